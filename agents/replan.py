"""Model-predictive control: at every rebound, try a few trims in a simulation of the descent and take the best."""

from __future__ import annotations

from abc import ABC, abstractmethod
from operator import attrgetter
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.oracle import jam_map
from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import SEEN, Contexts
from sledenv.envs.task import FLIGHT
from sledenv.scenarios.configuration import read_yaml, write_yaml
from sledenv.simulation.jam import descent_jam

Floats = NDArray[np.float64]

_FILE = "lookahead.yaml"


class Replanner(ABC):
    """Looks ahead to the end of the descent, as if the trim it tries were the last; it looks again after the next hop.

    A trim is the best of evenly spaced ones; where the launch comes from, others say. Two things are approximate. A
    state that has been observed has the precision of float32. And the energy supplied leaves out what cannot be
    observed after the launch, its spin, the height of its pose and the work of former trims, so that every trim looks a
    little too good. Where the agent chooses the speed, or else what gives energy, that has the middle of its bounds in
    this sum, alike for all trims.
    """

    def __init__(self, problem: Problem, trims: int) -> None:
        self._model = Problem(problem.scenario, control=problem.control)
        self._trims = np.linspace(-1.0, 1.0, trims)

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        actions = np.zeros((len(observations), self._model.actions + 1))
        waits = ~observations[:, SEEN:].any(axis=1)  # before the launch; afterwards sine or cosine is not 0
        if waits.any():
            actions[waits, :-1] = self._launches(observations[waits, :SEEN])
        if not waits.all():
            actions[~waits, -1] = self._best_trims(observations[~waits])
        return actions.astype(np.float32)

    @abstractmethod
    def _launches(self, observations: NDArray[np.float32]) -> NDArray[Any]:
        """Return launches of shape (n, k) for contexts that are seen, shape (n, 11)."""

    def _best_trims(self, observations: NDArray[np.float32]) -> Floats:
        """Return the trims that the model rewards most, shape (n,); in the run-out they stay as they are."""
        contexts, tried = self._model.task.contexts_seen(observations), len(self._trims)
        states, lent = self._model.task.flights_seen(np.repeat(observations, tried, axis=0))
        repeated = np.repeat(contexts, tried, axis=0)
        spins = np.tile(self._model.task.trims(self._trims), len(contexts))
        ahead, rewards = states[:, 0] < self._model.scenario.slope_section.length_m, np.zeros(len(states))
        if ahead.any():
            rewards[ahead] = self._predicted(*(each[ahead] for each in (repeated, states, lent, spins)))
        best = self._trims[rewards.reshape(-1, tried).argmax(axis=1)]
        return np.where(ahead[::tried], best, observations[:, SEEN + FLIGHT.index("trim")])

    def _predicted(self, contexts: Contexts, states: Floats, lent: Floats, spins: Floats) -> Floats:
        """Return the rewards of descents that go on from rebounds with other trims, shape (n,)."""
        task, scenario = self._model.task, self._model.scenario
        middle = np.zeros((len(contexts), len(task.controlled)))
        angle, _, _, speed, drop, fall, *_ = task.chosen(contexts, middle).T
        mass, inertia = (task.of_bodies(contexts, attrgetter(name)) for name in ("mass", "inertia"))
        gravity = scenario.slope_section.gravity_m_s2
        states[:, -1] += spins - lent
        outcomes = task.descend_batch(contexts, states).outcomes
        rotor = 0.0 if scenario.rider is None else 0.5 * inertia**2 / scenario.rider.rotor_inertia_kg_m2
        work = inertia * (spins - lent) * (states[:, -1] - 0.5 * (spins - lent)) + rotor * (spins**2 - lent**2)
        length = scenario.slope_section.length_m
        height = drop * np.cos(angle) + length * np.sin(angle)
        given = mass * (0.5 * (speed**2 + fall**2) + gravity * height)
        outcomes["supplied"] = given + np.maximum(work, 0.0)  # instead of what the state at the rebound stands for
        rewards: Floats = descent_jam(outcomes, mass, length).reward
        return rewards


class Agent(Replanner):
    """Launches as the best of a grid does in the model, under the tremble, and trims as it looks ahead."""

    def __init__(self, problem: Problem, settings: dict[str, Any]) -> None:
        super().__init__(problem, settings["trims"])
        self._cells = int(settings["cells"])

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Keep the settings; there is nothing to learn."""
        write_yaml(folder / _FILE, settings)
        return cls(problem, settings)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the settings of a run."""
        return cls(problem, read_yaml(folder / _FILE))

    def _launches(self, observations: NDArray[np.float32]) -> NDArray[Any]:
        best = []
        for one in jam_map(self._model, self._model.task.contexts_seen(observations), self._cells):
            cell = np.unravel_index(one.rewards.argmax(), one.rewards.shape)
            best.append([axis[i] for axis, i in zip(one.launches, cell, strict=True)])
        return np.array(best)
