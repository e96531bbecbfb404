"""Landings all over the box, tried in a model of the descent: what a search without an agent finds."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, Self

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.stats import qmc

from sledenv.benchmark.problem import Problem

from .lookups import Model, checked_lookups

_FILE: Final = "lookups.yaml"


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
        (folder / _FILE).write_text(yaml.safe_dump(settings))
        return agent

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the settings of a run."""
        return cls(problem, yaml.safe_load((folder / _FILE).read_text())["lookups"])

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        model, width = Model(self._problem, self._lookups, observations), self._problem.actions
        points = qmc.Sobol(width, rng=np.random.default_rng(0)).random_base2((model.candidates - 1).bit_length())
        landings = np.tile(2.0 * points[: model.candidates] - 1.0, (len(observations), 1, 1))
        return model.choose(landings, model.expect(landings))
