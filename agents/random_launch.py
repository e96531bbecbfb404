"""A uniformly random action, whatever the context: the floor that learning has to leave."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.scenarios.configuration import read_yaml, write_yaml

_FILE = "random.yaml"


class Agent:
    """Draws each action uniformly from the box; the seed is that of the run."""

    def __init__(self, problem: Problem, seed: int) -> None:
        self._actions = problem.actions
        self._rng = np.random.default_rng(seed)

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Keep the seed."""
        write_yaml(folder / _FILE, {"seed": seed})
        return cls(problem, seed)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Start again from the seed of the run."""
        return cls(problem, read_yaml(folder / _FILE)["seed"])

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        return self._rng.uniform(-1.0, 1.0, (len(observations), self._actions)).astype(np.float32)
