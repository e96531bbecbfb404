"""A body that lies flat on its chord, or on another straight side: loads of its ends, tipping, rest and sliding."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sledenv.closed_forms.features import IS_NUMBER, Floats, pressed, resting, rolling_arm
from sledenv.simulation.bodies import Body, made_body
from sledenv.simulation.rules import FINITE, NOT_NEGATIVE, checked_array, made
from sledenv.simulation.scene import ContactLaw, Slope


def chord_loads(
    body: Body, law: ContactLaw, slope: Slope, slip: ArrayLike, side: str = "chord"
) -> tuple[Floats, Floats]:
    """Loads [N] of the two ends of a straight side on which a body lies flat: docs/physics.md (8.6).

    They carry the weight together, and their moment balances that of friction, which acts H below the mass centre:
    ``L (N_tail - N_nose) = -H F`` for the two corners of a chord, with F = -s_t f m g cos(beta) sliding and
    F = -m g sin(beta) at rest. Ends at other distances from the mass centre share the weight by their arms a.

    Parameters
    ----------
    body : Body
        With such a side.
    law, slope
        As for :func:`sledenv.closed_forms.equilibrium.static_jam`.
    slip : array_like
        Velocity along the slope [m/s], or just its sign s_t; 0 at rest.
    side : str
        Name of the straight side; the chord of a segment by default.

    Returns
    -------
    tuple of ndarray
        Of the end that lies downhill, the tail of a chord, and of the other one, the nose; the shape of ``slip``.
        Rolling resistance is taken to be without moment: it may shift ``delta m g cos(beta) / (2 L)`` from either end
        to the other, over the length 2 L. A negative load that it cannot make up for means that the body tips, see
        :func:`chord_tipping_friction`.

    Raises
    ------
    TypeError, ValueError
        If the body has no such side, or several of that name, ``slip`` is NaN, gravity is 0, or the slope has zones or
        a profile.
    """
    body, law, slope = resting(body, law, slope)
    base = _base_of(body, law, side)
    sign = np.sign(checked_array("chord_loads: slip", slip, IS_NUMBER))
    share = body.mass * slope.gravity * math.cos(slope.angle) / (base.uphill - base.downhill)
    ratio = np.where(sign == 0.0, -math.tan(slope.angle), -sign * law.friction)  # F / N
    return share * (base.uphill - ratio * base.height), share * (ratio * base.height - base.downhill)


def chord_tipping_friction(body: Body, law: ContactLaw, side: str = "chord", slip: float = 1.0) -> float:
    """Ratio ``|F| / N`` [-] above which friction tips a body that lies flat over the end ahead: (8.7).

    It is ``(L + delta) / |H|`` for a chord, with the rolling arm delta of the corners: sliding flat needs a smaller
    friction coefficient, and lying at rest a smaller slope. For any side L is the distance along it from the mass
    centre to that end, and delta that of the end.

    Parameters
    ----------
    body : Body
        With such a side.
    law : ContactLaw
        How it touches; its friction is not used.
    side : str
        Name of the straight side; the chord of a segment by default.
    slip : float
        Velocity along the slope, or just its sign: at 0 or above, the end ahead is the one downhill, on which a body
        also tips that lies on a slope. It does not matter where the mass centre is over the middle.

    Returns
    -------
    float
        inf if the mass centre lies in the side, H = 0; 0 if the body tips off the side whatever the friction, because
        the mass centre is not over it.

    Raises
    ------
    TypeError, ValueError
        If the body has no such side, or several of that name, or ``slip`` is NaN.
    """
    body, law = made_body(body), made("law", ContactLaw, law)
    base = _base_of(body, law, side)
    uphill = float(checked_array("chord_tipping_friction: slip", slip, IS_NUMBER)) < 0.0
    if not base.least <= 0.0 <= base.most:
        return 0.0
    return math.inf if base.height == 0.0 else (base.most if uphill else -base.least) / abs(base.height)


def chord_rests(body: Body, law: ContactLaw, slope: Slope, side: str = "chord") -> bool:
    """Whether a body that lies flat on a side at rest stays: ``tan|beta| <= f`` and it does not tip, (8.7).

    Parameters
    ----------
    body : Body
        With such a side.
    law, slope
        As for :func:`sledenv.closed_forms.equilibrium.static_jam`.
    side : str
        Name of the straight side; the chord of a segment by default.

    Raises
    ------
    TypeError, ValueError
        If the body has no such side, or several of that name, gravity is 0, or the slope has zones or a profile.
    """
    body, law, slope = resting(body, law, slope)
    base, steepness = _base_of(body, law, side), math.tan(slope.angle)
    return abs(steepness) <= law.friction and base.least <= -steepness * base.height <= base.most


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
        If ``speed`` or ``time`` is not finite or ``time`` is negative, gravity is 0, or the slope has zones or a
        profile.
    """
    law, slope = ContactLaw(*law), pressed(slope)
    start = checked_array("chord_slide: speed", speed, FINITE)
    after = checked_array("chord_slide: time", time, (NOT_NEGATIVE[0], "in [0, inf) s"))
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
        If ``speed`` is not finite, gravity is 0, or the slope has zones or a profile.
    """
    law, slope = ContactLaw(*law), pressed(slope)
    start = float(checked_array("chord_finish_time: speed", speed, FINITE))
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


class _Base(NamedTuple):
    """Ends of the side on which a body lies flat."""

    downhill: float  # [m] arm a of the end downhill, which is not positive if the mass centre is over the side
    uphill: float  # [m] that of the other one
    height: float  # [m] of the mass centre above the side: their arm b
    least: float  # [m] where the load may act, rolling resistance included: ``b F/N`` is from here
    most: float  # [m] to here, or the body tips


def _base_of(body: Body, law: ContactLaw, side: str) -> _Base:
    """Ends of the straight side of this name; of a chord height is H and the arms are L: docs/physics.md (8.2)."""
    record, known = body.record[0], _sides(body)
    found = [k for k, name in enumerate(known) if name and name == side]
    if len(found) > 1:
        raise ValueError(f"side = {side!r}: {len(found)} sides of the body have this name: must be that of one")
    if not found:
        names = ", ".join(repr(name) for name in dict.fromkeys(known) if name)
        have = f"must be one of {names}" if names else "it has no straight side"
        raise ValueError(f"side = {side!r}: the body has no {side} to lie on: {have}")
    one = found[0]
    other = int(record["next"][one])
    (x, y, r, corner), (x_next, y_next, r_next, corner_next) = (
        (-float(record["across"][k]), *(float(record[name][k]) for name in ("along", "r", "corner")))
        for k in (one, other)
    )
    apart, grows = math.hypot(x_next - x, y_next - y), r_next - r
    length = math.sqrt((apart - grows) * (apart + grows))
    # Direction of the slope and its normal in the frame of the body. Taken from the centres and not from the
    # orientation, a mass centre in the side has exactly the height 0.
    cosine = ((x - x_next) * length + (y_next - y) * grows) / apart**2
    sine = ((y_next - y) * length + (x_next - x) * grows) / apart**2
    downhill, uphill = y * sine - x * cosine, y_next * sine - x_next * cosine
    least, most = downhill - rolling_arm(law, corner), uphill + rolling_arm(law, corner_next)
    return _Base(downhill, uphill, r - x * sine - y * cosine, least, most)


def _sides(body: Body) -> list[str]:
    """Return the name of the straight side that follows each arc of the record, "" where there is none."""
    record = body.record[0]
    codes = record["side"][: int(record["count"])].astype(int).tolist()
    names = [body.parts[code - 1] if code else "" for code in codes]
    if record["low"][0] < -math.pi and len(names) > 1:  # the first arc is the last one once more
        names[0] = ""
    return names


def _sliding_rate(law: ContactLaw, slope: Slope, direction: ArrayLike) -> Floats:
    """Acceleration [m/s^2] of a block that slides in a direction, 1 or -1."""
    inward = slope.gravity * math.cos(slope.angle)
    return np.asarray(slope.gravity * math.sin(slope.angle) - np.asarray(direction) * law.friction * inward)


def _starting_rate(law: ContactLaw, slope: Slope) -> float:
    """Acceleration [m/s^2] of a block that stands still: 0 if friction holds it."""
    direction = math.copysign(1.0, slope.angle)
    rate = float(_sliding_rate(law, slope, direction))
    return rate if rate * direction > 0.0 else 0.0
