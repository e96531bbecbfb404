"""Landings all over the box, tried in a model of the descent: what a search without an agent finds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from sledenv.benchmark.landing import Landing
from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import Contexts
from sledenv.scenarios.configuration import read_yaml, write_yaml

Floats = NDArray[np.float64]

_FILE: Final = "lookups.yaml"
LEAST: Final = 8  # descents that a search can do with
FINALISTS: Final = 4  # candidates that are judged again
RATING: Final = 4.0  # draws that the rating of a critic counts for: without it few draws choose whoever was lucky
_SEED: Final = 9  # of draws that nobody is judged by


class Agent:
    """Takes the best of quasi-random landings, the same in every context."""

    def __init__(self, problem: Problem, lookups: int) -> None:
        self._problem, self._lookups = problem, checked_lookups(lookups)

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Keep ``lookups``, the descents of the model before each launch; there is nothing to learn.

        Raises
        ------
        ValueError
            If they are fewer than eight.
        """
        agent = cls(problem, settings["lookups"])
        write_yaml(folder / _FILE, settings)
        return agent

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the settings of a run."""
        return cls(problem, read_yaml(folder / _FILE)["lookups"])

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        model, width = Model(self._problem, self._lookups, observations), self._problem.actions
        points = qmc.Sobol(width, rng=np.random.default_rng(0)).random_base2((model.candidates - 1).bit_length())
        landings = np.tile(2.0 * points[: model.candidates] - 1.0, (len(observations), 1, 1))
        return model.choose(landings, model.expect(landings))


class Model:
    """A model of the descents of contexts that an agent sees, with draws of the launch noise of its own.

    Half of the descents try candidates, all with the same few draws. The other half judges the best of these again,
    with new draws: who is best of many by few draws is so by luck in part. What is hidden is drawn too. Where nothing
    is drawn, all descents try candidates.

    Parameters
    ----------
    problem : Problem
    lookups : int
        Descents a context, at least 8.
    observations : ndarray, shape (n, 11)

    Attributes
    ----------
    candidates : int
        How many may be tried in each context.

    Raises
    ------
    ValueError
        For fewer descents.
    """

    def __init__(self, problem: Problem, lookups: int, observations: NDArray[np.float32]) -> None:
        self._problem, self._landing = problem, Landing(problem)
        self._contexts: Contexts = problem.task.contexts_seen(observations)
        self._uncertain = bool(problem.noise.any() or problem.task.hidden.any())
        half = checked_lookups(lookups) // 2
        self._draws = round(0.5 * math.sqrt(lookups)) if self._uncertain else 1
        self._draws_again = half // FINALISTS
        self.candidates = half // self._draws if self._uncertain else lookups

    def launches(self, landings: Floats) -> Floats:
        """Return the launches of landings of shape (n, m, k), of the same shape."""
        rows = np.repeat(self._contexts, landings.shape[1], axis=0)
        return self._landing.launches(rows, landings.reshape(-1, landings.shape[2])).reshape(landings.shape)

    def expect(self, landings: Floats) -> Floats:
        """Return the mean rewards of landings of shape (n, m, k), shape (n, m)."""
        return self._earned(landings, self._draws, 0)

    def choose(self, landings: Floats, rewards: Floats, ratings: Floats | None = None) -> NDArray[np.float32]:
        """Return the launch of the best of landings of shape (n, m, k) that earn ``rewards``, shape (n, k).

        What a critic expects of them, ``ratings`` of the shape of ``rewards``, counts beside what they earn.
        """
        if self._uncertain:
            rewards = self._draws * rewards + (0.0 if ratings is None else RATING * ratings)
            ranks = np.argsort(-rewards, axis=1, kind="stable")[:, :FINALISTS]
            landings, rewards = (
                np.take_along_axis(landings, ranks[..., np.newaxis], 1),
                np.take_along_axis(rewards, ranks, 1),
            )
            rewards = rewards + self._draws_again * self._earned(landings, self._draws_again, 1)
        return self.launches(best_of(landings, rewards)[:, np.newaxis])[:, 0].astype(np.float32)

    def _earned(self, landings: Floats, draws: int, number: int) -> Floats:
        return self._problem.expect(
            self._problem.scenes(self._contexts, draws, (_SEED, number)), self.launches(landings)
        )


def checked_lookups(lookups: Any) -> int:
    """Return a number of descents a context.

    Raises
    ------
    ValueError
        Unless it is a whole number from 8 on.
    """
    if type(lookups) is not int or lookups < LEAST:
        raise ValueError(f"lookups = {lookups!r}: must be a whole number of descents, at least {LEAST}")
    return lookups


def best_of(landings: Floats, rewards: Floats) -> Floats:
    """Return the landing of highest reward of each context, shape (n, k), of landings of shape (n, m, k)."""
    found: Floats = landings[np.arange(len(landings)), rewards.argmax(axis=1)]
    return found
