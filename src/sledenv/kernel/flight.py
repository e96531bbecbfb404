"""Ballistic flight up to the first touchdown, which is never stepped over: docs/physics.md, section 7.

A search first goes straight for a root and proves that none comes before. Where that fails, it goes on in steps that
pass none, however many there are. How the body moves is in :mod:`sledenv.kernel.motion`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import straight
from sledenv.kernel import motion
from sledenv.kernel.geometry import (
    TURN,
    arms_at,
    corner_lengths,
    distance,
    feature_at,
    feature_geometry,
    has_corners,
    sine_and_cosine,
    whole_turns,
)
from sledenv.kernel.params import Body, Incline, Limits
from sledenv.kernel.records import ARC, NOSE, TAIL
from sledenv.kernel.state import FALLING, LANDED, MOTION, POISED, SEARCHING, copy

EDGE = 1e-9  # [rad]
CLEARED = 100.0  # rounding errors of a gap that is open for certain
ROUNDING = 4e-16
LITTLE_TURN = 0.3  # [rad] of a step whose gap is much like a polynomial
# Share of the pull up to which centrifugal accelerations leave the gap concave, and up to which it is like a parabola.
CONCAVE = 0.9
PARABOLIC = 0.5


def _start_of(hop: Any, slope: Any, flight: Any) -> None:
    """Program of where a flight starts, and of what it is subject to."""
    copy(slope, hop, Incline._fields)
    copy(flight, hop, MOTION)


def _losses_of(hop: Any) -> None:
    """Program of what has been lost in a flight."""
    for name, lost in motion.losses(hop, hop, hop.duration).items():
        setattr(hop, name, lost / hop.per_mass)


_write_start, _write_losses = straight(_start_of), straight(_losses_of)


@kernel
def write_body(body: Body, hop: np.void) -> None:
    """Write whose hop it is."""
    h, (along, across) = body.eccentricity, corner_lengths(body)
    corners = has_corners(body)
    hop["radius"], hop["eccentricity"] = body.radius, h
    hop["half_angle"] = body.half_angle if corners else math.inf
    hop["along"], hop["across"] = along, across
    hop["furthest"] = max(h, distance(along, across)) if corners else h
    hop["size"] = body.radius + body.eccentricity
    hop["per_mass"], hop["per_inertia"] = 1.0 / body.mass, 1.0 / body.inertia


@kernel
def write_flight(hop: np.void, slope: Incline, limits: Limits, flight: np.void) -> None:
    """Write where a flight starts, from a record of OUTCOME, and what it is subject to."""
    _write_start(hop, slope, flight)
    hop["max_time"], hop["horizon"] = limits.max_time, limits.max_time - flight["t"]


@kernel
def _lowest(hop: np.void, local: float) -> tuple[float, float, float]:
    """Arms [m] of the feature that is lowest at an angle in [-pi, pi], and its radius [m]."""
    if abs(local) <= hop["half_angle"]:
        a, b = arms_at(hop["eccentricity"], 0.0, hop["radius"], local)
        return a, b, hop["radius"]
    a, b = arms_at(hop["along"], hop["across"] if local > 0.0 else -hop["across"], 0.0, local)
    return a, b, 0.0


@kernel
def _before_kink(hop: np.void, turn: float) -> bool:
    """Whether a body turns from the start of its flight without passing +-pi, where one corner follows on the other.

    There the gap has a kink, and its second derivative no bound.
    """
    phi = hop["phi"]
    without = not hop["half_angle"] < math.inf
    return bool(without or np.rint(phi * (1.0 / TURN)) == np.rint((phi + turn) * (1.0 / TURN)))


@kernel
def _safe_step(gap: float, rate: float, bound: float) -> float:
    """First root of ``gap + rate t - bound t^2 / 2``, inf if there is none."""
    twice = 2.0 * max(gap, 0.0)
    square = math.sqrt(rate * rate + bound * twice)
    if rate < 0.0:
        return twice / (square - rate)
    return (rate + square) / bound if bound > 0.0 else math.inf


@kernel
def _look_ahead(hop: np.void) -> None:
    """Write what does not change in a search, and where its first step goes."""
    y, v, omega, pull, top = hop["y"], hop["v"], hop["omega"], motion.pull(hop, hop["v"]), hop["size"]
    square, most = omega * omega, motion.most_pull(hop)
    bound = most + hop["furthest"] * square
    a, b, radius = _lowest(hop, hop["phi"] - whole_turns(hop["phi"]))
    gap, rate = y - b, v - a * omega
    hop["bound"], hop["noise"], hop["margin"] = bound, ROUNDING * (top + abs(y)), ROUNDING
    hop["root"], hop["alone_from"] = 0.0, math.inf
    # It stays out of reach for as long as on a parabola.
    if most > 0.0:
        hop["in_reach"] = (v + np.sqrt(v * v + 2.0 * most * (y - top))) / most
    else:
        hop["in_reach"] = (top - y) / v if v < 0.0 else math.inf
    # A slow body lands about where its parabola does, and one that flies high about where it comes in reach.
    slow = bound < (1.0 + PARABOLIC) * pull
    first = hop["in_reach"]
    if slow or not first > 0.0:
        bend = pull + (radius - b) * square if slow else pull
        first = (rate + np.sqrt(rate * rate + 2.0 * gap * bend)) / bend if bend != 0.0 else math.nan
    still = ROUNDING * (abs(v) + top * abs(omega))
    hop["clear"] = hop["touchdown"] = hop["last_step"] = 0.0
    hop["phase"] = SEARCHING
    if 0.0 < first < math.inf and (gap > hop["noise"] or rate > still):
        clear = _safe_step(gap, rate, bound)
        hop["clear"] = clear if _before_kink(hop, omega * clear) else 0.0
        hop["touchdown"] = hop["last_step"] = first
        hop["phase"] = FALLING


@kernel
def _alone(reached: float, steep: float, hop: np.void) -> bool:
    """Say whether no root comes before the one that has been reached: its gap closes with the rate ``steep`` [m/s].

    None comes before the one of a concave gap, while the body is out of reach, or for some time before a root.
    """
    if not _before_kink(hop, hop["omega"] * reached):
        hop["alone_from"] = math.inf
    else:
        last = hop["alone_from"] = reached - 2.0 * steep / hop["bound"]
        upward = 2.0 * hop["v"] / motion.most_pull(hop) - hop["in_reach"] if motion.most_pull(hop) > 0.0 else math.inf
        if last <= hop["clear"] or (upward <= hop["clear"] and last <= hop["in_reach"]):
            return True
    return bool(hop["bound"] < (1.0 + CONCAVE) * motion.least_pull(hop, reached))


@kernel
def _fall(hop: np.void) -> None:
    """Go a step towards a root of the gap.

    It goes to the root of the parabola that osculates the gap, and corrects that by the next two derivatives.
    """
    time, omega = hop["touchdown"], hop["omega"]
    phi = motion.turned(hop, time)
    local = phi - whole_turns(phi)
    a, b, radius = _lowest(hop, local)
    height, speed = motion.away(hop, time)
    gap, rate, pull = height - b, speed - a * omega, motion.pull(hop, speed)
    square, lever = omega * omega, radius - b
    # Where the parabola has no root, its lowest point.
    steep = math.sqrt(max(rate * rate + 2.0 * gap * (pull + lever * square), 0.0))
    hop["touchdown"], hop["phase"] = hop["clear"], SEARCHING  # unless it comes to more
    if not rate < 0.0:
        return
    step = 2.0 * gap / (steep - rate)
    turn = omega * step
    later = 0.0
    if abs(turn) < LITTLE_TURN and steep > 0.0:
        later = step * step * square * (turn * a * (1.0 / 6.0) + lever * turn * turn * (1.0 / 24.0)) / steep
    # The error of the gap is that of the slopes over the correction, and of the derivatives beyond.
    turn = abs(turn)
    slope = abs(later) * hop["bound"] + hop["furthest"] * abs(omega) * turn * turn
    error = motion.departure(hop, step, later) + abs(later) * slope
    error += hop["furthest"] * (1.0 / 120.0) * turn * turn * turn * turn * turn
    found = error <= hop["noise"]
    if hop["half_angle"] < math.inf:  # beyond the end of the feature the derivatives are others
        angle = abs(local)
        found = found and turn < min(abs(angle - hop["half_angle"]), math.pi - angle)
    found = found or abs(gap) <= hop["noise"]
    step += later
    reached = time + step
    if not (abs(step) < hop["last_step"] and reached > 0.0):
        return
    hop["last_step"], hop["root"] = abs(step), reached
    if not found:
        hop["touchdown"], hop["phase"] = reached, FALLING
    elif _alone(reached, steep, hop):
        hop["touchdown"], hop["phase"] = reached if reached <= hop["horizon"] else math.inf, LANDED


@kernel
def _heeded(height: float, speed: float, local: float, step: float, hop: np.void) -> float:
    """Shorten a step of a body with corners, so that none comes down unseen.

    The support height has a kink at +-pi, where the other corner takes over: heed that corner as well, and do not turn
    so far that the arc beyond it comes down. Without spin neither takes over: the middle of the chord stands for both,
    so that the search does not tell a body from its mirror image.
    """
    omega = hop["omega"]
    coming = -math.copysign(hop["across"], omega) if omega != 0.0 else 0.0
    a, b = arms_at(hop["along"], coming, 0.0, local)
    heeded = _safe_step(height - b, speed - a * omega, hop["bound"])
    if omega != 0.0:
        heeded = min(heeded, 0.5 * hop["half_angle"] / abs(omega))
    return min(heeded, step)


@kernel
def _march(hop: np.void) -> None:
    """Go a step that passes no root."""
    omega, noise, bound = hop["omega"], hop["noise"], hop["bound"]
    t, height = motion.once_in_reach(hop, hop["touchdown"])
    _, speed = motion.away(hop, t)
    phi = motion.turned(hop, t)
    local = phi - whole_turns(phi)
    a, b, _ = _lowest(hop, local)
    gap, rate = height - b, speed - a * omega
    if t > hop["horizon"]:
        hop["touchdown"], hop["phase"] = math.inf, LANDED
        return
    starting = gap <= noise and t <= 0.0
    if starting:
        still = hop["margin"] * (abs(speed) + hop["size"] * abs(omega))
        if rate <= still:
            hop["touchdown"], hop["phase"] = 0.0, LANDED if rate < -still else POISED
            return
    # One step of Newton where the curvature does not matter; a grazing root stays where it is.
    plain = 4.0 * bound * noise < rate * rate
    if gap <= noise and rate <= 0.0:
        hop["phase"] = LANDED
        hop["touchdown"] = max(t - gap / rate, 0.0) if plain else t
    else:
        step = _safe_step(0.0 if starting else gap, rate, bound)
        # What the curvature may be off by over the step: below rounding, the root has been reached.
        settled = rate < 0.0 and plain and bound * step * step <= noise and not starting
        if hop["half_angle"] < math.inf:
            heeded = _heeded(height, speed, local, step, hop)
            settled, step = settled and step <= heeded, heeded
        reached = t + step
        hop["touchdown"] = reached if reached <= hop["horizon"] else math.inf
        if settled or not t < reached <= hop["horizon"]:
            hop["phase"] = LANDED
    # Past this time there is only the root that is known.
    if hop["alone_from"] < hop["touchdown"] and hop["alone_from"] <= hop["horizon"]:
        hop["touchdown"], hop["phase"] = hop["root"] if hop["root"] <= hop["horizon"] else math.inf, LANDED


@kernel
def _angle_left(body: Body, phi: float, omega: float) -> float:
    """Angle [rad] that a body may turn until another feature is lowest; 2 pi without corners."""
    if not has_corners(body):
        return 2.0 * math.pi
    at = phi if omega > 0.0 else -phi
    least = math.pi - at
    for edge in (-body.half_angle, body.half_angle):
        if edge - at > EDGE:
            least = min(least, edge - at)
    return max(least, EDGE)


@kernel
def _cube_root(number: float) -> float:
    """Cube root of a number >= 0, by Newton's method between two powers of eight."""
    if not 0.0 < number < math.inf:
        return number
    scale = 1.0
    while number > 8.0:
        number, scale = 0.125 * number, 2.0 * scale
    while number < 1.0:
        number, scale = 8.0 * number, 0.5 * scale
    root = 0.5 + 0.25 * number
    for _ in range(5):
        root -= (root - number / (root * root)) / 3.0
    return scale * root


