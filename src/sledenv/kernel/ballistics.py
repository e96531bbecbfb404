"""Programs of flight: its start, steps of the search for the touchdown, and where it ends.

Each serves a single flight and packs of them; ``corners`` tells whether the body has any. How the body moves is in
:mod:`sledenv.kernel.motion`.
"""

from __future__ import annotations

import math
from typing import Any

from sledenv.compiler.values import absolute, equal, fma, larger, less, nearest, not_more, root, smaller, where
from sledenv.kernel import motion
from sledenv.kernel.geometry import TURN, arms_of, without_turns
from sledenv.kernel.params import Incline
from sledenv.kernel.records import ARC, NOSE, TAIL
from sledenv.kernel.state import MOTION, change, copy

# Phases of a search. POISED: on the surface without a gap rate, to be looked at by itself.
FALLING, SEARCHING, LANDED, POISED = -1.0, 0.0, 1.0, 2.0

ROUNDING = 4e-16
LITTLE_TURN = 0.3  # [rad] of a step whose gap is much like a polynomial
# Share of the pull up to which centrifugal accelerations leave the gap concave, and up to which it is like a parabola.
CONCAVE = 0.9
PARABOLIC = 0.5


def _before_kink(phi: Any, turn: Any) -> Any:
    """Whether a body turns from an angle without passing +-pi, where one corner takes over from the other.

    There the gap has a kink, and its second derivative no bound.
    """
    return equal(nearest(phi * (1.0 / TURN)), nearest((phi + turn) * (1.0 / TURN)))


def _support(hop: Any, local: Any, corners: bool) -> tuple[Any, Any, Any]:
    """Arms of the feature that is lowest, and the radius of its curvature."""
    if not corners:
        return *arms_of(hop.eccentricity, 0.0, hop.radius, local), hop.radius
    on_arc = not_more(absolute(local), hop.half_angle)
    side = where(on_arc, 0.0, where(less(0.0, local), hop.across, -hop.across))
    curved = where(on_arc, hop.radius, 0.0)
    return *arms_of(where(on_arc, hop.eccentricity, hop.along), side, curved, local), curved


def _safe_step(gap: Any, rate: Any, bound: Any) -> tuple[Any, Any]:
    """First root of ``gap + rate t - bound t^2 / 2``, as a quotient; NaN for a gap that stays zero."""
    twice = 2.0 * larger(gap, 0.0)
    square = root(rate * rate + bound * twice)
    closing = less(rate, 0.0)
    return where(closing, twice, rate + square), where(closing, square - rate, bound)


def begin_flight(hop: Any, slope: Any, limits: Any, flight: Any) -> None:
    """Program of where a flight starts, and of what it is subject to."""
    copy(slope, hop, Incline._fields)
    copy(flight, hop, MOTION)
    hop.max_time, hop.horizon = limits.max_time, limits.max_time - flight.t


def take_off(hop: Any, corners: bool) -> None:
    """Program of what does not change in a search, and of its first step."""
    y, v, omega, pull, top = hop.y, hop.v, hop.omega, motion.pull(hop, hop.v), hop.size
    square = omega * omega
    most = motion.most_pull(hop)
    bound = most + hop.furthest * square
    noise = ROUNDING * (top + absolute(y))
    # It stays out of reach for as long as on a parabola.
    thrown = (v + root(v * v + 2.0 * most * (y - top))) / most
    drifting = where(less(v, 0.0), (top - y) / v, math.inf)
    in_reach = where(less(0.0, most), thrown, drifting)
    a, b, curved = _support(hop, without_turns(hop.phi), corners)
    gap, rate = y - b, v - a * omega
    dividend, divisor = _safe_step(gap, rate, bound)
    clear = dividend / divisor
    if corners:
        clear = where(_before_kink(hop.phi, omega * clear), clear, 0.0)
    # A slow body lands about where its parabola does, and one that flies high about where it comes in reach.
    slow = less(bound, (1.0 + PARABOLIC) * pull)
    bend = where(slow, pull + (curved - b) * square, pull)
    far = (rate + root(rate * rate + 2.0 * gap * bend)) / bend
    first = where(~slow & less(0.0, in_reach), in_reach, far)
    still = ROUNDING * (absolute(v) + top * absolute(omega))
    begins = less(0.0, first) & less(first, math.inf) & (less(noise, gap) | less(still, rate))
    hop.bound, hop.noise, hop.margin, hop.in_reach = bound, noise, ROUNDING, in_reach
    hop.clear = where(begins, clear, 0.0)
    hop.touchdown = hop.last_step = where(begins, first, 0.0)
    hop.phase = where(begins, FALLING, SEARCHING)
    hop.root, hop.alone_from = 0.0, math.inf


