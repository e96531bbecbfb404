"""The best launch of a context and what trained agents choose, as a map or as marks of a page: ``sledenv map``."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from sledenv.benchmark.figures import between, label, look
from sledenv.benchmark.oracle import JamMap, best_launches, jam_map
from sledenv.benchmark.problem import Agent, Problem
from sledenv.benchmark.runs import agent_name, load_run
from sledenv.envs.inputs import Contexts
from sledenv.pages.play import Mark
from sledenv.plot.style import INK, plain, styled
from sledenv.scenarios.scenario import Scenario, ScenarioError
from sledenv.scenarios.sections import CONTROLS


class Landscape(NamedTuple):
    """What there is to say about the launches of one context."""

    figure: Figure
    words: str
    marks: dict[str, Any]  # what it marks, as plain data


class Chooser(NamedTuple):
    """A trained agent whose choice is marked."""

    name: str
    seed: int  # of its training
    problem: Problem
    agent: Agent


class Choices(NamedTuple):
    """What agents choose in one context."""

    marks: tuple[Mark, ...]
    words: str
    plain: list[dict[str, Any]]  # of plain_agents


def landscape(
    scenario: str | os.PathLike[str] | Scenario,
    seed: int,
    runs: Sequence[Path],
    progress: Callable[[str], None] | None = None,
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
        Is told what is about to be done, in a line each.

    Raises
    ------
    FileNotFoundError, ValueError
        If a folder is no finished run.
    ScenarioError
        If a run is of another scenario, or of agents that choose something else.
    """
    problem = Problem(scenario)
    choosers = load_choosers(problem, runs)
    told = progress or (lambda line: None)
    where = f"{problem.scenario.id}, context of seed {seed}"
    context = np.array([problem.scenario.sample(np.random.default_rng(seed))])
    told(f"{where}: searching the best launch")
    best = best_launches(problem, context).iloc[0]
    if choosers:
        told(f"{where}: asking {', '.join(f'{one.name}, seed {one.seed}' for one in choosers)}")
    results = chosen(problem, context, choosers)
    told(f"{where}: drawing the map of all launches")
    (one,) = jam_map(problem, context)
    figure = _drawn(problem, one, best, results, f"{problem.scenario.title}, context of seed {seed}")
    return Landscape(figure, _words(problem, best, results), _plain_marks(problem, seed, best, results))


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
    found = {}
    for seed in seeds:
        if progress is not None:
            names = ", ".join(f"{one.name}, seed {one.seed}" for one in choosers)
            progress(f"{scenario.id}, context of seed {seed}: asking {names}")
        results = chosen(problem, np.array([scenario.sample(np.random.default_rng(seed))]), choosers)
        words = "\n".join(agent_words(problem, results))
        found[seed] = Choices(_page_marks(problem, results), words, plain_agents(problem, results))
    return found


def _drawn(problem: Problem, one: JamMap, best: pd.Series, results: pd.DataFrame, title: str) -> Figure:
    """Draw a map over the first two things that are chosen, in the units of the scenario.

    Where more are chosen, a cell is the best of all launches that belong there.
    """
    names, others = problem.task.controlled[:2], problem.task.controlled[2:]
    axes = [physical(problem, name, values) for name, values in zip(names, one.launches, strict=False)]
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
        height = "action_1" if len(names) == 2 else "reward"

        def place(rows: Any) -> tuple[Any, Any]:
            upright = physical(problem, names[1], rows[height]) if len(names) == 2 else rows[height]
            return physical(problem, names[0], rows["action_0"]), upright

        marks: dict[str, Any] = {"ls": "", "clip_on": False}
        for agent, rows in results.groupby("agent", sort=False):
            colour, marker = look(str(agent), results)
            name = label(str(agent))
            ax.plot(*place(rows), marker=marker, ms=8.0, color=colour, mec="white", mew=0.8, label=name, **marks)
        x, y = place(best)
        ax.plot([x], [y], marker="*", ms=14.0, color="white", mec=INK, mew=0.8, label="best launch", **marks)
        figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def physical(problem: Problem, name: str, values: Any) -> Any:
    """Return values in [-1, 1] of a control in its unit."""
    return between(problem.scenario.control_bounds[name], values)


