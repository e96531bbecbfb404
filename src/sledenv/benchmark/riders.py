"""Who rides beside the visitor of a page: the rule, and trained agents."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from sledenv.benchmark.figures import label
from sledenv.benchmark.problem import Agent, Problem
from sledenv.benchmark.runs import TRAINED, agent_class, agent_name, load_run, read_config
from sledenv.envs.inputs import Contexts
from sledenv.pages.ride import Ridden
from sledenv.scenarios.scenario import Scenario, ScenarioError

_RULE: Final = "sledenv.agents.land_parallel"


class _Rider(NamedTuple):
    name: str
    problem: Problem
    agent: Agent


def ridden(
    scenario: Scenario, contexts: Contexts, runs: Sequence[Path], tracks: Sequence[str] = ()
) -> list[list[Ridden]]:
    """Return how others ride in contexts of shape (n, 12): a list for each of them.

    They are the rule that lands parallel to the ground and the agents of runs, or of those that ship for the scenario
    if none are named. With ``tracks``, n names of those made by hand, each context is ridden on its own.

    Raises
    ------
    FileNotFoundError, ValueError
        If a folder is no finished run.
    ScenarioError
        If a run is of another scenario, or of agents that choose a launch.
    GivenCodeError
        If an agent raises an error.
    """
    riders = [_rule(scenario), *(_trained(scenario, run) for run in runs or _shipped(scenario))]
    found = [(one.name, _trims(one, contexts, tracks)) for one in riders]
    return [[Ridden(name, trims[i]) for name, trims in found] for i in range(len(contexts))]


def _trims(rider: _Rider, contexts: Contexts, tracks: Sequence[str]) -> list[list[float]]:
    """Trims of a rider in each context, in one flight after the other."""
    parts = [(rider.problem.on(track), contexts[[i]]) for i, track in enumerate(tracks)] or [(rider.problem, contexts)]
    tables = (problem.ride(rider.agent, own)[1] for problem, own in parts)
    return [trims[~np.isnan(trims)].tolist() for table in tables for trims in table]


def _rule(scenario: Scenario) -> _Rider:
    """The rule, which has nothing to learn and writes nothing."""
    problem = Problem(scenario, "descent")
    return _Rider(f"rule ({label(agent_name(_RULE))})", problem, agent_class(_RULE).load(problem, Path()))


def _trained(scenario: Scenario, run: Path) -> _Rider:
    problem, agent, config = load_run(run)
    if problem.environment != "descent":
        raise ScenarioError(f"{run} chooses a launch, but here every flight of a ride is trimmed")
    if problem.scenario.hash != scenario.ride().hash:
        raise ScenarioError(f"{run} was trained on another scenario ({problem.scenario.id})")
    return _Rider(f"trained ({label(agent_name(config['agent']))}, seed {config['seed']})", problem, agent)


def _shipped(scenario: Scenario) -> list[Path]:
    """Runs of the scenario that ship."""
    folders = sorted(TRAINED.glob(f"{scenario.id}-descent-*"))
    return [folder for folder in folders if read_config(folder)["scenario_hash"] == scenario.ride().hash]
