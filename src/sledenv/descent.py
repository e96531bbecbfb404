"""The Python face of the descent loop: one descent, a batch, a batch in blocks, and rides hop by hop."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, NoReturn, Self, get_args

import numpy as np
from numpy.typing import ArrayLike

from sledenv.jam import DescentJam, ReboundJam, descent_jam, rebound_jam
from sledenv.kernel.descend import begin, close_books, descend, descend_batch, hop, hop_batch, trim, work_space
from sledenv.kernel.euler import descend_euler
from sledenv.kernel.geometry import support_heights
from sledenv.kernel.laws import Law
from sledenv.kernel.params import (
    FINITE,
    NOT_NEGATIVE,
    POSITIVE,
    TOLERANCE,
    Body,
    ContactLaw,
    Limits,
    RigidLaw,
    Rule,
    Slope,
    State,
    checked,
    checked_rows,
    restitution_of,
)
from sledenv.kernel.records import LEDGER_FIELDS, OUTCOME, REBOUND, STATUS_OF_CODE, TRAJECTORY, Status

if TYPE_CHECKING:
    from tqdm import tqdm

Solver = Literal["compliant", "rigid", "euler"]
BatchSolver = Literal["compliant", "rigid"]
Record = Literal["rebounds", "trajectory"]
FrictionSign = Literal["dissipative", "printed"]
Laws = ContactLaw | Sequence[ContactLaw] | np.ndarray
Slopes = Slope | Sequence[Slope] | np.ndarray

_SURFACE = 1e-9  # relative depth up to which a launch counts as lying on the surface
_FIRST_TRAJECTORY = 4096
_BLOCK = 8192  # lanes of a batch between two chances to interrupt it
_SETTLE_SPEED: Rule = (NOT_NEGATIVE[0], "in [0, inf) m/s")
_SETTLE = 1e-5  # of sqrt(gravity * size): approach speed below which a rigid impact is plastic


class Energy(NamedTuple):
    """Energy ledger of a descent [J]: docs/physics.md, section 9."""

    initial: float  # kinetic + potential at launch
    kinetic: float  # of the body at the end
    potential: float  # at the end; zero at x = 0, y = 0
    stored: float  # in the compressed contact at the end
    hysteresis: float  # lost between loading and unloading stiffness
    sliding: float  # lost to Coulomb friction
    rolling: float  # lost to rolling resistance
    rotor: float  # kinetic energy of the rider's rotor at the end
    work: float  # done by the rider's trim
    absorbed: float  # taken up by the rider's trim, and lost
    supplied: float  # launch kinetic energy + drop height + slope descended + work

    @property
    def lost(self) -> float:
        """All losses [J]."""
        return self.hysteresis + self.sliding + self.rolling + self.absorbed

    @property
    def residual(self) -> float:
        """Energy [J] that the ledger cannot account for: the integration error."""
        return self.kinetic + self.potential + self.stored + self.rotor + self.lost - self.initial - self.work


@dataclass(frozen=True, eq=False)
class Descent:
    """One simulated descent.

    Attributes
    ----------
    status : Status
        Why it ended; a string such as "finish", "jammed", "tumbled" or "timeout".
    time : float
        Duration [s].
    state : State
        At the end.
    rebounds : ndarray of REBOUND, shape (n,)
        One row a contact, in order; the last may be a contact in which the descent ended.
    trajectory : ndarray of TRAJECTORY, shape (m,)
        Empty unless simulated with ``record="trajectory"``.
    energy : Energy
        The ledger.
    body, law, slope, launch
        What was simulated.
    """

    body: Body
    law: ContactLaw
    slope: Slope
    launch: State
    status: Status
    time: float
    state: State
    rebounds: np.ndarray
    trajectory: np.ndarray
    energy: Energy
    outcome: np.void

    @cached_property
    def jam(self) -> DescentJam:
        """Progress, retention, reward and jam index of the descent."""
        return descent_jam(self.outcome, self.body.mass, self.slope.length)

    def as_batch(self) -> DescentBatch:
        """Return a batch of this one descent."""
        jam = DescentJam._make(field.reshape(1) for field in self.jam)
        return DescentBatch(self.outcome.reshape(1), self.rebounds[np.newaxis], jam)

    @cached_property
    def rebound_jam(self) -> ReboundJam:
        """Grip, tangential loss and stuck flags of each rebound."""
        return rebound_jam(self.rebounds, self.law.friction)


@dataclass(frozen=True, eq=False)
class DescentBatch:
    """Many simulated descents, arrays of N.

    Attributes
    ----------
    outcomes : ndarray of OUTCOME, shape (N,)
        Status code, time, final state and energy ledger of each.
    rebounds : ndarray of REBOUND, shape (N, max_rebounds) or (0, 0)
        The logs, ``outcomes["rebounds"]`` rows of which are filled.
    jam : DescentJam
        Progress, retention and reward, shape (N,).
    """

    outcomes: np.ndarray
    rebounds: np.ndarray
    jam: DescentJam

    @property
    def status(self) -> np.ndarray:
        """Status of each descent, an array of strings of shape (N,)."""
        return np.asarray(np.array(STATUS_OF_CODE)[self.outcomes["status"]])

    @property
    def time(self) -> np.ndarray:
        """Duration [s], shape (N,)."""
        return np.asarray(self.outcomes["t"])

    @property
    def states(self) -> np.ndarray:
        """Final states, shape (N, 6), columns as in :class:`State`."""
        return np.stack([self.outcomes[name] for name in State._fields], axis=-1)


def _choice(name: str, value: str, allowed: tuple[str, ...]) -> str:
    if value not in allowed:
        raise ValueError(f"{name} = {value!r}: must be one of {', '.join(map(repr, allowed))}")
    return value


def _count(name: str, value: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise TypeError(f"{name} = {value!r}: must be an integer >= 1")
    if value < 1:
        raise ValueError(f"{name} = {value!r}: must be an integer >= 1")
    return int(value)


def _on_the_surface(owner: str, body: Body, slopes: np.ndarray, launches: np.ndarray) -> None:
    """Put launches, shape (N, 6), that lie on the surface up to rounding exactly there, in place.

    Raises
    ------
    ValueError
        If one lies below the surface or beyond the end of its slope; ``{lane}`` in ``owner`` becomes its number.
    """
    x, y, phi = launches[:, 0], launches[:, 1], launches[:, 2]
    lowest = support_heights(body, phi)
    below = y - lowest < -_SURFACE * (body.radius + body.eccentricity)
    if below.any():
        i = int(np.argmax(below))
        raise ValueError(
            f"{owner.format(lane=i)}.y = {float(y[i])!r}: the launch lies below the surface; at phi = "
            f"{float(phi[i])!r} rad the mass centre must be at y >= {float(lowest[i])!r} m"
        )
    beyond = x >= slopes[:, 1]
    if beyond.any():
        i = int(np.argmax(beyond))
        length = float(slopes[i if len(slopes) > 1 else 0, 1])
        raise ValueError(f"{owner.format(lane=i)}.x = {float(x[i])!r}: must be < Slope.length = {length!r} m")
    np.maximum(y, lowest, out=y)


def _launched(body: Body, slope: Slope, state: State) -> State:
    """Return one launch, put on the surface if it lies there up to rounding; see :func:`_on_the_surface`."""
    launches = np.array([state])
    _on_the_surface("State", body, np.array([slope]), launches)
    return State._make(launches[0].tolist())


def simulate(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    state: State,
    *,
    solver: Solver = "compliant",
    max_time: float = 60.0,
    max_rebounds: int = 1000,
    record: Record = "rebounds",
    sample_interval: float = 0.01,
    tolerance: float = TOLERANCE,
    step: float = 2.5e-7,
    friction_sign: FrictionSign = "dissipative",
    settle_speed: float | None = None,
) -> Descent:
    """Simulate one descent until it finishes, jams, tumbles or meets a limit.

    Parameters
    ----------
    body, law, slope
        What descends, how it touches and where.
    state : State
        Launch; the body must not lie below the surface.
    solver : {"compliant", "rigid", "euler"}
        The two-stiffness contact, event-driven (docs/physics.md, section 5); its stiff limit, with impacts in normal
        impulse and sustained contact (sections 4 and 6), which takes the restitution of ``law`` and ignores its
        stiffness; or the paper's explicit Euler method.
    max_time : float
        Longest simulated time [s], > 0.
    max_rebounds : int
        Number of rebounds after which the descent ends with status "log_full".
    record : {"rebounds", "trajectory"}
        "trajectory" also records positions, velocities and contact forces.
    sample_interval : float
        Longest time [s] between two rows of the trajectory; contacts are sampled more densely.
    tolerance : float
        Last terms of the series of a contact step, relative to the speed scale of the contact ("compliant").
    step : float
        Time step [s] ("euler").
    friction_sign : {"dissipative", "printed"}
        "printed" gives the moment of friction the sign printed in the paper's (10), which creates energy; it exists to
        reproduce the paper and needs ``solver="euler"``.
    settle_speed : float, optional
        Approach speed [m/s] below which an impact is plastic ("rigid"), so that ever smaller bounces come to an end;
        1e-5 sqrt(gravity (radius + eccentricity)) by default. 0 follows the bounces until the log is full.

    Returns
    -------
    Descent

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range; nothing is simulated then.
    """
    _choice("solver", solver, get_args(Solver))
    _choice("record", record, get_args(Record))
    _choice("friction_sign", friction_sign, get_args(FrictionSign))
    if friction_sign == "printed" and solver != "euler":
        raise ValueError("friction_sign = 'printed': only solver='euler' reproduces the paper's printed sign")
    body, law, slope = Body(*body), ContactLaw(*law), Slope(*slope)
    launch = _launched(body, slope, State(*state))
    euler = solver == "euler"
    limits = Limits(
        max_time=max_time,
        max_steps=1e18 if euler else 1e6,
        tolerance=tolerance,
        sample_interval=sample_interval,
        step=step,
        printed_sign=1.0 if friction_sign == "printed" else 0.0,
    )
    touching = _touching(body, law, slope, solver, settle_speed)
    rebounds = np.zeros(_count("max_rebounds", max_rebounds), REBOUND)
    outcomes = np.zeros(1, OUTCOME)
    trajectory = np.zeros(_FIRST_TRAJECTORY if record == "trajectory" else 0, TRAJECTORY)
    outcome = outcomes[0]

    def run() -> None:
        if euler:
            descend_euler(body, law, slope, launch, limits, rebounds, trajectory, outcome)
        else:
            descend(body, touching, slope, launch, limits, rebounds, work_space(), trajectory, outcome)

    run()
    if record == "trajectory" and outcome["samples"] > len(trajectory):
        trajectory = np.zeros(outcome["samples"], TRAJECTORY)
        run()
    return _descent(body, law, slope, launch, outcome, rebounds, trajectory)


def _descent(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    launch: State,
    outcome: np.void,
    rebounds: np.ndarray,
    trajectory: np.ndarray,
) -> Descent:
    """Descent out of what the kernel has written; shares no log with it."""
    found = _fields(outcome)
    return Descent(
        body=body,
        law=law,
        slope=slope,
        launch=launch,
        status=STATUS_OF_CODE[found["status"]],
        time=found["t"],
        state=_state(found),
        rebounds=rebounds[: found["rebounds"]].copy(),
        trajectory=trajectory[: found["samples"]],
        energy=Energy._make(found[name] for name in LEDGER_FIELDS),
        outcome=outcome,
    )


def _touching(body: Body, law: ContactLaw, slope: Slope, solver: Solver, settle_speed: float | None) -> Law:
    """Return the law that the kernel follows."""
    if solver != "rigid":
        return law
    return RigidLaw(*_rigid(body, np.array([law]), np.array([slope]), settle_speed)[0].tolist())


def _rigid(body: Body, laws: np.ndarray, slopes: np.ndarray, settle_speed: float | None) -> np.ndarray:
    """Stiff limits of contact laws, shape (1 or N, 5): fields of RigidLaw."""
    _, asymmetry, friction, rolling_arm, corner_rolling_arm = laws.T
    if settle_speed is None:
        settle = _SETTLE * np.sqrt(slopes[:, 2] * (body.radius + body.eccentricity))
    else:
        settle = np.array([checked("simulate", "settle_speed", settle_speed, _SETTLE_SPEED)])
    fields = np.broadcast_arrays(restitution_of(asymmetry), friction, rolling_arm, corner_rolling_arm, settle)
    return np.stack(fields, axis=-1)


def _fields(outcome: np.void) -> dict[str, Any]:
    """Return the fields of an OUTCOME as Python numbers; one by one they take far longer to read."""
    return dict(zip(outcome.dtype.names or (), outcome.item(), strict=True))


def _state(fields: dict[str, Any]) -> State:
    # A non-finite final state is a status, not an error.
    return State._make(fields[name] for name in State._fields)


class Ride:
    """A descent that is followed hop by hop: it can be trimmed at every rebound, and go on in more than one way.

    A ride that is never trimmed ends with the very :class:`Descent` that :func:`simulate` returns, bit for bit. It can
    be copied (:meth:`copy`) and pickled at any rebound; the copies go on independently and identically.

    Parameters
    ----------
    body, law, slope, state, solver, max_time, max_rebounds, record, sample_interval, tolerance, settle_speed
        As for :func:`simulate`, but for the Euler solver.
    rotor_inertia : float, optional
        Moment of inertia of the rider's rotor [kg m^2], > 0; without it there is no :meth:`trim`.

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
        state: State,
        *,
        solver: BatchSolver = "compliant",
        max_time: float = 60.0,
        max_rebounds: int = 1000,
        record: Record = "rebounds",
        sample_interval: float = 0.01,
        tolerance: float = TOLERANCE,
        settle_speed: float | None = None,
        rotor_inertia: float | None = None,
    ) -> None:
        _choice("solver", solver, get_args(BatchSolver))
        _choice("record", record, get_args(Record))
        self.body, self.law, self.slope = Body(*body), ContactLaw(*law), Slope(*slope)
        self.launch = _launched(self.body, self.slope, State(*state))
        self.rotor_inertia = None
        if rotor_inertia is not None:
            self.rotor_inertia = checked("Ride", "rotor_inertia", rotor_inertia, POSITIVE)
        self._touching = _touching(self.body, self.law, self.slope, solver, settle_speed)
        self._limits = Limits(max_time=max_time, tolerance=tolerance, sample_interval=sample_interval)
        self._space = work_space()
        self._rebounds = np.zeros(_count("max_rebounds", max_rebounds), REBOUND)
        self._trajectory = np.zeros(_FIRST_TRAJECTORY if record == "trajectory" else 0, TRAJECTORY)
        self._flight = np.zeros(1, OUTCOME)
        begin(self.launch, self._flight[0])
        close_books(self.body, self.slope, self.launch, self._flight[0])

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
        return _state(_fields(self._flight[0]))

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
        trim(self.body, self.rotor_inertia, self._flight[0], lent)
        close_books(self.body, self.slope, self.launch, self._flight[0])

    def hop(self) -> Status:
        """Follow one hop, to the next rebound or to the end of the descent, and return the status.

        Raises
        ------
        RuntimeError
            If the descent has ended.
        """
        self._check_running()
        start = self._flight.copy()
        self._hop()
        if 0 < len(self._trajectory) < self._flight[0]["samples"]:
            longer = np.zeros(2 * self._flight[0]["samples"], TRAJECTORY)
            longer[: start[0]["samples"]] = self._trajectory[: start[0]["samples"]]
            self._trajectory, self._flight = longer, start
            self._hop()
        close_books(self.body, self.slope, self.launch, self._flight[0])
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
            for name in ("t", *State._fields):
                here[name] = outcome[name]
            trajectory = np.append(trajectory, here)
            outcome["samples"] += 1
        return _descent(self.body, self.law, self.slope, self.launch, outcome, self._rebounds, trajectory.copy())

    def copy(self) -> Self:
        """Return an independent ride that stands where this one stands."""
        return copy.deepcopy(self)

    def _hop(self) -> None:
        flight = self._flight[0]
        rebound = self._rebounds[flight["rebounds"]]
        log_length = len(self._rebounds)
        limits, space = self._limits, self._space
        hop(self.body, self._touching, self.slope, limits, flight, rebound, log_length, space, self._trajectory)

    def _check_running(self) -> None:
        if self.status != Status.RUNNING:
            raise RuntimeError(f"the descent has ended with status {str(self.status)!r}")


