"""Model-predictive control: at every flight, look ahead in a simulation of the ride and take the best trim."""

from __future__ import annotations

from operator import attrgetter
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import Contexts
from sledenv.envs.task import Seen
from sledenv.scenarios.configuration import read_yaml, write_yaml
from sledenv.scenarios.sections import RiderSection
from sledenv.simulation.jam import descent_jam
from sledenv.simulation.records import RUNNING
from sledenv.simulation.ride import RideBatch
from sledenv.simulation.scene import Profile, SlopeTable

Floats = NDArray[np.float64]

_FILE: Final = "lookahead.yaml"
_TRIMS: Final = np.linspace(-1.0, 1.0, 41)  # among which it chooses if what is lent is off by chance
_BLOCK: Final = 32  # flights that are looked ahead from at a time
_LEVEL: Final = 20.0  # [m] of level ground behind the last vertex that a ride is followed over: it has to land there
_RARE: Final = 2.0  # standard deviations by which a spin is tried to be off


class Rides(NamedTuple):
    """Rides that are looked ahead, m of them: many may follow on one that is seen."""

    batch: RideBatch
    supplied: Floats  # [J] at the line, but for the work of the rotor in the batch, (m,)
    mass: Floats  # [kg], (m,)
    contexts: Contexts  # as far as they are seen, (m, 12)
    vertices: Floats  # [m] of the ground that is seen, infinite where there are fewer, (m, k, 3)

    def take(self, lanes: NDArray[np.intp]) -> Rides:
        """Return independent rides that stand where some of these stand."""
        return Rides(self.batch.take(lanes), *(part[lanes] for part in self[1:]))


