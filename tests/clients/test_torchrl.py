"""TorchRL makes, steps and resets the environments, alone and in batches; needs the extra "torchrl"."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
import torch

pytest.importorskip("torchrl")

from torchrl.envs import GymEnv, GymWrapper
from torchrl.envs.utils import check_env_specs

from tests.envs.kinds import WIDTH, both_ids
from tests.own_scenarios import own_scenario

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]  # of TorchRL, which this project does not own

SCENARIO = own_scenario("ice_drop")


def played(env_id: str, actions: np.ndarray, seed: int) -> list[tuple[np.ndarray, float, bool]]:
    """One episode of Gymnasium's environment, or as much of it as there are actions: what each step returns."""
    env = gym.make(env_id, scenario=SCENARIO)
    env.reset(seed=seed)
    steps = []
    for action in actions:
        seen, reward, terminated, truncated, _ = env.step(action)
        steps.append((seen, reward, terminated or truncated))
        if steps[-1][2]:
            break
    return steps


def assert_plays(env, env_id: str, lanes: int) -> None:
    """Up to the first end each lane plays the episode of Gymnasium's environment with its seed."""
    shape = (lanes, 200, WIDTH[env_id])
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)
    expected = [played(env_id, actions[lane], 7 + lane) for lane in range(lanes)]
    now = env.reset(seed=7)
    for t in range(min(map(len, expected))):
        now["action"] = torch.from_numpy(actions[:, t].reshape(*env.batch_size, WIDTH[env_id]))
        now = env.step(now)["next"]
        told = [now[name].reshape(lanes, -1).numpy() for name in ("observation", "reward", "done")]
        for lane, (seen, reward, done) in enumerate(steps[t] for steps in expected):
            assert (told[1][lane], told[2][lane]) == (np.float32(reward), done)
            assert np.array_equal(told[0][lane], seen)
    assert told[2].any()


@both_ids
@pytest.mark.parametrize("given", [{}, {"info": ()}])
def test_gymenv_plays_the_episodes_of_gymnasium(env_id, given):
    """Oracle: Gymnasium's environment with the same seed and actions; TorchRL's own check."""
    env = GymEnv(f"sledenv:{env_id}", scenario=SCENARIO, device="cpu", **given)
    check_env_specs(env)
    assert_plays(env, env_id, 1)
    assert env.rollout(40, break_when_any_done=False).shape == (40,)
    env.close()


@both_ids
def test_gymwrapper_of_the_native_batch_plays_the_episodes_of_gymnasium(env_id):
    """Oracle: Gymnasium's environments with the same seeds and actions."""
    batch = gym.make_vec(f"sledenv:{env_id}", num_envs=4, scenario=SCENARIO, autoreset_mode="Disabled")
    env = GymWrapper(batch, device="cpu")
    assert_plays(env, env_id, 4)
    rollout = env.rollout(100, break_when_any_done=False)
    assert rollout["next", "done"].sum(dim=1).min() > 1  # every lane has begun anew
