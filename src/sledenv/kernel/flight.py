"""Ballistic flight up to the first touchdown, which is never stepped over: docs/physics.md, section 7.

A search first goes straight for a root of the gap, and proves that no root comes before. If that fails, it goes on in
steps that pass no root, as many as it takes. How the body moves is in :mod:`sledenv.kernel.motion`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import straight
from sledenv.kernel import motion
from sledenv.kernel.outline import arc_at, arms, lowest_arms, sine_and_cosine, whole_turns, within
from sledenv.kernel.params import Incline, Limits
from sledenv.kernel.state import FALLING, LANDED, MOTION, POISED, SEARCHING, copy

EDGE = 1e-9  # [rad] the body is at the end of an interval if it is this close
CLEARED = 100.0  # a gap of so many rounding errors is open for certain
ROUNDING = 4e-16  # of the terms of a gap or a gap rate: rounding error of their sum
LITTLE_TURN = 0.3  # [rad] in a step with less, a short series describes the gap well
# Centrifugal acceleration over the pull: up to CONCAVE the gap is concave, up to PARABOLIC it is like a parabola.
CONCAVE = 0.9
PARABOLIC = 0.5


def _start_of(hop: Any, slope: Any, flight: Any) -> None:
    """Program that writes the slope of a flight, and where it starts."""
    copy(slope, hop, Incline._fields)
    copy(flight, hop, MOTION)


def _losses_of(hop: Any) -> None:
    """Program that writes what a flight has lost."""
    for name, lost in motion.losses(hop, hop, hop.duration).items():
        setattr(hop, name, lost / hop.per_mass)


_write_start, _write_losses = straight(_start_of), straight(_losses_of)


@kernel
def write_body(body: np.void, hop: np.void) -> None:
    """Write what a hop needs of its body."""
    hop["size"], hop["furthest"] = body["size"], body["furthest"]
    hop["per_mass"], hop["per_inertia"] = 1.0 / body["mass"], 1.0 / body["inertia"]


@kernel
def write_flight(hop: np.void, slope: Incline, limits: Limits, flight: np.void) -> None:
    """Write the slope and the limit of a flight, and where it starts; ``flight`` is a record of OUTCOME."""
    _write_start(hop, slope, flight)
    hop["horizon"] = limits.max_time - flight["t"]


@kernel
def _to_kink(body: np.void, arc: int, local: float, omega: float) -> float:
    """Angle [rad] that a body may turn with its spin until it passes a straight side; inf if there is none.

    There an arc takes over from another one at a distance. The gap has a kink, so its second derivative has no bound.
    """
    if omega == 0.0:
        return math.inf
    turned, edge = 0.0, 0.0
    for _ in range(int(body["count"])):
        if omega > 0.0:
            edge = body["high"][arc]
            kinked, ahead = body["side"][arc] > 0.0, int(body["next"][arc])
            turned += edge - local
            local = body["low"][ahead]
        else:
            ahead = int(body["previous"][arc])
            edge, kinked = body["low"][arc], body["side"][ahead] > 0.0
            turned += local - edge
            local = body["high"][ahead]
        if kinked or not turned < math.inf:
            return float(max(turned, 0.0))
        arc = ahead
    return math.inf


@kernel
def _root(square: float) -> float:
    """Square root, NaN of a negative number."""
    return math.sqrt(square) if square >= 0.0 else math.nan


@kernel
def _safe_step(gap: float, rate: float, bound: float) -> float:
    """First root of ``gap + rate t - bound t^2 / 2``, inf if there is none."""
    twice = 2.0 * max(gap, 0.0)
    square = math.sqrt(rate * rate + bound * twice)
    if rate < 0.0:
        return twice / (square - rate)
    return (rate + square) / bound if bound > 0.0 else math.inf


@kernel
def _look_ahead(body: np.void, hop: np.void) -> None:
    """Write what does not change in a search, and where its first step goes."""
    y, v, omega, pull, top = hop["y"], hop["v"], hop["omega"], motion.pull(hop, hop["v"]), hop["size"]
    square, most = omega * omega, motion.most_pull(hop)
    bound = most + hop["furthest"] * square
    local = hop["phi"] - whole_turns(hop["phi"])
    arc, a, b = lowest_arms(body, local)
    radius = body["r"][arc]
    gap, rate = y - b, v - a * omega
    hop["kink"] = _to_kink(body, arc, local, omega)
    hop["bound"], hop["noise"], hop["margin"] = bound, ROUNDING * (top + abs(y)), ROUNDING
    hop["root"], hop["alone_from"] = 0.0, math.inf
    # The body stays out of reach at least as long as on the parabola of the largest pull.
    if most > 0.0:
        hop["in_reach"] = (v + _root(v * v + 2.0 * most * (y - top))) / most
    else:
        hop["in_reach"] = (top - y) / v if v < 0.0 else math.inf
    # A body that turns slowly lands near the root of its parabola. Any other body lands soon after it comes in reach.
    slow = bound < (1.0 + PARABOLIC) * pull
    first = hop["in_reach"]
    if slow or not first > 0.0:
        bend = pull + (radius - b) * square if slow else pull
        first = (rate + _root(rate * rate + 2.0 * gap * bend)) / bend if bend != 0.0 else math.nan
    still = ROUNDING * (abs(v) + top * abs(omega))
    hop["clear"] = hop["touchdown"] = hop["last_step"] = 0.0
    hop["phase"] = SEARCHING
    if 0.0 < first < math.inf and (gap > hop["noise"] or rate > still):
        clear = _safe_step(gap, rate, bound)
        hop["clear"] = clear if abs(omega) * clear < hop["kink"] else 0.0
        hop["touchdown"] = hop["last_step"] = first
        hop["phase"] = FALLING


@kernel
def _alone(reached: float, steep: float, hop: np.void) -> bool:
    """Return whether a root is surely the first: the one at ``reached`` [s], where the gap closes with ``steep`` [m/s].

    It is the first root of a concave gap. It is the first of any gap if three spans leave no time for another root: the
    gap is open at the start of the flight, while the body is out of reach, and just before a root.
    """
    if not abs(hop["omega"]) * reached < hop["kink"]:
        hop["alone_from"] = math.inf
    else:
        last = hop["alone_from"] = reached - 2.0 * steep / hop["bound"] if hop["bound"] > 0.0 else -math.inf
        upward = 2.0 * hop["v"] / motion.most_pull(hop) - hop["in_reach"] if motion.most_pull(hop) > 0.0 else math.inf
        if last <= hop["clear"] or (upward <= hop["clear"] and last <= hop["in_reach"]):
            return True
    return bool(hop["bound"] < (1.0 + CONCAVE) * motion.least_pull(hop, reached))


@kernel
def _fall(body: np.void, hop: np.void) -> None:
    """Go a step towards a root of the gap.

    The step goes to the root of the parabola that osculates the gap. The next two derivatives correct it.
    """
    time, omega = hop["touchdown"], hop["omega"]
    phi = motion.turned(hop, time)
    local = phi - whole_turns(phi)
    arc, a, b = lowest_arms(body, local)
    radius = body["r"][arc]
    height, speed = motion.away(hop, time)
    gap, rate, pull = height - b, speed - a * omega, motion.pull(hop, speed)
    square, lever = omega * omega, radius - b
    # If the parabola has no root, the step goes to that of the parabola with this gap and rate that just touches zero.
    steep = math.sqrt(max(rate * rate + 2.0 * gap * (pull + lever * square), 0.0))
    hop["touchdown"], hop["phase"] = hop["clear"], SEARCHING  # unless the step succeeds
    if not rate < 0.0:
        return
    step = 2.0 * gap / (steep - rate)
    turn = omega * step
    later = 0.0
    if abs(turn) < LITTLE_TURN and steep > 0.0:
        later = step * step * square * (turn * a * (1.0 / 6.0) + lever * turn * turn * (1.0 / 24.0)) / steep
    # The error of the gap is that of the parabola, of the slope times the correction, and of the fifth derivative on.
    turn = abs(turn)
    slope = abs(later) * hop["bound"] + hop["furthest"] * abs(omega) * turn * turn
    error = motion.departure(hop, step, later) + abs(later) * slope
    error += hop["furthest"] * (1.0 / 120.0) * turn * turn * turn * turn * turn
    found = error <= hop["noise"]
    # Beyond the end of its interval the derivatives differ.
    found = found and turn < min(body["high"][arc] - local, local - body["low"][arc])
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
def _heeded(height: float, speed: float, local: float, arc: int, body: np.void, hop: np.void) -> float:
    """Step [s] that passes no straight side unseen: up to where the body lies parallel to the first one ahead.

    From there on the arc across the side is heeded too, up to the end of its interval.
    """
    omega = hop["omega"]
    if omega == 0.0:
        return math.inf
    left = _to_kink(body, arc, local, omega)
    if not left <= EDGE:
        return float(left / abs(omega))
    coming = int(body["next"][arc] if omega > 0.0 else body["previous"][arc])
    a, b = arms(body, coming, local)
    width = body["high"][coming] - body["low"][coming]
    return float(min(_safe_step(height - b, speed - a * omega, hop["bound"]), (left + width) / abs(omega)))


@kernel
def _march(body: np.void, hop: np.void) -> None:
    """Go a step that passes no root."""
    omega, noise, bound = hop["omega"], hop["noise"], hop["bound"]
    t, height = motion.once_in_reach(hop, hop["touchdown"])
    if t > hop["horizon"] or not t < math.inf:
        hop["touchdown"], hop["phase"] = math.inf, LANDED
        return
    _, speed = motion.away(hop, t)
    phi = motion.turned(hop, t)
    local = phi - whole_turns(phi)
    arc, a, b = lowest_arms(body, local)
    gap, rate = height - b, speed - a * omega
    starting = gap <= noise and t <= 0.0
    if starting:
        still = hop["margin"] * (abs(speed) + hop["size"] * abs(omega))
        if rate <= still:
            hop["touchdown"], hop["phase"] = 0.0, LANDED if rate < -still else POISED
            return
    # A plain root, where the curvature does not matter, gets one step of Newton's method. A grazing root gets none.
    plain = 4.0 * bound * noise < rate * rate
    if gap <= noise and rate <= 0.0:
        hop["phase"] = LANDED
        hop["touchdown"] = max(t - gap / rate, 0.0) if plain else t
    else:
        step = _safe_step(0.0 if starting else gap, rate, bound)
        # The root is reached if all that the curvature can change over the step is below rounding.
        settled = rate < 0.0 and plain and bound * step * step <= noise and not starting
        if hop["kink"] < math.inf:
            heeded = _heeded(height, speed, local, arc, body, hop)
            settled, step = settled and step <= heeded, min(step, heeded)
        reached = t + step
        hop["touchdown"] = reached if reached <= hop["horizon"] else math.inf
        if settled or not t < reached <= hop["horizon"]:
            hop["phase"] = LANDED
    # After ``alone_from`` there is no root but the one that is known.
    if hop["alone_from"] < hop["touchdown"] and hop["alone_from"] <= hop["horizon"]:
        hop["touchdown"], hop["phase"] = hop["root"] if hop["root"] <= hop["horizon"] else math.inf, LANDED


@kernel
def _angle_left(body: np.void, arc: int, local: float, omega: float) -> float:
    """Angle [rad] that a body may turn until another arc than the given one is lowest; 2 pi of a disc."""
    left = body["high"][arc] - local if omega > 0.0 else local - body["low"][arc]
    return float(min(max(left, EDGE), 2.0 * math.pi))


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
def _lift(body: np.void, hop: np.void) -> float:
    """Time [s] at which the search for the touchdown of a body without a gap rate starts; -1 if the body stays down."""
    furthest, omega = hop["furthest"], hop["omega"]
    change, most_change = motion.jerks(hop)
    local = hop["phi"] - whole_turns(hop["phi"])
    # The next derivatives of the gap decide. At the end of an interval they are those of the arc that comes next.
    ahead = local + math.copysign(EDGE, omega)
    arc = arc_at(body, ahead - whole_turns(ahead))
    h, shift = body["h"][arc], body["shift"][arc]
    square = omega * omega
    pull = motion.pull(hop, hop["v"])
    bound = abs(pull) + furthest * square
    if bound == 0.0 and most_change == 0.0 and (hop["u"] != 0.0 or omega != 0.0):
        return math.inf  # it glides on: nothing presses it onto the slope
    sine, cosine = sine_and_cosine(local + shift)
    lift = -pull - h * cosine * square
    jerk = h * sine * square * omega + change
    if lift > 1e-9 * bound:
        # The gap stays open this long, unless the interval ends before: gap''' is not below -h |omega|^3 - most_change.
        open_for = 1.5 * lift / (furthest * square * abs(omega) + most_change)
        return float(min(open_for, _angle_left(body, arc, local - within(body, arc, local), omega) / abs(omega)))
    if lift > -1e-9 * bound and jerk > 0.0:
        return _cube_root(6.0 * CLEARED * hop["noise"] / jerk)  # it lifts off where the normal force is zero
    _, a, _ = lowest_arms(body, local)
    return 0.0 if hop["v"] - a * omega > 0.0 else -1.0


@kernel
def begin_search(body: np.void, hop: np.void) -> None:
    """Go straight for the touchdown of the flight in ``hop``. Where it may not be the first, :func:`search` goes on.

    The gap obeys ``gap'' >= -(pull + h omega^2)``. This often proves that a root is the first.
    """
    _look_ahead(body, hop)
    while hop["phase"] == FALLING:
        _fall(body, hop)


@kernel
def search(most: float, body: np.void, hop: np.void) -> float:
    """Go on with a search in steps that pass no root, up to ``most`` of them; return their number.

    Each step goes to the first root of a parabola below the gap, with the bound of :func:`begin_search` as curvature.
    So a step passes no root, not even a grazing one, and the steps converge quadratically to a plain root. Once LANDED,
    ``hop["touchdown"]`` is the first time [s] at which the body meets the slope, docs/physics.md (7.1). It is inf if
    the body does not meet the slope before ``hop["horizon"]``.
    """
    steps = 0.0
    while hop["phase"] != LANDED and steps < most:
        steps += 1.0
        if hop["phase"] == POISED:
            start = _lift(body, hop)
            hop["touchdown"], hop["margin"] = max(start, 0.0), 0.0
            hop["phase"] = SEARCHING if 0.0 <= start < math.inf else LANDED
        else:
            _march(body, hop)
    return steps


@kernel
def move(hop: np.void, duration: float) -> None:
    """Write where a flight is after some time [s], and what it has lost."""
    hop["duration"] = duration
    hop["x_landing"], hop["u_landing"] = motion.along(hop, duration)
    hop["y_landing"], hop["v_landing"] = motion.away(hop, duration)
    hop["t_landing"], hop["phi_landing"] = hop["t"] + duration, motion.turned(hop, duration)
    hop["omega_landing"] = hop["omega"]
    _write_losses(hop)


@kernel
def arrive(body: np.void, hop: np.void, duration: float) -> None:
    """Write where a flight is after some time [s], and how the lowest arc of the body would touch there."""
    move(hop, duration)
    arc, a, b = lowest_arms(body, hop["phi_landing"] - whole_turns(hop["phi_landing"]))
    hop["arc"], hop["a"], hop["b"] = arc, a, b
    hop["v_n_landing"] = hop["v_landing"] - a * hop["omega"]
    hop["v_t_landing"] = hop["u_landing"] + b * hop["omega"]
