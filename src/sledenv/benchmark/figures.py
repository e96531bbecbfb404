"""Figures of a benchmark: learning, regret and where the energy goes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import EngFormatter, PercentFormatter

from sledenv.benchmark.results import PROBLEM, Results
from sledenv.benchmark.scores import decomposition, regrets
from sledenv.plot.style import BLUE, DASHES, GREEN, INK, ORANGE, POTENTIAL, PURPLE, RED, SKY, WIDTH, styled
from sledenv.simulation.records import FLIGHT_LOSSES, LOSSES

_LOOKS: Final = {  # colour and marker of each agent, the same in all figures, in the order of their keys
    "zero": (POTENTIAL, "x"),
    "random_launch": ("#8792A0", "."),
    "best_fixed": (INK, "s"),
    "land_flat": (PURPLE, "D"),
    "land_parallel": (PURPLE, "D"),
    "ppo": (ORANGE, "^"),
    "sac": (BLUE, "o"),
    "tqc": (SKY, ">"),
    "critic": (RED, "P"),
    "replan": (INK, "p"),
}
_ACRONYMS: Final = ("ppo", "sac", "tqc")
_OTHERS: Final = (("#6F9E9B", "X"), ("#8C6D31", "h"), ("#A0527A", "*"))
_LINEAR: Final = 0.01  # regret up to which its axis is linear
_ENERGY: Final = {
    "kept": ("motion along the slope at the finish", BLUE),
    **{name: (f"lost by {name}", colour) for name, colour in zip(LOSSES, (GREEN, RED, ORANGE, PURPLE), strict=False)},
    "other": ("spin, motion across, not finished", POTENTIAL),
}
_ENDINGS: Final = {
    "finish": ("finish", BLUE),
    "jammed": ("jammed", RED),
    "tumbled": ("fall", ORANGE),
    "another way": ("another way", POTENTIAL),
}


def label(agent: str) -> str:
    """Return the name of an agent for a reader: "best fixed", "SAC"."""
    return agent.upper() if agent in _ACRONYMS else agent.replace("_", " ")


def title(environment: str, scenario: str) -> str:
    """Return the name of a problem for a reader."""
    return f"{scenario}, {'launch' if environment == 'launch' else 'ride'}"


def look(agent: str, table: pd.DataFrame) -> tuple[str, str]:
    """Return colour and marker of an agent; those of unknown ones follow from the agents in the table."""
    unknown = sorted(set(table["agent"]) - set(_LOOKS))
    return _LOOKS[agent] if agent in _LOOKS else _OTHERS[unknown.index(agent) % len(_OTHERS)]


def plot_learning(results: Results) -> Figure | None:
    """Plot the mean validation reward against simulated descents: mean over seeds, and their range.

    Descents are medians of the seeds, which are validated equally often.

    Returns
    -------
    Figure or None
        None without learning curves.
    """
    if results.curves.empty:
        return None
    levels = results.judged.groupby(PROBLEM)["lower"].mean()

    def draw(ax: Axes, group: pd.DataFrame) -> None:
        ax.axhline(levels[tuple(group[PROBLEM].iloc[0])], color=INK, lw=1.0, ls=DASHES)
        for agent, curves in group.groupby("agent"):
            checks = curves.groupby(curves.groupby("seed").cumcount())  # seeds may be validated after other descents
            at, along = checks["mean_reward"].agg(["mean", "min", "max"]), checks["descents"].median()
            colour, _ = look(str(agent), results.curves)
            ax.fill_between(along, at["min"], at["max"], color=colour, alpha=0.2, lw=0.0)
            ax.plot(along, at["mean"], color=colour)
        ax.xaxis.set_major_formatter(EngFormatter(sep=""))

    dashed = [Line2D([], [], color=INK, lw=1.0, ls=DASHES, label="reference, test contexts")]
    handles = _lines(results.curves) + (dashed if levels.notna().any() else [])
    return _panels(results.curves, draw, "simulated descents", "mean reward", handles)


def plot_regret(results: Results) -> Figure | None:
    """Plot which share of seeds and contexts has at most a given regret.

    Returns
    -------
    Figure or None
        None without a reference.
    """
    table = results.judged[results.judged["stage"] == "trained"]
    table = table.assign(regret=regrets(table).clip(-1.0)).dropna(subset="regret")
    if table.empty:
        return None

    def draw(ax: Axes, group: pd.DataFrame) -> None:
        ax.axvline(0.0, color=INK, lw=0.8, ls=DASHES)
        for agent, rows in group.groupby("agent"):
            ax.ecdf(rows["regret"], color=look(str(agent), table)[0])
        ax.set_xscale("symlog", linthresh=_LINEAR)
        ax.set_xticks([-1.0, -0.1, -0.01, 0.0, 0.01, 0.1, 1.0])
        ax.set(xlim=(min(group["regret"].min(), -_LINEAR), 1.0), ylim=(0.0, 1.02))
        ax.minorticks_off()
        ax.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
        ax.yaxis.set_major_formatter(PercentFormatter(1.0))

    return _panels(table, draw, "regret", "share of contexts", _lines(table))


def plot_energy(results: Results) -> Figure:
    """Draw as bars where the energy supplied goes and how the descents end, before and after learning."""
    table = decomposition(results.judged).sort_values("stage", ascending=False, kind="stable")  # untrained first
    problems = _problems(table.iloc[table["agent"].map(_place).argsort(kind="stable")])
    heights = [len(group) for _, group in problems]
    energy = {name: shown for name, shown in _ENERGY.items() if name not in FLIGHT_LOSSES or table[name].any()}
    with styled():
        figure = Figure(figsize=(WIDTH, 1.6 + 0.24 * sum(heights) + 0.45 * len(problems)), layout="constrained")
        grid = figure.subplots(len(problems), 2, squeeze=False, sharex=True, height_ratios=heights)
        for axes, (problem, group) in zip(grid, problems, strict=True):
            names = group["agent"].map(label) + np.where(group["stage"] == "untrained", ", untrained", "")
            for ax, parts in zip(axes, (energy, _ENDINGS), strict=True):
                left = np.zeros(len(group))
                for name, (_, colour) in parts.items():
                    share = group[name].to_numpy()
                    ax.barh(range(len(group)), share, left=left, color=colour, height=0.75)
                    left += share
                ax.set_yticks(range(len(group)), names if ax is axes[0] else [], fontsize=9.5)
                ax.set(xlim=(0.0, 1.0), ylim=(len(group) - 0.5, -0.5))
                ax.tick_params(axis="y", length=0.0)
                ax.spines["left"].set_visible(False)
                ax.xaxis.set_major_formatter(PercentFormatter(1.0))
            axes[0].set_title(title(*problem), loc="left")
        grid[-1, 0].set_xlabel("share of the energy supplied")
        grid[-1, 1].set_xlabel("share of the descents")
        legends: list[Any] = [("outside upper left", energy, 1), ("outside upper right", _ENDINGS, 2)]
        for where, parts, columns in legends:
            handles = [Patch(color=colour, label=name) for name, colour in parts.values()]
            figure.legend(handles=handles, loc=where, ncols=columns, fontsize=9.5)
    return figure


def _panels(
    table: pd.DataFrame, draw: Callable[[Axes, pd.DataFrame], None], x: str, y: str, handles: list[Any]
) -> Figure:
    """Draw a panel for each environment and scenario, three in a row."""
    problems = _problems(table)
    columns = min(3, len(problems))
    rows = -(-len(problems) // columns)
    with styled():
        figure = Figure(figsize=(WIDTH, 1.1 + 2.6 * rows), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False).ravel()
        for i, (ax, (problem, group)) in enumerate(zip(grid, problems, strict=False)):
            draw(ax, group)
            ax.set_title(title(*problem), loc="left")
            ax.set(xlabel=x if i + columns >= len(problems) else "", ylabel="" if i % columns else y)
        for ax in grid[len(problems) :]:
            ax.set_visible(False)
        figure.legend(handles=handles, loc="outside lower center", ncols=5)
    return figure


def _problems(table: pd.DataFrame) -> list[tuple[tuple[str, str], pd.DataFrame]]:
    """Return the rows of each environment and scenario, launches first."""
    return sorted(table.groupby(PROBLEM), key=lambda one: (one[0][0] != "launch", one[0][1]))


def _place(agent: str) -> int:
    return [*_LOOKS, agent].index(agent)


def _lines(table: pd.DataFrame) -> list[Line2D]:
    agents = sorted(table["agent"].unique(), key=_place)
    return [Line2D([], [], color=look(agent, table)[0], label=label(agent)) for agent in agents]
