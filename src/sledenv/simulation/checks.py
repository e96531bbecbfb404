"""Checks of what a descent is simulated with, before the kernel sees it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from sledenv.kernel.laws import Law
from sledenv.kernel.params import RigidLaw
from sledenv.simulation.bodies import Body, check_bodies
from sledenv.simulation.rules import NOT_NEGATIVE, Rule, checked, checked_choice, checked_rows, made
from sledenv.simulation.scene import AnyLaw, ContactLaw, Slope, State, kind_of, restitution_of
from sledenv.simulation.support import support_heights, within_a_turn

Solver = Literal["compliant", "rigid", "euler"]
BatchSolver = Literal["compliant", "rigid"]
Bodies = Body | Sequence[Body] | np.ndarray
Laws = AnyLaw | Sequence[AnyLaw] | np.ndarray
Slopes = Slope | Sequence[Slope] | np.ndarray

_SURFACE = 1e-9  # relative depth up to which a launch counts as lying on the surface
_SETTLE_SPEED: Rule = (NOT_NEGATIVE[0], "in [0, inf) m/s")
_SETTLE = 1e-5  # of sqrt(gravity * size): approach speed below which a rigid impact is plastic


def launched(body: Body, slope: Slope, state: State) -> State:
    """Return one launch as :func:`_admit` does many."""
    launches = np.array([state])
    _admit("State", np.array([body]), np.array([slope]), launches)
    return State._make(launches[0].tolist())


def checked_law(law: AnyLaw) -> AnyLaw:
    """Return a contact law whose fields have been checked, or raise TypeError or ValueError."""
    return made("law", kind_of(law), law)


def touching_law(body: Body, law: AnyLaw, slope: Slope, solver: Solver, settle_speed: float | None) -> Law:
    """Return the law that the kernel follows."""
    _check_solver(kind_of(law), solver)
    _checked_settle_speed(settle_speed)
    if solver != "rigid":
        return law
    return RigidLaw(*_rigid(np.array([body]), np.array([law]), np.array([slope]), settle_speed)[0].tolist())


class CheckedLanes(NamedTuple):
    """What the kernel follows in N lanes, new arrays of one row a lane or one for all."""

    kind: type[Law]  # of the rows of laws
    bodies: np.ndarray
    laws: np.ndarray
    slopes: np.ndarray
    launches: np.ndarray

    def like(self) -> Law:
        """Return any law of the kind."""
        return self.kind(*self.laws[0])


def checked_lanes(
    body: Bodies,
    law: Laws,
    slope: Slopes,
    given: ArrayLike,
    solver: str,
    settle_speed: float | None,
) -> CheckedLanes:
    """Check what N lanes are given.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or the lane, the value and the allowed range.
    """
    launches = checked_table("launches", given, State._fields)
    checked_choice("solver", solver, get_args(BatchSolver))
    kind = _kind_of_all(law)
    _check_solver(kind, solver)
    _checked_settle_speed(settle_speed)
    bodies = _rows("body", Body, body, len(launches))
    laws = _rows("law", kind, law, len(launches))
    slopes = _rows("slope", Slope, slope, len(launches))
    rigid = solver == "rigid"
    if rigid:
        laws = _rigid(bodies, laws, slopes, settle_speed)
    checked_rows("launches[{lane}]", State, launches)
    _admit("launches[{lane}]", bodies, slopes, launches)
    return CheckedLanes(RigidLaw if rigid else kind, bodies, laws, slopes, launches)


def checked_table(name: str, given: ArrayLike, fields: tuple[str, ...]) -> np.ndarray:
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


def _kind_of_all(given: Laws) -> type[AnyLaw]:
    """Kind of one or of N laws; that of rows of numbers is ContactLaw."""
    if isinstance(given, tuple) or not isinstance(given, Sequence):
        return kind_of(given)
    kinds = list(dict.fromkeys(map(kind_of, given)))
    if len(kinds) > 1:
        raise TypeError(f"law holds {' and '.join(kind.__name__ for kind in kinds)}: must hold laws of one kind")
    return kinds[0] if kinds else ContactLaw


def _check_solver(kind: type[AnyLaw], solver: str) -> None:
    if kind is not ContactLaw and solver != "compliant":
        raise TypeError(f"law is of the kind {kind.__name__}: solver = {solver!r} needs a ContactLaw")


def _rows(name: str, kind: type[Body] | type[AnyLaw] | type[Slope], given: object, lanes: int) -> np.ndarray:
    """Fields of one or of N bodies, laws or slopes, shape (1 or N, fields)."""
    if isinstance(given, kind):
        return np.array([kind(*given)])
    if not isinstance(given, np.ndarray | Sequence) or isinstance(given, tuple | str):
        raise TypeError(f"{name} = {given!r}: must be a {kind.__name__} or a sequence of them")
    if len(given) != lanes:
        raise ValueError(f"{name}: {len(given)} given for {lanes} launches; give one or one a launch")
    if not lanes:
        raise ValueError(f"{name} has no row: give one {kind.__name__} for all where there are no launches")
    rows = checked_table(name, given, kind._fields)
    owner = f"{name}[{{lane}}]"
    if kind is Body:
        check_bodies(owner, rows)
    else:
        checked_rows(owner, kind, rows)
    return rows


def _rigid(bodies: np.ndarray, laws: np.ndarray, slopes: np.ndarray, settle_speed: float | None) -> np.ndarray:
    """Stiff limits of contact laws, rows of a table or one for all lanes: fields of RigidLaw."""
    law = ContactLaw._make(laws.T)  # of columns
    settle: Any
    if settle_speed is None:
        settle = _SETTLE * np.sqrt(slopes[:, 2] * _sizes(bodies))
    else:
        settle = np.array([settle_speed], dtype=float)
    limit = RigidLaw(
        restitution=restitution_of(law.asymmetry),
        friction=law.friction,
        rolling_arm=law.rolling_arm,
        corner_rolling_arm=law.corner_rolling_arm,
        settle_speed=settle,
    )
    return np.stack(np.broadcast_arrays(*limit), axis=-1)


def _checked_settle_speed(settle_speed: float | None) -> None:
    """Raise TypeError or ValueError for a speed that no solver takes, whether or not the one at hand does."""
    if settle_speed is not None:
        checked("simulate", "settle_speed", settle_speed, _SETTLE_SPEED)


def _sizes(bodies: np.ndarray) -> Any:
    """Greatest distances [m] from the mass centres of bodies, one a row."""
    _, radius, eccentricity, *_ = bodies.T
    return radius + eccentricity


def _admit(owner: str, bodies: np.ndarray, slopes: np.ndarray, launches: np.ndarray) -> None:
    """Take whole turns off launches, shape (N, 6), in place, and lift those that lie on the surface up to rounding.

    A large orientation would round off every small turn that is added to it.

    Raises
    ------
    ValueError
        If one lies below the surface or beyond the end of its slope; ``{lane}`` in ``owner`` becomes its number.
    """
    x, y, phi = launches[:, 0], launches[:, 1], launches[:, 2]
    if (np.abs(phi) > np.pi).any():
        phi[:] = within_a_turn(phi)
    lowest = support_heights(bodies, phi)
    below = y - lowest < -_SURFACE * _sizes(bodies)
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
