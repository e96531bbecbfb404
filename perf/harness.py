"""What all measurements share: turns, timings, statistics, and results that say where, when and with what."""

from __future__ import annotations

import datetime
import gc
import importlib
import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import distributions
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LEAST = 0.02  # [s] that one timing should take at least
_K = TypeVar("_K")
Floats = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).parent / "results"
_PACKAGES = "sledenv numpy numba llvmlite scipy heyoka mujoco pymunk Box2D gymnasium stable_baselines3 torch"


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


def timed(run: Callable[[], Any], units: float, part: float = 0.02, total: float = 0.0) -> Callable[[], float]:
    """Return what measures the wall time [s] of a unit of work, of which one run does so many.

    The run is made twice here, so that nothing is compiled while it is timed, and repeated in each timing until it has
    taken ``part`` [s]. With ``total`` [s] such parts are timed until they have taken so long together, and the least
    counts: what else the machine does only adds, and most of it in bursts. The garbage collector waits meanwhile.
    """

    def seconds(repeats: int) -> float:
        start = time.perf_counter()
        for _ in range(repeats):
            run()
        return time.perf_counter() - start

    run()
    repeats = max(1, round(part / max(seconds(1), 1e-7)))

    def measure() -> float:
        gc.collect()
        gc.disable()
        try:
            parts = [seconds(repeats)]
            while sum(parts) < total:
                parts.append(seconds(repeats))
        finally:
            gc.enable()
        return min(parts) / (repeats * units)

    return measure


def take_turns(measures: Mapping[_K, Callable[[], Any]], rounds: int) -> dict[_K, Floats]:
    """Take all measurements in turn, each once a round, the order rotated from round to round.

    What each of them has found is an array of shape (rounds,), or (rounds, m) where it gives m numbers.
    """
    names = list(measures)
    found: dict[_K, list[Any]] = {name: [] for name in names}
    for i in range(rounds):
        for k in range(len(names)):
            name = names[(i + k) % len(names)]
            found[name].append(measures[name]())
    return {name: np.array(values) for name, values in found.items()}


def spread(values: Floats) -> dict[str, float]:
    """Median, quartiles and least of repeated measurements."""
    low, median, high = np.quantile(values, (0.25, 0.5, 0.75))
    return {"median": float(median), "low": float(low), "high": float(high), "least": float(values.min())}


def ratio(slow: Floats, fast: Floats) -> dict[str, float]:
    """How many times faster, round by round, so that what slows a whole round down cancels."""
    return spread(slow / fast)


def python(*arguments: str, under: Sequence[str] = (), **environment: str) -> str:
    """Return what a new Python process prints, run in the root of the checkout; RuntimeError if it fails."""
    given = {**os.environ, **environment}
    given.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its byte code
    command = [*under, sys.executable, *arguments]
    done = subprocess.run(
        command, cwd=ROOT, env=given, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"a new process has failed: {done.stderr.strip().splitlines()[-1:]}")
    return done.stdout


def git(*arguments: str) -> str:
    """Return what git prints of this checkout, nothing if it fails."""
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
    return "" if done.returncode else done.stdout.strip()


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def stamp() -> dict[str, Any]:
    """Where, when and with what a result was measured."""
    installed = {one.metadata["Name"]: one.version for one in distributions()}
    changed = [line for line in git("status", "--porcelain").splitlines() if "perf/results" not in line]
    return {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "commit": git("rev-parse", "--short", "HEAD") + ("+changes" if changed else ""),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "load": [round(load, 2) for load in os.getloadavg()],  # of 1, 5 and 15 minutes
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": {package: installed.get(package, "missing") for package in _PACKAGES.split()},
    }


def save(name: str, result: Mapping[str, Any]) -> None:
    """Write a stamped result to perf/results/NAME.json, all or nothing."""
    part = RESULTS / f"{name}.part"
    part.write_text(json.dumps({"stamp": stamp(), **result}, indent=1) + "\n")
    part.replace(RESULTS / f"{name}.json")


def load(name: str) -> dict[str, Any]:
    """Read a result."""
    found: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text())
    return found


def run(name: str, **options: Any) -> None:
    """Measure what the module of a name measures, save the result and draw it, if the module draws."""
    module = importlib.import_module(f"perf.{name}")
    if hasattr(module, "main"):
        module.main(**options)
        return
    save(name, module.measure(**options))
    if hasattr(module, "draw"):
        module.draw(load(name))


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
