"""Contact law, slope with its profile and its zones, and launch: every field is checked."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, ClassVar, Final, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sledenv.kernel import params
from sledenv.kernel.ground import MOST_ZONES
from sledenv.simulation.bends import MOST_VERTICES, STEEPEST
from sledenv.simulation.grounds import heights_on, pieces_of
from sledenv.simulation.rules import (
    CLOSED_FRACTION,
    FINITE,
    NOT_NEGATIVE,
    POSITIVE,
    STEEPNESS,
    Checked,
    Rule,
    checked,
    checked_fields,
    has_no_length,
    made,
    numbers_of,
)
from sledenv.simulation.terrain import ground_of

Floats = NDArray[np.float64]
Profile = tuple[tuple[float, float, float], ...]  # vertices x, y and the radii with which they are rounded [m]

AIR_DENSITY: Final = 1.2  # [kg/m^3] at sea level and some 20 degrees
STRAIGHT: Final = 1e-13  # sine of the turn of a vertex that is none, if rounding of its place makes no larger one
_ROUNDED: Final = 4.0 * 2.0**-52  # of the coordinates

_PAIRS: Final = "must be a sequence of pairs (x, y) of numbers, or an array of shape (n, 2)"
_PLACE: Rule = (lambda v: v > -math.inf, "in (-inf, inf] m")
_LENGTH: Rule = (lambda v: v > 0.0, "in (0, inf] m")
_RADIUS: Rule = (lambda v: v >= 0.0, "in [0, inf] m")


# Profiles.


def checked_profile(given: Any, rounding: Any = 0.0) -> Profile:
    """Return the vertices of a profile with their radii, those without a turn left out, or raise an error.

    A profile that is straight and lies in the plane is none. One that is straight and lies higher or lower keeps its
    first and its last vertex.

    Raises
    ------
    TypeError, ValueError
        Naming the vertex, its value and what is allowed: see :class:`sledenv.Slope`.
    """
    vertices = np.empty((0, 2)) if isinstance(given, tuple) and not given else _numbers(given)
    radii = _checked_rounding(rounding, len(vertices))
    if not len(vertices):
        return ()
    with np.errstate(all="ignore"):  # of numbers too large to be squared
        return _checked_vertices(vertices, radii)


def _checked_rounding(given: Any, count: int) -> Floats:
    """Return the radius [m] of each of so many vertices, or raise TypeError or ValueError."""
    if isinstance(given, tuple | list) or (isinstance(given, np.ndarray) and given.ndim == 1):
        if isinstance(given, tuple) and not given:
            return np.zeros(count)
        if len(given) != count:
            held = f"{len(given)} numbers"
            raise ValueError(
                f"Slope.rounding holds {held}: must hold one for each of {count} vertices, or be one number"
            )
        return np.array([checked("Slope", f"rounding[{k}]", radius, _RADIUS) for k, radius in enumerate(given)])
    return np.full(count, checked("Slope", "rounding", given, _RADIUS))


def _checked_vertices(vertices: Floats, radii: Floats) -> Profile:
    """As :func:`checked_profile`, of finite numbers of shape (n, 2), n > 0, and radii of shape (n,)."""
    if not 2 <= len(vertices) <= MOST_VERTICES:
        raise ValueError(f"Slope.profile holds {len(vertices)}: must hold no vertex, or 2 to {MOST_VERTICES}")
    x, y = vertices.T
    along, up = np.diff(x), np.diff(y)
    falls = ~(along > 0.0)
    if falls.any():
        k = int(np.argmax(falls)) + 1
        raise ValueError(
            f"Slope.profile[{k}].x = {float(x[k])!r}: must be > that of the vertex before, {float(x[k - 1])!r} m"
        )
    steep = ~(np.abs(up) <= math.tan(STEEPEST) * along)
    if steep.any():
        k = int(np.argmax(steep)) + 1
        reach = math.tan(STEEPEST) * float(along[k - 1])
        allowed = f"[{float(y[k - 1]) - reach!r}, {float(y[k - 1]) + reach!r}]"
        raise ValueError(
            f"Slope.profile[{k}].y = {float(y[k])!r}: must be in {allowed} m, so that the piece before it is at most "
            f"{math.degrees(STEEPEST):g} degrees steep to the plane"
        )
    turning = _turning(vertices)
    if turning.sum() < 2:
        turning[:] = False
        turning[[0, -1]] = True
        if not vertices[turning, 1].any():
            return ()
    kept = np.column_stack([vertices, radii])[turning]
    return tuple((x, y, radius) for x, y, radius in kept.tolist())


def _numbers(given: Any) -> Floats:
    """Return what is given for vertices as finite numbers, shape (n, 2), or raise TypeError or ValueError."""
    if isinstance(given, np.ma.MaskedArray):
        raise TypeError(f"Slope.profile is a masked array: {_PAIRS}, without a mask")
    if isinstance(given, np.ndarray):
        if given.ndim != 2 or given.shape[1] != 2:
            raise ValueError(f"Slope.profile has shape {given.shape}: must be (n, 2), columns x, y")
        if given.dtype.kind not in "iuf":
            raise TypeError(f"Slope.profile holds {given.dtype}: must hold numbers, columns x, y")
        given = given.astype(float)
        if np.isfinite(given).all():
            return np.asarray(given + 0.0)  # no -0.0
        given = given.tolist()
    elif not isinstance(given, tuple | list):
        raise TypeError(f"Slope.profile = {given!r}: {_PAIRS}")
    numbers = np.empty((len(given), 2))
    for k, vertex in enumerate(given):
        listed = (len(vertex),) if isinstance(vertex, tuple | list) else ()
        if (vertex.shape if isinstance(vertex, np.ndarray) else listed) != (2,):
            raise TypeError(f"Slope.profile[{k}] = {vertex!r}: must be a pair (x, y) of numbers")
        if isinstance(vertex, np.ma.MaskedArray):
            raise TypeError(f"Slope.profile[{k}] is a masked array: {_PAIRS}, without a mask")
        for column, field in enumerate("xy"):
            numbers[k, column] = checked(f"Slope.profile[{k}]", field, vertex[column], FINITE)
    return numbers + 0.0


def _turning(vertices: Floats) -> NDArray[np.bool_]:
    """Whether the ground turns at each vertex of shape (n, 2), those left out without that it does not."""
    kept = np.ones(len(vertices), bool)
    while True:  # without a vertex, its neighbours may turn by less
        found = np.flatnonzero(kept)
        straight = _straight(vertices[found])
        if not straight.any():
            return kept
        before: list[int] = []  # the last one that stays: seen from there, small turns add up
        for k, here in enumerate(found.tolist()):
            if straight[k]:
                kept[here] = not _straight(vertices[[*before, *found[k : k + 2]]])[len(before)]
            if kept[here]:
                before = [here]


def _straight(vertices: Floats) -> NDArray[np.bool_]:
    """Whether the ground goes straight on at each vertex of shape (n, 2), up to rounding."""
    along, up = np.diff(vertices, axis=0).T
    lengths = np.r_[math.inf, np.hypot(along, up), math.inf]
    steep = np.r_[0.0, np.abs(up) / along, 0.0]
    rounded = np.abs(vertices[:, 1]) + np.maximum(steep[:-1], steep[1:]) * np.abs(vertices[:, 0])
    rounding = _ROUNDED * rounded / np.minimum(lengths[:-1], lengths[1:])
    found: NDArray[np.bool_] = np.abs(_turns(vertices)) < np.maximum(STRAIGHT, rounding)
    return found


def _turns(vertices: Floats) -> Floats:
    """Sine of the turn at each vertex, shape (n,): > 0 in a dip, < 0 on a crest."""
    along, up = tangents(vertices).T
    turns: Floats = along[:-1] * up[1:] - up[:-1] * along[1:]
    return turns


def vertices_of(profile: Profile) -> Floats:
    """Return the vertices of a profile and their radii, shape (n, 3), in C order."""
    return np.array(profile, float).reshape(len(profile), 3)


def tangents(vertices: Floats) -> Floats:
    """Unit tangents of the pieces of the ground, shape (n + 1, 2), from n vertices x, y."""
    level = np.array([[1.0, 0.0]])
    if not len(vertices):
        return level
    pieces = np.diff(vertices[:, :2], axis=0)
    return np.concatenate([level, pieces / np.hypot(*pieces.T)[:, np.newaxis], level])


def sharp_crests(vertices: Floats) -> NDArray[np.bool_]:
    """Whether each vertex, of shape (n, 3), is a crest without a radius, shape (n,)."""
    sharp: NDArray[np.bool_] = (_turns(vertices) < 0.0) & (vertices[:, 2] == 0.0)
    return sharp


# Contact laws, slopes and launches.


def restitution_of(asymmetry: Any) -> Any:
    """Energetic coefficient of restitution e [-] of an asymmetry, float or array: docs/physics.md (5.3)."""
    return np.sqrt((1.0 - asymmetry) / (1.0 + asymmetry))


def asymmetry_of(restitution: Any) -> Any:
    """Asymmetry Delta [-] of a coefficient of restitution, float or array, 1 of 0 alone: docs/physics.md (5.3)."""
    squared = restitution * restitution
    most = np.where(restitution == 0.0, 1.0, math.nextafter(1.0, 0.0))
    return np.minimum((1.0 - squared) / (1.0 + squared), most)


class ContactLaw(Checked, params.ContactLaw):
    """How the body touches the slope: docs/physics.md, section 5.

    Parameters
    ----------
    stiffness : float
        Mean normal stiffness c [N/m], > 0: c(1 + asymmetry) while the gap closes, c(1 - asymmetry) while it opens.
    asymmetry : float
        Delta [-] in [0, 1]; restitution is sqrt((1 - Delta)/(1 + Delta)). Only rigid surfaces may have 1, which gives
        nothing back.
    friction : float
        Coulomb coefficient f [-], >= 0.
    rolling_arm : float
        Arm delta of the rolling resistance of the arc [m], >= 0.
    corner_rolling_arm : float
        The same for a corner [m], >= 0; 0 by default.

    Raises
    ------
    TypeError, ValueError
        Naming the field, its value and the allowed range.
    """

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (POSITIVE, CLOSED_FRACTION, NOT_NEGATIVE, NOT_NEGATIVE, NOT_NEGATIVE)

    def __new__(
        cls,
        stiffness: float,
        asymmetry: float,
        friction: float,
        rolling_arm: float,
        corner_rolling_arm: float = 0.0,
    ) -> Self:
        values = checked_fields(cls, stiffness, asymmetry, friction, rolling_arm, corner_rolling_arm)
        return super().__new__(cls, *values)

    @property
    def restitution(self) -> float:
        """Energetic coefficient of restitution e [-] of an impact without gravity: docs/physics.md (5.3)."""
        return float(restitution_of(self.asymmetry))

    @classmethod
    def from_restitution(
        cls,
        restitution: float,
        *,
        stiffness: float,
        friction: float,
        rolling_arm: float,
        corner_rolling_arm: float = 0.0,
    ) -> ContactLaw:
        """Build the law from the coefficient of restitution e [-] in [0, 1] instead of the asymmetry."""
        asymmetry = asymmetry_of(checked("ContactLaw", "restitution", restitution, CLOSED_FRACTION))
        return cls(stiffness, asymmetry, friction, rolling_arm, corner_rolling_arm)


class Zone(Checked, params.Zone):
    """A part of a slope with a surface of its own: docs/physics.md, section 11.

    Parameters
    ----------
    begin, end : float
        Where the contact point is in the zone, as x along the slope [m]; ``end`` > ``begin`` may be inf.
    friction : float
        Coulomb coefficient f [-], >= 0.
    rolling_arm : float
        Arm delta of the rolling resistance of an arc [m], >= 0.
    corner_rolling_arm : float
        The same for a corner [m], >= 0; 0 by default.
    restitution : float, optional
        Energetic coefficient of restitution e [-] in [0, 1] of contacts that begin in the zone; that of the contact law
        by default. Only rigid surfaces may have 0.
    stiffness : float, optional
        Mean normal stiffness c [N/m], > 0, of contacts that begin in the zone; that of the contact law by default.
        Surfaces of the rigid solver have none.

    Raises
    ------
    TypeError, ValueError
        Naming the field, its value and the allowed range.
    """

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (FINITE, _PLACE, NOT_NEGATIVE, NOT_NEGATIVE, NOT_NEGATIVE)
    optional_rules: ClassVar[tuple[Rule, ...]] = (CLOSED_FRACTION, POSITIVE)  # of the other fields, which may be None

    def __new__(
        cls,
        begin: float,
        end: float,
        friction: float,
        rolling_arm: float,
        corner_rolling_arm: float = 0.0,
        restitution: float | None = None,
        stiffness: float | None = None,
    ) -> Self:
        given = checked_fields(cls, begin, end, friction, rolling_arm, corner_rolling_arm)
        begin, end, friction, rolling_arm, corner_rolling_arm = given
        if not begin < end:
            raise ValueError(f"Zone.end = {end!r}: must be > Zone.begin = {begin!r} m")
        if restitution is not None:
            restitution = checked("Zone", "restitution", restitution, CLOSED_FRACTION)
        if stiffness is not None:
            stiffness = checked("Zone", "stiffness", stiffness, POSITIVE)
        return super().__new__(cls, begin, end, friction, rolling_arm, corner_rolling_arm, restitution, stiffness)

    @property
    def row(self) -> tuple[float, ...]:
        """The fields as they are in a row of a table of slopes: NaN for None."""
        return tuple(math.nan if field is None else field for field in self)

    def given(self) -> dict[str, float]:
        """Return the fields by name, without those that are None."""
        return {name: field for name, field in self._asdict().items() if field is not None}


class _SlopeFields(NamedTuple):
    angle: float  # [rad] beta, positive downhill
    length: float  # [m] where the descent finishes; may be inf
    gravity: float  # [m/s^2]
    zones: tuple[Zone, ...]
    profile: tuple[tuple[float, float], ...]
    rounding: tuple[float, ...]  # of each vertex; none if all are 0
    air_density: float  # [kg/m^3]


class Slope(Checked, _SlopeFields):
    """A straight incline, or the ground along one: docs/physics.md, sections 1 and 12.

    Parameters
    ----------
    angle : float
        Inclination beta [rad] in (-pi/2, pi/2); x runs downhill where it is positive.
    length : float
        The descent finishes where the mass centre reaches x = length [m], > 0; inf by default.
    gravity : float
        Gravitational acceleration [m/s^2], >= 0.
    zones : sequence of Zone
        Up to 64 parts with surfaces of their own, one behind the other along the slope; elsewhere that of the contact
        law holds. None by default.
    profile : sequence of pairs, or ndarray of shape (n, 2)
        Vertices (x, y) [m] of the ground: y is its height over the plane of the slope, along whose outward normal it is
        measured. From 2 to 16384, x strictly increasing, no piece between two of them steeper to the plane than 80
        degrees. Before the first and behind the last one the ground goes on parallel to the plane. A vertex without a
        turn is left out, so that how a straight piece is cut changes nothing. The plane itself by default.
    rounding : float, or sequence of float
        Radius [m] of the arc that rounds each vertex of the profile, in [0, inf]: one for all, or one for each. The arc
        touches both pieces; its radius is smaller where it would take more than 0.49 of one of them. 0 by default.
    air_density : float
        [kg/m^3], >= 0; 1.2 by default. It counts for bodies that have a drag area.

    Raises
    ------
    TypeError, ValueError
        Naming the field, its value and the allowed range; zones must be in order, must not overlap, and must not go
        beyond the end of the slope, unless without end.
    """

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (STEEPNESS, _LENGTH, NOT_NEGATIVE)

    def __new__(
        cls,
        angle: float,
        length: float = math.inf,
        gravity: float = 9.81,
        zones: Iterable[Zone] = (),
        profile: Sequence[Sequence[float]] | np.ndarray = (),
        rounding: float | Sequence[float] | np.ndarray = 0.0,
        air_density: float = AIR_DENSITY,
    ) -> Self:
        given = zip(cls._fields, (angle, length, gravity), cls.rules, strict=False)
        angle, length, gravity = (checked("Slope", name, value, rule) for name, value, rule in given)
        air_density = checked("Slope", "air_density", air_density, NOT_NEGATIVE)
        ground = checked_profile(profile, rounding)
        vertices, radii = tuple((x, y) for x, y, _ in ground), tuple(radius for _, _, radius in ground)
        bends = radii if any(radii) else ()
        return super().__new__(cls, angle, length, gravity, _checked_zones(zones, length), vertices, bends, air_density)

    @classmethod
    def from_terrain(
        cls,
        x: ArrayLike,
        z: ArrayLike,
        *,
        angle: float | None = None,
        length: float | None = None,
        gravity: float = 9.81,
        zones: Iterable[Zone] = (),
        tolerance: float | None = None,
        steepest: float | None = None,
        air_density: float = AIR_DENSITY,
    ) -> Self:
        """Return the slope of a section of terrain, as scenarios and studies read it out of a file.

        Parameters
        ----------
        x, z : array_like, shape (n,)
            Horizontal distance and elevation [m] of the surface, one point behind the other, 2 <= n. The origin of the
            slope is the ground at x = 0.
        angle : float, optional
            Of the plane [rad] over which the ground is measured; by default that through the first and the last point,
            to a millionth of a degree.
        length : float, optional
            Where descents finish, along the plane [m]; at the last point by default.
        gravity, zones, air_density
            As for the class; zones begin and end along the plane.
        tolerance : float, optional
            Tell the ground by few straight pieces and arcs that differ from it by at most this [m], off the plane:
            :func:`sledenv.simulation.smoothing.fit_ground`. Otherwise the points are sharp vertices.
        steepest : float, optional
            Angle [rad] in (0, 80 degrees] to the plane, up to which steeper faces, and overhangs, are filled up: the
            ground is the lowest one over all points that has no steeper face. A warning says how many points are under
            it, and how far. Without it they are refused.

        Raises
        ------
        TypeError, ValueError
            Naming the point or the argument, its value and what is allowed.

        Examples
        --------
        >>> slope = Slope.from_terrain([0.0, 30.0, 60.0], [20.0, 12.0, 0.0])
        >>> round(math.degrees(slope.angle), 1), round(slope.length, 1), float(slope.height_at(slope.length).round(3))
        (18.4, 63.2, 0.0)
        """
        found = ground_of(x, z, angle, tolerance, steepest)
        end = float(found.vertices[-1, 0]) if length is None else length
        return cls(found.angle, end, gravity, zones, found.told[:, :2], found.told[:, 2], air_density)

    @property
    def row(self) -> tuple[float, ...]:
        """Angle, length and gravity, and then the fields of each zone: a row of a table of slopes, without profile."""
        return (*self[:3], *(number for zone in self.zones for number in zone.row))

    @property
    def incline(self) -> tuple[float, float, float, float]:
        """Angle, length, gravity and air density: what a scene has of a slope beside its ground and its zones."""
        return self.angle, self.length, self.gravity, self.air_density

    @property
    def ground(self) -> Profile:
        """Vertices x, y of the profile and their radii [m]."""
        radii = self.rounding or (0.0,) * len(self.profile)
        return tuple((x, y, radius) for (x, y), radius in zip(self.profile, radii, strict=True))

    @property
    def vertices(self) -> np.ndarray:
        """Vertices x, y of the profile and their radii [m], a new array of shape (n, 3); (0, 3) without one."""
        return vertices_of(self.ground)

    def height_at(self, x: ArrayLike) -> np.ndarray:
        """Height [m] of the ground over the plane of the slope at places ``x`` [m] along it, same shape."""
        places = numbers_of("x", x, "numbers")
        return heights_on(pieces_of(self.vertices), places)

    def friction_at(self, x: ArrayLike, elsewhere: float) -> np.ndarray:
        """Friction [-] at places ``x`` [m] along the slope, same shape; ``elsewhere`` is that outside of the zones."""
        places = numbers_of("x", x, "numbers")
        friction = np.full(places.shape, checked("friction_at", "elsewhere", elsewhere, NOT_NEGATIVE))
        for zone in self.zones:
            friction[(places >= zone.begin) & (places < zone.end)] = zone.friction
        return friction


class SlopeTable(NamedTuple):
    """Many slopes as a table, over one profile that has been checked."""

    rows: np.ndarray  # angle, length, gravity and air density, then the fields of zones, NaN where one has fewer
    profile: Profile


def _checked_zones(zones: Any, length: float) -> tuple[Zone, ...]:
    """Return the zones of a slope of some length [m], each checked, or raise TypeError or ValueError."""
    if isinstance(zones, tuple) and not zones:
        return ()
    if isinstance(zones, str | Zone) or not isinstance(zones, Iterable) or has_no_length(zones):
        raise TypeError(f"Slope.zones = {zones!r}: must be a sequence of Zone")
    made_zones = tuple(made(f"Slope.zones[{k}]", Zone, zone) for k, zone in enumerate(zones))
    if len(made_zones) > MOST_ZONES:
        raise ValueError(f"Slope.zones holds {len(made_zones)}: must hold at most {MOST_ZONES}")
    for one in misplaced_zones([zone[:2] for zone in made_zones], length):
        if one.wrong:
            value = getattr(made_zones[one.zone], one.field)
            raise ValueError(f"Slope.zones[{one.zone}].{one.field} = {value!r}: {one.what.format(float(one.bound))}")
    return made_zones


class MisplacedZone(NamedTuple):
    """One way in which the place of a zone may be wrong, of one slope or of many."""

    zone: int
    field: str  # "begin" or "end"
    wrong: Any  # whether it is; bools of the shape of what is given
    what: str  # what it must be, with a place for the bound
    bound: Any  # [m] of the shape of what is given


def misplaced_zones(places: Iterable[Sequence[Any]], length: Any) -> Iterator[MisplacedZone]:
    """Look at the places of zones on a slope, one behind the other, or on many.

    Parameters
    ----------
    places : iterable of pairs
        Begin and end [m] of each zone: numbers, or arrays with one for each slope, NaN where it has fewer zones.
    length : float or ndarray
        Of the slope [m].
    """
    reached = -math.inf
    for zone, (begin, end) in enumerate(places):
        yield MisplacedZone(zone, "begin", begin < reached, "must be >= the end of the zone before, {!r} m", reached)
        yield MisplacedZone(zone, "begin", begin >= length, "must be < Slope.length = {!r} m", length)
        yield MisplacedZone(zone, "end", end <= begin, "must be > its begin, {!r} m", begin)
        beyond = (end > length) & (end < math.inf)
        yield MisplacedZone(zone, "end", beyond, "must be <= Slope.length = {!r} m, or inf", length)
        reached = np.fmax(reached, end)


class State(Checked, params.State):
    """Position, orientation and velocity of the body: docs/physics.md, section 1.

    ``x``, ``y`` [m] locate the mass centre in the slope frame, ``phi`` [rad] is counter-clockwise (a
    simulation takes whole turns off that of a launch, and goes on from there without wrapping),
    ``u``, ``v`` [m/s] and ``omega`` [rad/s] are their rates.

    Raises
    ------
    TypeError, ValueError
        If a field is not a finite number.
    """

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (FINITE,) * 6

    def __new__(cls, x: float, y: float, phi: float, u: float = 0.0, v: float = 0.0, omega: float = 0.0) -> Self:
        return super().__new__(cls, *checked_fields(cls, x, y, phi, u, v, omega))

    @classmethod
    def found(cls, fields: Iterable[float]) -> Self:
        """Return what a simulation has come to: one that is not finite is a result there, not an error."""
        return tuple.__new__(cls, fields)
