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
from sledenv.kernel.outline import sine_and_cosine
from sledenv.kernel.roots import first_root, horner

# What ends a step.
NOTHING, SEPARATION, RATE_ZERO, SLIP_ZERO, SPIN_ZERO = range(5)
RATE_RELEASED, SLIP_RELEASED, SPIN_RELEASED, ARC_ENDS, OTHER_DOWN, SLOPE_ENDS, MIDDLE_PASSED, PIECE_ENDS = range(5, 13)

TURN_ROUNDING = 1e-13  # [rad] rounding error of an orientation after many turns
SLOPE_ROUNDING = 1e-14  # of the rates of two heights: rounding error of that of their sum
PLACE_ROUNDING = 1e-14  # of the lengths that make up the place of a contact point: rounding error of that
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
def _arc_end(contact: np.void, point: np.void, step: np.void) -> float:
    """Time at which the contact passes on to the arc at an end of the interval."""
    phi, length = step["phi"], step["length"]
    best = math.inf
    for outwards in (1.0, -1.0):
        edge = point["high"] if outwards > 0.0 else point["low"]
        if not abs(edge) < math.inf:
            continue
        close = 1e-15 * (abs(edge) + abs(phi[1]) * length)
        vanishing = 1 + int(contact["spin_zeros"]) if point["at_edge"] != 0.0 and abs(phi[0] - edge) <= close else 0
        best = min(best, _level_root(phi, outwards, edge, vanishing, 0.0, step))
    return best


@kernel
def _other_down(contact: np.void, point: np.void, step: np.void) -> float:
    """Time at which another arc comes down beside the one that touches."""
    other, reach, height = point["other"], point["other_sine"], point["other_cosine"]
    gap, length = step["gap"], step["length"]
    above = step["scratch"]
    _sum(step["sines"], reach, step["cosines"], height, other, above)
    leaves = 0  # leading coefficients that rounding may make negative
    if point["other_left"] != 0.0:
        slope, rounding = above[1] + gap[1], SLOPE_ROUNDING * (abs(above[1]) + abs(gap[1]))
        if slope > rounding:
            leaves = 1
        elif slope >= -rounding and above[2] + gap[2] > 0.0:
            leaves = 2
    noise = TURN_ROUNDING * (abs(reach) + abs(height))
    at = sum_root(above, 1.0, gap, 1.0, 0.0, leaves, noise, step)
    if 0.0 < at < math.inf:
        # The step is as long as the series of the velocities hold. Those of sine and cosine may be less exact, so the
        # root is improved by Newton's method, as long as that arc is on its way down.
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
def _gap_events(contact: np.void, point: np.void, step: np.void) -> None:
    """Look for the end of a locked gap, for the deepest place, and for the separation."""
    if point["gap_rate"] == 0.0:
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
        zeros = int(point["gap_zeros"])
        happens(series_root(step["v_n"], point["gap_rate"], zeros, step), RATE_ZERO, step)
    if point["gap_rate"] > 0.0 and step["event"] != SEPARATION and not step["safe_load"] > 0.0:
        happens(series_root(normal.load_series(contact, step), -1.0, 0, step), SEPARATION, step)


@kernel
def _before_separation(step: np.void) -> float:
    """Time up to which a release counts. At the separation all bounds are zero: one just before it is rounding."""
    return float(step["length"] * (1.0 - 1e-10)) if step["event"] == SEPARATION else math.inf


@kernel
def _slip_events(point: np.void, step: np.void, normal: np.ndarray, friction: float) -> None:
    """Look for where a locked slip is released, its force held against ``friction`` times a load, or one stops."""
    if point["slip"] == 0.0:
        before = _before_separation(step)
        for sign in _both_signs(step["force"][0]):
            if not (step["safe_force"] if sign > 0.0 else step["safe_force_back"]) > 0.0:
                at = _bound_root(step["force"], sign, normal, friction, step)
                if at < before and happens(at, SLIP_RELEASED, step):
                    step["released"] = -sign
    elif step["event"] != SLIP_ZERO and not step["safe_v_t"] > 0.0:
        zeros = int(point["slip_zeros"])
        happens(series_root(step["v_t"], point["slip"], zeros, step), SLIP_ZERO, step)


@kernel
def _spin_events(contact: np.void, step: np.void, moment: np.ndarray, load: np.ndarray, arm: float) -> None:
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
def _outline_events(contact: np.void, point: np.void, step: np.void) -> None:
    """Look for where another arc takes over, and for where a second one comes down beside this one."""
    phi, middle = contact["phi"], point["middle"]
    if point["at_edge"] != 0.0 or not min(point["high"] - phi, phi - point["low"]) > step["turn"]:
        happens(_arc_end(contact, point, step), ARC_ENDS, step)
    watches = point["other"] < math.inf and not step["safe_other"] > 0.0
    if not abs(middle) < math.inf:
        if watches:
            happens(_other_down(contact, point, step), OTHER_DOWN, step)
        return
    # From the middle on another arc is the one to watch. Of two points a third one then comes down.
    inwards = 1.0 if point["rising"] == 0.0 else -1.0
    if (point["direct"] != 0.0 or contact["count"] > 1.0) and not abs(phi - middle) > step["turn"]:
        happens(_level_root(step["phi"], inwards, middle, 0, 0.0, step), MIDDLE_PASSED, step)
    if watches:
        at = _other_down(contact, point, step)
        if at < math.inf and inwards * (horner(step["phi"], at) - middle) > 0.0:
            happens(_level_root(step["phi"], inwards, middle, 0, 0.0, step), MIDDLE_PASSED, step)
        else:
            happens(at, OTHER_DOWN, step)


