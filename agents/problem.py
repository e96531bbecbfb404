"""What an agent is given: a scenario, what it controls, and contexts to train, to validate and to be judged on."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sledenv import DescentBatch
from sledenv.envs.task import Contexts, Control, Task, checked_actions
from sledenv.scenario import Split


class Agent(Protocol):
    """What can be judged: a map from observations to actions."""

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return actions of shape (n, k) in [-1, 1] for observations of shape (n, 8)."""
        ...


class Problem:
    """A scenario with what the agent controls of its launch.

    Parameters
    ----------
    scenario : str
        As for :func:`sledenv.load_scenario`.
    control : {"both", "orientation", "spin"}
        What the agent chooses.
    """

    def __init__(self, scenario: str, control: Control = "both") -> None:
        self.task = Task(scenario, control)
        self.scenario = scenario
        self.control = control
        self.actions: int = self.task.action_space.shape[0]

    def contexts(self, split: Split, count: int, seed: int = 0) -> Contexts:
        """Draw ``count`` contexts of a split, shape (count, 8); context i does not depend on ``count``."""
        draws = np.array([np.random.default_rng([seed, i]).random(self.task.draws) for i in range(count)])
        return self.task.scenario.contexts(draws, split)

    def descend(self, contexts: Contexts, actions: ArrayLike) -> DescentBatch:
        """Simulate one descent a context with actions of shape (n, k), on all cores."""
        chosen = checked_actions(self.task.action_space, actions, len(contexts))
        return self.task.descend_batch(contexts, self.task.launches(contexts, chosen))

    def judge(self, agent: Agent, contexts: Contexts) -> DescentBatch:
        """Simulate the launches that an agent chooses for contexts."""
        return self.descend(contexts, agent.act(self.task.observe(contexts)))
