"""Made-up results of a benchmark, in which the statistics are known."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import pandas as pd

from sledenv.benchmark.scores import STATUSES, Results
from sledenv.simulation.jam import DescentJam

HASH = "0123456789abcdef"


def results(
    regrets: Mapping[str, np.ndarray],
    scenarios: tuple[str, ...] = ("brake_mat",),
    environments: tuple[str, ...] = ("launch",),
) -> Results:
    """Judge agents whose regret is given as an array of shape (seeds, contexts), alike everywhere.

    Those of ``LEARN`` have a learning curve of one point.
    """
    contexts = next(iter(regrets.values())).shape[1]
    rng = np.random.default_rng(0)
    oracles, rows, curves = [], [], [pd.DataFrame(columns=CURVES.split())]
    for scenario in scenarios:
        best = rng.uniform(0.5, 0.9, contexts)
        for environment in environments:
            oracles.append(oracle(environment, scenario, best))
            for agent, values in regrets.items():
                for seed, row in enumerate(values):
                    rows.append(descents(environment, scenario, agent, seed, (1.0 - row) * best))
                    if agent in LEARN:
                        point = {"descents": [100], "seconds": [1.0], "mean_reward": [0.5]}
                        named = {"environment": environment, "scenario": scenario, "agent": agent, "seed": seed}
                        curves.append(pd.DataFrame(point).assign(**named))
    judged, learning, searched = (
        pd.concat(parts, ignore_index=True) for parts in (rows, curves[1:] or curves, oracles)
    )
    runs, maps = (pd.DataFrame(columns=columns.split()) for columns in (RUNS, MAPS))
    return Results(judged, learning, runs, searched, maps)


LEARN = ("ppo", "sac", "tqc")
CURVES = "environment scenario agent seed descents seconds mean_reward"
RUNS = "environment scenario agent seed descents train_seconds commit versions suite"
MAPS = "scenario context orientation spin reward"


def oracle(environment: str, scenario: str, best: np.ndarray) -> pd.DataFrame:
    """Best launches or rides, with a random one that earns half as much."""
    numbers = np.arange(len(best))
    angle = np.linspace(-0.9, 0.9, len(best))
    return pd.DataFrame(
        {
            "environment": environment,
            "scenario": scenario,
            "context": numbers,
            "action_0": angle,
            "action_1": -0.5 * angle,
            "reward": best,
            "low": 0.999 * best,
            "high": 1.001 * best,
            "uniform": 0.5 * best,
            "width": 0.02,
        }
    )


def descents(
    environment: str,
    scenario: str,
    agent: str,
    seed: int,
    rewards: np.ndarray,
    stage: str = "trained",
    status: np.ndarray | str = "finish",
) -> pd.DataFrame:
    """Judged descents that lose 2/10 of the energy by hysteresis, 1/10 by sliding, 1/20 by rolling."""
    numbers = np.arange(len(rewards))
    finished = np.broadcast_to(np.asarray(status) == "finish", rewards.shape)
    kept = np.where(finished, np.square(np.clip(2.0 * rewards - 1.0, 0.0, 0.8)), 0.0)
    return pd.DataFrame(
        {
            "environment": environment,
            "scenario": scenario,
            "scenario_hash": HASH,
            "agent": agent,
            "seed": seed,
            "stage": stage,
            "context": numbers,
            **{name: np.broadcast_to(np.asarray(status) == name, rewards.shape).astype(float) for name in STATUSES},
            **dict.fromkeys(DescentJam._fields, 1.0),
            "reward": rewards,
            "retention": kept,
            "supplied": 1000.0,
            "loss_hysteresis": 200.0,
            "loss_sliding": 100.0,
            "loss_rolling": 50.0,
            "rebounds": 9,
            "time": 3.0,
            "action_0": np.linspace(-0.9, 0.9, len(rewards)),
            "action_1": -0.5 * np.linspace(-0.9, 0.9, len(rewards)),
            "on_bound": False,
        }
    )


LEVELS = {
    "zero": 0.6,
    "random_launch": 0.5,
    "best_fixed": 0.15,
    "land_flat": 0.05,
    "land_parallel": 0.3,
    "ppo": 0.02,
    "sac": 0.008,
    "tqc": 0.012,
}


def whole(
    scenarios: tuple[str, ...] = ("brake_mat", "ice_drop", "ice_fast"),
    environments: tuple[str, ...] = ("launch", "descent"),
    seeds: int = 5,
    contexts: int = 100,
) -> Results:
    """Results with everything that a report shows, roughly as real ones look."""
    rng = np.random.default_rng(1)
    judged, curves, runs, oracles, maps = [], [], [], [], []
    for p, scenario in enumerate(scenarios):
        best = rng.uniform(0.65, 0.95, contexts)
        table = oracle("launch", scenario, best)
        table[["action_0", "action_1"]] = rng.uniform(-1.0, 1.0, (contexts, 2))
        oracles += [table.assign(environment=environment) for environment in environments]
        maps += [jam_map(scenario, i, best[i], *table.loc[i, ["action_0", "action_1"]]) for i in range(3)]
        for environment in environments:
            for agent, level in LEVELS.items():
                learns = agent in LEARN
                if environment == "descent" and not (learns or agent in ("random_launch", "land_parallel")):
                    continue
                for seed in range(1 if agent in ("zero", "land_flat", "land_parallel") else seeds):
                    scale = level * (1.0 + 0.3 * p) * rng.lognormal(0.0, 0.2)
                    regret = np.minimum(scale * rng.lognormal(0.0, 1.0, contexts), 1.0)
                    for stage in ("untrained", "trained"):
                        if stage == "untrained" and not learns:
                            continue
                        lost = np.minimum(regret + (0.45 if stage == "untrained" else 0.0), 1.0)
                        rewards = (1.0 - lost) * best
                        ends = np.where(lost > 0.5, "jammed", np.where(lost > 0.35, "tumbled", "finish"))
                        part = descents(environment, scenario, agent, seed, rewards, stage, ends)
                        spread = 0.4 * np.sqrt(level)
                        places = table[["action_0", "action_1"]] + rng.normal(0.0, spread, (contexts, 2))
                        part[["action_0", "action_1"]] = np.clip(places, -1.0, 1.0)
                        part["on_bound"] = (part[["action_0", "action_1"]].abs() == 1.0).any(axis=1)
                        part["loss_sliding"] = 1000.0 * np.minimum(0.05 + 0.5 * lost.clip(0.0), 0.5)
                        part["loss_hysteresis"] = 120.0
                        part["retention"] = np.where(ends == "finish", 0.6 * (1.0 - lost.clip(0.0)), 0.0)
                        judged.append(part)
                    budget = 20_000 if learns else 1_000
                    run = {"environment": environment, "scenario": scenario, "agent": agent, "seed": seed}
                    run |= {"descents": budget, "train_seconds": 60.0 + seed, "commit": "abc1234"}
                    runs.append(run | {"versions": json.dumps({"numpy": "2.4.6", "torch": "2.9"}), "suite": "made-up"})
                    if learns:
                        at = np.linspace(0, budget, 11).astype(int)
                        reward = best.mean() * (1.0 - scale - 0.4 * np.exp(-at / 4000.0)) + rng.normal(0, 0.005, 11)
                        curve = pd.DataFrame({"descents": at, "seconds": at / 400.0, "mean_reward": reward})
                        curves.append(curve.assign(environment=environment, scenario=scenario, agent=agent, seed=seed))
    tables = (pd.concat(parts, ignore_index=True) for parts in (judged, curves))
    launches = (pd.concat(parts, ignore_index=True) for parts in (oracles, maps))
    return Results(*tables, pd.DataFrame(runs), *launches)


def jam_map(scenario: str, context: int, best: float, orientation: float, spin: float) -> pd.DataFrame:
    """A hill with plateaus whose top is at a launch."""
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 36, endpoint=False), np.linspace(-1.0, 1.0, 17), indexing="ij")
    turn = (x - orientation + 1.0) % 2.0 - 1.0
    hill = best * np.exp(-3.0 * np.square(turn) - np.square(y - spin))
    reward = np.where(np.sin(9.0 * x + 4.0 * y) > 0.6, 0.5 * hill, hill)
    cells = {"orientation": x.ravel(), "spin": y.ravel(), "reward": reward.ravel()}
    return pd.DataFrame(cells).assign(scenario=scenario, context=context)
