"""Ray RLlib runs an iteration of PPO in this process and in a worker; needs the extra "ray"."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("ray.rllib")

from examples import rllib_ppo
from tests.own_scenarios import own_scenario

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]  # of Ray, which this project does not own


@pytest.mark.parametrize("env_runners", [0, 1])
def test_rllib_runs_an_iteration_of_ppo(env_runners):
    """Oracle: every episode has one step, and a return is a reward in (0, 1); the learner has seen the batch."""
    given = ["--scenario", own_scenario("ice_drop"), "--batch", "256", "--env-runners", str(env_runners)]
    (result,) = rllib_ppo.main(given)
    sampled = result["env_runners"]
    assert sampled["num_env_steps_sampled"] >= 256
    assert sampled["episode_len_mean"] == 1.0
    assert 0.0 < sampled["episode_return_mean"] < 1.0
    assert math.isfinite(result["learners"]["default_policy"]["total_loss"])
