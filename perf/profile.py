"""Where the time of one hop goes: a sampling profile of the compiled code, by kernel module and function.

Linux's ``perf`` samples a process that calls ``sledenv.simulate`` on the reference descent again and again. Compiled
code has no symbols that perf could find, so the process compiles the kernel anew and writes the address of every kernel
function to the map file that perf looks for. What LLVM has inlined counts for the caller.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from perf.harness import figure_of, save, table
from perf.methods import sled
from perf.reference import FEW, MANY

SECONDS = 8.0
FREQUENCY = 4000  # [Hz] of the samples
CASES = (("compliant", FEW), ("compliant", MANY), ("rigid", FEW))
PYTHON, MATHS = "Python", "libm"
_MOST = 12  # functions in a table
_MANGLED = re.compile(r"_ZN7sledenv6kernel(\d+)(\w+)")


def _plain_name(symbol: str) -> str:
    """Turn numba's mangled symbol into module.function; "" if it is not a kernel function."""
    found = _MANGLED.search(symbol)
    if not found:
        return ""
    length = int(found[1])
    module, rest = found[2][:length], found[2][length:]
    name = re.match(r"(\d+)(\w+)", rest)
    return f"{module}.{name[2][: int(name[1])]}" if name else module


def _write_map() -> None:
    """Write /tmp/perf-PID.map: address, size and name of every function in the library of the descent."""
    from sledenv.simulation.simulate import run_descent

    entries = []
    versions = run_descent._versions.values()  # type: ignore[attr-defined]
    for overload in (overload for version in versions for overload in version.overloads.values()):
        library = overload.library
        with tempfile.NamedTemporaryFile(suffix=".o") as file:
            file.write(library._get_compiled_object())
            file.flush()
            listing = subprocess.run(["readelf", "-sW", file.name], capture_output=True, text=True, check=True).stdout
        rows = [line.split() for line in listing.splitlines()]
        # A kernel that has been compiled by itself before runs from there.
        entries += [
            f"{library.get_pointer_to_function(fields[7]):x} {int(fields[2], 0):x} {name}"
            for fields in rows
            if fields[3:4] == ["FUNC"] and (name := _plain_name(fields[7]))
        ]
    Path(f"/tmp/perf-{os.getpid()}.map").write_text("\n".join(entries) + "\n")


def _work(solver: str, rebounds: int) -> None:
    """What the sampled process does, until it is ended."""
    sled(rebounds, solver=solver)
    _write_map()
    print("ready", flush=True)
    while True:
        sled(rebounds, solver=solver)


def sample(solver: str, rebounds: int, seconds: float) -> Counter[str]:
    """Samples by module.function of the kernel, libm and everything else, which is Python."""
    command = [sys.executable, "-m", "perf.profile", solver, str(rebounds)]
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(
            command,
            cwd=Path(__file__).parents[1],
            env={**os.environ, "NUMBA_CACHE_DIR": folder},  # numba keeps the object code only of what it has compiled
            stdout=subprocess.PIPE,
            text=True,
        ) as process,
    ):
        data = f"{folder}/perf.data"
        try:
            assert process.stdout is not None
            if process.stdout.readline().strip() != "ready":
                raise RuntimeError(f"the process to be sampled has failed: {' '.join(command)}")
            attach = ["perf", "record", "-q", "-e", "cpu-clock", "-F", str(FREQUENCY), "-p", str(process.pid)]
            subprocess.run([*attach, "-o", data, "--", "sleep", str(seconds)], check=True, capture_output=True)
            # perf finds the map only while the process lives.
            script = ["perf", "script", "-i", data, "-F", "ip,sym,dso"]
            listing = subprocess.run(script, capture_output=True, text=True, check=True).stdout
        finally:
            process.kill()
        Path(f"/tmp/perf-{process.pid}.map").unlink(missing_ok=True)
    counts: Counter[str] = Counter()
    for line in filter(None, map(str.strip, listing.splitlines())):
        symbol, _, library = line.partition(" ")[2].rpartition(" ")
        if "perf-" in library:
            counts[symbol if "." in symbol else "unknown"] += 1
        else:
            counts[MATHS if "libm" in library else PYTHON] += 1
    if not any("." in name for name in counts):
        raise RuntimeError("perf has found no kernel function among the samples")
    return counts


def main(seconds: float = SECONDS) -> None:
    """Sample and write."""
    missing = [tool for tool in ("perf", "readelf") if shutil.which(tool) is None]
    if missing:
        raise SystemExit(f"{' and '.join(missing)} not found: install linux-perf and binutils")
    cases = []
    for solver, rebounds in CASES:
        counts = sample(solver, rebounds, seconds)
        total = sum(counts.values())
        cases.append(
            {
                "solver": solver,
                "rebounds": rebounds,
                "samples": total,
                "shares": {name: count / total for name, count in counts.most_common()},
            }
        )
    result = {"seconds": seconds, "cases": cases}
    save("profile", result)


def _title(case: dict[str, Any]) -> str:
    return f"{case['solver']}, {case['rebounds']} rebounds"


def tables(result: dict[str, Any]) -> str:
    """Return the tables of docs/performance.md."""
    parts = []
    for case in result["cases"]:
        shares = sorted(case["shares"].items(), key=lambda item: -item[1])[:_MOST]
        compiled = 1.0 - case["shares"].get(PYTHON, 0.0)
        rows = [
            (
                f"`{name}`" if "." in name else name,
                figure_of(100.0 * share),
                figure_of(100.0 * share / compiled) if name != PYTHON else "-",
            )
            for name, share in shares
        ]
        parts.append(table((_title(case), "% of simulate()", "% of the compiled code"), rows))
    return "\n\n".join(parts)


if __name__ == "__main__":
    if len(sys.argv) == 3:
        _work(sys.argv[1], int(sys.argv[2]))
    else:
        main()
