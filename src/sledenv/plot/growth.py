"""The figure of small differences of the launch, which grow from rebound to rebound until the events change."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from sledenv.plot.style import BLUE, DASHES, GREEN, INK, PURPLE, RED, SKY, WIDTH, outcome, styled
from sledenv.simulation.rules import checked_kind
from sledenv.simulation.sensitivity import LAUNCH, Sensitivity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LEAST = 1e-6  # a singular value below this is that of a motion which a contact has stopped
_MAJOR: dict[str, Any] = {"color": RED, "lw": 2.4, "ms": 6.0}
_MINOR: dict[str, Any] = {"color": INK, "lw": 1.0, "ms": 4.0, "alpha": 0.6}
_COLOURS = dict(zip(LAUNCH, (INK, SKY, BLUE, GREEN, PURPLE, RED), strict=True))
_SYMBOLS = {"phi": "\N{GREEK SMALL LETTER PHI}", "omega": "\N{GREEK SMALL LETTER OMEGA}"}


def plot_growth(found: Sensitivity) -> Figure:
    """Plot the growth of small differences rebound by rebound, and the distances to another sequence of events.

    Parameters
    ----------
    found : Sensitivity
        With all fields of the launch among its parameters.

    Returns
    -------
    Figure
        Above, the singular values of the derivative of the state after each rebound by the launch, in natural units:
        the largest is what a small difference has grown by at most. Below, over the same rebounds, by how much each
        field of the launch may change, in the same units, until the events up to there change.

    Raises
    ------
    TypeError, ValueError
        If it is no Sensitivity, there is no rebound, or a field of the launch is not among the parameters.
    """
    growth, count = checked_kind("found", found, Sensitivity).growth, len(found.rebounds)
    if count == 0:
        raise ValueError("the descent has no rebound over which a difference could grow")
    with styled():
        from matplotlib.figure import Figure
        from matplotlib.ticker import MaxNLocator

        figure = Figure(figsize=(WIDTH, 6.5), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True)
        _draw_growth(above, growth)
        _draw_distances(below, found)
        below.set_xlim(0.5, count + 0.5)
        below.xaxis.set_major_locator(MaxNLocator(integer=True))
        below.set_xlabel("rebound")
        figure.suptitle(outcome(found.descent), x=0.01, ha="left", fontsize=11.0)
    return figure


def _draw_growth(ax: Axes, growth: np.ndarray) -> None:
    rebounds = np.arange(1, len(growth) + 1)
    for i, values in enumerate(growth.T):
        shown = np.where(values > _LEAST, values, np.nan)
        label = {0: "largest", 1: "others"}.get(i)
        ax.plot(rebounds, shown, marker="o", label=label, **(_MINOR if i else _MAJOR))
    ax.axhline(1.0, color=INK, lw=0.6, ls=DASHES)
    ax.set_yscale("log")
    ax.set_ylabel("growth of a difference")
    ax.set_title("Singular values of the derivative of the state after a rebound by the launch", loc="left")
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _draw_distances(ax: Axes, found: Sensitivity) -> None:
    rebounds = np.arange(1, len(found.rebounds) + 1)
    for name, unit in zip(LAUNCH, found.units, strict=True):
        distances = found.distances[:-1, found.parameters.index(name)].min(axis=-1) / unit
        if np.isfinite(distances).any():
            shown = np.where(np.isfinite(distances) & (distances > 0.0), distances, np.nan)
            symbol = _SYMBOLS.get(name, name)
            label = f"{symbol} (at once)" if (distances == 0.0).any() else symbol
            ax.plot(rebounds, shown, color=_COLOURS[name], marker="o", ms=4.0, label=label)
    ax.set_yscale("log")
    ax.set_ylabel("smallest change [natural units]")
    ax.set_title("Smallest change of one field of the launch that changes the events up to a rebound", loc="left")
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    else:
        ax.text(0.5, 0.5, "none was found", transform=ax.transAxes, ha="center")
