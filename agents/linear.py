"""Linear policies, and what the searches for their weights share: the map to actions, the judging, the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import Contexts
from sledenv.envs.task import Task
from sledenv.scenarios.configuration import read_yaml, write_yaml
from sledenv.scenarios.sections import CONTROLS

Floats = NDArray[np.float64]

_FILE = "weights.yaml"


def size(task: Task) -> int:
    """Number of weights: of each output one for every field that is seen, and a constant."""
    return _outputs(task) * (1 + int(task.varies.sum()))


def actions(task: Task, weights: Floats, observations: NDArray[np.float32]) -> Floats:
    """Return what policies do.

    What turns round, an orientation, is a direction: the angle of two outputs counted from the middle of its bounds, so
    that bounds a full turn apart have no seam. All else is one output. Both end at the bounds.

    Parameters
    ----------
    task : Task
    weights : ndarray, shape (m, size)
        Of m policies.
    observations : ndarray, shape (n, 11)

    Returns
    -------
    ndarray, shape (m, n, k)
    """
    seen = np.column_stack([np.ones(len(observations)), observations[:, task.varies]])
    outputs = np.einsum("moi,ni->omn", weights.reshape(len(weights), _outputs(task), -1), seen)
    left, columns = iter(outputs), []
    for name in task.controlled:
        column = next(left)
        if CONTROLS[name].turn:
            low, high = task.scenario.control_bounds[name]
            angle = np.arctan2(next(left), 1.0 + column)  # without weights: the middle
            column = angle / np.pi * (CONTROLS[name].turn / (high - low))
        columns.append(column)
    clipped: Floats = np.clip(np.stack(columns, axis=-1), -1.0, 1.0)
    return clipped


class Judge:
    """Mean rewards of policies on training contexts, and how many descents they have cost."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self.descents = 0

    def __call__(self, weights: Floats, contexts: Contexts) -> Floats:
        """Return the mean reward of each policy.

        Parameters
        ----------
        weights : ndarray, shape (m, size)
        contexts : ndarray, shape (n, 12)
            The same for all policies; where launches are noisy, each has one draw of the noise.

        Returns
        -------
        ndarray, shape (m,)
        """
        disturbed = self._problem.drawn(contexts, "validation")
        chosen = actions(self._problem.task, weights, self._problem.task.observe(contexts))
        self.descents += chosen[..., 0].size
        repeated = np.tile(disturbed, (len(weights), 1))
        rewards = self._problem.descend(repeated, chosen.reshape(len(repeated), -1)).jam.reward
        means: Floats = rewards.reshape(len(weights), -1).mean(axis=1)
        return means


class Linear:
    """Acts by the weights that a search has found."""

    def __init__(self, problem: Problem, weights: Floats) -> None:
        self._task = problem.task
        self.weights = weights

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Search with a budget of ``n_timesteps`` descents, and keep the weights."""
        judge = Judge(problem)
        weights = cls.search(problem, judge, settings, seed)
        content = {"descents": judge.descents, "weights": weights.tolist()}
        write_yaml(folder / _FILE, content)
        return cls(problem, weights)

    @classmethod
    def search(cls, problem: Problem, judge: Judge, settings: dict[str, Any], seed: int) -> Floats:
        """Return weights of shape (size,)."""
        raise NotImplementedError

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the weights of a run."""
        return cls(problem, np.array(read_yaml(folder / _FILE)["weights"]))

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.asarray(actions(self._task, self.weights[np.newaxis], observations)[0], np.float32)


def _outputs(task: Task) -> int:
    return sum(2 if CONTROLS[name].turn else 1 for name in task.controlled)
