"""Twin delayed deterministic policy gradient of stable-baselines3, from the context to the launch."""

from __future__ import annotations

from typing import Any

import numpy as np

from sledenv.benchmark.problem import Problem
from sledenv.machine.extras import needs

from .learning import Learned
from .searching import SearchingTD3, searching

with needs("agents", __name__):
    from stable_baselines3 import TD3
    from stable_baselines3.common.noise import NormalActionNoise


class Agent(Learned):
    """Learns off-policy, a deterministic policy that explores by normal noise."""

    algorithm = TD3

    @classmethod
    def prepared(cls, problem: Problem, settings: dict[str, Any]) -> dict[str, Any]:
        """Take the policy that searches, and make normal noise of deviation ``noise_std`` as rl-baselines3-zoo does.

        Raises
        ------
        ValueError
            For another ``noise_type``.
        """
        kind, sigma = settings.pop("noise_type"), settings.pop("noise_std")
        if kind != "normal":
            raise ValueError(f"noise_type = {kind!r}: must be 'normal'")
        noise = NormalActionNoise(np.zeros(problem.actions), np.full(problem.actions, sigma))
        return searching(SearchingTD3, problem, settings) | {"action_noise": noise}
