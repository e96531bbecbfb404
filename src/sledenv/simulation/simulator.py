"""The one way in which descents are followed: scenes, where each of them stands, and what moves them on."""

from __future__ import annotations

import copy
from typing import Final, Self

import numpy as np

from sledenv.kernel.batch import FLY, STAY, WAIT
from sledenv.kernel.entries import run_embark
from sledenv.kernel.params import Limits
from sledenv.simulation.jam import DescentJam, descent_jam
from sledenv.simulation.lanes import ALL_HOPS, NO_LOGS, NO_ROWS, follow_all
from sledenv.simulation.outcomes import DescentBatch
from sledenv.simulation.records import OUTCOME, REBOUND
from sledenv.simulation.scenes import Lanes, Scenes

ALL: Final = slice(None)
# Records to be copied whole: by their fields that takes ten times as long.
WHOLE: Final = np.dtype(f"V{OUTCOME.itemsize}")
_WHOLE_LOGGED: Final = np.dtype(f"V{REBOUND.itemsize}")


class Simulator:
    """Descents under way, one per lane; no lane depends on another.

    Parameters
    ----------
    scenes : Scenes
        What they are given, checked.
    rigid : bool
        Whether surfaces are rigid.
    limits : Limits
    rebounds : ndarray of REBOUND, shape (N, most) or (0, 0)
        Empty logs, or none.
    flights : ndarray of OUTCOME, shape (N,), optional
        Where descents stand that are under way; at their launches by default, where those of zeros are put too.

    Attributes
    ----------
    scenes : Scenes
    flights : ndarray of OUTCOME, shape (N,)
        All that moves: state, ledger and status of each descent. An array that has been handed out never changes.
    """

    def __init__(
        self,
        scenes: Scenes,
        rigid: bool,
        limits: Limits,
        rebounds: np.ndarray = NO_LOGS,
        flights: np.ndarray | None = None,
    ) -> None:
        self.scenes, self.rigid, self.limits, self.rebounds = scenes, rigid, limits, rebounds
        self.flights = at_launch(scenes) if flights is None else flights

    def launch(self, lanes: Lanes, scenes: Scenes) -> None:
        """Begin new descents in some lanes, no two alike."""
        self.scenes = self.scenes.put(lanes, scenes)
        self.flights = copied(self.flights)
        self.flights.view(WHOLE)[lanes] = at_launch(scenes).view(WHOLE)
        if self.rebounds.size:
            self.rebounds.view(_WHOLE_LOGGED)[lanes] = np.zeros((), _WHOLE_LOGGED)

    def hop(self, spins: np.ndarray, trajectory: np.ndarray = NO_ROWS) -> None:
        """Follow one hop in every lane that has not ended, in which riders lend spins [rad/s], shape (N,)."""
        self._follow(np.stack([spins, np.full(len(spins), float(FLY))], axis=-1), trajectory)

    def wait(self, lanes: Lanes | slice = ALL, trajectory: np.ndarray = NO_ROWS) -> None:
        """Go on to where a flight begins that is not too short, in lanes whose first flight may be."""
        trims = np.full((len(self.flights), 2), float(STAY))
        trims[lanes, 1] = WAIT
        self._follow(trims, trajectory)

    def run(self, trajectory: np.ndarray = NO_ROWS) -> None:
        """Follow all descents to their ends."""
        self._follow(ALL_HOPS, trajectory)

    def _follow(self, trims: np.ndarray, trajectory: np.ndarray) -> None:
        flights = copied(self.flights)  # nothing but logs is changed until it is done: an interrupt may come
        follow_all(self.rigid, self.limits, self.scenes, trims, flights, self.rebounds, trajectory)
        self.flights = flights

    def take(self, lanes: Lanes) -> Self:
        """Return independent descents that stand where some of these stand; a lane may be taken many times."""
        self.scenes = self.scenes.take(ALL)  # which from now on shares its pools
        taken = copy.copy(self)
        taken.scenes, taken.flights = self.scenes.take(lanes), self.flights.take(lanes)
        taken.rebounds = self.rebounds.take(lanes, axis=0) if self.rebounds.size else self.rebounds
        return taken

    def jam(self, lanes: Lanes | None = None) -> DescentJam:
        """Return the jam metrics of the descents so far, those of all lanes or of some."""
        scenes, flights = self.scenes, self.flights
        if lanes is not None:
            scenes, flights = scenes.take(lanes), flights.take(lanes)
        return descent_jam(flights, scenes.of_body("mass"), scenes.rows["length"])

    def descents(self, lanes: Lanes | None = None) -> DescentBatch:
        """Return the descents so far, those of all lanes or of some; later hops do not change them."""
        flights, rebounds = self.flights if lanes is None else self.flights.take(lanes), self.rebounds
        if rebounds.size:
            most = int(flights["rebounds"].max(initial=0))
            logs = rebounds.view(_WHOLE_LOGGED)[:, :most]
            rebounds = (logs.copy() if lanes is None else logs[lanes]).view(REBOUND)
        return DescentBatch(flights, rebounds, self.jam(lanes))


def copied(flights: np.ndarray) -> np.ndarray:
    """Return a copy of an array of OUTCOME."""
    copy: np.ndarray = flights.view(WHOLE).copy().view(OUTCOME)
    return copy


def at_launch(scenes: Scenes) -> np.ndarray:
    """Return descents at their launches, an array of OUTCOME, shape (N,)."""
    flights = np.zeros(len(scenes.rows), OUTCOME)  # of status RUNNING: nothing touched, nothing lost
    run_embark(*scenes.given, flights)
    return flights
