"""What a body meets and how it starts: contact law, slope and launch, with every field checked."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from sledenv.kernel import params
from sledenv.kernel.ground import MOST_ZONES
from sledenv.simulation.profiles import Profile, checked_profile, vertices_of
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
    made,
    or_absent,
)

_PLACE: Rule = (lambda v: v > -math.inf, "in (-inf, inf] m")
_LENGTH: Rule = (lambda v: v > 0.0, "in (0, inf] m")


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


AnyLaw = ContactLaw


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
    profile: Profile


class Slope(Checked, _SlopeFields):
    """A straight incline, or the ground along one: docs/physics.md, section 1.

    Parameters
    ----------
    angle : float
        Inclination beta [rad] in (-pi/2, pi/2); x runs downhill where it is positive.
    length : float
        The descent finishes where the mass centre reaches x = length [m], > 0; inf by default.
    gravity : float
        Gravitational acceleration [m/s^2], >= 0.
    zones : sequence of Zone
        Up to 8 parts with surfaces of their own, one behind the other along the slope; elsewhere that of the contact
        law holds. None by default.
    profile : sequence of pairs, or ndarray of shape (n, 2)
        Vertices (x, y) [m] of the ground: y is its height over the plane of the slope, along whose outward normal it is
        measured. From 2 to 16384, x strictly increasing, no piece between two of them steeper to the plane than 80
        degrees. Before the first and behind the last one the ground goes on parallel to the plane. A vertex without a
        turn is left out, so that how a straight piece is cut changes nothing. The plane itself by default.

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
    ) -> Self:
        angle, length, gravity = (
            checked("Slope", name, value, rule)
            for name, value, rule in zip(cls._fields, (angle, length, gravity), cls.rules, strict=False)
        )
        return super().__new__(cls, angle, length, gravity, _checked_zones(zones, length), checked_profile(profile))

    @property
    def row(self) -> tuple[float, ...]:
        """Angle, length and gravity, and then the fields of each zone: a row of a table of slopes, without profile."""
        return (*self[:3], *(number for zone in self.zones for number in zone.row))

    @property
    def vertices(self) -> np.ndarray:
        """Vertices x, y [m] of the profile, a new array of shape (n, 2); (0, 2) without one."""
        return vertices_of(self.profile)

    def height_at(self, x: ArrayLike) -> np.ndarray:
        """Height [m] of the ground over the plane of the slope at places ``x`` [m] along it, same shape."""
        places = np.asarray(x, float)
        if not self.profile:
            return np.zeros(places.shape)
        return np.asarray(np.interp(places, *self.vertices.T))

    def friction_at(self, x: np.ndarray, elsewhere: float) -> np.ndarray:
        """Friction [-] at places ``x`` [m] along the slope, same shape; ``elsewhere`` is that outside of the zones."""
        friction = np.full(np.shape(x), elsewhere)
        for zone in self.zones:
            friction[(x >= zone.begin) & (x < zone.end)] = zone.friction
        return friction


class SlopeTable(NamedTuple):
    """Many slopes that have one profile."""

    rows: np.ndarray  # angle, length and gravity, then the fields of zones: see :mod:`sledenv.kernel.params`
    over: Slope  # whose profile they have


def _checked_zones(zones: Any, length: float) -> tuple[Zone, ...]:
    """Return the zones of a slope of some length [m], each checked, or raise TypeError or ValueError."""
    if isinstance(zones, tuple) and not zones:
        return ()
    if isinstance(zones, str | Zone) or not isinstance(zones, Iterable):
        raise TypeError(f"Slope.zones = {zones!r}: must be a sequence of Zone")
    made_zones = tuple(made(f"Slope.zones[{k}]", Zone, zone) for k, zone in enumerate(zones))
    if len(made_zones) > MOST_ZONES:
        raise ValueError(f"Slope.zones holds {len(made_zones)}: must hold at most {MOST_ZONES}")
    reached = -math.inf
    for k, zone in enumerate(made_zones):
        name = f"Slope.zones[{k}]"
        if zone.begin < reached:
            raise ValueError(f"{name}.begin = {zone.begin!r}: must be >= the end of the zone before, {reached!r} m")
        if zone.begin >= length:
            raise ValueError(f"{name}.begin = {zone.begin!r}: must be < Slope.length = {length!r} m")
        if length < zone.end < math.inf:
            raise ValueError(f"{name}.end = {zone.end!r}: must be <= Slope.length = {length!r} m, or inf")
        reached = zone.end
    return made_zones


def zones_allowed(zones: np.ndarray) -> np.ndarray:
    """Whether zones of slopes, shape (N, K, fields), are allowed behind those before them: shape (N, K)."""
    fine = np.ones(zones.shape[:2], bool)
    rules = (*Zone.rules, *map(or_absent, Zone.optional_rules))
    for column, (accepts, _) in zip(np.moveaxis(zones, 2, 0), rules, strict=True):
        fine &= accepts(column)
    fine &= zones[:, :, 0] < zones[:, :, 1]
    fine[:, 1:] &= zones[:, 1:, 0] >= zones[:, :-1, 1]
    return fine


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
