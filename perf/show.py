"""How numbers are shown: tables in Markdown, and pictures of one look."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from perf.harness import RESULTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Columns = Mapping[str, Callable[[Any], str]]  # of a table: what each says of a row

# Okabe and Ito's colours, which stay apart for colour-blind readers.
BLUE, SKY, GREEN, ORANGE, RED, PURPLE = "#0072B2", "#56B4E9", "#009E73", "#E69F00", "#D55E00", "#CC79A7"
INK, GREY = "#333333", "#8A949E"
_STYLE: dict[str, Any] = {
    "font.size": 11.0,
    "axes.titlesize": 11.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.grid": True,
    "grid.color": "#E3E7EC",
    "axes.axisbelow": True,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "savefig.dpi": 130,
}


def table(rows: Iterable[Any], columns: Columns) -> str:
    """Return a Markdown table of what each column says of a row; all but the first column align right."""
    lines = [list(columns), ["---", *["---:"] * (len(columns) - 1)]]
    lines += [[say(row) for say in columns.values()] for row in rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def number(value: float) -> str:
    """Return three significant digits, with separators instead of exponents where they are few."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e7:
        digits = max(0, 2 - int(np.floor(np.log10(abs(value))))) if value else 0
        return f"{value:,.{digits}f}"
    return f"{value:.2e}"


def median(stat: Mapping[str, float]) -> str:
    """Return the median of what :func:`perf.harness.spread` has found."""
    return number(stat["median"])


def quartiles(stat: Mapping[str, float]) -> str:
    """Return the median with the quartiles in brackets."""
    return f"{median(stat)} [{number(stat['low'])}, {number(stat['high'])}]"


def percent(stat: Mapping[str, float], digits: int = 1) -> str:
    """Return the median of shares in per cent."""
    return f"{100.0 * stat['median']:.{digits}f} %"


@contextmanager
def drawing(name: str, size: tuple[float, float], panels: tuple[int, int] = (1, 1)) -> Iterator[tuple[Figure, Any]]:
    """Yield a figure and its axes in the style of all plots; write it to perf/results/NAME.png."""
    import matplotlib as mpl

    style: Any = _STYLE
    with mpl.rc_context(style):
        from matplotlib.figure import Figure

        figure = Figure(figsize=size, layout="constrained")
        yield figure, figure.subplots(*panels)
        figure.savefig(RESULTS / f"{name}.png")


def errors(stats: Sequence[Mapping[str, float]]) -> list[list[float]]:
    """Distances of the quartiles from the medians, as matplotlib wants them."""
    return [[stat["median"] - stat["low"] for stat in stats], [stat["high"] - stat["median"] for stat in stats]]
