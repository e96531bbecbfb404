"""What the agents of stable-baselines3 share: streams of their own, schedules."""

from __future__ import annotations

import pytest

from sledenv.agents import learning
from sledenv.agents.sac import Agent
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import read_settings
from sledenv.envs.sb3 import make_vec_env
from sledenv.scenarios.configuration import CONFIGS
from tests.own_scenarios import own_scenario

pytestmark = pytest.mark.filterwarnings("ignore")  # of torch, which this project does not own


def test_lanes_of_two_seeds_share_no_stream(monkeypatch, tmp_path):
    """Oracle: the seeds that the environments are asked for."""
    asked = []

    def made(id, lanes, seed, **rest):
        asked.append(range(seed, seed + lanes))
        return make_vec_env(id, lanes, seed, **rest)

    monkeypatch.setattr(learning, "make_vec_env", made)
    problem = Problem(own_scenario("ice_fast"))
    quick = {"n_timesteps": 512, "learning_starts": 256, "gradient_steps": 1}
    given = read_settings(CONFIGS / "agents", "sledenv.agents.sac", "launch") | quick
    for seed in range(3):
        folder = tmp_path / str(seed)
        folder.mkdir()
        Agent.train(problem, given, seed, folder)
    streams = [lane for lanes in asked for lane in lanes]
    assert len(streams) == len(set(streams)) == 3 * given["n_envs"]


def test_a_rate_falls_to_zero_as_the_zoo_has_it():
    """Oracle: a straight line over the progress that is left."""
    rate = learning._schedule("lin_0.004")
    assert [rate(left) for left in (1.0, 0.5, 0.0)] == pytest.approx([0.004, 0.002, 0.0])
    assert learning._schedule(0.003) == 0.003
