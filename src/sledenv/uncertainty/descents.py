"""Descents seen at fixed distances along the slope: each is simulated up to every one of them that it comes to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.simulation.bodies import Body
from sledenv.simulation.checks import limits_of
from sledenv.simulation.jam import DescentJam, descent_jam
from sledenv.simulation.lanes import NO_LOGS
from sledenv.simulation.records import FINISH, OUTCOME, params
from sledenv.simulation.scenes import Scenes
from sledenv.simulation.settings import Settings
from sledenv.simulation.simulator import Simulator

Limits = params.Limits
PASSING: Final = ("speed_m_s", "kinetic_j", "bounce_m", "centre_m")


class Passages(NamedTuple):
    """N descents and how they pass K stations."""

    outcomes: np.ndarray  # of OUTCOME, shape (N,), those of the whole descents
    jam: DescentJam
    speed: NDArray[np.float64]  # [m/s] of the mass centre where it first comes to a station, NaN if never; shape (N, K)
    kinetic: NDArray[np.float64]  # [J] of translation and rotation there
    # Over a hillside alone: heights [m] over the ground, of the lowest point of the body and of the mass centre.
    bounce: NDArray[np.float64] | None = None
    centre: NDArray[np.float64] | None = None
    left_backwards: NDArray[np.bool_] | None = None  # whether a descent leaves the section behind its start, shape (N,)

    @property
    def columns(self) -> dict[str, NDArray[np.float64]]:
        """What is told of each passage, by the name of its column."""
        return {name: one for name, one in zip(PASSING, self[2:6], strict=True) if one is not None}


def descend_past(
    scenes: Scenes, stations: NDArray[np.float64], settings: Settings, bodies: Sequence[Body] = ()
) -> Passages:
    """Simulate descents, and tell speed and energy where they first come to stations.

    On a slope that ends at a station the very same descent finishes there, exactly, be it in flight or in contact. So
    each goes on to the next station from its launch, as long as it finishes; the last time on its own slope.

    Parameters
    ----------
    scenes : Scenes
        Of N descents.
    stations : ndarray, shape (K,)
        Distances [m], rising from 0, where all descents begin.
    settings : Settings
        How they are simulated.
    bodies : sequence of Body
        Whose parts settings may name.
    """
    lengths, limits = scenes.rows["length"], limits_of(list(bodies), settings)
    count = len(lengths)
    outcomes = np.zeros(count, OUTCOME)
    speed, kinetic = np.full((2, count, len(stations)), np.nan)
    mass, inertia = scenes.of_body("mass"), scenes.of_body("inertia")
    _, _, _, u, v, omega = scenes.launches.T
    speed[:, 0] = np.hypot(u, v)
    kinetic[:, 0] = 0.5 * (mass * (u * u + v * v) + inertia * omega * omega)
    rigid, to_stations = settings.solver == "rigid", limits._replace(run_out=0.0)
    going = np.arange(count)
    for k, station in enumerate(stations[1:], 1):
        outcomes[going] = follow(scenes.take(going), np.minimum(lengths[going], station), rigid, to_stations)
        going = going[outcomes["status"][going] == FINISH]
        there = going[lengths[going] >= station]
        speed[there, k] = np.hypot(outcomes["u"][there], outcomes["v"][there])
        kinetic[there, k] = outcomes["kinetic"][there]
        going = going[lengths[going] > station]
    if settings.run_out > 0.0:  # who has come to the line may still crash behind it
        going = np.flatnonzero((outcomes["status"] == FINISH) | np.isin(np.arange(count), going))
    outcomes[going] = follow(scenes.take(going), lengths[going], rigid, limits)
    return Passages(outcomes, descent_jam(outcomes, mass, lengths), speed, kinetic)


def follow(
    scenes: Scenes, lengths: NDArray[np.float64], rigid: bool, limits: Limits, logs: np.ndarray = NO_LOGS
) -> np.ndarray:
    """Return the outcomes of descents, or of none, that end at places [m], whatever the ground is there."""
    rows = scenes.own_rows()
    rows["length"] = lengths
    simulator = Simulator(scenes._replace(rows=rows), rigid, limits, logs, np.zeros(len(lengths), OUTCOME))
    simulator.run()
    return simulator.flights
