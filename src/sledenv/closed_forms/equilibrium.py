"""Where a body rests on a slope, in closed form: orientations and inclinations of static equilibrium."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sledenv.closed_forms.features import TURN, Sector, arms_at, resting, sectors
from sledenv.simulation.bodies import Body
from sledenv.simulation.rules import FINITE, checked_array
from sledenv.simulation.scene import ContactLaw, Slope

_ROUNDING = 1e-14  # [rad] of the ends of two ranges that are one


def static_jam(body: Body, law: ContactLaw, slope: Slope, phi: ArrayLike) -> NDArray[np.bool_]:
    """Whether the body, laid on the slope at rest, stays: docs/physics.md (6.1).

    At rest N = m g cos(beta) and F = -m g sin(beta), so the moment to be borne by rolling resistance is
    M = a N - b F. It rests if and only if ``|F| <= f N`` and ``|M| <= delta N``, that is ``tan|beta| <= f`` and
    ``|a + b tan(beta)| <= delta`` with the arms a, b and the rolling arm delta of the arc that touches.

    Parameters
    ----------
    body, law, slope
        What rests, how it touches and where. Stiffness, asymmetry and the length of the slope do not matter, nor does
        gravity as long as there is some.
    phi : array_like
        Orientation [rad].

    Returns
    -------
    ndarray of bool
        The shape of ``phi``. Lying flat on a straight side, as on its chord at phi = pi, a body touches with both ends,
        of which one is taken alone here; see :func:`sledenv.closed_forms.on_chord.chord_rests`.

    Raises
    ------
    TypeError, ValueError
        If ``phi`` is not finite, the slope has zones or a profile, or gravity is 0, where nothing holds the body down.
    """
    body, law, slope = resting(body, law, slope)
    a, b, arm = arms_at(body, law, checked_array("static_jam: phi", phi, FINITE))
    steepness = math.tan(slope.angle)
    return np.asarray((abs(steepness) <= law.friction) & (np.abs(a + b * steepness) <= arm))


def static_jam_angles(body: Body, law: ContactLaw, slope: Slope) -> list[tuple[float, float]]:
    """Orientations at which the body rests on the slope, the solution set of :func:`static_jam` in closed form.

    On each arc (6.1) reads ``|h sin(theta - beta) + r sin(beta)| <= delta cos(beta)`` with theta = phi + shift,
    so its bounds are inverse sines.

    Parameters
    ----------
    body, law, slope
        As for :func:`static_jam`.

    Returns
    -------
    list of (float, float)
        Disjoint closed intervals [rad] in (-pi, pi], in order; one that contains pi is split there. Where delta = 0
        the body can only balance, and an interval is one point. An interval that ends where another arc touches, which
        does not rest there, does not contain that end. Lying flat on a straight side counts as in :func:`static_jam`.

    Raises
    ------
    TypeError, ValueError
        If gravity is 0, or the slope has zones or a profile.
    """
    body, law, slope = resting(body, law, slope)
    if math.tan(abs(slope.angle)) > law.friction:
        return []
    found: list[tuple[float, float]] = []
    for sector in sectors(body, law):
        for low, high in _balanced(sector, slope.angle):
            for turn in (-TURN, 0.0, TURN):
                clipped = max(low + turn, sector.low), min(high + turn, sector.high)
                if clipped[0] <= clipped[1] and clipped[1] > -math.pi:
                    found.append(clipped)
    merged: list[tuple[float, float]] = []
    for low, high in sorted(found):
        if merged and low <= merged[-1][1] + _ROUNDING:
            merged[-1] = merged[-1][0], max(high, merged[-1][1])
        else:
            merged.append((low, high))
    return merged


def _balanced(sector: Sector, beta: float) -> list[tuple[float, float]]:
    """Solve ``|h sin(phi + shift - beta) + r sin(beta)| <= delta cos(beta)`` for phi [rad], on one turn."""
    middle, half_width = -sector.r * math.sin(beta), sector.arm * math.cos(beta)
    below, above = middle - half_width, middle + half_width
    if below > sector.h or above < -sector.h:
        return []
    first = math.asin(below / sector.h) if below > -sector.h else -0.5 * math.pi
    last = math.asin(above / sector.h) if above < sector.h else 0.5 * math.pi
    offset = beta - sector.shift
    return [(offset + first, offset + last), (offset + math.pi - last, offset + math.pi - first)]
