"""Ballistic flight up to the first touchdown, which is never stepped over: docs/physics.md, section 7.

A search is a few steps of one program, :func:`_march`, for a single flight or for many side by side.
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
)
from sledenv.kernel.jit import allocating, kernel
from sledenv.kernel.params import Body
from sledenv.kernel.trace import LANES, absolute, larger, less, nearest, not_more, packed, root, scalar, smaller, where

ROUNDING = 4e-16
EDGE = 1e-9  # [rad]

SEARCHING, LANDED, RESTING = 0.0, 1.0, 2.0  # RESTING: on the surface without a gap rate, to be looked at by itself

FEW = 3  # flights of a pack from which it is worth while

# Rows of a pack of flights.
(
    F_TIME,  # [s] reached by the search; of the touchdown in the end, inf if there is none
    F_PHASE,  # SEARCHING, LANDED or RESTING
    F_Y,  # state at the start of the flight
    F_PHI,
    F_V,
    F_OMEGA,
    F_GRAVITY,  # [m/s^2] along the inward normal
    F_HORIZON,  # [s] beyond which a touchdown is of no interest
    F_MARGIN,  # of the speeds: gap rates below do not tell whether the body lifts off
    F_BOUND,  # [m/s^2] gap'' >= -bound
    F_NOISE,  # [m] rounding error of the gap
    F_FALL,  # [s] until the body is in reach of the slope
    F_TOP,  # [m] no part of the body reaches further from the mass centre
    F_RADIUS,  # of the body
    F_ECCENTRICITY,
    F_HALF_ANGLE,
    F_ALONG,  # [m] of a corner, see geometry.corner_lengths
    F_ACROSS,
    F_FURTHEST,  # [m] h of the feature with the largest
    F_LANE,  # for the caller: whose flight it is,
    F_DOWNHILL,  # [m/s^2] and gravity along the slope
) = range(21)
F_ROWS = 21


def _take_off(y: Any, v: Any, omega: Any, gravity: Any, top: Any, furthest: Any) -> tuple[Any, Any, Any]:
    """Program of what does not change in the search: bound, noise and fall."""
    bound = gravity + furthest * omega * omega
    noise = ROUNDING * (top + absolute(y))
    thrown = (v + root(v * v + 2.0 * gravity * (y - top))) / gravity
    drifting = where(less(v, 0.0), (top - y) / v, math.inf)
    return bound, noise, where(less(0.0, gravity), thrown, drifting)


def _safe_step(gap: Any, rate: Any, bound: Any) -> tuple[Any, Any]:
    """First root of ``gap + rate t - bound t^2 / 2``, as a quotient; NaN for a gap that stays zero."""
    twice = 2.0 * larger(gap, 0.0)
    square = root(rate * rate + bound * twice)
    closing = less(rate, 0.0)
    return where(closing, twice, rate + square), where(closing, square - rate, bound)


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
        turned = phi + omega * t
        local = turned - TURN * nearest(turned * (1.0 / TURN))
        if corners:
            on_arc = not_more(absolute(local), half_angle)
            side = where(on_arc, 0.0, where(less(0.0, local), across, -across))
            a, b = arms_of(where(on_arc, eccentricity, along), side, where(on_arc, radius, 0.0), local)
        else:
            a, b = arms_of(eccentricity, 0.0, radius, local)
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
        over = ~not_more(t, horizon) | ~(landed | not_more(reached, horizon))
        landing = landed | settled | pressing | not_more(reached, t)
        ended = where(resting, RESTING, where(landing, LANDED, SEARCHING))
        going = not_more(phase, SEARCHING)
        return (
            where(going, where(over, math.inf, reached), time),
            where(going, where(over, LANDED, ended), phase),
        )

    return march


_TOLD = (F_Y, F_V, F_OMEGA, F_GRAVITY, F_TOP, F_FURTHEST), (F_BOUND, F_NOISE, F_FALL)
_SEEN = range(F_ACROSS + 1), (F_TIME, F_PHASE)
_take_off_one, _take_off_all = scalar(_take_off), packed(_take_off, *_TOLD)
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
def touchdown_time(body: Body, gravity: float, y: float, phi: float, v: float, omega: float, horizon: float) -> float:
    """First time [s] at which the body meets the slope in free flight: docs/physics.md (7.1).

    The gap obeys ``gap'' >= -(gravity + h omega^2)``; each step goes to the first root of the parabola with that
    curvature, so it cannot pass a root, a grazing one included, and converges quadratically to a plain one.

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
    r, h, edge = body.radius, body.eccentricity, body.half_angle
    top = r + h
    corners = has_corners(body)
    along, across = corner_lengths(body)
    furthest = max(h, math.hypot(along, across)) if corners else h
    bound, noise, fall = _take_off_one(y, v, omega, gravity, top, furthest)
    t, phase, margin = 0.0, SEARCHING, ROUNDING
    while phase == SEARCHING:
        if corners:
            t, phase = _march_sled(
                t, phase, y, phi, v, omega, gravity, horizon, margin, bound, noise, fall, top, r, h, edge, along, across
            )
        else:
            t, phase = _march_disc(
                t, phase, y, phi, v, omega, gravity, horizon, margin, bound, noise, fall, top, r, h, edge, along, across
            )
        if phase == RESTING:
            t = _lift(body, furthest, gravity, noise, phi, v, omega)
            if t < 0.0:
                return 0.0
            phase, margin = SEARCHING, 0.0
    return t


@allocating
def pack_of(body: Body) -> np.ndarray:
    """Return a pack of flights of a body, shape (F_ROWS, LANES), for :func:`touchdown_times`."""
    z = np.zeros((F_ROWS, LANES))
    along, across = corner_lengths(body)
    for k in range(LANES):
        z[F_RADIUS, k], z[F_ECCENTRICITY, k], z[F_HALF_ANGLE, k] = body.radius, body.eccentricity, body.half_angle
        z[F_TOP, k] = body.radius + body.eccentricity
        z[F_ALONG, k], z[F_ACROSS, k] = along, across
        furthest = max(body.eccentricity, math.hypot(along, across)) if has_corners(body) else body.eccentricity
        z[F_FURTHEST, k] = furthest
    return z


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
        for k in range(LANES):
            z[F_TIME, k] = 0.0
            z[F_PHASE, k] = SEARCHING if k < count else LANDED
            z[F_MARGIN, k] = ROUNDING
        _take_off_all(z)
        searching = count
        while searching > 0:
            if corners:
                _march_sleds(z)
            else:
                _march_discs(z)
            searching = 0
            for k in range(LANES):
                searching += z[F_PHASE, k] == SEARCHING
    for k in range(count):
        if count < FEW or z[F_PHASE, k] == RESTING:
            y, phi, v, omega = z[F_Y, k], z[F_PHI, k], z[F_V, k], z[F_OMEGA, k]
            z[F_TIME, k] = touchdown_time(body, z[F_GRAVITY, k], y, phi, v, omega, z[F_HORIZON, k])


@kernel
def finish_time(x: float, u: float, acceleration: float, length: float) -> float:
    """First time [s] > 0 at which ``x + u t + acceleration t^2 / 2`` reaches ``length``, inf if never."""
    ahead = length - x
    if not ahead < math.inf:
        return math.inf
    if acceleration == 0.0:
        return ahead / u if u > 0.0 else math.inf
    discriminant = u * u + 2.0 * acceleration * ahead
    if discriminant < 0.0 or (acceleration < 0.0 and u <= 0.0):
        return math.inf
    root = math.sqrt(discriminant)
    return 2.0 * ahead / (u + root) if u >= 0.0 else (root - u) / acceleration
