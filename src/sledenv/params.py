"""What a descent is given: the tuples of floats that kernels take, with every field checked."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, Self, TypeVar, get_args

import numpy as np

from sledenv.kernel import params

_T = TypeVar("_T", bound=tuple[Any, ...])

Rule = tuple[Callable[[Any], Any], str]  # what accepts a float, or each entry of an array; what it accepts, in words

FINITE: Rule = (lambda v: abs(v) < math.inf, "a finite number")
NOT_NEGATIVE: Rule = (lambda v: (v >= 0.0) & (v < math.inf), "in [0, inf)")
STEEPNESS: Rule = (lambda v: abs(v) < math.pi / 2, "in (-pi/2, pi/2) rad")
RESTITUTION: Rule = (lambda v: (v > 0.0) & (v <= 1.0), "in (0, 1]")
CLOSED_FRACTION: Rule = (lambda v: (v >= 0.0) & (v <= 1.0), "in [0, 1]")
POSITIVE: Rule = (lambda v: (v > 0.0) & (v < math.inf), "in (0, inf)")
_HALF_ANGLE: Rule = (lambda v: (v > 0.0) & (v <= math.pi), "in (0, pi] rad")
_FRACTION: Rule = (lambda v: (v >= 0.0) & (v < 1.0), "in [0, 1)")
_LENGTH: Rule = (lambda v: v > 0.0, "in (0, inf] m")
_ON_CHORD = 1e-15  # of the radius: a mass centre that is farther outside the chord is so by more than rounding
_INTERVAL: Rule = (lambda v: (v >= 1e-12) & (v < math.inf), "in [1e-12, inf) s")
_THIN = 0.3  # [rad] half-angle below which the closed form of a segment loses digits
TOLERANCE = 1e-14  # default of Limits
_TOLERANCE: Rule = (lambda v: (v >= 1e-18) & (v <= 1e-3), "in [1e-18, 1e-3]")


def checked(owner: str, field: str, value: Any, rule: Rule) -> float:
    """Return ``value`` as a float, or raise an error that names field, value and allowed range.

    Raises
    ------
    TypeError
        If ``value`` is not a real number.
    ValueError
        If ``value`` is NaN or outside the range.
    """
    accepts, allowed = rule
    if type(value) is float and accepts(value):
        return value
    try:
        if isinstance(value, str | bytes) or getattr(value, "dtype", np.dtype(float)).kind not in "biuf":
            raise TypeError
        number = float(value)
    except (TypeError, ValueError):
        comma = "," if allowed.startswith("a ") else ""
        raise TypeError(f"{owner}.{field} = {value!r}: must be a number{comma} {allowed}") from None
    if not accepts(number):
        raise ValueError(f"{owner}.{field} = {value!r}: must be {allowed}")
    return number


def made(name: str, kind: type[_T], value: Any) -> _T:
    """Return an argument as the kind of tuple that it must be, every field checked.

    A sequence without names is one as well, if it has a number for each field.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or the field, its value and what is allowed.
    """
    fields: tuple[str, ...] = kind._fields  # type: ignore[attr-defined]
    own = isinstance(value, kind.__bases__)
    plain = type(value) in (tuple, list) or isinstance(value, np.ndarray)
    if own or (plain and np.shape(value) == np.shape(fields)):
        return kind(*value)
    raise TypeError(f"{name} = {value!r}: must be a {kind.__name__}, or as many numbers: {', '.join(fields)}")


def _checked_fields(kind: type[Any], *values: Any) -> list[float]:
    columns = zip(kind._fields, values, kind.rules, strict=True)
    return [checked(kind.__name__, field, value, rule) for field, value, rule in columns]


def checked_rows(owner: str, kind: type[Any], rows: np.ndarray) -> None:
    """Check many tuples of one kind at once.

    Parameters
    ----------
    owner : str
        What the message calls a row; ``{lane}`` in it becomes the number of the row.
    kind : type
        A named tuple of floats with ``rules``, one a field, such as :class:`Slope`.
    rows : ndarray of float, shape (N, fields)

    Raises
    ------
    ValueError
        Naming row, field, value and allowed range.
    """
    for column, field, (accepts, allowed) in zip(rows.T, kind._fields, kind.rules, strict=True):
        accepted = accepts(column)
        if not accepted.all():
            lane = int(np.argmin(accepted))
            value = float(column[lane])
            raise ValueError(f"{owner.format(lane=lane)}.{field} = {value!r}: must be {allowed}")


def least_eccentricity(radius: float, half_angle: float) -> float:
    """Smallest distance [m] of the mass centre from the centre of the arc with which it is not beyond the chord."""
    return radius * max(math.cos(half_angle), 0.0)


def holds_its_mass_centre(radius: float, eccentricity: float, half_angle: float) -> bool:
    """Whether the mass centre lies between arc and chord, so that it stays above the slope: docs/physics.md (8.11)."""
    return least_eccentricity(radius, half_angle) - _ON_CHORD * radius <= eccentricity <= radius


class Body(params.Body):
    """A circular arc with an eccentric mass centre, closed by its chord: docs/physics.md, section 1.

    Parameters
    ----------
    mass : float
        Mass [kg], > 0.
    radius : float
        Radius of the arc [m], >= 0; 0 is a point.
    eccentricity : float
        Distance from the centre of the arc to the mass centre [m], which lies between arc and chord: from
        ``radius * cos(half_angle)``, or 0 if that is negative, to ``radius``. Elsewhere it would pass below the slope.
    inertia : float
        Moment of inertia about the mass centre [kg m^2], > 0. If all mass lies between arc and chord it is at most
        ``mass * (radius**2 - eccentricity**2)``; this is not checked, as a spool on its axle has more: docs/physics.md
        (8.12).
    half_angle : float
        Half-angle of the arc [rad] in (0, pi]; pi is a full disc without corners.

    Raises
    ------
    TypeError, ValueError
        Naming the field, its value and the allowed range.
    """

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (POSITIVE, NOT_NEGATIVE, NOT_NEGATIVE, POSITIVE, _HALF_ANGLE)

    def __new__(
        cls, mass: float, radius: float, eccentricity: float, inertia: float, half_angle: float = math.pi
    ) -> Self:
        values = _checked_fields(cls, mass, radius, eccentricity, inertia, half_angle)
        _, r, h, _, alpha = values
        if not holds_its_mass_centre(r, h, alpha):
            raise _outside("Body", r, h, alpha)
        return super().__new__(cls, *values)


def _outside(owner: str, radius: float, eccentricity: float, half_angle: float) -> ValueError:
    least = least_eccentricity(radius, half_angle)
    return ValueError(
        f"{owner}.eccentricity = {eccentricity!r}: must be in [max(radius cos(half_angle), 0), radius] = "
        f"[{least!r}, {radius!r}] m: elsewhere the mass centre would pass below the slope"
    )


def check_bodies(owner: str, rows: np.ndarray) -> None:
    """Check many bodies at once as :func:`checked_rows` does, and where their mass centres are."""
    checked_rows(owner, Body, rows)
    for lane, (_, r, h, _, alpha) in enumerate(rows.tolist()):
        if not holds_its_mass_centre(r, h, alpha):
            raise _outside(owner.format(lane=lane), r, h, alpha)


def circular_segment(mass: float, radius: float, half_angle: float) -> Body:
    """Return the uniform lamina bounded by an arc and its chord: docs/physics.md, section 8.

    Parameters
    ----------
    mass : float
        Mass [kg], > 0.
    radius : float
        Radius of the arc [m], > 0.
    half_angle : float
        Half of the angle that the arc subtends [rad] in (0, pi].

    Returns
    -------
    Body
        With the eccentricity and the inertia of the lamina.
    """
    mass = checked("circular_segment", "mass", mass, POSITIVE)
    radius = checked("circular_segment", "radius", radius, POSITIVE)
    alpha = checked("circular_segment", "half_angle", half_angle, _HALF_ANGLE)
    if alpha < _THIN:
        h, inertia = _thin_segment(alpha)
        return Body(mass, radius, radius * h, mass * radius**2 * inertia, alpha)
    sine, cosine = math.sin(alpha), math.cos(alpha)
    area = alpha - sine * cosine  # of the segment, over r^2
    eccentricity = 2.0 * radius * sine**3 / (3.0 * area)
    about_arc_centre = 0.5 * mass * radius**2 * (1.0 + 2.0 * sine**3 * cosine / (3.0 * area))
    return Body(mass, radius, eccentricity, about_arc_centre - mass * eccentricity**2, alpha)


def sled(mass: float, length: float, rocker_radius: float, mass_centre_height: float, gyration_radius: float) -> Body:
    """Return a sled with its rider: runners bent to an arc, closed by the chord between their ends.

    Parameters
    ----------
    mass : float
        Mass of both [kg], > 0.
    length : float
        Of the sled [m], > 0: the chord.
    rocker_radius : float
        Radius of the runners' arc [m], at least half the length.
    mass_centre_height : float
        Height [m] of the mass centre of both above the middle of the runners, >= 0. The chord closes the body, so it
        lies at most as high as the ends of the runners, :func:`sled_rise`.
    gyration_radius : float
        Root of inertia over mass [m], about the mass centre, > 0.

    Returns
    -------
    Body

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range.
    """
    mass = checked("sled", "mass", mass, POSITIVE)
    length = checked("sled", "length", length, POSITIVE)
    radius = checked("sled", "rocker_radius", rocker_radius, POSITIVE)
    if radius < 0.5 * length:
        raise ValueError(
            f"sled.rocker_radius = {radius!r}: must be a number in [length/2, inf) = [{0.5 * length!r}, inf)"
        )
    height = checked("sled", "mass_centre_height", mass_centre_height, NOT_NEGATIVE)
    rise = sled_rise(length, radius)
    if height > rise:
        raise ValueError(f"sled.mass_centre_height = {height!r}: must be a number in [0, {rise:g}] m, below the chord")
    gyration = checked("sled", "gyration_radius", gyration_radius, POSITIVE)
    return Body(mass, radius, radius - height, mass * gyration**2, math.asin(0.5 * length / radius))


def sled_rise(length: float, rocker_radius: float) -> float:
    """Height [m] of the ends of runners above their middle: the sagitta of their arc."""
    half = 0.5 * length
    return half * half / (rocker_radius + math.sqrt(rocker_radius * rocker_radius - half * half))


def _thin_segment(alpha: float) -> tuple[float, float]:
    """Eccentricity over r and inertia over m r^2 of a thin segment, summed over strips along the chord.

    No term is negative, so that no digits are lost; the sum is that of the integral but for rounding.
    """
    nodes, weights = np.polynomial.legendre.leggauss(16)
    t = 0.5 * alpha * (1.0 + nodes)  # the strip at r cos(t) from the centre of the arc, half as wide as r sin(t)
    above = 2.0 * np.sin(0.5 * (alpha + t)) * np.sin(0.25 * alpha * (1.0 - nodes))  # the chord, over r
    half = np.sin(t)
    share = weights * (half / math.sin(alpha)) ** 2
    share /= share.sum()
    height = float(share @ above)
    inertia = float(share @ ((above - height) ** 2 + half**2 / 3.0))
    return min(math.cos(alpha) + height, 1.0), inertia


def restitution_of(asymmetry: Any) -> Any:
    """Energetic coefficient of restitution e [-] of an asymmetry, float or array: docs/physics.md (5.3)."""
    return np.sqrt((1.0 - asymmetry) / (1.0 + asymmetry))


def asymmetry_of(restitution: Any) -> Any:
    """Asymmetry Delta [-] < 1 of a coefficient of restitution, float or array: docs/physics.md (5.3)."""
    squared = restitution * restitution
    return np.minimum((1.0 - squared) / (1.0 + squared), math.nextafter(1.0, 0.0))


class ContactLaw(params.ContactLaw):
    """How the body touches the slope: docs/physics.md, section 5.

    Parameters
    ----------
    stiffness : float
        Mean normal stiffness c [N/m], > 0: c(1 + asymmetry) while the gap closes, c(1 - asymmetry) while it opens.
    asymmetry : float
        Delta [-] in [0, 1); restitution is sqrt((1 - Delta)/(1 + Delta)).
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
    rules: ClassVar[tuple[Rule, ...]] = (POSITIVE, _FRACTION, NOT_NEGATIVE, NOT_NEGATIVE, NOT_NEGATIVE)

    def __new__(
        cls,
        stiffness: float,
        asymmetry: float,
        friction: float,
        rolling_arm: float,
        corner_rolling_arm: float = 0.0,
    ) -> Self:
        values = _checked_fields(cls, stiffness, asymmetry, friction, rolling_arm, corner_rolling_arm)
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
        """Build the law from the coefficient of restitution e [-] in (0, 1] instead of the asymmetry."""
        asymmetry = asymmetry_of(checked("ContactLaw", "restitution", restitution, RESTITUTION))
        return cls(stiffness, asymmetry, friction, rolling_arm, corner_rolling_arm)


