"""Ballistic flight up to the first touchdown, which is never stepped over: docs/physics.md, section 7.

A search first goes straight for a root and proves that none comes before. Where that fails, it goes on in steps that
pass none, however many there are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel, part
from sledenv.compiler.trace import scalar, straight
from sledenv.kernel import ballistics, motion
from sledenv.kernel.geometry import (
    arms,
    corner_lengths,
    distance,
    feature_at,
    feature_geometry,
    has_corners,
    sine_and_cosine,
    whole_turns,
)
from sledenv.kernel.params import Body

EDGE = 1e-9  # [rad]
CLEARED = 100.0  # rounding errors of a gap that is open for certain


def _for_bodies(program: Callable[[Any, bool], None]) -> Callable[[Body, Any], None]:
    """Return a kernel that runs a program of hops, for bodies with corners or without."""
    with_corners, without = straight(lambda hop: program(hop, True)), straight(lambda hop: program(hop, False))

    @part
    def run(body: Body, hop: Any) -> None:
        if has_corners(body):
            with_corners(hop)
        else:
            without(hop)

    return run


_take_off, _fall, _march = _for_bodies(ballistics.take_off), _for_bodies(ballistics.fall), _for_bodies(ballistics.march)
_arrive = _for_bodies(lambda hop, corners: ballistics.arrival(hop, hop.duration, corners))
# Write where a flight starts, from a record of OUTCOME, and what it is subject to; where it is after some time [s].
tell_flight, go_on = straight(ballistics.begin_flight), straight(ballistics.move)
_finish = scalar(lambda hop: (motion.finish_of(hop),))
_drawn = scalar(lambda hop: (motion.pull(hop, hop.v), *motion.jerks(hop)))


@kernel
def tell_body(body: Body, hop: np.void) -> None:
    """Write whose hop it is."""
    h, (along, across) = body.eccentricity, corner_lengths(body)
    hop["radius"], hop["eccentricity"], hop["half_angle"] = body.radius, h, body.half_angle
    hop["along"], hop["across"] = along, across
    hop["furthest"] = max(h, distance(along, across)) if has_corners(body) else h
    hop["size"] = body.radius + body.eccentricity
    hop["per_mass"], hop["per_inertia"] = 1.0 / body.mass, 1.0 / body.inertia


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
    pull, change, most_change = _drawn(hop)
    local = hop["phi"] - whole_turns(hop["phi"])
    # The next derivatives of the gap tell; on the edge of a feature those of the one that the body turns to.
    ahead = local + math.copysign(EDGE, omega)
    h, _, shift = feature_geometry(body, feature_at(body, ahead - whole_turns(ahead)))
    square = omega * omega
    bound = abs(pull) + furthest * square
    sine, cosine = sine_and_cosine(local + shift)
    lift = -pull - h * cosine * square
    jerk = h * sine * square * omega + change
    if lift > 1e-9 * bound:
        # gap''' >= -h |omega|^3 and that of the height keep the gap open this long, if the feature does not end before.
        open_for = 1.5 * lift / (furthest * square * abs(omega) + most_change)
        return float(min(open_for, _angle_left(body, local, omega) / abs(omega)))
    if lift > -1e-9 * bound and jerk > 0.0:
        return _cube_root(6.0 * CLEARED * hop["noise"] / jerk)  # lifted off where the normal force vanished
    a, _ = arms(body, feature_at(body, local), local)
    return 0.0 if hop["v"] - a * omega > 0.0 else -1.0


@kernel
def begin_search(body: Body, hop: np.void) -> None:
    """Go straight for the touchdown of the flight in ``hop``. If that is in doubt, :func:`search` goes on.

    The gap obeys ``gap'' >= -(pull + h omega^2)``, which often proves of a root that it is the first.
    """
    _take_off(body, hop)
    while hop["phase"] == ballistics.FALLING:
        _fall(body, hop)


@kernel
def search(body: Body, most: float, hop: np.void) -> float:
    """Go on with a search in steps that pass no root, up to ``most`` of them; return their number.

    Each goes to the first root of the parabola with the curvature of that bound, so it cannot pass a root, a grazing
    one included, and converges quadratically to a plain one. Once LANDED, ``hop["touchdown"]`` is the first time [s] at
    which the body meets the slope: docs/physics.md (7.1); inf if it does not up to ``hop["horizon"]``.
    """
    steps = 0.0
    while hop["phase"] != ballistics.LANDED and steps < most:
        steps += 1.0
        if hop["phase"] == ballistics.POISED:
            start = _lift(hop)
            hop["touchdown"], hop["margin"] = max(start, 0.0), 0.0
            hop["phase"] = ballistics.LANDED if start < 0.0 else ballistics.SEARCHING
        else:
            _march(body, hop)
    return steps


@kernel
def finish_time(hop: np.void) -> float:
    """First time [s] > 0 at which a flight reaches the end of the slope, inf if never."""
    return _finish(hop)[0] if hop["length"] < math.inf else math.inf


@part
def arrive(body: Body, duration: float, hop: np.void) -> None:
    """Follow a flight for some time [s]: fill in where it then is, and how what is lowest there would touch."""
    hop["duration"] = duration
    _arrive(body, hop)
