"""A sweep with Optuna: settings of PPO on sled_snow, judged on validation contexts, the best one on test contexts.

``pip install optuna``, then ``python examples/optuna_sweep.py``: about two minutes on two cores.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import Any

import numpy as np
import optuna
import torch
from stable_baselines3 import PPO

from sledenv.benchmark.problem import Problem
from sledenv.envs.sb3 import make_vec_env
from sledenv.scenarios.scenario import Split

LANES = 256
STEPS = 4  # of every lane between two updates, and between two looks of the pruner


@dataclass(frozen=True)
class Policy:
    """Answers what ``Problem.judge`` asks for a launch."""

    model: PPO

    def act(self, observations: np.ndarray) -> Any:
        return self.model.predict(observations, deterministic=True)[0]


def mean_reward(problem: Problem, model: PPO, split: Split, contexts: int) -> float:
    """Return the expected reward of a policy, the mean over contexts of a split and over draws of the launch noise."""
    trials = problem.trials(problem.contexts(split, contexts), split)
    return float(problem.judge(Policy(model), trials)[0].jam.reward.mean())


def trained(trial: optuna.trial.BaseTrial, problem: Problem, updates: int) -> tuple[PPO, float]:
    """Train with the settings of a trial; return the policy and its reward on validation contexts."""
    settings: dict[str, Any] = {
        "learning_rate": trial.suggest_float("learning_rate", 1e-4, 1e-2, log=True),
        "ent_coef": trial.suggest_float("ent_coef", 1e-4, 1e-1, log=True),
        "n_epochs": trial.suggest_int("n_epochs", 4, 16, log=True),
        "batch_size": trial.suggest_categorical("batch_size", [64, 256]),
    }
    lanes = make_vec_env(problem.id, LANES, seed=0, env_kwargs=problem.env_kwargs | {"split": "train"})
    policy: dict[str, Any] = {"log_std_init": -0.7}
    model = PPO("MlpPolicy", lanes, gamma=0.0, n_steps=STEPS, seed=0, device="cpu", policy_kwargs=policy, **settings)
    reward = 0.0
    for update in range(updates):
        model.learn(LANES * STEPS, reset_num_timesteps=update == 0)
        reward = mean_reward(problem, model, "validation", 50)
        trial.report(reward, update)
        if trial.should_prune():
            raise optuna.TrialPruned
    return model, reward


def main(given: list[str] | None = None) -> float:
    """Sweep, and return the reward of the best settings on test contexts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", default="sled_snow")
    parser.add_argument("--trials", type=int, default=12)
    parser.add_argument("--updates", type=int, default=12, help=f"of each trial, after {LANES * STEPS} descents each")
    arguments = parser.parse_args(given)
    torch.set_num_threads(1)
    problem = Problem(arguments.scenario)
    study = optuna.create_study(
        direction="maximize",
        sampler=optuna.samplers.TPESampler(seed=0),
        pruner=optuna.pruners.MedianPruner(n_startup_trials=3, n_warmup_steps=2),
    )
    study.optimize(
        lambda trial: trained(trial, problem, arguments.updates)[1], arguments.trials, show_progress_bar=True
    )
    model, _ = trained(optuna.trial.FixedTrial(study.best_params), problem, arguments.updates)
    reward = mean_reward(problem, model, "test", 200)
    print(f"best settings: {study.best_params}")
    print(f"mean reward on validation contexts {study.best_value:.3f}, on 200 test contexts {reward:.3f}")
    return reward


if __name__ == "__main__":
    main()
