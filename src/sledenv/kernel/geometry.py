"""Which feature of the body touches the slope, and where it lies from the mass centre: docs/physics.md, section 8.

Arc and corners share one set of equations. A feature is described by ``(h, r, shift)``: with ``theta = phi + shift``
its lowest point lies at ``-a, -b`` from the mass centre, ``a = h sin(theta)``, ``b = r - h cos(theta)``.
"""

from __future__ import annotations

import math

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import scalar
from sledenv.compiler.values import angle_of, length_of, sine_cosine
from sledenv.kernel.params import Body, Incline, Slope
from sledenv.kernel.records import ARC, NOSE, TAIL

TURN = 2.0 * math.pi

# No library of mathematical functions has a say in a descent: those of two platforms round differently.
sine_and_cosine = scalar(lambda angle: sine_cosine(angle))
_polar = scalar(lambda across, along: (length_of(along, across), angle_of(across, along)))
_distance = scalar(lambda along, across: (length_of(along, across),))


@kernel
def distance(along: float, across: float) -> float:
    """Length of a vector."""
    return _distance(along, across)[0]


@kernel
def incline_of(slope: Slope) -> Incline:
    """Return what kernels need of a slope."""
    sine, cosine = sine_and_cosine(slope.angle)
    return Incline(slope.gravity * sine, slope.gravity * cosine, *slope[1:])


@kernel
def whole_turns(phi: float) -> float:
    """Multiple of 2 pi [rad] that brings ``phi`` into [-pi, pi] when subtracted; odd in ``phi``, as a mirror is."""
    return TURN * float(np.rint(phi * (1.0 / TURN)))


@kernel
def has_corners(body: Body) -> bool:
    """Whether the arc ends in corners: a full disc and a point have none."""
    return body.half_angle < math.pi and body.radius > 0.0


@kernel
def feature_at(body: Body, phi: float) -> int:
    """Feature that is lowest at ``phi`` [rad] in [-pi, pi]."""
    if not has_corners(body) or abs(phi) <= body.half_angle:
        return ARC
    return TAIL if phi > 0.0 else NOSE


@kernel
def corner_lengths(body: Body) -> tuple[float, float]:
    """Distance H [m] of the mass centre from the chord, and half of the length L [m] of the chord: (8.2)."""
    sine, cosine = sine_and_cosine(body.half_angle)
    return body.eccentricity - body.radius * cosine, body.radius * sine


@kernel
def feature_geometry(body: Body, feature: int) -> tuple[float, float, float]:
    """Return ``h`` [m], ``r`` [m] and ``shift`` [rad] of a feature: docs/physics.md (8.2)."""
    if feature == ARC:
        return body.eccentricity, body.radius, 0.0
    side = 1.0 if feature == TAIL else -1.0
    along, across = corner_lengths(body)
    reach, shift = _polar(side * across, along)
    return reach, 0.0, shift


@kernel
def arms_at(along: float, across: float, radius: float, phi: float) -> tuple[float, float]:
    """:func:`arms` for a point that lies ``along`` and ``across`` from where the radius begins."""
    sine, cosine = sine_and_cosine(phi)
    return along * sine + across * cosine, radius - along * cosine + across * sine


@kernel
def arms(body: Body, feature: int, phi: float) -> tuple[float, float]:
    """Arms ``a``, ``b`` [m] of a feature: the contact point lies at (-a, -b) from the mass centre."""
    if feature == ARC:
        return arms_at(body.eccentricity, 0.0, body.radius, phi)
    along, across = corner_lengths(body)
    return arms_at(along, -across if feature == NOSE else across, 0.0, phi)


@kernel
def support_height(body: Body, phi: float) -> float:
    """Height [m] of the mass centre above the slope when the lowest point of the body touches it."""
    local = phi - whole_turns(phi)
    return arms(body, feature_at(body, local), local)[1]


@kernel
def lowest_support(body: Body) -> float:
    """Smallest support height [m] over all orientations, from which the supplied energy is counted."""
    on_arc = body.radius - body.eccentricity
    return min(on_arc, corner_lengths(body)[0]) if has_corners(body) else on_arc


@kernel
def other_corner(body: Body, feature: int, shift: float) -> tuple[float, float, float]:
    """Gap of the corner on the other side less that of the feature: docs/physics.md, section 8.2.

    Returns
    -------
    tuple of float
        A constant [m], and the factors of sine and cosine of ``phi + shift``; inf, 0, 0 where no corner can come down.
        Where the arc touches, the factor of the sine is that for ``phi > 0``; it changes its sign with ``phi``.
    """
    if not has_corners(body):
        return math.inf, 0.0, 0.0
    sine, cosine = sine_and_cosine(body.half_angle)
    across = body.radius * sine
    if feature == ARC:
        # Beyond the far end of the arc, which only a body that is pressed in deep brings so low.
        return body.radius, across, -body.radius * cosine
    reach = 2.0 * across * (1.0 if feature == TAIL else -1.0)
    sine, cosine = sine_and_cosine(shift)
    return 0.0, reach * cosine, -reach * sine
