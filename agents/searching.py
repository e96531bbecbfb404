"""Policies of SAC and TQC that take the action which their critic rates best of many."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from scipy.stats import qmc

from sledenv.benchmark.problem import Problem
from sledenv.machine.extras import needs

from .touch import Touch

with needs("agents", __name__):
    import torch
    from sb3_contrib.tqc.policies import TQCPolicy
    from stable_baselines3.common.policies import BasePolicy
    from stable_baselines3.sac.policies import SACPolicy
    from torch import nn


COARSE: Final = 96  # actions tried anywhere in the box
FINE: Final = 16  # actions tried around the best so far, once for each of the widths
WIDTHS: Final = (0.1, 0.03)  # standard deviations, where the box is 2 wide


def searching(policy: type[_Searching], problem: Problem, settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings with a policy that searches, and that is told the first touch where actions are landings.

    Parameters
    ----------
    policy : type
    problem : Problem
    settings : dict
        As for :meth:`sledenv.agents.learning.Learned.train`.
    """
    touch = Touch(problem) if problem.environment == "launch" and settings.get("landings", True) else None
    return settings | {"policy": policy, "policy_kwargs": settings.get("policy_kwargs", {}) | {"touch": touch}}


class _Touching(nn.Module):
    """Adds to contexts and landings what closed forms tell of the first touch: what learns from both sees all of it.

    Parameters
    ----------
    touch : Touch
    fields : int
        How many columns are the context; the others are the landing.
    """

    def __init__(self, touch: Touch, fields: int) -> None:
        super().__init__()
        self._touch, self._fields = touch, fields

    def forward(self, given: torch.Tensor) -> torch.Tensor:
        """Return more columns. No gradient goes through them, so that an actor climbs only along the landing itself."""
        observations, landings = np.hsplit(given.detach().cpu().numpy(), [self._fields])
        told = torch.from_numpy(self._touch.inputs(observations, landings))
        return torch.cat([given, told.to(given.device)], dim=1)


class _Searching(BasePolicy):
    """What these policies share: the search, and a critic that may be told the first touch.

    An actor climbs its critic from where it stands, but the reward of a landing has many maxima with cliffs between
    them. Where an episode has one step the critic is a regression of the reward over the whole box, so that its best
    landing can be looked up; of a ride so can the best trim. The candidates are quasi-random and always the same: a
    policy that acts deterministically stays a function of what it sees.
    """

    critic: Any
    _box: torch.Tensor
    _cloud: torch.Tensor

    def __init__(self, *arguments: Any, touch: Touch | None = None, **settings: Any) -> None:
        self._touch = touch
        super().__init__(*arguments, **settings)
        width = int(np.prod(self.action_space.shape or ()))
        box = qmc.Sobol(width, rng=np.random.default_rng(0)).random_base2((COARSE - 1).bit_length())[:COARSE]
        cloud = qmc.MultivariateNormalQMC(np.zeros(width), rng=np.random.default_rng(0)).random(FINE)
        self.register_buffer("_box", torch.as_tensor(2.0 * box - 1.0, dtype=torch.float32), persistent=False)
        self.register_buffer("_cloud", torch.as_tensor(cloud, dtype=torch.float32), persistent=False)

    def make_critic(self, features_extractor: Any = None) -> Any:
        """Return what SAC and TQC make, with wider first layers where the touch is told."""
        critic = super().make_critic(features_extractor)  # type: ignore[misc]
        if self._touch is not None:
            told = _Touching(self._touch, self.observation_space.shape[0])  # type: ignore[index]
            for network in critic.q_networks:
                first = network[0]
                network[0] = nn.Sequential(told, nn.Linear(first.in_features + self._touch.width, first.out_features))
        return critic

    @torch.no_grad()
    def searched(self, observation: torch.Tensor, proposed: torch.Tensor) -> torch.Tensor:
        """Return the best of what the actor proposes, of actions anywhere and of actions around the best of these.

        Parameters
        ----------
        observation : Tensor, shape (n, 11)
        proposed : Tensor, shape (n, k)

        Returns
        -------
        Tensor, shape (n, k)
        """
        anywhere = self._box.expand(len(observation), -1, -1)
        best = self._best(observation, torch.cat([proposed[:, None], anywhere], dim=1))
        for width in WIDTHS:
            around = (best[:, None] + width * self._cloud).clamp(-1.0, 1.0)
            best = self._best(observation, torch.cat([best[:, None], around], dim=1))
        return best

    def _best(self, observation: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        lanes, tried, _ = actions.shape
        ratings = self._rated(observation.repeat_interleave(tried, dim=0), actions.flatten(0, 1))
        return actions[torch.arange(lanes), ratings.view(lanes, tried).argmax(dim=1)]

    def _rated(self, observation: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        """Return what the most cautious of the critics says of each action."""
        return torch.stack(self.critic(observation, actions)).amin(dim=0)


class SearchingSAC(_Searching, SACPolicy):
    """Explores with its actor, whose entropy keeps it wide; acts with what the critic rates best."""

    def _predict(self, observation: Any, deterministic: bool = False) -> torch.Tensor:
        proposed = super()._predict(observation, deterministic)
        return self.searched(observation, proposed) if deterministic else proposed


class SearchingTQC(_Searching, TQCPolicy):
    """Explores as SAC does; acts with what has the highest mean of the quantiles that its critic tells."""

    def _predict(self, observation: Any, deterministic: bool = False) -> torch.Tensor:
        proposed = super()._predict(observation, deterministic)
        return self.searched(observation, proposed) if deterministic else proposed

    def _rated(self, observation: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        quantiles: torch.Tensor = self.critic(observation, actions)
        return quantiles.mean(dim=(1, 2))
