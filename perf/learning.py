"""Mean regret against descents and seconds of training: PPO, SAC, TD3 and the critic with budgets of several sizes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from perf.harness import BLUE, GREEN, ORANGE, PURPLE, drawing, save, table
from sledenv.agents.curve import FILE, validation
from sledenv.benchmark import runs
from sledenv.benchmark.oracle import oracle
from sledenv.benchmark.problem import Problem
from sledenv.scenarios.configuration import CONFIGS

SCENARIO = "brake_mat"
BUDGETS = {
    "ppo": (46_000, 460_000, 4_600_000),
    "sac": (46_000, 460_000),
    "td3": (46_000, 460_000),
    "critic": (46_000, 460_000),
}
REGRETS = (0.10, 0.05, 0.03, 0.02)  # how long it takes to come below them
COLOURS = {"ppo": BLUE, "sac": GREEN, "td3": PURPLE, "critic": ORANGE}
LEVELS = (1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0)  # of the axis of regrets [%]
ROOT = Path(__file__).parents[1]
SETTINGS = CONFIGS / "agents"
RUNS = ROOT / "runs" / "perf" / "learning"  # kept, so that a measurement that was stopped goes on


def trained(agent: str, settings: dict[str, Any], problem: Problem) -> pd.DataFrame:
    """Return the learning curve of an agent, training it unless that has been done."""
    module, folder = f"sledenv.agents.{agent}", RUNS / f"{agent}-{settings['n_timesteps']}"
    if not runs.is_trained(module, problem, settings, 0, folder):
        runs.train(module, problem, settings, 0, folder)
    return pd.read_csv(folder / FILE)


def main() -> None:
    """Measure, write and draw."""
    problem = Problem(SCENARIO)
    cases = []
    for agent, budgets in BUDGETS.items():
        usual = runs.read_settings(SETTINGS, f"sledenv.agents.{agent}", problem)
        buffer = [{"buffer_size": budget} if "buffer_size" in usual else {} for budget in budgets]
        cases += [(agent, usual | more | {"n_timesteps": n}) for n, more in zip(budgets, buffer, strict=True)]
    cases.append(("critic", runs.read_settings(SETTINGS / "minutes", "sledenv.agents.critic", problem)))
    best = oracle(problem, validation(problem), RUNS)["reward"].mean()
    rows = []
    for agent, settings in cases:
        print(f"  {agent}, {settings['n_timesteps']:,} descents", flush=True)
        curve = trained(agent, settings, problem)
        regrets = 1.0 - curve["mean_reward"] / best
        rows.append(
            {
                "agent": agent,
                "budget": settings["n_timesteps"],
                "descents": curve["descents"].tolist(),
                "seconds": curve["seconds"].tolist(),
                "regret": regrets.tolist(),
            }
        )
    result = {"scenario": SCENARIO, "contexts": len(validation(problem)), "rows": rows}
    save("learning", result)
    draw(result)


def reached(row: dict[str, Any], regret: float) -> float:
    """Seconds until the mean regret is below a level for the first time, NaN if it never is."""
    below = np.flatnonzero(np.array(row["regret"]) <= regret)
    return float(row["seconds"][below[0]]) if below.size else float("nan")


def draw(result: dict[str, Any]) -> None:
    """Regret against descents and against seconds, a line a training."""
    with drawing("learning", (11.0, 5.0), (1, 2)) as (_, axes):
        for ax, quantity in zip(axes, ("descents", "seconds"), strict=True):
            named = set()
            for row in result["rows"]:
                agent = row["agent"]
                words = None if agent in named else "critic" if agent == "critic" else agent.upper()
                named.add(agent)
                x, y = np.array(row[quantity]), 100.0 * np.array(row["regret"])
                ax.plot(x[x > 0], y[x > 0], "-o", ms=3, color=COLOURS[agent], label=words)
            ax.set(xscale="log", yscale="log", xlabel=f"{quantity} of training")
            ax.set_yticks(LEVELS, [f"{level:g}" for level in LEVELS])
            ax.minorticks_off()
        axes[1].set_xlim(left=0.1)  # s
        axes[0].set_ylabel(f"mean regret on {result['contexts']} validation contexts [%]")
        axes[0].set_title(f"Learning on {result['scenario']}, a line a training", loc="left")
        axes[0].legend()


def tables(result: dict[str, Any]) -> str:
    """Return the table of docs/performance.md."""
    rows = []
    for row in result["rows"]:
        seconds = row["seconds"][-1]
        times = [reached(row, regret) for regret in REGRETS]
        rows.append(
            (
                "critic" if row["agent"] == "critic" else row["agent"].upper(),
                f"{row['budget']:,}",
                f"{seconds:,.0f}",
                f"{row['descents'][-1] / seconds:,.0f}",
                f"{100.0 * row['regret'][-1]:.2f} %",
                *("-" if np.isnan(time) else f"{time:,.0f}" for time in times),
            )
        )
    heads = [f"s to {100.0 * regret:.0f} %" for regret in REGRETS]
    return table(("agent", "descents", "seconds", "descents/s", "mean regret at the end", *heads), rows)


if __name__ == "__main__":
    main()
