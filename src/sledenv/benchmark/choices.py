"""What trained agents choose in contexts, as marks of a page that simulates: ``sledenv map --html --run``."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from sledenv.benchmark.figures import label, look
from sledenv.benchmark.landscape import agent_words, chosen, load_choosers, physical, plain_agents
from sledenv.benchmark.problem import Problem
from sledenv.pages.play import Mark
from sledenv.scenarios.scenario import Scenario, ScenarioError
from sledenv.scenarios.sections import CONTROLS


class Choices(NamedTuple):
    """What agents choose in one context."""

    marks: tuple[Mark, ...]
    words: str
    plain: list[dict[str, Any]]  # of plain_agents


def choices(
    scenario: Scenario, seeds: Sequence[int], runs: Sequence[Path], progress: Callable[[str], None] | None = None
) -> dict[int, Choices]:
    """Return what trained agents choose in the contexts of seeds, as drawn in ``sledenv simulate``.

    ``progress`` is told each context before the agents are asked.

    Raises
    ------
    FileNotFoundError, ValueError
        If a folder is no finished run.
    ScenarioError
        If a run is of another scenario, or of agents that choose something else or trim.
    """
    problem = Problem(scenario)
    choosers = load_choosers(problem, runs)
    for chooser in choosers:
        if chooser.problem.environment != "launch":
            raise ScenarioError(f"agent {chooser.name}: trims every hop, but a map plays launches that are left alone")
    found = {}
    for seed in seeds:
        if progress is not None:
            names = ", ".join(f"{one.name}, seed {one.seed}" for one in choosers)
            progress(f"{scenario.id}, context of seed {seed}: asking {names}")
        results = chosen(problem, np.array([scenario.sample(np.random.default_rng(seed))]), choosers)
        words = "\n".join(agent_words(problem, results))
        found[seed] = Choices(_marks(problem, results), words, plain_agents(problem, results))
    return found


def _marks(problem: Problem, results: pd.DataFrame) -> tuple[Mark, ...]:
    """Return the launches of a table of :func:`sledenv.benchmark.landscape.chosen`, in SI units."""
    found = []
    for _, row in results.iterrows():
        launch = {}
        for i, control in enumerate(problem.task.controlled):
            value = float(physical(problem, control, row[f"action_{i}"]))
            launch[control] = math.radians(value) if CONTROLS[control].unit == "deg" else value
        name = label(row["agent"])
        several = (results["agent"] == row["agent"]).sum() > 1
        title = f"{name}, seed {row['seed']}" if several else name
        found.append(Mark(title, name[0].upper(), look(row["agent"], results)[0], launch, float(row["reward"])))
    return tuple(found)
