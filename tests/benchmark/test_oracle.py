"""The oracle: nothing found by another search beats it, symmetry, its cache."""

from __future__ import annotations

import cma
import numpy as np
import pandas as pd
import pytest

from sledenv.benchmark import oracle as oracle_module
from sledenv.benchmark.oracle import (
    GRID,
    _maxima,
    actions_of,
    best_launches,
    jam_map,
    map_table,
    oracle,
    rewards_again,
)
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.suite import Suite
from sledenv.scenarios.scenario import Context, Scenario, load_scenario
from tests.packs import own_pack


@pytest.fixture(scope="module")
def found() -> tuple[Problem, pd.DataFrame]:
    """Best launches of a few contexts of brake_mat."""
    problem = Problem(own_pack("brake_mat"))
    return problem, best_launches(problem, problem.contexts("test", 2))


def evolve(problem: Problem, context: np.ndarray, start: np.ndarray, spread: float, budget: int, seed: int) -> float:
    """Best expected reward that CMA-ES finds in one context."""
    strategy = cma.CMAEvolutionStrategy(start, spread, {"seed": seed, "verbose": -9, "bounds": [-1, 1], "popsize": 16})
    best = 0.0
    while strategy.countevals < budget and not strategy.stop():
        asked = np.clip(strategy.ask(), -1.0, 1.0)
        rewards = problem.expect(context[np.newaxis], asked[np.newaxis], "test")[0]
        strategy.tell(list(asked), (-rewards).tolist())
        best = max(best, float(rewards.max()))
    return best


def test_the_reward_of_a_best_launch_is_what_it_earns(found):
    """Oracle: the simulator once more; a random search of the same box does not beat it."""
    problem, table = found
    assert np.array_equal(rewards_again(problem, table), table["reward"])
    contexts = table[list(Context._fields)].to_numpy()
    tried = np.random.default_rng(0).uniform(-1.0, 1.0, (len(contexts), 1000, 2))
    assert (problem.expect(contexts, tried, "test").max(axis=1) <= 1.001 * table["reward"]).all()
    assert (table["uniform"] < table["reward"]).all()


def test_what_is_left_is_how_far_the_best_two_searches_are_apart(found, monkeypatch):
    """Oracle: contexts whose searches agree were searched twice and no more; with one search more, none is worse."""
    problem, table = found
    agree = table["left"] <= oracle_module.AGREED * table["reward"]
    assert (table["left"] >= 0.0).all()
    assert (table["searches"][agree] >= oracle_module.SEARCHES[0]).all()
    assert (table["searches"][~agree] == oracle_module.SEARCHES[1]).all()
    assert (table["left_high"] >= table["left"]).all()
    assert (table["reward"] + table["left_high"] <= 1.0).all()
    monkeypatch.setattr(oracle_module, "AGREED", -1.0)
    monkeypatch.setattr(oracle_module, "SEARCHES", (2, 3))
    again = best_launches(problem, table[list(Context._fields)].to_numpy()[:1])
    assert again["searches"].tolist() == [3]
    assert again["reward"][0] >= table["reward"][0]


def test_a_steady_launch_earns_under_a_tremble_what_is_said_and_no_less_than_the_best_launch(found):
    """Oracle: the simulator once more; the best launch without a tremble is one of those that are tried."""
    problem, table = found
    contexts = table[list(Context._fields)].to_numpy()
    steady = table[["steady_0", "steady_1"]].to_numpy()[:, np.newaxis]
    earned = problem.expect(contexts, steady, "test", trembling=True)[:, 0]
    assert earned == pytest.approx(table["steady"].to_numpy(), abs=1e-12)
    other = problem.expect(contexts, actions_of(problem, table)[:, np.newaxis], "test", trembling=True)[:, 0]
    # It was chosen by another tremble than that of the test.
    assert (table["steady"].to_numpy() >= other - 0.05).all()
    assert (table["steady"] <= table["reward"]).all()


