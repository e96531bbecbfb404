"""Made-up results of a benchmark, in which the statistics are known."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping

import numpy as np
import pandas as pd

from sledenv.benchmark.results import AGENT, COLUMNS, REFERENCE, STATUSES, Results
from sledenv.simulation.jam import DescentJam

HASH = "0123456789abcdef"
LEARN = ("sac",)
VERSIONS = json.dumps({"numpy": "2.4.6", "torch": "2.9"})


def results(
    regrets: Mapping[str, np.ndarray],
    scenarios: tuple[str, ...] = ("brake_mat",),
    environments: tuple[str, ...] = ("launch",),
) -> Results:
    """Judge agents whose regret is given as an array of shape (seeds, contexts), alike everywhere."""
    lower = np.random.default_rng(0).uniform(0.5, 0.9, next(iter(regrets.values())).shape[1])
    judged, runs = [], []
    for scenario, environment, (agent, values) in itertools.product(scenarios, environments, regrets.items()):
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


LEVELS = {"zero": 0.6, "random_launch": 0.5, "land_parallel": 0.3, "sac": 0.008}


def whole(scenarios: tuple[str, ...] = ("brake_mat",), seeds: int = 2, contexts: int = 20) -> Results:
    """Results with everything that a report shows, roughly as real ones look: launches and rides."""
    rng = np.random.default_rng(1)
    judged, curves, runs = [], [], []
    for scenario, environment, (agent, level) in itertools.product(scenarios, ("launch", "descent"), LEVELS.items()):
        lower, learns = np.full(contexts, 0.8), agent in LEARN
        for seed in range(seeds if learns else 1):
            named = dict(zip([*AGENT, "seed"], (environment, scenario, agent, seed), strict=True))
            regret = np.minimum(level * rng.lognormal(0.0, 1.0, contexts), 1.0)
            for stage, more in (("untrained", 0.45), ("trained", 0.0)) if learns else (("trained", 0.0),):
                lost = np.minimum(regret + more, 1.0)
                ends = np.where(lost > 0.5, "jammed", np.where(lost > 0.35, "tumbled", "finish"))
                judged.append(descents((1.0 - lost) * lower, lower, stage, ends).assign(**named))
            runs.append(run(20_000 if learns else 1_000, 60.0 + seed).assign(**named))
            if learns:
                at = np.linspace(0, 20_000, 11).astype(int)
                curve = {"descents": at, "seconds": at / 400.0, "mean_reward": 0.8 - 0.4 * np.exp(-at / 4000.0)}
                curves.append(pd.DataFrame(curve).assign(**named))
    return Results(*(pd.concat(parts, ignore_index=True) for parts in (judged, curves, runs)))


def without_reference(made: Results) -> Results:
    """Return the results of scenarios of which nothing is frozen."""
    return made._replace(judged=made.judged.assign(**dict.fromkeys(REFERENCE, np.nan)))
