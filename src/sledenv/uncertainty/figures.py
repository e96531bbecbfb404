"""The figures of a study: envelopes along the slope, and what the scatter of the outcome comes from."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING, Final

import numpy as np

from sledenv.plot.style import BLUE, GREEN, INK, ORANGE, POTENTIAL, PURPLE, RED, SKY, WIDTH, plain, styled
from sledenv.uncertainty.result import StudyResult
from sledenv.uncertainty.summary import NAMES
from sledenv.uncertainty.terrain import TerrainSection

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WAYS: Final = {
    "moving": SKY,
    "finished": BLUE,
    "jammed": RED,
    "tumbled": ORANGE,
    "left_backwards": PURPLE,
    "other": POTENTIAL,
}
_FANS: Final = {  # label and scale
    "bounce_m": ("clearance of the\nlowest point [m]", 1.0),
    "speed_m_s": ("speed [m/s]", 1.0),
    "kinetic_j": ("kinetic energy [kJ]", 1e-3),
}
_GROUNDS: Final = (POTENTIAL, ORANGE, PURPLE, GREEN, INK, SKY, RED, BLUE)  # of materials
_OUTPUTS: Final = {
    "stop_m": "where it stops",
    "time_s": "duration",
    "kinetic_j": "kinetic energy at the end",
    "reward": "reward",
    "finish": "whether it finishes",
    "jammed": "whether it jams",
    "tumbled": "whether it falls",
    "left_backwards": "whether it leaves backwards",
}
_COLUMNS: Final = 3  # panels beside each other
_SEEN: Final = 2e-3  # share of launches that can be seen in a figure
_FEW: Final = 0.01  # share of launches from which on their quantiles are drawn


def plot_envelopes(result: StudyResult) -> Figure:
    """Plot along the slope how many are still moving, and quantiles of speed and energy of those that come there.

    Over a hillside the section stands above that, with the heights at which mass centres pass, and how high the lowest
    points bounce.
    """
    table, terrain = result.envelopes, result.study.terrain
    x = table["x_m"].to_numpy()
    shares = {way: table[way].to_numpy().copy() for way in _WAYS if way in table}
    # It is at the end of the slope that they finish, not little by little from the station before.
    last = shares["finished"][-1] - shares["finished"][-2:][0]
    shares["moving"][-1] += last
    shares["finished"][-1] -= last
    shown = {way: share for way, share in shares.items() if share.max() >= _SEEN}
    come = table["moving"] + table["finished"] >= _FEW
    fans = [name for name in _FANS if f"{name}_{NAMES[0]}" in table]
    with styled():
        from matplotlib.figure import Figure

        above = 0 if terrain is None else 1
        figure = Figure(figsize=(WIDTH, 8.5 + 4.5 * above), layout="constrained")
        heights = [1.6] * above + [1.0] * (1 + len(fans))
        axes = list(figure.subplots(len(heights), 1, sharex=True, height_ratios=heights))
        axes[0].set_title(plain(result.study.title), loc="left")
        if terrain is not None:
            _draw_section(axes[0], terrain, table.where(come))
        top = axes[above]
        top.stackplot(x, list(shown.values()), labels=list(shown), colors=[_WAYS[way] for way in shown], lw=0.0)
        top.set_ylabel("share of launches")
        top.set_ylim(0.0, 1.0)
        for ax, name in zip(axes[above + 1 :], fans, strict=True):
            label, scale = _FANS[name]
            quantiles = (scale * table[f"{name}_{quantile}"].where(come) for quantile in (*NAMES, "most"))
            low, lower, middle, upper, high, most = quantiles
            ax.fill_between(x, low, high, color=BLUE, alpha=0.2, lw=0.0, label="5 to 95 %")
            ax.fill_between(x, lower, upper, color=BLUE, alpha=0.35, lw=0.0, label="25 to 75 %")
            ax.plot(x, middle, color=INK, label="median")
            if terrain is not None:
                ax.plot(x, most, color=RED, lw=0.9, label="largest")
            ax.set_ylabel(label)
            ax.set_ylim(bottom=0.0)
        for ax, title in zip(axes[: above + 2], [None] * (above + 1) + ["of those that\ncome there"], strict=True):
            ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), title=title)
        axes[-1].set_xlabel("distance along the slope [m]" if terrain is None else "x [m]")
        axes[-1].set_xlim(x[0] if terrain is None else 0.0, x[-1])
        if terrain is not None:
            _say_exaggeration(figure, axes[0])
    return figure


def _say_exaggeration(figure: Figure, ax: Axes) -> None:
    """Say on the axis of elevations how many times as long a metre is there as along x, where all has its place."""
    said = "elevation [m]\nvertical exaggeration {:.2g}"
    ax.set_ylabel(said.format(1.5))  # as much room as it takes
    figure.draw_without_rendering()
    across, up = ax.get_window_extent().size / np.ptp([ax.get_xlim(), ax.get_ylim()], axis=1)
    ax.set_ylabel(said.format(up / across))


def _draw_section(ax: Axes, terrain: TerrainSection, table: pd.DataFrame) -> None:
    """Draw the ground at its elevations by its materials, and how high over it mass centres pass."""
    vertices = terrain.points
    bottom, x = float(vertices[:, 1].min() - 0.08 * np.ptp(vertices[:, 1])), table["x_m"]
    colours = dict(zip(dict.fromkeys(run.material for run in terrain.runs), cycle(_GROUNDS), strict=False))
    labelled = set()
    for run in terrain.runs:
        end = min(run.end, terrain.length)
        places = np.r_[run.begin, vertices[(vertices[:, 0] > run.begin) & (vertices[:, 0] < end), 0], end]
        ground = np.interp(places, *vertices.T)
        label = None if run.material in labelled else run.material
        labelled.add(run.material)
        colour = colours[run.material]
        ax.fill_between(places, ground, bottom, color=colour, alpha=0.8, lw=0.0, label=label)
    under = np.interp(x, *vertices.T)
    ax.plot(*vertices.T, color=INK, lw=0.8)
    ax.plot(x, under + table["centre_m_q95"], color=BLUE, lw=1.2, label="mass centre, 95 %")
    ax.plot(x, under + table["centre_m_most"], color=RED, lw=0.9, label="highest")


def plot_sobol(result: StudyResult) -> Figure:
    """Plot Sobol's indices of each output: the first order, and the total, which counts interactions too."""
    table = result.sobol
    outputs = [name for name in _OUTPUTS if (table["output"] == name).any()]
    parameters = list(result.study.parameters)
    rows = max(-(-len(outputs) // _COLUMNS), 1)
    with styled():
        from matplotlib.figure import Figure

        height = rows * (1.1 + 0.42 * len(parameters)) + 0.6
        figure = Figure(figsize=(WIDTH + 1.0, height), layout="constrained")
        axes: list[Axes] = list(figure.subplots(rows, _COLUMNS, sharex=True, sharey=True, squeeze=False).ravel())
        place = np.arange(len(parameters))
        for ax, name in zip(axes, outputs, strict=False):
            found = table[table["output"] == name].set_index("parameter").loc[parameters]
            for shift, index, colour, label in ((-0.2, "first", GREEN, "first order"), (0.2, "total", PURPLE, "total")):
                spread = found[f"{index}_conf"]
                ax.barh(place + shift, found[index], 0.38, xerr=spread, color=colour, label=label, ecolor=INK)
            ax.axvline(0.0, color=INK, lw=0.6)
            ax.set_title(_OUTPUTS[name], loc="left")
            ax.tick_params(labelbottom=True)
        for ax in axes[len(outputs) :]:
            ax.set_axis_off()
        axes[0].set_yticks(place, parameters)
        axes[0].invert_yaxis()
        axes[0].set(xlim=(-0.1, 1.1), xticks=(0.0, 0.5, 1.0))  # intervals of a small study may go far beyond
        if outputs:
            figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        figure.suptitle(f"Sobol indices: {plain(result.study.title)}", x=0.01, ha="left", fontsize=11.0)
    return figure
