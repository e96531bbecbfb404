"""Descents seen at fixed places along the slope: over the plane and bumps, or over a hillside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.simulation.bodies import Body
from sledenv.simulation.checks import limits_of
from sledenv.simulation.grounds import heights_on
from sledenv.simulation.jam import DescentJam, descent_jam
from sledenv.simulation.lanes import NO_LOGS, new_logs
from sledenv.simulation.records import FINISH, OUTCOME, params
from sledenv.simulation.scene import State
from sledenv.simulation.scenes import Scenes
from sledenv.simulation.settings import Settings
from sledenv.simulation.simulator import Simulator
from sledenv.simulation.support import within_a_turn

PASSING: Final = ("speed_m_s", "kinetic_j", "bounce_m", "centre_m")
_LOGS: Final = 512  # descents whose logs are kept at a time
_AGAIN: Final = 4  # rebounds for a contact that is followed again

Limits = params.Limits
Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Bools = NDArray[np.bool_]


class Passages(NamedTuple):
    """N descents and how they first come to K places."""

    outcomes: np.ndarray  # of OUTCOME, shape (N,), those of the whole descents
    jam: DescentJam
    # Columns as in PASSING, NaN if never there, shape (N, K, 2): speed of the mass centre, energy of translation and
    # rotation. Over a hillside (N, K, 4): heights over the ground, of the lowest point of the body and the mass centre.
    seen: Floats
    left_backwards: Bools  # whether a descent leaves a hillside behind its start, shape (N,)

    @property
    def columns(self) -> dict[str, Floats]:
        """Values by the name of their column, shape (N, K)."""
        return {name: self.seen[:, :, k] for k, name in enumerate(PASSING[: self.seen.shape[2]])}


def descend_past(scenes: Scenes, stations: Floats, settings: Settings, bodies: Sequence[Body] = ()) -> Passages:
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
    outcomes, seen = np.zeros(count, OUTCOME), np.full((count, len(stations), 2), np.nan)
    seen[:, 0] = _energetic(scenes, scenes.launches)
    rigid, to_stations = settings.solver == "rigid", limits._replace(run_out=0.0)
    going = np.arange(count)
    for k, station in enumerate(stations[1:], 1):
        outcomes[going] = follow(scenes.take(going), np.minimum(lengths[going], station), rigid, to_stations)
        going = going[outcomes["status"][going] == FINISH]
        there = going[lengths[going] >= station]
        seen[there, k] = np.stack([np.hypot(outcomes["u"], outcomes["v"]), outcomes["kinetic"]], axis=-1)[there]
        going = going[lengths[going] > station]
    if settings.run_out > 0.0:  # who has come to the finish may still fall behind it
        going = np.flatnonzero((outcomes["status"] == FINISH) | np.isin(np.arange(count), going))
    outcomes[going] = follow(scenes.take(going), lengths[going], rigid, limits)
    jam = descent_jam(outcomes, scenes.of_body("mass"), lengths)
    return Passages(outcomes, jam, seen, np.zeros(count, np.bool_))


def follow(scenes: Scenes, lengths: Floats, rigid: bool, limits: Limits, logs: np.ndarray = NO_LOGS) -> np.ndarray:
    """Return the outcomes of descents, or of none, that end at places [m], whatever the ground is there."""
    rows = scenes.own_rows()
    rows["length"] = lengths
    simulator = Simulator(scenes._replace(rows=rows), rigid, limits, logs, np.zeros(len(lengths), OUTCOME))
    simulator.run()
    return simulator.flights


def _energetic(scenes: Scenes, states: Floats) -> Floats:
    """Return speed [m/s] and kinetic energy [J] of states, shape (N, 2)."""
    _, _, _, u, v, omega = states.T
    kinetic = 0.5 * (scenes.of_body("mass") * (u * u + v * v) + scenes.of_body("inertia") * omega * omega)
    return np.column_stack([np.hypot(u, v), kinetic])


def descend_over(scenes: Scenes, stations: Floats, settings: Settings) -> Passages:
    """Simulate descents over one profile, and tell how they first come to places along it.

    In flight everything follows from the separation before. A contact in which a descent comes to a place is followed
    once more, from the separation before, on a slope that ends there; so is a flight in air. Where a body swings over a
    place and back in one contact it has not come there. A mass centre behind x = 0 has left the section backwards, for
    good.

    Parameters
    ----------
    scenes : Scenes
        Of N descents over a slope whose plane is level, so that x is horizontal and y vertical.
    stations : ndarray, shape (K,)
        Places x [m], rising; a descent that begins behind one comes to it where it begins.
    settings : Settings
        How they are simulated.
    """
    parts = [slice(first, first + _LOGS) for first in range(0, len(scenes.rows), _LOGS)]
    found = [_seen(scenes.take(part), stations, settings) for part in parts]
    outcomes, seen, left = (np.concatenate(each) for each in zip(*found, strict=True))
    jam = descent_jam(outcomes, scenes.of_body("mass"), scenes.rows["length"])
    return Passages(outcomes, jam, seen, left)


def _seen(given: Scenes, stations: Floats, settings: Settings) -> tuple[np.ndarray, Floats, Bools]:
    """Return the outcomes of descents, what is told of them at stations, and who leaves backwards."""
    lengths = given.rows["length"]
    logs = new_logs(len(lengths), settings.max_rebounds)
    outcomes = follow(given, lengths, False, settings.limits, logs)
    flights = _Flights(given, outcomes, logs[:, : int(outcomes["rebounds"].max(initial=0))])
    places = flights.first_at(stations)  # in the path of each descent
    lane, station = np.nonzero(places < flights.path.shape[1])
    place = places[lane, station]
    states = flights.at(lane, place, stations[station])
    passing = _energetic(given.take(lane), states)
    contact = np.flatnonzero((place > 0) & (flights.feel_air | (place % 2 == 0)))
    again = _followed(given, flights, lane[contact], place[contact], stations[station[contact]], settings)
    states[contact] = np.column_stack([again[name] for name in State._fields])
    passing[contact] = np.column_stack([np.hypot(again["u"], again["v"]), again["kinetic"]])
    missed = contact[again["status"] != FINISH]  # it turns back before
    x, y, phi, *_ = states.T
    lowest = y - given.take(lane).resting_heights(x, within_a_turn(phi))
    seen = np.full((len(lengths), len(stations), len(PASSING)), np.nan)
    seen[lane, station] = np.column_stack([passing, np.maximum(lowest, 0.0), y - heights_on(given.pieces, x)])
    seen[lane[missed], station[missed]] = np.nan
    return outcomes, seen, flights.left_backwards


class _Flights:
    """Flights of N descents: from their launches and from each separation on.

    Their path, shape (N, 2 R + 2), holds the places x [m] where each flight begins and ends, up to the descent's end.
    One that has come behind x = 0, where the section begins, has left it: it comes to no place from there on. Where
    bodies feel the air, a flight ends for it where the contact behind it does.
    """

    def __init__(self, given: Scenes, outcomes: np.ndarray, logs: np.ndarray) -> None:
        self.given, self.outcomes, self.logs = given, outcomes, logs
        self.gravity = given.rows["gravity"]
        self.feel_air = bool((given.rows["air_density"] * given.of_body("drag_area")).any())
        count, most = logs.shape
        flown = np.arange(most) < outcomes["rebounds"][:, np.newaxis]
        x, t, u = (np.empty((count, most + 1)) for _ in range(3))
        x[:, 0], t[:, 0], u[:, 0] = given.launches[:, 0], 0.0, given.launches[:, 3]
        x[:, 1:], t[:, 1:], u[:, 1:] = logs["x"], logs["t"], logs["u_after"]
        self.path = np.repeat(outcomes["x"][:, np.newaxis], 2 * most + 2, axis=1)
        self.path[:, 0] = x[:, 0]
        self.path[:, 2::2][flown] = x[:, 1:][flown]
        landing = x[:, 1:] if self.feel_air else x[:, :-1] + u[:, :-1] * (logs["t_touchdown"] - t[:, :-1])
        self.path[:, 1:-1:2][flown] = landing[flown]
        gone = np.logical_or.accumulate(self.path < 0.0, axis=1)
        self.left_backwards = gone[:, -1]
        self.path[gone] = -np.inf

    def first_at(self, stations: Floats) -> Indices:
        """Return which entry of each path is the first one at or beyond stations, shape (N, K); its length if none."""
        furthest = np.maximum.accumulate(self.path, axis=1)
        places = [np.searchsorted(row, stations) for row in furthest]
        return np.array(places, np.intp).reshape(len(furthest), len(stations))

    def starts(self, lane: Indices, flight: Indices) -> Floats:
        """Return the states in which flights begin, shape (M, 6): those of the launch, or of the separation before.

        Logs have no height. It is told from where the flight ends: where the body touches the ground, or where the
        descent ends. With air it is that at which the body touches the ground where it begins.
        """
        states = self.given.launches[lane].copy()
        later = np.flatnonzero(flight > 0)
        lane, flight = lane[later], flight[later]
        rows, end = self.logs[lane, flight - 1], self.outcomes[lane]
        x, phi, u, v, omega = (rows[name] for name in ("x", "phi", "u_after", "v_after", "omega_after"))
        lands = flight < end["rebounds"]
        landing = self.logs["t_touchdown"][lane, np.minimum(flight, self.logs.shape[1] - 1)]
        time = np.where(lands, landing, end["t"]) - rows["t"]
        turned = within_a_turn(phi + omega * time)
        lowest = self.given.take(lane).resting_heights(x + u * time, turned)
        y = np.where(lands, lowest, end["y"]) - (v - 0.5 * self.gravity[lane] * time) * time
        if self.feel_air:
            y = self.given.take(lane).resting_heights(x, within_a_turn(phi))
        states[later] = np.column_stack([x, y, phi, u, v, omega])
        return states

    def at(self, lane: Indices, place: Indices, x: Floats) -> Floats:
        """Return states at places x [m] that are come to in flight, shape (M, 6); without meaning for others."""
        states = self.starts(lane, (place - np.minimum(place, 1)) // 2)
        gravity = self.gravity[lane]
        with np.errstate(divide="ignore", invalid="ignore"):
            time = np.where(place > 0, (x - states[:, 0]) / states[:, 3], 0.0)
        time = np.where(place % 2 == 1, time, 0.0)
        states[:, :3] += states[:, 3:] * time[:, np.newaxis]
        states[:, 1] -= 0.5 * gravity * time * time
        states[:, 4] -= gravity * time
        return states


def _followed(
    given: Scenes, flights: _Flights, lane: Indices, place: Indices, x: Floats, settings: Settings
) -> np.ndarray:
    """Return outcomes, shape (M,), of descents that come to places x [m], simulated again up to there."""
    some, before = given.take(lane), given.take(lane)
    before.launches[:] = flights.starts(lane, (place - 1) // 2)
    outcomes = follow(before, x, False, replace(settings, max_rebounds=_AGAIN).limits)
    missed = np.flatnonzero(outcomes["status"] != FINISH)  # by rounding: the very same descent cannot
    outcomes[missed] = follow(some.take(missed), x[missed], False, settings.limits)
    return outcomes
