"""Clients that need only what the other tests need: the single-file PPO, and workers that are started anew."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.error import InvalidAction
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv

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


@pytest.mark.slow
@pytest.mark.parametrize("name", [LAUNCH_ID, DESCENT_ID])
def test_spawned_workers_of_sb3_give_what_one_process_gives(name):
    """Oracle: DummyVecEnv, info included."""
    make = partial(gym.make, f"sledenv:{name}", scenario=own_scenario("ice_drop"))
    dummy, spawned = DummyVecEnv([make] * 2), SubprocVecEnv([make] * 2, start_method="spawn")
    try:
        for env in (dummy, spawned):
            env.seed(3)
        assert equal(dummy.reset(), spawned.reset())
        for action in actions(make(), 12, 2):
            seen, rewards, dones, infos = spawned.step(action)  # rewards in double precision, infos as a tuple
            assert equal(dummy.step(action), (seen, rewards.astype(np.float32), dones, list(infos)))
    finally:
        spawned.close()


@pytest.mark.filterwarnings("ignore::UserWarning")  # Gymnasium logs the traceback of the worker as warnings
def test_a_wrong_action_in_a_spawned_worker_is_gymnasiums_error_here():
    make = partial(gym.make, f"sledenv:{LAUNCH_ID}", scenario=own_scenario("ice_drop"), disable_env_checker=True)
    env = AsyncVectorEnv([make], context="spawn")
    env.reset(seed=0)
    with pytest.raises(InvalidAction, match=r"action = \[2.0, 0.0\]: must be within \[-1.0, 1.0\]"):
        env.step(np.array([[2.0, 0.0]], np.float32))
    env.close(terminate=True)


ROLLOUT = """
import sys
import gymnasium as gym, numpy as np
for name in ("SledLaunch", "SledDescent"):
    env = gym.make(f"sledenv:sledenv/{name}-v0", scenario=sys.argv[1])
    rng = np.random.default_rng(0)
    for seed in range(2):
        values = [env.reset(seed=seed)[0]]
        ended = False
        while not ended:
            action = rng.uniform(-1, 1, env.action_space.shape).astype(np.float32)
            observation, reward, terminated, truncated, info = env.step(action)
            ended = terminated or truncated
            values += [observation, [reward, info["descent"]["time"], len(info["rebounds"]["t"])]]
        print(" ".join(float(x).hex() for x in np.concatenate(values)), info["descent"]["status"])
"""


def rollout(**variables: str) -> list[list[str]]:
    command = [sys.executable, "-W", "error", "-c", ROLLOUT, own_scenario("ice_drop")]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=dict(os.environ) | variables)
    return [line.split() for line in done.stdout.splitlines()]


@pytest.mark.slow
def test_plain_python_changes_no_more_than_rounding():
    """Oracle: the same episodes, compiled and interpreted.

    Compiled code contracts a product and a sum into one rounding, so plain Python differs in the last digits.
    """
    fast, plain = rollout(), rollout(NUMBA_DISABLE_JIT="1")
    assert [len(episode) for episode in plain] == [len(episode) for episode in fast]
    for one, other in zip(fast, plain, strict=True):
        assert one[-1] == other[-1]
        compiled, interpreted = ([float.fromhex(x) for x in episode[:-1]] for episode in (one, other))
        assert interpreted == pytest.approx(compiled, rel=1e-6, abs=1e-6)