def fall(hop: Any, corners: bool) -> None:
    """Program of a step towards a root of the gap.

    It goes to the root of the parabola that osculates the gap, and corrects that by the next two derivatives.
    """
    time, omega, furthest = hop.touchdown, hop.omega, hop.furthest
    local = without_turns(motion.turned(hop, time))
    a, b, curved = _support(hop, local, corners)
    height, speed = motion.away(hop, time)
    gap, rate, pull = height - b, speed - a * omega, motion.pull(hop, speed)
    square, lever = omega * omega, curved - b
    # Where the parabola has no root, its lowest point.
    steep = root(larger(rate * rate + 2.0 * gap * (pull + lever * square), 0.0))
    step = 2.0 * gap / (steep - rate)
    turn = omega * step
    more = step * step * square * fma(turn, a * (1.0 / 6.0), lever * turn * turn * (1.0 / 24.0))
    turn = absolute(turn)
    later = where(less(turn, LITTLE_TURN), more / steep, 0.0)
    # The error of the gap is that of the slopes over the correction, and of the derivatives beyond.
    slope = absolute(later) * hop.bound + furthest * absolute(omega) * turn * turn
    error = fma(absolute(later), slope, furthest * (1.0 / 120.0) * turn * turn * turn * turn * turn)
    error = sum(motion.departures(hop, step, later), error)
    found = not_more(error, hop.noise)
    if corners:
        # Beyond the end of the feature the derivatives are others.
        angle = absolute(local)
        found = found & less(turn, smaller(absolute(angle - hop.half_angle), math.pi - angle))
    found = found | not_more(absolute(gap), hop.noise)
    step = step + later
    reached = time + step
    going = less(rate, 0.0) & less(absolute(step), hop.last_step) & less(0.0, reached)
    # No root comes before the one of a concave gap, while the body is out of reach, or for some time before a root.
    last = reached - 2.0 * steep / hop.bound
    upward = 2.0 * hop.v / motion.most_pull(hop) - hop.in_reach
    alone = not_more(last, hop.clear) | (not_more(upward, hop.clear) & not_more(last, hop.in_reach))
    if corners:
        plain = _before_kink(hop.phi, omega * reached)
        alone, last = alone & plain, where(plain, last, math.inf)
    alone = alone | less(hop.bound, (1.0 + CONCAVE) * motion.least_pull(hop, reached))
    landed = going & found & alone
    lost = ~going | (found & ~alone)
    late = landed & ~not_more(reached, hop.horizon)
    falling = not_more(hop.phase, FALLING)
    hop.last_step = absolute(step)
    change(hop, falling & going, root=reached)
    change(hop, falling & going & found, alone_from=last)
    change(
        hop,
        falling,
        touchdown=where(lost, hop.clear, where(late, math.inf, reached)),
        phase=where(lost, SEARCHING, where(landed, LANDED, FALLING)),
    )


