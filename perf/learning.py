"""Mean regret against descents and seconds of training: PPO, SAC, TD3 and the critic with budgets of several sizes."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from perf import show
from perf.harness import ROOT
from sledenv.agents.curve import FILE, validation
from sledenv.benchmark import runs
from sledenv.benchmark.oracle import oracle
from sledenv.benchmark.problem import Problem
from sledenv.scenarios.configuration import CONFIGS

SCENARIO = "sled_mat"
BUDGETS = {
    "ppo": (46_000, 460_000, 4_600_000),
    "sac": (46_000, 460_000),
    "td3": (46_000, 460_000),
    "critic": (46_000, 460_000),
}
REGRETS = (0.10, 0.05, 0.03, 0.02)  # how long it takes to come below them
COLOURS = {"ppo": show.BLUE, "sac": show.GREEN, "td3": show.PURPLE, "critic": show.ORANGE}
LEVELS = (1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0)  # of the axis of regrets [%]
SETTINGS = CONFIGS / "agents"
RUNS = ROOT / "runs" / "perf" / "learning"  # kept, so that a measurement that was stopped goes on


def measure() -> dict[str, Any]:
    """Train all agents, one after the other, unless that has been done."""
    problem = Problem(SCENARIO)
    cases = []
    for agent, budgets in BUDGETS.items():
        usual = runs.read_settings(SETTINGS, f"sledenv.agents.{agent}", problem)
        for budget in budgets:
            buffer = {"buffer_size": budget} if "buffer_size" in usual else {}
            cases.append((agent, usual | buffer | {"n_timesteps": budget}))
    cases.append(("critic", runs.read_settings(SETTINGS / "minutes", "sledenv.agents.critic", problem)))
    best = oracle(problem, validation(problem), RUNS)["reward"].mean()
    rows = []
    for agent, settings in cases:
        print(f"  {agent}, {settings['n_timesteps']:,} descents", flush=True)
        module, folder = f"sledenv.agents.{agent}", RUNS / f"{agent}-{settings['n_timesteps']}"
        if not runs.is_trained(module, problem, settings, 0, folder):
            runs.train(module, problem, settings, 0, folder)
        curve = pd.read_csv(folder / FILE)
        curve["regret"] = 1.0 - curve["mean_reward"] / best
        columns = {name: curve[name].tolist() for name in ("descents", "seconds", "regret")}
        rows.append({"agent": agent, "budget": settings["n_timesteps"], **columns})
    return {"scenario": SCENARIO, "contexts": len(validation(problem)), "rows": rows}


def _name(row: dict[str, Any]) -> str:
    return "critic" if row["agent"] == "critic" else row["agent"].upper()


def _reached(regret: float, row: dict[str, Any]) -> str:
    """Seconds until the mean regret is below a level for the first time."""
    below = np.flatnonzero(np.array(row["regret"]) <= regret)
    return f"{row['seconds'][below[0]]:,.0f}" if below.size else "-"


def draw(result: dict[str, Any]) -> None:
    """Regret against descents and against seconds, a line a training."""
    with show.drawing("learning", (11.0, 5.0), (1, 2)) as (_, axes):
        for ax, quantity in zip(axes, ("descents", "seconds"), strict=True):
            for row in result["rows"]:
                x, y = np.array(row[quantity]), 100.0 * np.array(row["regret"])
                ax.plot(x[x > 0], y[x > 0], "-o", ms=3, color=COLOURS[row["agent"]], label=_name(row))
            ax.set(xscale="log", yscale="log", xlabel=f"{quantity} of training")
            ax.set_yticks(LEVELS, [f"{level:g}" for level in LEVELS])
            ax.minorticks_off()
        axes[1].set_xlim(left=0.1)  # s
        axes[0].set_ylabel(f"mean regret on {result['contexts']} validation contexts [%]")
        axes[0].set_title(f"Learning on {result['scenario']}, a line a training", loc="left")
        one_each = {label: line for line, label in zip(*axes[0].get_legend_handles_labels(), strict=True)}
        axes[0].legend(one_each.values(), one_each.keys())


COLUMNS: show.Columns = {
    "agent": _name,
    "descents": lambda row: f"{row['budget']:,}",
    "seconds": lambda row: f"{row['seconds'][-1]:,.0f}",
    "descents/s": lambda row: f"{row['descents'][-1] / row['seconds'][-1]:,.0f}",
    "mean regret at the end": lambda row: f"{100.0 * row['regret'][-1]:.2f} %",
    **{f"s to {100.0 * regret:.0f} %": partial(_reached, regret) for regret in REGRETS},
}
