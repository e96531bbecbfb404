"""The search for the best ride: what it finds is earned, nothing random is above it, and it is kept between runs."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from sledenv.benchmark.best_rides import best_rides, follow_plans
from sledenv.benchmark.oracle import best_found, oracle, search_block
from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import FIELDS
from sledenv.scenarios.scenario import Context


class Plan:
    """Does what a plan says, the trims of one flight after the other; one ride alone."""

    def __init__(self, trims):
        self._trims = list(trims)

    def act(self, observations):
        return np.array([[self._trims.pop(0)]], np.float32)


@pytest.fixture(scope="module")
def found():
    problem = Problem("sled_kickers", "descent")
    return problem, best_found(problem, problem.contexts("test", 3))


def plans_of(table):
    return table.filter(like="action_").to_numpy()


def test_the_best_ride_earns_its_reward_in_the_environment(found):
    """Oracle: the ride of an agent that does what the plan says, in the same draws."""
    problem, table = found
    trials = problem.trials(problem.contexts("test", 3), "test")
    batch = follow_plans(problem, trials[:, 0], plans_of(table))
    assert np.array_equal(batch.jam.reward, table["reward"])
    for trial, plan, reward in zip(trials, plans_of(table), table["reward"], strict=True):
        single, first = problem.judge(Plan(plan[~np.isnan(plan)]), trial)
        assert single.jam.reward[0] == pytest.approx(reward, abs=1e-3)  # an agent's trims are float32
        assert first[0, 0] == np.float32(plan[0])


def test_no_random_ride_is_above_the_best_one(found):
    """Oracle: 2,000 rides with other random trims in each context."""
    problem, table = found
    scenes = problem.trials(problem.contexts("test", 3), "test")[:, 0]
    tried = np.random.default_rng(9).uniform(-1.0, 1.0, (3, 2000, 12))
    rewards = follow_plans(problem, np.repeat(scenes, 2000, axis=0), tried.reshape(-1, 12)).jam.reward
    assert (rewards.reshape(3, -1).max(axis=1) <= table["reward"]).all()
    shares = table[["uniform", "best_of_16", "best_of_64", "best_of_256", "reward", "high"]].to_numpy()
    assert (np.diff(shares, axis=1) >= 0.0).all()
    assert rewards.mean() == pytest.approx(table["uniform"].mean(), abs=0.05)


def test_a_search_is_kept_and_does_not_depend_on_how_many_contexts_are_searched_at_once(found, tmp_path, monkeypatch):
    """Oracle: the search of the first context by itself, and files that are read again."""
    problem, table = found
    contexts, calls = problem.contexts("test", 2), []

    def search(*arguments):
        calls.append(arguments)
        return best_rides(*arguments)

    monkeypatch.setattr("sledenv.benchmark.oracle.best_rides", search)
    first = oracle(problem, contexts, tmp_path)
    pd.testing.assert_frame_equal(oracle(problem, contexts, tmp_path), first)
    assert len(calls) == 1
    assert len(list(tmp_path.iterdir())) == 1
    assert np.array_equal(first["reward"], table["reward"][:2])


def test_blocks_that_were_searched_apart_are_put_together(found, tmp_path, monkeypatch):
    """Oracle: the search of all contexts at once."""
    problem, table = found
    contexts, rides, searched = problem.contexts("test", 3), table.drop(columns=list(Context._fields)), []

    def search(problem, scenes):
        (row,) = np.flatnonzero((contexts == scenes[:, :FIELDS]).all(axis=1))
        searched.append(int(row))
        return rides.iloc[[row]]

    monkeypatch.setattr("sledenv.benchmark.oracle.BLOCK", 1)
    monkeypatch.setattr("sledenv.benchmark.oracle.best_rides", lambda *given: search(*given).reset_index(drop=True))
    for start in (2, 0, 1):
        search_block(problem, contexts, tmp_path, start)
    pd.testing.assert_frame_equal(oracle(problem, contexts, tmp_path), table)
    search_block(problem, contexts, tmp_path, 0)
    assert searched == [2, 0, 1]
    assert len(list(tmp_path.iterdir())) == 1


def test_a_search_in_blocks_keeps_the_draw_of_each_context_and_tells_how_far_it_is(monkeypatch, capsys):
    """Oracle: the draws with which agents are judged."""
    problem = Problem("sled_kickers", "descent")
    contexts = problem.contexts("test", 12)  # more than a block

    def search(problem, scenes):
        return pd.DataFrame({"error": scenes[:, -1]})

    monkeypatch.setattr("sledenv.benchmark.oracle.best_rides", search)
    table = best_found(problem, contexts, progress=True)
    assert np.array_equal(table["error"], problem.trials(contexts, "test")[:, 0, -1])
    assert "12/12" in capsys.readouterr().err


def test_processes_find_what_one_finds(found, monkeypatch):
    """Oracle: the same search without them."""
    problem, table = found
    monkeypatch.setattr("sledenv.benchmark.oracle._PAYS", 1)
    pd.testing.assert_frame_equal(best_found(problem, problem.contexts("test", 3), workers=2), table)
