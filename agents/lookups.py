"""What agents share that try a launch in a model of the descent before they choose it: K descents a context."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.landing import Landing
from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import Contexts

Floats = NDArray[np.float64]

LEAST: Final = 8  # descents that a search can do with
_SEED: Final = 9  # of draws that nobody is judged by


class Model:
    """A model of the descents of contexts that an agent sees, with draws of the tremble of its own.

    What is hidden is drawn too. Half as many draws as the root of the descents leave the other factor to candidates:
    each candidate is tried with all draws, the same for all.

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
        draws = (
            round(0.5 * math.sqrt(checked_lookups(lookups))) if problem.noise.any() or problem.task.hidden.any() else 1
        )
        self.candidates = lookups // draws
        self._problem, self._landing = problem, Landing(problem)
        self._contexts: Contexts = problem.task.contexts_seen(observations)
        self._scenes = problem.scenes(self._contexts, draws, (_SEED,))

    def launches(self, landings: Floats) -> Floats:
        """Return the launches of landings of shape (n, m, k), of the same shape."""
        rows = np.repeat(self._contexts, landings.shape[1], axis=0)
        return self._landing.launches(rows, landings.reshape(-1, landings.shape[2])).reshape(landings.shape)

    def expect(self, landings: Floats) -> Floats:
        """Return the mean rewards of landings of shape (n, m, k) over the draws, shape (n, m)."""
        return self._problem.expect(self._scenes, self.launches(landings))


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
