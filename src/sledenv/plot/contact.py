"""The contact forces of a descent over time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sledenv.descent import Descent
from sledenv.outline import drawable_rows
from sledenv.plot.energy import kinetic
from sledenv.plot.style import BLUE, GREEN, INK, RED, WIDTH, contact_key, shade_contacts, styled, touching_arms

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
        Normal force, tangential force, total moment about the mass centre, kinetic energy.

    Raises
    ------
    ImportError
        If matplotlib is missing.
    ValueError
        If the trajectory is missing or has fewer than two rows in the interval.
    """
    rows = drawable_rows(descent)
    rows = rows[(rows["t"] >= start) & (rows["t"] <= stop)]
    if len(rows) < 2:
        raise ValueError(f"start = {start!r}, stop = {stop!r}: fewer than two rows of the trajectory lie in between")
    a, b = touching_arms(descent, rows)
    moment = -a * rows["normal"] + b * rows["tangential"] + rows["rolling"]
    translation, rotation = kinetic(descent, rows)
    panels = (
        ("N [N]\nnormal force", rows["normal"], BLUE),
        ("F [N]\ntangential force", rows["tangential"], RED),
        ("moment [N m]\nabout the mass centre", moment, GREEN),
        ("T [J]\nkinetic energy", translation + rotation, INK),
    )
    brief = rows["t"][-1] - rows["t"][0] < 0.5
    scale, unit = (1e3, "ms") if brief else (1.0, "s")
    with styled():
        from matplotlib.figure import Figure

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
        figure.legend(handles=[contact_key()], loc="outside lower center")
    return figure
