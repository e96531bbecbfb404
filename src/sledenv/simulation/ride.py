"""Descents that are followed hop by hop, one or a batch of them."""

from __future__ import annotations

import copy
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from sledenv.kernel import params
from sledenv.kernel.batch import FLY, STAY, WAIT
from sledenv.kernel.entries import run_embark, run_trim
from sledenv.kernel.params import Limits
from sledenv.simulation.bodies import Body
from sledenv.simulation.checks import Bodies, CheckedLanes, Laws, Slopes, checked_descent, checked_lanes, limits_of
from sledenv.simulation.jam import descent_jam
from sledenv.simulation.lanes import NO_LOGS, NO_ROWS, Tables, follow_all, new_log, new_logs, new_trajectory
from sledenv.simulation.outcomes import RECORDS, Descent, DescentBatch, Record, descent_of, state_of
from sledenv.simulation.records import FLIGHT_LOSSES, OUTCOME, REBOUND, STATUS_OF_CODE, TRAJECTORY, Status
from sledenv.simulation.rules import (
    FINITE,
    NOT_NEGATIVE,
    POSITIVE,
    checked,
    checked_array,
    checked_choice,
    checked_table,
)
from sledenv.simulation.scene import ContactLaw, Slope, State, laid
from sledenv.simulation.settings import Settings, checked_settings
from sledenv.simulation.simulate import FIRST_TRAJECTORY, put_at_launch


class _Lanes:
    """Lanes that are followed hop by hop, whose arguments have been checked: one of a ride, many of a batch."""

    def __init__(
        self, given: CheckedLanes, limits: Limits, settings: Settings, logs: np.ndarray, rotor_inertia: float | None
    ) -> None:
        """Begin with what has been checked; logs are empty, of all lanes or of none."""
        self.settings, self.rotor_inertia, self._rebounds = settings, rotor_inertia, logs
        self._rigid, self._limits, *_, self._tracks, self._pieces = given.tables(limits)
        self._bodies = given.bodies.copy()  # one body for all lanes, or one a lane; so with tracks
        lanes = len(given.launches)
        self._laws, self._slopes = (
            rows if len(rows) == lanes else np.repeat(rows, lanes, axis=0) for rows in (given.laws, given.slopes)
        )
        self._launches, self._flights = given.launches, np.zeros(lanes, OUTCOME)
        put_at_launch(self._flights, self._launches)

    def _begin(self, lanes: np.ndarray, given: CheckedLanes) -> None:
        more = given.slopes.shape[1] - self._slopes.shape[1]  # some slope has more zones than any before
        if more > 0:
            self._slopes = np.pad(self._slopes, ((0, 0), (0, more)), constant_values=np.nan)
        self._slopes[lanes], self._slopes[lanes, : given.slopes.shape[1]] = np.nan, given.slopes
        self._laws[lanes], self._launches[lanes] = given.laws, given.launches
        self._lay(lanes, *laid(given.tracks))
        flights = np.zeros(len(given.launches), OUTCOME)  # of status RUNNING: nothing touched, nothing lost
        put_at_launch(flights, given.launches)
        self._flights[lanes] = flights
        if self._rebounds.size:
            self._rebounds[lanes] = np.zeros((), REBOUND)

    def _lay(self, lanes: np.ndarray, tracks: np.ndarray, pieces: np.ndarray) -> None:
        """Put other ground under some lanes."""
        if len(self._tracks) == len(tracks) == 1 and pieces.tobytes() == self._pieces.tobytes():
            return
        spans = np.broadcast_to(self._tracks, (len(self._flights), 2)).copy()
        spans[lanes] = tracks + float(len(self._pieces))  # they are put behind those that there are
        begins, counts = spans[:, 0].astype(np.intp), np.diff(spans, axis=-1)[:, 0].astype(np.intp)
        ends = np.cumsum(counts)
        kept = np.arange(ends[-1]) + np.repeat(begins - (ends - counts), counts)
        self._pieces = np.concatenate([self._pieces, pieces]).take(kept)
        self._tracks = np.stack([ends - counts, ends], axis=-1).astype(float)

    def _followed(self, trims: np.ndarray, trajectory: np.ndarray = NO_ROWS) -> np.ndarray:
        """Where the descents are after one hop; nothing but logs is changed, for an interrupt may come."""
        rows = self._bodies, self._laws, self._slopes, self._launches, self._tracks, self._pieces
        flights = self._flights.copy()
        follow_all(Tables(self._rigid, self._limits, *rows), trims, flights, self._rebounds, trajectory)
        return flights


