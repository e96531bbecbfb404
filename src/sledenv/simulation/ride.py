"""Descents that are followed hop by hop, one or a batch of them."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from sledenv.kernel import params
from sledenv.kernel.entries import run_trim
from sledenv.simulation.bodies import Body
from sledenv.simulation.checks import Bodies, Laws, Slopes, checked_descent, checked_scenes, limits_of
from sledenv.simulation.lanes import NO_LOGS, NO_ROWS, new_log, new_logs, new_trajectory
from sledenv.simulation.outcomes import RECORDS, Descent, DescentBatch, Record, descent_of, state_of
from sledenv.simulation.records import FLIGHT_LOSSES, STATUS_OF_CODE, TRAJECTORY, Status
from sledenv.simulation.rules import (
    FINITE,
    NOT_NEGATIVE,
    POSITIVE,
    checked,
    checked_array,
    checked_choice,
    checked_flag,
    checked_table,
)
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.scenes import Scenes
from sledenv.simulation.settings import Settings, checked_settings
from sledenv.simulation.simulate import FIRST_TRAJECTORY
from sledenv.simulation.simulator import Simulator, copied


class Ride:
    """A descent that is followed hop by hop: it can be trimmed at every rebound, and go on in more than one way.

    A ride that is never trimmed ends with the very :class:`sledenv.simulation.Descent` that
    :func:`sledenv.simulate` returns, bit for bit. It can be copied (:meth:`copy`) and pickled at any rebound; the
    copies go on independently and identically.

    Parameters
    ----------
    body, law, slope, launch, record
        As for :func:`sledenv.simulate`.
    settings : Settings, optional
        How it is simulated; the default ones otherwise.
    rotor_inertia : float, optional
        Moment of inertia of the rider's rotor [kg m^2], > 0; without it there is no :meth:`trim`.
    shortest_flight : float
        A hop goes on through flights that are shorter than this [s], >= 0, such as those between nose and tail in a
        landing; 0 by default.

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range.
    """

    def __init__(
        self,
        body: Body,
        law: ContactLaw,
        slope: Slope,
        launch: State,
        settings: Settings | None = None,
        *,
        record: Record = "rebounds",
        rotor_inertia: float | None = None,
        shortest_flight: float = 0.0,
    ) -> None:
        checked_choice("record", record, RECORDS)
        settings = checked_settings(settings)
        self.body, self.law, self.slope, self.launch, scenes = checked_descent(body, law, slope, launch, settings)
        self.settings = settings
        self.rotor_inertia, shortest = _checked_rider("Ride", rotor_inertia, shortest_flight)
        scenes.rows["rotor_inertia"] = self.rotor_inertia or 1.0
        limits = limits_of(self.body, settings)._replace(shortest_flight=shortest)
        log = new_log(settings.max_rebounds)[np.newaxis]
        self._lane = Simulator(scenes, settings.solver == "rigid", limits, log)
        self._trajectory = np.zeros(FIRST_TRAJECTORY, TRAJECTORY) if record == "trajectory" else NO_ROWS

    @property
    def _flight(self) -> np.ndarray:
        """Where the descent is, shape (1,) of OUTCOME."""
        return self._lane.flights

    @property
    def status(self) -> Status:
        """Why the descent has ended; "running" until then."""
        return STATUS_OF_CODE[int(self._flight[0]["status"])]

    @property
    def time(self) -> float:
        """Time [s] since the launch."""
        return float(self._flight[0]["t"])

    @property
    def state(self) -> State:
        """Where the body is: at the launch, at a rebound or at the end."""
        return state_of(self._flight[0])

    @property
    def trim_spin(self) -> float:
        """Spin [rad/s] that the rider's rotor lends to the body."""
        return float(self._flight[0]["trim_spin"])

    def trim(self, spin: float) -> None:
        """Let the rider's rotor lend ``spin`` [rad/s] to the body from here on: docs/physics.md, section 9.

        Raises
        ------
        RuntimeError
            If the descent has ended or the ride has no rotor.
        TypeError, ValueError
            If ``spin`` is not a finite number.
        """
        self._check_running()
        if self.rotor_inertia is None:
            raise RuntimeError("the ride has no rotor to trim with: give it a rotor_inertia")
        lent = checked("Ride.trim", "spin", spin, FINITE)
        flight = copied(self._flight)
        run_trim(*self._lane.scenes.given, lent, flight)
        self._lane.flights = flight

    def hop(self) -> Status:
        """Follow one hop, to the next rebound or to the end of the descent, and return the status.

        If flights may be too short, it goes on to a rebound behind which one begins that is not.

        Raises
        ------
        RuntimeError
            If the descent has ended.
        """
        return self._follow(lambda rows: self._lane.hop(self._flight["trim_spin"], rows))

    def await_flight(self) -> Status:
        """Go on to where a flight begins that is not too short, if not even the first one is; return the status.

        Raises
        ------
        RuntimeError
            If the descent has ended.
        """
        return self._follow(lambda rows: self._lane.wait(trajectory=rows))

    def _follow(self, move: Callable[[np.ndarray], None]) -> Status:
        """Move on, once more where there was not room for all rows of the trajectory."""
        self._check_running()
        before = self._flight
        move(self._trajectory)
        if len(self._trajectory) < (rows := int(self._flight["samples"][0])):
            written = int(before["samples"][0])
            longer = new_trajectory(2 * rows, self.settings.sample_interval)
            longer[:written] = self._trajectory[:written]
            self._trajectory, self._lane.flights = longer, before
            move(longer)
        return self.status

    def run(self) -> Descent:
        """Follow the descent to its end and return it."""
        while self.status == Status.RUNNING:
            self.hop()
        return self.descent()

    def descent(self) -> Descent:
        """Return the descent so far, of status "running" until it has ended; later hops do not change it."""
        outcome = copied(self._flight)[0]
        trajectory = self._trajectory[: outcome["samples"]]
        if self.status == Status.RUNNING and len(self._trajectory) > 0:
            here = np.zeros(1, TRAJECTORY)  # the next hop would write this row
            for name in ("t", *params.State._fields, *FLIGHT_LOSSES):
                here[name] = outcome[name]
            trajectory = np.append(trajectory, here)
            outcome["samples"] += 1
        repeatable = self.rotor_inertia is None and self.status != Status.RUNNING
        given, settings = (self.body, self.law, self.slope, self.launch), self.settings if repeatable else None
        return descent_of(*given, outcome, self._lane.rebounds[0], trajectory.copy(), settings)

    def copy(self) -> Self:
        """Return an independent ride that stands where this one stands, as ``copy.copy`` of it does."""
        return copy.deepcopy(self)

    __copy__ = copy

    def _check_running(self) -> None:
        if self.status != Status.RUNNING:
            raise RuntimeError(f"the descent has ended with status {str(self.status)!r}")


