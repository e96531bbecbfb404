"""Time another commit and the present working tree side by side: ``python -m perf versus COMMIT``.

Both trees are copied to a temporary folder and have a worker process, with a cache of compiled kernels of its own. The
two are asked in turn, so that a busy moment of the machine hits both, and a ratio is taken within each turn. On a
machine that is never quiet the ratio of the least times of all turns says more: what disturbs only adds.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from perf.harness import figure_of, ratio, spread, stamp, table
from perf.workloads import WORKLOADS, Workload

ROOT = Path(__file__).parents[1]
ROUNDS = 15
PROCESSES = 3  # pairs of workers one after the other: a process may be faster than the next from beginning to end


class Failed(Exception):
    """A workload cannot be run in one of the trees."""


class Worker:
    """A process that times workloads of one tree."""

    def __init__(self, label: str, tree: Path, script: Path, cache: Path) -> None:
        self._label = label
        environment = {
            **os.environ,
            "NUMBA_CACHE_DIR": str(cache),
            "PYTHONHASHSEED": "0",
            "PYTHONPATH": os.pathsep.join([str(tree / "src"), str(tree)]),
        }
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its byte code
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(script)],  # -P: no module of the script's own folder is found by accident
            cwd=tree,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def order(self, verb: str, name: str) -> None:
        """Give an order without waiting for the answer."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # the missing answer says so
            print(verb, name, file=self._process.stdin, flush=True)

    def answer(self) -> dict[str, Any]:
        """Wait for the answer to an order."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        found: dict[str, Any] = json.loads(line) if line else {"error": "the worker has ended without an answer"}
        if "error" in found:
            raise Failed(f"{self._label}: {found['error']}")
        return found

    def time(self, name: str) -> float:
        """Time [s] of a unit of a workload that has been prepared."""
        self.order("time", name)
        return float(self.answer()["seconds"])

    def end(self) -> None:
        """End the process, whatever it does."""
        with self._process:
            self._process.kill()


def commit_of(name: str) -> str:
    """Full hash of a commit; SystemExit if there is none of that name."""
    command = ["git", "rev-parse", "--verify", "--quiet", f"{name}^{{commit}}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        _refuse(f"{name!r} is no commit here; give a branch, a tag, a hash, or HEAD for the last commit")
    return done.stdout.strip()


def chosen(names: Sequence[str] | None, everything: bool) -> list[str]:
    """Names of the workloads to run, in the order of the table; SystemExit if one is unknown."""
    for name in names or ():
        if name not in WORKLOADS:
            _refuse(f"{name!r} is no workload; there are {', '.join(WORKLOADS)}")
    return [name for name, work in WORKLOADS.items() if (name in names if names else everything or not work.once)]


def unpack(commit: str, tree: Path) -> None:
    """Write the files of a commit."""
    done = subprocess.run(["git", "archive", "--format=tar", commit], cwd=ROOT, capture_output=True, check=True)
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
        archive.extractall(tree, filter="data")


def copy(tree: Path) -> None:
    """Write the files of the working tree that git knows or does not ignore, as they are now."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    for name in filter(None, done.stdout.split("\0")):
        if (ROOT / name).exists():  # not removed since
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, tree / name, follow_symlinks=False)


@contextlib.contextmanager
def workers(folder: Path, labels: tuple[str, str]) -> Iterator[tuple[Worker, Worker]]:
    """Start the workers of both trees, and end them."""
    script = folder / "now" / "perf" / "workloads.py"
    with contextlib.ExitStack() as stack:
        pair = []
        for label, place in zip(labels, ("old", "now"), strict=True):
            pair.append(Worker(label, folder / place, script, folder / f"{place}-cache"))
            stack.callback(pair[-1].end)
        yield pair[0], pair[1]


def take_turns(pair: tuple[Worker, Worker], name: str, rounds: int) -> tuple[list[float], list[tuple[float, float]]]:
    """Units of work of a run in both trees, and the times [s] of a unit in both, round by round."""
    for worker in pair:
        worker.order("prepare", name)
    units = [found["units"] for found in _answers(pair)]
    times = []
    for i in range(rounds):
        found = [0.0, 0.0]
        for k in (0, 1) if i % 2 == 0 else (1, 0):
            found[k] = pair[k].time(name)
        times.append((found[0], found[1]))
    return units, times


def _answers(pair: tuple[Worker, Worker]) -> list[dict[str, Any]]:
    """Answers of both, each awaited even if the other has failed."""
    found, wrong = [], []
    for worker in pair:
        try:
            found.append(worker.answer())
        except Failed as failed:
            wrong.append(str(failed))
    if wrong:
        raise Failed("; ".join(wrong))
    return found


