"""The scalar kernel in a plain compiled loop, one descent or flight after the other: what a batch kernel has to beat.

The one place in the benchmarks that looks below the public names of sledenv.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from sledenv import Body, ContactLaw, Slope, State
from sledenv.kernel.descend import descend, work_space
from sledenv.kernel.flight import (
    F_GRAVITY,
    F_HORIZON,
    F_OMEGA,
    F_PHI,
    F_TIME,
    F_V,
    F_Y,
    pack_of,
    touchdown_time,
    touchdown_times,
)
from sledenv.kernel.jit import allocating
from sledenv.kernel.laws import Law
from sledenv.kernel.params import Limits
from sledenv.kernel.records import OUTCOME, REBOUND, TRAJECTORY
from sledenv.kernel.trace import LANES
from sledenv.launches import touching_law


# The cache notices changes of the kernel, not of this loop.
@allocating
def _loop(
    body: Body,
    law: Law,
    slope: Slope,
    launches: np.ndarray,
    limits: Limits,
    log: np.ndarray,
    space: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    trajectory: np.ndarray,
    outcomes: np.ndarray,
) -> None:
    for i in range(launches.shape[0]):
        z = launches[i]
        launch = State(z[0], z[1], z[2], z[3], z[4], z[5])
        descend(body, law, slope, launch, limits, log, space, trajectory, outcomes[i])


def scalar_loop(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    states: ArrayLike,
    *,
    solver: Literal["compliant", "rigid"] = "compliant",
    max_rebounds: int = 1000,
    max_time: float = 60.0,
) -> Callable[[], np.ndarray]:
    """Return a function that simulates the launches, shape (N, 6), one by one, and returns their outcomes."""
    launches = np.array(states, dtype=float, ndmin=2)
    touching: Law = touching_law(body, law, slope, solver, None)
    limits = Limits(max_time=max_time)
    log, trajectory = np.zeros(max_rebounds, REBOUND), np.zeros(0, TRAJECTORY)
    outcomes = np.zeros(len(launches), OUTCOME)

    def run() -> np.ndarray:
        _loop(body, touching, slope, launches, limits, log, work_space(), trajectory, outcomes)
        return outcomes

    return run


@allocating
def _one_by_one(body: Body, gravity: float, launches: np.ndarray, times: np.ndarray) -> None:
    for i in range(launches.shape[0]):
        z = launches[i]
        times[i] = touchdown_time(body, gravity, z[1], z[2], z[4], z[5], np.inf)


@allocating
def _in_packs(body: Body, gravity: float, launches: np.ndarray, times: np.ndarray) -> None:
    pack = pack_of(body)
    pack[F_GRAVITY], pack[F_HORIZON] = gravity, np.inf
    for first in range(0, launches.shape[0], LANES):
        count = min(LANES, launches.shape[0] - first)
        for k in range(count):
            z = launches[first + k]
            pack[F_Y, k], pack[F_PHI, k], pack[F_V, k], pack[F_OMEGA, k] = z[1], z[2], z[4], z[5]
        touchdown_times(body, count, pack)
        for k in range(count):
            times[first + k] = pack[F_TIME, k]


def flight_loops(
    body: Body, slope: Slope, states: ArrayLike
) -> tuple[Callable[[], np.ndarray], Callable[[], np.ndarray]]:
    """Return functions that find the touchdowns [s] of launches, shape (N, 6): one by one, and in packs."""
    launches = np.array(states, dtype=float, ndmin=2)
    gravity = slope.gravity * math.cos(slope.angle)
    alone, packed = np.empty(len(launches)), np.empty(len(launches))

    def one_by_one() -> np.ndarray:
        _one_by_one(body, gravity, launches, alone)
        return alone

    def in_packs() -> np.ndarray:
        _in_packs(body, gravity, launches, packed)
        return packed

    return one_by_one, in_packs
