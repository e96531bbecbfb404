"""Checks of what a descent is simulated with, before the kernel sees it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sledenv.kernel import params
from sledenv.kernel.ground import MOST_ZONES
from sledenv.kernel.params import SLOPE_FIELDS, Law, Limits, RigidLaw
from sledenv.simulation.bodies import Body, made_body, records_of
from sledenv.simulation.clearance import resting_heights
from sledenv.simulation.profiles import crests, level_at, vertices_of
from sledenv.simulation.rules import checked_rows, checked_table, is_frame, made, or_absent
from sledenv.simulation.scene import AnyLaw, ContactLaw, Slope, SlopeTable, State, Zone, kind_of, restitution_of
from sledenv.simulation.settings import Settings
from sledenv.simulation.support import within_a_turn

Bodies = Body | Sequence[Body] | np.ndarray
Laws = AnyLaw | Sequence[AnyLaw] | np.ndarray
Slopes = Slope | Sequence[Slope] | np.ndarray | SlopeTable

_SURFACE = 1e-9  # relative depth up to which a launch counts as lying on the surface
_SETTLE = 1e-5  # of sqrt(gravity * size): approach speed below which a rigid impact is plastic


class CheckedDescent(NamedTuple):
    """What one descent is of."""

    body: Body
    law: AnyLaw  # as it was given
    slope: Slope
    launch: State
    touching: Law  # as the kernel follows it
    vertices: np.ndarray  # of the profile, shape (n, 2)


def checked_descent(body: Body, law: AnyLaw, slope: Slope, launch: State, settings: Settings) -> CheckedDescent:
    """Check what one descent is given.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or its field, the value and the allowed range.
    """
    body, law, slope = made_body(body), checked_law(law), made("slope", Slope, slope)
    launch, vertices = made("launch", State, launch), slope.vertices
    _check_solver(type(law), settings.solver)
    if law.asymmetry == 1.0 or any(zone.restitution == 0.0 for zone in slope.zones):
        _check_bounce("law", "Slope", np.array([law]), np.array([slope.row]), settings.solver)
    _check_ground("body", "Slope", body.record, np.array([slope.length]), vertices, settings.solver)
    launch = _admitted(body, slope, launch, vertices)
    touching: Law = law
    if settings.solver == "rigid":
        touching = RigidLaw._make(map(float, _stiff_limit(body.size, law, slope, settings.settle_speed)))
    return CheckedDescent(body, law, slope, launch, touching, vertices)


def limits_of(body: Bodies, settings: Settings) -> Limits:
    """Return what the kernel takes of settings for one body or for many.

    Raises
    ------
    ValueError
        If ``end_touching`` names a part that a body does not have, or that bodies do not have at the same place.
    """
    name = settings.end_touching
    if name is None:
        return settings.limits
    bodies = [body] if isinstance(body, Body) else body
    codes = set()
    for one in bodies:
        parts = one.parts if isinstance(one, Body) else ()
        if name not in parts:
            raise ValueError(f"Settings.end_touching = {name!r}: must be a part of the body, one of {parts}")
        codes.add(parts.index(name) + 1)
    if len(codes) > 1:
        raise ValueError(f"Settings.end_touching = {name!r}: must have the same place in the parts of all bodies")
    return settings.limits._replace(end_part=float(max(codes, default=0)))


def checked_law(law: AnyLaw) -> AnyLaw:
    """Return a contact law whose fields have been checked, or raise TypeError or ValueError."""
    return made("law", kind_of(law), law)


class CheckedLanes(NamedTuple):
    """What the kernel follows in N lanes, new arrays of one row a lane or one for all."""

    kind: type[Law]  # of the rows of laws
    bodies: np.ndarray  # of kernel.outline.BODY
    laws: np.ndarray
    slopes: np.ndarray
    launches: np.ndarray
    vertices: np.ndarray  # of the profile that all of them have, shape (n, 2)

    def like(self) -> Law:
        """Return any law of the kind."""
        return self.kind(*self.laws[0])


def checked_lanes(
    body: Bodies,
    law: Laws,
    slope: Slopes,
    given: ArrayLike,
    settings: Settings,
) -> CheckedLanes:
    """Check what N lanes are given.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or the lane, the value and the allowed range.
    """
    launches = checked_table("launches", given, State._fields, State.rules)
    kind = _kind_of_all(law)
    _check_solver(kind, settings.solver)
    bodies = records_of(body, len(launches))
    laws = _rows("law", kind, law, len(launches))
    slopes, vertices = _rows_of_slopes(slope, len(launches)), _vertices_of_all(slope)
    _check_bounce("law[{lane}]", "slope[{lane}]", laws, slopes, settings.solver)
    rigid = settings.solver == "rigid"
    if rigid:
        columns = params.ContactLaw._make(laws.T), params.Slope._make(slopes.T[:SLOPE_FIELDS])
        laws = np.stack(np.broadcast_arrays(*_stiff_limit(bodies["size"], *columns, settings.settle_speed)), axis=-1)
    _check_ground("body[{lane}]", "slope[{lane}]", bodies, slopes[:, 1], vertices, settings.solver)
    _admit("launches[{lane}]", bodies, slopes, launches, vertices)
    return CheckedLanes(RigidLaw if rigid else kind, bodies, laws, slopes, launches, vertices)


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


def _rows(name: str, kind: type[AnyLaw], given: object, lanes: int) -> np.ndarray:
    """Fields of one or of N laws, shape (1 or N, fields)."""
    if isinstance(given, kind):
        return np.array([kind(*given)])
    _check_rows(name, kind, given, lanes)
    rows = checked_table(name, given, kind._fields, kind.rules)
    _check_rows(name, kind, rows, lanes)
    return rows


def _check_rows(name: str, kind: type[Any], given: Any, lanes: int) -> None:
    """Refuse what is not a sequence of as many rows as lanes."""
    if not (isinstance(given, np.ndarray | Sequence) or is_frame(given)) or isinstance(given, tuple | str):
        raise TypeError(f"{name} = {given!r}: must be a {kind.__name__} or a sequence of them")
    if len(given) != lanes:
        raise ValueError(f"{name}: {len(given)} given for {lanes} launches; give one or one a launch")
    if not lanes:
        raise ValueError(f"{name} has no row: give one {kind.__name__} for all where there are no launches")


def _rows_of_slopes(given: Any, lanes: int) -> np.ndarray:
    """Rows of one or of N slopes with their zones, shape (1 or N, 3 + 7 zones); see :mod:`sledenv.kernel.params`."""
    if isinstance(given, Slope):
        return np.array([given.row])
    if isinstance(given, SlopeTable):
        given = given.rows
    _check_rows("slope", Slope, given, lanes)
    fields = params.Slope._fields
    if isinstance(given, np.ndarray) or is_frame(given):
        widest = given.shape[1] if len(given.shape) == 2 else 0
    else:
        given = [one.row if isinstance(one, Slope) else one for one in given]
        widest = max(map(_width, given))
        given = [(*one, *[math.nan] * (widest - _width(one))) if _width(one) >= len(fields) else one for one in given]
    zones = max((widest - len(fields)) // len(Zone._fields), 0)
    names = [f"zones[{k}].{name}" for k in range(zones) for name in Zone._fields]
    rows = checked_table("slope", given, (*fields, *names), Slope.rules)
    _check_rows("slope", Slope, rows, lanes)
    if zones > MOST_ZONES:
        raise ValueError(f"slope has columns of {zones} zones: must be at most {MOST_ZONES}")
    _check_zones(rows[:, len(fields) :].reshape(len(rows), zones, len(Zone._fields)))
    return rows


def _vertices_of_all(given: Slopes) -> np.ndarray:
    """Vertices of the profile of one or of N slopes, which must have the same."""
    if isinstance(given, Slope):
        return given.vertices
    if isinstance(given, SlopeTable):
        return given.over.vertices
    rows: Any = () if isinstance(given, np.ndarray) or is_frame(given) else given
    profiles = [one.profile if isinstance(one, Slope) else () for one in rows]
    for lane, profile in enumerate(profiles):
        if profile is not profiles[0] and profile != profiles[0]:
            raise ValueError(f"slope[{lane}].profile: must be that of slope[0], as all lanes have one profile")
    return vertices_of(profiles[0] if profiles else ())


def _width(row: Any) -> int:
    """Columns of a row of numbers; 0 of anything else."""
    return len(row) if isinstance(row, tuple | list) or (isinstance(row, np.ndarray) and row.ndim == 1) else 0


class _ZoneOfTable(params.Zone):
    """A zone as rows have it: NaN for None."""

    rules = (*Zone.rules, *map(or_absent, Zone.optional_rules))


def _check_zones(zones: np.ndarray) -> None:
    """Check the zones of slopes, shape (N, zones, fields), of which a slope may have fewer: NaN from there on."""
    reached = np.full(len(zones), -np.inf)
    for k in range(zones.shape[1]):
        absent = np.isnan(zones[:, k]).all(axis=-1)
        begin, end, *_ = zones[:, k].T
        given = np.where(absent[:, np.newaxis], (0.0, 1.0, 0.0, 0.0, 0.0, np.nan, np.nan), zones[:, k])
        checked_rows(f"slope[{{lane}}].zones[{k}]", _ZoneOfTable, given)
        for wrong, field, what in (
            (begin < reached, 0, "must be >= the end of the zone before"),
            (end <= begin, 1, "must be > its begin"),
        ):
            if wrong.any():
                lane = int(np.argmax(wrong))
                value = float(zones[lane, k, field])
                raise ValueError(f"slope[{lane}].zones[{k}].{Zone._fields[field]} = {value!r}: {what}")
        reached = np.where(absent, reached, end)


def _stiff_limit(size: Any, law: Any, slope: Any, settle_speed: float | None) -> RigidLaw:
    """Stiff limit of a contact law, or of the columns of a table of them; ``size`` [m] is that of the body."""
    settle: Any = settle_speed
    if settle is None:
        settle = _SETTLE * np.sqrt(slope.gravity * size)
    return RigidLaw(
        restitution=restitution_of(law.asymmetry),
        friction=law.friction,
        rolling_arm=law.rolling_arm,
        corner_rolling_arm=law.corner_rolling_arm,
        settle_speed=settle,
    )


def _check_bounce(law: str, slope: str, laws: np.ndarray, slopes: np.ndarray, solver: str) -> None:
    """Refuse compliant surfaces that give nothing back, in rows of laws and of slopes with their zones.

    Raises
    ------
    ValueError
        Naming the law or the zone; ``{lane}`` in ``law`` and ``slope`` becomes the number.
    """
    why = "springs that give nothing back never let go; solver = 'rigid' takes it"
    if solver == "rigid":
        return
    plastic = laws[:, params.ContactLaw._fields.index("asymmetry")] == 1.0
    if plastic.any():
        name = law.format(lane=int(np.argmax(plastic)))
        raise ValueError(f"{name}.asymmetry = 1.0 (restitution 0): must be in [0, 1) with solver = {solver!r}: {why}")
    zones = slopes[:, SLOPE_FIELDS:].reshape(len(slopes), -1, len(Zone._fields))
    lanes, numbers = np.nonzero(zones[:, :, Zone._fields.index("restitution")] == 0.0)
    if len(lanes):
        name = f"{slope.format(lane=int(lanes[0]))}.zones[{numbers[0]}]"
        raise ValueError(f"{name}.restitution = 0.0: must be in (0, 1] with solver = {solver!r}: {why}")


def _check_ground(
    body: str, slope: str, bodies: np.ndarray, lengths: np.ndarray, vertices: np.ndarray, solver: str
) -> None:
    """Refuse what cannot be simulated over a profile, of one or of N bodies and lengths [m] of slopes.

    Raises
    ------
    ValueError
        For rigid surfaces, for a body with a sharp corner where there are crests, and where the finish lies within the
        size of the body of a piece that is not level; ``{lane}`` in ``body`` and ``slope`` becomes the number.
    """
    if not len(vertices):
        return
    if solver != "compliant":
        raise ValueError(f"solver = {solver!r}: must be 'compliant' on a slope with a profile")
    if crests(vertices).any():
        listed = np.arange(bodies["r"].shape[1]) < bodies["count"][:, np.newaxis]
        # The end of a side that is listed as a corner, but lowest at one orientation alone, belongs to an arc.
        sharp = (listed & (bodies["r"] == 0.0) & (bodies["high"] > bodies["low"])).any(axis=1)
        if sharp.any():
            raise ValueError(
                f"{body.format(lane=int(np.argmax(sharp)))} has a sharp corner: all arcs must have a radius > 0 where "
                "the profile of the slope has crests; polygon(..., rounding=...) rounds corners"
            )
    sizes, lengths = np.broadcast_arrays(bodies["size"], lengths)
    sloping, level = level_at(lengths, sizes, vertices)
    if not level.all():
        lane = int(np.argmin(level))
        begin, end = vertices[sloping[lane] : sloping[lane] + 2, 0].tolist()
        raise ValueError(
            f"{slope.format(lane=lane)}.length = {float(lengths[lane])!r}: the finish must be as far from where the "
            f"profile is not level, such as [{begin!r}, {end!r}] m, as the size of the body, {float(sizes[lane])!r} m: "
            "the speed along the plane says little there"
        )


def _admitted(body: Body, slope: Slope, launch: State, vertices: np.ndarray) -> State:
    """Return one launch as :func:`_admit` does many."""
    if not math.isfinite(sum(launch)):  # as that of an outcome may be
        launch = State(*launch)
    x, y, phi, *rates = launch
    if abs(phi) > math.pi:
        phi = float(within_a_turn(np.array(phi)))
    lowest = float(resting_heights(body.record, np.array([x]), np.array([phi]), vertices)[0])
    if y - lowest < -_SURFACE * body.size:
        raise _below("State", x, y, phi, lowest)
    if x >= slope.length:
        raise _beyond("State", x, slope.length)
    if y >= lowest and phi == launch.phi:
        return launch
    return State(x, y if y >= lowest else lowest, phi, *rates)


def _admit(owner: str, bodies: np.ndarray, slopes: np.ndarray, launches: np.ndarray, vertices: np.ndarray) -> None:
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
    lowest = resting_heights(bodies, x, phi, vertices)
    below = y - lowest < -_SURFACE * bodies["size"]
    if below.any():
        i = int(np.argmax(below))
        raise _below(owner.format(lane=i), float(x[i]), float(y[i]), float(phi[i]), float(lowest[i]))
    beyond = x >= slopes[:, 1]
    if beyond.any():
        i = int(np.argmax(beyond))
        raise _beyond(owner.format(lane=i), float(x[i]), float(slopes[i if len(slopes) > 1 else 0, 1]))
    y[:] = np.where(y >= lowest, y, lowest)


def _below(owner: str, x: float, y: float, phi: float, lowest: float) -> ValueError:
    return ValueError(
        f"{owner}.y = {y!r}: the launch lies below the surface; at x = {x!r} m and phi = {phi!r} rad the mass centre "
        f"must be at y >= {lowest!r} m"
    )


def _beyond(owner: str, x: float, length: float) -> ValueError:
    return ValueError(f"{owner}.x = {x!r}: must be < Slope.length = {length!r} m")