def _rows(name: str, kind: type[ContactLaw] | type[Slope], given: object, lanes: int) -> np.ndarray:
    """Fields of one or of N laws or slopes, shape (1 or N, fields)."""
    if isinstance(given, kind):
        return np.array([kind(*given)])
    if not isinstance(given, np.ndarray | Sequence) or isinstance(given, tuple | str):
        raise TypeError(f"{name} = {given!r}: must be a {kind.__name__} or a sequence of them")
    if len(given) != lanes:
        raise ValueError(f"{name}: {len(given)} given for {lanes} states; give one or one a state")
    rows = _table(name, given, kind._fields)
    checked_rows(f"{name}[{{lane}}]", kind, rows)
    return rows


def _table(name: str, given: ArrayLike, fields: tuple[str, ...]) -> np.ndarray:
    """Return a new array of floats, shape (N, fields), of N tuples, or of one."""
    try:
        table = np.asarray(given)
    except ValueError:  # rows of different lengths
        table = np.asarray(given, dtype=object)
    if table.dtype.kind not in "biuf":
        raise TypeError(f"{name} holds {table.dtype}: must hold numbers, columns {', '.join(fields)}")
    table = np.array(table, dtype=float, ndmin=2, order="C")
    if table.ndim != 2 or table.shape[1] != len(fields):
        raise ValueError(f"{name} has shape {np.shape(given)}: must be (N, {len(fields)}), columns {', '.join(fields)}")
    return table


