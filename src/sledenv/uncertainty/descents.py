"""Descents seen at fixed distances along the slope: each is simulated up to every one of them that it comes to."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.simulation.checks import CheckedLanes, checked_lanes, limits_of
from sledenv.simulation.jam import DescentJam, descent_jam
from sledenv.simulation.lanes import ALL_HOPS, NO_LOGS, Tables, follow_all
from sledenv.simulation.records import FINISH, OUTCOME
from sledenv.simulation.scene import Slope
from sledenv.simulation.settings import Settings
from sledenv.simulation.simulate import put_at_launch
from sledenv.uncertainty.model import Lanes

PASSING: Final = ("speed_m_s", "kinetic_j", "bounce_m", "centre_m")
_LENGTH: Final = Slope._fields.index("length")


class Passages(NamedTuple):
    """N descents and how they pass K stations."""

    outcomes: np.ndarray  # of OUTCOME, shape (N,), those of the whole descents
    jam: DescentJam
    speed: NDArray[np.float64]  # [m/s] of the mass centre where it first comes to a station, NaN if never; shape (N, K)
    kinetic: NDArray[np.float64]  # [J] of translation and rotation there
    # Over a hillside alone: heights [m] over the ground, of the lowest point of the body and of the mass centre.
    bounce: NDArray[np.float64] | None = None
    centre: NDArray[np.float64] | None = None

    @property
    def columns(self) -> dict[str, NDArray[np.float64]]:
        """What is told of each passage, by the name of its column."""
        return {name: one for name, one in zip(PASSING, self[2:], strict=True) if one is not None}


def descend_past(lanes: Lanes, stations: NDArray[np.float64], settings: Settings) -> Passages:
    """Simulate descents, and tell speed and energy where they first come to stations.

    On a slope that ends at a station the very same descent finishes there, exactly, be it in flight or in contact. So
    each goes on to the next station from its launch, as long as it finishes; the last time on its own slope.

    Parameters
    ----------
    lanes : Lanes
        Of N descents.
    stations : ndarray, shape (K,)
        Distances [m], rising from 0, where all descents begin.
    settings : Settings
        How they are simulated.
    """
    given, lengths = checked_ahead(lanes, settings)
    count, tables = len(lengths), given.tables(limits_of(lanes.bodies, settings))
    to_stations = tables._replace(limits=tables.limits._replace(run_out=0.0))
    outcomes = np.zeros(count, OUTCOME)
    speed, kinetic = np.full((2, count, len(stations)), np.nan)
    mass, inertia = given.bodies["mass"], given.bodies["inertia"]
    _, _, _, u, v, omega = given.launches.T
    speed[:, 0] = np.hypot(u, v)
    kinetic[:, 0] = 0.5 * (mass * (u * u + v * v) + inertia * omega * omega)
    going = np.arange(count)
    for k, station in enumerate(stations[1:], 1):
        outcomes[going] = follow(to_stations.part(going), np.minimum(lengths[going], station))
        going = going[outcomes["status"][going] == FINISH]
        there = going[lengths[going] >= station]
        speed[there, k] = np.hypot(outcomes["u"][there], outcomes["v"][there])
        kinetic[there, k] = outcomes["kinetic"][there]
        going = going[lengths[going] > station]
    if settings.run_out > 0.0:  # who has come to the line may still crash behind it
        going = np.flatnonzero((outcomes["status"] == FINISH) | np.isin(np.arange(count), going))
    outcomes[going] = follow(tables.part(going), lengths[going])
    return Passages(outcomes, descent_jam(outcomes, mass, lengths), speed, kinetic)


def checked_ahead(lanes: Lanes, settings: Settings) -> tuple[CheckedLanes, NDArray[np.float64]]:
    """Return lanes, checked, on slopes that go on for ever, and where theirs end [m]: see :func:`follow`."""
    lengths, rows = lanes.slopes.rows[:, _LENGTH].copy(), lanes.slopes.rows.copy()
    rows[:, _LENGTH] = np.inf  # a place may be where the ground is not level
    slopes = lanes.slopes._replace(rows=rows)
    return checked_lanes(lanes.bodies, lanes.laws, slopes, lanes.launches, settings), lengths


def follow(tables: Tables, lengths: NDArray[np.float64], logs: np.ndarray = NO_LOGS) -> np.ndarray:
    """Return the outcomes of descents, or of none, that end at places [m], whatever the ground is there."""
    outcomes = np.zeros(len(lengths), OUTCOME)
    if len(lengths):
        slopes = np.repeat(tables.slopes, len(lengths) // len(tables.slopes), axis=0)
        slopes[:, _LENGTH] = lengths
        put_at_launch(outcomes, tables.launches)
        follow_all(tables._replace(slopes=slopes), ALL_HOPS, outcomes, logs)
    return outcomes
