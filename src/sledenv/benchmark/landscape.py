"""The best launch of a context and what trained agents choose, as a map or as marks of a page: ``sledenv map``."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from sledenv.benchmark.figures import label, look
from sledenv.benchmark.oracle import JamMap, best_launches, jam_map
from sledenv.benchmark.problem import Agent, Problem
from sledenv.benchmark.runs import agent_name, load_run
from sledenv.benchmark.scores import regrets
from sledenv.envs.inputs import Contexts
from sledenv.pages.play import Mark
from sledenv.plot.style import INK, plain, styled
from sledenv.scenarios.scenario import Scenario, ScenarioError
from sledenv.scenarios.sections import CONTROLS


class Landscape(NamedTuple):
    """Figure, words and marks of the launches of one context."""

    figure: Figure
    words: str
    marks: dict[str, Any]  # what it marks, as plain data


class _Chooser(NamedTuple):
    name: str
    seed: int  # of its training
    problem: Problem
    agent: Agent


class Choices(NamedTuple):
    """Launches that agents choose in one context."""

    marks: tuple[Mark, ...]
    words: str
    plain: list[dict[str, Any]]  # launches in the scenario's units


def landscape(
    scenario: str | os.PathLike[str] | Scenario,
    seed: int,
    runs: Sequence[Path],
    progress: Callable[[str], None] = lambda line: None,
) -> Landscape:
    """Map the launches of one context.

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    seed : int
        Which context is drawn, as in ``sledenv simulate``.
    runs : sequence of Path
        Folders of trained agents, whose choices are marked.
    progress : callable, optional
        Is told what is about to be done, a line for each part.

    Raises
    ------
    FileNotFoundError, ValueError
        If a folder is no finished run.
    ScenarioError
        If a run is of another scenario, or of agents that choose something else.
    """
    problem = Problem(scenario)
    choosers = _loaded(problem, runs)
    where = f"{problem.scenario.id}, context of seed {seed}"
    context = _context(problem, seed)
    progress(f"{where}: searching the best launch")
    best = best_launches(problem, context).iloc[0]
    if choosers:
        progress(f"{where}: asking {_named(choosers)}")
    results = _chosen(problem, context, choosers)
    progress(f"{where}: drawing the map of all launches")
    (one,) = jam_map(problem, context)
    figure = _drawn(problem, one, best, results, f"{problem.scenario.title}, context of seed {seed}")
    marks = {"seed": seed, "best": _plain(problem, best), "agents": _plain_agents(problem, results)}
    marks |= best[["low", "high", "apart", "uniform", "width"]].to_dict()
    return Landscape(figure, _words(problem, best, results), marks)


def choices(
    scenario: Scenario,
    seeds: Sequence[int],
    runs: Sequence[Path],
    progress: Callable[[str], None] = lambda line: None,
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
    choosers = _loaded(problem, runs)
    found = {}
    for seed in seeds:
        progress(f"{scenario.id}, context of seed {seed}: asking {_named(choosers)}")
        results = _chosen(problem, _context(problem, seed), choosers)
        words = "\n".join(_agent_lines(problem, results))
        found[seed] = Choices(_page_marks(problem, results), words, _plain_agents(problem, results))
    return found


def _loaded(problem: Problem, runs: Sequence[Path]) -> list[_Chooser]:
    """Load the agents of folders, which must be of the problem."""
    choosers = []
    for folder in runs:
        theirs, agent, config = load_run(folder)
        if theirs.environment != "launch":
            raise ScenarioError(f"{folder} trims every flight of a ride, but a map plays launches that are left alone")
        if (theirs.scenario.hash, theirs.control) != (problem.scenario.hash, problem.control):
            raise ScenarioError(f"{folder} was trained on another scenario ({theirs.scenario.id}, {theirs.control})")
        choosers.append(_Chooser(agent_name(config["agent"]), int(config["seed"]), theirs, agent))
    return choosers


def _chosen(problem: Problem, context: Contexts, choosers: Sequence[_Chooser]) -> pd.DataFrame:
    """Return what agents choose in a context, as ``action_0``, ..., and its expected ``reward``, a row for each."""
    found = []
    for name, seed, theirs, agent in choosers:
        batch, actions = theirs.judge(agent, theirs.trials(context, "test"))
        found.append((name, seed, *actions[0].tolist(), float(batch.jam.reward.mean())))
    columns = ["agent", "seed", *(f"action_{i}" for i in range(problem.actions)), "reward"]
    return pd.DataFrame(found, columns=columns)


def _physical(problem: Problem, name: str, values: Any) -> Any:
    """Return values in [-1, 1] of a control in its unit."""
    low, high = problem.scenario.control_bounds[name]
    return low + 0.5 * (np.asarray(values, float) + 1.0) * (high - low)


def _drawn(problem: Problem, one: JamMap, best: pd.Series, results: pd.DataFrame, title: str) -> Figure:
    """Draw a map over the first two things that are chosen, in the units of the scenario.

    Where more are chosen, a cell is the best of all launches that belong there.
    """
    names, others = problem.task.controlled[:2], problem.task.controlled[2:]
    axes = [_physical(problem, name, values) for name, values in zip(names, one.launches, strict=False)]
    labels = [f"{name} at launch [{CONTROLS[name].unit}]" for name in names]
    with styled({"figure.constrained_layout.use": True}):
        figure = Figure(figsize=(6.4, 4.6))
        ax = figure.subplots()
        if len(names) == 2:
            best_there = one.rewards.max(axis=tuple(range(2, one.rewards.ndim)))
            image = ax.pcolormesh(*axes, best_there.T, vmin=0.0, vmax=1.0, shading="nearest", rasterized=True)
            figure.colorbar(image, ax=ax, label=f"reward at the best {' and '.join(others)}" if others else "reward")
        else:
            ax.plot(axes[0], one.rewards, color=INK, lw=0.9)
        ax.set(xlabel=labels[0], ylabel=labels[1] if len(names) == 2 else "reward", title=plain(title))

        def mark(rows: Any, **style: Any) -> None:
            upright = _physical(problem, names[1], rows["action_1"]) if len(names) == 2 else rows["reward"]
            ax.plot(_physical(problem, names[0], rows["action_0"]), upright, ls="", mew=0.8, clip_on=False, **style)

        for agent, rows in results.groupby("agent", sort=False):
            colour, marker = look(str(agent), results)
            mark(rows, marker=marker, ms=8.0, color=colour, mec="white", label=label(str(agent)))
        mark(best.to_frame().T, marker="*", ms=14.0, color="white", mec=INK, label="best launch found")
        figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _context(problem: Problem, seed: int) -> Contexts:
    return np.array([problem.scenario.sample(np.random.default_rng(seed))])


def _named(choosers: Iterable[_Chooser]) -> str:
    return ", ".join(f"{one.name}, seed {one.seed}" for one in choosers)


def _words(problem: Problem, best: pd.Series, results: pd.DataFrame) -> str:
    """Return the best launch found, what agents choose and what any launch earns in words, a line each."""
    missed = regrets(results.assign(lower=best["reward"]))
    lines = [
        _line(problem, "best launch found", best),
        f"{'judged anew':<20} reward {best['low']:.4f} to {best['high']:.4f}; two searches apart {best['apart']:.4f}",
        *(f"{line}, regret {lost:.2%}" for line, lost in zip(_agent_lines(problem, results), missed, strict=True)),
        f"{'any launch':<20} mean reward {best['uniform']:.4f}; {best['width']:.2%} within 1 % of the best",
    ]
    return "\n".join(lines)


def _agent_lines(problem: Problem, results: pd.DataFrame) -> list[str]:
    return [_line(problem, f"{row['agent']}, seed {row['seed']}", row) for _, row in results.iterrows()]


def _line(problem: Problem, name: str, row: pd.Series) -> str:
    launch = [f"{value:{CONTROLS[k].printed}} {CONTROLS[k].unit}" for k, value in _launch(problem, row).items()]
    return f"{name:<20} {' '.join(launch)}   reward {row['reward']:.4f}"


def _launch(problem: Problem, row: pd.Series) -> dict[str, float]:
    """Return what is chosen in a row, in the units of the scenario."""
    return {name: float(_physical(problem, name, row[f"action_{i}"])) for i, name in enumerate(problem.task.controlled)}


def _plain_agents(problem: Problem, results: pd.DataFrame) -> list[dict[str, Any]]:
    rows = [row for _, row in results.iterrows()]
    return [{"agent": row["agent"], "seed": row["seed"], **_plain(problem, row)} for row in rows]


def _plain(problem: Problem, row: pd.Series) -> dict[str, Any]:
    launch = {f"{name} [{CONTROLS[name].unit}]": value for name, value in _launch(problem, row).items()}
    return {"launch": launch, "reward": row["reward"]}


def _page_marks(problem: Problem, results: pd.DataFrame) -> tuple[Mark, ...]:
    """Return what agents choose, in SI units."""
    found = []
    for _, row in results.iterrows():
        launch = {
            name: math.radians(value) if CONTROLS[name].unit == "deg" else value
            for name, value in _launch(problem, row).items()
        }
        name = label(row["agent"])
        several = (results["agent"] == row["agent"]).sum() > 1
        title = f"{name}, seed {row['seed']}" if several else name
        found.append(Mark(title, name[0].upper(), look(row["agent"], results)[0], launch, float(row["reward"])))
    return tuple(found)
