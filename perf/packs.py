"""What the scenarios ask: best and fixed launches, what a tremble leaves of them, and whether crashes pay.

``python -m perf.packs [NAME ...]`` writes results/packs.json and docs/images/pack_*.png for docs/environments.md.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter

from perf.harness import RESULTS, Floats, load, save
from sledenv.benchmark.problem import Problem
from sledenv.kernel.records import BURIED, TUMBLED
from sledenv.plot.strobe import plot_strobe
from sledenv.scenarios.scenario import NOISY, Context, scenario_names
from sledenv.simulation.outcomes import DescentBatch
from sledenv.simulation.scene import State

CONTEXTS: Final = 100  # of each split
TREMBLE: Final = {"orientation": math.radians(1.0), "spin": 0.05}  # standard deviations [rad], [rad/s]
DRAWS: Final = 48  # of it, and their mirror images
GRID: Final = {1: (241,), 2: (61, 41), 3: (31, 21, 9)}  # launches tried, by how much is chosen
LEVELS, NEIGHBOURS, NARROWER = 7, 40, 0.6  # of the search around the best one of the grid
CANDIDATES: Final = 32  # launches of the grid that are tried under the tremble
PARTS: Final = 20  # of the contexts that are simulated at a time
IMAGES: Final = Path(__file__).parents[1] / "docs" / "images"
_NOISY = [Context._fields.index(name) for name in NOISY]


class Found(NamedTuple):
    """Launches of N contexts, and what they earn."""

    contexts: Floats  # (N, fields)
    rewards: Floats  # (N, launches) of the grid
    crashed: np.ndarray  # (N, launches) whether they crash
    best: Floats  # (N, k) actions
    best_reward: Floats  # (N,)


def descend(problem: Problem, contexts: Floats, actions: Floats, tremble: Floats | None = None) -> DescentBatch:
    """Simulate launches of shape (N, M, k) in N contexts; a tremble has shape (M, 2)."""
    chosen = problem.task.chosen(np.repeat(contexts, actions.shape[1], axis=0), actions.reshape(-1, actions.shape[2]))
    if tremble is not None:
        chosen[:, _NOISY] += np.tile(tremble, (len(contexts), 1))
    task = problem.task
    return task.descend_batch(chosen, task.scenario.launches(chosen))


def searched(problem: Problem, contexts: Floats, rng: np.random.Generator) -> Found:
    """Search the best launches: a grid, then ever closer around its best one."""
    counts = GRID[problem.actions]
    axes = [np.linspace(-1.0, 1.0, count) for count in counts]
    points = np.stack([each.ravel() for each in np.meshgrid(*axes, indexing="ij")], axis=-1)
    rewards, crashed = np.empty((2, len(contexts), len(points)))
    for rows in np.array_split(np.arange(len(contexts)), max(len(contexts) // PARTS, 1)):
        batch = descend(problem, contexts[rows], np.broadcast_to(points, (len(rows), *points.shape)))
        rewards[rows] = batch.jam.reward.reshape(len(rows), -1)
        crashed[rows] = np.isin(batch.outcomes["status"], (TUMBLED, BURIED)).reshape(len(rows), -1)
    best, most = points[rewards.argmax(axis=1)], rewards.max(axis=1)
    width = 2.0 / (np.array(counts) - 1.0)
    for level in range(LEVELS):
        around = rng.normal(0.0, NARROWER ** (level + 1) * width, (len(contexts), NEIGHBOURS, len(counts)))
        tried = np.clip(best[:, np.newaxis] + around, -1.0, 1.0)
        earned = descend(problem, contexts, tried).jam.reward.reshape(len(contexts), -1)
        better, which = earned.max(axis=1) > most, earned.argmax(axis=1)
        best = np.where(better[:, np.newaxis], tried[np.arange(len(contexts)), which], best)
        most = np.maximum(most, earned.max(axis=1))
    return Found(contexts, rewards, crashed.astype(bool), best, most)


def trembling(problem: Problem, contexts: Floats, actions: Floats, rng: np.random.Generator) -> Floats:
    """Mean reward of launches of shape (N, M, k) under the tremble, shape (N, M)."""
    draws = rng.normal(size=(DRAWS, 2)) * [TREMBLE[name] for name in NOISY]
    draws = np.concatenate([draws, -draws])
    means = np.empty(actions.shape[:2])
    for i in range(actions.shape[1]):  # one launch of each context at a time
        each = np.repeat(actions[:, i : i + 1], len(draws), axis=1)
        means[:, i] = descend(problem, contexts, each, draws).jam.reward.reshape(len(contexts), -1).mean(axis=1)
    return means


def upright(batch: DescentBatch) -> np.ndarray:
    """Whether bodies stay within a quarter turn of their upright pose, at every rebound and at the end."""
    filled = np.arange(batch.rebounds.shape[1]) < batch.outcomes["rebounds"][:, np.newaxis]
    turned = (np.abs(batch.rebounds["phi"]) >= 0.5 * np.pi) & filled
    stays: np.ndarray = ~turned.any(axis=1) & (np.abs(batch.outcomes["phi"]) < 0.5 * np.pi)
    return stays


def mean_and_interval(values: Floats, rng: np.random.Generator) -> tuple[float, float, float]:
    """Mean, and its 95 % interval by the bootstrap over contexts."""
    means = values[rng.integers(0, len(values), (2000, len(values)))].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return float(values.mean()), float(low), float(high)


def judged(name: str) -> tuple[dict[str, Any], Problem, Found, Floats]:
    """What a scenario asks, in numbers; with its best launches and the best single one."""
    problem, rng = Problem(name), np.random.default_rng(0)
    test, train = (searched(problem, problem.contexts(split, CONTEXTS), rng) for split in ("test", "train"))
    counts = GRID[problem.actions]
    axes = [np.linspace(-1.0, 1.0, count) for count in counts]
    points = np.stack([each.ravel() for each in np.meshgrid(*axes, indexing="ij")], axis=-1)
    number = int(train.rewards.mean(axis=0).argmax())
    fixed = np.broadcast_to(points[number], test.best.shape)
    # Under a tremble the middle of a plateau is best: the best launches of a smoothed grid are tried.
    smooth = np.array([uniform_filter(row.reshape(counts), 5, mode="nearest").ravel() for row in test.rewards])
    some = np.argsort(-smooth, axis=1)[:, : CANDIDATES - 8]
    few = np.argsort(-test.rewards, axis=1)[:, :8]
    tried = np.concatenate([points[some], points[few], test.best[:, np.newaxis], fixed[:, np.newaxis]], axis=1)
    steady = trembling(problem, test.contexts, tried, rng)
    task = problem.task
    launches = task.launches(test.contexts, test.best)
    at_best = task.descend_batch(test.contexts, launches, keep_rebounds=True)
    return (
        {
            "best": float(test.best_reward.mean()),
            "fixed": float(test.rewards[:, number].mean()),
            "anywhere": float(test.rewards.mean()),
            "margin": mean_and_interval((test.best_reward - test.rewards[:, number]) / test.best_reward, rng),
            "kept": mean_and_interval(steady.max(axis=1) / test.best_reward, rng),
            "steady_margin": mean_and_interval(1.0 - steady[:, -1] / steady.max(axis=1), rng),
            "upright": float(upright(at_best).mean()),
            "crashes": float(test.crashed.mean()),
            "best_crash": float(test.rewards[test.crashed].max(initial=0.0)),
            "rebounds": float(at_best.outcomes["rebounds"].mean()),
        },
        problem,
        test,
        fixed,
    )


def draw(name: str, problem: Problem, found: Found, fixed: Floats) -> None:
    """Draw the best and the fixed launch of the context whose margin is larger than that of three quarters."""
    earned = descend(problem, found.contexts, fixed[:, np.newaxis]).jam.reward
    number = int(np.argsort(found.best_reward - earned)[3 * len(earned) // 4])
    context, descents = found.contexts[number : number + 1], []
    for actions in (found.best, fixed):
        launch = State(*problem.task.launches(context, actions[number : number + 1])[0].tolist())
        descents.append(problem.task.descend(context, launch, "trajectory"))
    labels = ["best launch", "fixed launch"]
    plot_strobe(descents, labels=labels).savefig(IMAGES / f"pack_{name}.png")


def main() -> None:
    """Judge scenarios, and add them to the results."""
    results = load("packs")["packs"] if (RESULTS / "packs.json").is_file() else {}
    for name in sys.argv[1:] or [name for name in scenario_names() if name != "paper_impact"]:
        found, problem, launches, fixed = judged(name)
        if problem.scenario.ends.touching is not None:
            draw(name, problem, launches, fixed)
        results[name] = {"contexts": CONTEXTS, "scenario": problem.scenario.hash, **found}
        print(name, results[name], flush=True)
        save("packs", {"packs": results})


if __name__ == "__main__":
    main()
