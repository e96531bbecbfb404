"""What the agents of stable-baselines3 share: training, validation, the policy that is kept."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from sledenv.benchmark.landing import Landing
from sledenv.benchmark.problem import Problem
from sledenv.envs.sb3 import make_vec_env
from sledenv.machine.extras import needs
from sledenv.scenarios.configuration import read_yaml, write_yaml

from .curve import Curve
from .flight import MOST, Flights

with needs("agents", __name__):
    import torch
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.utils import LinearSchedule
    from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
    from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn


_LANDINGS = "landings.yaml"
_MODEL = "model.zip"
_BEFORE = "model_before.zip"
_SCALE_CONTEXTS = 1000


class _Validation(BaseCallback):
    """Judge the policy on validation contexts, write the learning curve and keep the best policy so far."""

    def __init__(self, agent: Callable[[Any], Learned], problem: Problem, folder: Path, every: int) -> None:
        super().__init__()
        self._agent = agent
        self._problem = problem
        self._folder = folder
        self._every = every
        self._next = 0
        self._best = -1.0
        self._descents = 0

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


class Standardised(VecEnvWrapper):
    """Environments of one step whose rewards are those of random launches less their mean, over their deviation.

    Where no launch jams, all rewards lie within a few hundredths: too little beside an entropy bonus and for a critic
    that starts at 0. ``VecNormalize`` scales, but does not centre.

    Parameters
    ----------
    venv : VecEnv
    rewards : ndarray, shape (n,)
        Of random launches.
    """

    def __init__(self, venv: VecEnv, rewards: NDArray[np.float64]) -> None:
        super().__init__(venv)
        self._mean = float(rewards.mean())
        self._deviation = float(rewards.std()) or 1.0

    def reset(self) -> VecEnvObs:
        return self.venv.reset()

    def step_wait(self) -> VecEnvStepReturn:
        observations, rewards, dones, infos = self.venv.step_wait()
        return observations, (rewards - self._mean) / self._deviation, dones, infos


class Landed(VecEnvWrapper):
    """Environments of one step whose actions are landings.

    Parameters
    ----------
    venv : VecEnv
    landing : Landing
    """

    def __init__(self, venv: VecEnv, landing: Landing) -> None:
        super().__init__(venv)
        self._landing = landing
        self._seen = np.empty(0, np.float32)

    def reset(self) -> VecEnvObs:
        observations = self.venv.reset()
        self._seen = np.asarray(observations)
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        self.venv.step_async(self._landing.actions(self._seen, actions))

    def step_wait(self) -> VecEnvStepReturn:
        observations, rewards, dones, infos = self.venv.step_wait()
        self._seen = np.asarray(observations)
        return observations, rewards, dones, infos


class Foreseen(VecEnvWrapper):
    """Rides whose observations are what closed forms foresee of the landings.

    Parameters
    ----------
    venv : VecEnv
    flights : Flights
    """

    def __init__(self, venv: VecEnv, flights: Flights) -> None:
        super().__init__(venv, spaces.Box(-MOST, MOST, (flights.width,), np.float32))
        self._flights = flights

    def reset(self) -> VecEnvObs:
        return self._flights.land(np.asarray(self.venv.reset())).inputs

    def step_wait(self) -> VecEnvStepReturn:
        observations, rewards, dones, infos = self.venv.step_wait()
        for i in np.flatnonzero(dones).tolist():
            infos[i]["terminal_observation"] = self._flights.land(infos[i]["terminal_observation"][np.newaxis]).inputs[
                0
            ]
        return self._flights.land(np.asarray(observations)).inputs, rewards, dones, infos


def random_rewards(problem: Problem, seed: int) -> NDArray[np.float64]:
    """Return the rewards of random launches in as many training contexts, each with one draw of the noise."""
    contexts = problem.drawn(problem.contexts("train", _SCALE_CONTEXTS, seed), "train")
    launches = np.random.default_rng(seed).uniform(-1.0, 1.0, (_SCALE_CONTEXTS, problem.actions))
    rewards: NDArray[np.float64] = problem.descend(contexts, launches).jam.reward
    return rewards


def _schedule(value: Any) -> Any:
    """Return the schedule that "lin_0.001" stands for in rl-baselines3-zoo, from 0.001 to 0; or what else is given."""
    if isinstance(value, str) and value.startswith("lin_"):
        return LinearSchedule(float(value.removeprefix("lin_")), 0.0, 1.0)
    return value


class Learned:
    """A trained policy, acting without exploration noise.

    Where an episode has one step, it tells a launch by its landing, see :class:`sledenv.benchmark.landing.Landing`,
    unless its settings say ``landings: false``. On a ride it sees the landings that
    :class:`sledenv.agents.flight.Flights` foresees.
    """

    algorithm: ClassVar[type[BaseAlgorithm]]

    def __init__(self, model: Any, landing: Landing | None, flights: Flights | None) -> None:
        self.model = model
        self._landing = landing
        self._flights = flights

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Train in the environment; the policy that does best on the validation contexts is kept.

        Parameters
        ----------
        problem : Problem
        settings : dict
            Hyperparameters as in configs/agents; ``checks`` is how often the policy is validated, and ``landings``
            whether actions are landings. A value such as "lin_0.001" decays linearly to 0.
        seed : int
            Of the networks, the environments and the exploration; no two seeds share a lane's stream of contexts.
        folder : Path
            Where the models, the learning curve and the tensorboard log are written.
        """
        settings = cls.prepared(problem, dict(settings))
        settings = {name: _schedule(value) for name, value in settings.items()}
        steps = settings.pop("n_timesteps")
        checks = settings.pop("checks", 20)
        landings = bool(settings.pop("landings", True)) and problem.environment == "launch"
        write_yaml(folder / _LANDINGS, {"landings": landings})
        landing, flights = Landing(problem) if landings else None, _flights(problem)
        torch.set_num_threads(1)  # networks this small run slower on more
        lanes = settings.pop("n_envs")
        env: VecEnv = make_vec_env(problem.id, lanes, seed * lanes, env_kwargs=problem.env_kwargs | {"split": "train"})
        if problem.environment == "launch":
            env = Standardised(env, random_rewards(problem, seed))
        if landing is not None:
            env = Landed(env, landing)
        if flights is not None:
            env = Foreseen(env, flights)
        model = cls.algorithm(env=env, seed=seed, tensorboard_log=str(folder / "tensorboard"), **settings)
        with warnings.catch_warnings():
            # rich marks its use by tqdm as experimental; the bar is what the user asked for.
            warnings.filterwarnings("ignore", message=".*rich is experimental.*")
            validation = _Validation(lambda learned: cls(learned, landing, flights), problem, folder, steps // checks)
            model.learn(steps, callback=validation, progress_bar=sys.stderr.isatty())
        env.close()
        return cls.load(problem, folder)

    @classmethod
    def prepared(cls, problem: Problem, settings: dict[str, Any]) -> dict[str, Any]:
        """Return settings with what YAML cannot say."""
        return settings

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the policy of a run."""
        return cls._read(problem, folder, _MODEL)

    @classmethod
    def load_untrained(cls, problem: Problem, folder: Path) -> Self:
        """Read the policy with which the run began."""
        return cls._read(problem, folder, _BEFORE)

    @classmethod
    def _read(cls, problem: Problem, folder: Path, name: str) -> Self:
        landings = read_yaml(folder / _LANDINGS)["landings"]
        model = cls.algorithm.load(folder / name, device="cpu")
        return cls(model, Landing(problem) if landings else None, _flights(problem))

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        seen = observations if self._flights is None else self._flights.land(observations).inputs
        chosen, _ = self.model.predict(seen, deterministic=True)
        actions = np.asarray(chosen, np.float32)
        return actions if self._landing is None else self._landing.actions(observations, actions)


def _flights(problem: Problem) -> Flights | None:
    return Flights(problem) if problem.environment == "descent" else None