def measure(commit: str, names: Sequence[str], rounds: int, processes: int) -> list[dict[str, Any]]:
    """Run the workloads in both trees; one row each, which has ``failed`` instead of times where that was in vain."""
    labels = commit[:7], "now"
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in names}
    units: dict[str, list[float]] = {}
    failed: dict[str, str] = {}
    with tempfile.TemporaryDirectory(prefix="sledenv-versus-") as place:
        folder = Path(place)
        for part in ("old", "now"):
            (folder / part).mkdir()
        unpack(commit, folder / "old")
        copy(folder / "now")
        for process in range(processes):
            with workers(folder, labels) as pair:
                for name in names:
                    wanted = len(range(process, rounds, processes))  # of so many rounds in all
                    if WORKLOADS[name].once:
                        wanted = int(process == 0)
                    if name in failed or not wanted:
                        continue
                    print(f"{name} ({process + 1} of {processes})", file=sys.stderr, flush=True)
                    try:
                        units[name], found = take_turns(pair, name, wanted)
                        times[name] += found
                    except Failed as error:
                        failed[name] = str(error)
    return [
        {"name": name, "failed": failed[name]} if name in failed else row(name, units[name], times[name])
        for name in names
    ]


def row(name: str, units: Sequence[float], times: Sequence[tuple[float, float]]) -> dict[str, Any]:
    """Statistics of the times [s] of a unit of work in both trees, (old, new) round by round."""
    old, new = np.array(times).T
    return {
        "name": name,
        "unit": WORKLOADS[name].unit,
        "units": list(units),
        "old_s": spread(old),
        "new_s": spread(new),
        "times_faster": ratio(old, new),
        "least_times_faster": float(old.min() / new.min()),
        "rounds_s": [list(pair) for pair in times],
    }


def _shown(work: Workload, seconds: float) -> str:
    if work.rate:
        return f"{1.0 / seconds:,.0f} {work.unit}s/s"
    return f"{figure_of(seconds)} s" if seconds > 0.01 else f"{figure_of(1e6 * seconds)} µs a {work.unit}"


def report(commit: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the table, and under it a line for everything that is not as it should be."""
    lines, remarks = [], []
    for found in rows:
        name = found["name"]
        if "failed" in found:
            lines.append((name, *"-----"))
            remarks.append(f"{name} has failed: {found['failed']}")
            continue
        gain = found["times_faster"]
        lines.append(
            (
                name,
                _shown(WORKLOADS[name], found["old_s"]["median"]),
                _shown(WORKLOADS[name], found["new_s"]["median"]),
                f"{gain['median']:.3f}",
                f"{gain['low']:.3f} to {gain['high']:.3f}",
                f"{found['least_times_faster']:.3f}",
            )
        )
        old, new = found["units"]
        if old != new:
            remarks.append(f"{name} is not the same work: {old:g} {found['unit']}s in {commit[:7]}, {new:g} now")
    head = ("workload", commit[:7], "now", "times faster now", "quartiles", "by the least times")
    return "\n".join([table(head, lines), *([""] if remarks else []), *remarks])


def _refuse(message: str) -> NoReturn:
    raise SystemExit(f"python -m perf versus: {message}")


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of rounds or processes: 1, 2, 3, ...")
    return int(text)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print; exit with status 1 if a workload has failed."""
    parser = argparse.ArgumentParser(
        prog="python -m perf versus",
        description="Time another commit and the present working tree side by side.",
        epilog="workloads: " + "; ".join(f"{name}: {work.about}" for name, work in WORKLOADS.items()),
    )
    parser.add_argument("commit", metavar="COMMIT", help="what the working tree is compared with")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="workloads to run; all but cold by default")
    parser.add_argument("--all", action="store_true", help="cold too, which takes a minute")
    parser.add_argument(
        "--rounds", type=_count, default=ROUNDS, metavar="N", help=f"turns of each, {ROUNDS} by default"
    )
    parser.add_argument(
        "--processes",
        type=_count,
        default=PROCESSES,
        metavar="N",
        help=f"that share the rounds, one after the other, {PROCESSES} by default",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="where to write all times too")
    given = parser.parse_args(arguments)
    names = chosen(given.only, given.all)
    commit = commit_of(given.commit)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that workers and folder go, as on Ctrl+C
    rows = measure(commit, names, given.rounds, min(given.processes, given.rounds))
    print(report(commit, rows))
    if given.json:
        result = {"stamp": stamp(), "versus": commit, "rounds": given.rounds, "rows": rows}
        given.json.write_text(json.dumps(result, indent=1) + "\n")
    if any("failed" in found for found in rows):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
