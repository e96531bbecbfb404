"""Agents that try launches in a model: what they choose is the best of what they have tried."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import qmc

from sledenv.agents import cma_lookups, uniform_lookups, verified
from sledenv.agents.train import default_settings
from sledenv.agents.uniform_lookups import Model, checked_lookups
from sledenv.benchmark.landing import Landing
from sledenv.benchmark.problem import Problem
from sledenv.scenarios.configuration import CONFIGS


@pytest.fixture(scope="module")
def problem() -> Problem:
    return Problem("sled_mat")


def seen(problem: Problem, count: int) -> np.ndarray:
    return problem.task.observe(problem.contexts("test", count))


def earned(problem: Problem, observations: np.ndarray, launches: np.ndarray, draws: int, number: int) -> np.ndarray:
    """Mean rewards of launches over draws of a model, one descent at a time."""
    scenes = problem.scenes(problem.task.contexts_seen(observations), draws, (9, number))
    rewards = [
        [problem.descend(scenes[i, j][np.newaxis], launch[np.newaxis]).jam.reward[0] for j in range(draws)]
        for i, launch in enumerate(launches)
    ]
    return np.mean(rewards, axis=1)


def test_uniform_lookups_take_the_best_of_their_candidates(problem: Problem) -> None:
    """Oracle: each candidate simulated alone; 32 descents are 5 candidates with 3 draws, and 4 of these with 4 more."""
    observations, landing = seen(problem, 3), Landing(problem)
    candidates = 2.0 * qmc.Sobol(1, rng=np.random.default_rng(0)).random_base2(3)[:5, 0] - 1.0
    launches = [landing.actions(observations, np.full((3, 1), one, np.float32)) for one in candidates]
    first = np.array([earned(problem, observations, one, 3, 0) for one in launches])
    again = np.array([earned(problem, observations, one, 4, 1) for one in launches])
    again[first == first.min(axis=0)] = -np.inf
    best = (3 * first + 4 * again).argmax(axis=0)
    chosen = uniform_lookups.Agent(problem, 32).act(observations)
    assert chosen.dtype == np.float32
    assert np.array_equal(chosen, np.array(launches)[best, np.arange(3)])


@pytest.fixture(scope="module")
def trained(problem: Problem, tmp_path_factory: pytest.TempPathFactory) -> verified.Agent:
    """With a critic that has learned next to nothing."""
    settings = default_settings("verified", problem, Path(CONFIGS) / "agents")
    settings |= {"n_timesteps": 300, "n_contexts": 10, "n_tries": 10, "gradient_steps": 2, "checks": 1, "lookups": 16}
    return verified.Agent.train(problem, settings, 0, tmp_path_factory.mktemp("verified"))


def test_what_a_model_verifies_is_better_than_what_the_critic_would_do(
    problem: Problem, trained: verified.Agent
) -> None:
    """Oracle: the critic alone, which knows next to nothing, judged by draws that neither has seen."""
    contexts = problem.contexts("test", 30)
    trials, observations = problem.trials(contexts, "test"), problem.task.observe(contexts)
    own, alone = (
        problem.expect(trials, agent.act(observations)[:, np.newaxis].astype(float)).mean()
        for agent in (verified.Agent(problem, trained._proposer, 256), trained._proposer)
    )
    assert own > alone + 0.05


def test_proposals_differ_and_the_first_is_the_best(problem: Problem, trained: verified.Agent) -> None:
    observations = seen(problem, 4)
    proposer = trained._proposer
    proposed = proposer.proposals(observations, 12, 0.1)
    assert proposed.shape == (4, 12, 1)
    apart = np.abs(proposed - proposed.transpose(0, 2, 1)) + np.eye(12)
    assert apart.min() >= 0.1
    many = proposer.proposals(observations, 60, 0.1)[:, :, 0]  # more than there is room for
    assert all(len(np.unique(row)) == 60 for row in many)
    first = np.asarray(Landing(problem).actions(observations, proposed[:, 0].astype(np.float32)))
    assert np.array_equal(first, proposer.act(observations))


def test_cma_es_takes_the_best_that_it_has_tried(problem: Problem) -> None:
    """Oracle: it is better in its model than the middle of the box, and the same every time."""
    observations = seen(problem, 4)
    chosen = cma_lookups.Agent(problem, 64).act(observations)
    assert np.array_equal(chosen, cma_lookups.Agent(problem, 64).act(observations))
    middle = Model(problem, 64, observations).expect(np.zeros((4, 1, 1)))[:, 0]
    assert earned(problem, observations, chosen, 4, 0).mean() > middle.mean()


@pytest.mark.parametrize("lookups", [7, 16.0, True, "16"])
def test_too_few_descents_are_refused(lookups: object) -> None:
    with pytest.raises(ValueError, match=r"lookups = .*: must be a whole number of descents, at least 8"):
        checked_lookups(lookups)
