"""A critic proposes landings, a model of the descent tries them: the launch that does best there is taken."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from sledenv.benchmark.problem import Problem
from sledenv.scenarios.configuration import read_yaml, write_yaml

from . import critic
from .uniform_lookups import Floats, Model, best_of, checked_lookups

_FILE: Final = "lookups.yaml"
APART: Final = 0.1  # of proposals, where the box is 2 wide: nearer ones would fail for the same reason
LEAST_PROPOSALS: Final = 4
NEAR: Final = 0.03  # standard deviation of the landings tried around the best of them


class Proposer(critic.Agent):
    """A critic that proposes more than one landing."""

    def rate(self, observations: NDArray[np.float32], landings: Floats) -> Floats:
        """Return what the critic expects of landings of shape (n, m, k), shape (n, m)."""
        return self._critic.rate(observations, landings.astype(np.float32)).astype(np.float64)

    def proposals(self, observations: NDArray[np.float32], count: int, apart: float) -> Floats:
        """Return different landings that the critic rates highly, the one that it would do first.

        Parameters
        ----------
        observations : ndarray, shape (n, 11)
        count : int
            At most 1,024.
        apart : float
            Least distance of any two in one entry, where the box is 2 wide. If there is room for fewer, the others
            are nearer.

        Returns
        -------
        ndarray, shape (n, count, k)
        """
        box = np.broadcast_to(self._box, (len(observations), *self._box.shape))
        landings = np.concatenate([self._landings(observations)[:, np.newaxis], box], axis=1)
        rated = self._critic.rate(observations, landings.astype(np.float32))
        rated[:, 0] = np.inf
        found = np.empty((len(landings), count, landings.shape[2]))
        for one, ratings, chosen in zip(landings, rated, found, strict=True):
            left = ratings.copy()
            for i in range(count):
                if left.max() == -np.inf:
                    left = np.where((one[:, np.newaxis] == chosen[:i]).all(axis=2).any(axis=1), -np.inf, ratings)
                chosen[i] = one[left.argmax()]
                left[np.abs(one - chosen[i]).max(axis=1) < apart] = -np.inf
        return found


class Agent:
    """Tries half of its candidates, four at least, where the critic rates highest, the others around the best."""

    def __init__(self, problem: Problem, proposer: Proposer, lookups: int) -> None:
        self._problem, self._proposer, self._lookups = problem, proposer, checked_lookups(lookups)

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Train a critic.

        Parameters
        ----------
        problem : Problem
        settings : dict
            Those of the critic, and ``lookups``, the descents of the model before each launch.
        seed : int
        folder : Path

        Raises
        ------
        ValueError
            If there are fewer than eight lookups; nothing is trained then.
        """
        settings = dict(settings)
        lookups = checked_lookups(settings.pop("lookups"))
        write_yaml(folder / _FILE, {"lookups": lookups})
        return cls(problem, Proposer.train(problem, settings, seed, folder), lookups)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the critic of a run."""
        lookups = read_yaml(folder / _FILE)["lookups"]
        return cls(problem, Proposer.load(problem, folder), lookups)

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        model = Model(self._problem, self._lookups, observations)
        count = min(model.candidates, max(LEAST_PROPOSALS, model.candidates // 2))
        landings = self._proposer.proposals(observations, count, APART)
        rewards = model.expect(landings)
        rest = model.candidates - count
        if rest:
            cloud = qmc.MultivariateNormalQMC(np.zeros(self._problem.actions), rng=np.random.default_rng(0)).random(
                rest
            )
            around: Floats = self._problem.inside(best_of(landings, rewards)[:, np.newaxis] + NEAR * cloud)
            landings = np.concatenate([landings, around], axis=1)
            rewards = np.concatenate([rewards, model.expect(around)], axis=1)
        return model.choose(landings, rewards, self._proposer.rate(observations, landings))
