"""Descents over a profile, seen at fixed places: out of the log of each descent, which is simulated once."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sledenv.simulation.grounds import heights_on
from sledenv.simulation.jam import descent_jam
from sledenv.simulation.lanes import new_logs
from sledenv.simulation.records import FINISH
from sledenv.simulation.scene import State
from sledenv.simulation.scenes import Scenes
from sledenv.simulation.settings import Settings
from sledenv.simulation.support import within_a_turn
from sledenv.uncertainty.descents import Passages, follow

_LOGS: Final = 512  # descents whose logs are kept at a time
_AGAIN: Final = 4  # rebounds for a contact that is followed again

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Bools = NDArray[np.bool_]


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
    speed, kinetic, bounce, centre = np.moveaxis(seen, 2, 0)
    return Passages(outcomes, jam, speed, kinetic, bounce, centre, left)


def _seen(given: Scenes, stations: Floats, settings: Settings) -> tuple[np.ndarray, Floats, Bools]:
    """Return the outcomes of descents, what is told of them at stations, shape (N, K, 4), and who leaves backwards."""
    lengths = given.rows["length"]
    logs = new_logs(len(lengths), settings.max_rebounds)
    outcomes = follow(given, lengths, False, settings.limits, logs)
    logs = logs[:, : int(outcomes["rebounds"].max(initial=0))]
    flights = _Flights(given, outcomes, logs)
    lane, station = np.nonzero(np.full((len(lengths), len(stations)), True))
    place = flights.first_at(stations)[lane, station]  # in the path of each descent
    comes = place < flights.path.shape[1]
    lane, station, place = lane[comes], station[comes], place[comes]
    states = flights.at(lane, place, stations[station])
    kinetic = _kinetic(given, lane, states)
    contact = np.flatnonzero((place > 0) & (flights.feel_air | (place % 2 == 0)))
    again = _followed(given, flights, lane[contact], place[contact], stations[station[contact]], settings)
    states[contact] = np.column_stack([again[name] for name in State._fields])
    kinetic[contact] = again["kinetic"]
    missed = contact[again["status"] != FINISH]  # it turns back before
    x, y, phi, u, v, _ = states.T
    lowest = y - given.take(lane).resting_heights(x, within_a_turn(phi))
    ground = heights_on(given.pieces, x)
    seen = np.full((len(lengths), len(stations), 4), np.nan)
    seen[lane, station] = np.column_stack([np.hypot(u, v), kinetic, np.maximum(lowest, 0.0), y - ground])
    seen[lane[missed], station[missed]] = np.nan
    return outcomes, seen, flights.left_backwards


class _Flights:
    """How N descents fly: from their launches and from each separation on.

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


def _kinetic(given: Scenes, lane: Indices, states: Floats) -> Floats:
    some = given.take(lane)
    _, _, _, u, v, omega = states.T
    kinetic: Floats = 0.5 * (some.of_body("mass") * (u * u + v * v) + some.of_body("inertia") * omega * omega)
    return kinetic


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