class Agent:
    """Looks ahead in a tree of spins; it looks again at the next flight.

    In each of the next flights it tries evenly spaced spins, and behind the last of them the ride goes on with what is
    lent. A trim is worth the mean over the spins that it may lend, for an unsteady rider's are off by chance, and a
    flight what its best trim is worth: so it counts on seeing the errors before it trims again, but not on foreseeing
    them. What is approximate is what is seen: a state has the precision of float32, and the ground behind the last
    vertex is taken for level.

    Parameters
    ----------
    problem : Problem
    spins : sequence of int
        How many spins are tried in the next flight, in the one behind it, and so on; each is at least 2.
    """

    def __init__(self, problem: Problem, spins: list[int]) -> None:
        self._task = problem.task
        self._spins = spins

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
        task, actions = self._task, np.zeros((len(observations), 1), np.float32)
        if task.scenario.rider is None:
            return actions
        x = task.flights_seen(observations).states[:, 0]
        left = np.flatnonzero(x < task.scenario.slope_section.length_m)  # behind the line nothing is left to do
        tried, trims, chances = self._tried(self._spins[0])
        for begin in range(0, len(left), _BLOCK):
            rows = left[begin : begin + _BLOCK]
            contexts, seen = task.contexts_seen(observations[rows]), task.flights_seen(observations[rows])
            worth = self.predicted(contexts, seen, np.tile(tried, (len(rows), 1))) @ chances
            # Of equal ones, as those of all that fall at once, the trim that asks for least.
            actions[rows, 0] = trims[(worth - 1e-9 * np.abs(trims)).argmax(axis=1)]
        return actions

    def predicted(self, contexts: Contexts, seen: Seen, tried: Floats) -> Floats:
        """Return what rides earn that go on with spins in units of the largest trim, shapes (n, k)."""
        return self._worth(self._begun(contexts, seen, tried), self._spins[1:]).reshape(tried.shape)

    @property
    def _rider(self) -> RiderSection:
        rider = self._task.scenario.rider
        assert rider is not None  # act has returned before
        return rider

    def _tried(self, count: int) -> tuple[Floats, Floats, Floats]:
        """Return spins that are tried, trims to choose from, and how likely each spin is with each trim.

        Spins and trims are in units of the largest trim; their shapes are (count,), (k,) and (count, k).
        """
        rider = self._rider
        off = rider.noise_rad_s / rider.trim_rad_s
        tried = (1.0 + _RARE * off) * np.linspace(-1.0, 1.0, count)
        if off == 0.0:
            return tried, tried, np.eye(count)
        chances = np.exp(-0.5 * ((tried[:, np.newaxis] - _TRIMS) / off) ** 2)
        return tried, _TRIMS, chances / chances.sum(axis=0)

    def _begun(self, contexts: Contexts, seen: Seen, tried: Floats) -> Rides:
        """Return rides behind the flights that are seen, in each of which spins are tried, shape (n, k)."""
        task, rider = self._task, self._rider
        lanes = np.repeat(np.arange(len(contexts)), tried.shape[1])
        profiles, rows = [_ended(profile) for profile in seen.profiles], task.scenario.slopes(contexts).rows.copy()
        if not task.scenario.zones:  # which have to begin before the end
            ends = [profile[-1][0] if profile else np.inf for profile in profiles]
            rows[:, 1] = np.minimum(rows[:, 1], np.maximum(ends, seen.states[:, 0]) + _LEVEL)
        states, spins = seen.states.copy(), rider.trim_rad_s * tried.ravel()
        states[:, -1] -= seen.lent
        batch = RideBatch(
            task.bodies_of(contexts),
            task.scenario.laws(contexts),
            SlopeTable(rows, profiles),
            states,
            task.settings,
            rotor_inertia=rider.rotor_inertia_kg_m2,
            shortest_flight=rider.shortest_flight_s,
        ).take(lanes)
        batch.hop(spins)
        # The batch lends its first spin to a body to which nothing was lent: not the work that it takes here.
        mass, inertia = (task.of_bodies(contexts, attrgetter(name))[lanes] for name in ("mass", "inertia"))
        change, lent = spins - seen.lent[lanes], seen.lent[lanes]
        rotor = 0.5 * inertia**2 / rider.rotor_inertia_kg_m2 * (spins**2 - lent**2)
        work = inertia * change * (seen.states[lanes, -1] + 0.5 * change) + rotor
        section = task.scenario.slope_section
        descended = np.maximum(rows[:, 1] - seen.states[:, 0], 0.0) * np.sin(contexts[:, 0])
        supplied = seen.supplied[lanes] + mass * section.gravity_m_s2 * descended[lanes]
        supplied += np.maximum(work, 0.0) - batch.outcomes()["work"]
        return Rides(batch, supplied, mass, contexts[lanes], _vertices(seen.profiles)[lanes])

    def _worth(self, rides: Rides, spins: list[int]) -> Floats:
        """Return what rides earn if so many spins are tried in their next flights, shape (m,)."""
        if not spins:
            return self._worth_behind(rides)
        worth, running, _ = self._earned(rides)
        if running.size:
            tried, _, chances = self._tried(spins[0])
            further = rides.take(np.repeat(running, len(tried)))
            further.batch.hop(np.tile(self._rider.trim_rad_s * tried, len(running)))
            worth[running] = (self._worth(further, spins[1:]).reshape(-1, len(tried)) @ chances).max(axis=1)
        return worth

    def _worth_behind(self, rides: Rides) -> Floats:
        """Return what rides earn behind the last flight in which spins are tried, shape (m,)."""
        batch = rides.batch
        while (batch.outcomes()["status"] == RUNNING).any():
            batch.hop(batch.outcomes()["trim"])
        return self._earned(rides)[0]

    def _earned(self, rides: Rides) -> tuple[Floats, NDArray[np.intp], np.ndarray]:
        """Return what rides have earned so far, which of them go on, and where they stand, shapes (m,), (k,), (m,)."""
        outcomes = rides.batch.outcomes()
        outcomes["supplied"] = rides.supplied + outcomes["work"]
        earned: Floats = descent_jam(outcomes, rides.mass, self._task.scenario.slope_section.length_m).reward
        return earned, np.flatnonzero(outcomes["status"] == RUNNING), outcomes


def _ended(profile: Profile) -> Profile:
    """Return a profile without a last vertex that is none, with level ground on both sides of it.

    A body that slides over one may take a million steps.
    """
    return profile[:-1] if len(profile) > 2 and profile[-1][1] == profile[-2][1] else profile


def _vertices(profiles: list[Profile]) -> Floats:
    """Return the vertices of profiles, infinite where one has fewer than another, shape (n, k, 3)."""
    vertices = np.full((len(profiles), max(map(len, profiles), default=0), 3), np.inf)
    for row, profile in zip(vertices, profiles, strict=True):
        row[: len(profile)] = np.reshape(profile, (-1, 3))
    return vertices