@kernel
def _slope_event(contact: np.void, length: float, step: np.void) -> None:
    """Look for the end of a slope of some length [m]."""
    if not length - contact["x"] > step["travel"]:
        happens(_level_root(step["x"], 1.0, length, 0, 0.0, step), SLOPE_ENDS, step)


@kernel
def _place_zeros(contact: np.void, point: np.void) -> int:
    """Leading coefficients that are zero by construction of the rate of the place of a point, v_t - r omega."""
    slides, rolls = point["slip"] != 0.0, point["r"] != 0.0 and contact["spin"] != 0.0
    if slides and rolls:
        return int(min(point["slip_zeros"], contact["spin_zeros"]))
    return int(contact["spin_zeros"] if rolls else point["slip_zeros"])


@kernel
def _piece_events(contact: np.void, point: np.void, step: np.void, ground: np.void) -> None:
    """Look for where a point passes on to the next piece of the ground, or to the one before.

    A corner that sticks stays where it is; its place along the slope changes by rounding alone.
    """
    if point["r"] == 0.0 and point["slip"] == 0.0:
        return
    piece, h, x = int(point["piece"]), point["h"], contact["x"]
    place, within = x - h * step["sine"], step["travel"] + abs(h) * step["turn"]
    for sign in _both_signs(contact["phi"]):
        edge = ground["begin"][piece + 1 if sign > 0.0 else piece]
        ahead = sign * (edge - place)
        if ahead > within:
            continue
        passed = abs(ahead) <= PLACE_ROUNDING * (abs(edge) + abs(x) + abs(h))
        vanishing = 1 + _place_zeros(contact, point) if passed else 0
        at = sum_root(step["x"], -sign, step["sines"], sign * h, sign * edge, vanishing, 0.0, step)
        if happens(at, PIECE_ENDS, step):
            step["released"] = sign


@kernel
def _passes_flat(contact: np.void, points: np.ndarray, steps: np.ndarray, i: int) -> float:
    """Time at which a straight side lies flat, while point ``i`` slips relative to the other one, which sticks.

    That slip is the difference of the gaps times the spin, too small to be looked for by itself.
    """
    point, step = points[i], steps[i]
    sign = -point["slip"] * contact["spin"]
    flat = abs(point["gap"] - points[1 - i]["gap"]) <= normal.NO_DEPTH * contact["size"]
    vanishing = 1 + int(contact["spin_zeros"]) if flat else 0
    return sum_root(step["gap"], sign, steps[1 - i]["gap"], -sign, 0.0, vanishing, 0.0, step)


@kernel
def _rounds(moment: np.ndarray, load: np.ndarray, size: float, length: float) -> bool:
    """Whether a moment is nothing but the rounding errors of two that balance, under a load [N]."""
    rounding = MOMENT_ROUNDING * size * max(abs(load[0]), abs(horner(load, length)))
    return bool(max(abs(moment[0]), abs(horner(moment, length))) <= rounding)


@kernel
def _held_events(contact: np.void, settled: bool, space: np.void) -> None:
    """Look for what ends the locks that two points share: they are limited by both normal forces."""
    step, point, load = space["steps"][0], space["points"][0], space["together"]
    normals = step["normal"], space["steps"][1]["normal"]
    step["safe_moment"] = step["safe_moment_back"] = 0.0
    if not settled:
        _gap_events(contact, point, step)
    _sum(normals[0], point["friction"], normals[1], space["points"][1]["friction"], 0.0, load)
    _slip_events(point, step, load, 1.0)
    if not settled:
        _sum(normals[0], 1.0, normals[1], 1.0, 0.0, load)
        for i in range(2):
            if not _rounds(space["moments"][i], load, contact["size"], step["length"]):
                _spin_events(contact, step, space["moments"][i], space["loads"][i], 1.0)


@kernel
def first_event(length: float, space: np.void) -> None:
    """Let a step that has been completed end with its first event, of one point or two.

    ``event`` of the first step is what is known to happen at its end, NOTHING if nothing is. What
    :func:`sledenv.kernel.step.complete` has proved not to happen is not sought. Overwrites ``length``, ``event`` and
    ``released``, the sign with which a released velocity leaves, of each step. ``length`` [m] is that of the slope.
    """
    contact, points, steps = space["contact"], space["points"], space["steps"]
    paired = contact["count"] > 1.0
    held = paired and contact["spin"] == 0.0  # both points do the same
    settled = paired and points[0]["gap_rate"] == 0.0 and points[1]["gap_rate"] == 0.0
    steps[0]["released"] = 0.0
    for i in range(int(contact["count"])):
        point, step = points[i], steps[i]
        if i > 0:
            step["length"], step["event"], step["released"] = steps[0]["length"], NOTHING, 0.0
        if held and i == 0:
            _held_events(contact, settled, space)
        elif not settled:
            _gap_events(contact, point, step)
        if not held:
            if paired and points[1 - i]["slip"] == 0.0:
                happens(_passes_flat(contact, points, steps, i), SLIP_ZERO, step)
            else:
                _slip_events(point, step, step["normal"], point["friction"])
            if i == 0:
                _spin_events(contact, step, step["moment"], step["normal"], point["arm"])
        _outline_events(contact, point, step)
        if space["ground"]["count"] > 1.0:
            _piece_events(contact, point, step, space["ground"])
        if i == 0:
            _slope_event(contact, length, step)
        elif step["event"] != NOTHING:
            steps[0]["length"], steps[0]["event"] = step["length"], NOTHING
