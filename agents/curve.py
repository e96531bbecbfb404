"""The learning curve of a run: how an agent does on validation contexts, against descents and seconds."""

from __future__ import annotations

import csv
import time
from pathlib import Path
from typing import Final, NamedTuple

from sledenv.benchmark.problem import Agent, Problem
from sledenv.envs.inputs import Contexts

FILE: Final = "learning_curve.csv"
_CONTEXTS: Final = 512


class Check(NamedTuple):
    """How an agent does on the validation contexts."""

    mean_reward: float
    finished: float  # share of the descents


def validation(problem: Problem) -> Contexts:
    """Return the contexts on which a learning agent is judged, shape (n, 12) or (n, 14)."""
    return problem.drawn(problem.contexts("validation", _CONTEXTS), "validation")


class Curve:
    """Judges an agent while it learns, always on the same validation contexts, and writes the learning curve.

    Parameters
    ----------
    problem : Problem
    folder : Path
        Of the run; the file is begun.

    Attributes
    ----------
    descents : int
        How many had been learned from at the last check.
    """

    def __init__(self, problem: Problem, folder: Path) -> None:
        self._problem = problem
        self._contexts = validation(problem)
        self._path = folder / FILE
        self._begun = time.perf_counter()
        self._judging = 0.0
        self.descents = 0
        with self._path.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerow(["descents", "seconds", "mean_reward", "finished"])

    def check(self, agent: Agent, descents: int) -> Check:
        """Judge an agent that has learned from so many descents; seconds are those of learning, without the judging."""
        begun = time.perf_counter()
        batch, _ = self._problem.judge(agent, self._contexts)
        check = Check(float(batch.jam.reward.mean()), float((batch.status == "finish").mean()))
        seconds = begun - self._begun - self._judging
        with self._path.open("a", encoding="utf-8", newline="") as file:
            csv.writer(file).writerow([descents, f"{seconds:.2f}", *check])
        self._judging += time.perf_counter() - begun
        self.descents = descents
        return check
