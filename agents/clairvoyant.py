"""Rides of somebody who knows the errors: a plan of trims for each, improved flight by flight in the exact model."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem, checked_draws
from sledenv.envs.inputs import Contexts
from sledenv.simulation.outcomes import DescentBatch
from sledenv.simulation.records import RUNNING
from sledenv.simulation.rules import checked_count, checked_kind
from sledenv.simulation.simulator import Simulator

Floats = NDArray[np.float64]

SHOTS: Final = 256  # rides with random trims, the best of which begins a search
BRANCHES: Final = 64  # ways in which a ride is followed on at each flight
WIDTHS: Final = (0.5, 0.5, 0.3, 0.1, 0.1, 0.03)  # of the changes of trims, one sweep after the other
SEARCHES: Final = 2
LONGEST: Final = 64  # trims of a plan; in the flights behind them there are none


def best_rides(problem: Problem, scenes: Contexts, searches: int = SEARCHES) -> pd.DataFrame:
    """Search the best ride in each of scenes of shape (n, 12) or (n, 14), all of whose draws are known.

    It is an estimate from below of what somebody earns who knows the errors of the rider beforehand, on which no agent
    can count.

    Returns
    -------
    DataFrame
        One row per scene: ``action_0``, ... of the best plan found, the trims of one flight after the other in [-1, 1],
        NaN behind the last; its ``reward``; ``apart``, how far the best search is above the worst.

    Notes
    -----
    A search begins with the best of 256 rides with random trims. It rides that plan, and at each flight follows the
    ride on in 64 ways: with fresh trims from here on, with another trim here and the plan behind it, and with changes
    of all trims from here on. The best takes the place of the plan. Six such sweeps, with ever smaller changes, make a
    search. What is random is the same in all scenes, so that what is found in one does not depend on the others.

    Raises
    ------
    TypeError, ValueError
        If it is no problem or none of rides, or for wrong scenes or a wrong number of searches.
    """
    checked_kind("problem", problem, Problem).must_be("descent", "the best rides")
    scenes, searches = checked_draws("scenes", scenes), checked_count("searches", searches)
    count = len(scenes)
    found = []
    for number in range(searches):
        plans, rewards = _shoot(problem, scenes, number)
        for sweep, width in enumerate(WIDTHS):
            _sweep(problem, scenes, plans, rewards, width, (number, sweep))
        found.append((plans, rewards))
    earned = np.array([rewards for _, rewards in found])
    best = np.array([plans for plans, _ in found])[earned.argmax(axis=0), np.arange(count)]
    flights = _finish(problem, _begin(problem, scenes), best)[1]
    best[np.arange(LONGEST) >= flights[:, np.newaxis]] = np.nan
    named = {f"action_{i}": trims for i, trims in enumerate(best.T[: max(int(flights.max(initial=0)), 1)])}
    return pd.DataFrame(named | {"reward": earned.max(axis=0), "apart": np.ptp(earned, axis=0)})


def follow_plans(problem: Problem, scenes: Contexts, plans: Floats) -> DescentBatch:
    """Return the rides of plans of shape (n, k), NaN behind the last trim, in scenes of shape (n, 12) or (n, 14)."""
    whole = np.zeros((len(plans), LONGEST))
    whole[:, : plans.shape[1]] = np.nan_to_num(plans)
    return _finish(problem, _begin(problem, scenes), whole)[0]


def _shoot(problem: Problem, scenes: Contexts, number: int) -> tuple[Floats, Floats]:
    """Return the best of plans of random trims, the first of which has none, and their rewards."""
    lanes = np.repeat(np.arange(len(scenes)), SHOTS)
    shots = np.random.default_rng(number).uniform(-1.0, 1.0, (SHOTS, LONGEST))
    shots[0] = 0.0
    plans = np.tile(shots, (len(scenes), 1, 1))
    rides = _begin(problem, scenes).take(lanes)
    earned = _finish(problem, rides, plans.reshape(-1, LONGEST))[0].jam.reward.reshape(-1, SHOTS)
    return _best(plans, earned), earned.max(axis=1)


def _sweep(
    problem: Problem, scenes: Contexts, plans: Floats, rewards: Floats, width: float, seed: tuple[int, int]
) -> None:
    """Improve plans of shape (n, LONGEST), and their rewards, at one flight after the other."""
    rides, kind = _begin(problem, scenes), np.arange(BRANCHES) % 3
    for flight in range(LONGEST):
        moving = np.flatnonzero(rides.flights["status"] == RUNNING)
        if not moving.size:
            return
        tried = np.repeat(plans[moving, np.newaxis], BRANCHES, axis=1)
        behind = tried[..., flight:]  # a view
        rng = np.random.default_rng([*seed, flight])
        fresh = rng.uniform(-1.0, 1.0, behind.shape[1:])
        changed = np.clip(behind + width * rng.standard_normal(behind.shape[1:]), -1.0, 1.0)
        behind[:, kind == 0] = fresh[kind == 0]
        behind[:, kind == 1, 0] = fresh[kind == 1, 0]
        behind[:, kind == 2] = changed[:, kind == 2]
        tried[:, 0] = plans[moving]  # the first of equal ones stays
        lanes = np.repeat(moving, BRANCHES)
        batch, _ = _finish(problem, rides.take(lanes), tried.reshape(-1, LONGEST), flight)
        earned = batch.jam.reward.reshape(len(moving), BRANCHES)
        plans[moving], rewards[moving] = _best(tried, earned), earned.max(axis=1)
        rides.hop(problem.task.spins(rides.scenes, plans[:, [flight]], np.full(len(scenes), flight)))


def _begin(problem: Problem, scenes: Contexts) -> Simulator:
    """Return rides at their first decisions."""
    return problem.task.rides(problem.task.scenes(scenes))


def _finish(
    problem: Problem, rides: Simulator, plans: Floats, flight: int = 0
) -> tuple[DescentBatch, NDArray[np.int64]]:
    """Follow rides on to their ends with the trims of plans from a flight on; return how many flights they had."""
    flights = np.full(len(plans), flight)
    while (moving := rides.flights["status"] == RUNNING).any():
        trims = plans[:, [flight]] if flight < LONGEST else np.zeros((len(plans), 1))
        rides.hop(problem.task.spins(rides.scenes, trims, flights))
        flights, flight = flights + moving, flight + 1
    return rides.descents(), flights


def _best(plans: Floats, earned: Floats) -> Floats:
    """Return of plans of shape (n, m, k) those that earn most."""
    return np.take_along_axis(plans, earned.argmax(axis=1)[:, np.newaxis, np.newaxis], axis=1)[:, 0]
