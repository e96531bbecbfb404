"""PPO in one file, as CleanRL writes it: gymnasium.make_vec, torch and numpy, nothing else of this repository.

``python examples/cleanrl_ppo.py --scenario sled_mat --seed 0``
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, fields
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from torch import Tensor, nn
from torch.distributions import Normal


@dataclass(frozen=True)
class Arguments:
    """Settings; each is an option of the command line."""

    env_id: str = "sledenv:sledenv/SledLaunch-v0"  # the module before the colon is imported to register the id
    scenario: str = "sled_mat"
    seed: int = 0
    total_timesteps: int = 50_000
    num_envs: int = 64
    num_steps: int = 8  # of every lane between two updates
    num_minibatches: int = 4
    update_epochs: int = 10
    learning_rate: float = 1e-3  # falls to 0
    gamma: float = 0.99  # without effect where an episode has one step
    gae_lambda: float = 0.95
    clip_coef: float = 0.2
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    eval_episodes: int = 400
    torch_threads: int = 1  # networks this small run slower on more


class Agent(nn.Module):
    """Actor and critic, each with two hidden layers; the actor's spread does not depend on the observation."""

    def __init__(self, observation_size: int, action_size: int) -> None:
        super().__init__()

        def network(outputs: int, gain: float) -> nn.Sequential:
            linear = nn.Linear(observation_size, 64), nn.Linear(64, 64), nn.Linear(64, outputs)
            for layer, scale in zip(linear, (2**0.5, 2**0.5, gain), strict=True):
                nn.init.orthogonal_(layer.weight, scale)
                nn.init.zeros_(layer.bias)
            return nn.Sequential(linear[0], nn.Tanh(), linear[1], nn.Tanh(), linear[2])

        self.critic = network(1, 1.0)
        self.actor = network(action_size, 0.01)
        self.log_std = nn.Parameter(torch.full((action_size,), -0.5))

    def policy(self, observations: Tensor) -> Normal:
        """Distribution of the actions, before they are clipped to the box."""
        return Normal(self.actor(observations), self.log_std.exp())

    def value(self, observations: Tensor) -> Tensor:
        """Expected return of each observation."""
        values: Tensor = self.critic(observations).squeeze(-1)
        return values


def make(args: Arguments, num_envs: int, split: str) -> gym.vector.VectorEnv[Any, Any, Any]:
    """Return the native batch, whose ended lanes begin their next episode in the same step."""
    return gym.make_vec(
        args.env_id, num_envs=num_envs, scenario=args.scenario, split=split, autoreset_mode="SameStep", info=()
    )


def evaluate(agent: Agent, args: Arguments) -> float:
    """Return the mean return of the noiseless policy over held-out contexts."""
    envs = make(args, args.eval_episodes, "test")
    observations, _ = envs.reset(seed=args.seed)
    returns, running = np.zeros(args.eval_episodes), np.ones(args.eval_episodes, bool)
    while running.any():
        with torch.no_grad():
            actions = agent.policy(torch.as_tensor(observations)).mean.numpy()
        observations, rewards, terminated, truncated, _ = envs.step(np.clip(actions, -1.0, 1.0))
        returns += rewards * running
        running &= ~(terminated | truncated)
    envs.close()
    return float(returns.mean())


def train(args: Arguments) -> Agent:
    """Train and return the agent; one line of progress an update."""
    torch.manual_seed(args.seed)
    rng = np.random.default_rng(args.seed)
    envs = make(args, args.num_envs, "train")
    torch.set_num_threads(args.torch_threads)
    next_observation, _ = envs.reset(seed=args.seed)

    observation_shape, action_shape = envs.single_observation_space.shape, envs.single_action_space.shape
    assert observation_shape is not None
    assert action_shape is not None
    agent = Agent(observation_shape[0], action_shape[0])
    optimizer = torch.optim.Adam(agent.parameters(), lr=args.learning_rate, eps=1e-5)
    steps, lanes = args.num_steps, args.num_envs
    observations = torch.zeros((steps, lanes, *observation_shape))
    actions = torch.zeros((steps, lanes, *action_shape))
    logprobs, rewards, ends, values = torch.zeros((4, steps, lanes)).unbind()
    running_return = np.zeros(lanes)
    updates = args.total_timesteps // (steps * lanes)
    start = time.perf_counter()

    for update in range(updates):
        optimizer.param_groups[0]["lr"] = args.learning_rate * (1.0 - update / updates)
        returns: list[float] = []
        for t in range(steps):
            observations[t] = torch.as_tensor(next_observation)
            with torch.no_grad():
                policy = agent.policy(observations[t])
                actions[t] = policy.sample()  # type: ignore[no-untyped-call]
                logprobs[t] = policy.log_prob(actions[t]).sum(-1)  # type: ignore[no-untyped-call]
                values[t] = agent.value(observations[t])
            next_observation, reward, terminated, truncated, _ = envs.step(actions[t].clamp(-1.0, 1.0).numpy())
            ended = terminated | truncated
            rewards[t], ends[t] = torch.as_tensor(reward), torch.as_tensor(ended)
            running_return += reward
            returns += running_return[ended].tolist()
            running_return[ended] = 0.0

        with torch.no_grad():
            next_value = agent.value(torch.as_tensor(next_observation))
            advantages, last = torch.zeros_like(rewards), torch.zeros(lanes)
            for t in reversed(range(steps)):
                following = next_value if t == steps - 1 else values[t + 1]
                delta = rewards[t] + args.gamma * following * (1.0 - ends[t]) - values[t]
                last = delta + args.gamma * args.gae_lambda * (1.0 - ends[t]) * last
                advantages[t] = last

        batch = [rows.flatten(0, 1) for rows in (observations, actions, logprobs, advantages, advantages + values)]
        for _ in range(args.update_epochs):
            for rows in np.array_split(rng.permutation(steps * lanes), args.num_minibatches):
                seen, chosen, old_logprob, advantage, target = (column[rows] for column in batch)
                ratio = (agent.policy(seen).log_prob(chosen).sum(-1) - old_logprob).exp()  # type: ignore[no-untyped-call]
                advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
                clipped = ratio.clamp(1.0 - args.clip_coef, 1.0 + args.clip_coef)
                policy_loss = -torch.min(advantage * ratio, advantage * clipped).mean()
                value_loss = 0.5 * (agent.value(seen) - target).square().mean()
                optimizer.zero_grad()
                (policy_loss + args.vf_coef * value_loss).backward()
                nn.utils.clip_grad_norm_(agent.parameters(), args.max_grad_norm)
                optimizer.step()

        done = (update + 1) * steps * lanes
        rate = done / (time.perf_counter() - start)
        mean = f"{np.mean(returns):.4f}" if returns else "-"
        print(f"steps {done:7d}  return {mean}  {rate:.0f} steps/s", flush=True)
    envs.close()
    return agent


def main(arguments: list[str] | None = None) -> float:
    """Run the command line; return the score on held-out contexts."""
    parser = argparse.ArgumentParser(description=__doc__)
    for field in fields(Arguments):
        name = "--" + field.name.replace("_", "-")
        parser.add_argument(name, type=type(field.default), default=field.default)
    args = Arguments(**vars(parser.parse_args(arguments)))
    score = evaluate(train(args), args)
    print(f"held-out contexts: mean return {score:.4f} over {args.eval_episodes} episodes")
    return score


if __name__ == "__main__":
    main()