AnyLaw = ContactLaw  # every kind of law that a descent may be given: a union, if there are more
LAWS: tuple[type[AnyLaw], ...] = get_args(AnyLaw) or (AnyLaw,)


def kind_of(law: Any) -> type[AnyLaw]:
    """Return the kind of a contact law; that of a tuple without a name is ContactLaw."""
    return next((kind for kind in LAWS if isinstance(law, kind)), ContactLaw)


class Slope(params.Slope):
    """A straight incline: docs/physics.md, section 1.

    Parameters
    ----------
    angle : float
        Inclination beta [rad] in (-pi/2, pi/2); x runs downhill where it is positive.
    length : float
        The descent finishes where the mass centre reaches x = length [m], > 0; inf by default.
    gravity : float
        Gravitational acceleration [m/s^2], >= 0.

    Raises
    ------
    TypeError, ValueError
        Naming the field, its value and the allowed range.
    """

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (STEEPNESS, _LENGTH, NOT_NEGATIVE)

    def __new__(cls, angle: float, length: float = math.inf, gravity: float = 9.81) -> Self:
        return super().__new__(cls, *_checked_fields(cls, angle, length, gravity))


class State(params.State):
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
        return super().__new__(cls, *_checked_fields(cls, x, y, phi, u, v, omega))


class Limits(params.Limits):
    """Where a simulation stops and how finely it is integrated and sampled."""

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (
        POSITIVE,
        POSITIVE,
        _TOLERANCE,
        _INTERVAL,
        POSITIVE,
        CLOSED_FRACTION,
        POSITIVE,
        CLOSED_FRACTION,
        POSITIVE,
    )

    def __new__(
        cls,
        max_time: float = 60.0,
        max_steps: float = 1e6,
        tolerance: float = TOLERANCE,
        sample_interval: float = 0.01,
        step: float = 2.5e-7,
        printed_sign: float = 0.0,
        max_rebounds: float = 1000.0,
        end_on_chord: float = 0.0,
        most_work: float = 1e18,
    ) -> Self:
        limits = (max_time, max_steps, tolerance, sample_interval, step, printed_sign, max_rebounds, end_on_chord)
        return super().__new__(cls, *_checked_fields(cls, *limits, most_work))
