"""The outline of a body: which arc is lowest, where it lies from the mass centre, and what may touch beside it.

An outline is convex and closed, of arcs and straight sides: docs/physics.md, section 8. Arc k is described by
``(h, r, shift)``: with ``theta = phi + shift`` its lowest point lies at ``-a, -b`` from the mass centre, where
``a = h sin(theta)`` and ``b = r - h cos(theta)``. A corner is an arc of radius 0. Each arc is lowest in an interval of
orientations. Where it hands over to the next one, both lie equally deep: at the same place, or apart by the length of a
straight side. An arc that is lowest at +-pi is listed twice, as the first and the last one.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import scalar
from sledenv.compiler.values import angle_of, length_of, sine_cosine
from sledenv.kernel.params import Incline, Slope

TURN = 2.0 * math.pi
MOST_ARCS: Final = 12
# One arc may be listed twice, and where the circle of an arc would reach beyond the straight side before it, the end of
# the side is listed too, as a corner that is lowest at one orientation alone.
PLACES: Final = 3 * MOST_ARCS + 1

# What is given of each arc, and what follows from that (see :func:`complete`).
GIVEN: Final = (
    "begin",  # [rad] where its interval begins; -pi of the first one, and the last interval ends at pi
    "along",  # [m] its centre lies at (-across, along) from the mass centre, in the frame of the body
    "across",
    "r",  # [m] radius
    "part",  # code of the part of the body
    "side",  # and of the straight side up to the next arc, 0 where there is none
    "corner",  # 1 if the rolling arm of corners holds for it
)
_DERIVED: Final = (
    "h",  # [m] distance of the centre from the mass centre
    "shift",  # [rad]
    "reach",  # [m] largest arm a
    "low",  # [rad] ends of its interval, which may lie beyond +-pi
    "high",
    "previous",  # the arcs there
    "next",
    # Who may touch beside it as the orientation falls or rises, -1 for nobody: the arc across the next straight side.
    "falling",
    "rising",
    "falling_side",  # codes of the parts of these sides
    "rising_side",
    "middle",  # [rad] above this the rising one is to be watched, below the falling one
    "direct",  # 1 if the nearer one is watched, 0 if the further one: the two ends of a flat arc, see ``sinks``
    "sinks",  # 1 if the model of the contact ends where that one touches too
    # What contacts need, of each arc once: see geometry.complete_outline.
    "cx",  # [m] its centre in the frame of the body
    "cy",
    "mid",  # [rad] middle of its interval
    "half",  # [rad] and half of its length
    "smooth",  # 1 if the next arc takes over without a straight side; else of that side:
    "ox",  # [-] outward normal
    "oy",
    "sx",  # [m] where it begins
    "sy",
    "length",  # [m]
)
BODY: Final = np.dtype(
    [
        ("mass", "f8"),  # [kg]
        ("inertia", "f8"),  # [kg m^2] about the mass centre
        ("per_mass", "f8"),  # [1/kg]
        ("per_inertia", "f8"),  # [1/(kg m^2)]
        ("count", "f8"),  # of intervals
        ("arcs", "f8"),  # of arcs, none listed twice
        ("size", "f8"),  # [m] largest distance of the outline from the mass centre
        ("furthest", "f8"),  # [m] largest h
        ("lowest", "f8"),  # [m] smallest support height
        *((name, "f8", (PLACES,)) for name in GIVEN + _DERIVED),
    ]
)

# No library of mathematical functions has a say in a descent: those of two platforms round differently.
sine_and_cosine = scalar(lambda angle: sine_cosine(angle))
_polar = scalar(lambda across, along: (length_of(along, across), angle_of(across, along)))


@kernel
def polar(across: float, along: float) -> tuple[float, float]:
    """Length of a vector, and its angle [rad]; 0 of no vector."""
    if across == 0.0 and along >= 0.0:
        return along, 0.0
    return _polar(across, along)  # type: ignore[return-value]


@kernel
def distance(along: float, across: float) -> float:
    """Length of a vector."""
    return _polar(across, along)[0]


@kernel
def same_arc(body: np.void, one: int, other: int) -> bool:
    """Whether two intervals are of the same arc."""
    r, along, across = body["r"], body["along"], body["across"]
    return bool(r[one] == r[other] and along[one] == along[other] and across[one] == across[other])


@kernel
def listed_twice(body: np.void) -> bool:
    """Whether the first and the last interval are of the same arc."""
    last = int(body["count"]) - 1
    return last > 0 and same_arc(body, 0, last)


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
def arc_at(body: np.void, local: float) -> int:
    """Arc that is lowest at an orientation [rad] in [-pi, pi].

    Where two are, the larger one is taken; of two equal ones the one at the larger angle, as in the mirror.
    """
    begin, r, last = body["begin"], body["r"], int(body["count"]) - 1
    k = 0
    while k < last and local > begin[k + 1]:
        k += 1
    after = k
    while after < last and local == begin[after + 1]:
        after += 1
    lower = r[k] > r[after] or (r[k] == r[after] and math.copysign(1.0, local) < 0.0)
    return k if lower else after


@kernel
def arms(body: np.void, arc: int, phi: float) -> tuple[float, float]:
    """Arms ``a``, ``b`` [m] of an arc: its lowest point lies at (-a, -b) from the mass centre."""
    sine, cosine = sine_and_cosine(phi)
    return arms_along(body, arc, sine, cosine)


@kernel
def arms_along(body: np.void, arc: int, sine: float, cosine: float) -> tuple[float, float]:
    """:func:`arms` from sine and cosine of the orientation."""
    along, across = body["along"][arc], body["across"][arc]
    a, level = along * sine + across * cosine, along * cosine - across * sine
    r = body["r"][arc]
    if r > body["size"] and level > 0.0:  # r and level are large and nearly equal
        h = body["h"][arc]
        return a, (r - h) + a * a / (h + level)
    return a, r - level


@kernel
def rolling_arm(body: np.void, law: Any, arc: int) -> float:
    """Rolling arm [m] that a law gives an arc."""
    return law.corner_rolling_arm if body["corner"][arc] != 0.0 else law.rolling_arm  # type: ignore[no-any-return]


@kernel
def lowest_arms(body: np.void, local: float) -> tuple[int, float, float]:
    """Arc that is lowest at an orientation [rad] in [-pi, pi], and its arms [m]."""
    arc = arc_at(body, local)
    a, b = arms(body, arc, local)
    return arc, a, b


@kernel
def support_height(body: np.void, phi: float) -> float:
    """Height [m] of the mass centre above the slope when the lowest point of the body touches it."""
    return lowest_arms(body, phi - whole_turns(phi))[2]


@kernel
def within(body: np.void, arc: int, phi: float) -> float:
    """Multiple of 2 pi [rad] that brings an orientation to the interval of an arc when subtracted."""
    if body["count"] == 1.0:
        return 0.0
    beyond = phi - 0.5 * (body["low"][arc] + body["high"][arc])
    return math.copysign(TURN, beyond) if abs(beyond) > math.pi else 0.0


@kernel
def partner(body: np.void, arc: int, rising: bool) -> int:
    """Arc that may touch beside one, on the side where it comes down as the orientation rises, or falls; -1: none."""
    return int(body["rising"][arc] if rising else body["falling"][arc])


@kernel
def turn_across(body: np.void, arc: int, other: int, rising: bool) -> float:
    """Turn [rad] by which the intervals of an arc and of its partner on a side lie apart: 0, 2 pi or -2 pi."""
    near = int(body["next"][arc] if rising else body["previous"][arc])
    turn = body["high"][arc] - body["low"][near] if rising else body["low"][arc] - body["high"][near]
    if near != other:
        turn += body["high"][near] - body["low"][other] if rising else body["low"][near] - body["high"][other]
    return float(turn)


@kernel
def beside(body: np.void, arc: int, other: int) -> tuple[float, float, float]:
    """Gap of another arc less that of an arc: a constant [m], and the factors of sine and cosine of ``theta``."""
    sine, cosine = sine_and_cosine(body["shift"][arc])
    across = body["across"][arc] - body["across"][other]
    along = body["along"][other] - body["along"][arc]
    return body["r"][arc] - body["r"][other], across * cosine + along * sine, along * cosine - across * sine


@kernel
def apart(body: np.void, arc: int, other: int, phi: float) -> float:
    """Gap [m] of another arc less that of an arc at an orientation."""
    sine, cosine = sine_and_cosine(phi)
    across = body["across"][arc] - body["across"][other]
    along = body["along"][other] - body["along"][arc]
    return body["r"][arc] - body["r"][other] + across * sine + along * cosine  # type: ignore[no-any-return]


@kernel
def _beyond(body: np.void, arc: int, step: int) -> int:
    """Arc across the straight side at an end of an arc, or at the further end of its neighbour; -1 if there is none.

    ``step`` is 1 at the upper end of the interval, -1 at the lower one.
    """
    following = body["next"] if step > 0 else body["previous"]
    near = int(following[arc])
    far = int(following[near])
    if body["side"][arc if step > 0 else near] > 0.0:
        return near
    return far if body["side"][near if step > 0 else far] > 0.0 and far != arc else -1


@kernel
def _side_to(body: np.void, arc: int, other: int, step: int) -> float:
    """Code of the side across which :func:`_beyond` has found an arc."""
    if other < 0:
        return 0.0
    near = int(body["next"][arc] if step > 0 else body["previous"][arc])
    if step > 0:
        return float(body["side"][arc] if other == near else body["side"][near])
    return float(body["side"][other])


@kernel
def _halfway(body: np.void, arc: int) -> float:
    """Orientation [rad] at which the arcs that may touch beside one have the same gap."""
    falling, rising = int(body["falling"][arc]), int(body["rising"][arc])
    low, high = body["low"][arc], body["high"][arc]
    before = apart(body, arc, rising, low) - apart(body, arc, falling, low)
    after = apart(body, arc, rising, high) - apart(body, arc, falling, high)
    if before * after > 0.0:  # one of them is the nearer one all along
        return float(math.copysign(math.inf, before))
    for _ in range(80):
        middle = 0.5 * (low + high)
        there = apart(body, arc, rising, middle) - apart(body, arc, falling, middle)
        if there == 0.0:
            break
        if (there > 0.0) == (before > 0.0):
            low = middle
        else:
            high = middle
    return float(0.5 * (low + high))


@kernel
def _place(body: np.void, arc: int) -> None:
    """Write where the centre of an arc lies, and its interval with its neighbours."""
    count, last = int(body["count"]), int(body["count"]) - 1
    begin, following, before = body["begin"], body["next"], body["previous"]
    body["h"][arc], body["shift"][arc] = polar(body["across"][arc], body["along"][arc])
    twice = listed_twice(body)
    body["low"][arc], body["high"][arc] = begin[arc], begin[arc + 1] if arc < last else math.pi
    before[arc], following[arc] = (arc - 1) % count, (arc + 1) % count
    if count == 1:
        body["low"][arc], body["high"][arc] = -math.inf, math.inf
    elif twice and arc == 0:
        body["low"][arc], before[arc] = begin[last] - TURN, last - 1
    elif twice and arc == last:
        body["high"][arc], following[arc] = begin[1] + TURN, 1


@kernel
def _measure(body: np.void, arc: int) -> None:
    """Let the sizes of a body heed an arc, and write its largest arm a."""
    h, r, shift = body["h"][arc], body["r"][arc], body["shift"][arc]
    low, high = body["low"][arc], body["high"][arc]
    if body["count"] == 1.0:
        low, high = -math.pi, math.pi
    middle, half = 0.5 * (low + high) + shift, 0.5 * (high - low)
    middle -= whole_turns(middle)
    reach, furthest, lowest = 0.0, 0.0, math.inf
    for phi in (low, high):
        a, b = arms(body, arc, phi)
        reach, furthest, lowest = max(reach, abs(a)), max(furthest, distance(a, b)), min(lowest, b)
    if half >= abs(middle):
        lowest = min(lowest, r - h)
    if half >= math.pi - abs(middle):
        furthest = r + h
    if half >= abs(abs(middle) - 0.5 * math.pi):
        reach = h
    body["reach"][arc] = reach
    body["size"], body["lowest"] = max(body["size"], furthest), min(body["lowest"], lowest)
    body["furthest"] = max(body["furthest"], h)


@kernel
def complete(body: np.void) -> None:
    """Write all that follows from mass, inertia, count and what is given of each arc."""
    count = int(body["count"])
    body["size"], body["furthest"], body["lowest"] = 0.0, 0.0, math.inf
    for arc in range(count):
        _place(body, arc)
    for arc in range(count):
        _measure(body, arc)
    for arc in range(count):
        falling, rising = -1, -1
        if count > 1:
            falling, rising = _beyond(body, arc, -1), _beyond(body, arc, 1)
        body["falling"][arc], body["rising"][arc] = falling, rising
        body["falling_side"][arc] = _side_to(body, arc, falling, -1)
        body["rising_side"][arc] = _side_to(body, arc, rising, 1)
        if falling >= 0 and rising >= 0:
            body["middle"][arc] = _halfway(body, arc)
        else:
            body["middle"][arc] = math.inf if falling >= 0 else -math.inf
        near_above, near_below = int(body["next"][arc]), int(body["previous"][arc])
        both = rising >= 0 and falling >= 0
        ends = both and same_arc(body, rising, near_below) and same_arc(body, falling, near_above)
        ends = ends and not same_arc(body, rising, falling)
        flat = body["high"][arc] - body["low"][arc] <= math.pi
        body["direct"][arc] = 1.0 if both and not ends else 0.0
        body["sinks"][arc] = 1.0 if ends and flat else 0.0