@pytest.mark.slow
@pytest.mark.parametrize("scenario", Suite.load("full").scenarios)
def test_evolution_strategies_with_restarts_do_not_beat_the_oracle_by_a_thousandth(scenario):
    """Oracle: CMA-ES from the best launch and five times from a random one; a scan where there is one thing to choose.

    CMA-ES has half as many descents as the oracle, the scan as many.
    """
    problem = Problem(scenario)
    contexts = problem.contexts("test", 12)
    table = best_launches(problem, contexts)
    rng = np.random.default_rng(1)
    gains = []
    for i, context in enumerate(contexts):
        if problem.actions == 1:
            scan = np.linspace(-1.0, 1.0, 18_000)[np.newaxis, :, np.newaxis]
            best = problem.expect(context[np.newaxis], scan, "test").max()
        else:
            starts = [(actions_of(problem, table)[i], 0.05), *((rng.uniform(-1.0, 1.0, 2), 0.5) for _ in range(5))]
            best = max(evolve(problem, context, start, spread, 3000, 1 + j) for j, (start, spread) in enumerate(starts))
        gains.append(best / table["reward"].iloc[i] - 1.0)
    assert max(gains) <= 1e-3


def test_the_map_of_a_symmetric_body_turns_over_with_its_launch():
    """Oracle: launches a full turn apart are the same, so the grid has each once; a row agrees with the simulator."""
    problem = Problem(own_pack("ice_drop"))
    contexts = problem.contexts("test", 2)
    one = jam_map(problem, contexts, {"orientation": 12, "spin": 5})[1]
    assert one.rewards.shape == (12, 5)
    assert one.launches[0][0] == -1.0
    assert one.launches[0][-1] < 1.0 == one.launches[1][-1]
    launch = np.array([[one.launches[0][7], one.launches[1][2]]])
    assert problem.descend(contexts[1:], launch).jam.reward[0] == one.rewards[7, 2]
    table = map_table(problem, contexts[:1])
    assert len(table) == GRID["orientation"] * GRID["spin"]
    assert (
        problem.descend(contexts[:1], table[["orientation", "spin"]].to_numpy()[99:100]).jam.reward[0]
        == table["reward"].iloc[99]
    )


@pytest.mark.parametrize("control", ["both", "orientation", "spin"])
def test_no_cell_is_refined_twice(control):
    """Where a grid has few cells, neighbours are refined once there is nothing else."""
    problem = Problem(own_pack("ice_drop"), control=control)
    shape = tuple(GRID[name] for name in problem.task.controlled)
    rewards = np.random.default_rng(0).random(shape)
    starts = _maxima(problem, rewards, 24, 1)
    assert len(set(starts.tolist())) == 24
    assert starts[0] == rewards.argmax()


@pytest.mark.parametrize("control", ["speed", "all"])
def test_speeds_are_searched_too(control):
    """Oracle: the simulator; a random search; the best of both at the speed of the context, which is less free."""
    content = load_scenario("talus").model_dump(by_alias=True)
    content["control"]["speed_m_s"] = (2.0, 8.0)
    problem = Problem(Scenario.model_validate(content), control=control)
    contexts = problem.contexts("test", 1)
    table = best_launches(problem, contexts)
    assert np.array_equal(rewards_again(problem, table), table["reward"])
    tried = np.random.default_rng(0).uniform(-1.0, 1.0, (1, 3000, problem.actions))
    assert problem.expect(contexts, tried, "test").max() <= 1.001 * table["reward"][0]
    if control == "all":
        less = best_launches(Problem(problem.scenario, control="both"), contexts)
        assert table["reward"][0] >= 0.999 * less["reward"][0]
    cells = map_table(problem, contexts)
    assert len(cells) == np.prod([GRID[name] for name in problem.task.controlled])
    assert cells["reward"].max() <= table["reward"][0]


def test_what_is_not_chosen_is_not_searched():
    problem = Problem(own_pack("ice_drop"), control="spin")
    table = best_launches(problem, problem.contexts("test", 2))
    assert "action_1" not in table
    assert map_table(problem, problem.contexts("test", 1))["orientation"].isna().all()


def test_a_search_is_kept_and_one_of_other_physics_is_made_anew(found, tmp_path, monkeypatch):
    """Oracle: the file is read while its launches earn their rewards, and written anew once they do not."""
    problem, table = found
    contexts = problem.contexts("test", 4)
    calls = []
    monkeypatch.setattr(
        "sledenv.benchmark.oracle.best_launches", lambda *arguments: calls.append(arguments) or table.copy()
    )
    first = oracle(problem, contexts, tmp_path / "cache")
    pd.testing.assert_frame_equal(oracle(problem, contexts, tmp_path / "cache"), first)
    assert len(calls) == 1
    (file,) = (tmp_path / "cache").iterdir()
    table.assign(reward=table["reward"] + 1e-6).to_parquet(file)
    pd.testing.assert_frame_equal(oracle(problem, contexts, tmp_path / "cache"), first)
    assert len(calls) == 2
    oracle(problem, contexts[:2], tmp_path / "cache")
    assert len(calls) == 3
