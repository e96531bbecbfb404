"""Clients that need only what the other tests need: the single-file PPO, and workers that are started anew."""

from __future__ import annotations

from functools import partial

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.error import InvalidAction
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv

from examples import cleanrl_ppo
from sledenv.envs import DESCENT_ID, LAUNCH_ID
from tests.envs.kinds import equal
from tests.own_scenarios import own_scenario


@pytest.fixture(autouse=True)
def _torch_threads():
    threads = torch.get_num_threads()
    yield
    torch.set_num_threads(threads)


def actions(env, steps: int, lanes: int) -> np.ndarray:
    shape = (steps, lanes, *env.action_space.shape)
    return np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)


def test_the_single_file_ppo_repeats(capsys):
    short = ["--scenario", own_scenario("brake_mat"), "--total-timesteps", "1024"]
    assert cleanrl_ppo.main(short) == cleanrl_ppo.main(short)
    assert len(capsys.readouterr().out.splitlines()) == 2 * (1024 // 512 + 1)


@pytest.mark.slow
def test_the_single_file_ppo_learns_the_braking_mat():
    """Oracle: its own untrained policy on the same held-out contexts."""
    arguments = cleanrl_ppo.Arguments(scenario=own_scenario("brake_mat"))
    torch.manual_seed(arguments.seed)
    before = cleanrl_ppo.evaluate(cleanrl_ppo.Agent(11, 2), arguments)
    assert cleanrl_ppo.main(["--scenario", arguments.scenario, "--total-timesteps", "6144"]) > before + 0.1


@pytest.mark.parametrize("name", [pytest.param(LAUNCH_ID, marks=pytest.mark.slow), DESCENT_ID])
def test_spawned_workers_give_what_one_process_gives(name):
    """Oracle: SyncVectorEnv and DummyVecEnv, info included."""
    make = partial(
        gym.make, f"sledenv:{name}", scenario=own_scenario("ice_drop")
    )  # importable in a process that knows no sledenv
    one, other = SyncVectorEnv([make] * 2), AsyncVectorEnv([make] * 2, context="spawn")
    try:
        assert equal(one.reset(seed=3), other.reset(seed=3))
        for action in actions(make(), 12, 2):
            assert equal(one.step(action), other.step(action))
    finally:
        other.close()


@pytest.mark.filterwarnings("ignore::UserWarning")  # Gymnasium logs the traceback of the worker as warnings
def test_a_wrong_action_in_a_spawned_worker_is_gymnasiums_error_here():
    make = partial(gym.make, f"sledenv:{LAUNCH_ID}", scenario=own_scenario("ice_drop"), disable_env_checker=True)
    env = AsyncVectorEnv([make], context="spawn")
    env.reset(seed=0)
    with pytest.raises(InvalidAction, match=r"action = \[2.0, 0.0\]: must be within \[-1.0, 1.0\]"):
        env.step(np.array([[2.0, 0.0]], np.float32))
    env.close(terminate=True)
