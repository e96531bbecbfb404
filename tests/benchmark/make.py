"""Made-up results of a benchmark, in which the statistics are known."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
import pandas as pd

from sledenv.benchmark.results import AGENT, COLUMNS, REFERENCE, STATUSES, Results
from sledenv.simulation.jam import DescentJam

HASH = "0123456789abcdef"
LEARN = ("ppo", "sac", "tqc")
VERSIONS = json.dumps({"numpy": "2.4.6", "torch": "2.9"})


def results(
    regrets: Mapping[str, np.ndarray],
    scenarios: tuple[str, ...] = ("brake_mat",),
    environments: tuple[str, ...] = ("launch",),
) -> Results:
    """Judge agents whose regret is given as an array of shape (seeds, contexts), alike everywhere."""
    contexts = next(iter(regrets.values())).shape[1]
    rng = np.random.default_rng(0)
    judged, runs = [], []
    for scenario in scenarios:
        lower = rng.uniform(0.5, 0.9, contexts)
        for environment in environments:
            for agent, values in regrets.items():
                for seed, row in enumerate(values):
                    named = dict(zip([*AGENT, "seed"], (environment, scenario, agent, seed), strict=True))
                    judged.append(descents((1.0 - row) * lower, lower).assign(**named))
                    runs.append(run(1_000, 1.0).assign(**named))
    return Results(pd.concat(judged, ignore_index=True), pd.DataFrame(columns=COLUMNS["curves"]), pd.concat(runs))


def run(budget: int, seconds: float) -> pd.DataFrame:
    """One run of a training, but for its names."""
    took = {"descents": budget, "train_seconds": seconds, "train_cpu_seconds": seconds}
    return pd.DataFrame([took | {"suite": "made-up", "commit": "abc1234", "versions": VERSIONS}])


def descents(
    rewards: np.ndarray, lower: np.ndarray, stage: str = "trained", status: np.ndarray | str = "finish"
) -> pd.DataFrame:
    """Judged descents that lose 2/10 of the energy by hysteresis, 1/10 by sliding, 1/20 by rolling."""
    finished = np.broadcast_to(np.asarray(status) == "finish", rewards.shape)
    kept = np.where(finished, np.square(np.clip(2.0 * rewards - 1.0, 0.0, 0.8)), 0.0)
    return pd.DataFrame(
        {
            "scenario_hash": HASH,
            "stage": stage,
            "context": np.arange(len(rewards)),
            **{name: np.broadcast_to(np.asarray(status) == name, rewards.shape).astype(float) for name in STATUSES},
            **dict.fromkeys(DescentJam._fields, 1.0),
            "reward": rewards,
            "retention": kept,
            "supplied": 1000.0,
            "loss_hysteresis": 200.0,
            "loss_sliding": 100.0,
            "loss_rolling": 50.0,
            "loss_drag": 0.0,
            "rebounds": 9,
            "time": 3.0,
            "action_0": np.linspace(-0.9, 0.9, len(rewards)),
            "on_bound": False,
            **dict(zip(REFERENCE, (lower, 0.05, np.nan), strict=True)),
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
    judged, curves, runs = [], [], []
    for p, scenario in enumerate(scenarios):
        lower = rng.uniform(0.65, 0.95, contexts)
        for environment in environments:
            for agent, level in LEVELS.items():
                learns = agent in LEARN
                if environment == "descent" and not (learns or agent in ("random_launch", "land_parallel")):
                    continue
                for seed in range(1 if agent in ("zero", "land_flat", "land_parallel") else seeds):
                    named = dict(zip([*AGENT, "seed"], (environment, scenario, agent, seed), strict=True))
                    scale = level * (1.0 + 0.3 * p) * rng.lognormal(0.0, 0.2)
                    regret = np.minimum(scale * rng.lognormal(0.0, 1.0, contexts), 1.0)
                    for stage in ("untrained", "trained") if learns else ("trained",):
                        lost = np.minimum(regret + (0.45 if stage == "untrained" else 0.0), 1.0)
                        ends = np.where(lost > 0.5, "jammed", np.where(lost > 0.35, "tumbled", "finish"))
                        part = descents((1.0 - lost) * lower, lower, stage, ends)
                        part["loss_sliding"] = 1000.0 * np.minimum(0.05 + 0.5 * lost.clip(0.0), 0.5)
                        part["loss_hysteresis"] = 120.0
                        part["retention"] = np.where(ends == "finish", 0.6 * (1.0 - lost.clip(0.0)), 0.0)
                        judged.append(part.assign(**named))
                    budget = 20_000 if learns else 1_000
                    runs.append(run(budget, 60.0 + seed).assign(**named))
                    if learns:
                        at = np.linspace(0, budget, 11).astype(int)
                        reward = lower.mean() * (1.0 - scale - 0.4 * np.exp(-at / 4000.0)) + rng.normal(0, 0.005, 11)
                        curve = pd.DataFrame({"descents": at, "seconds": at / 400.0, "mean_reward": reward})
                        curves.append(curve.assign(**named))
    return Results(*(pd.concat(parts, ignore_index=True) for parts in (judged, curves, runs)))


def without_reference(made: Results) -> Results:
    """Return the results of scenarios of which nothing is frozen."""
    return made._replace(judged=made.judged.assign(**dict.fromkeys(REFERENCE, np.nan)))
