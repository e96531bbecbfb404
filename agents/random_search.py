"""The best of many random linear policies: how far one gets without any search direction."""

from __future__ import annotations

from typing import Any

import numpy as np

from sledenv.benchmark.problem import Problem

from .linear import Floats, Judge, Linear, size


class Agent(Linear):
    """Draws weights from normal distributions and keeps those that do best on the same training contexts."""

    @classmethod
    def search(cls, problem: Problem, judge: Judge, settings: dict[str, Any], seed: int) -> Floats:
        """Try ``n_timesteps // contexts`` policies, the weights of each with a standard deviation of its own.

        That is drawn between the two of ``scales``, uniform in its logarithm: some policies hardly look at the context.
        """
        contexts = problem.contexts("train", settings["contexts"], seed)
        count = settings["n_timesteps"] // len(contexts)
        if count < 1:
            least = len(contexts)
            raise ValueError(f"n_timesteps = {settings['n_timesteps']}: must be >= {least}, the descents of one policy")
        rng = np.random.default_rng(seed)
        low, high = np.log(settings["scales"])
        scales = np.exp(rng.uniform(low, high, (count, 1)))
        policies = scales * rng.normal(size=(count, size(problem.task)))
        best: Floats = policies[judge(policies, contexts).argmax()]
        return best
