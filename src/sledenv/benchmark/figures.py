"""Figures of a benchmark: learning, regret, jam maps and where the energy goes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import EngFormatter, PercentFormatter

from sledenv.benchmark.scores import (
    PROBLEM,
    SMALL_REGRET,
    STATUSES,
    Results,
    decomposition,
    ordered,
    rank,
    regrets,
)
from sledenv.plot.style import BLUE, DASHES, GREEN, INK, ORANGE, POTENTIAL, PURPLE, RED, SKY, WIDTH, styled
from sledenv.scenarios.configuration import Pair
from sledenv.scenarios.scenario import load_scenario, scenario_names
from sledenv.scenarios.sections import CONTROLS
from sledenv.simulation.records import LOSSES

_LOOKS: Final = {  # colour and marker of each agent, the same in all figures
    "zero": (POTENTIAL, "x"),
    "random_launch": ("#8792A0", "."),
    "best_fixed": (INK, "s"),
    "land_flat": (PURPLE, "D"),
    "land_parallel": (PURPLE, "D"),
    "ppo": (ORANGE, "^"),
    "sac": (BLUE, "o"),
    "tqc": (SKY, ">"),
    "critic": (RED, "P"),
    "ride_critic": (RED, "P"),
    "replan": (INK, "p"),
    "replan_critic": (GREEN, "v"),
}
_ACRONYMS: Final = ("ppo", "sac", "tqc")
_OTHERS: Final = (("#6F9E9B", "X"), ("#8C6D31", "h"), ("#A0527A", "*"))
_SMALLEST: Final = 1e-5  # regret that is still told from none
_MAPS: Final = 3  # contexts a scenario of which the jam map is drawn
_ENERGY: Final = {
    "kept": ("motion along the slope at the finish", BLUE),
    **{name: (f"lost by {name}", colour) for name, colour in zip(LOSSES, (GREEN, RED, ORANGE, PURPLE), strict=False)},
    "other": ("spin, motion across, not finished", POTENTIAL),
}
_ENDINGS: Final = dict(zip((*STATUSES, "another way"), (BLUE, RED, ORANGE, POTENTIAL), strict=True))


def label(agent: str) -> str:
    """Return the name of an agent for a reader: "best fixed", "SAC"."""
    return agent.upper() if agent in _ACRONYMS else agent.replace("_", " ")


def title(environment: str, scenario: str) -> str:
    """Return the name of a problem for a reader."""
    return scenario if environment == "launch" else f"{scenario}, ride"


def plot_learning(results: Results, against: Literal["descents", "seconds"] = "descents") -> Figure | None:
    """Plot the mean validation reward against simulated descents, or seconds: mean over seeds, and their range.

    Both are medians of the seeds, which are validated equally often; the seconds leave out those of the validation.

    Returns
    -------
    Figure or None
        None without learning curves, or without their seconds, which an agent need not tell.
    """
    told = results.curves.dropna(subset=[against])
    if told.empty:
        return None
    judged = regrets(results)

    def draw(ax: Axes, group: pd.DataFrame) -> None:
        same = judged.loc[(judged[PROBLEM] == group[PROBLEM].iloc[0]).all(axis=1)]
        fixed = same.loc[same["agent"] == "best_fixed", "reward"]
        if len(same):
            ax.axhline(same.drop_duplicates("context")["best"].mean(), color=INK, lw=1.0, ls=DASHES)
        if len(fixed):
            ax.axhline(fixed.mean(), color=INK, lw=1.0, ls=":")
        for agent, curves in group.groupby("agent", sort=False):
            checks = curves.groupby(curves.groupby("seed").cumcount())  # seeds may be validated after other descents
            at, along = checks["mean_reward"].agg(["mean", "min", "max"]), checks[against].median()
            colour, _ = look(agent, told)
            ax.fill_between(along, at["min"], at["max"], color=colour, alpha=0.2, lw=0.0)
            ax.plot(along, at["mean"], color=colour)
        ax.xaxis.set_major_formatter(EngFormatter(sep=""))

    levels = [Line2D([], [], color=INK, lw=1.0, ls=DASHES, label="best of each context")]
    if (judged["agent"] == "best_fixed").any():
        levels.append(Line2D([], [], color=INK, lw=1.0, ls=":", label="best fixed launch"))
    words = {"descents": "simulated descents", "seconds": "seconds of training"}[against]
    return _panels(told, draw, words, "mean reward", _lines(told) + levels)


def plot_regret(results: Results) -> Figure:
    """Plot which share of seeds and contexts has at most a given regret."""
    table = regrets(results)

    def draw(ax: Axes, group: pd.DataFrame) -> None:
        ax.axvline(SMALL_REGRET, color=INK, lw=0.8, ls=DASHES)
        for agent, rows in group.groupby("agent", sort=False):
            values = np.sort(np.clip(rows["regret"].to_numpy(), _SMALLEST, 1.0))
            colour, _ = look(agent, table)
            share = np.arange(1, len(values) + 1) / len(values)
            ax.step([_SMALLEST, *values, 1.0], [0.0, *share, 1.0], where="post", color=colour)
        ax.set_xscale("log")
        ax.set_xlim(_SMALLEST, 1.0)
        ax.set_ylim(0.0, 1.02)
        ax.set_xticks([1e-4, 1e-2, 1.0], ["0.01%", "1%", "100%"])
        ax.minorticks_off()
        ax.yaxis.set_major_formatter(PercentFormatter(1.0))

    lines = [*_lines(table), Line2D([], [], color=INK, lw=0.8, ls=DASHES, label=f"regret {SMALL_REGRET:.0%}")]
    return _panels(table, draw, "regret", "share of contexts", lines)


def plot_maps(results: Results) -> Figure | None:
    """Draw the reward over the launches of a few contexts, the best launch and what the agents chose.

    Returns
    -------
    Figure or None
        None without jam maps.
    """
    maps = results.maps
    if maps.empty:
        return None
    judged = results.results
    chosen = judged[
        (judged["environment"] == "launch")
        & (judged["stage"] == "trained")
        & ~judged["agent"].isin(["zero", "random_launch"])
    ]
    launches = results.oracle[results.oracle["environment"] == "launch"].set_index(["scenario", "context"])
    scenarios = sorted(maps["scenario"].unique())
    with styled({"axes.spines.top": True, "axes.spines.right": True}):
        figure = Figure(figsize=(WIDTH, 1.0 + 2.7 * len(scenarios)), layout="constrained")
        grid = figure.subplots(len(scenarios), _MAPS, squeeze=False, sharex="row")
        image = None
        for row, scenario in zip(grid, scenarios, strict=True):
            here = maps[maps["scenario"] == scenario]
            axes = _axes(results, scenario, here)
            contexts = sorted(here["context"].unique())[:_MAPS]
            for ax in row[len(contexts) :]:
                ax.set_visible(False)
            for ax, context in zip(row, contexts, strict=False):
                places = chosen[(chosen["scenario"] == scenario) & (chosen["context"] == context)]
                best = launches.loc[(scenario, context)]
                image = _draw_map(ax, axes, here[here["context"] == context], best, places, judged) or image
                ax.set_title(f"{scenario}, context {context}: best {best['reward']:.2f}", loc="left", fontsize=9.5)
        if image is not None:
            figure.colorbar(image, ax=grid, label="reward", shrink=0.6, aspect=30, pad=0.02)
        star = Line2D([], [], color="white", mec=INK, marker="*", ms=11.0, ls="", label="best launch")
        figure.legend(handles=[star, *_marks(chosen, judged)], loc="outside lower center", ncols=6)
    return figure


def plot_energy(results: Results) -> Figure:
    """Draw as bars where the energy supplied goes and how the descents end, before and after learning."""
    table = decomposition(results)
    problems = list(table.groupby(PROBLEM, sort=False))
    heights = [len(group) for _, group in problems]
    with styled():
        size = (WIDTH, 1.6 + 0.24 * sum(heights) + 0.45 * len(problems))
        figure = Figure(figsize=size, layout="constrained")
        grid = figure.subplots(len(problems), 2, squeeze=False, sharex=True, height_ratios=heights)
        energy = {name: colour for name, (_, colour) in _ENERGY.items()}
        for axes, (problem, group) in zip(grid, problems, strict=True):
            names = [
                label(row.agent) + (", untrained" if row.stage == "untrained" else "") for row in group.itertuples()
            ]
            for ax, parts in zip(axes, (energy, _ENDINGS), strict=True):
                left = np.zeros(len(group))
                for name, colour in parts.items():
                    share = group[name].to_numpy()
                    ax.barh(range(len(group)), share, left=left, color=colour, height=0.75)
                    left += share
                ax.set_yticks(range(len(group)), names if ax is axes[0] else [], fontsize=9.5)
                ax.set_ylim(len(group) - 0.5, -0.5)
                ax.set_xlim(0.0, 1.0)
                ax.tick_params(axis="y", length=0.0)
                ax.spines["left"].set_visible(False)
                ax.xaxis.set_major_formatter(PercentFormatter(1.0))
            axes[0].set_title(title(*problem), loc="left")
        grid[-1, 0].set_xlabel("share of the energy supplied")
        grid[-1, 1].set_xlabel("share of the descents")
        for column, parts in enumerate((dict(_ENERGY.values()), _ENDINGS)):
            handles = [Patch(color=colour, label=name) for name, colour in parts.items()]
            where: Any = "outside upper left" if column == 0 else "outside upper right"
            figure.legend(handles=handles, loc=where, ncols=2 if column else 1, fontsize=9.5)
    return figure


def _panels(
    table: pd.DataFrame, draw: Callable[[Axes, pd.DataFrame], None], x: str, y: str, handles: list[Any]
) -> Figure:
    """Draw one panel an environment and scenario, three a row."""
    groups = list(ordered(table).groupby(PROBLEM, sort=False))
    columns = min(3, len(groups))
    rows = -(-len(groups) // columns)
    with styled():
        figure = Figure(figsize=(WIDTH, 1.1 + 2.6 * rows), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False)
        for ax in grid.flat[len(groups) :]:
            ax.set_visible(False)
        for i, (ax, (problem, group)) in enumerate(zip(grid.flat, groups, strict=False)):
            draw(ax, group)
            ax.set_title(title(*problem), loc="left")
            ax.set_xlabel(x if i + columns >= len(groups) else "")
            ax.set_ylabel(y if i % columns == 0 else "")
        figure.legend(handles=handles, loc="outside lower center", ncols=5 if len(handles) == 5 else 4)
    return figure


def _draw_map(
    ax: Axes, axes: list[_Axis], cells: pd.DataFrame, best: pd.Series, places: pd.DataFrame, every: pd.DataFrame
) -> Any:
    """Draw one jam map over the first two things that are chosen, a curve over one alone; return what has colours.

    A cell is the best of all launches that belong there, whatever else of them is chosen.
    """
    along, *across = axes
    image = None
    if across:
        grid = cells.pivot_table(index=across[0].name, columns=along.name, values="reward", aggfunc="max")
        x, y = along.at(grid.columns), across[0].at(grid.index)
        image = ax.pcolormesh(x, y, grid, vmin=0.0, vmax=1.0, shading="nearest", rasterized=True)
        edge = 0.5 * (x[1] - x[0])  # a full turn leaves out its end, which is its beginning
        ax.set_xlim(x[0] - edge, x[-1] + edge)
    else:
        curve = cells.sort_values(along.name)
        ax.plot(along.at(curve[along.name]), curve["reward"], color=INK, lw=0.9)
    ax.set(xlabel=along.label, ylabel=across[0].label if across else "reward")

    def place(rows: Any) -> tuple[Any, Any]:
        return along.at(rows["action_0"]), across[0].at(rows["action_1"]) if across else rows["reward"]

    clip: dict[str, Any] = {"ls": "", "clip_on": False, "mec": "white", "mew": 0.6}
    ax.plot(*place(best), marker="*", ms=11.0, **clip | {"color": "white", "mec": INK}, zorder=5)
    for agent, rows in places.groupby("agent", sort=False):
        colour, marker = look(agent, every)
        ax.plot(*place(rows), marker=marker, ms=6.0, color=colour, zorder=4, **clip)
    return image


class _Axis(NamedTuple):
    """One thing that the launches of a jam map choose."""

    name: str
    label: str
    bounds: Pair  # what -1 and 1 are

    def at(self, values: Any) -> Any:
        """Return where values in [-1, 1] lie."""
        return between(self.bounds, values)


def _axes(results: Results, scenario: str, cells: pd.DataFrame) -> list[_Axis]:
    """Return the first two things that the launches of jam maps choose, or the only one.

    Results do not hold the bounds of a scenario: they are those of the one that ships under its name, unless another
    one was meant, whose launches remain in [-1, 1].
    """
    hashes = results.results.loc[results.results["scenario"] == scenario, "scenario_hash"].unique()
    known = load_scenario(scenario) if scenario in scenario_names() else None
    bounds = known.control_bounds if known is not None and [*hashes] == [known.hash] else {}
    free = [name for name in CONTROLS if name in cells and cells[name].notna().any()][:2]
    units = {name: CONTROLS[name].unit if name in bounds else "-1 to 1 of its bounds" for name in free}
    return [_Axis(name, f"{name} [{units[name]}]", bounds.get(name, (-1.0, 1.0))) for name in free]


def between(bounds: Pair, values: Any) -> Any:
    """Return what values in [-1, 1] stand for, the lower and the upper bound at the ends."""
    low, high = bounds
    return low + 0.5 * (np.asarray(values, float) + 1.0) * (high - low)


def look(agent: str, table: pd.DataFrame) -> tuple[str, str]:
    """Colour and marker of an agent; those of unknown ones follow from the agents in the table."""
    if agent in _LOOKS:
        return _LOOKS[agent]
    unknown = sorted(set(table["agent"]) - set(_LOOKS))
    return _OTHERS[unknown.index(agent) % len(_OTHERS)]


def _agents(table: pd.DataFrame) -> Iterator[str]:
    names = pd.Series(table["agent"].unique())
    yield from names.loc[rank(names).sort_values().index]


def _lines(table: pd.DataFrame) -> list[Any]:
    return [Line2D([], [], color=look(agent, table)[0], label=label(agent)) for agent in _agents(table)]


def _marks(table: pd.DataFrame, every: pd.DataFrame) -> list[Any]:
    handles = []
    for agent in _agents(table):
        colour, marker = look(agent, every)
        handles.append(Line2D([], [], color=colour, mec="white", marker=marker, ms=7.0, ls="", label=label(agent)))
    return handles
