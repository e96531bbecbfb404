"""The zero action: the middle of the control bounds, or no trim, whatever the context."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem


class Agent:
    """Launches upright and without spin where the bounds are symmetric; leaves the rotor of a ride at rest."""

    def __init__(self, problem: Problem) -> None:
        self._actions = problem.actions

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Nothing to learn."""
        return cls(problem)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Nothing to load."""
        return cls(problem)

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.zeros((len(observations), self._actions), np.float32)
