"""The jam map of one context, with its best launch and what trained agents choose: the command ``sledenv map``."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from sledenv.benchmark.figures import plot_maps
from sledenv.benchmark.oracle import best_launches, map_table
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import agent_name, load_run
from sledenv.benchmark.scores import Results
from sledenv.envs.task import Contexts
from sledenv.scenario import Scenario, ScenarioError


class Landscape(NamedTuple):
    """What there is to say about the launches of one context."""

    figure: Figure
    words: str


def landscape(scenario: str | os.PathLike[str] | Scenario, seed: int, runs: Sequence[Path]) -> Landscape:
    """Map the launches of one context.

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    seed : int
        Which context is drawn, as in ``sledenv simulate``.
    runs : sequence of Path
        Folders of trained agents, whose choices are marked.

    Raises
    ------
    FileNotFoundError, ValueError
        If a folder is no finished run.
    ScenarioError
        If a run is of another scenario, or of agents that choose something else.
    """
    problem = Problem(scenario)
    context = np.array([problem.scenario.sample(np.random.default_rng(seed))])
    best = best_launches(problem, context)
    chosen = [_choice(problem, context, folder) for folder in runs]
    named = {"environment": "launch", "scenario": problem.scenario.id}
    results = pd.DataFrame(chosen, columns=_COLUMNS).assign(context=0, trial=0, noise=0.0, stage="trained", **named)
    oracle = best.assign(scenario=problem.scenario.id, context=0)
    maps = map_table(problem, context).assign(scenario=problem.scenario.id)
    nothing = pd.DataFrame()
    figure = plot_maps(Results(results, nothing, nothing, oracle, maps))
    assert figure is not None  # there is one map
    return Landscape(figure, _words(problem, best.iloc[0], results))


_COLUMNS = ["agent", "seed", "action_0", "action_1", "reward"]


def _choice(problem: Problem, context: Contexts, folder: Path) -> tuple[str, int, float, float, float]:
    theirs, agent, config = load_run(folder)
    if (theirs.scenario.hash, theirs.control) != (problem.scenario.hash, problem.control):
        raise ScenarioError(f"{folder} was trained on another scenario ({theirs.scenario.id}, {theirs.control})")
    trials = theirs.trials(context)[0]
    batch, actions = theirs.judge(agent, trials)
    launch = [*actions[0].tolist(), np.nan][:2]
    return agent_name(config["agent"]), int(config["seed"]), launch[0], launch[1], float(batch.jam.reward.mean())


def _words(problem: Problem, best: pd.Series, results: pd.DataFrame) -> str:
    def launch(row: pd.Series) -> str:
        actions = np.array([[row[f"action_{i}"] for i in range(len(problem.task.controlled))]])
        state = problem.task.launches(best[:8].to_numpy(dtype=float)[np.newaxis], actions)[0]
        parts = {"orientation": f"{np.degrees(state[2]):8.2f} deg", "spin": f"{state[5]:7.3f} rad/s"}
        return " ".join(parts[name] for name in problem.task.controlled)

    lines = [f"{'best launch':<20} {launch(best)}   reward {best['reward']:.4f}"]
    lines += [
        f"{row['agent'] + ', seed ' + str(row['seed']):<20} {launch(row)}   reward {row['reward']:.4f}, "
        f"regret {1.0 - row['reward'] / best['reward']:.2%}"
        for _, row in results.iterrows()
    ]
    lines.append(f"{'any launch':<20} mean reward {best['uniform']:.4f}; {best['width']:.2%} within 1 % of the best")
    lines.append(f"{'neighbours differ':<20} by {best['step_median']:.4f} (median), {best['step_p99']:.4f} (99 %)")
    return "\n".join(lines)
