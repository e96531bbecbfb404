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
from importlib.metadata import distributions
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

_K = TypeVar("_K")
Floats = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).parent / "results"
_PACKAGES = "sledenv numpy numba llvmlite scipy mujoco pymunk Box2D highway-env gymnasium stable_baselines3 torch"


def timed(
    run: Callable[[], Any], units: float, part: float = 0.02, total: float = 0.0, *, cpu: bool = False
) -> Callable[[], float]:
    """Return what measures the wall time [s], or the CPU time, of a unit of work, of which one run does so many.

    The run is made twice here, so that nothing is compiled while it is timed, and repeated in each timing until it has
    taken ``part`` [s]. With ``total`` [s] such parts are timed until they have taken so long together, and the least
    counts: what else the machine does only adds, and most of it in bursts. The garbage collector waits meanwhile.
    """

    def seconds(repeats: int) -> float:
        clock = time.process_time if cpu else time.perf_counter
        start = clock()
        for _ in range(repeats):
            run()
        return clock() - start

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
    save(name, module.measure(**options))
    if hasattr(module, "draw"):
        module.draw(load(name))
