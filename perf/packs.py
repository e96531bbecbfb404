"""What the scenarios ask: best and fixed launches, what the tremble leaves of them, and whether crashes pay.

``python -m perf.packs [NAME ...]`` writes results/packs.json and docs/images/pack_*.png, and prints the table of
docs/environments.md. What the oracle finds is kept in runs/perf/packs, so that a measurement that was stopped goes on.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from perf import show
from perf.harness import RESULTS, ROOT, Floats, load, save
from sledenv.benchmark.oracle import actions_of, jam_map, oracle
from sledenv.benchmark.problem import Problem
from sledenv.kernel.records import BURIED, TUMBLED
from sledenv.plot.strobe import plot_strobe
from sledenv.scenarios.scenario import scenario_names
from sledenv.simulation.outcomes import DescentBatch

CONTEXTS: Final = 40  # of each split
CELLS: Final = 1_000  # descents of a map of a context, about
IMAGES: Final = ROOT / "docs" / "images"
RUNS: Final = ROOT / "runs" / "perf" / "packs"


def best_fixed(problem: Problem, contexts: Floats) -> Floats:
    """Return the single launch of a grid that earns most in the mean over contexts, shape (k,)."""
    maps = jam_map(problem, contexts, CELLS)
    best: Floats = grid(maps[0].launches)[np.mean([one.rewards.ravel() for one in maps], axis=0).argmax()]
    return best


def grid(axes: tuple[Floats, ...]) -> Floats:
    """Return the launches of a map, shape (cells, k)."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def everywhere(exact: Problem, contexts: Floats) -> tuple[Floats, np.ndarray]:
    """Simulate the launches of a grid; return their rewards and whether they crash, shapes (N, cells)."""
    points = grid(jam_map(exact, contexts[:1], CELLS)[0].launches)
    rewards, crashed = np.empty((len(contexts), len(points))), np.empty((len(contexts), len(points)), bool)
    for i, context in enumerate(contexts):
        batch = exact.descend(np.tile(context, (len(points), 1)), points)
        rewards[i], crashed[i] = batch.jam.reward, np.isin(batch.outcomes["status"], (TUMBLED, BURIED))
    return rewards, crashed


def upright(batch: DescentBatch) -> np.ndarray:
    """Whether bodies stay within a quarter turn of their upright pose, at every rebound and at the end."""
    filled = np.arange(batch.rebounds.shape[1]) < batch.outcomes["rebounds"][:, np.newaxis]
    turned = (np.abs(batch.rebounds["phi"]) >= 0.5 * np.pi) & filled
    stays: np.ndarray = ~turned.any(axis=1) & (np.abs(batch.outcomes["phi"]) < 0.5 * np.pi)
    return stays


def mean_and_interval(values: Floats) -> tuple[float, float, float]:
    """Mean, and its 95 % interval by the bootstrap over contexts."""
    rng = np.random.default_rng(0)
    means = values[rng.integers(0, len(values), (2000, len(values)))].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return float(values.mean()), float(low), float(high)


def judged(name: str, count: int = CONTEXTS, folder: Path = RUNS) -> dict[str, Any]:
    """What a scenario asks, in numbers and a picture."""
    problem, exact = Problem(name), Problem(name, launch_noise=(0.0, 0.0))
    contexts = problem.contexts("test", count)
    best = oracle(problem, contexts, folder)
    launches = actions_of(problem, best)
    fixed = np.tile(best_fixed(problem, problem.contexts("train", count)), (count, 1))
    reward = best["reward"].to_numpy()
    most = np.array([one.rewards.max() for one in jam_map(exact, contexts)])  # without the tremble
    earned = problem.expect(problem.trials(contexts, "test"), fixed[:, np.newaxis])[:, 0]
    rewards, crashed = everywhere(exact, contexts)
    aimed = problem.task.descend_batch(contexts, problem.task.launches(contexts, launches), keep_rebounds=True)
    shown = int(np.argsort(reward - earned)[9 * count // 10])  # the margin is larger than that of nine contexts in ten
    draw(problem, contexts[[shown]], launches[[shown]], fixed[[shown]])
    return {
        "contexts": count,
        "scenario": problem.scenario.hash,
        "best": float(reward.mean()),
        "fixed": float(earned.mean()),
        "anywhere": float(best["uniform"].mean()),
        "margin": mean_and_interval(1.0 - earned / reward),
        "kept": mean_and_interval(reward / most),
        "upright": float(upright(aimed).mean()),
        "crashes": float(crashed.mean()),
        "best_crash": float(rewards[crashed].max(initial=0.0)),
        "rebounds": float(aimed.outcomes["rebounds"].mean()),
    }


def _interval(values: Sequence[float]) -> str:
    """Mean and interval in per cent."""
    mean, low, high = (100.0 * value for value in values)
    return f"{mean:.1f} [{low:.1f}, {high:.1f}]"


COLUMNS: show.Columns = {
    "scenario": lambda row: f"`{row[0]}`",
    "contexts": lambda row: f"{row[1]['contexts']}",
    "best": lambda row: f"{row[1]['best']:.3f}",
    "fixed": lambda row: f"{row[1]['fixed']:.3f}",
    "anywhere": lambda row: f"{row[1]['anywhere']:.3f}",
    "margin [%]": lambda row: _interval(row[1]["margin"]),
    "kept [%]": lambda row: f"{100.0 * row[1]['kept'][0]:.1f}",
    "upright": lambda row: f"{row[1]['upright']:.0%}" if row[1]["crashes"] else "-",
    "best crash": lambda row: f"{row[1]['best_crash']:.2f}" if row[1]["crashes"] else "-",
}


def draw(problem: Problem, context: Floats, best: Floats, fixed: Floats) -> None:
    """Draw the best and the fixed launch of a context, as they are aimed."""
    descents = [
        problem.task.descend(context, problem.task.launch(context, actions), "trajectory") for actions in (best, fixed)
    ]
    figure = plot_strobe(descents, labels=["best launch", "fixed launch"])
    figure.savefig(IMAGES / f"pack_{problem.scenario.id}.png")


def main() -> None:
    """Judge scenarios, and add them to the results."""
    results = load("packs")["packs"] if (RESULTS / "packs.json").is_file() else {}
    for name in sys.argv[1:] or [name for name in scenario_names() if name != "paper_impact"]:
        results[name] = judged(name)
        save("packs", {"packs": results})
    print(show.table(results.items(), COLUMNS))


if __name__ == "__main__":
    main()
