"""Model-predictive control: at every flight, look ahead in a simulation of the ride and take the best trim."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import load_run
from sledenv.scenarios.configuration import read_yaml, write_yaml
from sledenv.scenarios.sections import RiderSection
from sledenv.simulation.jam import descent_jam
from sledenv.simulation.records import RUNNING
from sledenv.simulation.scenes import Scenes
from sledenv.simulation.simulator import Simulator

Floats = NDArray[np.float64]

_FILE: Final = "lookahead.yaml"
_TRIMS: Final = np.linspace(-1.0, 1.0, 41)  # among which it chooses if what is lent is off by chance
_BLOCK: Final = 32  # flights that are looked ahead from at a time
_LEVEL: Final = 20.0  # [m] of level ground behind the last vertex that a ride is followed over: it has to land there
_RARE: Final = 2.0  # standard deviations by which a spin is tried to be off


class Agent:
    """Looks ahead in a tree of spins; it looks again at the next flight.

    In each of the next flights it tries evenly spaced spins. Behind the last of them a ride is worth what a critic
    expects of what is seen there, as in POLO (Lowrey et al. 2018), or without one what it earns with the spin that is
    lent. A trim is worth the mean over the spins that it may lend, for a rider's are off by chance, and a flight what
    its best trim is worth: so it counts on seeing the errors before it trims again, but not on foreseeing them. It
    knows where each flight begins to the last bit, and no ground behind the eighth vertex, which it takes for level.

    Parameters
    ----------
    problem : Problem
    spins : sequence of int
        How many spins are tried in the next flight, in the one behind it, and so on; each is at least 2.
    critic : str, optional
        Folder or name of a run of :mod:`sledenv.agents.critic`, in which ``{scenario}`` stands for the id.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such critic, or it is one of launches or of another scenario.
    """

    def __init__(self, problem: Problem, spins: list[int], critic: str | None = None) -> None:
        self._task, self._spins = problem.task, spins
        self._critic: Any = None
        if critic is not None:
            theirs, self._critic, _ = load_run(Path(critic.format(scenario=problem.scenario.id)))
            theirs.must_be("descent", "a critic of rides")
            if theirs.scenario.hash != problem.scenario.hash or not hasattr(self._critic, "expected"):
                raise ValueError(f"critic = {critic!r}: must be a run of a critic of {problem.scenario.id} as it is")
            self._seen_as = theirs.task

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Keep the settings; there is nothing to learn."""
        write_yaml(folder / _FILE, settings)
        return cls(problem, **settings)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the settings of a run."""
        return cls(problem, **read_yaml(folder / _FILE))

    def plan(self, scenes: Scenes, flights: np.ndarray | None) -> NDArray[np.float32]:
        actions = np.zeros((len(scenes.rows), 1), np.float32)
        if self._task.scenario.rider is None or flights is None:
            return actions
        left = np.flatnonzero(flights["x"] < scenes.rows["length"])  # behind the finish nothing is left to do
        tried, trims, chances = self._tried(self._spins[0])
        for begin in range(0, len(left), _BLOCK):
            rows = left[begin : begin + _BLOCK]
            worth = self.predicted(scenes.take(rows), flights[rows], np.tile(tried, (len(rows), 1))) @ chances
            # Of equal ones, as those of all that fall at once, the trim that asks for least.
            actions[rows, 0] = trims[(worth - 1e-9 * np.abs(trims)).argmax(axis=1)]
        return actions

    def predicted(self, scenes: Scenes, flights: np.ndarray, tried: Floats) -> Floats:
        """Return what rides earn that go on with spins in units of the largest trim, shapes (n, k)."""
        lengths = np.repeat(scenes.rows["length"], tried.shape[1])
        return self._worth(self._begun(scenes, flights, tried), lengths, self._spins[1:]).reshape(tried.shape)

    @property
    def _rider(self) -> RiderSection:
        rider = self._task.scenario.rider
        assert rider is not None  # plan has returned before
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

    def _begun(self, scenes: Scenes, flights: np.ndarray, tried: Floats) -> Simulator:
        """Return rides behind the flights that begin, in each of which spins are tried, shape (n, k)."""
        # Rides are followed to their ends without a critic alone; zones have to begin before the end.
        if self._critic is None and not self._task.scenario.zones:
            ends = [ground["x"][-1] if len(ground) else np.inf for ground in scenes.grounds()]
            scenes = scenes._replace(rows=scenes.own_rows())
            scenes.rows["length"] = np.minimum(scenes.rows["length"], np.maximum(ends, flights["x"]) + _LEVEL)
        rides = self._task.simulator(scenes)
        rides.flights = flights
        rides = rides.take(np.repeat(np.arange(len(flights)), tried.shape[1]))
        rides.hop(self._rider.trim_rad_s * tried.ravel())
        return rides

    def _worth(self, rides: Simulator, lengths: Floats, spins: list[int]) -> Floats:
        """Return what rides earn if so many spins are tried in their next flights, shape (m,)."""
        if not spins and self._critic is None:
            while (rides.flights["status"] == RUNNING).any():
                rides.hop(rides.flights["trim_spin"])
        worth: Floats = descent_jam(rides.flights, rides.scenes.of_body("mass"), lengths).reward
        running = np.flatnonzero(rides.flights["status"] == RUNNING)
        if running.size and spins:
            tried, _, chances = self._tried(spins[0])
            further = rides.take(np.repeat(running, len(tried)))
            further.hop(np.tile(self._rider.trim_rad_s * tried, len(running)))
            expected = self._worth(further, np.repeat(lengths[running], len(tried)), spins[1:])
            worth[running] = (expected.reshape(-1, len(tried)) @ chances).max(axis=1)
        elif running.size:
            seen = self._seen_as.observe(rides.scenes.take(running), rides.flights.take(running))
            worth[running] += self._critic.expected(seen)
        return worth