def _checked_lanes(
    body: Body,
    law: Laws,
    slope: Slopes,
    states: ArrayLike,
    solver: str,
    settle_speed: float | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Laws that the kernel follows, slopes and launches of N lanes, new arrays of one row a lane or one for all.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or the lane, the value and the allowed range.
    """
    launches = _table("states", states, State._fields)
    _choice("solver", solver, get_args(BatchSolver))
    laws = _rows("law", ContactLaw, law, len(launches))
    slopes = _rows("slope", Slope, slope, len(launches))
    if solver == "rigid":
        laws = _rigid(body, laws, slopes, settle_speed)
    checked_rows("states[{lane}]", State, launches)
    _on_the_surface("states[{lane}]", body, slopes, launches)
    return laws, slopes, launches


def _law_like(laws: np.ndarray, solver: str) -> Law:
    """Return any law of the kind that the rows of ``laws`` are."""
    return RigidLaw(*laws[0]) if solver == "rigid" else ContactLaw(*laws[0])


class _Lanes(NamedTuple):
    """A batch that has been checked: what the kernel is given."""

    body: Body
    like: Law
    laws: np.ndarray
    slopes: np.ndarray
    launches: np.ndarray
    limits: Limits
    max_rebounds: int

    def parts(self, block: int) -> Iterator[slice]:
        """Split the lanes into blocks."""
        lanes = len(self.launches)
        return (slice(start, min(start + block, lanes)) for start in range(0, lanes, block))

    def log(self, lanes: int, keep: bool) -> np.ndarray:
        """Return empty rebound logs, of no lane unless they are kept."""
        shape = (lanes, self.max_rebounds) if keep else (0, 0)
        try:
            return np.zeros(shape, REBOUND)
        except (MemoryError, ValueError) as error:  # ValueError: not even an address
            size = lanes * self.max_rebounds * REBOUND.itemsize
            raise MemoryError(
                f"keep_rebounds = True: the logs of {lanes} launches, max_rebounds = {self.max_rebounds}, take "
                f"{size / 1e9:.3g} GB; lower max_rebounds or take them block by block, see simulate_blocks"
            ) from error

    def run(self, part: slice, outcomes: np.ndarray, rebounds: np.ndarray) -> DescentJam:
        """Simulate a block of lanes and return its jam metrics."""
        laws = self.laws[part] if len(self.laws) > 1 else self.laws
        slopes = self.slopes[part] if len(self.slopes) > 1 else self.slopes
        launches, log_length = self.launches[part], self.max_rebounds
        descend_batch(self.body, self.like, laws, slopes, launches, self.limits, rebounds, log_length, outcomes)
        return descent_jam(outcomes, self.body.mass, slopes[:, 1] if len(slopes) > 1 else slopes[0, 1])


def _lanes(
    body: Body,
    law: Laws,
    slope: Slopes,
    states: ArrayLike,
    solver: BatchSolver,
    max_time: float,
    max_rebounds: int,
    tolerance: float,
    settle_speed: float | None,
) -> _Lanes:
    """Check a batch."""
    body = Body(*body)
    laws, slopes, launches = _checked_lanes(body, law, slope, states, solver, settle_speed)
    log_length = _count("max_rebounds", max_rebounds)
    limits = Limits(max_time=max_time, tolerance=tolerance)
    return _Lanes(body, _law_like(laws, solver), laws, slopes, launches, limits, log_length)


def simulate_batch(
    body: Body,
    law: Laws,
    slope: Slopes,
    states: ArrayLike,
    *,
    solver: BatchSolver = "compliant",
    max_time: float = 60.0,
    max_rebounds: int = 1000,
    keep_rebounds: bool = False,
    tolerance: float = TOLERANCE,
    settle_speed: float | None = None,
    progress: bool = False,
) -> DescentBatch:
    """Simulate many descents of one body on all cores; lane i equals ``simulate`` of state i bit for bit.

    The lanes are simulated in blocks, between which an interrupt takes effect; the result does not depend on them.

    Parameters
    ----------
    body : Body
        Shared by all lanes.
    law, slope : ContactLaw, Slope, or sequences or arrays of N of them, shapes (N, 5) and (N, 3)
        One for all lanes or one a lane.
    states : array_like, shape (N, 6)
        Launches, columns as in :class:`State`.
    solver, max_time, max_rebounds, tolerance, settle_speed
        As for :func:`simulate`.
    keep_rebounds : bool
        Return the logs too, N * max_rebounds records of 144 bytes; :func:`simulate_blocks` gives them piece by piece.
    progress : bool
        Show a bar on standard error; needs tqdm.

    Returns
    -------
    DescentBatch
        About 200 bytes a lane, without logs.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or the lane, the value and the allowed range; nothing is simulated then.
    MemoryError
        If there is no room for the logs; nothing is simulated then.
    ImportError
        If tqdm is missing and ``progress`` is asked for.
    """
    lanes = _lanes(body, law, slope, states, solver, max_time, max_rebounds, tolerance, settle_speed)
    count = len(lanes.launches)
    rebounds = lanes.log(count, keep_rebounds)
    outcomes = np.zeros(count, OUTCOME)
    jam = np.empty((len(DescentJam._fields), count))
    with _bar(count) if progress else nullcontext() as bar:
        for part in lanes.parts(_BLOCK):
            jam[:, part] = lanes.run(part, outcomes[part], rebounds[part])
            if bar is not None:
                bar.update(part.stop - part.start)
    return DescentBatch(outcomes, rebounds, DescentJam(*jam))


def simulate_blocks(
    body: Body,
    law: Laws,
    slope: Slopes,
    states: ArrayLike,
    *,
    block: int = 1024,
    solver: BatchSolver = "compliant",
    max_time: float = 60.0,
    max_rebounds: int = 1000,
    keep_rebounds: bool = True,
    tolerance: float = TOLERANCE,
    settle_speed: float | None = None,
) -> Iterator[DescentBatch]:
    """Simulate many descents block by block, for logs that memory cannot hold all at once.

    Parameters
    ----------
    body, law, slope, states, solver, max_time, max_rebounds, tolerance, settle_speed
        As for :func:`simulate_batch`.
    block : int
        Launches simulated at a time, >= 1.
    keep_rebounds : bool
        Give the logs too, block * max_rebounds records of 144 bytes at a time: 147 MB by default, and as much again
        while the caller still holds the block before.

    Yields
    ------
    DescentBatch
        Of the next ``block`` launches, or of those that are left. They share no memory; put together they are the
        result of :func:`simulate_batch`, bit for bit.

    Raises
    ------
    TypeError, ValueError, MemoryError
        As :func:`simulate_batch`, when it is called.
    """
    lanes = _lanes(body, law, slope, states, solver, max_time, max_rebounds, tolerance, settle_speed)
    block = _count("block", block)
    lanes.log(min(block, len(lanes.launches)), keep_rebounds)  # refuses what will not fit before anything is simulated

    def blocks() -> Iterator[DescentBatch]:
        for part in lanes.parts(block):
            count = part.stop - part.start
            outcomes, rebounds = np.zeros(count, OUTCOME), lanes.log(count, keep_rebounds)
            yield DescentBatch(outcomes, rebounds, lanes.run(part, outcomes, rebounds))

    return blocks()


def _bar(count: int) -> tqdm[NoReturn]:
    try:
        from tqdm import tqdm
    except ImportError as error:
        raise ImportError("progress = True: the bar needs tqdm: pip install tqdm") from error
    return tqdm(total=count, unit=" launches", unit_scale=True)


class RideBatch:
    """Many descents of one body, followed hop by hop on all cores; lane i is a :class:`Ride` of its own, bit for bit.

    A lane can be launched anew whatever the others do. Pickles and copies go on independently and identically.

    Parameters
    ----------
    body, law, slope, states, solver, max_time, max_rebounds, tolerance, settle_speed
        As for :func:`simulate_batch`.
    keep_rebounds : bool
        Keep the logs, N * max_rebounds records of 144 bytes.
    rotor_inertia : float, optional
        Moment of inertia of the riders' rotors [kg m^2], > 0; without it no trim but 0 is possible.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or the lane, the value and the allowed range.
    """

    def __init__(
        self,
        body: Body,
        law: Laws,
        slope: Slopes,
        states: ArrayLike,
        *,
        solver: BatchSolver = "compliant",
        max_time: float = 60.0,
        max_rebounds: int = 1000,
        keep_rebounds: bool = False,
        tolerance: float = TOLERANCE,
        settle_speed: float | None = None,
        rotor_inertia: float | None = None,
    ) -> None:
        self.body = Body(*body)
        self.rotor_inertia = None
        if rotor_inertia is not None:
            self.rotor_inertia = checked("RideBatch", "rotor_inertia", rotor_inertia, POSITIVE)
        self._solver: BatchSolver = solver
        self._settle_speed = settle_speed
        self._limits = Limits(max_time=max_time, tolerance=tolerance)
        self._log_length = _count("max_rebounds", max_rebounds)
        launches = _table("states", states, State._fields)
        lanes = len(launches)
        self._laws = np.empty((lanes, len(ContactLaw._fields)))
        self._slopes = np.empty((lanes, len(Slope._fields)))
        self._launches = np.empty_like(launches)
        self._flights = np.zeros(lanes, OUTCOME)
        self._touched = np.zeros(lanes, REBOUND)  # the last contact of each lane
        self._rebounds = np.zeros((lanes, self._log_length) if keep_rebounds else (0, 0), REBOUND)
        self.launch(np.arange(lanes), law, slope, launches)

    def launch(
        self,
        lanes: np.ndarray,
        law: Laws,
        slope: Slopes,
        states: ArrayLike,
    ) -> None:
        """Begin new descents; their ledgers are empty until the first hop.

        Parameters
        ----------
        lanes : ndarray of int, shape (n,)
            In which lanes, no two alike.
        law, slope, states
            As for :func:`simulate_batch`, of n descents.

        Raises
        ------
        TypeError, ValueError
            Naming the argument or the lane, counted in ``states``; no lane has changed then.
        """
        laws, slopes, launches = _checked_lanes(self.body, law, slope, states, self._solver, self._settle_speed)
        self._laws[lanes], self._slopes[lanes], self._launches[lanes] = laws, slopes, launches
        flights = np.zeros(len(launches), OUTCOME)  # of status RUNNING: nothing touched, nothing lost
        for name, column in zip(State._fields, launches.T, strict=True):
            flights[name] = column
        self._flights[lanes] = flights
        if self._rebounds.size:
            self._rebounds[lanes] = np.zeros((), REBOUND)

    def hop(self, trims: np.ndarray) -> None:
        """Follow one hop in every lane that has not ended.

        Parameters
        ----------
        trims : ndarray, shape (N,)
            Spin [rad/s] that the rotor lends to each body during the hop: docs/physics.md, section 9.

        Raises
        ------
        ValueError
            For another shape, a trim that is not finite, or one without a rotor; no lane has moved then.
        """
        spins = np.asarray(trims, dtype=float)
        if spins.shape != self._flights.shape or not np.isfinite(spins).all():
            raise ValueError(f"trims = {trims!r}: must be finite numbers of shape {self._flights.shape}")
        if self.rotor_inertia is None and spins.any():
            raise ValueError("the rides have no rotor to trim with: give them a rotor_inertia")
        before = self._flights["rebounds"].copy() if self._rebounds.size else None
        hop_batch(
            self.body,
            _law_like(self._laws, self._solver),
            self._laws,
            self._slopes,
            self._launches,
            self._limits,
            self.rotor_inertia or 1.0,
            spins,
            self._flights,
            self._touched,
            self._log_length,
        )
        if before is not None:
            touching = np.flatnonzero(self._flights["rebounds"] > before)
            self._rebounds[touching, before[touching]] = self._touched[touching]

    def outcomes(self, lanes: np.ndarray | None = None) -> np.ndarray:
        """Return where descents stand, an OUTCOME array of all lanes or of some; later hops do not change it."""
        # Records are copied whole by take, but field by field through an index.
        return self._flights.copy() if lanes is None else self._flights.take(np.arange(len(self._flights))[lanes])

    def descents(self, lanes: np.ndarray | None = None) -> DescentBatch:
        """Return the descents so far, those of all lanes or of some; later hops do not change them."""
        chosen = np.arange(len(self._flights)) if lanes is None else lanes
        outcomes, rebounds = self.outcomes(lanes), self._rebounds
        if rebounds.size:
            rebounds = rebounds[chosen, : int(outcomes["rebounds"].max(initial=0))]
        return DescentBatch(outcomes, rebounds, descent_jam(outcomes, self.body.mass, self._slopes[chosen, 1]))