def march(hop: Any, corners: bool) -> None:
    """Program of a step that passes no root."""
    omega, top, noise = hop.omega, hop.size, hop.noise
    t, height = motion.once_in_reach(hop, hop.touchdown)
    _, speed = motion.away(hop, t)
    local = without_turns(motion.turned(hop, t))
    a, b, _ = _support(hop, local, corners)
    gap, rate = height - b, speed - a * omega
    touching = not_more(gap, noise)
    starting = touching & not_more(t, 0.0)
    still = hop.margin * (absolute(speed) + top * absolute(omega))
    pressing = starting & less(rate, -still)
    poised = starting & ~pressing & not_more(rate, still)
    landed = touching & not_more(rate, 0.0) & ~starting
    # One step of Newton where the curvature does not matter; a grazing root stays where it is.
    plain = less(4.0 * hop.bound * noise, rate * rate)
    dividend, divisor = _safe_step(where(starting, 0.0, gap), rate, hop.bound)
    step = where(landed, where(plain, gap, 0.0), dividend) / where(landed, where(plain, rate, 1.0), divisor)
    moves = landed | less(0.0, hop.bound) | less(rate, 0.0)
    step = where(moves, step, where(less(0.0, rate), step, math.inf))
    # What the curvature may be off by over the step: below rounding, the root has been reached.
    settled = less(rate, 0.0) & plain & not_more(hop.bound * step * step, noise) & ~starting
    if corners:
        # The support height has a kink at +-pi, where the other corner takes over: heed that corner as well, and do not
        # turn so far that the arc beyond it comes down. Without spin neither takes over: the middle of the chord stands
        # for both, so that the search does not tell a body from its mirror image.
        coming = where(less(0.0, omega), -hop.across, where(less(omega, 0.0), hop.across, 0.0))
        a, b = arms_of(hop.along, coming, 0.0, local)
        dividend, divisor = _safe_step(height - b, speed - a * omega, hop.bound)
        heeded = smaller(dividend / divisor, smaller(step, 0.5 * hop.half_angle / absolute(omega)))
        settled = settled & not_more(step, heeded)
        step = where(landed, step, heeded)
    reached = where(landed, larger(t - step, 0.0), t + step)
    reached = where(pressing | poised, 0.0, reached)
    # Past this time there is only the root that is known.
    ahead = ~not_more(reached, hop.alone_from) & not_more(hop.alone_from, hop.horizon)
    reached = where(ahead, hop.root, reached)
    over = ~not_more(t, hop.horizon) | ~(landed | not_more(reached, hop.horizon))
    ends = over | landed | settled | pressing | not_more(reached, t) | ahead
    change(
        hop,
        equal(hop.phase, SEARCHING),
        touchdown=where(over, math.inf, reached),
        phase=where(poised & ~over, POISED, where(ends, LANDED, SEARCHING)),
    )


def move(hop: Any, duration: Any) -> None:
    """Program of where a flight has come to after some time [s], and of what has been lost in it."""
    hop.x_landing, hop.u_landing = motion.along(hop, duration)
    hop.y_landing, hop.v_landing = motion.away(hop, duration)
    hop.t_landing, hop.phi_landing = hop.t + duration, motion.turned(hop, duration)
    hop.omega_landing = hop.omega
    for name, lost in motion.losses(hop, hop, duration).items():
        setattr(hop, name, lost / hop.per_mass)


def arrival(hop: Any, duration: Any, corners: bool) -> None:
    """Program of a flight of some duration [s], and of how what is lowest then would touch."""
    move(hop, duration)
    local = without_turns(hop.phi_landing)
    a, b, _ = _support(hop, local, corners)
    feature: Any = float(ARC)
    if corners:
        corner = where(less(0.0, local), float(TAIL), float(NOSE))
        feature = where(not_more(absolute(local), hop.half_angle), float(ARC), corner)
    hop.feature, hop.a, hop.b = feature, a, b
    hop.v_n_landing, hop.v_t_landing = hop.v_landing - a * hop.omega, hop.u_landing + b * hop.omega
