"""Soft actor-critic of stable-baselines3, from what is seen to the launch or the trims."""

from __future__ import annotations

from typing import Any

from sledenv.benchmark.problem import Problem
from sledenv.machine.extras import needs

from .learning import Learned
from .searching import SearchingSAC, searching

with needs("agents", __name__):
    from stable_baselines3 import SAC


class Agent(Learned):
    """Learns off-policy, with an entropy bonus that it tunes itself."""

    algorithm = SAC

    @classmethod
    def prepared(cls, problem: Problem, settings: dict[str, Any]) -> dict[str, Any]:
        """Take the policy that searches."""
        return searching(SearchingSAC, problem, settings)
