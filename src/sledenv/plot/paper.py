"""Figures of what the paper computes, over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from sledenv.plot.shapes import to_world
from sledenv.plot.style import (
    BLUE,
    DASHES,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    RED,
    SHADE,
    SKY,
    WIDTH,
    contact_key,
    plain,
    shade_contacts,
    styled,
)
from sledenv.plot.trajectories import first_contact, opening
from sledenv.simulation.interpolation import drawable_rows
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.rules import checked_mapping

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_worked_example(series: Mapping[str, np.ndarray], *, paper: tuple[float, float] | None = None) -> Figure:
    """Plot several computations of one impact over each other: the paper's Fig. 7-10.

    Parameters
    ----------
    series : mapping of str to structured ndarray
        Label to rows with the fields ``t`` [s], ``normal`` and ``tangential`` [N], ``moment`` [N m] about the mass
        centre and ``kinetic`` [J]. The first is drawn as a broad line, the others over it.
    paper : (float, float), optional
        Time [s] and kinetic energy [J] of a published value to mark.

    Returns
    -------
    Figure
        Normal force, tangential force, total moment about the mass centre, kinetic energy.

    Raises
    ------
    ValueError
        If ``series`` is empty.
    """
    if not checked_mapping("series", series):
        raise ValueError("series is empty: there is nothing to draw")
    panels = (
        ("Fig. 7: normal force", "N [N]", "normal"),
        ("Fig. 8: tangential force", "F [N]", "tangential"),
        ("Fig. 9: moment about the mass centre", "moment [N m]", "moment"),
        ("Fig. 10: kinetic energy", "T [J]", "kinetic"),
    )
    styles: tuple[dict[str, Any], ...] = (
        {"color": SKY, "lw": 4.5},
        {"color": INK, "lw": 1.2, "ls": DASHES},
        {"color": RED, "lw": 1.4},
        {"color": PURPLE, "lw": 1.4},
    )
    with styled():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 6.6), layout="constrained")
        grid = figure.subplots(2, 2, sharex=True)
        for ax, (title, label, field) in zip(grid.flat, panels, strict=True):
            ax.axhline(0.0, color=INK, lw=0.6)
            for i, (name, rows) in enumerate(series.items()):
                ax.plot(1e3 * rows["t"], rows[field], label=plain(name), **styles[min(i, len(styles) - 1)])
            ax.set_title(title, loc="left")
            ax.set_ylabel(label)
        if paper is not None:
            grid[1, 1].plot(
                1e3 * paper[0], paper[1], color=ORANGE, marker="X", ms=9.0, ls="", label=f"paper: {paper[1]:g} J"
            )
        last = max(float(rows["t"][-1]) for rows in series.values())
        for ax in grid[1]:
            ax.set_xlim(0.0, 1.02e3 * last)
            ax.set_xlabel("time [ms]")
        figure.align_ylabels(grid)
        figure.legend(*grid[1, 1].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def plot_velocities(descent: Descent, *, note: str = "", paper: bool = False) -> Figure:
    """Plot the velocity of the mass centre in the world, not along the slope, and the spin.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``.
    note : str
        Written above the panels.
    paper : bool
        Number the panels as the paper's Fig. 12-14.

    Returns
    -------
    Figure
        Vertical velocity (upwards), horizontal velocity (in the sense of the descent) and angular velocity.

    Raises
    ------
    ValueError
        If the trajectory is missing.
    """
    rows = drawable_rows(descent)
    world = to_world(np.stack([rows["u"], rows["v"]], axis=-1), descent.slope.angle)
    panels = (
        ("vertical velocity, upwards", "vertical [m/s]", world[:, 1]),
        ("horizontal velocity, downhill", "horizontal [m/s]", world[:, 0]),
        ("angular velocity, counter-clockwise", "ω [rad/s]", rows["omega"]),
    )
    with styled():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 7.4), layout="constrained")
        axes: list[Axes] = list(figure.subplots(3, 1, sharex=True))
        for number, ax, (title, unit, values) in zip((12, 13, 14), axes, panels, strict=True):
            shade_contacts(ax, descent, 1.0)
            ax.axhline(0.0, color=INK, lw=0.6)
            ax.plot(rows["t"], values, color=BLUE)
            ax.set_title(f"Fig. {number}: {title}" if paper else title, loc="left")
            ax.set_ylabel(unit)
        axes[-1].set_xlabel("time [s]")
        axes[-1].set_xlim(rows["t"][0], rows["t"][-1])
        figure.suptitle(plain(note), x=0.01, ha="left", fontsize=10.0)
        figure.align_ylabels(axes)
        figure.legend(handles=[contact_key()], loc="outside lower center")
    return figure


def plot_impact_phases(descent: Descent, *, note: str = "") -> Figure:
    """Plot the normal force of the first contact over time, with its two phases: the paper's Fig. 2.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``; the first contact takes time.
    note : str
        Written above the axes.

    Returns
    -------
    Figure
        The areas are the impulses of the phases.

    Raises
    ------
    ValueError
        If the trajectory is missing or has no contact that takes time.
    """
    rows = first_contact(descent)
    turn = opening(descent, rows)
    begin, middle, end = (1e3 * float(rows["t"][i]) for i in (0, turn, -1))
    with styled():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 4.4), layout="constrained")
        ax = figure.subplots()
        phases = (("I", rows[: turn + 1], SKY, begin, middle, 1), ("II", rows[turn:], ORANGE, middle, end, 2))
        for name, part, colour, start, stop, number in phases:
            impulse = float(np.trapezoid(part["normal"], part["t"]))
            label = f"phase {name}: $S_{{N{name}}}$ = {impulse:.4g} N s"
            ax.fill_between(1e3 * part["t"], part["normal"], color=colour, alpha=0.35, lw=0.0, label=label)
            height = 1.08 * float(rows["normal"].max())
            ax.annotate("", (start, height), (stop, height), arrowprops={"arrowstyle": "<->", "color": INK})
            words = f"$\\tau_{number}$ = {stop - start:.2f} ms"
            ax.text(0.5 * (start + stop), 1.02 * height, words, ha="center", va="bottom")
        ax.plot(1e3 * rows["t"], rows["normal"], color=BLUE)
        ax.axvline(middle, color=INK, lw=0.8, ls=DASHES)
        ax.set_xlim(begin, end)
        ax.set_ylim(0.0, 1.2 * float(rows["normal"].max()))
        ax.set_xlabel("time [ms]")
        ax.set_ylabel("normal force P(t) [N]")
        ax.set_title(plain(note), loc="left")
        ax.legend(loc="center right")
    return figure


def plot_sliding_end(panels: Mapping[str, Descent], *, note: str = "") -> Figure:
    """Plot normal and tangential force of first contacts in which sliding stops, over time: the paper's Fig. 4.

    Parameters
    ----------
    panels : mapping of str to Descent
        Title to a descent simulated with ``record="trajectory"``, whose first contact takes time.
    note : str
        Written above the panels.

    Returns
    -------
    Figure
        One column for each title: normal force, tangential force within its bounds; when sliding stops.

    Raises
    ------
    ValueError
        If there are no panels, or a trajectory is missing or has no contact that takes time.
    """
    if not checked_mapping("panels", panels):
        raise ValueError("panels is empty: there is nothing to draw")
    with styled():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(WIDTH, 5.6), layout="constrained")
        grid = figure.subplots(2, len(panels), sharex=True, sharey="row", squeeze=False)
        for (upper, lower), (title, descent) in zip(grid.T, panels.items(), strict=True):
            rows = first_contact(descent)
            t = 1e3 * rows["t"]
            touching = rows["contacts"]["x"][:, 0]
            bound = descent.slope.friction_at(touching, descent.law.friction) * rows["normal"]
            upper.plot(t, rows["normal"], color=BLUE)
            upper.set_title(plain(title), loc="left")
            lower.fill_between(t, -bound, bound, color=SHADE, lw=0.0, label="$|F| \\leq f P$")
            lower.plot(t, rows["tangential"], color=RED, label="F(t)")
            lower.axhline(0.0, color=INK, lw=0.6)
            turn = float(t[opening(descent, rows)])
            for ax in (upper, lower):
                ax.axvline(turn, color=INK, lw=0.8, ls=DASHES, label="end of the first phase")
                ax.set_xlim(t[0], t[-1])
            if (rows["slip"] == 0).any():
                stop = float(t[np.argmax(rows["slip"] == 0)])
                for ax in (upper, lower):
                    ax.axvline(stop, color=GREEN, lw=1.2, label="sliding stops")
                upper.set_xlabel(f"sliding stops at {stop:.2f} ms", color=GREEN)
            lower.set_xlabel("time [ms]")
        grid[0, 0].set_ylabel("normal force P(t) [N]")
        grid[1, 0].set_ylabel("tangential force F(t) [N]")
        figure.suptitle(plain(note), x=0.01, ha="left", fontsize=10.0)
        figure.legend(*grid[1, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure
