"""What a critic sees of a landing: besides the context the first touch, which is known in closed form."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from sledenv.benchmark.landing import Landing, fall_time
from sledenv.benchmark.problem import Problem
from sledenv.scenarios.scenario import Context

Floats = NDArray[np.float32]

_CHOSEN: Final = 4  # harmonics of an orientation that is chosen: corners and chord are felt over a part of a turn
_TOUCHING: Final = 8  # of the pose at the touch
_HALVINGS: Final = 16  # of the time of flight: a network needs no more digits
_TURN: Final = 1e-4  # [rad] by which an arm is a difference
_SAMPLES: Final = 512  # launches that give the scales
_SHAPE: Final = Context._fields.index("shape")


class Touch:
    """Turns observations and landings into the inputs of a network.

    What follows a launch is decided at its first touch. A network that is told only the launch has to learn the flight
    and the outline of the body before anything else, and bodies that are merely numbered look as if they were ordered.
    The inputs are the observation; which body it is, a one among zeros; the landing; and the touch: pose, time of
    flight, both arms of the contact, approach, slip and spin.

    Parameters
    ----------
    problem : Problem

    Attributes
    ----------
    width : int
        Number of inputs.
    """

    def __init__(self, problem: Problem) -> None:
        self._task, self._turns = problem.task, problem.turns
        self._gravity = problem.scenario.slope_section.gravity_m_s2
        self._landing = Landing(problem)
        self._bodies = len(self._task.bodies) if self._task.varies[_SHAPE] else 0
        landings = 2.0 * qmc.Sobol(problem.actions, rng=np.random.default_rng(0)).random(_SAMPLES) - 1.0
        sample = self._touched(self._task.observe(self._task.scenes(problem.contexts("train", _SAMPLES))), landings)
        self._middle, self._scale = sample.mean(axis=0), np.where(np.ptp(sample, axis=0) > 0.0, sample.std(axis=0), 1.0)
        chosen = sum(2 * _CHOSEN if turning else 1 for turning in self._turns)
        self.width = self._task.observation_space.shape[0] + self._bodies + chosen + 2 * _TOUCHING + sample.shape[1] - 1

    def inputs(self, observations: Floats, landings: NDArray[np.floating]) -> Floats:
        """Return what a network sees of landings.

        Parameters
        ----------
        observations : ndarray, shape (n, 11)
        landings : ndarray, shape (n, k)

        Returns
        -------
        ndarray of float32, shape (n, width)
        """
        columns = [observations]
        if self._bodies:
            number = np.rint(0.5 * (observations[:, _SHAPE] + 1.0) * (self._bodies - 1)).astype(int)
            columns.append(np.eye(self._bodies, dtype=np.float32)[number])
        for entry, turning in zip(landings.T, self._turns, strict=True):
            columns += _directions(np.pi * entry, _CHOSEN) if turning else [entry[:, np.newaxis]]
        touch = self._touched(observations, np.asarray(landings, np.float64))
        columns += _directions(touch[:, 0], _TOUCHING)
        columns.append(((touch - self._middle) / self._scale)[:, 1:])
        return np.concatenate(columns, axis=1, dtype=np.float32)

    def _touched(self, observations: Floats, landings: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pose, time of flight, arms across and along, approach, slip and spin at the first touch, shape (n, 7)."""
        task = self._task
        seen = task.contexts_seen(observations)
        contexts = task.chosen(seen, self._landing.launches(seen, landings))
        angle, speed, drop, fall, orientation, spin = (
            contexts[:, Context._fields.index(name)]
            for name in ("angle", "speed", "drop", "fall", "orientation", "spin")
        )
        across, along = self._gravity * np.cos(angle), self._gravity * np.sin(angle)
        height = drop + task.support_heights(contexts, orientation)
        early, late = np.zeros_like(height), fall_time(height, fall, across)
        for _ in range(_HALVINGS):
            time = 0.5 * (early + late)
            left = height - (fall + 0.5 * across * time) * time
            above = left > task.support_heights(contexts, orientation + spin * time)
            early, late = np.where(above, time, early), np.where(above, late, time)
        pose = orientation + spin * late
        ahead, arm, behind = (task.support_heights(contexts, pose + turn) for turn in (_TURN, 0.0, -_TURN))
        lever = (ahead - behind) / (2.0 * _TURN)
        approach, slip = -(fall + across * late) - lever * spin, speed + along * late + arm * spin
        return np.stack([pose, late, arm, lever, approach, slip, spin], axis=1)


def _directions(angles: NDArray[np.floating], count: int) -> list[NDArray[np.floating]]:
    """Return sines and cosines of multiples of angles of shape (n,), shapes (n, count)."""
    multiples = angles[:, np.newaxis] * np.arange(1, count + 1)
    return [np.sin(multiples), np.cos(multiples)]
