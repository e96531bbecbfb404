"""Hops a second of simulate_batch over batch size and threads, against the scalar kernel in a loop; random launches."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, Literal

import numba
import numpy as np

import sledenv
from perf.harness import (
    BLUE,
    GREY,
    ORANGE,
    SKY,
    Competitor,
    drawing,
    figure_of,
    interleave,
    ratio,
    save,
    spread,
    table,
)
from perf.reference import BODY, FEW, LAW, SLOPE, Floats, launches, settings
from perf.scalar_loop import scalar_loop

ROUNDS = 3  # in each of so many
PROCESSES = 5
LANES = (1, 10, 100, 1_000, 10_000, 100_000)
MOST_LOOPED = 10_000  # lanes of the compiled scalar loop
MOST_CALLED = 1_000  # lanes simulated by one call each
SOLVERS: tuple[Literal["compliant", "rigid"], ...] = ("compliant", "rigid")
CALLS, LOOP = "simulate() a lane", "compiled scalar loop"


def batch_name(threads: int) -> str:
    """Name of simulate_batch on so many threads."""
    return f"simulate_batch, {threads} thread" + ("s" if threads > 1 else "")


def thread_counts() -> list[int]:
    """1, 2, 4, ... up to the number of threads that numba may use."""
    most = int(os.environ.get("NUMBA_NUM_THREADS", os.cpu_count() or 1))
    return sorted({*(2**k for k in range(int(math.log2(most)) + 1)), most})


def _batch(states: Floats, solver: Literal["compliant", "rigid"], threads: int) -> Callable[[], sledenv.DescentBatch]:
    options = settings(solver=solver, max_rebounds=FEW)

    def run() -> sledenv.DescentBatch:
        numba.set_num_threads(threads)
        return sledenv.simulate_batch(BODY, LAW, SLOPE, states, **options)

    return run


def _calls(states: Floats, solver: Literal["compliant", "rigid"]) -> Callable[[], None]:
    given = [sledenv.State(*row) for row in states]

    def run() -> None:
        for state in given:
            sledenv.simulate(BODY, LAW, SLOPE, state, solver=solver, max_rebounds=FEW)

    return run


def _measured(rounds: int, sizes: Sequence[int]) -> list[tuple[str, int, dict[str, Floats]]]:
    """Solver, lanes and time [s] a hop of all competitors, round by round."""
    counts = thread_counts()
    found: list[tuple[str, int, dict[str, Floats]]] = []
    for solver in SOLVERS:
        for lanes in sizes:
            states = launches(lanes)
            hops = float(_batch(states, solver, 1)().outcomes["rebounds"].sum())
            competitors = [Competitor(batch_name(threads), _batch(states, solver, threads), hops) for threads in counts]
            if lanes <= MOST_LOOPED:
                loop = scalar_loop(BODY, LAW, SLOPE, states, solver=solver, max_rebounds=FEW)
                competitors.append(Competitor(LOOP, loop, hops))
            if lanes <= MOST_CALLED:
                competitors.append(Competitor(CALLS, _calls(states, solver), hops))
            found.append((solver, lanes, interleave(competitors, rounds if lanes <= MOST_LOOPED else 1)))
    return found


def main(rounds: int = ROUNDS, processes: int = PROCESSES, sizes: tuple[int, ...] = LANES) -> None:
    """Measure, write and draw; in several processes, because one may be faster than the next from beginning to end."""
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
            if LOOP in times:
                row["times_loop"] = ratio(times[LOOP], found)
            if batch_name(1) in times:
                row["times_one_thread"] = ratio(times[batch_name(1)], found)
            rows.append(row)
    result = {"rounds": rounds, "processes": processes, "rebounds": FEW, "rows": rows}
    save("scaling", result)
    draw(result)


def draw(result: dict[str, Any]) -> None:
    """Hops a second over lanes, a panel a solver."""
    colours = [BLUE, SKY, "#0A2F51", "#7FB2D0"]
    names = list(dict.fromkeys(row["name"] for row in result["rows"] if row["solver"] in SOLVERS))
    batches = [name for name in names if name.startswith("simulate_batch")]
    looks = {LOOP: (ORANGE, "s"), CALLS: (GREY, "v")}
    looks |= {name: (colours[i % len(colours)], "o") for i, name in enumerate(batches)}
    with drawing("scaling", (9.0, 4.4), (1, 2)) as (figure, axes):
        for ax, solver in zip(axes, SOLVERS, strict=True):
            for name in names:
                rows = [row for row in result["rows"] if row["solver"] == solver and row["name"] == name]
                stats = [row["hops_per_s"] for row in rows]
                colour, marker = looks[name]
                low = [stat["median"] - stat["low"] for stat in stats]
                high = [stat["high"] - stat["median"] for stat in stats]
                ax.errorbar(
                    [row["lanes"] for row in rows],
                    [stat["median"] for stat in stats],
                    yerr=[low, high],
                    color=colour,
                    marker=marker,
                    label=name,
                )
            ax.set_xscale("log")
            ax.set_yscale("log")
            ax.set_xlabel("lanes")
            ax.set_title(solver, loc="left")
        axes[0].set_ylabel("hops a second (higher is better)")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9.5)


def tables(result: dict[str, Any]) -> str:
    """Return the table of docs/performance.md."""
    rows = [
        (
            f"{row['solver']}, {row['lanes']:,}",
            row["name"],
            f"{row['hops_per_s']['median']:,.0f}",
            figure_of(row["times_loop"]["median"]) if "times_loop" in row else "-",
            figure_of(row["times_one_thread"]["median"]) if "times_one_thread" in row else "-",
        )
        for row in result["rows"]
    ]
    return table(("solver, lanes", "how", "hops/s", "times the scalar loop", "times one thread"), rows)


if __name__ == "__main__":
    main()
