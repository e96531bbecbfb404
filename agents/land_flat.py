"""Land upright, and rolling where friction would hold a sled: what closed forms say without any simulation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import Contexts
from sledenv.envs.task import Task

from .features import fall_time
from .untrained import Untrained

Floats = NDArray[np.float64]

_TURN: Final = 2.0 * np.pi
_HALVINGS: Final = 60  # of the time of flight: down to rounding


class Agent(Untrained):
    """Puts the mass centre straight below the centre of the arc at the first touch: the normal impulse has no arm then.

    That is phi_1 = phi_0 + omega t = 0 after a flight of t, up to whole turns. Where friction holds what slides,
    f > tan(beta), it should not slip: u + s(0) omega = 0 with u = speed + g sin(beta) t. Elsewhere it gains speed by
    sliding, and a spin would cost energy: omega = 0. The agent solves these for the orientation and the spin, as far as
    it controls them and the bounds allow; of the spin without the orientation, being upright comes first. All else that
    it controls, such as the speed, is in the middle of its bounds. A touch in another pose on the way is left out, and
    so are all contacts after the first. A body that is no segment lands with phi_1 = 0 too.
    """

    def __init__(self, problem: Problem) -> None:
        problem.must_be("launch", "land_flat")
        super().__init__(problem)
        self._gravity = problem.scenario.slope_section.gravity_m_s2

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        task = self.problem.task
        names = task.controlled
        actions = np.zeros((len(observations), len(names)))
        contexts = task.chosen(task.contexts_seen(observations), actions)  # all that is chosen in the middle
        angle, friction, _, speed, drop, fall, orientation, spin, *_ = contexts.T
        spins = task.bounds["spin"]
        upright = task.support_heights(contexts, np.zeros_like(drop))
        along = self._gravity * np.sin(angle)

        def wanted(time: Floats) -> Floats:
            rolling = -(speed + along * time) / upright
            return np.asarray(np.clip(np.where(friction > np.tan(angle), rolling, 0.0), *spins))

        solved = {}
        if "orientation" in names:
            # The pose decides how far the body falls, and the time that it falls decides the pose.
            spun = wanted if "spin" in names else lambda _: spin
            time = _flight_time(task, contexts, spun, self._gravity)
            solved = {"orientation": _turned(-spun(time) * time, task.bounds["orientation"]), "spin": spun(time)}
        elif "spin" in names:
            height = drop + task.support_heights(contexts, orientation) - upright
            time = fall_time(height, fall, self._gravity * np.cos(angle))
            solved = {"spin": _spin(orientation, time, wanted(time), spins)}
        for name in names:
            if name in solved:
                low, high = task.bounds[name]
                actions[:, names.index(name)] = 2.0 * (solved[name] - low) / (high - low) - 1.0
        return np.asarray(np.clip(actions, -1.0, 1.0), np.float32)


def _flight_time(task: Task, contexts: Contexts, spin: Callable[[Floats], Floats], gravity: float) -> Floats:
    """Return how long [s] bodies fly that land upright with spins [rad/s] that depend on that time.

    One launched with phi_0 = -omega t has fallen by drop + s(phi_0) - s(0), s being the support height.
    """
    angle, _, _, _, drop, fall, *_ = contexts.T
    normal, upright = gravity * np.cos(angle), task.support_heights(contexts, np.zeros_like(drop))
    highest = drop + max(body.size for body in task.bodies)
    low, high = np.zeros_like(drop), fall_time(highest, fall, normal)
    for _ in range(_HALVINGS):
        time = 0.5 * (low + high)
        late = fall_time(drop + task.support_heights(contexts, -spin(time) * time) - upright, fall, normal) > time
        low, high = np.where(late, time, low), np.where(late, high, time)
    return np.asarray(0.5 * (low + high))


def _turned(angle: Floats, bounds: Floats) -> Floats:
    """Add the whole turns that bring angles nearest to the middle of the bounds."""
    turns: Floats = np.rint((angle - bounds.mean()) / _TURN)
    return angle - _TURN * turns


def _spin(orientation: Floats, time: Floats, wanted: Floats, bounds: Floats) -> Floats:
    """Return the spins [rad/s] that end upright, up to whole turns, and are nearest to those wanted."""
    turns = -orientation / _TURN
    with np.errstate(divide="ignore", invalid="ignore"):
        nearest = np.rint(wanted * time / _TURN - turns)
        least, most = np.ceil(bounds[0] * time / _TURN - turns), np.floor(bounds[1] * time / _TURN - turns)
        spins = _TURN * (turns + np.clip(nearest, least, np.maximum(least, most))) / time
    return np.where(time > 0.0, np.clip(spins, *bounds), wanted)
