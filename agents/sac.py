"""Soft actor-critic of stable-baselines3, from the context to the launch."""

from __future__ import annotations

import csv
import warnings
from pathlib import Path
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor

from agents.problem import Problem
from sledenv.envs import LAUNCH_ID
from sledenv.envs.sb3 import make_vec_env

_MODEL = "model.zip"
_BEFORE = "model_before.zip"
_CURVE = "learning_curve.csv"
_CHECK_EVERY = 500  # descents
_CHECK_CONTEXTS = 128


class _Validation(BaseCallback):
    """Judge the policy on validation contexts, write the learning curve and keep the best policy so far."""

    def __init__(self, problem: Problem, folder: Path) -> None:
        super().__init__()
        self._problem = problem
        self._folder = folder
        self._contexts = problem.contexts("validation", _CHECK_CONTEXTS)
        self._next = 0
        self._best = -1.0

    def _on_training_start(self) -> None:
        with (self._folder / _CURVE).open("w", newline="") as file:
            csv.writer(file).writerow(["descents", "mean_reward", "finished"])
        self.model.save(self._folder / _BEFORE)
        self._check()

    def _on_step(self) -> bool:
        if self.num_timesteps >= self._next:
            self._check()
        return True

    def _on_training_end(self) -> None:
        self._check()

    def _check(self) -> None:
        self._next = self.num_timesteps + _CHECK_EVERY
        batch = self._problem.judge(Sac(self.model), self._contexts)
        mean = float(batch.jam.reward.mean())
        finished = float((batch.status == "finish").mean())
        self.logger.record("validation/mean_reward", mean)
        self.logger.record("validation/finished", finished)
        self.logger.dump(self.num_timesteps)
        with (self._folder / _CURVE).open("a", newline="") as file:
            csv.writer(file).writerow([self.num_timesteps, mean, finished])
        if mean > self._best:
            self._best = mean
            self.model.save(self._folder / _MODEL)


class Sac:
    """A trained policy, acting without exploration noise."""

    def __init__(self, model: Any) -> None:
        self.model = model

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Train in the environment; the policy that does best on the validation contexts is kept.

        Parameters
        ----------
        problem : Problem
        settings : dict
            Hyperparameters as in configs/agents/sac.yaml.
        seed : int
            Of the networks, the environments and the exploration.
        folder : Path
            Where the models, the learning curve and the tensorboard log are written.
        """
        settings = dict(settings)
        steps = settings.pop("n_timesteps")
        torch.set_num_threads(1)  # networks this small run slower on more
        lanes = make_vec_env(
            LAUNCH_ID,
            settings.pop("n_envs"),
            seed,
            env_kwargs={"scenario": problem.scenario, "control": problem.control, "split": "train"},
        )
        env = VecMonitor(lanes)
        model = SAC(env=env, seed=seed, tensorboard_log=str(folder / "tensorboard"), **settings)
        with warnings.catch_warnings():
            # rich marks its use by tqdm as experimental; the bar is what the user asked for.
            warnings.filterwarnings("ignore", message=".*rich is experimental.*")
            model.learn(steps, callback=_Validation(problem, folder), progress_bar=True)
        env.close()
        return cls.load(problem, folder)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the policy of a run."""
        return cls(SAC.load(folder / _MODEL, device="cpu"))

    @classmethod
    def load_untrained(cls, folder: Path) -> Self:
        """Read the policy with which the run began."""
        return cls(SAC.load(folder / _BEFORE, device="cpu"))

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        actions, _ = self.model.predict(observations, deterministic=True)
        return np.asarray(actions, np.float32)
