"""Descents seen at fixed distances along the slope: each is simulated up to every one of them that it comes to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.simulation.bodies import Body
from sledenv.simulation.jam import DescentJam, descent_jam
from sledenv.simulation.records import FINISH, OUTCOME
from sledenv.simulation.scene import Slope
from sledenv.simulation.settings import Settings
from sledenv.simulation.simulate import simulate_batch
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
    assert isinstance(lanes.slopes, np.ndarray)
    count = len(lanes.launches)
    outcomes = np.zeros(count, OUTCOME)
    speed, kinetic = np.full((2, count, len(stations)), np.nan)
    lengths = lanes.slopes[:, _LENGTH]
    going = np.arange(count)
    for k, station in enumerate(stations):
        if k == 0:
            _, _, _, u, v, omega = lanes.launches.T
            mass, inertia = _of_bodies(lanes.bodies, "mass"), _of_bodies(lanes.bodies, "inertia")
            speed[:, 0] = np.hypot(u, v)
            kinetic[:, 0] = 0.5 * (mass * (u * u + v * v) + inertia * omega * omega)
            continue
        outcomes[going] = _descend(lanes, going, np.minimum(lengths[going], station), replace(settings, run_out=0.0))
        going = going[outcomes["status"][going] == FINISH]
        there = going[lengths[going] >= station]
        speed[there, k] = np.hypot(outcomes["u"][there], outcomes["v"][there])
        kinetic[there, k] = outcomes["kinetic"][there]
        going = going[lengths[going] > station]
    if settings.run_out > 0.0:  # who has come to the line may still crash behind it
        going = np.flatnonzero((outcomes["status"] == FINISH) | np.isin(np.arange(count), going))
    outcomes[going] = _descend(lanes, going, lengths[going], settings)
    return Passages(outcomes, descent_jam(outcomes, _of_bodies(lanes.bodies, "mass"), lengths), speed, kinetic)


def _descend(lanes: Lanes, going: NDArray[np.intp], lengths: NDArray[np.float64], settings: Settings) -> np.ndarray:
    """Return the outcomes of some lanes, or of none, on slopes of given lengths [m]."""
    if not len(going):
        return np.zeros(0, OUTCOME)
    assert isinstance(lanes.slopes, np.ndarray)
    slopes = lanes.slopes[going]
    slopes[:, _LENGTH] = lengths
    bodies: Body | list[Body] | np.ndarray = lanes.bodies
    if isinstance(bodies, list):
        bodies = [bodies[i] for i in going]
    elif not isinstance(bodies, Body):
        bodies = bodies[going]
    return simulate_batch(bodies, lanes.laws[going], slopes, lanes.launches[going], settings).outcomes


def _of_bodies(bodies: Body | list[Body] | np.ndarray, field: str) -> Any:
    if isinstance(bodies, list):
        return np.array([getattr(body, field) for body in bodies])
    return getattr(bodies, field) if isinstance(bodies, Body) else bodies[field]
