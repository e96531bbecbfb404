"""Land parallel to the ground: the trim with which a sled turns until it lands as the ground there slopes."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.simulation.scene import Profile, vertices_of

Floats = NDArray[np.float64]

_TURN: Final = 2.0 * np.pi
_PLACES: Final = 400  # along a flight at which it may land
_LONGEST: Final = 3.0  # [s] that is looked ahead


class Agent:
    """Turns the body so that it has the pose of the ground where its mass centre comes as low as it is when it lies.

    The mass centre flies a parabola, and the spin does not change: closed forms tell where the flight ends and which
    spin ends it parallel to the ground, up to whole turns. What it leaves out is a part that touches before.
    """

    def __init__(self, problem: Problem) -> None:
        problem.must_be("descent", "land_parallel")
        self._task = problem.task

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Nothing to learn."""
        return cls(problem)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Nothing to load."""
        return cls(problem)

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        task, rider = self._task, self._task.scenario.rider
        if rider is None:
            return np.zeros((len(observations), 1), np.float32)
        contexts, seen = task.contexts_seen(observations), task.flights_seen(observations)
        angle, gravity = contexts[:, :1], task.scenario.slope_section.gravity_m_s2
        x, y, phi, u, v, omega = seen.states.T[..., np.newaxis]
        time = np.linspace(0.0, _LONGEST, _PLACES + 1)[1:]
        along = x + (u + 0.5 * gravity * np.sin(angle) * time) * time
        above = y + (v - 0.5 * gravity * np.cos(angle) * time) * time
        ground = [_ground(*each) for each in zip(seen.profiles, along, strict=True)]
        heights, pitches = (np.array(each) for each in zip(*ground, strict=True))
        lying = task.support_heights(contexts, np.zeros(len(contexts)))[:, np.newaxis]
        clear = (above - heights) * np.cos(pitches) > lying
        falls = v - gravity * np.cos(angle) * time < u * np.tan(pitches)  # towards the ground
        lands = np.argmax(~clear & falls, axis=1)[:, np.newaxis]
        time, pitch = time[lands], np.take_along_axis(pitches, lands, axis=1)
        turn = pitch - phi
        wanted = (turn - _TURN * np.rint((turn - omega * time) / _TURN)) / time
        trims = (wanted - omega)[:, 0] + seen.lent
        return np.asarray(np.clip(trims / rider.trim_rad_s, -1.0, 1.0)[:, np.newaxis], np.float32)


def _ground(profile: Profile, x: Floats) -> tuple[Floats, Floats]:
    """Return height [m] and pitch [rad] of the ground at places [m], shapes (n,)."""
    if not profile:
        return np.zeros_like(x), np.zeros_like(x)
    vertices = vertices_of(profile)
    slopes = np.concatenate([[0.0], np.diff(vertices[:, 1]) / np.diff(vertices[:, 0]), [0.0]])
    return np.interp(x, *vertices.T[:2]), np.arctan(slopes[np.searchsorted(vertices[:, 0], x)])
