"""How many seconds an agent learns until it is within 2 % of the best, from the folder of a benchmark.

``python -m perf.learning FOLDER`` reads the learning curves of a finished ``sledenv benchmark``, writes
results/learning.json and prints the table of agents/README.md. The best on the validation contexts is not known; the
launches of all agents of the folder stand for it, the best in each context, refined a little.
"""

from __future__ import annotations

import math
import sys
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from perf import show
from perf.harness import Floats, save
from sledenv.agents.curve import validation
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import load_run
from sledenv.benchmark.scores import ordered, read_results

NEAR: Final = 0.02  # of the best
DRAWS: Final = 64  # of the tremble, with which launches are compared
TRIED: Final = 16  # around the best launch of a context, once for each of the widths
WIDTHS: Final = (0.05, 0.02, 0.01)  # standard deviations, where the box is 2 wide


def best_mean(runs: list[Path]) -> float:
    """Return the mean reward of the best launches that runs of one problem lead to, in the trials of their curves."""
    loaded = [load_run(run) for run in runs]
    problem = loaded[0][0]
    trials = validation(problem)
    contexts = problem.contexts("validation", len(trials))
    seen = problem.task.observe(contexts)
    scenes = problem.scenes(contexts, DRAWS, (1, 0))
    best = _best(problem, scenes, np.stack([agent.act(seen) for _, agent, _ in loaded], axis=1))
    rng = np.random.default_rng(0)
    for width in WIDTHS:
        around = best + width * rng.standard_normal((len(best), TRIED, best.shape[2]))
        best = _best(problem, scenes, np.concatenate([best, problem.inside(around)], axis=1))
    return float(problem.descend(trials, best[:, 0]).jam.reward.mean())


def _best(problem: Problem, scenes: Floats, launches: Floats) -> Floats:
    """Return the launch that earns most in each context, shape (n, 1, k), of those of shape (n, m, k)."""
    best = problem.expect(scenes, launches).argmax(axis=1)[:, np.newaxis, np.newaxis]
    return np.take_along_axis(launches, best, axis=1)


def reached(curves: pd.DataFrame, goal: float) -> list[float | None]:
    """Return for each seed the seconds at which its curve first reaches a goal, None where it never does."""
    there = curves["seconds"].where(curves["mean_reward"] >= goal)
    return [None if math.isnan(first) else first for first in there.groupby(curves["seed"]).min()]


def measured(folder: Path) -> list[dict[str, Any]]:
    """Return for each scenario of a folder the best mean reward, and the seconds of each agent that learns."""
    results = read_results(folder)
    curves = results.curves[results.curves["environment"] == "launch"]
    rows = []
    for scenario, learned in ordered(curves).groupby("scenario", sort=False):
        named = learned[["agent", "seed"]].drop_duplicates().itertuples(index=False)
        runs = [folder / "trained" / f"launch-{scenario}-{agent}-s{seed}" for agent, seed in named]
        best = best_mean(runs)
        seconds = {agent: reached(one, (1.0 - NEAR) * best) for agent, one in learned.groupby("agent", sort=False)}
        rows.append({"scenario": scenario, "best": best, "seconds": seconds})
    return rows


def median(agent: str, row: dict[str, Any]) -> str:
    """Tell the median of the seconds over seeds; where some of these never get there, how many do."""
    seconds = row["seconds"].get(agent, [])
    there = [one for one in seconds if one is not None]
    middle = float(np.median([math.inf if one is None else one for one in seconds])) if seconds else math.inf
    parts = [f"{middle:.0f}"] if math.isfinite(middle) else []
    if len(there) < len(seconds):
        parts.append(f"{len(there)} of {len(seconds)}")
    return ", ".join(parts)


def main() -> None:
    """Measure the runs of a folder and keep what they need."""
    if len(sys.argv) != 2:
        sys.exit("usage: python -m perf.learning FOLDER, where a benchmark has left its results")
    rows = measured(Path(sys.argv[1]))
    save("learning", {"near": NEAR, "rows": rows})
    columns: dict[str, Any] = {
        "scenario": lambda row: f"`{row['scenario']}`",
        "best mean": lambda row: f"{row['best']:.3f}",
    }
    columns |= {agent: partial(median, agent) for row in rows for agent in row["seconds"]}
    print(show.table(rows, columns))


if __name__ == "__main__":
    main()
