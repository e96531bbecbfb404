"""Hops a second of simulate_batch over batch size and threads, against the scalar kernel in a loop; random launches."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, Literal

import numpy as np

import sledenv
from perf import show
from perf.harness import Floats, ratio, spread, take_turns, timed
from perf.reference import BODY, FEW, LAW, SLOPE, launches, settings
from perf.scalar_loop import scalar_loop
from sledenv.simulation.lanes import num_threads

ROUNDS = 3  # in each of so many
PROCESSES = 5
LANES = (1, 10, 100, 1_000, 10_000, 100_000)
SHOWN = (1, 10_000)  # in the table
MOST_LOOPED = 10_000  # lanes of the compiled scalar loop
MOST_CALLED = 1_000  # lanes simulated by one call each
SOLVERS: tuple[Literal["compliant", "rigid"], ...] = ("compliant", "rigid")
CALLS, LOOP = "simulate() a lane", "compiled scalar loop"
_BATCHES = [show.BLUE, show.SKY, "#0A2F51", "#7FB2D0"]


def batch_name(threads: int) -> str:
    """Name of simulate_batch on so many threads."""
    return f"simulate_batch, {threads} thread" + ("s" if threads > 1 else "")


def thread_counts() -> list[int]:
    """1, 2, 4, ... up to the number of threads that a batch may use."""
    most = num_threads()
    return sorted({*(2**k for k in range(int(math.log2(most)) + 1)), most})


def _batch(states: Floats, solver: str, threads: int) -> Callable[[], sledenv.DescentBatch]:
    options = settings(solver=solver, max_rebounds=FEW)

    def run() -> sledenv.DescentBatch:
        os.environ["NUMBA_NUM_THREADS"] = str(threads)
        return sledenv.simulate_batch(BODY, LAW, SLOPE, states, **options)

    return run


def _calls(states: Floats, solver: Any) -> Callable[[], None]:
    given = [sledenv.State(*row) for row in states]

    def run() -> None:
        for state in given:
            sledenv.simulate(BODY, LAW, SLOPE, state, solver=solver, max_rebounds=FEW)

    return run


def _measured(rounds: int, sizes: Sequence[int]) -> list[tuple[str, int, dict[str, Floats]]]:
    """Solver, lanes and time [s] a hop of all competitors, round by round."""
    found: list[tuple[str, int, dict[str, Floats]]] = []
    counts = thread_counts()  # before a batch is told how many
    for solver in SOLVERS:
        for lanes in sizes:
            states = launches(lanes)
            runs: dict[str, Callable[[], Any]] = {batch_name(k): _batch(states, solver, k) for k in counts}
            hops = float(runs[batch_name(1)]().outcomes["rebounds"].sum())
            if lanes <= MOST_LOOPED:
                runs[LOOP] = scalar_loop(BODY, LAW, SLOPE, states, solver=solver, max_rebounds=FEW)
            if lanes <= MOST_CALLED:
                runs[CALLS] = _calls(states, solver)
            measures = {name: timed(run, hops) for name, run in runs.items()}
            found.append((solver, lanes, take_turns(measures, rounds if lanes <= MOST_LOOPED else 1)))
    return found


def measure(rounds: int = ROUNDS, processes: int = PROCESSES, sizes: tuple[int, ...] = LANES) -> dict[str, Any]:
    """Measure in several processes, because one may be faster than the next from beginning to end."""
    runs = []
    for _ in range(processes):
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as process:
            runs.append(process.submit(_measured, rounds, sizes).result())
    rows: list[dict[str, Any]] = []
    for alike in zip(*runs, strict=True):
        solver, lanes, first = alike[0]
        times = {name: np.concatenate([run[2][name] for run in alike]) for name in first}
        for name, found in times.items():
            row = {"solver": solver, "lanes": lanes, "name": name, "hops_per_s": spread(1.0 / found)}
            bases = {"times_loop": LOOP, "times_one_thread": batch_name(1)}
            rows.append(row | {key: ratio(times[base], found) for key, base in bases.items() if base in times})
    return {"rounds": rounds, "processes": processes, "rebounds": FEW, "rows": rows}


def draw(result: dict[str, Any]) -> None:
    """Hops a second over lanes, a panel a solver."""
    names = list(dict.fromkeys(row["name"] for row in result["rows"] if row["solver"] in SOLVERS))
    batches = [name for name in names if name not in (LOOP, CALLS)]
    looks = {name: (_BATCHES[i % len(_BATCHES)], "o") for i, name in enumerate(batches)}
    looks |= {LOOP: (show.ORANGE, "s"), CALLS: (show.GREY, "v")}
    with show.drawing("scaling", (9.0, 4.4), (1, 2)) as (figure, axes):
        for ax, solver in zip(axes, SOLVERS, strict=True):
            for name, (colour, marker) in looks.items():
                rows = [row for row in result["rows"] if row["solver"] == solver and row["name"] == name]
                stats = [row["hops_per_s"] for row in rows]
                medians = [stat["median"] for stat in stats]
                look = {"color": colour, "marker": marker, "label": name}
                ax.errorbar([row["lanes"] for row in rows], medians, yerr=show.errors(stats), **look)
            ax.set(xscale="log", yscale="log", xlabel="lanes")
            ax.set_title(solver, loc="left")
        axes[0].set_ylabel("hops a second (higher is better)")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9.5)


def tables(result: dict[str, Any]) -> str:
    """Return the table of docs/performance.md; the figure has the other numbers of lanes."""
    return show.table([row for row in result["rows"] if row["lanes"] in SHOWN], _COLUMNS)


_COLUMNS: show.Columns = {
    "solver, lanes": lambda row: f"{row['solver']}, {row['lanes']:,}",
    "how": lambda row: row["name"],
    "hops/s": lambda row: f"{row['hops_per_s']['median']:,.0f}",
    "times the scalar loop": lambda row: show.median(row["times_loop"]) if "times_loop" in row else "-",
    "times one thread": lambda row: show.median(row["times_one_thread"]) if "times_one_thread" in row else "-",
}
