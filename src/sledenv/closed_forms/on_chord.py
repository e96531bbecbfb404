"""A body that lies flat on its chord, in closed form: loads of its corners, tipping, rest and sliding."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from sledenv.closed_forms.arguments import Floats, is_number, numbers, pressed, resting
from sledenv.simulation.bodies import Body
from sledenv.simulation.rules import made
from sledenv.simulation.scene import ContactLaw, Slope
from sledenv.simulation.support import has_corners


def chord_loads(body: Body, law: ContactLaw, slope: Slope, slip: ArrayLike) -> tuple[Floats, Floats]:
    """Loads [N] of the two corners of a body that lies flat on its chord: docs/physics.md (8.6).

    They carry the weight together, and their moment balances that of friction, which acts H below the mass centre:
    ``L (N_tail - N_nose) = -H F``, with F = -s_t f m g cos(beta) sliding and F = -m g sin(beta) at rest.

    Parameters
    ----------
    body : Body
        With corners.
    law, slope
        As for :func:`sledenv.closed_forms.equilibrium.static_jam`.
    slip : array_like
        Velocity along the slope [m/s], or just its sign s_t; 0 at rest.

    Returns
    -------
    tuple of ndarray
        Of the tail, which lies downhill, and of the nose; the shape of ``slip``. Rolling resistance is taken to be
        without moment: it may shift ``delta m g cos(beta) / (2 L)`` from either corner to the other. A negative load
        that it cannot make up for means that the body tips, see :func:`chord_tipping_friction`.

    Raises
    ------
    TypeError, ValueError
        If the body has no corners, ``slip`` is NaN or gravity is 0.
    """
    body, law, slope = resting(body, law, slope)
    along, across = _chord(body)
    sign = np.sign(numbers("chord_loads", "slip", slip, is_number, "a number"))
    weight = body.mass * slope.gravity * math.cos(slope.angle)
    ratio = np.where(sign == 0.0, -math.tan(slope.angle), -sign * law.friction)  # F / N
    return 0.5 * weight * (1.0 - ratio * along / across), 0.5 * weight * (1.0 + ratio * along / across)


def chord_tipping_friction(body: Body, law: ContactLaw) -> float:
    """Ratio ``|F| / N`` [-] above which friction tips a body that lies on its chord over the corner ahead: (8.7).

    It is ``(L + delta) / |H|`` with the rolling arm delta of the corners: sliding flat needs a smaller friction
    coefficient, and lying at rest a smaller slope.

    Returns
    -------
    float
        inf if the mass centre lies in the chord, H = 0.

    Raises
    ------
    ValueError
        If the body has no corners.
    """
    body, law = made("body", Body, body), made("law", ContactLaw, law)
    along, across = _chord(body)
    return math.inf if along == 0.0 else (across + law.corner_rolling_arm) / abs(along)


def chord_rests(body: Body, law: ContactLaw, slope: Slope) -> bool:
    """Whether a body that lies flat on its chord at rest stays: ``tan|beta| <= f`` and it does not tip, (8.7).

    Parameters
    ----------
    body : Body
        With corners.
    law, slope
        As for :func:`sledenv.closed_forms.equilibrium.static_jam`.

    Raises
    ------
    ValueError
        If the body has no corners or gravity is 0.
    """
    body, law, slope = resting(body, law, slope)
    return math.tan(abs(slope.angle)) <= min(law.friction, chord_tipping_friction(body, law))


def chord_slide(law: ContactLaw, slope: Slope, speed: ArrayLike, time: ArrayLike) -> tuple[Floats, Floats]:
    """Distance [m] and velocity [m/s] of a body that slides flat on its chord, after a time: (8.8).

    It slides like a block, ``du/dt = g sin(beta) - s_t f g cos(beta)``. Where it comes to a stop it stays if
    ``tan|beta| <= f``, and slides down otherwise.

    Parameters
    ----------
    law, slope
        As for :func:`sledenv.closed_forms.equilibrium.static_jam`; the length of the slope does not matter.
    speed : array_like
        Velocity along the slope at the start [m/s].
    time : array_like
        Time since then [s], >= 0.

    Returns
    -------
    tuple of ndarray
        The arguments are broadcast.

    Raises
    ------
    TypeError, ValueError
        If ``speed`` or ``time`` is not finite or ``time`` is negative, or gravity is 0.
    """
    law, slope = ContactLaw(*law), pressed(slope)
    start = numbers("chord_slide", "speed", speed, np.isfinite, "finite")
    after = numbers("chord_slide", "time", time, lambda v: (v >= 0.0) & (v < np.inf), "in [0, inf) s")
    direction = np.where(start == 0.0, np.sign(slope.angle), np.sign(start))
    rate = _sliding_rate(law, slope, direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        stop = np.where(start == 0.0, 0.0, np.where(rate * start < 0.0, -start / rate, np.inf))
    first = np.minimum(after, stop)
    rest = after - first
    again = _starting_rate(law, slope)
    distance = first * (start + 0.5 * rate * first) + 0.5 * again * rest * rest
    return np.asarray(distance), np.where(after < stop, start + rate * first, again * rest)


def chord_finish_time(law: ContactLaw, slope: Slope, speed: float) -> float:
    """Time [s] after which a body that slides flat on its chord has gone the length of the slope; inf if never.

    Parameters
    ----------
    law, slope
        As for :func:`chord_slide`.
    speed : float
        Velocity along the slope at the start [m/s].

    Raises
    ------
    TypeError, ValueError
        If ``speed`` is not finite or gravity is 0.
    """
    law, slope = ContactLaw(*law), pressed(slope)
    start = float(numbers("chord_finish_time", "speed", speed, np.isfinite, "finite"))
    distance, turned, rate = slope.length, 0.0, float(_sliding_rate(law, slope, 1.0))
    if start <= 0.0:
        slowing = float(_sliding_rate(law, slope, -1.0))
        if start < 0.0 and not slowing > 0.0:
            return math.inf
        turned = -start / slowing if start < 0.0 else 0.0
        distance -= 0.5 * start * turned
        start, rate = 0.0, _starting_rate(law, slope)
    squared = start * start + 2.0 * rate * distance  # speed at the end
    return turned + 2.0 * distance / (start + math.sqrt(squared)) if 0.0 < squared < math.inf else math.inf


def _chord(body: Body) -> tuple[float, float]:
    """H and L [m] of docs/physics.md (8.2)."""
    if not has_corners(body):
        raise ValueError(
            f"Body.half_angle = {body.half_angle}, radius = {body.radius}: the body has no chord to lie on"
        )
    return body.eccentricity - body.radius * math.cos(body.half_angle), body.radius * math.sin(body.half_angle)


def _sliding_rate(law: ContactLaw, slope: Slope, direction: ArrayLike) -> Floats:
    """Acceleration [m/s^2] of a block that slides in a direction, 1 or -1."""
    inward = slope.gravity * math.cos(slope.angle)
    return np.asarray(slope.gravity * math.sin(slope.angle) - np.asarray(direction) * law.friction * inward)


def _starting_rate(law: ContactLaw, slope: Slope) -> float:
    """Acceleration [m/s^2] of a block that stands still: 0 if friction holds it."""
    direction = math.copysign(1.0, slope.angle)
    rate = float(_sliding_rate(law, slope, direction))
    return rate if rate * direction > 0.0 else 0.0
