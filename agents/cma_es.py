"""Covariance matrix adaptation of the library ``cma``, with restarts, on the weights of a linear policy."""

from __future__ import annotations

from typing import Any

import numpy as np

from sledenv.benchmark.problem import Problem
from sledenv.machine.extras import needs

from .linear import Floats, Judge, Linear, size

with needs("benchmark", __name__):
    import cma


class Agent(Linear):
    """Restarts from random weights; the mean of the run that validates best is kept."""

    @classmethod
    def search(cls, problem: Problem, judge: Judge, settings: dict[str, Any], seed: int) -> Floats:
        """Share ``n_timesteps`` descents, those of the validation included, among ``restarts`` runs.

        A generation is tried on the same ``contexts`` training contexts, the next one on others: what is good on
        these alone does not last.
        """
        restarts, each = settings["restarts"], settings["contexts"]
        checked = problem.contexts("validation", settings["validation"])
        budget = settings["n_timesteps"] // restarts - len(checked)
        generations = budget // (each * settings["popsize"])
        if generations < 1:
            least = restarts * (len(checked) + each * settings["popsize"])
            raise ValueError(f"n_timesteps = {settings['n_timesteps']}: must be >= {least}, a generation a restart")
        rng = np.random.default_rng(seed)
        found: list[Floats] = []
        for _ in range(restarts):
            start = rng.normal(0.0, settings["scale"], size(problem.task))
            options = {"seed": int(rng.integers(1, 1 << 31)), "verbose": -9, "popsize": settings["popsize"]}
            search = cma.CMAEvolutionStrategy(start, settings["sigma0"], options)
            for _ in range(generations):
                policies = np.array(search.ask())
                contexts = problem.contexts("train", each, int(rng.integers(1 << 31)))
                search.tell(policies, -judge(policies, contexts))
            found.append(np.array(search.result.xfavorite))
        kept: Floats = found[judge(np.array(found), checked).argmax()]
        return kept
