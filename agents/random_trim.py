"""The launch of no_trim with random trims: the floor that trimming has to leave."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem

from . import no_trim, random_launch


class Agent:
    """Launches as the agent no_trim does, and draws every trim uniformly."""

    def __init__(self, launch: no_trim.Agent, trim: random_launch.Agent) -> None:
        self._launch = launch
        self._trim = trim

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Search the launch, and keep the seed of the trims."""
        launch = no_trim.Agent.train(problem, settings, seed, folder)
        return cls(launch, random_launch.Agent.train(problem, {}, seed, folder))

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the launch of a run, and start again from its seed."""
        return cls(no_trim.Agent.load(problem, folder), random_launch.Agent.load(problem, folder))

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        actions = self._launch.act(observations)
        actions[:, -1] = self._trim.act(observations)[:, -1]
        return actions
