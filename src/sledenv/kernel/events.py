"""What ends a step of a contact, and when: each event is the first root of a series.

Each event that is found shortens the interval in which the next one is sought.
"""

from __future__ import annotations

import math

import numpy as np

from sledenv.kernel import normal
from sledenv.kernel.geometry import has_corners
from sledenv.kernel.params import Body
from sledenv.kernel.records import ARC, TAIL
from sledenv.kernel.roots import first_root, horner
from sledenv.programs.jit import kernel
from sledenv.programs.rows import WIDTH

# What ends a step.
NOTHING, SEPARATION, RATE_ZERO, SLIP_ZERO, SPIN_ZERO = range(5)
RATE_RELEASED, SLIP_RELEASED, SPIN_RELEASED, FEATURE_ENDS, CHORD_DOWN, SLOPE_ENDS, MIDDLE_PASSED = range(5, 12)

TURN_ROUNDING = 1e-13  # [rad] rounding error of an orientation after many turns
MOST_POLISHED = 4  # steps of Newton's method


@kernel
def _both_signs(value: float) -> tuple[int, int]:
    """Both signs, that of ``value`` first: the order must not tell a body from its mirror image."""
    return (-1, 1) if value < 0.0 else (1, -1)


@kernel
def series_root(series: np.ndarray, scratch: np.ndarray, sign: float, step: float, vanishing: int) -> float:
    """Time at which ``sign`` times a series, positive at first, becomes negative; see :func:`first_root`."""
    for k in range(WIDTH):
        scratch[k] = sign * series[k]
    return first_root(scratch, step, vanishing, 0.0)


@kernel
def _bound_root(
    load: np.ndarray, force: np.ndarray, scratch: np.ndarray, sign: float, factor: float, step: float
) -> float:
    """Time at which ``sign`` times a locked force exceeds ``factor`` times its load."""
    for k in range(WIDTH):
        scratch[k] = factor * load[k] - sign * force[k]
    noise = 1e-15 * (abs(factor * load[0]) + abs(force[0]))
    return first_root(scratch, step, 0, noise)


@kernel
def level_root(
    series: np.ndarray, scratch: np.ndarray, sign: float, level: float, step: float, vanishing: int, noise: float
) -> float:
    """Time at which a series passes a level, upwards if ``sign`` is 1, downwards if it is -1."""
    for k in range(WIDTH):
        scratch[k] = -sign * series[k]
    scratch[0] += sign * level
    return first_root(scratch, step, vanishing, noise)


@kernel
def _feature_end(body: Body, contact: np.void, step: np.void) -> float:
    """Time at which the contact passes from the arc to a corner or back."""
    phi, length = step["phi"], step["length"]
    best = math.inf
    for side in (1.0, -1.0):
        if contact["feature"] == ARC:
            outwards = side
        elif (contact["feature"] == TAIL) == (side > 0.0):
            outwards = -side
        else:
            continue
        edge = side * body.half_angle
        close = 1e-15 * (body.half_angle + abs(phi[1]) * length)
        vanishing = 1 if contact["at_edge"] != 0.0 and abs(phi[0] - edge) <= close else 0
        best = min(best, level_root(phi, step["scratch"], outwards, edge, length, vanishing, 0.0))
    return best


@kernel
def _chord_down(contact: np.void, step: np.void) -> float:
    """Time at which the corner on the other side comes down."""
    other, reach, height = contact["other"], contact["other_sine"], contact["other_cosine"]
    q, gap, length = step["scratch"], step["gap"], step["length"]
    for k in range(WIDTH):
        q[k] = gap[k] + reach * step["sines"][k] + height * step["cosines"][k]
    q[0] += other
    at = first_root(q, length, 0, TURN_ROUNDING * (abs(reach) + abs(height)))
    if 0.0 < at < math.inf:
        # The step is chosen for the velocities: sine and cosine may converge less.
        for _ in range(MOST_POLISHED):
            theta = step["theta"] - contact["phi"] + horner(step["phi"], at)
            sine, cosine = math.sin(theta), math.cos(theta)
            left = horner(gap, at) + other + reach * sine + height * cosine
            turning = reach * cosine - height * sine
            rate = step["unit"] * (horner(step["v_n"], at) + turning * horner(step["omega"], at))
            if not rate < 0.0:
                break
            at = max(at - left / rate, 0.0)
    return at if at <= length else math.inf


@kernel
def happens(at: float, event: int, step: np.void) -> bool:
    """Let the step end with an event, if there is one; say whether."""
    if not at < math.inf:
        return False
    step["length"], step["event"], step["released"] = at, event, 0.0
    return True


