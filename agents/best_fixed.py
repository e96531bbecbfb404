"""The best single launch for all contexts: what can be had without looking at the context."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import qmc
from tqdm import tqdm

from sledenv.benchmark.problem import Problem
from sledenv.scenarios.configuration import read_yaml, write_yaml

_FILE = "action.yaml"


class Agent:
    """Always takes the one action that did best on the training contexts."""

    def __init__(self, action: ArrayLike) -> None:
        self.action = np.asarray(action, np.float32)

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Try candidates on the same training contexts.

        Parameters
        ----------
        problem : Problem
        settings : dict
            ``contexts`` (training contexts) and ``n_timesteps`` (budget in descents).
        seed : int
            Of the contexts and the candidates.
        folder : Path
            Where the action is kept.
        """
        contexts = problem.drawn(problem.contexts("train", settings["contexts"], seed), "train")
        each = len(contexts)
        count = settings["n_timesteps"] // each
        if count < 1:
            raise ValueError(
                f"n_timesteps = {settings['n_timesteps']}: must be >= {each}, the descents of one candidate"
            )
        sequence = qmc.Sobol(problem.actions, rng=np.random.default_rng(seed))
        candidates = 2.0 * sequence.random_base2(max(1, (count - 1).bit_length()))[:count] - 1.0
        rewards = [
            float(problem.descend(contexts, np.tile(candidate, (len(contexts), 1))).jam.reward.mean())
            for candidate in tqdm(candidates, desc="best-fixed", unit="candidate", disable=None)
        ]
        agent = cls(candidates[int(np.argmax(rewards))])
        write_yaml(folder / _FILE, {"action": agent.action.tolist()})
        return agent

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the action of a run."""
        return cls(read_yaml(folder / _FILE)["action"])

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.tile(self.action, (len(observations), 1))
