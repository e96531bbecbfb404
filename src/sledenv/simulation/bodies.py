"""The body: an arc closed by its chord, and the ones that are built from fewer numbers."""

from __future__ import annotations

import math
from typing import ClassVar, Self

import numpy as np

from sledenv.kernel import params
from sledenv.simulation.rules import NOT_NEGATIVE, POSITIVE, Checked, Rule, checked, checked_fields, checked_rows

_HALF_ANGLE: Rule = (lambda v: (v > 0.0) & (v <= math.pi), "in (0, pi] rad")
_ON_CHORD = 1e-15  # of the radius: a mass centre that is farther outside the chord is so by more than rounding
_THIN = 0.3  # [rad] half-angle below which the closed form of a segment loses digits


def least_eccentricity(radius: float, half_angle: float) -> float:
    """Smallest distance [m] of the mass centre from the centre of the arc with which it is not beyond the chord."""
    return radius * max(math.cos(half_angle), 0.0)


def holds_its_mass_centre(radius: float, eccentricity: float, half_angle: float) -> bool:
    """Whether the mass centre lies between arc and chord, so that it stays above the slope: docs/physics.md (8.11)."""
    return least_eccentricity(radius, half_angle) - _ON_CHORD * radius <= eccentricity <= radius


class Body(Checked, params.Body):
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
        values = checked_fields(cls, mass, radius, eccentricity, inertia, half_angle)
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
