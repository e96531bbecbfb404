"""The best single launch for all contexts and no trim afterwards: what trims have to improve on."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem

from . import best_fixed


class Agent:
    """Launches as the agent best_fixed does, and leaves the rotor at rest."""

    def __init__(self, launch: best_fixed.Agent) -> None:
        self._launch = launch

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Search the launch as the agent best_fixed does, from whole descents."""
        return cls(best_fixed.Agent.train(problem.launch_alone(), settings, seed, folder))

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the launch of a run."""
        return cls(best_fixed.Agent.load(problem.launch_alone(), folder))

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.column_stack([self._launch.act(observations), np.zeros(len(observations), np.float32)])
