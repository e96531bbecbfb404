"""The scalar kernel in a plain compiled loop, one descent or flight after the other: what a batch kernel has to beat.

The one place in this folder that looks below the public names of sledenv.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from sledenv import Body, ContactLaw, Slope, State
from sledenv.compiler.entries import entry
from sledenv.compiler.trace import LANES
from sledenv.kernel.descend import SPACE, descend
from sledenv.kernel.flight import begin_search, search, tell_body, tell_place, touchdowns
from sledenv.kernel.laws import Law
from sledenv.kernel.records import OUTCOME, REBOUND, TRAJECTORY
from sledenv.kernel.state import new
from sledenv.simulation.checks import touching_law
from sledenv.simulation.settings import Limits


# The cache notices changes of the kernel, not of this loop.
@entry
def _loop(
    body: Body,
    law: Law,
    slope: Slope,
    launches: np.ndarray,
    limits: Limits,
    log: np.ndarray,
    spaces: np.ndarray,
    trajectory: np.ndarray,
    outcomes: np.ndarray,
) -> None:
    for i in range(launches.shape[0]):
        z = launches[i]
        launch = State(z[0], z[1], z[2], z[3], z[4], z[5])
        descend(body, law, slope, launch, limits, log, spaces, trajectory, outcomes[i : i + 1], False)


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
    limits = Limits(max_time=max_time, max_rebounds=max_rebounds)
    log, trajectory = np.zeros(max_rebounds, REBOUND), np.zeros(0, TRAJECTORY)
    outcomes = np.zeros(len(launches), OUTCOME)

    def run() -> np.ndarray:
        _loop(body, touching, slope, launches, limits, log, new(SPACE), trajectory, outcomes)
        return outcomes

    return run


@entry
def _one_by_one(body: Body, inward: float, launches: np.ndarray, times: np.ndarray, spaces: np.ndarray) -> None:
    at = spaces[0]["hop"]
    tell_body(body, at)
    at["inward"], at["horizon"] = inward, np.inf
    for i in range(launches.shape[0]):
        z = launches[i]
        at["y"], at["phi"], at["v"], at["omega"] = z[1], z[2], z[4], z[5]
        begin_search(body, at)
        search(body, np.inf, at)
        times[i] = at["touchdown"]


@entry
def _in_packs(body: Body, inward: float, launches: np.ndarray, times: np.ndarray, spaces: np.ndarray) -> None:
    pack, at = spaces[0]["pack"], spaces[0]["hop"]
    tell_body(body, at)
    for k in range(LANES):
        tell_place(at, pack, k)
    for first in range(0, launches.shape[0], LANES):
        count = min(LANES, launches.shape[0] - first)
        for k in range(count):
            z = launches[first + k]
            pack["y"][k], pack["phi"][k], pack["v"][k], pack["omega"][k] = z[1], z[2], z[4], z[5]
            pack["inward"][k], pack["horizon"][k] = inward, np.inf
        touchdowns(body, count, pack, at)
        for k in range(count):
            times[first + k] = pack["touchdown"][k]


def flight_loops(
    body: Body, slope: Slope, states: ArrayLike
) -> tuple[Callable[[], np.ndarray], Callable[[], np.ndarray]]:
    """Return functions that find the touchdowns [s] of launches, shape (N, 6): one by one, and in packs."""
    launches = np.array(states, dtype=float, ndmin=2)
    inward = slope.gravity * math.cos(slope.angle)
    spaces = new(SPACE)
    alone, packed = np.empty(len(launches)), np.empty(len(launches))

    def one_by_one() -> np.ndarray:
        _one_by_one(body, inward, launches, alone, spaces)
        return alone

    def in_packs() -> np.ndarray:
        _in_packs(body, inward, launches, packed, spaces)
        return packed

    return one_by_one, in_packs
