"""Instructions a hop, counted by valgrind: the same number however busy the machine is.

A process simulates N descents of the reference and another one 2 N; the difference is the work of N descents, without
the start of Python. Both are compiled for a generic processor, which is what valgrind knows, so the number serves to
compare one state of the code with another, not to predict time.

``python -m perf.instructions`` compares with perf/baseline.json, ``--update`` makes the numbers the baseline.
"""

from __future__ import annotations

import re
import sys
import tempfile

import numpy as np

import sledenv
from perf.harness import python
from perf.reference import BODY, FEW, LAUNCH, LAW, SLOPE, settings
from perf.work import compare

LANES = 2000
_GENERIC = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
_VALGRIND = ("valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", "--log-fd=1")


def _work(solver: str, lanes: int) -> None:
    options = settings(solver=solver, max_rebounds=FEW)
    sledenv.simulate_batch(BODY, LAW, SLOPE, np.tile(LAUNCH, (lanes, 1)), **options)


def _count(solver: str, lanes: int, cache: str) -> int:
    """Instructions of a process that simulates so many descents."""
    program = "-m", "perf.instructions", solver, str(lanes)
    environment = {"NUMBA_CACHE_DIR": cache, **_GENERIC}
    python(*program, **environment)  # compiles outside valgrind, which would take half an hour
    said = python(*program, under=_VALGRIND, **environment)
    found = re.search(r"Collected : (\d+)", said)
    if found is None:
        raise RuntimeError(f"valgrind did not count:\n{said}")
    return int(found[1])


def main() -> None:
    """Count, and compare with the committed baseline."""
    now: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as cache:
        for solver in ("compliant", "rigid"):
            once, twice = (_count(solver, lanes, cache) for lanes in (LANES, 2 * LANES))
            now[solver] = round((twice - once) / (LANES * FEW))
    compare("instructions_per_hop", now)


if __name__ == "__main__":
    if len(sys.argv) == 3:
        _work(sys.argv[1], int(sys.argv[2]))
    else:
        main()
