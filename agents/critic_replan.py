"""The launch that a critic rates best, and at every rebound the trim that a simulation of the descent rewards most."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.scenarios.configuration import read_yaml, write_yaml

from . import critic, replan

_FILE = "trims.yaml"


class Agent(replan.Replanner):
    """Launches as the agent critic does, and looks ahead at every rebound as the agent replan does."""

    def __init__(self, problem: Problem, trims: int, launch: critic.Agent) -> None:
        super().__init__(problem, trims)
        self._critic = launch

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Train a critic of launches.

        Parameters
        ----------
        problem : Problem
        settings : dict
            Those of the critic, and ``trims``, how many are tried at each rebound.
        seed : int
        folder : Path
        """
        settings = dict(settings)
        trims = int(settings.pop("trims"))
        write_yaml(folder / _FILE, {"trims": trims})
        return cls(problem, trims, critic.Agent.train(problem.launch_alone(), settings, seed, folder))

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the critic of a run."""
        trims = read_yaml(folder / _FILE)["trims"]
        return cls(problem, trims, critic.Agent.load(problem.launch_alone(), folder))

    def _launches(self, observations: NDArray[np.float32]) -> NDArray[Any]:
        return self._critic.act(observations)
