"""Measure speed: ``python -m perf [NAME ...]``, or compare with another commit: ``python -m perf versus COMMIT``."""

from __future__ import annotations

import argparse
import subprocess
import sys
import time

from perf import versus
from perf.report import NAMES, write


def main() -> None:
    """Take each measurement in a process of its own, then bring the tables of docs/performance.md up to date."""
    if sys.argv[1:2] == ["versus"]:
        versus.main(sys.argv[2:])
        return
    parser = argparse.ArgumentParser(prog="python -m perf", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one or more of {', '.join(NAMES)}; all by default")
    names = parser.parse_args().names or NAMES
    for unknown in set(names) - set(NAMES):
        parser.error(f"{unknown!r} is no measurement; there are {', '.join(NAMES)}")
    for name in names:
        print(f"{name} ...", flush=True)
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", f"from perf import harness; harness.run({name!r})"], check=True)
        print(f"{name}: {time.perf_counter() - start:.0f} s", flush=True)
    write()


if __name__ == "__main__":
    main()
