"""Training samples a second of SB3's PPO on 1024 lanes, against null environments of the same spaces."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from perf import show
from perf.env import IDS
from perf.harness import ratio, spread, take_turns

SCENARIO = "sled_mat"
ROUNDS = 3
LANES = 1024
SAMPLES = 32_768  # of one training run
SETTINGS: dict[str, Any] = {"n_steps": 16, "n_epochs": 10, "batch_size": 2048, "gamma": 0.0, "seed": 0, "device": "cpu"}
NULL = "null environment"
SOLVERS = {"": "compliant", " on rigid surfaces": "rigid"}


class Null(VecEnvWrapper):
    """Same spaces and nothing to compute: the rate of the learner alone."""

    def __init__(self, like: VecEnv) -> None:
        super().__init__(like)
        shape = (like.num_envs, *(like.observation_space.shape or ()))
        self._observations = np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)
        self._rewards, self._dones = np.zeros(like.num_envs, np.float32), np.ones(like.num_envs, bool)
        self._infos: list[dict[str, Any]] = [{} for _ in range(like.num_envs)]

    def reset(self) -> VecEnvObs:
        return self._observations

    def step_async(self, actions: np.ndarray) -> None:
        pass

    def step_wait(self) -> VecEnvStepReturn:
        return self._observations, self._rewards, self._dones, self._infos


class Timed(VecEnvWrapper):
    """Adds up the time spent inside the environment."""

    seconds = 0.0

    def _spent(self, call: Callable[..., Any], *given: Any) -> Any:
        start = time.perf_counter()
        found = call(*given)
        self.seconds += time.perf_counter() - start
        return found

    def reset(self) -> VecEnvObs:
        return self._spent(self.venv.reset)  # type: ignore[no-any-return]

    def step_async(self, actions: np.ndarray) -> None:
        self._spent(self.venv.step_async, actions)

    def step_wait(self) -> VecEnvStepReturn:
        return self._spent(self.venv.step_wait)  # type: ignore[no-any-return]


def train(env: VecEnv, samples: int) -> tuple[float, float]:
    """Samples a second and the share of the time that was spent outside the environment."""
    timed = Timed(env)
    model = PPO("MlpPolicy", timed, **SETTINGS)
    timed.seconds = 0.0
    start = time.perf_counter()
    model.learn(samples)
    seconds = time.perf_counter() - start
    return model.num_timesteps / seconds, 1.0 - timed.seconds / seconds


def measure(rounds: int = ROUNDS, samples: int = SAMPLES) -> dict[str, Any]:
    """Train on all environments in turn."""
    from sledenv.envs.sb3 import make_vec_env

    torch.set_num_threads(1)  # networks this small run slower on more
    envs: dict[str, tuple[VecEnv, str]] = {}  # with the name of its null environment
    for name, key in IDS.items():
        null = f"{NULL}, {name}"
        for where, solver in SOLVERS.items():
            sled = make_vec_env(key, LANES, seed=0, env_kwargs={"scenario": SCENARIO, "solver": solver})
            envs[f"{name}{where}"] = sled, null
        envs[null] = Null(sled), null
    for env, _ in envs.values():
        train(env, LANES * SETTINGS["n_steps"])
    found = take_turns({name: partial(train, env, samples) for name, (env, _) in envs.items()}, rounds)
    rows = [
        {
            "name": name,
            "samples_per_s": spread(found[name][:, 0]),
            "share_outside": spread(found[name][:, 1]),
            "of_null": ratio(found[name][:, 0], found[null][:, 0]),
        }
        for name, (_, null) in envs.items()
    ]
    how = {"rounds": rounds, "lanes": LANES, "samples": samples, "settings": SETTINGS}
    return how | {"torch_threads": torch.get_num_threads(), "rows": rows}


COLUMNS: show.Columns = {
    "PPO on": lambda row: row["name"],
    "samples/s": lambda row: show.quartiles(row["samples_per_s"]),
    "of the null environment": lambda row: show.percent(row["of_null"]),
    "time outside the environment": lambda row: show.percent(row["share_outside"]),
}