class Ride:
    """A descent that is followed hop by hop: it can be trimmed at every rebound, and go on in more than one way.

    A ride that is never trimmed ends with the very :class:`sledenv.Descent` that :func:`sledenv.simulate` returns, bit
    for bit. It can be copied (:meth:`copy`) and pickled at any rebound; the copies go on independently and identically.

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
        self.body, self.law, self.slope, self.launch, lanes = checked_descent(body, law, slope, launch, settings)
        if rotor_inertia is not None:
            rotor_inertia = checked("Ride", "rotor_inertia", rotor_inertia, POSITIVE)
        shortest = checked("Ride", "shortest_flight", shortest_flight, NOT_NEGATIVE)
        limits = limits_of(self.body, settings)._replace(shortest_flight=shortest)
        log = new_log(settings.max_rebounds)[np.newaxis]
        self._lane = _Lanes(lanes, limits, settings, log, rotor_inertia)
        self._trajectory = np.zeros(FIRST_TRAJECTORY, TRAJECTORY) if record == "trajectory" else NO_ROWS
        run_embark(self.body.record, *self._ground(), self._flight)

    @property
    def settings(self) -> Settings:
        """How it is simulated."""
        return self._lane.settings

    @property
    def rotor_inertia(self) -> float | None:
        """Moment of inertia of the rider's rotor [kg m^2]; None without one."""
        return self._lane.rotor_inertia

    @property
    def _flight(self) -> np.ndarray:
        """Where the descent is, shape (1,) of OUTCOME."""
        return self._lane._flights

    def _ground(self) -> tuple[np.ndarray, params.Slope, State]:
        """Return what the kernel needs for the ledger."""
        return self._lane._pieces, params.Slope(*self.slope[:3]), self.launch

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
    def lent(self) -> float:
        """Spin [rad/s] that the rider's rotor lends to the body."""
        return float(self._flight[0]["trim"])

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
        run_trim(self.body.record, *self._ground(), self.rotor_inertia, lent, self._flight)

    def hop(self) -> Status:
        """Follow one hop, to the next rebound or to the end of the descent, and return the status.

        If flights may be too short, it goes on to a rebound behind which one begins that is not.

        Raises
        ------
        RuntimeError
            If the descent has ended.
        """
        return self._follow(FLY)

    def await_flight(self) -> Status:
        """Go on to where a flight begins that is not too short, if not even the first one is; return the status.

        Raises
        ------
        RuntimeError
            If the descent has ended.
        """
        return self._follow(WAIT)

    def _follow(self, what: int) -> Status:
        self._check_running()
        trims = np.array([[self.lent, self.rotor_inertia or 1.0, what]])  # which has been done
        flight = self._lane._followed(trims, self._trajectory)
        if len(self._trajectory) < (rows := int(flight["samples"][0])):
            written = int(self._flight["samples"][0])
            longer = new_trajectory(2 * rows, self.settings.sample_interval)
            longer[:written] = self._trajectory[:written]
            self._trajectory = longer
            flight = self._lane._followed(trims, self._trajectory)
        self._lane._flights = flight
        return self.status

    def run(self) -> Descent:
        """Follow the descent to its end and return it."""
        while self.status == Status.RUNNING:
            self.hop()
        return self.descent()

    def descent(self) -> Descent:
        """Return the descent so far, of status "running" until it has ended; later hops do not change it."""
        outcome = self._flight.copy()[0]
        trajectory = self._trajectory[: outcome["samples"]]
        if self.status == Status.RUNNING and len(self._trajectory) > 0:
            here = np.zeros(1, TRAJECTORY)  # the next hop would write this row
            for name in ("t", *params.State._fields, *FLIGHT_LOSSES):
                here[name] = outcome[name]
            trajectory = np.append(trajectory, here)
            outcome["samples"] += 1
        repeatable = self.rotor_inertia is None and self.status != Status.RUNNING
        given, settings = (self.body, self.law, self.slope, self.launch), self.settings if repeatable else None
        return descent_of(*given, outcome, self._lane._rebounds[0], trajectory.copy(), settings)

    def copy(self) -> Self:
        """Return an independent ride that stands where this one stands, as ``copy.copy`` of it does."""
        return copy.deepcopy(self)

    __copy__ = copy

    def _check_running(self) -> None:
        if self.status != Status.RUNNING:
            raise RuntimeError(f"the descent has ended with status {str(self.status)!r}")


