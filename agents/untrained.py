"""Agents that have nothing to learn and keep nothing: made of the problem alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

from sledenv.benchmark.problem import Problem


class Untrained:
    """Trained and loaded by making it.

    Parameters
    ----------
    problem : Problem
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Nothing to learn."""
        return cls(problem)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Nothing to load."""
        return cls(problem)
