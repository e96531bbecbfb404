"""What ends a step of a contact, and when: each event is the first root of a series.

Each event that is found shortens the interval in which the next one is sought.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.compiler import rows
from sledenv.compiler.jit import kernel
from sledenv.compiler.rows import EIGHT, element, repeated
from sledenv.compiler.trace import scalar, write_series
from sledenv.compiler.values import fma
from sledenv.kernel import normal
from sledenv.kernel.geometry import has_corners, sine_and_cosine
from sledenv.kernel.params import Body
from sledenv.kernel.records import ARC, TAIL
from sledenv.kernel.roots import first_root, horner

# What ends a step.
NOTHING, SEPARATION, RATE_ZERO, SLIP_ZERO, SPIN_ZERO = range(5)
RATE_RELEASED, SLIP_RELEASED, SPIN_RELEASED, FEATURE_ENDS, CHORD_DOWN, SLOPE_ENDS, MIDDLE_PASSED = range(5, 12)

TURN_ROUNDING = 1e-13  # [rad] rounding error of an orientation after many turns
SLOPE_ROUNDING = 1e-14  # of the rates of two heights: rounding error of that of their sum
MOMENT_ROUNDING = 1e-12  # of a load times the size: rounding error of moments that balance
MOST_POLISHED = 4  # steps of Newton's method,
POLISHED = 1e-9  # of the step: the one after a step as small as this would be lost in rounding


@kernel
def _both_signs(value: float) -> tuple[float, float]:
    """Both signs, that of ``value`` first: a body and its mirror image then try them in mirrored order."""
    return (-1.0, 1.0) if value < 0.0 else (1.0, -1.0)


def _summing(p: Any, a: Any, q: Any, b: Any, level: Any, found: Any) -> tuple[Any, ...]:
    """Write ``a p + b q + level``, of which ``p`` and ``q`` are series; return its first coefficient."""
    factors = repeated(a, EIGHT), repeated(b, EIGHT)
    row = [fma(factors[0], x, factors[1] * y) for x, y in zip(rows.read(p), rows.read(q), strict=True)]
    first = element(row[0], 0) + level
    write_series(found, rows.with_first(row, first))
    return (first,)


_sum = scalar(_summing)


@kernel
def sum_root(
    p: np.ndarray, a: float, q: np.ndarray, b: float, level: float, vanishing: int, noise: float, step: np.void
) -> float:
    """Time in a step at which ``a p + b q + level``, positive at first, becomes negative; see :func:`first_root`."""
    _sum(p, a, q, b, level, step["scratch"])
    return first_root(step["scratch"], step["length"], vanishing, noise)


@kernel
def series_root(series: np.ndarray, sign: float, vanishing: int, step: np.void) -> float:
    """Time at which ``sign`` times a series, positive at first, becomes negative."""
    return sum_root(series, sign, series, 0.0, 0.0, vanishing, 0.0, step)


@kernel
def _level_root(series: np.ndarray, sign: float, level: float, vanishing: int, noise: float, step: np.void) -> float:
    """Time at which a series passes a level, upwards if ``sign`` is 1, downwards if it is -1."""
    return sum_root(series, -sign, series, 0.0, sign * level, vanishing, noise, step)


@kernel
def _bound_root(force: np.ndarray, sign: float, load: np.ndarray, factor: float, step: np.void) -> float:
    """Time at which ``sign`` times a locked force exceeds ``factor`` times its load."""
    noise = 1e-15 * (abs(factor * load[0]) + abs(force[0]))
    return sum_root(load, factor, force, -sign, 0.0, 0, noise, step)


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
        vanishing = 1 + int(contact["spin_zeros"]) if contact["at_edge"] != 0.0 and abs(phi[0] - edge) <= close else 0
        best = min(best, _level_root(phi, outwards, edge, vanishing, 0.0, step))
    return best


@kernel
def _chord_down(contact: np.void, step: np.void) -> float:
    """Time at which the corner on the other side comes down."""
    other, reach, height = contact["other"], contact["other_sine"], contact["other_cosine"]
    gap, length = step["gap"], step["length"]
    above = step["scratch"]
    _sum(step["sines"], reach, step["cosines"], height, other, above)
    leaves = 0  # leading coefficients that rounding may make negative
    if contact["other_left"] != 0.0:
        slope, rounding = above[1] + gap[1], SLOPE_ROUNDING * (abs(above[1]) + abs(gap[1]))
        if slope > rounding:
            leaves = 1
        elif slope >= -rounding and above[2] + gap[2] > 0.0:
            leaves = 2
    noise = TURN_ROUNDING * (abs(reach) + abs(height))
    at = sum_root(above, 1.0, gap, 1.0, 0.0, leaves, noise, step)
    if 0.0 < at < math.inf:
        # The step is as long as the series of the velocities hold. Those of sine and cosine may be less exact, so the
        # root is improved by Newton's method, as long as the corner is on its way down.
        falling = at
        for _ in range(MOST_POLISHED):
            theta = step["theta"] - contact["phi"] + horner(step["phi"], at)
            sine, cosine = sine_and_cosine(theta)
            turning = reach * cosine - height * sine
            rate = step["unit"] * (horner(step["v_n"], at) + turning * horner(step["omega"], at))
            if not rate < 0.0:
                at = falling
                break
            left = horner(gap, at) + other + reach * sine + height * cosine
            falling, at = at, max(at - left / rate, 0.0)
            if abs(at - falling) <= POLISHED * length:
                break
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
    if contact["gap_rate"] == 0.0:
        force, least, largest = step["normal"], step["least"], step["largest"]
        if largest < math.inf and not step["safe_largest"] > 0.0:
            noise = 1e-15 * (abs(largest) + abs(force[0]))
            if happens(_level_root(force, 1.0, largest, 0, noise, step), RATE_RELEASED, step):
                step["released"] = -1.0
        if not step["safe_least"] > 0.0:
            noise = 1e-15 * (abs(least) + abs(force[0]))
            if happens(_level_root(force, -1.0, least, 0, noise, step), RATE_RELEASED, step):
                step["released"] = 1.0
        return
    if step["event"] != RATE_ZERO and not step["safe_v_n"] > 0.0:
        zeros = int(contact["gap_zeros"])
        happens(series_root(step["v_n"], contact["gap_rate"], zeros, step), RATE_ZERO, step)
    if contact["gap_rate"] > 0.0 and step["event"] != SEPARATION and not step["safe_load"] > 0.0:
        happens(series_root(normal.load_series(contact, step), -1.0, 0, step), SEPARATION, step)


@kernel
def _before_separation(step: np.void) -> float:
    """Time up to which a release counts. At the separation all bounds are zero: one just before it is rounding."""
    return float(step["length"] * (1.0 - 1e-10)) if step["event"] == SEPARATION else math.inf


@kernel
def slip_events(contact: np.void, step: np.void, normal: np.ndarray) -> None:
    """Look for where a locked slip is released, its force being held against a normal force, or a free one stops."""
    if contact["slip"] == 0.0:
        before = _before_separation(step)
        for sign in _both_signs(step["force"][0]):
            if not (step["safe_force"] if sign > 0.0 else step["safe_force_back"]) > 0.0:
                at = _bound_root(step["force"], sign, normal, contact["friction"], step)
                if at < before and happens(at, SLIP_RELEASED, step):
                    step["released"] = -sign
    elif step["event"] != SLIP_ZERO and not step["safe_v_t"] > 0.0:
        zeros = int(contact["slip_zeros"])
        happens(series_root(step["v_t"], contact["slip"], zeros, step), SLIP_ZERO, step)


@kernel
def spin_events(contact: np.void, step: np.void, moment: np.ndarray, load: np.ndarray, arm: float) -> None:
    """Look for where a locked spin is released, its moment held against ``arm`` times a load, or a free one stops."""
    if contact["spin"] == 0.0:
        before = _before_separation(step)
        for sign in _both_signs(moment[0]):
            if not (step["safe_moment"] if sign > 0.0 else step["safe_moment_back"]) > 0.0:
                at = _bound_root(moment, sign, load, arm, step)
                if at < before and happens(at, SPIN_RELEASED, step):
                    step["released"] = -sign
    elif step["event"] != SPIN_ZERO and not step["safe_omega"] > 0.0:
        zeros = int(contact["spin_zeros"])
        happens(series_root(step["omega"], contact["spin"], zeros, step), SPIN_ZERO, step)


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
            happens(series_root(step["phi"], side, 0, step), MIDDLE_PASSED, step)
    elif contact["other"] < math.inf and not step["safe_other"] > 0.0:
        at = _chord_down(contact, step)
        if at < math.inf and on_arc and contact["other_sine"] * horner(step["phi"], at) < 0.0:
            # By then phi has changed its sign, and the further end of the arc is the other one: watch that from the
            # middle on.
            side = 1.0 if contact["other_sine"] > 0.0 else -1.0
            happens(series_root(step["phi"], side, 0, step), MIDDLE_PASSED, step)
        else:
            happens(at, CHORD_DOWN, step)


@kernel
def slope_event(contact: np.void, step: np.void) -> None:
    """Look for the end of the slope."""
    if not contact["length"] - contact["x"] > step["travel"]:
        at = _level_root(step["x"], 1.0, contact["length"], 0, 0.0, step)
        happens(at, SLOPE_ENDS, step)


@kernel
def _passes_flat(contact: np.void, second: np.void, step: np.void, second_step: np.void, slip: float) -> float:
    """Time at which the chord lies flat, while one point sticks and the second slips with this sign relative to it.

    That slip is the difference of the gaps times the spin, too small to be looked for by itself.
    """
    sign = slip * contact["spin"]
    flat = abs(contact["gap"] - second["gap"]) <= normal.NO_DEPTH * contact["size"]
    vanishing = 1 + int(contact["spin_zeros"]) if flat else 0
    return sum_root(step["gap"], sign, second_step["gap"], -sign, 0.0, vanishing, 0.0, step)


@kernel
def _second_events(body: Body, contact: np.void, second: np.void, step: np.void, second_step: np.void) -> None:
    """Let a step of two points end with the first event of the second one."""
    second_step["length"], second_step["event"], second_step["released"] = step["length"], NOTHING, 0.0
    if contact["gap_rate"] != 0.0 or second["gap_rate"] != 0.0:
        gap_events(second, second_step)
    if contact["spin"] != 0.0 and contact["slip"] == 0.0:
        happens(_passes_flat(contact, second, second_step, step, -second["slip"]), SLIP_ZERO, second_step)
    elif contact["spin"] != 0.0:
        slip_events(second, second_step, second_step["normal"])
    corner_events(body, second, second_step)
    if second_step["event"] != NOTHING:
        step["length"], step["event"] = second_step["length"], NOTHING


@kernel
def _rounds(moment: np.ndarray, load: np.ndarray, size: float, length: float) -> bool:
    """Whether a moment is nothing but the rounding errors of two that balance, under a load [N]."""
    rounding = MOMENT_ROUNDING * size * max(abs(load[0]), abs(horner(load, length)))
    return bool(max(abs(moment[0]), abs(horner(moment, length))) <= rounding)


@kernel
def first_event(body: Body, space: np.void) -> None:
    """Let a step that has been completed end with its first event, of one point or two.

    ``step["event"]`` is what is known to happen at its end, NOTHING if nothing is. What
    :func:`sledenv.kernel.step.complete` has proved not to happen is not sought. Overwrites ``length``, ``event`` and
    ``released``, the sign with which a released velocity leaves.
    """
    contact, second, step, second_step = space["contact"], space["second"], space["step"], space["second_step"]
    paired = contact["paired"] != 0.0
    held = paired and contact["spin"] == 0.0  # both points do the same
    settled = paired and contact["gap_rate"] == 0.0 and second["gap_rate"] == 0.0
    load = step["normal"]
    step["released"] = 0.0
    if held:  # locks that both points share are limited by the sum of both normal forces
        load = space["together"]
        _sum(step["normal"], 1.0, second_step["normal"], 1.0, 0.0, load)
        step["safe_moment"] = step["safe_moment_back"] = 0.0
    if not settled:
        gap_events(contact, step)
    if paired and not held and second["slip"] == 0.0:
        happens(_passes_flat(contact, second, step, second_step, -contact["slip"]), SLIP_ZERO, step)
    else:
        slip_events(contact, step, load)
    if not held:
        spin_events(contact, step, step["moment"], load, contact["arm"])
    elif not settled:
        for moment, against in ((space["moment"], space["load"]), (space["second_moment"], space["second_load"])):
            if not _rounds(moment, load, contact["size"], step["length"]):
                spin_events(contact, step, moment, against, 1.0)
    if has_corners(body):
        corner_events(body, contact, step)
    slope_event(contact, step)
    if paired:
        _second_events(body, contact, second, step, second_step)
