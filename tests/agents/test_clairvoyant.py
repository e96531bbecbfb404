"""The rides of one who knows the errors: what they earn is earned, and nothing random is above them."""

from __future__ import annotations

import numpy as np
import pytest

from sledenv.agents.clairvoyant import best_rides, follow_plans
from sledenv.benchmark.problem import Problem


class Plan:
    """Does what a plan says, the trims of one flight after the other; one ride alone."""

    def __init__(self, trims):
        self._trims = list(trims)

    def act(self, observations):
        return np.array([[self._trims.pop(0)]], np.float32)


@pytest.fixture(scope="module")
def found():
    problem = Problem("sled_kickers", "descent")
    scenes = problem.trials(problem.contexts("test", 3), "test")[:, 0]
    return problem, scenes, best_rides(problem, scenes)


def test_the_best_ride_earns_its_reward_in_the_environment(found):
    """Oracle: the ride of an agent that does what the plan says, in the same draws."""
    problem, scenes, table = found
    plans = table.filter(like="action_").to_numpy()
    batch = follow_plans(problem, scenes, plans)
    assert np.array_equal(batch.jam.reward, table["reward"])
    for scene, plan, reward in zip(scenes, plans, table["reward"], strict=True):
        single, first = problem.judge(Plan(plan[~np.isnan(plan)]), scene[np.newaxis])
        assert single.jam.reward[0] == pytest.approx(reward, abs=1e-3)  # an agent's trims are float32
        assert first[0, 0] == np.float32(plan[0])


def test_hardly_any_random_ride_is_above_the_best_one(found):
    """Oracle: 2,000 rides with other random trims in each context."""
    problem, scenes, table = found
    tried = np.random.default_rng(9).uniform(-1.0, 1.0, (3, 2000, 12))
    rewards = follow_plans(problem, np.repeat(scenes, 2000, axis=0), tried.reshape(-1, 12)).jam.reward
    above = rewards.reshape(3, -1).max(axis=1) - table["reward"]
    assert above.max() < 0.01
    assert (above <= 0.0).sum() >= 2
    assert (table["apart"] >= 0.0).all()


def test_a_search_does_not_depend_on_how_many_contexts_are_searched_at_once(found):
    """Oracle: the search of the second context by itself."""
    problem, scenes, table = found
    assert best_rides(problem, scenes[1:2])["reward"].item() == table["reward"][1]