class RideBatch:
    """Many descents, followed hop by hop on all cores; lane i is a :class:`Ride` of its own, bit for bit.

    A lane can be launched anew whatever the others do. Pickles and copies go on independently and identically.

    Parameters
    ----------
    body, law, slope, launches, settings
        As for :func:`sledenv.simulate_batch`.
    keep_rebounds : bool
        Keep the logs, N * max_rebounds records of 184 bytes.
    rotor_inertia : float, optional
        Moment of inertia of the riders' rotors [kg m^2], > 0; without it no trim but 0 is possible.
    shortest_flight : float
        As for :class:`Ride`.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or the lane, the value and the allowed range.
    """

    def __init__(
        self,
        body: Bodies,
        law: Laws,
        slope: Slopes,
        launches: ArrayLike,
        settings: Settings | None = None,
        *,
        keep_rebounds: bool = False,
        rotor_inertia: float | None = None,
        shortest_flight: float = 0.0,
    ) -> None:
        self.settings = checked_settings(settings)
        self.rotor_inertia, shortest = _checked_rider("RideBatch", rotor_inertia, shortest_flight)
        kept = checked_flag("keep_rebounds", keep_rebounds)
        scenes = self._checked(body, law, slope, launches)
        limits = limits_of(body, self.settings)._replace(shortest_flight=shortest)
        logs = new_logs(len(scenes.rows), self.settings.max_rebounds) if kept else NO_LOGS
        self._lanes = Simulator(scenes, self.settings.solver == "rigid", limits, logs)

    def _checked(self, body: Bodies, law: Laws, slope: Slopes, launches: ArrayLike) -> Scenes:
        scenes = checked_scenes(body, law, slope, launches, self.settings)
        scenes.rows["rotor_inertia"] = self.rotor_inertia or 1.0
        return scenes

    def launch(
        self,
        lanes: np.ndarray,
        law: Laws,
        slope: Slopes,
        launches: ArrayLike,
        body: Bodies | None = None,
    ) -> None:
        """Begin new descents.

        Parameters
        ----------
        lanes : ndarray of int, shape (n,)
            In which lanes, in [0, N), no two alike.
        law, slope, launches
            As for :func:`sledenv.simulate_batch`, of n descents.
        body : optional
            As there; those that the lanes had by default.

        Raises
        ------
        TypeError, ValueError
            Naming the argument or the lane, counted in ``launches``; no lane has changed then.
        """
        numbers = self._checked_numbers(lanes, len(checked_table("launches", launches, State._fields)))
        held = self._lanes.scenes
        if body is None:
            bodies: Bodies = held.bodies if len(held.bodies) == 1 else held.bodies[held.body[numbers]]
        elif limits_of(body, self.settings).end_parts == self._lanes.limits.end_parts:
            bodies = body
        else:
            name = self.settings.end_touching
            raise ValueError(f"Settings.end_touching = {name!r}: must have the same place in the parts of all bodies")
        self._lanes.launch(numbers, self._checked(bodies, law, slope, launches))

    def hop(self, trims: np.ndarray) -> None:
        """Follow one hop in every lane that has not ended: see :meth:`Ride.hop`.

        Parameters
        ----------
        trims : ndarray, shape (N,)
            Spin [rad/s] that the rotor lends to each body during the hop: docs/physics.md, section 9.

        Raises
        ------
        TypeError, ValueError
            For another shape, a trim that is no finite number, or one without a rotor; no lane has moved then.
        """
        spins = checked_array("trims", trims, FINITE)
        if spins.shape != self._lanes.flights.shape:
            raise ValueError(f"trims has shape {spins.shape}: must be {self._lanes.flights.shape}")
        if self.rotor_inertia is None and spins.any():
            raise ValueError("the rides have no rotor to trim with: give them a rotor_inertia")
        self._lanes.hop(spins)

    def take(self, lanes: np.ndarray) -> Self:
        """Return an independent batch whose lane i stands where lane ``lanes[i]`` of this one stands.

        A lane may be taken many times: so a ride is followed on in many ways, to see which is best.

        Raises
        ------
        IndexError
            For a lane that is not there.
        """
        taken = object.__new__(type(self))
        vars(taken).update(vars(self), _lanes=self._lanes.take(self._numbered(lanes)))
        return taken

    def __copy__(self) -> Self:
        return self.take(np.arange(len(self._lanes.flights)))

    def outcomes(self, lanes: np.ndarray | None = None) -> np.ndarray:
        """Return where descents stand, an OUTCOME array of all lanes or of some; later hops do not change it.

        Raises
        ------
        IndexError
            For a lane that is not there.
        """
        # Records are copied whole by take, but field by field through an index.
        flights = self._lanes.flights
        return copied(flights) if lanes is None else flights.take(self._numbered(lanes))

    def descents(self, lanes: np.ndarray | None = None) -> DescentBatch:
        """Return the descents so far, those of all lanes or of some; later hops do not change them."""
        found = self._lanes.descents(None if lanes is None else self._numbered(lanes))
        return replace(found, outcomes=copied(found.outcomes)) if lanes is None else found

    def _numbered(self, lanes: np.ndarray) -> np.ndarray:
        """Numbers of lanes that an index of numpy means."""
        try:
            return np.asarray(np.arange(len(self._lanes.flights))[lanes])
        except (IndexError, ValueError) as error:  # among them lists of different lengths
            raise IndexError(f"lanes = {lanes!r}: must be among {len(self._lanes.flights)} lanes: {error}") from None

    def _checked_numbers(self, lanes: np.ndarray, count: int) -> np.ndarray:
        """Return the numbers of so many lanes that are launched, or raise TypeError or ValueError."""
        try:
            numbers = np.asarray(lanes)
        except ValueError:  # lists of different lengths
            numbers = np.asarray(None)
        if numbers.dtype.kind not in "iu" and numbers.size:
            raise TypeError(f"lanes = {lanes!r}: must be whole numbers")
        if numbers.shape != (count,):
            raise ValueError(f"lanes = {lanes!r} has shape {numbers.shape}: must be ({count},), one a launch")
        wrong = (numbers < 0) | (numbers >= len(self._lanes.flights))
        if wrong.any():
            raise ValueError(f"lanes holds {numbers[wrong][0]}: must be in [0, {len(self._lanes.flights)})")
        if len(set(numbers.tolist())) < count:
            raise ValueError(f"lanes = {lanes!r}: no two must be alike")
        return numbers.astype(np.intp)


def _checked_rider(name: str, rotor_inertia: float | None, shortest_flight: float) -> tuple[float | None, float]:
    """Return what is given of a rider, or raise TypeError or ValueError."""
    shortest = checked(name, "shortest_flight", shortest_flight, NOT_NEGATIVE)
    return None if rotor_inertia is None else checked(name, "rotor_inertia", rotor_inertia, POSITIVE), shortest
