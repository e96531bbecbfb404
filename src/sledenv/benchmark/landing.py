"""Launches told by the pose of the body at its first touch, on which the rest of a descent depends most directly."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import Contexts
from sledenv.envs.task import highest_support
from sledenv.scenarios.scenario import Context

Floats = NDArray[np.float64]

_SHAPE: Final = Context._fields.index("shape")
_HALVINGS: Final = 60  # of the time of flight: down to rounding


class Landing:
    """Tells launches by the orientation at the first touch instead of that at the launch.

    A body with the spin omega that touches with phi_1 after a flight of t was launched with phi_0 = phi_1 - omega t. It
    has fallen by D = drop + s(phi_0) - s(phi_1), s being the support height, with D = fall t + G t^2 / 2 and
    G = g cos(beta). Launches that touch in the same pose lie on an oblique line of orientation and spin, whole turns of
    it in a long flight; told by the landing they lie side by side.

    It is a coordinate, not a forecast: a touch in another pose on the way is left out, and of several times of flight
    one is taken. Where the agent does not choose the orientation, or not out of a full turn, a landing is its launch.

    Parameters
    ----------
    problem : Problem
    """

    def __init__(self, problem: Problem) -> None:
        self._task = problem.task
        self._gravity = problem.scenario.slope_section.gravity_m_s2
        self._low, high = self._task.bounds["orientation"]
        self._half = 0.5 * (high - self._low)
        turning = dict(zip(self._task.controlled, problem.turns, strict=True))
        self._applies = turning.get("orientation", False)

    def launches(self, contexts: Contexts, landings: Floats) -> Floats:
        """Return the launches behind landings.

        Parameters
        ----------
        contexts : ndarray, shape (n, 12)
        landings : ndarray, shape (n, k)
            As actions, scaled to the control bounds of the scenario, but with the orientation at the first touch.

        Returns
        -------
        ndarray, shape (n, k)
            Actions in [-1, 1].
        """
        if not self._applies:
            return landings
        chosen = self._task.chosen(contexts, landings)
        pose, spin = (chosen[:, Context._fields.index(name)] for name in ("orientation", "spin"))
        phi = pose - spin * self.flight_time(chosen, pose, lambda _: spin)
        launches, column = landings.copy(), self._task.controlled.index("orientation")
        launches[:, column] = np.clip(((phi - self._low) / self._half) % 2.0 - 1.0, -1.0, 1.0)
        return launches

    def actions(self, observations: NDArray[np.float32], landings: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return :meth:`launches` from what an agent sees, observations of shape (n, 11)."""
        contexts = self._task.contexts_seen(observations)
        return np.asarray(self.launches(contexts, np.asarray(landings, np.float64)), np.float32)

    def flight_time(self, contexts: Contexts, pose: Floats, spin: Callable[[Floats], Floats]) -> Floats:
        """Return how long [s] bodies fly that touch in a pose.

        Parameters
        ----------
        contexts : ndarray, shape (n, 12)
        pose : ndarray, shape (n,)
            Orientation [rad] at the first touch.
        spin : callable
            From times of flight [s] to spins [rad/s], shapes (n,).

        Returns
        -------
        ndarray, shape (n,)
        """
        task = self._task
        angle, drop, fall = (contexts[:, Context._fields.index(name)] for name in ("angle", "drop", "fall"))
        normal = self._gravity * np.cos(angle)
        touching = task.support_heights(contexts, pose)
        highest = drop + np.array(list(map(highest_support, task.bodies)))[contexts[:, _SHAPE].astype(int)]
        low, high = np.zeros_like(drop), fall_time(highest, fall, normal)
        for _ in range(_HALVINGS):
            time = 0.5 * (low + high)
            height = drop + task.support_heights(contexts, pose - spin(time) * time) - touching
            late = fall_time(height, fall, normal) > time
            low, high = np.where(late, time, low), np.where(late, high, time)
        return 0.5 * (low + high)


def fall_time(height: Floats, fall: Floats, gravity: Floats) -> Floats:
    """Return the time [s] after which a body has fallen by a height [m]; 0 if it is not above or never falls."""
    height = np.maximum(height, 0.0)
    root = fall + np.sqrt(np.square(fall) + 2.0 * gravity * height)
    return np.divide(2.0 * height, root, out=np.zeros_like(height), where=root > 0.0)
