"""Timing in turns, and results with their provenance, which docs/performance.md shows."""

from __future__ import annotations

import datetime
import json
import os
import platform
import re
import subprocess
import time
import timeit
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import distributions
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from sledenv.command.doctor import processor
from sledenv.machine.text_tables import markdown

_K = TypeVar("_K")
Floats = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).parent / "results"
DOCUMENT = ROOT / "docs" / "performance.md"
_PACKAGES = "numpy", "numba", "mujoco", "pymunk", "Box2D", "highway-env", "gymnasium", "stable_baselines3"


def timed(run: Callable[[], Any], units: float) -> Callable[[], float]:
    """Return what measures the CPU time [s] per unit of work, of which one run does so many.

    The run is made here first, so that nothing is compiled while it is timed, and repeated in each measurement until it
    has taken 0.2 s, without garbage collection.
    """
    run()
    timer = timeit.Timer(run, timer=time.process_time)
    repeats, _ = timer.autorange()
    return lambda: timer.timeit(repeats) / (repeats * units)


def take_turns(measures: Mapping[_K, Callable[[], float]], rounds: int) -> dict[_K, Floats]:
    """Take all measurements in turn, each once per round, the order rotated from round to round."""
    names = list(measures)
    found: dict[_K, list[float]] = {name: [] for name in names}
    for i in range(rounds):
        for k in range(len(names)):
            name = names[(i + k) % len(names)]
            found[name].append(measures[name]())
    return {name: np.array(values) for name, values in found.items()}


def spread(values: Floats) -> dict[str, float]:
    """Return median, quartiles and least of repeated measurements."""
    low, median, high = np.quantile(values, (0.25, 0.5, 0.75))
    return {"median": float(median), "low": float(low), "high": float(high), "least": float(values.min())}


def number(value: float) -> str:
    """Return three significant digits, with separators instead of exponents."""
    digits = max(0, 2 - int(np.floor(np.log10(abs(value))))) if value else 0
    return f"{value:,.{digits}f}"


def stamp() -> dict[str, Any]:
    """Return where, when and with what a result is measured."""
    installed = {one.metadata["Name"]: one.version for one in distributions()}
    commit = subprocess.run(["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True)
    return {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "commit": commit.stdout.strip(),
        "processor": processor(),
        "cores": os.cpu_count(),
        "load": [round(load, 2) for load in os.getloadavg()],  # of 1, 5 and 15 minutes
        "python": platform.python_version(),
        "versions": {package: installed[package] for package in _PACKAGES if package in installed},
    }


def publish(name: str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write stamped rows to perf/results/NAME.json and their table into docs/performance.md."""
    text = json.dumps({"stamp": stamp(), "rows": rows}, indent=1)  # complete before a file is touched
    (RESULTS / f"{name}.json").write_text(text + "\n")
    DOCUMENT.write_text(render(DOCUMENT.read_text()))


def render(text: str) -> str:
    """Return the document with the table of each result between its two marks."""
    return re.sub(r"(<!-- (\w+): begin -->\n).*?(<!-- \2: end -->)", _block, text, flags=re.DOTALL)


def _block(found: re.Match[str]) -> str:
    result = json.loads((RESULTS / f"{found[2]}.json").read_text())
    of = result["stamp"]
    packages = ", ".join(f"{package} {version}" for package, version in of["versions"].items())
    made = (
        f"*{of['date']}, commit {of['commit']}, {of['processor']}, {of['cores']} cores, load {of['load'][2]:.2f} over "
        f"the last 15 minutes, Python {of['python']}, {packages}*"
    )
    return f"{found[1]}{made}\n\n{_table(result['rows'])}{found[3]}"


def _table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return rows as Markdown: medians, and "-" where a row has no such number."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    return markdown(names, ([_cell(row.get(name, "-")) for name in names] for row in rows))


def _cell(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return f"{value:.1e}"
    return number(value["median"])
