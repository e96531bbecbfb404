"""What trims are worth after the launch: nothing, what an agent makes of them, and perfect foresight.

``python -m perf.trims [NAME ...]`` judges the shipped critics, alone and with the trims of replan, on test contexts,
writes results/trims.json and prints the table of agents/README.md. Perfect foresight knows the tremble and tries many
sequences of trims in the descent itself, those of the agent among them; it takes the best of each draw. That is no
upper bound, but near one: what half of the sequences reach is told beside it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.stats import qmc

from perf import show
from perf.harness import RESULTS, Floats, load, save
from perf.packs import mean_and_interval
from sledenv.agents.critic_replan import Agent
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import load_run
from sledenv.kernel.records import RUNNING
from sledenv.scenarios.scenario import scenario_names

CONTEXTS: Final = 50
DRAWS: Final = 16  # of the tremble
SEQUENCES: Final = 128
HOPS: Final = 6  # with trims of their own; the last one stays
TRIMS: Final = 33  # tried by the agent at each rebound


def sequences() -> Floats:
    """Return sequences of trims in [-1, 1], shape (SEQUENCES, HOPS): none, the largest, and quasi-random ones."""
    drawn = qmc.Sobol(HOPS, rng=np.random.default_rng(0)).random(SEQUENCES)
    return np.concatenate([np.array([[0.0], [1.0], [-1.0]]) * np.ones(HOPS), 2.0 * drawn[3:] - 1.0])


def foreseen(problem: Problem, trials: Floats, actions: Floats) -> Floats:
    """Return what the sequences earn in trials (n, t, 13) after launches (n, k), shape (n t, SEQUENCES)."""
    planned, task = sequences(), problem.task
    flat = trials.reshape(-1, trials.shape[2])
    contexts = np.repeat(flat, SEQUENCES, axis=0)
    launches = task.launches(flat, np.repeat(actions, trials.shape[1], axis=0))
    rides, plans = task.rides(contexts, np.repeat(launches, SEQUENCES, axis=0)), np.tile(planned, (len(flat), 1))
    rides.hop(np.zeros(len(contexts)))
    hop = 0
    while (rides.outcomes()["status"] == RUNNING).any():
        rides.hop(task.trims(plans[:, min(hop, HOPS - 1)]))
        hop += 1
    earned: Floats = rides.descents().jam.reward
    return earned.reshape(-1, SEQUENCES)


def judged(name: str, count: int = CONTEXTS) -> dict[str, Any]:
    """Judge the shipped critic of a scenario on test contexts: without trims, with those of replan, with foresight."""
    alone = Problem(name)
    _, critic, _ = load_run(Path(f"{name}-launch-{alone.control}-critic-s0"))
    problem = Problem(name, "descent")
    contexts = problem.contexts("test", count)
    trials = problem.trials(contexts, "test", DRAWS)
    still, actions = alone.judge(critic, trials)
    trimmed, _ = problem.judge(Agent(problem, TRIMS, critic), trials)
    pairs = zip(trials, actions, strict=True)
    found = np.stack([foreseen(problem, one[np.newaxis], action[np.newaxis]) for one, action in pairs])
    agent = trimmed.jam.reward.reshape(count, -1)
    best = np.maximum(found.max(axis=2), agent)
    fewer = np.maximum(found[..., : SEQUENCES // 2].max(axis=2), agent)
    none, agent, best = (each.reshape(count, -1).mean(axis=1) for each in (still.jam.reward, agent, best))
    gap, scale = best.mean() - none.mean(), np.maximum(best, 1e-9)
    return {
        "contexts": count,
        "scenario": problem.scenario.hash,
        "none": float(none.mean()),
        "agent": float(agent.mean()),
        "foresight": float(best.mean()),
        "of_fewer": float(fewer.mean()),
        "gap": mean_and_interval((best - none) / scale),
        "gain": mean_and_interval((agent - none) / scale),
        "closed": float((agent.mean() - none.mean()) / gap) if gap > 0.0 else 1.0,
    }


def _interval(values: Any) -> str:
    """Mean and interval in per cent."""
    mean, low, high = (100.0 * value for value in values)
    return f"{mean:.2f} [{low:.2f}, {high:.2f}]"


COLUMNS: show.Columns = {
    "scenario": lambda row: f"`{row[0]}`",
    "no trim": lambda row: f"{row[1]['none']:.4f}",
    "trims of replan": lambda row: f"{row[1]['agent']:.4f}",
    "perfect foresight": lambda row: f"{row[1]['foresight']:.4f}",
    "gap to foresight [%]": lambda row: _interval(row[1]["gap"]),
    "gain of trims [%]": lambda row: _interval(row[1]["gain"]),
    "gap closed": lambda row: f"{row[1]['closed']:.0%}",
}


def main() -> None:
    """Judge the scenarios that have a rider, and add them to the results."""
    results = load("trims")["trims"] if (RESULTS / "trims.json").is_file() else {}
    packs = [name for name in scenario_names() if name != "paper_impact"]
    for name in sys.argv[1:] or [name for name in packs if Problem(name).scenario.rider is not None]:
        results[name] = judged(name)
        save("trims", {"trims": results})
    print(show.table(results.items(), COLUMNS))


if __name__ == "__main__":
    main()
