"""Proximal policy optimisation of stable-baselines3, from what is seen to the launch and the trims."""

from __future__ import annotations

from typing import Any

from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import SEEN
from sledenv.machine.extras import needs

from .learning import Learned

with needs("agents", __name__):
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.policies import ActorCriticPolicy


class HopPolicy(ActorCriticPolicy):
    """Counts in the likelihood of an action only what acts: the launch in the first step, the trim in every other one.

    The rest of an action has no effect, so that its likelihood would be mere noise in the ratio of two policies.
    """

    def forward(
        self, obs: torch.Tensor, deterministic: bool = False
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        actions, values, _ = super().forward(obs, deterministic)
        return actions, values, self._log_likelihood(obs, actions)

    def evaluate_actions(
        self, obs: Any, actions: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor | None]:
        values, _, entropy = super().evaluate_actions(obs, actions)
        return values, self._log_likelihood(obs, actions), entropy

    def _log_likelihood(self, obs: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        normal: Any = self.get_distribution(obs).distribution  # of each entry of the action by itself
        each: torch.Tensor = normal.log_prob(actions)
        rides = obs[:, SEEN:].any(dim=1)  # the flight is all zeros before the launch alone
        return torch.where(rides, each[:, -1], each[:, :-1].sum(dim=1))


class Agent(Learned):
    """Learns on-policy, from batches of fresh descents."""

    algorithm = PPO

    @classmethod
    def prepared(cls, problem: Problem, settings: dict[str, Any]) -> dict[str, Any]:
        """Take the policy that knows the steps apart, where there is more than one."""
        return settings | {"policy": HopPolicy} if problem.environment == "descent" else settings