@kernel
def _lift(hop: np.void) -> float:
    """Time [s] from which to search for the touchdown of a body without a gap rate; -1 if it stays down."""
    body = Body(math.nan, hop["radius"], hop["eccentricity"], math.nan, hop["half_angle"])  # its shape, that is
    furthest, omega = hop["furthest"], hop["omega"]
    change, most_change = motion.jerks(hop)
    local = hop["phi"] - whole_turns(hop["phi"])
    # The next derivatives of the gap tell; on the edge of a feature those of the one that the body turns to.
    ahead = local + math.copysign(EDGE, omega)
    h, _, shift = feature_geometry(body, feature_at(body, ahead - whole_turns(ahead)))
    square = omega * omega
    pull = motion.pull(hop, hop["v"])
    bound = abs(pull) + furthest * square
    if bound == 0.0 and most_change == 0.0 and (hop["u"] != 0.0 or omega != 0.0):
        return math.inf  # it glides on: nothing presses it onto the slope
    sine, cosine = sine_and_cosine(local + shift)
    lift = -pull - h * cosine * square
    jerk = h * sine * square * omega + change
    if lift > 1e-9 * bound:
        # gap''' >= -h |omega|^3 and that of the height keep the gap open this long, if the feature does not end before.
        open_for = 1.5 * lift / (furthest * square * abs(omega) + most_change)
        return float(min(open_for, _angle_left(body, local, omega) / abs(omega)))
    if lift > -1e-9 * bound and jerk > 0.0:
        return _cube_root(6.0 * CLEARED * hop["noise"] / jerk)  # lifted off where the normal force vanished
    a, _, _ = _lowest(hop, local)
    return 0.0 if hop["v"] - a * omega > 0.0 else -1.0