def load_choosers(problem: Problem, runs: Sequence[Path]) -> list[Chooser]:
    """Load the agents of folders.

    Raises
    ------
    FileNotFoundError, ValueError
        If a folder is no finished run.
    ScenarioError
        If a run is of another scenario, or of agents that choose something else or trim.
    """
    choosers = []
    for folder in runs:
        theirs, agent, config = load_run(folder)
        if theirs.environment != "launch":
            raise ScenarioError(f"{folder} trims every flight of a ride, but a map plays launches that are left alone")
        if (theirs.scenario.hash, theirs.control) != (problem.scenario.hash, problem.control):
            raise ScenarioError(f"{folder} was trained on another scenario ({theirs.scenario.id}, {theirs.control})")
        choosers.append(Chooser(agent_name(config["agent"]), int(config["seed"]), theirs, agent))
    return choosers


def chosen(problem: Problem, context: Contexts, choosers: Sequence[Chooser]) -> pd.DataFrame:
    """Return what agents choose in a context, shape (1, 12).

    Returns
    -------
    DataFrame
        A row for each agent: ``agent``, ``seed``, ``action_0``, ... and the expected ``reward``.
    """
    found = []
    for name, seed, theirs, agent in choosers:
        batch, actions = theirs.judge(agent, theirs.trials(context, "test"))
        found.append((name, seed, *actions[0].tolist(), float(batch.jam.reward.mean())))
    columns = ["agent", "seed", *(f"action_{i}" for i in range(problem.actions)), "reward"]
    return pd.DataFrame(found, columns=columns)


def agent_words(problem: Problem, results: pd.DataFrame) -> list[str]:
    """Return what :func:`chosen` has found in words, a line for each agent."""
    return [
        f"{row['agent'] + ', seed ' + str(row['seed']):<20} {_launch_words(problem, row)}   reward {row['reward']:.4f}"
        for _, row in results.iterrows()
    ]


def plain_agents(problem: Problem, results: pd.DataFrame) -> list[dict[str, Any]]:
    """Return what :func:`chosen` has found as plain data, launches in the scenario's units."""
    rows = [row for _, row in results.iterrows()]
    return [{"agent": row["agent"], "seed": row["seed"], **_plain_launch(problem, row)} for row in rows]


def _words(problem: Problem, best: pd.Series, results: pd.DataFrame) -> str:
    """Return the best launch, what agents choose and what any launch earns in words, a line each."""
    regrets = [1.0 - reward / best["reward"] for reward in results["reward"]]
    lines = [
        f"{'best launch':<20} {_launch_words(problem, best)}   reward {best['reward']:.4f}",
        f"{'best there is':<20} reward {best['low']:.4f} to {best['high']:.4f}",
        *(f"{line}, regret {lost:.2%}" for line, lost in zip(agent_words(problem, results), regrets, strict=True)),
        f"{'any launch':<20} mean reward {best['uniform']:.4f}; {best['width']:.2%} within 1 % of the best",
    ]
    return "\n".join(lines)


def _launch_words(problem: Problem, row: pd.Series) -> str:
    parts = []
    for i, name in enumerate(problem.task.controlled):
        control, value = CONTROLS[name], physical(problem, name, row[f"action_{i}"])
        parts.append(f"{value:{control.printed}} {control.unit}")
    return " ".join(parts)


def _plain_launch(problem: Problem, row: pd.Series) -> dict[str, Any]:
    names = enumerate(problem.task.controlled)
    values = {
        f"{name} [{CONTROLS[name].unit}]": float(physical(problem, name, row[f"action_{i}"])) for i, name in names
    }
    return {"launch": values, "reward": row["reward"]}


def _plain_marks(problem: Problem, seed: int, best: pd.Series, results: pd.DataFrame) -> dict[str, Any]:
    """Return what is marked in the context of a seed as plain data."""
    around = {name: best[name] for name in ("low", "high", "uniform", "width")}
    return {"seed": seed, "best": _plain_launch(problem, best), "agents": plain_agents(problem, results), **around}


def _page_marks(problem: Problem, results: pd.DataFrame) -> tuple[Mark, ...]:
    """Return the launches of a table of :func:`chosen`, in SI units."""
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
