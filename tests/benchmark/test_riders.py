"""Who rides beside the visitor of a page: their trims give the rides that are judged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from agents import land_parallel
from sledenv.agents.clairvoyant import follow_plans
from sledenv.benchmark import riders
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.riders import ridden
from sledenv.benchmark.runs import train
from sledenv.scenarios.scenario import ScenarioError

SCENARIO = "sled_kickers"
SHIPPED_LAUNCH = Path("sled_mat-launch-spin-critic-s0")


@pytest.fixture(scope="module")
def problem() -> Problem:
    return Problem(SCENARIO, "descent")


def drawn(problem: Problem, *seeds: int) -> np.ndarray:
    return np.array([problem.scenario.sample(np.random.default_rng(seed)) for seed in seeds])


def test_the_rule_rides_alone_where_no_agent_ships(
    problem: Problem, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Oracle: the rides that are judged; plans of the same trims."""
    monkeypatch.setattr(riders, "TRAINED", tmp_path)
    contexts = drawn(problem, 4, 5)
    found = ridden(problem.scenario, contexts, [])
    assert [[one.name for one in rides] for rides in found] == [["rule (land parallel)"]] * 2
    judged, firsts = problem.judge(land_parallel.Agent(problem), contexts)
    for i in range(2):
        plans = np.array([found[i][0].trims])
        assert follow_plans(problem, contexts[[i]], plans).jam.reward == judged.jam.reward[i]
        assert plans[0, 0] == firsts[i, 0]


def test_a_trained_agent_rides_if_it_is_named_or_ships(
    problem: Problem, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    contexts = drawn(problem, 4)
    run = train("sledenv.agents.zero", problem, {}, 3, tmp_path / f"{SCENARIO}-descent-trim-zero-s3")
    (named,) = ridden(problem.scenario, contexts, [run])
    assert [one.name for one in named] == ["rule (land parallel)", "trained (zero, seed 3)"]
    assert set(named[1].trims) == {0.0}
    monkeypatch.setattr(riders, "TRAINED", tmp_path)
    assert ridden(problem.scenario, contexts, []) == [named]
    other = Problem("sled_rollers", "descent")
    with pytest.raises(ScenarioError, match="was trained on another scenario"):
        ridden(other.scenario, contexts, [run])
    with pytest.raises(ScenarioError, match="chooses a launch"):
        ridden(problem.scenario, contexts, [SHIPPED_LAUNCH])
