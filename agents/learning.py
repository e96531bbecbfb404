"""Training and validation that the agents of stable-baselines3 share, and the policy that is kept."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.envs.sb3 import make_vec_env
from sledenv.machine.extras import needs

from .curve import Curve

with needs("agents", __name__):
    import torch
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.utils import LinearSchedule

_MODEL: Final = "model.zip"
_BEFORE: Final = "model_before.zip"
_CHECKS: Final = 10  # times that the policy is validated


class _Validation(BaseCallback):
    """Judge the policy on validation contexts, write the learning curve and keep the best policy so far."""

    def __init__(self, agent: Callable[[Any], Learned], problem: Problem, folder: Path, every: int) -> None:
        super().__init__()
        self._agent, self._problem, self._folder, self._every = agent, problem, folder, every
        self._next, self._best, self._descents = 0, -1.0, 0

    def _on_training_start(self) -> None:
        self._curve = Curve(self._problem, self._folder)
        self.model.save(self._folder / _BEFORE)
        self._check()

    def _on_step(self) -> bool:
        self._descents += int(self.locals["dones"].sum())
        if self.num_timesteps >= self._next:
            self._check()
        return True

    def _on_training_end(self) -> None:
        self._check()

    def _check(self) -> None:
        self._next = self.num_timesteps + self._every
        mean, finished = self._curve.check(self._agent(self.model), self._descents)
        self.logger.record("validation/mean_reward", mean)
        self.logger.record("validation/finished", finished)
        self.logger.dump(self.num_timesteps)
        if mean > self._best:
            self._best = mean
            self.model.save(self._folder / _MODEL)


class Learned:
    """A trained policy, acting without exploration noise."""

    algorithm: ClassVar[type[BaseAlgorithm]]

    def __init__(self, model: Any) -> None:
        self.model = model

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Train in the environment; the policy that does best on the validation contexts is kept.

        Parameters
        ----------
        problem : Problem
        settings : dict
            Hyperparameters as in configs/agents, which rl-baselines3-zoo reads too. A value such as "lin_0.001" decays
            linearly to 0.
        seed : int
            Of the networks, the environments and the exploration; no two seeds share a lane's stream of contexts.
        folder : Path
            Where the models, the learning curve and the tensorboard log are written.
        """
        settings = {name: _schedule(value) for name, value in settings.items()}
        steps, lanes = settings.pop("n_timesteps"), settings.pop("n_envs")
        torch.set_num_threads(1)  # networks this small run slower on more
        env = make_vec_env(problem.id, lanes, seed * lanes, env_kwargs=problem.env_kwargs | {"split": "train"})
        model = cls.algorithm(env=env, seed=seed, tensorboard_log=str(folder / "tensorboard"), **settings)
        with warnings.catch_warnings():
            # rich marks its use by tqdm as experimental; the bar is what the user asked for.
            warnings.filterwarnings("ignore", message=".*rich is experimental.*")
            validation = _Validation(cls, problem, folder, steps // _CHECKS)
            model.learn(steps, callback=validation, progress_bar=sys.stderr.isatty())
        env.close()
        return cls.load(problem, folder)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the policy of a run."""
        return cls(cls.algorithm.load(folder / _MODEL, device="cpu"))

    @classmethod
    def load_untrained(cls, problem: Problem, folder: Path) -> Self:
        """Read the policy with which the run began."""
        return cls(cls.algorithm.load(folder / _BEFORE, device="cpu"))

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        actions, _ = self.model.predict(observations, deterministic=True)
        return np.asarray(actions, np.float32)


def _schedule(value: Any) -> Any:
    """Return the schedule that "lin_0.001" stands for in rl-baselines3-zoo, from 0.001 to 0; or what else is given."""
    if isinstance(value, str) and value.startswith("lin_"):
        return LinearSchedule(float(value.removeprefix("lin_")), 0.0, 1.0)
    return value
