"""The jam map of contexts as one HTML page that simulates every launch: ``sledenv map --html``."""

from __future__ import annotations

import importlib.util
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd
from tqdm import tqdm

from sledenv.benchmark.figures import label, look
from sledenv.benchmark.landscape import load_choosers, marked, physical, plain_marks, words
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import TRAINED, read_config
from sledenv.pages.play import Mark, Played, play_page
from sledenv.scenarios.scenario import Scenario, ScenarioError
from sledenv.scenarios.sections import BOTH, CONTROLS

MOST_SEEDS: Final = 24  # contexts of a page


class MapPage(NamedTuple):
    """A page, and what it marks in words."""

    html: str
    words: str
    marks: list[dict[str, Any]]  # of plain_marks, one a context


def map_page(
    scenario: str | os.PathLike[str] | Scenario, seeds: Sequence[int], runs: Sequence[Path] | None = None
) -> MapPage:
    """Return the page that simulates (docs/browser.md) with the best launch of contexts and what agents choose.

    Its maps are over the first two things that are chosen, or over orientation and spin if only one is.

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    seeds : sequence of int
        Which contexts are drawn, as in ``sledenv simulate``: from 1 to ``MOST_SEEDS``, all different.
    runs : sequence of Path, optional
        Folders of trained agents, whose choices are marked; the shipped ones by default, if torch is installed.

    Raises
    ------
    FileNotFoundError, ValueError
        If the seeds are wrong or a folder is no finished run.
    ScenarioError
        If a run is of another scenario, or of agents that choose something else or trim.
    """
    if not 1 <= len(seeds) <= MOST_SEEDS or len(set(seeds)) < len(seeds):
        raise ValueError(f"seeds = {list(seeds)}: must be 1 to {MOST_SEEDS} integers, all different")
    problem = Problem(scenario)
    choosers = load_choosers(problem, _shipped_runs(problem) if runs is None else runs)
    for chooser in choosers:
        if chooser.problem.environment != "launch":
            raise ScenarioError(f"agent {chooser.name}: trims every hop, but a map plays launches that are left alone")
    told, marks, contexts = [], [], []
    for seed in tqdm(seeds, desc="best launches", unit="context", leave=False, disable=None):  # where a terminal is
        context = problem.scenario.sample(np.random.default_rng(seed))
        best, results = marked(problem, np.array([context]), choosers)
        contexts.append(Played(f"seed {seed}", context, tuple(_marks(problem, best, results))))
        marks.append(plain_marks(problem, seed, best, results))
        told.append((f"context of seed {seed}\n" if len(seeds) > 1 else "") + words(problem, best, results))
    first, *others = problem.task.controlled
    axes = (first, others[0]) if others else BOTH
    return MapPage(play_page(problem.scenario, contexts, axes=axes), "\n\n".join(told), marks)


def _shipped_runs(problem: Problem) -> list[Path]:
    """Folders of the shipped agents of a problem, none where they cannot be loaded."""
    if importlib.util.find_spec("torch") is None:
        return []
    folders = sorted(TRAINED.glob(f"{problem.scenario.id}-{problem.environment}-{problem.control}-*"))
    return [folder for folder in folders if read_config(folder)["scenario_hash"] == problem.scenario.hash]


def _marks(problem: Problem, best: pd.Series, results: pd.DataFrame) -> list[Mark]:
    """Return the best launch and what agents choose, in SI units."""

    def mark(name: str, sign: str, colour: str, row: pd.Series) -> Mark:
        launch = {}
        for i, control in enumerate(problem.task.controlled):
            value = float(physical(problem, control, row[f"action_{i}"]))
            launch[control] = math.radians(value) if CONTROLS[control].unit == "deg" else value
        return Mark(name, sign, colour, launch, float(row["reward"]))

    found = [mark("best launch", "★", "#ffffff", best)]
    for _, row in results.iterrows():
        name = label(row["agent"])
        several = (results["agent"] == row["agent"]).sum() > 1
        title = f"{name}, seed {row['seed']}" if several else name
        found.append(mark(title, name[0].upper(), look(row["agent"], results)[0], row))
    return found
