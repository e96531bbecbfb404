"""Figures of the contacts of a descent over time: forces, slip and stick."""

from __future__ import annotations

import math
from itertools import cycle
from typing import TYPE_CHECKING, Final

import numpy as np

from sledenv.plot.style import (
    BLUE,
    DASHES,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    RED,
    SKY,
    WIDTH,
    contact_key,
    plain,
    shade_contacts,
    styled,
)
from sledenv.plot.trajectories import by_label, kinetic, rows_between, touches_in
from sledenv.simulation.outcomes import Descent

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROUNDING: Final = 1e-12  # of the largest force: less is that of a zero
_FORCES: Final = ("normal", "tangential")
_SEVERAL: Final = (SKY, ORANGE, PURPLE, GREEN, RED, BLUE)  # contacts, where there is not one alone


def plot_impact(descent: Descent, start: float = 0.0, stop: float = math.inf) -> Figure:
    """Plot forces, moment and kinetic energy over time: the paper's Fig. 7-10.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``.
    start, stop : float
        Interval of time [s].

    Returns
    -------
    Figure
        Normal force, tangential force, total moment about the mass centre, kinetic energy. Where several parts of the
        body touch, or one does a profile at several places, the forces of each are drawn beside their sums.

    Raises
    ------
    ValueError
        If the trajectory is missing or has fewer than two rows in the interval.
    """
    rows = rows_between(descent, start, stop)
    touches = touches_in(descent.body, rows)
    moment = touches.by_row(touches.moment, rows) + rows["rolling"]
    normal, tangential = (by_label(descent, touches.forces, touches.forces[of], len(rows)) for of in _FORCES)
    translation, rotation = kinetic(descent, rows)
    panels = (
        ("N [N]\nnormal force", rows["normal"], BLUE),
        ("F [N]\ntangential force", rows["tangential"], RED),
        ("moment [N m]\nabout the mass centre", moment, GREEN),
        ("T [J]\nkinetic energy", translation + rotation, INK),
    )
    scale, unit = _time_scale(rows)
    with styled():
        from matplotlib.figure import Figure
        from matplotlib.lines import Line2D

        figure = Figure(figsize=(WIDTH, 5.6), layout="constrained")
        grid = figure.subplots(2, 2, sharex=True)
        for ax, (label, values, colour) in zip(grid.flat, panels, strict=True):
            shade_contacts(ax, descent, scale)
            ax.axhline(0.0, color=INK, lw=0.6)
            ax.plot(scale * rows["t"], values, color=colour)
            ax.set_ylabel(label)
            ax.set_xlim(scale * rows["t"][0], scale * rows["t"][-1])
        for ax in grid[1]:
            ax.set_xlabel(f"time [{unit}]")
        figure.align_ylabels(grid)
        handles = [contact_key()]
        if len(normal) > 1:
            for ax, parts in zip(grid[0], (normal, tangential), strict=True):
                for colour, values in zip(cycle(_SEVERAL), parts.values(), strict=False):
                    ax.plot(scale * rows["t"], values, color=colour, lw=1.2)
            keys = zip(cycle(_SEVERAL), normal, strict=False)
            handles += [Line2D([], [], color=colour, lw=1.2, label=plain(label)) for colour, label in keys]
        figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 5))
    return figure


