"""Model-predictive control: at every flight, try a few trims in a simulation of the descent and take the best."""

from __future__ import annotations

from operator import attrgetter
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import Contexts
from sledenv.envs.task import Seen
from sledenv.scenarios.configuration import read_yaml, write_yaml
from sledenv.simulation.jam import descent_jam
from sledenv.simulation.scene import SlopeTable
from sledenv.simulation.simulate import simulate_batch

Floats = NDArray[np.float64]

_FILE = "lookahead.yaml"


class Agent:
    """Looks ahead to the end of the descent, as if the trim it tries were the last; it looks again at the next flight.

    A trim is the best of evenly spaced ones. What is approximate is what is seen: a state has the precision of float32,
    the ground behind the last vertex is taken for level, and errors of the rider are not foreseen.
    """

    def __init__(self, problem: Problem, trims: int) -> None:
        self._task = problem.task
        self._trims = np.linspace(-1.0, 1.0, trims)

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Keep the settings; there is nothing to learn."""
        write_yaml(folder / _FILE, settings)
        return cls(problem, **settings)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the settings of a run."""
        return cls(problem, **read_yaml(folder / _FILE))

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        task, tried, rider = self._task, len(self._trims), self._task.scenario.rider
        if rider is None:
            return np.zeros((len(observations), 1), np.float32)
        contexts, seen = task.contexts_seen(observations), task.flights_seen(observations)
        passed = (
            seen.states[:, 0] >= task.scenario.slope_section.length_m
        )  # the end of the slope: nothing is left to do
        if passed.any():
            actions = np.zeros((len(observations), 1), np.float32)
            if not passed.all():
                actions[~passed] = self.act(observations[~passed])
            return actions
        spins = np.tile(rider.trim_rad_s * self._trims, len(observations))
        states, lent, supplied = (np.repeat(each, tried, axis=0) for each in (seen.states, seen.lent, seen.supplied))
        repeated = Seen(states, lent, supplied, [profile for profile in seen.profiles for _ in range(tried)])
        rewards = self.predicted(np.repeat(contexts, tried, axis=0), repeated, spins).reshape(-1, tried)
        # Of equal ones, as those of all that fall at once, the trim that asks for least.
        least = rewards - 1e-9 * np.abs(self._trims)
        return np.asarray(self._trims[least.argmax(axis=1)][:, np.newaxis], np.float32)

    def predicted(self, contexts: Contexts, seen: Seen, spins: Floats) -> Floats:
        """Return the rewards of descents that go on with other spins [rad/s] lent from here on, shapes (n,)."""
        task, rider = self._task, self._task.scenario.rider
        assert rider is not None
        mass, inertia = (task.of_bodies(contexts, attrgetter(name)) for name in ("mass", "inertia"))
        states, change = seen.states.copy(), spins - seen.lent
        states[:, -1] += change
        slopes = SlopeTable(task.scenario.slopes(contexts).rows, seen.profiles)
        given = task.bodies_of(contexts), task.scenario.laws(contexts), slopes, states, task.settings
        outcomes = simulate_batch(*given).outcomes
        rotor = 0.5 * inertia**2 / rider.rotor_inertia_kg_m2 * (spins**2 - seen.lent**2)
        work = inertia * change * (states[:, -1] - 0.5 * change) + rotor
        section, x = task.scenario.slope_section, states[:, 0]
        descended = np.maximum(section.length_m - x, 0.0) * np.sin(contexts[:, 0])
        outcomes["supplied"] = seen.supplied + np.maximum(work, 0.0) + mass * section.gravity_m_s2 * descended
        rewards: Floats = descent_jam(outcomes, mass, section.length_m).reward
        return rewards
