"""Model-predictive control with a learned value: look ahead over a flight or two, and ask a critic what follows."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, Self

from sledenv.benchmark.problem import Problem
from sledenv.scenarios.configuration import read_yaml, write_yaml
from sledenv.simulation.simulator import Simulator

from . import replan, ride_critic
from .replan import Floats

_FILE: Final = "lookahead.yaml"


class Agent(replan.Agent):
    """Looks ahead as replan does; behind the last flight of its tree a ride is worth what a ride critic expects.

    One flight is foreseen exactly, and its rewards jump between landing and falling, which no network learns sharply.
    What comes behind it is smoother, and depends on ground that is not seen yet: of that the critic knows the mean.

    Parameters
    ----------
    problem : Problem
    spins : sequence of int
        As for :class:`sledenv.agents.replan.Agent`.
    critic : sledenv.agents.ride_critic.Agent
    """

    def __init__(self, problem: Problem, spins: list[int], critic: ride_critic.Agent) -> None:
        super().__init__(problem, spins)
        self._critic = critic

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Train the critic, by which nothing is looked ahead; settings are its own and ``spins``."""
        settings = dict(settings)
        spins = settings.pop("spins")
        write_yaml(folder / _FILE, {"spins": spins})
        return cls(problem, spins, ride_critic.Agent.train(problem, settings, seed, folder))

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read a run; raises as :func:`sledenv.agents.classes.kept_weights`."""
        return cls(problem, **read_yaml(folder / _FILE), critic=ride_critic.Agent.load(problem, folder))

    def _worth_behind(self, rides: Simulator) -> Floats:
        worth, running = self._earned(rides)
        if running.size:
            scenes, flights = rides.scenes.take(running), rides.flights.take(running)
            scenes.rows["length"] = self._task.scenario.slope_section.length_m
            worth[running] += self._critic.expected(self._task.observe(scenes, flights))
        return worth