@kernel
def begin_search(hop: np.void) -> None:
    """Go straight for the touchdown of the flight in ``hop``. If that is in doubt, :func:`search` goes on.

    The gap obeys ``gap'' >= -(pull + h omega^2)``, which often proves of a root that it is the first.
    """
    _look_ahead(hop)
    while hop["phase"] == FALLING:
        _fall(hop)


@kernel
def search(most: float, hop: np.void) -> float:
    """Go on with a search in steps that pass no root, up to ``most`` of them; return their number.

    Each goes to the first root of the parabola with the curvature of that bound, so it cannot pass a root, a grazing
    one included, and converges quadratically to a plain one. Once LANDED, ``hop["touchdown"]`` is the first time [s] at
    which the body meets the slope: docs/physics.md (7.1); inf if it does not up to ``hop["horizon"]``.
    """
    steps = 0.0
    while hop["phase"] != LANDED and steps < most:
        steps += 1.0
        if hop["phase"] == POISED:
            start = _lift(hop)
            hop["touchdown"], hop["margin"] = max(start, 0.0), 0.0
            hop["phase"] = LANDED if start < 0.0 else SEARCHING
        else:
            _march(hop)
    return steps


@kernel
def move(hop: np.void, duration: float) -> None:
    """Write where a flight has come to after some time [s], and what has been lost in it."""
    hop["duration"] = duration
    hop["x_landing"], hop["u_landing"] = motion.along(hop, duration)
    hop["y_landing"], hop["v_landing"] = motion.away(hop, duration)
    hop["t_landing"], hop["phi_landing"] = hop["t"] + duration, motion.turned(hop, duration)
    hop["omega_landing"] = hop["omega"]
    _write_losses(hop)


@kernel
def arrive(hop: np.void, duration: float) -> None:
    """Follow a flight for some time [s]: write where it then is, and how what is lowest there would touch."""
    move(hop, duration)
    local = hop["phi_landing"] - whole_turns(hop["phi_landing"])
    a, b, _ = _lowest(hop, local)
    hop["feature"] = ARC
    if abs(local) > hop["half_angle"]:
        hop["feature"] = TAIL if local > 0.0 else NOSE
    hop["a"], hop["b"] = a, b
    hop["v_n_landing"] = hop["v_landing"] - a * hop["omega"]
    hop["v_t_landing"] = hop["u_landing"] + b * hop["omega"]
