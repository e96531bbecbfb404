"""PPO of Ray RLlib on an environment of this package: ``python examples/rllib_ppo.py --scenario sled_mat``."""

from __future__ import annotations

import argparse
from typing import Any

import ray
from ray.rllib.algorithms.ppo import PPOConfig


def train(env_id: str, scenario: str, iterations: int, env_runners: int, batch: int, seed: int) -> list[dict[str, Any]]:
    """Train and return RLlib's results, one dict an iteration.

    Parameters
    ----------
    env_id : str
        With the module that registers it before a colon, because Ray's workers are new processes.
    scenario : str
    iterations : int
    env_runners : int
        Processes that sample beside this one; 0 samples here.
    batch : int
        Steps an iteration.
    seed : int
    """
    config = (
        PPOConfig()
        .environment(env_id, env_config={"scenario": scenario})
        .env_runners(num_env_runners=env_runners, num_envs_per_env_runner=8)
        .training(gamma=0.0, lr=1e-3, train_batch_size_per_learner=batch, minibatch_size=128, num_epochs=10)
        .debugging(seed=seed, log_level="ERROR")
    )
    algorithm = config.build_algo()
    try:
        return [algorithm.train() for _ in range(iterations)]
    finally:
        algorithm.stop()


def main(arguments: list[str] | None = None) -> list[dict[str, Any]]:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--env-id", default="sledenv:sledenv/SledLaunch-v0")
    parser.add_argument("--scenario", default="sled_mat")
    parser.add_argument("--iterations", type=int, default=1)
    parser.add_argument("--env-runners", type=int, default=1)
    parser.add_argument("--batch", type=int, default=1024)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    ray.init(num_cpus=max(2, given.env_runners + 1), include_dashboard=False, configure_logging=False)
    try:
        results = train(given.env_id, given.scenario, given.iterations, given.env_runners, given.batch, given.seed)
    finally:
        ray.shutdown()
    for i, result in enumerate(results):
        sampled = result["env_runners"]
        print(
            f"iteration {i + 1}: {sampled['num_env_steps_sampled_lifetime']:.0f} steps,"
            f" {sampled['num_episodes']:.0f} episodes, mean return {sampled['episode_return_mean']:.4f}"
        )
    return results


if __name__ == "__main__":
    main()
