"""What all measurements share: interleaved timing, statistics, stamped results, and the look of the plots."""

from __future__ import annotations

import datetime
import gc
import json
import os
import platform
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RESULTS = Path(__file__).parent / "results"
_PACKAGES = (
    "sledenv",
    "numpy",
    "numba",
    "llvmlite",
    "scipy",
    "heyoka",
    "mujoco",
    "pymunk",
    "Box2D",
    "gymnasium",
    "stable_baselines3",
    "torch",
)
_LEAST = 0.02  # [s] that one timing should take at least

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


class Competitor(NamedTuple):
    """One way to do a piece of work."""

    name: str
    run: Callable[[], Any]
    units: float  # of work that one run does: hops, steps, lanes


def interleave(competitors: Sequence[Competitor], rounds: int, least: float = _LEAST) -> dict[str, NDArray[np.float64]]:
    """Time all competitors in turn, once a round, the order rotated from round to round.

    Parameters
    ----------
    competitors : sequence of Competitor
        Each is run once beforehand, so that nothing is compiled while timed.
    rounds : int
    least : float
        A competitor faster than this [s] is repeated within each of its turns.

    Returns
    -------
    dict of str to ndarray, shape (rounds,)
        Wall time [s] a unit of work, round by round.
    """
    repeats = []
    for competitor in competitors:
        competitor.run()
        start = time.perf_counter()
        competitor.run()
        repeats.append(max(1, round(least / max(time.perf_counter() - start, 1e-7))))
    seconds = np.empty((len(competitors), rounds))
    gc.collect()
    gc.disable()
    try:
        for i in range(rounds):
            for k in range(len(competitors)):
                j = (i + k) % len(competitors)
                run = competitors[j].run
                start = time.perf_counter()
                for _ in range(repeats[j]):
                    run()
                seconds[j, i] = (time.perf_counter() - start) / (repeats[j] * competitors[j].units)
            gc.collect()
    finally:
        gc.enable()
    return {competitor.name: seconds[j] for j, competitor in enumerate(competitors)}


def spread(values: NDArray[np.float64]) -> dict[str, float]:
    """Median, quartiles and least of repeated measurements."""
    low, median, high = np.quantile(values, (0.25, 0.5, 0.75))
    return {"median": float(median), "low": float(low), "high": float(high), "least": float(values.min())}


def ratio(slow: NDArray[np.float64], fast: NDArray[np.float64]) -> dict[str, float]:
    """How many times faster, round by round, so that what slows a whole round down cancels."""
    return spread(slow / fast)


def _git(*arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=Path(__file__).parent, capture_output=True, text=True, check=False)
    return done.stdout.strip()


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def stamp() -> dict[str, Any]:
    """Where, when and with what a result was measured."""
    versions = {}
    for name in _PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "missing"
    changed = [line for line in _git("status", "--porcelain").splitlines() if "perf/results" not in line]
    return {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "commit": _git("rev-parse", "--short", "HEAD") + ("+changes" if changed else ""),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "load": [round(load, 2) for load in os.getloadavg()],  # of 1, 5 and 15 minutes
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": versions,
    }


def save(name: str, result: Mapping[str, Any]) -> Path:
    """Write a stamped result to perf/results/NAME.json, all or nothing."""
    RESULTS.mkdir(exist_ok=True)
    target = RESULTS / f"{name}.json"
    part = target.with_suffix(".part")
    part.write_text(json.dumps({"stamp": stamp(), **result}, indent=1) + "\n")
    part.replace(target)
    return target


def load(name: str) -> dict[str, Any]:
    """Read a result."""
    found: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text())
    return found


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


def bars(
    ax: Axes, names: Sequence[str], stats: Sequence[Mapping[str, float]], colours: Sequence[str], unit: str
) -> None:
    """Draw horizontal bars of medians on a logarithmic axis, with quartiles and the number beside each."""
    rows = np.arange(len(names))[::-1]
    medians = np.array([stat["median"] for stat in stats])
    errors = np.array([[s["median"] - s["low"] for s in stats], [s["high"] - s["median"] for s in stats]])
    ax.barh(rows, medians, xerr=errors, color=list(colours), height=0.7, error_kw={"ecolor": INK, "lw": 1.0})
    for row, median, stat in zip(rows, medians, stats, strict=True):
        ax.text(stat["high"] * 1.12, row, figure_of(median), va="center", fontsize=9.5)
    ax.set_xscale("log")
    ax.set_xlim(medians.min() / 3.0, medians.max() * 6.0)
    ax.set_yticks(rows, list(names))
    ax.set_xlabel(unit)
    ax.grid(axis="y", visible=False)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; all but the first column align right."""
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def figure_of(value: float) -> str:
    """Return three significant digits, with separators instead of exponents where they are few."""
    if value == 0.0 or 1e-3 <= abs(value) < 1e7:
        digits = max(0, 2 - int(np.floor(np.log10(abs(value))))) if value else 0
        return f"{value:,.{digits}f}"
    return f"{value:.2e}"


def with_quartiles(stat: Mapping[str, float], scale: float = 1.0) -> str:
    """Return median with quartiles in brackets."""
    return f"{figure_of(scale * stat['median'])} [{figure_of(scale * stat['low'])}, {figure_of(scale * stat['high'])}]"
