"""The best of many random linear policies: how far one gets without any search direction."""

from __future__ import annotations

from typing import Any

import numpy as np

from agents.linear import Floats, Judge, Linear, size
from sledenv.benchmark.problem import Problem


class Agent(Linear):
    """Draws weights from a normal distribution and keeps those that do best on the same training contexts."""

    @classmethod
    def search(cls, problem: Problem, judge: Judge, settings: dict[str, Any], seed: int) -> Floats:
        """Try ``n_timesteps // contexts`` policies of weights with the standard deviation ``scale``."""
        contexts = problem.contexts("train", settings["contexts"], seed)
        count = settings["n_timesteps"] // len(contexts)
        policies = np.random.default_rng(seed).normal(0.0, settings["scale"], (count, size(problem.task)))
        best: Floats = policies[judge(policies, contexts).argmax()]
        return best
