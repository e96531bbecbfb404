"""CMA-ES of the library ``cma`` on the landing of one context, tried in a model of the descent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sledenv.machine.extras import needs

from . import uniform_lookups

with needs("benchmark", __name__):
    import cma

_POPULATION = 4  # the least: few lookups are a handful of generations
_WIDTH = 0.5  # standard deviation of the first one, where the box is 2 wide


class Agent(uniform_lookups.Agent):
    """Starts anew in the middle of the box in every context; the best landing that it has tried is taken."""

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        problem, count = self._problem, len(observations)
        model = uniform_lookups.Model(problem, self._lookups, observations)
        # A search needs two dimensions at least, so a second one without effect where a launch has one.
        start, options = np.zeros(max(problem.actions, 2)), {"verbose": -9, "popsize": _POPULATION}
        searches = [cma.CMAEvolutionStrategy(start, _WIDTH, options | {"seed": 1 + i}) for i in range(count)]
        tried, rewards = [], []
        for _ in range(max(1, model.candidates // _POPULATION)):
            asked = np.array([search.ask() for search in searches])
            tried.append(problem.inside(asked[..., : problem.actions]))
            rewards.append(model.expect(tried[-1]))
            for search, points, earned in zip(searches, asked, rewards[-1], strict=True):
                search.tell(list(points), -earned)
        return model.choose(np.concatenate(tried, axis=1), np.concatenate(rewards, axis=1))
