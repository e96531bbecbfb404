"""Where the time of one hop goes: a sampling profile of the compiled code, by kernel module and function.

``python -m perf.profile`` prints it. Linux's ``perf`` samples a process that calls ``sledenv.simulate`` on the
reference descent again and again. It cannot find the symbols of the object file, so the process writes the address of
every function in it to the map file that perf looks for. What LLVM has inlined counts for the caller. It needs
linux-perf and binutils.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from perf import show
from perf.harness import python
from perf.peers import called
from perf.reference import FEW, MANY

SECONDS = 8.0
FREQUENCY = 4000  # [Hz] of the samples
CASES = (("compliant", FEW), ("compliant", MANY), ("rigid", FEW))
PYTHON = "Python"
_LABEL = "sledenv_descend_lanes"  # an entry whose address is known
_MOST = 6  # functions in a table
_MANGLED = re.compile(r"(?:_ZN7sledenv(?:6kernel|8compiler)\d+([a-z_]+)\d+|sledenv_)([a-z_]+)")  # module and function


def _write_map() -> None:
    """Write /tmp/perf-PID.map: address, size and name of every function of the object file."""
    from sledenv.kernel.entries import LIBRARY

    path = Path(LIBRARY.ready().split(".kernel,")[0] + ".kernel")
    with tempfile.NamedTemporaryFile(suffix=".o") as file:
        file.write(path.read_bytes().partition(b"\n")[2])
        file.flush()
        listing = subprocess.run(["readelf", "-sW", file.name], capture_output=True, text=True, check=True).stdout
    functions = [fields for fields in map(str.split, listing.splitlines()) if fields[3:4] == ["FUNC"]]
    places = {fields[7]: int(fields[1], 16) for fields in functions}
    start = LIBRARY.find(_LABEL.removeprefix("sledenv_")) - places[_LABEL]  # all lie in one section
    entries = []
    for fields in functions:
        found = _MANGLED.match(fields[7])
        name = f"{found[1] or 'entries'}.{found[2]}" if found else "other.code"
        entries.append(f"{start + places[fields[7]]:x} {int(fields[2], 0):x} {name}")
    Path(f"/tmp/perf-{os.getpid()}.map").write_text("\n".join(entries) + "\n")


def _work(solver: str, rebounds: int, seconds: str) -> None:
    """What the sampled process does; it prints the samples, while perf still finds the map."""
    simulate = called("", "", rebounds, solver=solver).run
    simulate()
    _write_map()
    with tempfile.NamedTemporaryFile(suffix=".data") as data:
        attach = ["perf", "record", "-q", "-e", "cpu-clock", "-F", str(FREQUENCY), "-p", str(os.getpid())]
        record = subprocess.Popen([*attach, "-o", data.name, "--", "sleep", seconds], stdout=subprocess.DEVNULL)
        while record.poll() is None:
            for _ in range(1000):
                simulate()
        print(subprocess.check_output(["perf", "script", "-i", data.name, "-F", "ip,sym,dso"], text=True))
    Path(f"/tmp/perf-{os.getpid()}.map").unlink()


def sample(solver: str, rebounds: int, seconds: float) -> Counter[str]:
    """Samples by module.function of the kernel, and of everything else, which is Python."""
    listing = python("-m", "perf.profile", solver, str(rebounds), str(seconds))
    counts: Counter[str] = Counter()
    for line in filter(None, map(str.strip, listing.splitlines())):
        symbol, _, library = line.partition(" ")[2].rpartition(" ")
        counts[(symbol if "." in symbol else "unknown") if "perf-" in library else PYTHON] += 1
    if not any("." in name for name in counts):
        raise RuntimeError("perf has found no kernel function among the samples")
    return counts


def measure(seconds: float = SECONDS) -> dict[str, Any]:
    """Sample all cases."""
    cases = []
    for solver, rebounds in CASES:
        counts = sample(solver, rebounds, seconds)
        total = counts.total()
        shares = {name: count / total for name, count in counts.most_common()}
        cases.append({"solver": solver, "rebounds": rebounds, "samples": total, "shares": shares})
    return {"seconds": seconds, "cases": cases}


def tables(result: dict[str, Any]) -> str:
    """Return a table of each case."""

    def part(case: dict[str, Any]) -> str:
        compiled = 1.0 - case["shares"].get(PYTHON, 0.0)
        columns: show.Columns = {
            f"{case['solver']}, {case['rebounds']} rebounds": lambda of: f"`{of[0]}`" if "." in of[0] else of[0],
            "% of simulate()": lambda of: show.number(100.0 * of[1]),
            "% of the compiled code": lambda of: show.number(100.0 * of[1] / compiled) if of[0] != PYTHON else "-",
        }
        return show.table(sorted(case["shares"].items(), key=lambda of: -of[1])[:_MOST], columns)

    return "\n\n".join(map(part, result["cases"]))


if __name__ == "__main__":
    if sys.argv[1:]:
        _work(sys.argv[1], int(sys.argv[2]), sys.argv[3])
    else:
        print(tables(measure()))
