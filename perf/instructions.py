"""Instructions a hop, counted by valgrind: the same number however busy the machine is.

A process simulates N descents of the reference and another one 2 N; the difference is the work of N descents, without
the start of Python. Both are compiled for a generic processor, which is what valgrind knows, so the number serves to
compare one state of the code with another, not to predict time.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from perf.harness import table
from perf.reference import BODY, FEW, LAUNCH, LAW, SLOPE, settings

LANES = 2000
BASELINE = Path(__file__).parent / "baseline.json"
_SOLVERS = ("compliant", "rigid")


def _work(solver: Any, lanes: int) -> None:
    import sledenv

    options = settings(solver=solver, max_rebounds=FEW)
    sledenv.simulate_batch(BODY, LAW, SLOPE, np.tile(LAUNCH, (lanes, 1)), **options)


def _count(solver: str, lanes: int, cache: str) -> int:
    """Instructions of a process that simulates so many descents."""
    environment = {
        **os.environ,
        "NUMBA_CACHE_DIR": cache,
        "NUMBA_CPU_NAME": "generic",
        "NUMBA_CPU_FEATURES": "",
        "NUMBA_NUM_THREADS": "1",
        "PYTHONHASHSEED": "0",
    }
    command = [sys.executable, "-m", "perf.instructions", solver, str(lanes)]
    # Compile outside valgrind, which would take half an hour.
    subprocess.run(command, env=environment, cwd=Path(__file__).parents[1], check=True)
    counted = subprocess.run(
        ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", *command],
        env=environment,
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
        check=True,
    )
    found = re.search(r"Collected : (\d+)", counted.stderr)
    if found is None:
        raise RuntimeError(f"valgrind did not count:\n{counted.stderr}")
    return int(found[1])


def main() -> None:
    """Count, and compare with the committed baseline; ``--update`` replaces it."""
    if shutil.which("valgrind") is None:
        raise SystemExit("valgrind not found: install it")
    baseline = json.loads(BASELINE.read_text())
    before = baseline.get("instructions_per_hop", {})
    now = {}
    with tempfile.TemporaryDirectory() as cache:
        for solver in _SOLVERS:
            once, twice = (_count(solver, lanes, cache) for lanes in (LANES, 2 * LANES))
            now[solver] = round((twice - once) / (LANES * FEW))
    rows = [
        (solver, f"{now[solver]:,}", f"{before[solver]:,}", f"{now[solver] / before[solver] - 1.0:+.1%}")
        if solver in before
        else (solver, f"{now[solver]:,}", "-", "-")
        for solver in _SOLVERS
    ]
    print(table(("instructions a hop", "now", "baseline", "change"), rows))
    if "--update" in sys.argv:
        baseline["instructions_per_hop"] = now
        BASELINE.write_text(json.dumps(baseline, indent=1) + "\n")


if __name__ == "__main__":
    if len(sys.argv) == 3:
        _work(sys.argv[1], int(sys.argv[2]))
    else:
        main()
