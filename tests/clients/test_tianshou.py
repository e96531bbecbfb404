"""Tianshou's Collector gathers the episodes of the environments; needs the extra "tianshou"."""

from __future__ import annotations

from functools import partial

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("tianshou")

from tianshou.algorithm.algorithm_base import Policy
from tianshou.data import Batch, Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv

from tests.envs.kinds import WIDTH, both_ids
from tests.own_scenarios import own_scenario

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]  # of Tianshou, which this project does not own

LANES = 3


class Constant(Policy):
    """Acts alike whatever it sees."""

    def forward(self, batch, state=None, info=("jam", "is_success")):
        return Batch(act=np.full((len(batch.obs), *self.action_space.shape), 0.25, np.float32))


@both_ids
def test_a_collector_gathers_the_episodes_of_gymnasium(env_id):
    """Oracle: Gymnasium's environment with the same seeds and actions; the number of successes by info."""
    make = partial(gym.make, env_id, scenario=own_scenario("ice_drop"), info=("jam", "is_success"))
    envs = DummyVectorEnv([make] * LANES)
    policy = Constant(action_space=make().action_space, observation_space=make().observation_space)
    buffer = VectorReplayBuffer(10_000, LANES)
    collector = Collector(policy, envs, buffer)
    envs.seed(list(range(LANES)))
    collector.reset()
    told = collector.collect(n_episode=LANES)
    returns, steps, successes = [], 0, 0
    for lane in range(LANES):
        env = make()
        env.reset(seed=lane)
        env.reset()
        ended, gained = False, 0.0
        while not ended:
            _, reward, terminated, truncated, info = env.step(np.full(WIDTH[env_id], 0.25, np.float32))
            gained, steps, ended = gained + reward, steps + 1, terminated or truncated
        returns.append(gained)
        successes += info["is_success"]
    np.testing.assert_allclose(sorted(told.returns), sorted(returns), rtol=1e-12)
    assert (told.n_collected_episodes, told.n_collected_steps, len(buffer)) == (LANES, steps, steps)
    kept = buffer.sample(0)[0]
    assert kept.info.is_success[kept.done].sum() == successes