@kernel
def gap_events(contact: np.void, step: np.void) -> None:
    """Look for the end of a locked gap, for the deepest place, and for the separation."""
    scratch = step["scratch"]
    if contact["gap_rate"] == 0.0:
        force, least, largest = step["normal"], step["least"], step["largest"]
        if largest < math.inf and not step["safe_largest"] > 0.0:
            noise = 1e-15 * (abs(largest) + abs(force[0]))
            if happens(level_root(force, scratch, 1.0, largest, step["length"], 0, noise), RATE_RELEASED, step):
                step["released"] = -1.0
        if not step["safe_least"] > 0.0:
            noise = 1e-15 * (abs(least) + abs(force[0]))
            if happens(level_root(force, scratch, -1.0, least, step["length"], 0, noise), RATE_RELEASED, step):
                step["released"] = 1.0
        return
    if step["event"] != RATE_ZERO and not step["safe_v_n"] > 0.0:
        zeros = int(contact["gap_zeros"])
        happens(series_root(step["v_n"], scratch, contact["gap_rate"], step["length"], zeros), RATE_ZERO, step)
    if contact["gap_rate"] > 0.0 and step["event"] != SEPARATION and not step["safe_load"] > 0.0:
        happens(series_root(normal.load_series(contact, step), scratch, -1.0, step["length"], 0), SEPARATION, step)


@kernel
def _before_separation(step: np.void) -> float:
    """Time before which a locked force must reach its bound: by then all bounds vanish, and rounding must not count."""
    return float(step["length"] * (1.0 - 1e-10)) if step["event"] == SEPARATION else math.inf


@kernel
def slip_events(contact: np.void, step: np.void, normal: np.ndarray) -> None:
    """Look for where a locked slip is released, its force being held against a normal force, or a free one stops."""
    if contact["slip"] == 0.0:
        before = _before_separation(step)
        for sign in _both_signs(step["force"][0]):
            if not (step["safe_force"] if sign > 0 else step["safe_force_back"]) > 0.0:
                at = _bound_root(normal, step["force"], step["scratch"], sign, contact["friction"], step["length"])
                if at < before and happens(at, SLIP_RELEASED, step):
                    step["released"] = -sign
    elif step["event"] != SLIP_ZERO and not step["safe_v_t"] > 0.0:
        zeros = int(contact["slip_zeros"])
        happens(series_root(step["v_t"], step["scratch"], contact["slip"], step["length"], zeros), SLIP_ZERO, step)


@kernel
def spin_events(contact: np.void, step: np.void, moment: np.ndarray, load: np.ndarray, arm: float) -> None:
    """Look for where a locked spin is released, its moment held against ``arm`` times a load, or a free one stops."""
    if contact["spin"] == 0.0:
        before = _before_separation(step)
        for sign in _both_signs(moment[0]):
            if not (step["safe_moment"] if sign > 0 else step["safe_moment_back"]) > 0.0:
                at = _bound_root(load, moment, step["scratch"], sign, arm, step["length"])
                if at < before and happens(at, SPIN_RELEASED, step):
                    step["released"] = -sign
    elif step["event"] != SPIN_ZERO and not step["safe_omega"] > 0.0:
        zeros = int(contact["spin_zeros"])
        happens(series_root(step["omega"], step["scratch"], contact["spin"], step["length"], zeros), SPIN_ZERO, step)


@kernel
def corner_events(body: Body, contact: np.void, step: np.void) -> None:
    """Look for where another feature takes over, and for where a second one comes down."""
    on_arc = contact["feature"] == ARC
    inside = body.half_angle - abs(contact["phi"])
    if contact["at_edge"] != 0.0 or not (inside if on_arc else -inside) > step["turn"]:
        happens(_feature_end(body, contact, step), FEATURE_ENDS, step)
    if contact["paired"] != 0.0:
        if on_arc and not abs(contact["phi"]) > step["turn"]:
            side = -1.0 if contact["phi"] < 0.0 else 1.0
            happens(series_root(step["phi"], step["scratch"], side, step["length"], 0), MIDDLE_PASSED, step)
    elif contact["other"] < math.inf and not step["safe_other"] > 0.0:
        at = _chord_down(contact, step)
        if at < math.inf and on_arc and contact["other_sine"] * horner(step["phi"], at) < 0.0:
            # By then the other end of the arc is further away: that one is heeded from the middle on.
            side = 1.0 if contact["other_sine"] > 0.0 else -1.0
            happens(series_root(step["phi"], step["scratch"], side, step["length"], 0), MIDDLE_PASSED, step)
        else:
            happens(at, CHORD_DOWN, step)


@kernel
def slope_event(contact: np.void, step: np.void) -> None:
    """Look for the end of the slope."""
    if not contact["length"] - contact["x"] > step["travel"]:
        at = level_root(step["x"], step["scratch"], 1.0, contact["length"], step["length"], 0, 0.0)
        happens(at, SLOPE_ENDS, step)


@kernel
def first_event(body: Body, contact: np.void, step: np.void) -> None:
    """Let a step that has been completed end with its first event.

    ``step["event"]`` is what is known to happen at its end, NOTHING if nothing is. What
    :func:`sledenv.kernel.step.complete` has proved not to happen is not sought. Overwrites ``length``, ``event`` and
    ``released``, the sign with which a released velocity leaves.
    """
    step["released"] = 0.0
    gap_events(contact, step)
    slip_events(contact, step, step["normal"])
    spin_events(contact, step, step["moment"], step["normal"], contact["arm"])
    if has_corners(body):
        corner_events(body, contact, step)
    slope_event(contact, step)
