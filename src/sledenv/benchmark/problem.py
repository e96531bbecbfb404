"""What an agent is given: a scenario, what it controls, and contexts to train, to validate and to be judged on."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any, Final, Literal, Protocol, Self, get_args

import numpy as np
from gymnasium import spaces
from gymnasium.error import InvalidAction
from numpy.typing import ArrayLike, NDArray
from scipy.stats import qmc

from sledenv.envs import DESCENT_ID, LAUNCH_ID
from sledenv.envs.inputs import FIELDS, Contexts, checked_actions
from sledenv.envs.task import FLIGHT, Task
from sledenv.kernel.records import RUNNING
from sledenv.scenarios.scenario import NOISY, Scenario, Split, check_split
from sledenv.scenarios.sections import CONTROLS
from sledenv.simulation.outcomes import DescentBatch
from sledenv.simulation.settings import BatchSolver

Environment = Literal["launch", "descent"]
ENVIRONMENTS: Final = {"launch": LAUNCH_ID, "descent": DESCENT_ID}
TRIALS: Final = 8  # launches with which a context is judged where the launch is noisy
TREMBLE: Final = (math.radians(2.0), 0.2)  # [rad], [rad/s] standard deviations of what a steady hand misses by; assumed
TREMBLES: Final = 16  # launches with which a context is judged under a tremble


class Agent(Protocol):
    """What can be trained and judged: a map from observations to actions, and how it comes about.

    A suite names the module whose class ``Agent`` it is; docs/benchmark.md shows a complete one.
    """

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Train on contexts of the splits "train" and "validation", keep the result in a folder and return the agent.

        Parameters
        ----------
        problem : Problem
        settings : dict
            From configs/agents; ``n_timesteps`` is the budget in simulated descents (in hops for SledDescent-v0).
        seed : int
            Of everything random.
        folder : Path
            Exists and is the agent's own.
        """
        ...

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read what :meth:`train` kept."""
        ...

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return actions of shape (n, k) in [-1, 1] for observations of shape (n, 11) or (n, 20)."""
        ...


