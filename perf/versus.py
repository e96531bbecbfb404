"""Another commit and the working tree, timed side by side: ``python -m perf versus COMMIT``.

Each tree has a worker process (:mod:`perf.workloads`); a kernel that does not fit its sources is compiled there at its
first call, which is not timed. The two are asked in turn, so that a busy moment of the machine hits both, and a ratio
is taken within each turn. On a machine that is never quiet the ratio of the least times of all turns says more: what
disturbs only adds.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter
from cyclopts.types import PositiveInt

from perf.harness import ROOT, Floats, number, spread, take_turns
from perf.workloads import WORKLOADS
from sledenv.machine.text_tables import markdown

PROCESSES = 3  # pairs of workers one after the other: a process may be faster than the next from beginning to end
_OBJECTS = "src/sledenv/objects"  # compiled kernels
Name = Literal[*WORKLOADS]  # type: ignore[valid-type]


class Worker:
    """A process that times workloads of a tree, given by the perf folder of the present one."""

    def __init__(self, label: str, tree: Path, cache: Path) -> None:
        self._label = label
        paths = {"PYTHONPATH": os.pathsep.join([str(tree / "src"), str(ROOT)]), "XDG_CACHE_HOME": str(cache)}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "perf.workloads"],  # -P: no module of the folder that it runs in is found
            env={**os.environ, "PYTHONHASHSEED": "0", "NUMBA_NUM_THREADS": "1", **paths},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, order: str = "") -> float:
        """Give an order and wait for the answer; RuntimeError if the workload cannot be run in this tree."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(order, file=self._process.stdin, flush=True)
        answer = json.loads(self._process.stdout.readline() or '"the worker has ended without an answer"')
        if isinstance(answer, str):
            raise RuntimeError(f"{self._label}: {order}: {answer}")
        return float(answer)

    def end(self) -> None:
        """End the process, whatever it does."""
        with self._process:
            self._process.kill()


def turns(pair: Sequence[Worker], name: str, rounds: int) -> Floats:
    """Return the CPU times [s] per unit of a workload in both trees, shape (rounds, 2)."""
    old, now = [worker.ask(name) for worker in pair]
    if old != now:
        print(f"{name} is not the same work: {old:g} units then, {now:g} now", file=sys.stderr)
    times = take_turns({i: worker.ask for i, worker in enumerate(pair)}, rounds)
    return np.column_stack([times[0], times[1]])


def report(commit: str, times: dict[str, Floats]) -> str:
    """Return the table of medians and ratios, old over now."""
    lines = []
    for name, found in times.items():
        middle = [f"{number(1e6 * t)} µs per {WORKLOADS[name].unit}" for t in np.median(found, axis=0)]
        gain, (old, now) = spread(found[:, 0] / found[:, 1]), found.min(axis=0)
        quartiles = f"{gain['low']:.3f} to {gain['high']:.3f}"
        lines.append([name, *middle, f"{gain['median']:.3f}", quartiles, f"{old / now:.3f}"])
    return markdown(["workload", commit, "now", "times faster now", "quartiles", "by the least times"], lines)


def versus(
    commit: Annotated[str, Parameter(metavar="COMMIT")],
    /,
    *,
    only: Annotated[tuple[Name, ...], Parameter(consume_multiple=True)] = (),
    rounds: PositiveInt = 5,
) -> None:
    """Time another commit and the working tree side by side.

    Parameters
    ----------
    commit
        What the working tree is compared with: a branch, a tag, a hash, or HEAD.
    only
        These workloads (default: all).
    rounds
        Turns of each, in each of three pairs of processes.
    """
    times = {name: np.empty((0, 2)) for name in only or WORKLOADS}
    with tempfile.TemporaryDirectory(prefix="sledenv-versus-") as folder:
        tree, cache = Path(folder, "tree"), Path(folder, "cache")
        packed = subprocess.run(["git", "archive", commit], cwd=ROOT, stdout=subprocess.PIPE, check=False)
        if packed.returncode:
            sys.exit(packed.returncode)  # git has said why
        tree.mkdir()
        subprocess.run(["tar", "-x", "-C", tree], input=packed.stdout, check=True)
        if (ROOT / _OBJECTS).is_dir():  # one that does not fit is not used
            shutil.copytree(ROOT / _OBJECTS, tree / _OBJECTS)
        for process in range(PROCESSES):
            with ExitStack() as stack:
                pair = [Worker(label, place, cache) for label, place in ((commit, tree), ("now", ROOT))]
                for worker in pair:
                    stack.callback(worker.end)
                for name in times:
                    print(f"{name} ({process + 1} of {PROCESSES})", file=sys.stderr, flush=True)
                    times[name] = np.concatenate([times[name], turns(pair, name, rounds)])
    print(report(commit, times), end="")
