"""Episodes of a random policy as a Minari dataset, for offline learning: ``python examples/minari_dataset.py``."""

from __future__ import annotations

import argparse
from importlib.metadata import version
from typing import Any

import gymnasium as gym
import minari
from minari import DataCollector, MinariDataset, StepDataCallback


class ContextOnly(StepDataCallback):  # type: ignore[misc]  # Minari has no types
    """Keep the context of the info: Minari wants the same entries at every step, the reset included."""

    def __call__(self, env: gym.Env[Any, Any], **step: Any) -> Any:
        data = super().__call__(env, **step)
        data["info"] = {"context": data["info"]["context"]}
        return data


def collect(env_id: str, scenario: str, episodes: int, seed: int, dataset_id: str) -> MinariDataset:
    """Record episodes, episode i after ``reset(seed=seed + i)``, into the local Minari folder.

    The dataset holds how its environment is made and the seed of each episode, so it can be simulated again.
    """
    env = DataCollector(gym.make(env_id, scenario=scenario), step_data_callback=ContextOnly, record_infos=True)
    env.action_space.seed(seed)
    for i in range(episodes):
        env.reset(seed=seed + i)
        ended = False
        while not ended:
            _, _, terminated, truncated, _ = env.step(env.action_space.sample())
            ended = terminated or truncated
    dataset = env.create_dataset(
        dataset_id,
        algorithm_name="uniform random",
        author="sledenv",
        code_permalink=f"examples/minari_dataset.py, sledenv {version('sledenv')}",
        description=f"{episodes} episodes of {env_id}, scenario {scenario}, seeds from {seed}.",
    )
    env.close()
    return dataset


def main(arguments: list[str] | None = None) -> MinariDataset:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--env-id", default="sledenv:sledenv/SledDescent-v0")
    parser.add_argument("--scenario", default="sled_rollers")
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--dataset", default="sledenv/descent-sled_rollers/random-v0", help="namespace/name-vN")
    given = parser.parse_args(arguments)
    collect(given.env_id, given.scenario, given.episodes, given.seed, given.dataset)
    dataset = minari.load_dataset(given.dataset)
    print(f"{given.dataset}: {dataset.total_episodes} episodes, {dataset.total_steps} steps")
    return dataset


if __name__ == "__main__":
    main()