class Problem:
    """A scenario with what the agent controls of it.

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    environment : {"launch", "descent"}
        Whether the agent chooses the launch alone or trims every hop too.
    control : str, optional
        What it chooses of the launch, as for :class:`sledenv.envs.task.Task`.
    solver : {"compliant", "rigid"}
        As for :func:`sledenv.simulate`; agents are judged on compliant surfaces.

    Attributes
    ----------
    noisy : bool
        Whether the launch misses what was chosen.
    tremble : ndarray, shape (2,)
        Standard deviations of orientation [rad] and spin [rad/s] under a tremble: the noise of the scenario and, in
        what the agent chooses, ``TREMBLE``.
    turns : tuple of bool
        For each thing that is chosen whether its bounds are a full turn apart, so that both are the same launch.

    Raises
    ------
    ScenarioError, ValueError
        For an unknown scenario, environment, control or solver.
    """

    def __init__(
        self,
        scenario: str | os.PathLike[str] | Scenario,
        environment: Environment = "launch",
        control: str | None = None,
        *,
        solver: BatchSolver = "compliant",
    ) -> None:
        if environment not in ENVIRONMENTS:
            known = ", ".join(map(repr, get_args(Environment)))
            raise ValueError(f"environment = {environment!r}: must be one of {known}")
        self.task = Task(scenario, control, solver=solver)
        self.scenario = self.task.scenario
        self.environment = environment
        self.id = ENVIRONMENTS[environment]
        self.control = self.task.control
        hops = environment == "descent"
        self.action_space: spaces.Box = self.task.ride_action_space if hops else self.task.action_space
        self.actions: int = self.action_space.shape[0]
        self.noisy = bool(self.task.noise.any())
        chosen = [name in self.task.controlled for name in NOISY]
        self.tremble: NDArray[np.float64] = np.hypot(self.task.noise, np.where(chosen, TREMBLE, 0.0))
        bounds = self.scenario.control_bounds
        self.turns = tuple(bounds[name][1] - bounds[name][0] == CONTROLS[name].turn for name in self.task.controlled)

    def contexts(self, split: Split, count: int, seed: int = 0) -> Contexts:
        """Draw ``count`` contexts of a split, shape (count, 11); context i does not depend on ``count``."""
        part = _number(split)
        draws = np.array([np.random.default_rng([seed, part, i]).random(FIELDS) for i in range(count)])
        return self.scenario.contexts(draws.reshape(count, FIELDS), split)

    def trials(self, contexts: Contexts, split: Split) -> Contexts:
        """Repeat contexts of shape (n, 11) as often as they are judged, shape (n, t, 11) or (n, t, 13).

        Where the launch is noisy, t is ``TRIALS`` and every context gets the same quasi-random normal noise, so that a
        mean over the trials is the expected value, of agents and of the oracle alike. Each split has noise of its own:
        an agent that searches with that of "train" or "validation" knows nothing of that with which it is judged.
        Otherwise t is 1.
        """
        if not self.noisy:
            return contexts[:, np.newaxis]
        return _repeated(contexts, self.task.noise, TRIALS, split)

    def trembling(self, contexts: Contexts, split: Split) -> Contexts:
        """Repeat contexts of shape (n, 11) with launches that miss what is chosen by a tremble, shape (n, t, 13).

        As :meth:`trials`, but with t = ``TREMBLES`` and the noise of ``tremble``.
        """
        return _repeated(contexts, self.tremble, TREMBLES, split)

    def drawn(self, contexts: Contexts, split: Split) -> Contexts:
        """Give each of contexts of shape (n, 11) one draw of the noise of a split, shape (n, 11) or (n, 13).

        These are the trials of :meth:`trials` in turn, one a context.
        """
        trials = self.trials(contexts, split)
        lanes = np.arange(len(contexts))
        return np.asarray(trials[lanes, lanes % trials.shape[1]])

    def disturbed(self, contexts: Contexts, level: float) -> Contexts:
        """Add normal noise to what the agent chooses of ``NOISY``, once for each of contexts of shape (n, 11).

        Parameters
        ----------
        contexts : ndarray, shape (n, 11)
        level : float
            Standard deviation as a share of half the control range, added to the noise of the scenario.

        Returns
        -------
        ndarray, shape (n, 13)
            The same whatever the agent.
        """
        task = self.task
        extra = [np.ptp(task.bounds[name]) / 2 if name in task.controlled else 0.0 for name in NOISY]
        sigma = np.hypot(self.task.noise, level * np.array(extra))
        return np.hstack([contexts, sigma * np.random.default_rng(0).standard_normal((len(contexts), 2))])

    def inside(self, actions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Put actions of shape (..., k) into the box: a full turn wraps around, everything else stops at its bounds."""
        columns = [
            (actions[..., i] + 1.0) % 2.0 - 1.0 if turning else np.clip(actions[..., i], -1.0, 1.0)
            for i, turning in enumerate(self.turns)
        ]
        return np.stack(columns, axis=-1)

    def descend(self, contexts: Contexts, actions: ArrayLike) -> DescentBatch:
        """Simulate one descent a context with launches of shape (n, k), on all cores."""
        chosen = checked_actions(self.task.action_space, actions, len(contexts))
        return self.task.descend_batch(contexts, self.task.launches(contexts, chosen))

    def expect(
        self, contexts: Contexts, actions: NDArray[np.float64], split: Split, *, trembling: bool = False
    ) -> NDArray[np.float64]:
        """Return the expected reward of launches.

        Parameters
        ----------
        contexts : ndarray, shape (n, 11)
        actions : ndarray, shape (n, m, k)
            Launches to try in each context.
        split : {"train", "validation", "test"}
            Whose noise is meant, see :meth:`trials`.
        trembling : bool
            Whether the launches miss by a tremble too, see :meth:`trembling`.

        Returns
        -------
        ndarray, shape (n, m)
        """
        tried = actions.shape[1]
        trials = self.trembling(contexts, split) if trembling else self.trials(contexts, split)
        rewards: NDArray[np.float64] = np.zeros(actions.shape[:2])
        for i in range(trials.shape[1]):
            repeated = np.repeat(trials[:, i], tried, axis=0)
            rewards += self.descend(repeated, actions.reshape(-1, actions.shape[2])).jam.reward.reshape(rewards.shape)
        rewards /= trials.shape[1]
        return rewards

    def judge(self, agent: Agent, contexts: Contexts) -> tuple[DescentBatch, NDArray[np.float64]]:
        """Simulate what an agent does in contexts, on all cores.

        Parameters
        ----------
        agent : Agent
        contexts : ndarray, shape (n, 11) or (n, 13)

        Returns
        -------
        DescentBatch
            Equal bit for bit to episodes of the environment.
        ndarray, shape (n, k)
            The launches that it chose, in [-1, 1].

        Raises
        ------
        ValueError
            If its actions have another shape, are no numbers or lie outside [-1, 1].
        RuntimeError
            If it raises an error itself, which is the cause.
        """
        task = self.task
        seen = task.observe(contexts)
        if self.environment == "launch":
            actions = self._answer(agent, seen)
            return task.descend_batch(contexts, task.launches(contexts, actions)), actions
        ground = np.zeros((len(seen), len(FLIGHT)), np.float32)
        actions = self._answer(agent, np.hstack([seen, ground]))[:, :-1]
        rides = task.rides(contexts, task.launches(contexts, actions))
        trims = np.zeros(len(seen))
        while True:
            rides.hop(trims)
            flights = rides.outcomes()
            moving = np.flatnonzero(flights["status"] == RUNNING)
            if not moving.size:
                return rides.descents(), actions
            observed = np.hstack([seen[moving], task.observe_flights(flights[moving])])
            chosen = self._answer(agent, observed)
            trims = np.zeros(len(seen))
            trims[moving] = task.trims(chosen[:, -1])

    def _answer(self, agent: Agent, observations: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return the actions of an agent, shape (n, k), or say whose are wrong and where."""
        whose = f"agent {type(agent).__module__}, scenario {self.scenario.id}"
        try:
            actions = agent.act(observations)
        except Exception as error:  # a command would tell a ValueError as wrong input, without its place
            raise RuntimeError(f"{whose}: act raised {type(error).__name__}: {error}") from error
        try:
            return checked_actions(self.action_space, actions, len(observations))
        except InvalidAction as error:
            raise ValueError(f"{whose}: {error}") from error


def _repeated(contexts: Contexts, sigma: NDArray[np.float64], count: int, split: Split) -> Contexts:
    """Give each of contexts of shape (n, 11) the same quasi-random normal noise of a split, shape (n, count, 13)."""
    noise = sigma * qmc.MultivariateNormalQMC([0.0, 0.0], rng=np.random.default_rng(_number(split))).random(count)
    shape = len(contexts), count
    repeated = np.broadcast_to(contexts[:, np.newaxis], (*shape, FIELDS))
    return np.concatenate([repeated, np.broadcast_to(noise, (*shape, 2))], axis=2)


def _number(split: Split) -> int:
    """Return which of the splits it is, for the streams of random numbers."""
    check_split(split)
    return get_args(Split).index(split)