def plot_slip(descent: Descent, start: float = 0.0, stop: float = math.inf) -> Figure:
    """Plot the slip velocity and how much of the friction is used, over time, with stick and slip shaded.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``.
    start, stop : float
        Interval of time [s].

    Returns
    -------
    Figure
        Slip velocity of each contact; friction force over its bound, F/(f N) in [-1, 1], -1 or 1 where it slips. Where
        several parts of the body touch, or one does a profile at several places, each has its line.

    Raises
    ------
    ValueError
        If the trajectory is missing, has fewer than two rows in the interval, or none in contact there.
    """
    rows = rows_between(descent, start, stop)
    touching = rows["touching"] > 0
    if not touching.any():
        raise ValueError(f"start = {start!r}, stop = {stop!r}: the body flies all the time")
    scale, unit = _time_scale(rows)
    touches = touches_in(descent.body, rows)
    forces = touches.forces
    bound = _friction(descent, rows) * forces["normal"]
    loaded = (bound > 0.0) & (forces["normal"] > _ROUNDING * forces["normal"].max())
    used = np.divide(forces["tangential"], bound, out=np.full(len(forces), np.nan), where=loaded)
    curves = [by_label(descent, forces, values, len(rows)) for values in (touches.slip_velocity, used)]
    t = scale * rows["t"]
    # A step of a contact has one mode from its first row to its last.
    lasting = touching[:-1] & touching[1:] & (np.diff(rows["t"]) > 0.0)
    sticks = lasting & (rows["slip"][:-1] == 0) & (rows["slip"][1:] == 0)
    with styled():
        from matplotlib.figure import Figure
        from matplotlib.patches import Patch

        figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
        axes: list[Axes] = list(figure.subplots(2, 1, sharex=True))
        kinds = ((ORANGE, "slips", lasting & ~sticks), (GREEN, "sticks", sticks))
        for ax in axes:
            for colour, _, mask in kinds:
                for first, last in _runs(mask):
                    ax.axvspan(t[first], t[last], color=colour, alpha=0.18, lw=0.0, zorder=0)
            ax.axhline(0.0, color=INK, lw=0.6)
            ax.set_xlim(t[0], t[-1])
        for ax, colour, parts in zip(axes, (BLUE, RED), curves, strict=True):
            for own, (label, values) in zip(cycle(_SEVERAL[2:]), parts.items(), strict=False):
                ax.plot(t, values, color=own if len(parts) > 1 else colour, label=plain(label))
        axes[0].set_ylabel("slip velocity $v_t$ [m/s]")
        for level in (-1.0, 1.0):
            axes[1].axhline(level, color=INK, lw=0.8, ls=DASHES)
        axes[1].set_ylim(-1.15, 1.15)
        axes[1].set_ylabel("friction used $F/(fN)$ [-]")
        axes[1].set_xlabel(f"time [{unit}]")
        handles: list[Artist] = [Patch(color=colour, alpha=0.18, label=label) for colour, label, _ in kinds]
        if len(curves[0]) > 1:
            handles += axes[0].get_legend_handles_labels()[0]
        figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 5))
        figure.align_ylabels(axes)
    return figure


def _friction(descent: Descent, rows: np.ndarray) -> np.ndarray:
    """Friction [-] of the contacts in rows of a trajectory, one behind the other.

    A step ends where a zone begins, and its last row has the friction of the others: that of half the way to the row
    before. The first one has that of half the way to the row behind.
    """
    number = np.arange(len(rows))
    ends = np.append(np.diff(rows["t"]) == 0.0, True)
    x = rows["contacts"]["x"]
    beside = np.clip(np.where(ends, number - 1, number + 1), 0, len(rows) - 1)
    same = (rows["touching"] == rows["touching"][beside])[:, np.newaxis]
    friction = descent.slope.friction_at(np.where(same, 0.5 * (x + x[beside]), x), descent.law.friction)
    return friction[np.arange(x.shape[1]) < rows["touching"][:, np.newaxis]]


def _time_scale(rows: np.ndarray) -> tuple[float, str]:
    """Return how many units of time a second has in a figure, and the unit."""
    brief: bool = rows["t"][-1] - rows["t"][0] < 0.5
    return (1e3, "ms") if brief else (1.0, "s")


def _runs(mask: np.ndarray) -> np.ndarray:
    """Return first and last row, shape (n, 2), of each run of intervals between rows for which ``mask`` holds."""
    edges = np.diff(np.concatenate([[0], mask.astype(int), [0]]))
    return np.stack([np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)], axis=-1)
