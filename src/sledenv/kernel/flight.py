"""Ballistic flight up to the first touchdown, which is never stepped over: docs/physics.md, section 7."""

from __future__ import annotations

import math

from sledenv.kernel.geometry import arms, feature_at, feature_geometry, has_corners, whole_turns
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body
from sledenv.kernel.records import NOSE, TAIL

ROUNDING = 4e-16
EDGE = 1e-9  # [rad]


@kernel
def _safe_step(gap: float, rate: float, bound: float) -> float:
    """First root of ``gap + rate t - bound t^2 / 2``, which no gap with ``gap'' >= -bound`` can reach sooner."""
    if bound == 0.0:
        return -gap / rate if rate < 0.0 else math.inf
    root = math.sqrt(rate * rate + 2.0 * bound * max(gap, 0.0))
    return 2.0 * max(gap, 0.0) / (root - rate) if rate < 0.0 else (rate + root) / bound


@kernel
def _branch_gap(body: Body, y: float, v: float, phi: float, omega: float, feature: int) -> tuple[float, float]:
    """Gap of a feature and its rate."""
    a, b = arms(body, feature, phi)
    return y - b, v - a * omega


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
    corners = has_corners(body)
    h_corner = feature_geometry(body, TAIL)[0] if corners else 0.0
    h_most = max(body.eccentricity, h_corner)
    top = body.radius + body.eccentricity  # no part of the body reaches further from the mass centre
    bound = gravity + h_most * omega * omega
    noise = ROUNDING * (top + abs(y))
    t = 0.0
    while t <= horizon:
        height = y + t * (v - 0.5 * gravity * t)
        speed = v - gravity * t
        if height > top:  # out of reach until it has fallen back to ``top``
            if gravity > 0.0:
                t = (v + math.sqrt(v * v + 2.0 * gravity * (y - top))) / gravity
            elif v < 0.0:
                t = (top - y) / v
            else:
                return math.inf
            if t > horizon:
                return math.inf
            height = top
            speed = v - gravity * t
        turned = phi + omega * t
        local = turned - whole_turns(turned)
        feature = feature_at(body, local)
        gap, rate = _branch_gap(body, height, speed, local, omega, feature)
        if t == 0.0 and gap <= noise:
            still = ROUNDING * (abs(speed) + top * abs(omega))
            if rate < -still:
                return 0.0
            gap = 0.0
            if rate <= still:
                # Lifted off without a gap rate: the next derivatives tell. On the edge of a feature those of the
                # one that the body turns to count.
                ahead = local + math.copysign(EDGE, omega)
                h, _, shift = feature_geometry(body, feature_at(body, ahead - whole_turns(ahead)))
                square = omega * omega
                lift = -gravity - h * math.cos(local + shift) * square
                jerk = h * math.sin(local + shift) * square * omega
                if lift > 1e-9 * bound:
                    # gap''' >= -h |omega|^3 keeps the gap open this long, if the feature does not end before.
                    t = min(1.5 * lift / (h_most * abs(omega) ** 3), _angle_left(body, local, omega) / abs(omega))
                    continue
                if lift > -1e-9 * bound and jerk > 0.0:
                    t = (600.0 * noise / jerk) ** (1.0 / 3.0)  # lifted off where the normal force vanished
                    continue
                if rate <= 0.0:
                    return 0.0
        elif gap <= noise and rate <= 0.0:
            # One step of Newton where the curvature does not matter; a grazing root stays where it is.
            return max(0.0, t - gap / rate) if rate * rate > 4.0 * bound * noise else t
        step = _safe_step(gap, rate, bound)
        if corners and omega != 0.0:
            # The support height has a kink at +-pi, where the other corner takes over: heed that corner as well,
            # and do not turn so far that the arc beyond it comes down.
            other = NOSE if omega > 0.0 else TAIL
            if feature != other:
                other_gap, other_rate = _branch_gap(body, height, speed, local, omega, other)
                step = min(step, _safe_step(other_gap, other_rate, bound))
            step = min(step, 0.5 * body.half_angle / abs(omega))
        if t + step == t:
            return t
        t += step
    return math.inf


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
