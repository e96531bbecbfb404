"""Ballistic flight up to the first touchdown, which is never stepped over: docs/physics.md, section 7.

A search is a few steps of one program, for a single flight or for many side by side. The first one goes straight for a
root and proves that none comes before. Where that fails, the second one passes none, however many there are.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.kernel.geometry import (
    TURN,
    arms,
    arms_of,
    corner_lengths,
    feature_at,
    feature_geometry,
    has_corners,
    whole_turns,
    without_turns,
)
from sledenv.kernel.jit import allocating, kernel
from sledenv.kernel.params import Body
from sledenv.kernel.records import ARC, NOSE, TAIL
from sledenv.kernel.rows import table
from sledenv.kernel.trace import (
    LANES,
    absolute,
    fma,
    larger,
    less,
    nearest,
    not_more,
    packed,
    root,
    scalar,
    smaller,
    where,
)

ROUNDING = 4e-16
EDGE = 1e-9  # [rad]

# Phases of a flight. RESTING: on the surface without a gap rate, to be looked at by itself.
FALLING, SEARCHING, LANDED, RESTING = -1.0, 0.0, 1.0, 2.0

SLOW = 0.9  # share of gravity up to which centrifugal accelerations leave the gap concave,
SLOWER = 0.5  # and up to which it is much like a parabola
CLOSE = 0.3  # [rad] of a step in which the body turns little

FEW = 3  # flights of a pack from which to follow them side by side

# Rows of a pack of flights.
(
    F_TIME,  # [s] reached by the search; of the touchdown in the end, inf if there is none
    F_PHASE,
    F_Y,  # state at the start of the flight
    F_PHI,
    F_V,
    F_OMEGA,
    F_GRAVITY,  # [m/s^2] along the inward normal
    F_HORIZON,  # [s] beyond which a touchdown is of no interest
    F_MARGIN,  # of the speeds: gap rates below do not tell whether the body lifts off
    F_BOUND,  # [m/s^2] gap'' >= -bound
    F_NOISE,  # [m] rounding error of the gap
    F_FALL,  # [s] until the body is in reach of the slope, for good
    F_CLEAR,  # [s] up to which the gap is known to be open
    F_BEFORE,  # [s] length of the step before
    F_ROOT,  # [s] a root of the gap,
    F_GOAL,  # [s] and since when there is no other
    F_TOP,  # [m] no part of the body reaches further from the mass centre
    F_RADIUS,  # of the body
    F_ECCENTRICITY,
    F_HALF_ANGLE,
    F_ALONG,  # [m] of a corner, see geometry.corner_lengths
    F_ACROSS,
    F_FURTHEST,  # [m] h of the feature with the largest
    F_LANE,  # for the caller: whose flight it is,
    F_DOWNHILL,  # [m/s^2] and gravity along the slope
) = range(25)
F_ROWS = 25


def _before_kink(phi: Any, turn: Any) -> Any:
    """Whether a body turns from an angle without passing +-pi, where one corner takes over from the other.

    There the gap has a kink, and its second derivative no bound.
    """
    before, behind = nearest(phi * (1.0 / TURN)), nearest((phi + turn) * (1.0 / TURN))
    return not_more(before, behind) & not_more(behind, before)


def _support(
    local: Any, radius: Any, eccentricity: Any, half_angle: Any, along: Any, across: Any, corners: bool
) -> tuple[Any, Any, Any]:
    """Arms of the feature that is lowest, and the radius of its curvature."""
    if not corners:
        return *arms_of(eccentricity, 0.0, radius, local), radius
    on_arc = not_more(absolute(local), half_angle)
    side = where(on_arc, 0.0, where(less(0.0, local), across, -across))
    curved = where(on_arc, radius, 0.0)
    return *arms_of(where(on_arc, eccentricity, along), side, curved, local), curved


def _safe_step(gap: Any, rate: Any, bound: Any) -> tuple[Any, Any]:
    """First root of ``gap + rate t - bound t^2 / 2``, as a quotient; NaN for a gap that stays zero."""
    twice = 2.0 * larger(gap, 0.0)
    square = root(rate * rate + bound * twice)
    closing = less(rate, 0.0)
    return where(closing, twice, rate + square), where(closing, square - rate, bound)


def _taking_off(corners: bool) -> Any:
    """Return the program of what does not change in a search, and of its first step."""

    def take_off(
        y: Any,
        phi: Any,
        v: Any,
        omega: Any,
        gravity: Any,
        top: Any,
        radius: Any,
        eccentricity: Any,
        half_angle: Any,
        along: Any,
        across: Any,
        furthest: Any,
    ) -> tuple[Any, ...]:
        square = omega * omega
        bound = gravity + furthest * square
        noise = ROUNDING * (top + absolute(y))
        thrown = (v + root(v * v + 2.0 * gravity * (y - top))) / gravity
        drifting = where(less(v, 0.0), (top - y) / v, math.inf)
        fall = where(less(0.0, gravity), thrown, drifting)
        a, b, curved = _support(without_turns(phi), radius, eccentricity, half_angle, along, across, corners)
        gap, rate = y - b, v - a * omega
        dividend, divisor = _safe_step(gap, rate, bound)
        clear = dividend / divisor
        if corners:
            clear = where(_before_kink(phi, omega * clear), clear, 0.0)
        # A slow body lands about where its parabola does, and one that flies high about where it comes in reach.
        slow = less(bound, (1.0 + SLOWER) * gravity)
        bend = where(slow, gravity + (curved - b) * square, gravity)
        far = (rate + root(rate * rate + 2.0 * gap * bend)) / bend
        first = where(~slow & less(0.0, fall), fall, far)
        still = ROUNDING * (absolute(v) + top * absolute(omega))
        begins = less(0.0, first) & less(first, math.inf) & (less(noise, gap) | less(still, rate))
        time = where(begins, first, 0.0)
        phase = where(begins, FALLING, SEARCHING)
        return phase, time, bound, noise, fall, where(begins, clear, 0.0), time

    return take_off


def _falling(corners: bool) -> Any:
    """Return the program of a step towards a root of the gap, for bodies with corners or without.

    It goes to the root of the parabola that osculates the gap, and corrects that by the next two derivatives.
    """

    def fall(
        time: Any,
        phase: Any,
        y: Any,
        phi: Any,
        v: Any,
        omega: Any,
        gravity: Any,
        horizon: Any,
        bound: Any,
        noise: Any,
        in_reach: Any,
        clear: Any,
        before: Any,
        known: Any,
        goal: Any,
        radius: Any,
        eccentricity: Any,
        half_angle: Any,
        along: Any,
        across: Any,
        furthest: Any,
    ) -> tuple[Any, ...]:
        local = without_turns(phi + omega * time)
        a, b, curved = _support(local, radius, eccentricity, half_angle, along, across, corners)
        gap, rate = y + time * (v - 0.5 * gravity * time) - b, v - gravity * time - a * omega
        square, lever = omega * omega, curved - b
        # Where the parabola has no root, its lowest point.
        steep = root(larger(rate * rate + 2.0 * gap * (gravity + lever * square), 0.0))
        step = 2.0 * gap / (steep - rate)
        turn = omega * step
        more = step * step * square * fma(turn, a * (1.0 / 6.0), lever * turn * turn * (1.0 / 24.0))
        turn = absolute(turn)
        later = where(less(turn, CLOSE), more / steep, 0.0)
        # The error of the gap is that of the slopes over the correction, and of the derivatives beyond.
        slope = absolute(later) * bound + furthest * absolute(omega) * turn * turn
        found = fma(absolute(later), slope, furthest * (1.0 / 120.0) * turn * turn * turn * turn * turn)
        found = not_more(found, noise)
        if corners:
            # Beyond the end of the feature the derivatives are others.
            size = absolute(local)
            found = found & less(turn, smaller(absolute(size - half_angle), math.pi - size))
        found = found | not_more(absolute(gap), noise)
        step = step + later
        reached = time + step
        going = less(rate, 0.0) & less(absolute(step), before) & less(0.0, reached)
        # No root comes before the one of a concave gap, while the body is out of reach, or for some time before a root.
        last = reached - 2.0 * steep / bound
        upward = 2.0 * v / gravity - in_reach
        alone = not_more(last, clear) | (not_more(upward, clear) & not_more(last, in_reach))
        if corners:
            plain = _before_kink(phi, omega * reached)
            alone, last = alone & plain, where(plain, last, math.inf)
        alone = alone | less(bound, (1.0 + SLOW) * gravity)
        landed = going & found & alone
        lost = ~going | (found & ~alone)
        falling = not_more(phase, FALLING)
        late = landed & ~not_more(reached, horizon)
        return (
            where(falling, where(lost, clear, where(late, math.inf, reached)), time),
            where(falling, where(lost, SEARCHING, where(landed, LANDED, FALLING)), phase),
            absolute(step),
            where(falling & going, reached, known),
            where(falling & going & found, last, goal),
        )

    return fall


def _marching(corners: bool) -> Any:
    """Return the program of one step of the search, for bodies with corners or without."""

    def march(
        time: Any,
        phase: Any,
        y: Any,
        phi: Any,
        v: Any,
        omega: Any,
        gravity: Any,
        horizon: Any,
        margin: Any,
        bound: Any,
        noise: Any,
        fall: Any,
        known: Any,
        goal: Any,
        top: Any,
        radius: Any,
        eccentricity: Any,
        half_angle: Any,
        along: Any,
        across: Any,
    ) -> tuple[Any, Any]:
        height = y + time * (v - 0.5 * gravity * time)
        above = less(top, height)  # out of reach until it has fallen back to ``top``
        t = where(above, larger(fall, time), time)
        height = where(above, top, height)
        speed = v - gravity * t
        local = without_turns(phi + omega * t)
        a, b, _ = _support(local, radius, eccentricity, half_angle, along, across, corners)
        gap, rate = height - b, speed - a * omega
        touching = not_more(gap, noise)
        starting = touching & not_more(t, 0.0)
        still = margin * (absolute(speed) + top * absolute(omega))
        pressing = starting & less(rate, -still)
        resting = starting & ~pressing & not_more(rate, still)
        landed = touching & not_more(rate, 0.0) & ~starting
        # One step of Newton where the curvature does not matter; a grazing root stays where it is.
        plain = less(4.0 * bound * noise, rate * rate)
        dividend, divisor = _safe_step(where(starting, 0.0, gap), rate, bound)
        step = where(landed, where(plain, gap, 0.0), dividend) / where(landed, where(plain, rate, 1.0), divisor)
        step = where(landed | less(0.0, bound) | less(rate, 0.0), step, where(less(0.0, rate), step, math.inf))
        # What the curvature may be off by over the step: below rounding, the root has been reached.
        settled = less(rate, 0.0) & plain & not_more(bound * step * step, noise) & ~starting
        if corners:
            # The support height has a kink at +-pi, where the other corner takes over: heed that corner as well, and
            # do not turn so far that the arc beyond it comes down. Without spin neither takes over: the middle of the
            # chord stands for both, so that the search does not tell a body from its mirror image.
            coming = where(less(0.0, omega), -across, where(less(omega, 0.0), across, 0.0))
            a, b = arms_of(along, coming, 0.0, local)
            dividend, divisor = _safe_step(height - b, speed - a * omega, bound)
            heeded = smaller(dividend / divisor, smaller(step, 0.5 * half_angle / absolute(omega)))
            settled = settled & not_more(step, heeded)
            step = where(landed, step, heeded)
        reached = where(landed, larger(t - step, 0.0), t + step)
        reached = where(pressing | resting, 0.0, reached)
        # No root lies between the goal and the one that is known.
        ahead = ~not_more(reached, goal) & not_more(goal, horizon)
        reached = where(ahead, known, reached)
        over = ~not_more(t, horizon) | ~(landed | not_more(reached, horizon))
        landing = landed | settled | pressing | not_more(reached, t) | ahead
        ended = where(resting, RESTING, where(landing, LANDED, SEARCHING))
        going = not_more(absolute(phase), SEARCHING)
        return (
            where(going, where(over, math.inf, reached), time),
            where(going, where(over, LANDED, ended), phase),
        )

    return march


_SHAPE = (F_RADIUS, F_ECCENTRICITY, F_HALF_ANGLE, F_ALONG, F_ACROSS)
_TOLD = (
    (F_Y, F_PHI, F_V, F_OMEGA, F_GRAVITY, F_TOP, *_SHAPE, F_FURTHEST),
    (F_PHASE, F_TIME, F_BOUND, F_NOISE, F_FALL, F_CLEAR, F_BEFORE),
)
_KNOWN = (F_TIME, F_PHASE, F_Y, F_PHI, F_V, F_OMEGA, F_GRAVITY, F_HORIZON)
_FELT = (
    (*_KNOWN, F_BOUND, F_NOISE, F_FALL, F_CLEAR, F_BEFORE, F_ROOT, F_GOAL, *_SHAPE, F_FURTHEST),
    (F_TIME, F_PHASE, F_BEFORE, F_ROOT, F_GOAL),
)
_SEEN = (*_KNOWN, F_MARGIN, F_BOUND, F_NOISE, F_FALL, F_ROOT, F_GOAL, F_TOP, *_SHAPE), (F_TIME, F_PHASE)
_take_off_disc, _take_off_discs = scalar(_taking_off(False)), packed(_taking_off(False), *_TOLD)
_take_off_sled, _take_off_sleds = scalar(_taking_off(True)), packed(_taking_off(True), *_TOLD)
_fall_disc, _fall_discs = scalar(_falling(False)), packed(_falling(False), *_FELT)
_fall_sled, _fall_sleds = scalar(_falling(True)), packed(_falling(True), *_FELT)
_march_disc, _march_discs = scalar(_marching(False)), packed(_marching(False), *_SEEN)
_march_sled, _march_sleds = scalar(_marching(True)), packed(_marching(True), *_SEEN)


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
def _lift(body: Body, furthest: float, gravity: float, noise: float, phi: float, v: float, omega: float) -> float:
    """Time [s] from which to search for the touchdown of a body without a gap rate; -1 if it stays down."""
    local = phi - whole_turns(phi)
    # The next derivatives of the gap tell; on the edge of a feature those of the one that the body turns to.
    ahead = local + math.copysign(EDGE, omega)
    h, _, shift = feature_geometry(body, feature_at(body, ahead - whole_turns(ahead)))
    square = omega * omega
    bound = gravity + furthest * square
    lift = -gravity - h * math.cos(local + shift) * square
    jerk = h * math.sin(local + shift) * square * omega
    if lift > 1e-9 * bound:
        # gap''' >= -h |omega|^3 keeps the gap open this long, if the feature does not end before.
        return min(1.5 * lift / (furthest * abs(omega) ** 3), _angle_left(body, local, omega) / abs(omega))
    if lift > -1e-9 * bound and jerk > 0.0:
        return float((600.0 * noise / jerk) ** (1.0 / 3.0))  # lifted off where the normal force vanished
    a, _ = arms(body, feature_at(body, local), local)
    return 0.0 if v - a * omega > 0.0 else -1.0


@kernel
def _extent(body: Body) -> tuple[float, float, float]:
    """Lengths of a corner, and distance [m] from the mass centre of what is furthest of all that may touch."""
    along, across = corner_lengths(body)
    h = body.eccentricity
    return along, across, max(h, math.hypot(along, across)) if has_corners(body) else h


@kernel
def _search(
    body: Body,
    t: float,
    phase: float,
    y: float,
    phi: float,
    v: float,
    omega: float,
    gravity: float,
    horizon: float,
    bound: float,
    noise: float,
    fall: float,
    known: float,
    goal: float,
    along: float,
    across: float,
    furthest: float,
) -> float:
    """Go on from ``t`` to the first root."""
    top = body.radius + body.eccentricity
    shape = (body.radius, body.eccentricity, body.half_angle, along, across)
    margin = ROUNDING
    while phase == SEARCHING:
        seen = (t, phase, y, phi, v, omega, gravity, horizon, margin, bound, noise, fall, known, goal, top, *shape)
        t, phase = _march_sled(*seen) if has_corners(body) else _march_disc(*seen)
        if phase == RESTING:
            t = _lift(body, furthest, gravity, noise, phi, v, omega)
            if t < 0.0:
                return 0.0
            phase, margin = SEARCHING, 0.0
    return t


@kernel
def touchdown_time(body: Body, gravity: float, y: float, phi: float, v: float, omega: float, horizon: float) -> float:
    """First time [s] at which the body meets the slope in free flight: docs/physics.md (7.1).

    The gap obeys ``gap'' >= -(gravity + h omega^2)``. That often proves of a root that it is the first. Where it does
    not, each step goes to the first root of the parabola with that curvature, so it cannot pass a root, a grazing one
    included, and converges quadratically to a plain one.

    Parameters
    ----------
    body : Body
    gravity : float
        Component along the inward normal [m/s^2], >= 0.
    y, phi, v, omega : float
        State at the start of the flight.
    horizon : float
        Time [s] beyond which the touchdown is of no interest.

    Returns
    -------
    float
        Time of touchdown, inf if there is none up to ``horizon``.
    """
    top = body.radius + body.eccentricity
    along, across, furthest = _extent(body)
    shape = (body.radius, body.eccentricity, body.half_angle, along, across)
    flight = (y, phi, v, omega, gravity)
    corners = has_corners(body)
    told = (*flight, top, *shape, furthest)
    phase, t, bound, noise, fall, clear, before = _take_off_sled(*told) if corners else _take_off_disc(*told)
    known, goal = 0.0, math.inf
    while phase == FALLING:
        felt = (t, phase, *flight, horizon, bound, noise, fall, clear, before, known, goal, *shape, furthest)
        t, phase, before, known, goal = _fall_sled(*felt) if corners else _fall_disc(*felt)
    return _search(body, t, phase, *flight, horizon, bound, noise, fall, known, goal, along, across, furthest)


@kernel
def tell_body(body: Body, z: np.ndarray) -> None:
    """Write whose flights those of a pack are."""
    for k in range(LANES):
        z[F_RADIUS, k], z[F_ECCENTRICITY, k], z[F_HALF_ANGLE, k] = body.radius, body.eccentricity, body.half_angle
        z[F_TOP, k] = body.radius + body.eccentricity
        z[F_ALONG, k], z[F_ACROSS, k], z[F_FURTHEST, k] = _extent(body)


@allocating
def pack_of(body: Body) -> np.ndarray:
    """Return a pack of flights of a body, shape (F_ROWS, LANES), for :func:`touchdown_times`."""
    z = table(F_ROWS, LANES)
    tell_body(body, z)
    return z


@kernel
def _number(phase: float, z: np.ndarray) -> int:
    """Number of the flights of a pack that are in a phase."""
    count = 0
    for k in range(LANES):
        count += z[F_PHASE, k] == phase
    return count


@kernel
def touchdown_times(body: Body, count: int, z: np.ndarray) -> None:
    """Find the touchdowns of the first ``count`` flights of a pack, each that of :func:`touchdown_time` bit for bit.

    Parameters
    ----------
    body : Body
    count : int
        Up to LANES.
    z : ndarray, shape (F_ROWS, LANES)
        From :func:`pack_of`, with F_Y, F_PHI, F_V, F_OMEGA, F_GRAVITY and F_HORIZON of each flight; F_TIME is
        the answer.
    """
    if count >= FEW:
        corners = has_corners(body)
        if corners:
            _take_off_sleds(z)
        else:
            _take_off_discs(z)
        for k in range(LANES):
            z[F_MARGIN, k], z[F_GOAL, k] = ROUNDING, math.inf
            if k >= count:
                z[F_PHASE, k] = LANDED
        while _number(FALLING, z) > 0:
            if corners:
                _fall_sleds(z)
            else:
                _fall_discs(z)
        if _number(SEARCHING, z) >= FEW:
            while _number(SEARCHING, z) > 0:
                if corners:
                    _march_sleds(z)
                else:
                    _march_discs(z)
    for k in range(count):
        y, phi, v, omega, gravity = z[F_Y, k], z[F_PHI, k], z[F_V, k], z[F_OMEGA, k], z[F_GRAVITY, k]
        if count < FEW:
            z[F_TIME, k] = touchdown_time(body, gravity, y, phi, v, omega, z[F_HORIZON, k])
        elif z[F_PHASE, k] != LANDED:
            flight = (y, phi, v, omega, gravity, z[F_HORIZON, k])
            known = (z[F_BOUND, k], z[F_NOISE, k], z[F_FALL, k], z[F_ROOT, k], z[F_GOAL, k])
            extent = (z[F_ALONG, k], z[F_ACROSS, k], z[F_FURTHEST, k])
            z[F_TIME, k] = _search(body, z[F_TIME, k], SEARCHING, *flight, *known, *extent)


def finish(x: Any, u: Any, acceleration: Any, length: Any) -> tuple[Any]:
    """Program of :func:`finish_time`."""
    ahead = length - x
    discriminant = u * u + 2.0 * acceleration * ahead
    speed = root(discriminant)
    time = where(not_more(0.0, u), 2.0 * ahead / (u + speed), (speed - u) / acceleration)
    never = less(discriminant, 0.0) | (less(acceleration, 0.0) & not_more(u, 0.0))
    steady = not_more(acceleration, 0.0) & not_more(0.0, acceleration)
    time = where(steady, where(less(0.0, u), ahead / u, math.inf), where(never, math.inf, time))
    return (where(less(ahead, math.inf), time, math.inf),)


_finish = scalar(finish)


@kernel
def finish_time(x: float, u: float, acceleration: float, length: float) -> float:
    """First time [s] > 0 at which ``x + u t + acceleration t^2 / 2`` reaches ``length``, inf if never."""
    return _finish(x, u, acceleration, length)[0] if length < math.inf else math.inf


def arrival(corners: bool) -> Any:
    """Return the program of a flight of some duration, and of how what is lowest then would touch."""

    def arrive(
        duration: Any,
        t: Any,
        x: Any,
        y: Any,
        phi: Any,
        u: Any,
        v: Any,
        omega: Any,
        downhill: Any,
        gravity: Any,
        radius: Any,
        eccentricity: Any,
        half_angle: Any,
        along: Any,
        across: Any,
    ) -> tuple[Any, ...]:
        phi = phi + omega * duration
        local = without_turns(phi)
        a, b, _ = _support(local, radius, eccentricity, half_angle, along, across, corners)
        feature: Any = float(ARC)
        if corners:
            corner = where(less(0.0, local), float(TAIL), float(NOSE))
            feature = where(not_more(absolute(local), half_angle), float(ARC), corner)
        x = x + duration * (u + 0.5 * downhill * duration)
        y = y + duration * (v - 0.5 * gravity * duration)
        u, v = u + downhill * duration, v - gravity * duration
        return t + duration, x, y, phi, u, v, feature, a, b, v - a * omega, u + b * omega

    return arrive


_arrive_disc, _arrive_sled = scalar(arrival(False)), scalar(arrival(True))


@kernel
def arrive_at(
    body: Body,
    duration: float,
    t: float,
    x: float,
    y: float,
    phi: float,
    u: float,
    v: float,
    omega: float,
    downhill: float,
    gravity: float,
) -> tuple[float, float, float, float, float, float, float, float, float, float, float]:
    """Follow a flight.

    Parameters
    ----------
    body : Body
    duration : float
        [s].
    t, x, y, phi, u, v, omega : float
        Time and state at its start.
    downhill, gravity : float
        Components of gravity [m/s^2], see :func:`sledenv.kernel.geometry.incline_of`.

    Returns
    -------
    tuple of float
        Time, x, y, phi, u, v at its end; of the feature that is lowest then its code, its arms a and b [m], gap rate
        and slip velocity [m/s].
    """
    along, across = corner_lengths(body)
    shape = (body.radius, body.eccentricity, body.half_angle, along, across)
    given = (duration, t, x, y, phi, u, v, omega, downhill, gravity, *shape)
    return _arrive_sled(*given) if has_corners(body) else _arrive_disc(*given)  # type: ignore[return-value]
