"""Training samples a second of SB3's PPO on 1024 lanes, against null environments of the same spaces."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from perf.env import IDS, SCENARIO
from perf.harness import save, spread, table, with_quartiles

ROUNDS = 5
LANES = 1024
EPOCHS = (10, 2)
SAMPLES = 65_536  # of one training run
SETTINGS: dict[str, Any] = {"n_steps": 16, "batch_size": 2048, "gamma": 0.0, "seed": 0, "device": "cpu"}
NULL = "null environment"
SOLVERS = {"": "compliant", " on rigid surfaces": "rigid"}


class NullVecEnv(VecEnv):
    """Same spaces and nothing to compute: the rate of the learner alone."""

    def __init__(self, like: VecEnv) -> None:
        super().__init__(like.num_envs, like.observation_space, like.action_space)
        shape = (like.num_envs, *(like.observation_space.shape or ()))
        self._observations = np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)
        self._rewards = np.zeros(like.num_envs, np.float32)
        self._dones = np.ones(like.num_envs, bool)
        self._infos: list[dict[str, Any]] = [{} for _ in range(like.num_envs)]

    def reset(self) -> VecEnvObs:
        return self._observations

    def step_async(self, actions: np.ndarray) -> None:
        pass

    def step_wait(self) -> VecEnvStepReturn:
        return self._observations, self._rewards, self._dones, self._infos

    def close(self) -> None:
        pass

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:
        return [False] * self.num_envs


class Timed(VecEnvWrapper):
    """Adds up the time spent inside the environment."""

    seconds = 0.0

    def reset(self) -> VecEnvObs:
        start = time.perf_counter()
        found = self.venv.reset()
        self.seconds += time.perf_counter() - start
        return found

    def step_async(self, actions: np.ndarray) -> None:
        start = time.perf_counter()
        self.venv.step_async(actions)
        self.seconds += time.perf_counter() - start

    def step_wait(self) -> VecEnvStepReturn:
        start = time.perf_counter()
        found = self.venv.step_wait()
        self.seconds += time.perf_counter() - start
        return found


def train(env: VecEnv, epochs: int, samples: int) -> tuple[float, float]:
    """Samples a second and the share of the time that was spent outside the environment."""
    timed = Timed(env)
    model = PPO("MlpPolicy", timed, n_epochs=epochs, **SETTINGS)
    timed.seconds = 0.0
    start = time.perf_counter()
    model.learn(samples)
    seconds = time.perf_counter() - start
    return model.num_timesteps / seconds, 1.0 - timed.seconds / seconds


def main(rounds: int = ROUNDS, samples: int = SAMPLES) -> None:
    """Measure and write."""
    from sledenv.envs.sb3 import make_vec_env

    torch.set_num_threads(1)  # networks this small run slower on more
    envs: dict[str, VecEnv] = {}
    nulls = {}
    for name, key in IDS.items():
        for where, solver in SOLVERS.items():
            sled = make_vec_env(key, LANES, seed=0, env_kwargs={"scenario": SCENARIO, "solver": solver})
            envs[f"{name}{where}"], nulls[f"{name}{where}"] = sled, f"{NULL}, {name}"
        envs[f"{NULL}, {name}"], nulls[f"{NULL}, {name}"] = NullVecEnv(sled), f"{NULL}, {name}"
    cases = [(name, epochs) for epochs in EPOCHS for name in envs]
    rates: dict[tuple[str, int], list[float]] = {case: [] for case in cases}
    outside: dict[tuple[str, int], list[float]] = {case: [] for case in cases}
    for env in envs.values():
        train(env, 1, LANES * SETTINGS["n_steps"])
    for i in range(rounds):
        for k in range(len(cases)):
            name, epochs = cases[(i + k) % len(cases)]
            rate, share = train(envs[name], epochs, samples)
            rates[name, epochs].append(rate)
            outside[name, epochs].append(share)
    result = {
        "rounds": rounds,
        "lanes": LANES,
        "samples": samples,
        "settings": SETTINGS,
        "torch_threads": torch.get_num_threads(),
        "rows": [
            {
                "name": name,
                "epochs": epochs,
                "samples_per_s": spread(np.array(rates[name, epochs])),
                "share_outside": spread(np.array(outside[name, epochs])),
                "of_null": spread(np.array(rates[name, epochs]) / np.array(rates[nulls[name], epochs])),
            }
            for name, epochs in cases
        ],
    }
    save("training", result)


def tables(result: dict[str, Any]) -> str:
    """Return the table of docs/performance.md."""
    rows = [
        (
            f"{row['name']}, {row['epochs']} epochs",
            with_quartiles(row["samples_per_s"]),
            f"{100.0 * row['of_null']['median']:.1f} %",
            f"{100.0 * row['share_outside']['median']:.1f} %",
        )
        for row in result["rows"]
    ]
    return table(("PPO on", "samples/s", "of the null environment", "time outside the environment"), rows)


if __name__ == "__main__":
    main()