class RideBatch(_Lanes):
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
        settings = checked_settings(settings)
        if rotor_inertia is not None:
            rotor_inertia = checked("RideBatch", "rotor_inertia", rotor_inertia, POSITIVE)
        shortest = checked("RideBatch", "shortest_flight", shortest_flight, NOT_NEGATIVE)
        given = checked_lanes(body, law, slope, launches, settings)
        limits = limits_of(body, settings)._replace(shortest_flight=shortest)
        logs = new_logs(len(given.launches), settings.max_rebounds) if keep_rebounds else NO_LOGS
        super().__init__(given, limits, settings, logs, rotor_inertia)

    def launch(
        self,
        lanes: np.ndarray,
        law: Laws,
        slope: Slopes,
        launches: ArrayLike,
        body: Bodies | None = None,
    ) -> None:
        """Begin new descents; their ledgers are empty until the first hop.

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
        if body is None:
            bodies: Bodies = self._bodies if len(self._bodies) == 1 else self._bodies.take(numbers)
        elif limits_of(body, self.settings).end_parts == self._limits.end_parts:
            bodies = body
        else:
            name = self.settings.end_touching
            raise ValueError(f"Settings.end_touching = {name!r}: must have the same place in the parts of all bodies")
        given = checked_lanes(bodies, law, slope, launches, self.settings)
        self._begin(numbers, given)
        if body is not None and (len(self._bodies) > 1 or given.bodies.tobytes() != self._bodies.tobytes()):
            if len(self._bodies) < len(self._flights):
                self._bodies = np.repeat(self._bodies, len(self._flights))
            self._bodies[numbers] = given.bodies

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
        if spins.shape != self._flights.shape:
            raise ValueError(f"trims has shape {spins.shape}: must be {self._flights.shape}")
        if self.rotor_inertia is None and spins.any():
            raise ValueError("the rides have no rotor to trim with: give them a rotor_inertia")
        self._flights = self._followed(self._trims(spins, FLY))

    def take(self, lanes: np.ndarray) -> Self:
        """Return an independent batch whose lane i stands where lane ``lanes[i]`` of this one stands.

        A lane may be taken many times: so a ride is followed on in many ways, to see which is best.

        Raises
        ------
        IndexError
            For a lane that is not there.
        """
        chosen, taken = self._numbered(lanes), object.__new__(type(self))
        vars(taken).update(vars(self))
        for name in ("_bodies", "_laws", "_slopes", "_launches", "_flights", "_tracks", "_rebounds"):
            rows = getattr(self, name)
            shared = len(rows) == 1 < len(self._flights) or not rows.size  # one for all lanes, or none
            setattr(taken, name, rows.copy() if shared else rows.take(chosen, axis=0))
        return taken

    def __copy__(self) -> Self:
        return self.take(np.arange(len(self._flights)))

    def await_flights(self, lanes: np.ndarray) -> None:
        """Go on to where a flight begins that is not too short, in lanes whose first flight may be: of numbers (n,).

        Raises
        ------
        IndexError
            For a lane that is not there.
        """
        what = np.full(len(self._flights), STAY)
        what[self._numbered(lanes)] = WAIT
        self._flights = self._followed(self._trims(np.zeros(len(what)), what))

    def _trims(self, spins: np.ndarray, what: np.ndarray | int) -> np.ndarray:
        return np.stack(np.broadcast_arrays(spins, self.rotor_inertia or 1.0, what), axis=-1)

    def outcomes(self, lanes: np.ndarray | None = None) -> np.ndarray:
        """Return where descents stand, an OUTCOME array of all lanes or of some; later hops do not change it.

        Raises
        ------
        IndexError
            For a lane that is not there.
        """
        # Records are copied whole by take, but field by field through an index.
        return self._flights.copy() if lanes is None else self._flights.take(self._numbered(lanes))

    def ground(self, lanes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the ground of lanes of numbers (n,), as :mod:`sledenv.simulation.outlook` takes it.

        Raises
        ------
        IndexError
            For a lane that is not there.
        """
        return (self._tracks if len(self._tracks) == 1 else self._tracks[self._numbered(lanes)]), self._pieces

    def descents(self, lanes: np.ndarray | None = None) -> DescentBatch:
        """Return the descents so far, those of all lanes or of some; later hops do not change them."""
        chosen = np.arange(len(self._flights)) if lanes is None else self._numbered(lanes)
        outcomes, rebounds = self.outcomes(lanes), self._rebounds
        if rebounds.size:
            rebounds = rebounds[chosen, : int(outcomes["rebounds"].max(initial=0))]
        mass = self._bodies["mass"] if len(self._bodies) == 1 else self._bodies["mass"][chosen]
        return DescentBatch(outcomes, rebounds, descent_jam(outcomes, mass, self._slopes[chosen, 1]))

    def _numbered(self, lanes: np.ndarray) -> np.ndarray:
        """Numbers of lanes that an index of numpy means."""
        try:
            return np.asarray(np.arange(len(self._flights))[lanes])
        except IndexError as error:
            raise IndexError(f"lanes = {lanes!r}: must be among {len(self._flights)} lanes: {error}") from None

    def _checked_numbers(self, lanes: np.ndarray, count: int) -> np.ndarray:
        """Return the numbers of so many lanes that are launched, or raise TypeError or ValueError."""
        numbers = np.asarray(lanes)
        if numbers.dtype.kind not in "iu" and numbers.size:
            raise TypeError(f"lanes = {lanes!r}: must be whole numbers")
        if numbers.shape != (count,):
            raise ValueError(f"lanes = {lanes!r} has shape {numbers.shape}: must be ({count},), one a launch")
        wrong = (numbers < 0) | (numbers >= len(self._flights))
        if wrong.any():
            raise ValueError(f"lanes holds {numbers[wrong][0]}: must be in [0, {len(self._flights)})")
        if len(set(numbers.tolist())) < count:
            raise ValueError(f"lanes = {lanes!r}: no two must be alike")
        return numbers.astype(np.intp)
