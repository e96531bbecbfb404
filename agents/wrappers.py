"""What agents/learning.py puts around its lanes, as wrappers of one environment: for rl-baselines3-zoo and others."""

from __future__ import annotations

from typing import Any, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.landing import Landing
from sledenv.benchmark.problem import Problem
from sledenv.envs.launch import SledLaunch

from .learning import random_rewards

Floats = NDArray[np.float32]


class Landed(gym.Wrapper[Floats, Floats, Floats, Floats]):
    """SledLaunch whose actions are landings, see :class:`sledenv.benchmark.landing.Landing`.

    Parameters
    ----------
    env : Env
        SledLaunch, wrapped or not.
    """

    def __init__(self, env: gym.Env[Floats, Floats]) -> None:
        super().__init__(env)
        self._landing = Landing(_problem(env))
        self._seen = np.empty((0, 0), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Floats, dict[str, Any]]:
        observation, info = self.env.reset(seed=seed, options=options)
        self._seen = observation[np.newaxis]
        return observation, info

    def step(self, action: Floats) -> tuple[Floats, Any, bool, bool, dict[str, Any]]:
        return self.env.step(self._landing.actions(self._seen, np.asarray(action, np.float32)[np.newaxis])[0])


class Standardised(gym.RewardWrapper[Floats, Floats]):
    """SledLaunch whose rewards are those of random launches less their mean, over their deviation.

    Parameters
    ----------
    env : Env
        SledLaunch, wrapped or not.
    """

    def __init__(self, env: gym.Env[Floats, Floats]) -> None:
        super().__init__(env)
        rewards = random_rewards(_problem(env), seed=0)
        self._mean, self._deviation = float(rewards.mean()), float(rewards.std()) or 1.0

    def reward(self, reward: Any) -> float:
        return (float(reward) - self._mean) / self._deviation


def _problem(env: gym.Env[Floats, Floats]) -> Problem:
    task = cast(SledLaunch, env.unwrapped).task
    noise = tuple(task.noise.tolist())
    return Problem(task.scenario, control=task.control, solver=task.solver, launch_noise=noise, observe=task.observed)
