"""Time another commit and the present working tree side by side: ``python -m perf versus COMMIT``.

Both are installed in a temporary folder, where the kernels are compiled, and have a worker process
(:mod:`perf.workloads`). An older tree compiles at its first calls: these are not timed, and it keeps what it compiles
for itself. The two are asked in turn, so that a busy moment of the machine hits both, and a ratio is taken within each
turn. On a machine that is never quiet the ratio of the least times of all turns says more: what disturbs only adds.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from perf import show
from perf.harness import ROOT, Floats, git, ratio, stamp, take_turns
from perf.startup import keeping
from perf.workloads import WORKLOADS

ROUNDS = 15
PROCESSES = 3  # pairs of workers one after the other: a process may be faster than the next from beginning to end


class Worker:
    """A process that times workloads of an installed tree, given by the perf folder of the present one."""

    def __init__(self, label: str, tree: Path, now: Path) -> None:
        self._label = label
        paths = {**keeping(f"{tree}-cache"), "PYTHONPATH": os.pathsep.join([f"{tree}-site", str(now)])}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "perf.workloads"],  # -P: no module of the folder that it runs in is found
            cwd=tree,
            env={**os.environ, "PYTHONHASHSEED": "0", "NUMBA_NUM_THREADS": "1", **paths},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, verb: str, name: str) -> float:
        """Give an order and wait for the answer; RuntimeError if the workload cannot be run in this tree."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):  # the missing answer says so
            print(verb, name, file=self._process.stdin, flush=True)
        answer = json.loads(self._process.stdout.readline() or '"the worker has ended without an answer"')
        if isinstance(answer, str):
            raise RuntimeError(f"{self._label}: {answer}")
        return float(answer)

    def end(self) -> None:
        """End the process, whatever it does."""
        with self._process:
            self._process.kill()


def commit_of(name: str) -> str:
    """Full hash of a commit."""
    found = git("rev-parse", "--verify", "--quiet", f"{name}^{{commit}}")
    if not found:
        raise argparse.ArgumentTypeError(f"{name!r} is no commit here; give a branch, a tag, a hash, or HEAD")
    return found


def unpack(commit: str, tree: Path) -> None:
    """Write the files of a commit."""
    archive = Path(f"{tree}.tar")
    subprocess.run(["git", "archive", f"--output={archive}", commit], cwd=ROOT, check=True)
    shutil.unpack_archive(archive, tree, filter="data")


def copy(tree: Path) -> None:
    """Write the files of the working tree that git knows or does not ignore, as they are now."""
    for name in filter(None, git("ls-files", "--cached", "--others", "--exclude-standard", "-z").split("\0")):
        if (ROOT / name).exists():  # not removed since
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, tree / name, follow_symlinks=False)


def install(tree: Path) -> None:
    """Install a tree beside itself, wherever it keeps its packages and their files."""
    options = ["--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check"]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, f"--target={tree}-site", str(tree)], check=True)


def turns(pair: Sequence[Worker], name: str, rounds: int) -> dict[str, list[Any]]:
    """Units of work of a run in both trees, and the times [s] of a unit in both, round by round."""
    with ThreadPoolExecutor() as both:  # older trees compile, side by side
        units = list(both.map(lambda worker: worker.ask("prepare", name), pair))
    times = take_turns({i: partial(worker.ask, "time", name) for i, worker in enumerate(pair)}, rounds)
    return {"units": units, "rounds_s": np.column_stack([times[0], times[1]]).tolist()}


def measure(commit: str, names: Sequence[str], rounds: int) -> list[dict[str, Any]]:
    """Run the workloads in both trees; one row each, which has ``failed`` where that was in vain."""
    rows: list[dict[str, Any]] = [{"name": name, "rounds_s": []} for name in names]
    with tempfile.TemporaryDirectory(prefix="sledenv-versus-") as folder:
        old, now = Path(folder, "old"), Path(folder, "now")
        unpack(commit, old)
        copy(now)
        for tree in (old, now):
            install(tree)
        for process in range(min(PROCESSES, rounds)):
            with contextlib.ExitStack() as stack:
                pair = [Worker(label, tree, now) for label, tree in ((commit[:7], old), ("now", now))]
                for worker in pair:
                    stack.callback(worker.end)
                for row in rows:
                    once = WORKLOADS[row["name"]].once
                    if "failed" in row or (once and process):
                        continue
                    print(f"{row['name']} ({process + 1} of {PROCESSES})", file=sys.stderr, flush=True)
                    try:
                        part = 1 if once else len(range(process, rounds, PROCESSES))  # of so many rounds in all
                        found = turns(pair, row["name"], part)
                        row |= found | {"rounds_s": row["rounds_s"] + found["rounds_s"]}
                    except RuntimeError as error:
                        row["failed"] = str(error)
    return rows


def report(commit: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the table, and under it a line for everything that is not as it should be."""
    short = commit[:7]

    def cells(row: Mapping[str, Any]) -> list[str]:
        times: Floats = np.array(row["rounds_s"])
        old, now = times.T
        gain = ratio(old, now)
        scale, unit = (1.0, "s") if old.max() > 0.01 else (1e6, "µs")
        middle = [f"{show.number(scale * t)} {unit} a {WORKLOADS[row['name']].unit}" for t in np.median(times, axis=0)]
        quartiles = f"{gain['low']:.3f} to {gain['high']:.3f}"
        return [row["name"], *middle, f"{gain['median']:.3f}", quartiles, f"{old.min() / now.min():.3f}"]

    head = ["workload", short, "now", "times faster now", "quartiles", "by the least times"]
    columns = {title: itemgetter(i) for i, title in enumerate(head)}
    lines = [show.table([cells(row) for row in rows if "failed" not in row], columns), ""]
    for row in rows:
        old, now = row.get("units", (0, 0))
        if "failed" in row:
            lines.append(f"{row['name']} has failed: {row['failed']}")
        elif old != now:
            lines.append(f"{row['name']} is not the same work: {old:g} units in {short}, {now:g} now")
    return "\n".join(lines).rstrip()


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print; exit with status 1 if a workload has failed."""
    parser = argparse.ArgumentParser(
        prog="python -m perf versus",
        description="Time another commit and the present working tree side by side.",
        epilog="workloads: " + "; ".join(f"{name}: {work.about}" for name, work in WORKLOADS.items()),
    )
    parser.add_argument("commit", type=commit_of, metavar="COMMIT", help="what the working tree is compared with")
    parser.add_argument("--only", nargs="+", choices=WORKLOADS, metavar="NAME", help="all but cold by default")
    parser.add_argument("--all", action="store_true", help="cold too, for which older trees compile")
    parser.add_argument("--rounds", type=int, default=ROUNDS, metavar="N", help=f"turns of each, {ROUNDS} by default")
    parser.add_argument("--json", type=Path, metavar="FILE", help="where to write all times too")
    given = parser.parse_args(arguments)
    if given.rounds < 1:
        parser.error(f"{given.rounds} is no number of rounds: 1, 2, 3, ...")
    names = given.only or [name for name, work in WORKLOADS.items() if given.all or not work.once]
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that workers and folder go, as on Ctrl+C
    rows = measure(given.commit, names, given.rounds)
    print(report(given.commit, rows))
    if given.json:
        result = {"stamp": stamp(), "versus": given.commit, "rounds": given.rounds, "rows": rows}
        given.json.write_text(json.dumps(result, indent=1) + "\n")
    if any("failed" in row for row in rows):
        raise SystemExit(1)
