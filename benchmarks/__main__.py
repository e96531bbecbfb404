"""Run the benchmarks in turn, or those that are named: ``python -m benchmarks [NAME ...]``."""

from __future__ import annotations

import argparse
import subprocess
import sys
import time

from benchmarks.report import NAMES, write


def main() -> None:
    """Run each benchmark in a process of its own, then bring the tables of docs/performance.md up to date."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one or more of {', '.join(NAMES)}; all by default")
    names = parser.parse_args().names or NAMES
    for unknown in set(names) - set(NAMES):
        parser.error(f"{unknown!r} is no benchmark; there are {', '.join(NAMES)}")
    for name in names:
        print(f"benchmark {name} ...", flush=True)
        start = time.perf_counter()
        subprocess.run([sys.executable, "-m", f"benchmarks.{name}"], check=True)
        print(f"benchmark {name}: {time.perf_counter() - start:.0f} s", flush=True)
    write()


if __name__ == "__main__":
    main()
