"""Colours, widths, titles and shades that all figures share."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

from sledenv.machine.extras import needs
from sledenv.simulation.outcomes import Descent

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes


# Okabe and Ito's colours, which stay apart for colour-blind readers.
BLUE, SKY, GREEN, ORANGE, RED, PURPLE = "#0072B2", "#56B4E9", "#009E73", "#E69F00", "#D55E00", "#CC79A7"
INK, GROUND, SHADE, POTENTIAL = "#333333", "#E3E7EC", "#E9EDF2", "#BFC8D2"
STYLE: dict[str, Any] = {
    "text.usetex": False,
    "font.size": 11.0,
    "axes.titlesize": 11.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
}
DASHES = (0, (4, 3))
WIDTH = 9.0  # [in]


def styled(more: dict[str, Any] | None = None) -> AbstractContextManager[None]:
    """Return the context in which figures are drawn, with ``more`` settings of matplotlib."""
    with needs("plot", "figures"):
        import matplotlib
    settings: Any = STYLE | (more or {})  # matplotlib types the names of its settings
    return matplotlib.rc_context(settings)


def plain(text: str) -> str:
    """Return a text of the user's so that a figure has it as it stands: dollars do not begin a formula."""
    return text.replace("$", r"\$")


def outcome(descent: Descent, label: str = "") -> str:
    """Return a title: what a descent is called, if it is, and how it ended."""
    called = f"{plain(label)}: " if label else ""
    return f"{called}{descent.status} after {descent.time:.2f} s, reward {float(descent.jam.reward):.2f}"


def shade_contacts(ax: Axes, descent: Descent, scale: float) -> None:
    """Shade the times of contact; ``scale`` is that of the time axis."""
    for rebound in descent.rebounds:
        end = scale * rebound["t"]
        ax.axvspan(end - scale * rebound["duration"], end, facecolor=SHADE, edgecolor=SHADE, lw=0.8, zorder=0)


def contact_key() -> Artist:
    """Return the entry of the legend for what :func:`shade_contacts` shades."""
    from matplotlib.patches import Patch

    return Patch(facecolor=SHADE, label="in contact")
