"""Checks of what a descent is simulated with, before the kernel sees it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sledenv.kernel import params
from sledenv.kernel.ground import MOST_ZONES
from sledenv.kernel.params import SCENE, ZONE_FIELDS, Limits
from sledenv.simulation.bodies import Body, made_body, records_of
from sledenv.simulation.fineness import too_fine
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.lanes import check_room
from sledenv.simulation.rules import checked_rows, checked_table, has_no_length, is_frame, made, or_absent, warn_user
from sledenv.simulation.scene import (
    AIR_DENSITY,
    ContactLaw,
    Profile,
    Slope,
    SlopeTable,
    State,
    Zone,
    misplaced_zones,
    vertices_of,
)
from sledenv.simulation.scenes import NO_ZONES, Scenes, columns, settle_speed
from sledenv.simulation.settings import Settings
from sledenv.simulation.support import within_a_turn

Bodies = Body | Sequence[Body] | np.ndarray
Laws = ContactLaw | Sequence[ContactLaw] | np.ndarray
Slopes = Slope | Sequence[Slope] | np.ndarray | SlopeTable

_SLOPE: Final = len(params.Slope._fields)
_LAW, _INCLINE = columns("stiffness", "corner_rolling_arm"), columns("angle", "air_density")
_SURFACE = 1e-9  # relative depth up to which a launch counts as lying on the surface


class CheckedDescent(NamedTuple):
    """Body, law, slope and launch of one descent, checked, and its scene."""

    body: Body
    law: ContactLaw
    slope: Slope
    launch: State
    scenes: Scenes  # of one lane, for the kernel


class _Names(NamedTuple):
    """Names of arguments in messages; ``{lane}`` becomes the number of a lane."""

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
    ground = Grounds.of((vertices_of(slope.ground),))
    zones = np.array([zone.row for zone in slope.zones]) if slope.zones else NO_ZONES
    places = 0.0, 0.0, len(ground.pieces), 0.0, len(zones)
    settle = settle_speed(slope.gravity, body.size) if settings.settle_speed is None else settings.settle_speed
    row = np.array([*places, *law, settle, *slope.incline, *launch, 1.0, 0.0])
    scenes = admitted(Scenes(row.view(SCENE), body.record, ground.pieces, zones), settings, _ONE)
    return CheckedDescent(body, law, slope, State.found(scenes.launches[0].tolist()), scenes)


def checked_scenes(body: Bodies, law: Laws, slope: Slopes, launches: ArrayLike, settings: Settings) -> Scenes:
    """Check what N lanes are given.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or the lane, the value and the allowed range.
    """
    if isinstance(launches, np.ndarray):  # one that is broadcast takes no room yet
        check_room(launches.size * 8, f"launches: their {launches.size} numbers", "give fewer at a time")
    starts = checked_table("launches", launches, State._fields, State.rules)
    bodies, laws = records_of(body, len(starts)), _rows_of_laws(law, len(starts))
    slopes, ground = _rows_of_slopes(slope, len(starts)), _grounds_of(slope)
    scenes = Scenes(np.zeros(len(starts), SCENE), bodies, ground.pieces, NO_ZONES)
    rows, table = scenes.rows, scenes.table
    rows["body"] = np.arange(len(bodies))
    rows["ground"], rows["ground_end"] = ground.places.T
    if slopes.shape[1] > _SLOPE:
        zones = slopes[:, _SLOPE:].reshape(len(slopes), -1, ZONE_FIELDS)
        there = ~np.isnan(zones).all(axis=-1)
        rows["zones_end"] = ends = np.cumsum(there.sum(axis=1))
        rows["zones"] = ends - there.sum(axis=1)
        scenes = scenes._replace(zones=zones[there])
    table[:, _LAW], table[:, _INCLINE], scenes.launches[:] = laws, slopes[:, :_SLOPE], starts
    own = settings.settle_speed
    rows["settle_speed"] = settle_speed(rows["gravity"], bodies["size"]) if own is None else own
    rows["rotor_inertia"] = 1.0
    return admitted(scenes, settings)


def admitted(scenes: Scenes, settings: Settings, names: _Names = _MANY) -> Scenes:
    """Return scenes whose fields are known to be right, if they are allowed together; else raise ValueError."""
    _check_bounce(names, scenes, settings.solver)
    _check_ground(names, scenes, settings.solver)
    _admit(names, scenes)
    warn_of_fine_ground(scenes, names)
    return scenes


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
        if len(codes) != 1:
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
    listed = isinstance(given, np.ndarray | Sequence) and not isinstance(given, tuple | str)
    if not (listed or is_frame(given)) or has_no_length(given):
        raise TypeError(f"{name} = {given!r}: must be a {kind.__name__} or a sequence of them")
    if len(given) != lanes:
        raise ValueError(f"{name}: {len(given)} given for {lanes} launches; give one or one a launch")
    if not lanes:
        raise ValueError(f"{name} has no row: give one {kind.__name__} for all where there are no launches")


def _rows_of_slopes(given: Any, lanes: int) -> np.ndarray:
    """Rows of one or of N slopes with their zones, shape (1 or N, 4 + 7 zones); see :mod:`sledenv.kernel.params`.

    What is given as numbers has no column of the air density: it is the usual one.
    """
    if isinstance(given, Slope):
        return np.array([(*given.incline, *given.row[3:])])
    with_air = isinstance(given, SlopeTable)
    if isinstance(given, SlopeTable):
        given = given.rows
    _check_rows("slope", Slope, given, lanes)
    fields = params.Slope._fields if with_air else params.Slope._fields[:-1]
    density: Any = AIR_DENSITY
    if isinstance(given, np.ndarray) or is_frame(given):
        widest = given.shape[1] if len(given.shape) == 2 else 0
    else:
        density = [one.air_density if isinstance(one, Slope) else AIR_DENSITY for one in given]
        given = [one.row if isinstance(one, Slope) else one for one in given]
        widest = max(map(_width, given))
        given = [(*one, *[math.nan] * (widest - _width(one))) if _width(one) >= len(fields) else one for one in given]
    zones = max((widest - len(fields)) // len(Zone._fields), 0)
    names = [f"zones[{k}].{name}" for k in range(zones) for name in Zone._fields]
    rows = checked_table("slope", given, (*fields, *names), Slope.rules)
    _check_rows("slope", Slope, rows, lanes)
    if zones > MOST_ZONES:
        raise ValueError(f"slope has columns of {zones} zones: must be at most {MOST_ZONES}")
    check_zones(rows[:, len(fields) :].reshape(len(rows), zones, len(Zone._fields)), rows[:, fields.index("length")])
    return rows if with_air else np.insert(rows, len(fields), density, axis=1)


def _grounds_of(given: Slopes) -> Grounds:
    """Ground of one or of N slopes."""
    if isinstance(given, Slope):
        return Grounds.of((vertices_of(given.ground),))
    if isinstance(given, SlopeTable):
        return Grounds.of((vertices_of(given.profile),))
    rows: Any = () if isinstance(given, np.ndarray) or is_frame(given) else given
    found: dict[Profile, int] = {}
    seen: dict[int, int] = {}  # by identity, as long ones take a while to compare
    numbers = []
    profiles = [one.ground if isinstance(one, Slope) and one.profile else () for one in rows]
    for slope, profile in zip(rows, profiles, strict=True):
        if id(slope) not in seen:
            seen[id(slope)] = found.setdefault(profile, len(found))
        numbers.append(seen[id(slope)])
    return Grounds.of([vertices_of(profile) for profile in found or [()]], numbers)


def _width(row: Any) -> int:
    """Columns of a row of numbers; 0 of anything else."""
    return len(row) if isinstance(row, tuple | list) or (isinstance(row, np.ndarray) and row.ndim == 1) else 0


class _ZoneOfTable(params.Zone):
    """A zone as rows have it: NaN for None."""

    rules = (*Zone.rules, *map(or_absent, Zone.optional_rules))


def check_zones(zones: np.ndarray, lengths: np.ndarray) -> None:
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


def _check_bounce(names: _Names, scenes: Scenes, solver: str) -> None:
    """Refuse compliant surfaces that give nothing back.

    Raises
    ------
    ValueError
        Naming the law or the zone.
    """
    why = "springs that give nothing back never let go; solver = 'rigid' takes it"
    if solver == "rigid":
        return
    plastic = scenes.rows["asymmetry"] == 1.0
    if np.count_nonzero(plastic):  # of few lanes any() takes ten times as long
        name = names.law.format(lane=int(np.argmax(plastic)))
        raise ValueError(f"{name}.asymmetry = 1.0 (restitution 0): must be in [0, 1) with solver = {solver!r}: {why}")
    dead = scenes.zones[:, Zone._fields.index("restitution")] == 0.0
    if np.count_nonzero(dead):
        k = int(np.argmax(dead))
        lane = int(np.argmax(scenes.rows["zones_end"] > k))
        name = f"{names.slope.format(lane=lane)}.zones[{k - int(scenes.rows['zones'][lane])}]"
        raise ValueError(f"{name}.restitution = 0.0: must be in (0, 1] with solver = {solver!r}: {why}")


def _check_ground(names: _Names, scenes: Scenes, solver: str) -> None:
    """Refuse what cannot be simulated over a profile.

    Raises
    ------
    ValueError
        For rigid surfaces, and for a body with a sharp corner where there are sharp crests.
    """
    if scenes.is_plane:
        return
    if solver != "compliant":
        raise ValueError(f"solver = {solver!r}: must be 'compliant' on a slope with a profile")
    sharp = has_sharp_corner(scenes.bodies)
    if not sharp.any():
        return
    pieces, rows = scenes.pieces, scenes.rows
    crests = np.r_[0, np.cumsum((pieces["bend"] > 0) & (pieces["radius"] == 0.0))]
    begins, ends = (rows[name].astype(np.intp) for name in ("ground", "ground_end"))
    wrong = sharp[scenes.body] & (crests[ends] > crests[begins])
    if wrong.any():
        raise ValueError(
            f"{names.body.format(lane=int(np.argmax(wrong)))} has a sharp corner: all arcs must have a radius > 0 "
            "where the profile of the slope has sharp crests; polygon(..., rounding=...) rounds corners, "
            "Slope(..., rounding=...) crests"
        )


def warn_of_fine_ground(scenes: Scenes, names: _Names = _ONE) -> None:
    """Warn of a polyline that is cut too finely for a body and a stiffness, where the user calls the package."""
    found = None if scenes.is_plane else too_fine(scenes)
    if found is None:
        return
    warn_user(
        f"{names.slope.format(lane=found.lane)}.profile is cut too finely around x = {found.x:.6g} m: its weight "
        f"presses {names.body.format(lane=found.lane)} in by {found.depth:.3g} m, pieces there allow "
        f"{found.allowed:.3g} m; so many pieces bear it at once, as stiff as many springs. Slope(..., "
        "rounding=math.inf) makes them arcs; simulation.smoothing.fit_ground, or slope.tolerance_m in a scenario, "
        "fits few arcs"
    )


def has_sharp_corner(bodies: np.ndarray) -> np.ndarray:
    """Whether bodies, records of kernel.outline.BODY, have a corner without a radius: bools of the same shape."""
    listed = np.arange(bodies["r"].shape[1]) < bodies["count"][:, np.newaxis]
    # The end of a side that is listed as a corner, but lowest at one orientation alone, belongs to an arc.
    sharp: np.ndarray = (listed & (bodies["r"] == 0.0) & (bodies["high"] > bodies["low"])).any(axis=1)
    return sharp


def _admit(names: _Names, scenes: Scenes) -> None:
    """Take whole turns off launches, in place, and lift those that lie on the surface up to rounding.

    A large orientation would round off every small turn that is added to it.

    Raises
    ------
    ValueError
        If one lies below the surface or beyond the end of its slope.
    """
    x, y, phi = scenes.launches.T[:3]
    if np.count_nonzero(np.abs(phi) > np.pi):
        phi[:] = within_a_turn(phi)
    lengths = scenes.rows["length"]
    beyond = x >= lengths
    if np.count_nonzero(beyond):
        i = int(np.argmax(beyond))
        length = float(lengths[i])
        raise ValueError(f"{names.launch.format(lane=i)}.x = {float(x[i])!r}: must be < Slope.length = {length!r} m")
    sizes = scenes.bodies["size"] if len(scenes.bodies) == 1 else scenes.of_body("size")
    if scenes.is_plane and not np.count_nonzero(y < (1.0 + _SURFACE) * sizes):
        return  # all are further up than their bodies reach
    lowest = scenes.resting_heights(x, phi)
    lies = y < lowest
    if np.count_nonzero(lies):
        below = y - lowest < -_SURFACE * sizes
        if below.any():
            i = int(np.argmax(below))
            raise ValueError(
                f"{names.launch.format(lane=i)}.y = {float(y[i])!r}: the launch lies below the surface; at "
                f"x = {float(x[i])!r} m and phi = {float(phi[i])!r} rad the mass centre must be at "
                f"y >= {float(lowest[i])!r} m"
            )
        y[lies] = lowest[lies]
