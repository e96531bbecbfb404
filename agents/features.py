"""The inputs of a critic: besides the observation what closed forms tell of the next touch with each action."""

from __future__ import annotations

from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.scenarios.scenario import Context
from sledenv.simulation.bodies import Body
from sledenv.simulation.outlook import PLACES
from sledenv.simulation.support import support_heights

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]

_TURNS: Final = np.array([1, 2, 4, 6, 8, 12, 16])  # harmonics of the pose at the touch
_TILT: Final = 0.1  # [rad] at which a body touches with an end
_HALVINGS: Final = 16  # of the time of flight: a network needs no more digits
_TURN: Final = 1e-4  # [rad] by which an arm is a difference
_SHAPE: Final = Context._fields.index("shape")


class Features(Protocol):
    """Inputs of a network, of observations and of actions."""

    width: int  # of those of an action
    error: float  # standard deviation with which an action is missed, 0 where nobody sees what was done

    def done(self, actions: Floats, after: Floats) -> Floats:
        """Return what was done where such actions were asked for, shape (n, k), as what is seen after them tells."""
        ...

    def of_actions(self, observations: Floats, actions: Floats) -> Floats:
        """Return the inputs of actions of shape (n, m, k), as (n, m, width), in what is seen, shape (n, j)."""
        ...


def features_of(problem: Problem) -> Features:
    """Return the inputs that suit a problem."""
    return RideFeatures(problem) if problem.environment == "descent" else LaunchFeatures(problem)


class RideFeatures:
    """Tells a trim by the landing: pose and spin with it, and how high both ends of the body are over the ground.

    The ground around a landing, and when and where it is, do not depend on the trim: they are columns of the
    observation ("landing").

    Raises
    ------
    ValueError
        If the observations of the problem have no context, no state or no landing.
    """

    def __init__(self, problem: Problem) -> None:
        task, rider = problem.task, problem.scenario.rider
        for group in ("context", "state", "landing"):
            if group not in task.groups:
                raise ValueError(f"columns = {task.groups!r}: must have {group!r}, which the critic of rides reads")
        self._task = task
        self._most = np.float32(0.0 if rider is None else rider.trim_rad_s)
        self.error = 0.0 if rider is None else rider.noise_rad_s / rider.trim_rad_s
        self._ends = np.array([_ends(body) for body in task.bodies], np.float32)
        self._lying = np.array([support_heights(body, np.zeros(1))[0] for body in task.bodies], np.float32)
        self._places = np.sort(np.append(PLACES, 0.0)).astype(np.float32)
        self.width = 3 + 2 * len(_TURNS) + 6

    def done(self, actions: Floats, after: Floats) -> Floats:
        if self.error == 0.0:
            return actions
        lent: Floats = self._task.columns.values(after)["trim"][:, np.newaxis].astype(np.float32) / self._most
        return lent

    def of_actions(self, observations: Floats, actions: Floats) -> Floats:
        seen = self._task.columns.values(observations)
        time, pitch, pose, spin = (
            seen[f"landing_{name}"].astype(np.float32)[:, np.newaxis] for name in ("time", "pitch", "pose", "spin")
        )
        heights = np.stack([seen.get(f"landing_height_{place:+g}", 0.0 * time[:, 0]) for place in self._places], axis=1)
        body = self._task.contexts_seen(observations)[:, _SHAPE].astype(int)
        trims = actions[..., 0]
        lent = self._most * trims
        turned = pose + lent * time  # less the angle of the ground
        angle = turned + pitch
        columns = [trims, spin + lent, angle, *_harmonics(turned)]
        cosine, sine = np.cos(angle), np.sin(angle)
        over = self._lying[body][:, np.newaxis] / np.cos(pitch)  # of the mass centre
        for ahead, up in self._ends[body].transpose(1, 2, 0)[..., np.newaxis]:
            below, rise = _between(self._places, heights.astype(np.float32), ahead * cosine - up * sine)
            columns += [over + ahead * sine + up * cosine - below, rise - pitch, rise - angle]
        return np.stack(columns, axis=-1, dtype=np.float32)


class LaunchFeatures:
    """Tells a launch by its first touch on a plane: pose, time, arms of the contact, approach, slip and spin."""

    error = 0.0

    def __init__(self, problem: Problem) -> None:
        self._task = problem.task
        self._gravity = problem.scenario.slope_section.gravity_m_s2
        self.width = problem.actions + 2 * len(_TURNS) + 6

    def done(self, actions: Floats, after: Floats) -> Floats:
        return actions

    def of_actions(self, observations: Floats, actions: Floats) -> Floats:
        task, (lanes, many, width) = self._task, actions.shape
        seen = np.repeat(task.contexts_seen(observations), many, axis=0)
        contexts = task.chosen(seen, actions.reshape(-1, width).astype(np.float64))
        angle, speed, drop, fall, orientation, spin = (
            contexts[:, Context._fields.index(name)]
            for name in ("angle", "speed", "drop", "fall", "orientation", "spin")
        )
        across, along = self._gravity * np.cos(angle), self._gravity * np.sin(angle)
        height = drop + task.support_heights(contexts, orientation)
        early, late = np.zeros_like(height), fall_time(height, fall, across)
        for _ in range(_HALVINGS):
            time = 0.5 * (early + late)
            above = height - (fall + 0.5 * across * time) * time > task.support_heights(
                contexts, orientation + spin * time
            )
            early, late = np.where(above, time, early), np.where(above, late, time)
        pose = orientation + spin * late
        ahead, arm, behind = (task.support_heights(contexts, pose + turn) for turn in (_TURN, 0.0, -_TURN))
        lever = (ahead - behind) / (2.0 * _TURN)
        approach, slip = -(fall + across * late) - lever * spin, speed + along * late + arm * spin
        columns = [*actions.reshape(-1, width).T, *_harmonics(pose), late, arm, lever, approach, slip, spin]
        return np.stack(columns, axis=-1, dtype=np.float32).reshape(lanes, many, -1)


def fall_time(height: Doubles, fall: Doubles, gravity: Doubles) -> Doubles:
    """Return the time [s] after which a body has fallen by a height [m]; 0 if it is not above or never falls."""
    height = np.maximum(height, 0.0)
    root = fall + np.sqrt(np.square(fall) + 2.0 * gravity * height)
    return np.divide(2.0 * height, root, out=np.zeros_like(height), where=root > 0.0)


def _harmonics(angles: NDArray[np.floating]) -> list[NDArray[np.floating]]:
    return [part(turns * angles) for turns in _TURNS for part in (np.sin, np.cos)]


def _between(places: Floats, heights: Floats, x: Floats) -> tuple[Floats, Floats]:
    """Return heights and angles at x of shape (n, m) of ground whose heights at places are given, shape (n, k)."""
    i = np.clip(np.searchsorted(places, x) - 1, 0, len(places) - 2)
    low, high = np.take_along_axis(heights, i, axis=1), np.take_along_axis(heights, i + 1, axis=1)
    rise = (high - low) / (places[i + 1] - places[i])
    return low + rise * (x - places[i]), np.arctan(rise)


def _ends(body: Body) -> list[tuple[float, float]]:
    """Return the points with which a body touches a plane when tilted either way, [m] ahead and up in its axes."""
    ends = []
    for tilt in (_TILT, -_TILT):
        low, height, high = support_heights(body, np.array([tilt - 1e-4, tilt, tilt + 1e-4])).tolist()
        beside, cosine, sine = (low - high) / 2e-4, np.cos(tilt), np.sin(tilt)
        ends.append((beside * cosine - height * sine, -beside * sine - height * cosine))
    return ends
