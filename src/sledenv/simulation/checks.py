"""Checks of what a descent is simulated with, before the kernel sees it."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sledenv.kernel import params
from sledenv.kernel.ground import MOST_ZONES
from sledenv.kernel.params import SLOPE_FIELDS, ZONE_FIELDS, Law, Limits, RigidLaw
from sledenv.simulation.bodies import Body, made_body, records_of
from sledenv.simulation.fineness import too_fine
from sledenv.simulation.lanes import Tables, check_room
from sledenv.simulation.rules import checked_rows, checked_table, is_frame, made, or_absent
from sledenv.simulation.scene import (
    ContactLaw,
    Slope,
    SlopeTable,
    State,
    Tracks,
    Zone,
    laid,
    misplaced_zones,
    restitution_of,
    sharp_crests,
)
from sledenv.simulation.settings import Settings
from sledenv.simulation.support import resting_heights, within_a_turn

Bodies = Body | Sequence[Body] | np.ndarray
Laws = ContactLaw | Sequence[ContactLaw] | np.ndarray
Slopes = Slope | Sequence[Slope] | np.ndarray | SlopeTable

_ASYMMETRY, _RESTITUTION = ContactLaw._fields.index("asymmetry"), Zone._fields.index("restitution")
_SURFACE = 1e-9  # relative depth up to which a launch counts as lying on the surface
_SETTLE = 1e-5  # of sqrt(gravity * size): approach speed below which a rigid impact is plastic


class CheckedLanes(NamedTuple):
    """What the kernel follows in N lanes, new arrays of one row a lane or one for all."""

    kind: type[Law]  # of the rows of laws
    bodies: np.ndarray  # of kernel.outline.BODY
    laws: np.ndarray
    slopes: np.ndarray
    launches: np.ndarray
    tracks: Tracks

    def tables(self, limits: Limits) -> Tables:
        """Return what the loop over lanes takes."""
        rigid = int(self.kind is RigidLaw)
        return Tables(rigid, limits, self.bodies, self.laws, self.slopes, self.launches, *laid(self.tracks))


class CheckedDescent(NamedTuple):
    """What one descent is of."""

    body: Body
    law: ContactLaw  # as it was given
    slope: Slope
    launch: State
    lanes: CheckedLanes  # one, for the kernel


class _Names(NamedTuple):
    """What messages call things; ``{lane}`` becomes the number of a lane."""

    body: str
    law: str
    slope: str
    launch: str


_ONE, _MANY = (
    _Names("body", "law", "Slope", "State"),
    _Names(*(f"{name}[{{lane}}]" for name in ("body", "law", "slope", "launches"))),
)


def checked_descent(body: Body, law: ContactLaw, slope: Slope, launch: State, settings: Settings) -> CheckedDescent:
    """Check what one descent is given: lane 0 of a batch of one.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or its field, the value and the allowed range.
    """
    body, law, slope = made_body(body), made("law", ContactLaw, law), made("slope", Slope, slope)
    launch = made("launch", State, launch)
    if not math.isfinite(sum(launch)):  # as that of an outcome may be
        launch = State(*launch)
    row = np.array([[*law, *slope.row, *launch]])
    rows = row[:, : len(law)], row[:, len(law) : -len(launch)], row[:, -len(launch) :]
    lanes = _allowed(_ONE, CheckedLanes(params.ContactLaw, body.record, *rows, Tracks.of((slope.ground,))), settings)
    return CheckedDescent(body, law, slope, State.found(lanes.launches[0].tolist()), lanes)


def checked_lanes(body: Bodies, law: Laws, slope: Slopes, launches: ArrayLike, settings: Settings) -> CheckedLanes:
    """Check what N lanes are given.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or the lane, the value and the allowed range.
    """
    if isinstance(launches, np.ndarray):  # one that is broadcast takes no room yet
        check_room(launches.size * 8, f"launches: their {launches.size} numbers", "give fewer at a time")
    starts = checked_table("launches", launches, State._fields, State.rules)
    count = len(starts)
    rows = records_of(body, count), _rows_of_laws(law, count), _rows_of_slopes(slope, count)
    return _allowed(_MANY, CheckedLanes(params.ContactLaw, *rows, starts, _tracks_of(slope)), settings)


def _allowed(names: _Names, lanes: CheckedLanes, settings: Settings) -> CheckedLanes:
    """Return lanes whose fields have been checked, as the solver follows them, if they are allowed together."""
    _check_bounce(names, lanes, settings.solver)
    _check_ground(names, lanes, settings.solver)
    _admit(names, lanes)
    _warn_of_fine_ground(names, lanes)
    return _stiff_limit(lanes, settings.settle_speed) if settings.solver == "rigid" else lanes


def limits_of(body: Bodies, settings: Settings) -> Limits:
    """Return what the kernel takes of settings for one body or for many.

    Raises
    ------
    ValueError
        If ``end_touching`` names a part that a body does not have, or that bodies do not have at the same place.
    """
    total = 0
    for name in settings.end_parts:
        codes = set()
        for one in [body] if isinstance(body, Body) else body:
            parts = one.parts if isinstance(one, Body) else ()
            if name not in parts:
                raise ValueError(f"Settings.end_touching = {name!r}: must be a part of the body, one of {parts}")
            codes.add(parts.index(name) + 1)
        if len(codes) > 1:
            raise ValueError(f"Settings.end_touching = {name!r}: must have the same place in the parts of all bodies")
        total |= sum(1 << code for code in codes)
    return settings.limits._replace(end_parts=float(total)) if total else settings.limits


def _rows_of_laws(given: Any, lanes: int) -> np.ndarray:
    """Fields of one or of N laws, shape (1 or N, fields)."""
    if isinstance(given, params.ContactLaw):
        return np.array([ContactLaw(*given)])
    _check_rows("law", ContactLaw, given, lanes)
    rows = checked_table("law", given, ContactLaw._fields, ContactLaw.rules)
    _check_rows("law", ContactLaw, rows, lanes)
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
    _check_zones(rows[:, len(fields) :].reshape(len(rows), zones, len(Zone._fields)), rows[:, fields.index("length")])
    return rows


def _tracks_of(given: Slopes) -> Tracks:
    """Ground of one or of N slopes."""
    if isinstance(given, Slope):
        return Tracks.of((given.ground,))
    if isinstance(given, SlopeTable):
        return Tracks.of(given.profiles)
    rows: Any = () if isinstance(given, np.ndarray) or is_frame(given) else given
    return Tracks.of([one.ground if isinstance(one, Slope) else () for one in rows])


def _width(row: Any) -> int:
    """Columns of a row of numbers; 0 of anything else."""
    return len(row) if isinstance(row, tuple | list) or (isinstance(row, np.ndarray) and row.ndim == 1) else 0


class _ZoneOfTable(params.Zone):
    """A zone as rows have it: NaN for None."""

    rules = (*Zone.rules, *map(or_absent, Zone.optional_rules))


def _check_zones(zones: np.ndarray, lengths: np.ndarray) -> None:
    """Check the zones of slopes, shape (N, zones, fields), of which a slope may have fewer: NaN from there on."""
    for k in range(zones.shape[1]):
        absent = np.isnan(zones[:, k]).all(axis=-1)
        given = np.where(absent[:, np.newaxis], (0.0, 1.0, 0.0, 0.0, 0.0, np.nan, np.nan), zones[:, k])
        checked_rows(f"slope[{{lane}}].zones[{k}]", _ZoneOfTable, given)
    for one in misplaced_zones(np.moveaxis(zones[:, :, :2], 0, 2), lengths):
        if one.wrong.any():
            lane = int(np.argmax(one.wrong))
            value = float(zones[lane, one.zone, Zone._fields.index(one.field)])
            what = one.what.format(float(np.broadcast_to(one.bound, len(zones))[lane]))
            raise ValueError(f"slope[{lane}].zones[{one.zone}].{one.field} = {value!r}: {what}")


def _stiff_limit(lanes: CheckedLanes, settle_speed: float | None) -> CheckedLanes:
    """Stiff limit of lanes; the speed below which an impact is plastic depends on body and slope, unless given."""
    law = params.ContactLaw._make(lanes.laws.T)
    gravity, size = lanes.slopes[:, params.Slope._fields.index("gravity")], lanes.bodies["size"]
    settle = np.array([settle_speed]) if settle_speed is not None else _SETTLE * np.sqrt(gravity * size)
    columns = restitution_of(law.asymmetry), law.friction, law.rolling_arm, law.corner_rolling_arm, settle
    rows = np.empty((max(len(settle), len(lanes.laws)), len(columns)))
    for i, column in enumerate(columns):
        rows[:, i] = column
    return lanes._replace(kind=RigidLaw, laws=rows)


def _check_bounce(names: _Names, lanes: CheckedLanes, solver: str) -> None:
    """Refuse compliant surfaces that give nothing back.

    Raises
    ------
    ValueError
        Naming the law or the zone.
    """
    why = "springs that give nothing back never let go; solver = 'rigid' takes it"
    if solver == "rigid":
        return
    plastic = lanes.laws[:, _ASYMMETRY] == 1.0
    if np.count_nonzero(plastic):  # of few lanes any() takes ten times as long
        name = names.law.format(lane=int(np.argmax(plastic)))
        raise ValueError(f"{name}.asymmetry = 1.0 (restitution 0): must be in [0, 1) with solver = {solver!r}: {why}")
    restitutions = lanes.slopes[:, SLOPE_FIELDS + _RESTITUTION :: ZONE_FIELDS]
    if restitutions.size and np.count_nonzero(restitutions == 0.0):
        lane, zone = np.argwhere(restitutions == 0.0)[0].tolist()
        name = f"{names.slope.format(lane=lane)}.zones[{zone}]"
        raise ValueError(f"{name}.restitution = 0.0: must be in (0, 1] with solver = {solver!r}: {why}")


def _check_ground(names: _Names, lanes: CheckedLanes, solver: str) -> None:
    """Refuse what cannot be simulated over a profile.

    Raises
    ------
    ValueError
        For rigid surfaces, and for a body with a sharp corner where there are sharp crests.
    """
    bodies, tracks = lanes.bodies, lanes.tracks
    if tracks.is_plane:
        return
    if solver != "compliant":
        raise ValueError(f"solver = {solver!r}: must be 'compliant' on a slope with a profile")
    count, sharp = len(lanes.launches), has_sharp_corner(bodies)
    if not sharp.any():
        return
    crests = np.array([sharp_crests(vertices).any() for vertices in tracks.vertices])
    wrong = np.broadcast_to(sharp, count) & np.broadcast_to(crests[tracks.numbers], count)
    if wrong.any():
        raise ValueError(
            f"{names.body.format(lane=int(np.argmax(wrong)))} has a sharp corner: all arcs must have a radius > 0 "
            "where the profile of the slope has sharp crests; polygon(..., rounding=...) rounds corners, "
            "Slope(..., rounding=...) crests"
        )


def _warn_of_fine_ground(names: _Names, lanes: CheckedLanes) -> None:
    """Warn of a polyline that is cut too finely for a body and a stiffness, where the user calls the package."""
    if lanes.tracks.is_plane:
        return
    found = too_fine(lanes.bodies, lanes.laws, lanes.slopes, lanes.tracks)
    if found is None:
        return
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and str(frame.f_globals.get("__name__")).startswith("sledenv."):
        level, frame = level + 1, frame.f_back
    warnings.warn(
        f"{names.slope.format(lane=found.lane)}.profile is cut too finely around x = {found.x:.6g} m: its weight "
        f"presses {names.body.format(lane=found.lane)} in by {found.depth:.3g} m, pieces there allow "
        f"{found.allowed:.3g} m; so many pieces bear it at once, as stiff as many springs. Slope(..., "
        "rounding=math.inf) makes them arcs; simulation.smoothing.fit_ground, or slope.tolerance_m in a scenario, "
        "fits few arcs",
        stacklevel=level,
    )


def has_sharp_corner(bodies: np.ndarray) -> np.ndarray:
    """Whether bodies, records of kernel.outline.BODY, have a corner without a radius: bools of the same shape."""
    listed = np.arange(bodies["r"].shape[1]) < bodies["count"][:, np.newaxis]
    # The end of a side that is listed as a corner, but lowest at one orientation alone, belongs to an arc.
    sharp: np.ndarray = (listed & (bodies["r"] == 0.0) & (bodies["high"] > bodies["low"])).any(axis=1)
    return sharp


def _admit(names: _Names, lanes: CheckedLanes) -> None:
    """Take whole turns off launches, in place, and lift those that lie on the surface up to rounding.

    A large orientation would round off every small turn that is added to it.

    Raises
    ------
    ValueError
        If one lies below the surface or beyond the end of its slope.
    """
    x, y, phi = lanes.launches.T[:3]
    if np.count_nonzero(np.abs(phi) > np.pi):
        phi[:] = within_a_turn(phi)
    lengths = lanes.slopes[:, 1]
    beyond = x >= lengths
    if np.count_nonzero(beyond):
        i = int(np.argmax(beyond))
        length = float(lengths[i if len(lengths) > 1 else 0])
        raise ValueError(f"{names.launch.format(lane=i)}.x = {float(x[i])!r}: must be < Slope.length = {length!r} m")
    if lanes.tracks.is_plane and not np.count_nonzero(y < (1.0 + _SURFACE) * lanes.bodies["size"]):
        return  # all are further up than their bodies reach
    lowest = resting_heights(lanes.bodies, x, phi, lanes.tracks)
    lies = y < lowest
    if np.count_nonzero(lies):
        below = y - lowest < -_SURFACE * lanes.bodies["size"]
        if below.any():
            i = int(np.argmax(below))
            raise ValueError(
                f"{names.launch.format(lane=i)}.y = {float(y[i])!r}: the launch lies below the surface; at "
                f"x = {float(x[i])!r} m and phi = {float(phi[i])!r} rad the mass centre must be at "
                f"y >= {float(lowest[i])!r} m"
            )
        y[lies] = lowest[lies]
