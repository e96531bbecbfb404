"""The outline of a body: which arc is lowest, where it lies from the mass centre, and what may touch beside it.

An outline is convex and closed, of arcs and straight sides: docs/physics.md, section 8. The lowest point of an arc lies
at ``-a, -b`` from the mass centre, its arms. A corner is an arc of radius 0. Each arc is lowest in an interval of
orientations. Where it hands over to the next one, both lie equally deep: at the same place, or apart by the length of a
straight side. An arc that is lowest at +-pi is listed twice, as the first and the last one.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import TURN, angle_of, sine_cosine, wrap

MOST_ARCS: Final = 24
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
    "low",  # [rad] ends of its interval, which may lie beyond +-pi
    "high",
    "previous",  # the arcs there
    "next",
    # The arcs across the straight sides that come down as the orientation falls or rises, -1 if there is none.
    "falling",
    "rising",
    "sinks",  # 1 of a flat arc between two ends, both of which touch only where it is as deep as it is thick
    # What contacts need, of each arc once:
    "cx",  # [m] its centre in the frame of the body
    "cy",
    "mid",  # [rad] middle of its interval, see :func:`from_middle`
    "over",  # 1 if that is the one that lies half a turn from there
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
        ("drag_area", "f8"),  # [m^2] drag coefficient times the area that the air meets
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


@kernel
def distance(along: float, across: float) -> float:
    """Length of a vector."""
    return math.sqrt(along * along + across * across)


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
    sine, cosine = sine_cosine(wrap(phi))
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
def from_middle(body: np.void, arc: int, angle: float) -> float:
    """Angle [rad] less the middle of the interval of an arc, in [-pi, pi]; mirror images have the same, turned round.

    An arc that is lowest at +-pi has its middle half a turn from ``mid``.
    """
    turned = wrap(angle - body["mid"][arc])
    return turned - math.copysign(math.pi, turned) if body["over"][arc] != 0.0 else turned


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
    return lowest_arms(body, wrap(phi))[2]


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
def _place(body: np.void, arc: int) -> None:
    """Write where the centre of an arc lies, and its interval with its neighbours."""
    count, last = int(body["count"]), int(body["count"]) - 1
    begin, following, before = body["begin"], body["next"], body["previous"]
    body["h"][arc] = distance(body["along"][arc], body["across"][arc])
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
    """Let the sizes of a body heed an arc."""
    h, r, shift = body["h"][arc], body["r"][arc], angle_of(body["across"][arc], body["along"][arc])
    low, high = body["low"][arc], body["high"][arc]
    if body["count"] == 1.0:
        low, high = -math.pi, math.pi
    middle, half = 0.5 * (low + high) + shift, 0.5 * (high - low)
    middle, furthest, lowest = wrap(middle), 0.0, math.inf
    for phi in (low, high):
        a, b = arms(body, arc, phi)
        furthest, lowest = max(furthest, distance(a, b)), min(lowest, b)
    if half >= abs(middle):
        lowest = min(lowest, r - h)
    if half >= math.pi - abs(middle):
        furthest = r + h
    body["size"], body["lowest"] = max(body["size"], furthest), min(body["lowest"], lowest)
    body["furthest"] = max(body["furthest"], h)


@kernel
def _join(body: np.void, arc: int) -> None:
    """Write which arcs come down beside one."""
    falling, rising = -1, -1
    if body["count"] > 1.0:
        falling, rising = _beyond(body, arc, -1), _beyond(body, arc, 1)
    body["falling"][arc], body["rising"][arc] = falling, rising
    near_above, near_below = int(body["next"][arc]), int(body["previous"][arc])
    ends = falling >= 0 and rising >= 0
    ends = ends and same_arc(body, rising, near_below) and same_arc(body, falling, near_above)
    ends = ends and not same_arc(body, rising, falling)
    body["sinks"][arc] = 1.0 if ends and body["high"][arc] - body["low"][arc] <= math.pi else 0.0


@kernel
def _write_side(body: np.void, arc: int) -> None:
    """Write where an arc ends, and the straight side there, if there is one."""
    after = (arc + 1) % int(body["arcs"])
    sine, cosine = sine_cosine(wrap(body["high"][arc]))
    r, q = body["r"][arc], body["r"][after]
    body["ox"][arc], body["oy"][arc] = -sine, -cosine
    body["sx"][arc], body["sy"][arc] = body["cx"][arc] - r * sine, body["cy"][arc] - r * cosine
    if body["side"][arc] > 0.0:
        x, y = body["cx"][after] - q * sine, body["cy"][after] - q * cosine
        body["length"][arc] = distance(x - body["sx"][arc], y - body["sy"][arc])


@kernel
def complete(body: np.void) -> None:
    """Write all that follows from mass, inertia, count and what is given of each arc."""
    count = int(body["count"])
    body["per_mass"], body["per_inertia"] = 1.0 / body["mass"], 1.0 / body["inertia"]
    body["size"], body["furthest"], body["lowest"] = 0.0, 0.0, math.inf
    for arc in range(count):
        _place(body, arc)
    for arc in range(count):
        _measure(body, arc)
        _join(body, arc)
    arcs = count - 1 if listed_twice(body) else count
    body["arcs"] = float(arcs)
    for k in range(arcs):
        body["cx"][k], body["cy"][k] = -body["across"][k], body["along"][k]
        low, high = body["low"][k], body["high"][k]
        body["mid"][k], body["half"][k], body["over"][k] = 0.0, math.inf, 0.0
        if k == 0 and arcs < count:
            low, high = body["begin"][1], body["begin"][arcs]
            body["mid"][k], body["half"][k], body["over"][k] = 0.5 * (low + high), math.pi - 0.5 * (high - low), 1.0
        elif count > 1:
            body["mid"][k], body["half"][k] = 0.5 * (low + high), 0.5 * (high - low)
        body["smooth"][k] = 1.0 if body["side"][k] == 0.0 else 0.0
        body["ox"][k] = body["oy"][k] = body["sx"][k] = body["sy"][k] = body["length"][k] = 0.0
    if count > 1:
        for k in range(arcs):
            _write_side(body, k)
