"""Instructions a hop, counted by valgrind: the same number however busy the machine is.

A process simulates N descents of the reference and another one 2 N; the difference is the work of N descents, without
the start of Python. Both run an object file that is made here for any processor of this kind, as valgrind does not know
all instructions of newer ones. So the number serves to compare one state of the code with another, not to predict time.

``python -m perf.instructions`` compares with perf/baseline.json, ``--update`` makes the numbers the baseline.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

import numpy as np

import sledenv
from perf.harness import python
from perf.reference import BODY, FEW, LAUNCH, LAW, SLOPE, settings
from perf.work import compare

LANES = 2000
_SETTINGS = {"NUMBA_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
_VALGRIND = ("valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", "--log-fd=1")
_MAKE = """
import sys
from pathlib import Path
from sledenv.compiler import build, targets
from sledenv.kernel.entries import LIBRARY
build.machine = lambda: targets.OTHER
build.make(LIBRARY, Path(sys.argv[1]), [targets.OTHER])
"""


def _work(folder: str, solver: str, lanes: int) -> None:
    """Simulate so many descents with the object file in a folder."""
    from sledenv.compiler import library, targets

    vars(library)["machine"] = lambda: targets.OTHER
    library.SHIPPED = Path(folder)  # type: ignore[misc]
    options = settings(solver=solver, max_rebounds=FEW)
    sledenv.simulate_batch(BODY, LAW, SLOPE, np.tile(LAUNCH, (lanes, 1)), **options)


def _count(folder: str, solver: str, lanes: int) -> int:
    """Instructions of a process that simulates so many descents."""
    said = python("-m", "perf.instructions", folder, solver, str(lanes), under=_VALGRIND, **_SETTINGS)
    found = re.search(r"Collected : (\d+)", said)
    if found is None:
        raise RuntimeError(f"valgrind did not count:\n{said}")
    return int(found[1])


def main() -> None:
    """Count, and compare with the committed baseline."""
    now: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        python("-c", _MAKE, folder)
        for solver in ("compliant", "rigid"):
            once, twice = (_count(folder, solver, lanes) for lanes in (LANES, 2 * LANES))
            now[solver] = round((twice - once) / (LANES * FEW))
    compare("instructions_per_hop", now)


if __name__ == "__main__":
    if len(sys.argv) == 4:
        _work(sys.argv[1], sys.argv[2], int(sys.argv[3]))
    else:
        main()
