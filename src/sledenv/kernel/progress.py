"""How a contact goes on from step to step, point by point."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import straight
from sledenv.compiler.values import equal, less, root, where
from sledenv.kernel import events, normal, records
from sledenv.kernel.friction import Branch, sign_of
from sledenv.kernel.ground import arm_on
from sledenv.kernel.outline import apart, arms, beside, partner, same_arc, whole_turns, within
from sledenv.kernel.params import Incline, Limits
from sledenv.kernel.series import longest_step
from sledenv.kernel.step import advance, go_on

MOST_UNITS = 2.0  # [units] longest step
UNIT_ANGLE = 1.5  # [rad] of the contact oscillation in a unit of time
MOST_STALLED = 60  # events in a row without any progress in time
TRIALS = 27  # last of these, in which branches are tried in turn
NEARLY = (
    1e-6  # of the size: with another end as close to the slope as this, springs however stiff would touch with both
)
DEEP = 1e-9  # of the size: an arc that touches beside another one is deeper only if its start has been missed
STRETCHED = 1.08  # a step may be longer by this factor to end with an event; its last terms are four times larger then


@kernel
def _leading_zeros(velocity: np.ndarray, sign: float) -> int:
    """Number of leading coefficients to be passed over in a search for where a released velocity returns to zero.

    It starts without acceleration, but for the error of the time of release. Two coefficients are passed over if what
    is left opposes ``sign``, else one. It stays in the series: it makes up for a release that came a little early.
    """
    return 1 if sign * velocity[1] > 0.0 else 2


@kernel
def speed_scale(slope: Incline, size: float, v_n: float, v_t: float, omega: float) -> float:
    """Scale [m/s] of the velocities of a contact."""
    fastest = max(abs(v_n), abs(v_t), size * abs(omega))
    return max(fastest, math.sqrt(slope.gravity * size), 1e-12)


@kernel
def forget_zeros(contact: np.void, points: np.ndarray) -> None:
    """Let no velocity be zero by construction, nor just released."""
    contact["spin_zeros"] = contact["spin_left"] = 0.0
    for i in range(int(contact["count"])):
        point = points[i]
        point["gap_zeros"] = point["slip_zeros"] = point["gap_left"] = point["slip_left"] = 0.0


@kernel
def forget_branch(contact: np.void, points: np.ndarray) -> None:
    """Put the branch of a contact at its beginning, before any has been chosen."""
    contact["spin"] = contact["stalled"] = 0.0
    for i in range(int(contact["count"])):
        points[i]["gap_rate"] = points[i]["slip"] = 0.0
    forget_zeros(contact, points)


@kernel
def trial(contact: np.void) -> int:
    """Number of the trial, 1 to TRIALS, of a contact in which no time passes; 0 if it is in none."""
    if contact["rigid"] != 0.0:
        return 0
    return max(int(contact["stalled"]) - (MOST_STALLED - TRIALS), 0)


@kernel
def side(contact: np.void) -> int:
    """Side to which a contact lies, 1 or -1: what is tried in turn is tried in the mirror image's turn there."""
    return -1 if contact["phi"] < 0.0 else 1


@kernel
def _sign_of(velocity: float, left: float) -> int:
    """Sign of a velocity for the box rule: 2 or -2 where it is zero but has just been released."""
    return sign_of(velocity) if left == 0.0 else 2 * int(left)


@kernel
def signs(contact: np.void, point: np.void) -> Branch:
    """Signs of the velocities of a point, for the box rule."""
    return Branch(
        _sign_of(point["v_n"], point["gap_left"]),
        _sign_of(point["v_t"], point["slip_left"]),
        _sign_of(contact["omega"], contact["spin_left"]),
    )


def _taking(contact: Any, point: Any, branch: Branch) -> None:
    """Program of :func:`take_branch`."""
    velocities = ((point, "v_n", "gap_rate", "gap"), (point, "v_t", "slip", "slip"), (contact, "omega", "spin", "spin"))
    jumps = sum(
        where(equal(getattr(of, sign), to), 0.0, 1.0) for (of, _, sign, _), to in zip(velocities, branch, strict=True)
    )
    # A released velocity starts without acceleration, so with two zeros, unless another force jumps too. Of two points
    # there may be two in any case; bound_step looks.
    both = less(1.0, contact.count)
    leaving, starting = where(equal(jumps, 1.0) | both, 2.0, 1.0), where(both, 2.0, 1.0)
    for (of, velocity, sign, name), to in zip(velocities, branch, strict=True):
        zeros = where(equal(getattr(of, f"{name}_left"), 0.0), starting, leaving)
        setattr(of, f"{name}_zeros", where(equal(getattr(of, velocity), 0.0), zeros, 0.0))
        setattr(of, sign, to)
    point.stiffness = normal.stiffness(contact, less(branch.gap_rate, 0.0))
    pace = UNIT_ANGLE / root(point.stiffness * point.yielding)
    point.pace = where(less(0.0, point.stiffness), pace, point.pace)


_take = straight(_taking)


@kernel
def take_branch(branch: Branch, contact: np.void, point: np.void) -> None:
    """Write a branch: signs of the velocities and their leading zeros, friction, stiffness and unit of time."""
    _take(contact, point, branch)


@kernel
def bound_step(limits: Limits, most: float, contact: np.void, point: np.void, step: np.void) -> int:
    """Find how long the series of a step hold, up to ``most``, once the leading zeros of the velocities are settled.

    Returns RUNNING, TIMEOUT if the time ends with the step, or NON_FINITE.
    """
    if point["gap_zeros"] == 2.0:
        point["gap_zeros"] = _leading_zeros(step["v_n"], point["gap_rate"])
    if point["slip_zeros"] == 2.0:
        point["slip_zeros"] = _leading_zeros(step["v_t"], point["slip"])
    if contact["spin_zeros"] == 2.0:
        contact["spin_zeros"] = _leading_zeros(step["omega"], contact["spin"])
    v_n, v_t, omega = step["v_n"], step["v_t"], step["omega"]
    length = longest_step(contact["size"], contact["scale"], limits.tolerance, most, v_n, v_t, omega)
    left = max(limits.max_time - contact["time"], 0.0) / step["unit"]
    if not math.isfinite(min(length, left)):
        return records.NON_FINITE
    step["length"] = min(length, left)
    step["most"] = STRETCHED * length if STRETCHED * length < left else step["length"]
    return records.TIMEOUT if length >= left else records.RUNNING


@kernel
def _stop_or_release(contact: np.void, point: np.void, step: np.void) -> None:
    """Let slip or spin be zero at the end of a step, if that is what happens there, and free if it is released."""
    event = int(step["event"])
    if event in (events.SLIP_ZERO, events.SLIP_RELEASED):
        point["v_t"], point["slip_left"] = 0.0, step["released"]
    elif event in (events.SPIN_ZERO, events.SPIN_RELEASED):
        contact["omega"], contact["spin_left"] = 0.0, step["released"]


@kernel
def rises(body: np.void, arc: int, phi: float) -> bool:
    """Whether of the arcs that may touch beside one, the one on the rising side is to be watched."""
    middle = body["middle"][arc]
    return bool(phi > middle or (phi == middle and math.copysign(1.0, phi) > 0.0))


@kernel
def _watch(body: np.void, contact: np.void, point: np.void) -> None:
    """Write the gap of the arc that may touch beside the one that touches: of two points, on the far side of each."""
    arc, alone, rising = int(point["arc"]), contact["count"] == 1.0, point["rising"] != 0.0
    other = partner(body, arc, rising == alone)
    point["other"], point["other_sine"], point["other_cosine"] = math.inf, 0.0, 0.0
    third = not alone and point["direct"] != 0.0 and not same_arc(body, other, partner(body, arc, rising))
    if other >= 0 and (alone or third):
        point["other"], point["other_sine"], point["other_cosine"] = beside(body, arc, other)


@kernel
def watch_third(body: np.void, rising: float, contact: np.void, point: np.void) -> None:
    """Let one of two points, the other of which lies on its rising side or not, watch its far side."""
    point["rising"] = rising
    _watch(body, contact, point)


@kernel
def watch_nearer(body: np.void, contact: np.void, point: np.void) -> None:
    """Let a contact that has passed the middle of its arc watch the other side, or the further one: see ``direct``."""
    beyond = contact["phi"] - point["middle"]
    if (beyond < 0.0) if point["rising"] != 0.0 else (beyond > 0.0):
        point["rising"] = 1.0 - point["rising"]
        _watch(body, contact, point)


@kernel
def write_piece(body: np.void, ground: np.void, point: np.void) -> None:
    """Write what the piece of the ground says on which a point touches."""
    piece = int(point["piece"])
    point["friction"], point["arm"] = ground["friction"][piece], arm_on(body, int(point["arc"]), ground, piece)


@kernel
def write_arc(body: np.void, ground: np.void, turn: float, contact: np.void, point: np.void) -> None:
    """Write what does not change until another arc touches, on the piece of the ground where the point is.

    ``turn`` [rad] is what the orientation of the contact exceeds the interval of the arc by: 0, or a whole turn.
    """
    arc = int(point["arc"])
    point["turn"] = turn
    point["h"], point["r"], point["shift"] = body["h"][arc], body["r"][arc], body["shift"][arc]
    write_piece(body, ground, point)
    ends, begins = body["side"][arc] > 0.0, body["side"][int(body["previous"][arc])] > 0.0
    point["low"] = -math.inf if begins else body["low"][arc] + turn
    point["high"] = math.inf if ends else body["high"][arc] + turn
    point["middle"], point["direct"] = body["middle"][arc] + turn, body["direct"][arc]
    point["rising"] = 1.0 if rises(body, arc, contact["phi"] - turn) else 0.0
    _watch(body, contact, point)
    # A spring that turns the body moves less than its mass.
    reach = body["reach"][arc]
    point["yielding"] = contact["per_mass"] * (1.0 + contact["ratio"] * reach * reach)


@kernel
def settled_unit(size: float, gravity: float, omega: float) -> float:
    """Unit of time [s] of a step with a locked gap, in which nothing oscillates."""
    rate = max(abs(omega), math.sqrt(gravity / size))
    return 0.5 / rate if rate > 0.0 else 1.0


@kernel
def move_on(contact: np.void, points: np.ndarray, steps: np.ndarray) -> bool:
    """Go to the end of a step; return whether a velocity has passed zero there by rounding, and is zero now.

    Of two events at the same time the later one must not leave its velocity with the wrong sign.
    """
    before, count, passed = contact["time"], int(contact["count"]), False
    for i in range(count):
        advance(contact, points[i], steps[i])
        points[i]["at_edge"] = points[i]["other_left"] = 0.0
    go_on(contact, steps[0])
    contact["stalled"] = 0.0 if contact["time"] > before else contact["stalled"] + 1.0
    if not steps[0]["length"] * steps[0]["unit"] > 0.0:
        return False
    forget_zeros(contact, points)
    for i in range(count):
        point = points[i]
        if point["gap_rate"] * point["v_n"] < 0.0:
            point["v_n"], passed = 0.0, True
        if point["slip"] * point["v_t"] < 0.0:
            point["v_t"], passed = 0.0, True
    if contact["spin"] * contact["omega"] < 0.0:
        contact["omega"], passed = 0.0, True
    return passed


@kernel
def _pass_on(body: np.void, ground: np.void, contact: np.void, point: np.void) -> int:
    """Pass on to the arc at the end of the interval; RUNNING, or BURIED if another one that may touch is deep there."""
    arc, low, high = int(point["arc"]), point["low"], point["high"]
    upwards = not contact["phi"] - low < high - contact["phi"]
    after = int(body["next"][arc] if upwards else body["previous"][arc])
    edge, start = (high, body["low"][after]) if upwards else (low, body["high"][after])
    contact["phi"] = edge
    point["arc"], point["at_edge"] = after, 1.0
    rising = point["rising"]
    write_arc(body, ground, edge - start, contact, point)
    if contact["count"] > 1.0:
        watch_third(body, rising, contact, point)
        return records.RUNNING
    other = partner(body, after, point["rising"] != 0.0)
    deep = point["other"] < math.inf and point["gap"] + apart(body, after, other, start) < -DEEP * contact["size"]
    return records.BURIED if deep else records.RUNNING


@kernel
def follow_event(body: np.void, length: float, i: int, space: np.void) -> int:
    """Apply what happens to point ``i`` at the end of a step; return the status of the contact, RUNNING if it goes on.

    ``length`` [m] is that of the slope.
    """
    contact, point, step = space["contact"], space["points"][i], space["steps"][i]
    event = int(step["event"])
    if event == events.NOTHING:
        moved = contact["x"] + contact["phi"] + point["gap"] + point["v_n"] + point["v_t"] + contact["omega"]
        return records.RUNNING if math.isfinite(moved) else records.NON_FINITE
    if event == events.SLOPE_ENDS:
        contact["x"] = length
        return records.FINISH
    if event == events.SEPARATION or (event == events.RATE_RELEASED and contact["rigid"] != 0.0):
        return records.SEPARATED
    if event == events.OTHER_DOWN:
        return records.TWO_POINTS if contact["count"] == 1.0 else records.BURIED
    if event == events.ARC_ENDS:
        return _pass_on(body, space["ground"], contact, point)
    if event == events.PIECE_ENDS:
        point["piece"] += step["released"]
        write_piece(body, space["ground"], point)
    elif event == events.RATE_ZERO:
        point["v_n"], point["gap_left"] = 0.0, 0.0
    elif event == events.RATE_RELEASED:
        point["gap_left"] = step["released"]
    elif event == events.MIDDLE_PASSED:
        if contact["count"] > 1.0:
            return records.BURIED
        point["rising"] = 1.0 - point["rising"]
        contact["phi"] = point["middle"]
        _watch(body, contact, point)
    else:
        _stop_or_release(contact, point, step)
    return records.RUNNING


@kernel
def passes_line(limits: Limits, t: float, u: float, flight: np.void, space: np.void) -> bool:
    """Whether a body goes on that has come to where its descent ends, at a time [s] and a speed [m/s] down the slope.

    It does so at the line, if there is a run-out behind it.
    """
    if flight["t_line"] < math.inf:
        return False
    flight["t_line"], flight["u_line"] = t, u
    space["finish"] += limits.run_out
    return limits.run_out > 0.0


@kernel
def touches(body: np.void, part: float, contact: np.void, points: np.ndarray) -> bool:
    """Whether a contact is one of a part of the body, whose code is given; 0 is none.

    That is so where a point belongs to it, or the straight side that has touched with both its ends; and where rigid
    surfaces have hit flat, so that both may have left, where the other end does.
    """
    if part == 0.0:
        return False
    for i in range(int(contact["count"])):
        if body["part"][int(points[i]["arc"])] == part:
            return True
    if contact["side_touched"] == 0.0 or contact["rigid"] == 0.0:
        return bool(contact["side_touched"] == part)
    other, gap, _ = beside_now(body, int(points[0]["arc"]), contact["phi"])
    return bool(contact["side_touched"] == part or (abs(gap) <= NEARLY * body["size"] and body["part"][other] == part))


@kernel
def arms_now(body: np.void, arc: int, contact: np.void) -> tuple[float, float]:
    """Arms [m] of an arc at the orientation of a contact."""
    return arms(body, arc, contact["phi"] - whole_turns(contact["phi"]))


@kernel
def change_point(body: np.void, arc: int, contact: np.void, point: np.void) -> None:
    """Turn a point into the lowest one of another arc, which is given."""
    omega = contact["omega"]
    a, b = arms_now(body, int(point["arc"]), contact)
    u, v = point["v_t"] - b * omega, point["v_n"] + a * omega
    a, b = arms_now(body, arc, contact)
    point["v_t"], point["v_n"], point["arc"] = u + b * omega, v - a * omega, arc


@kernel
def beside_now(body: np.void, arc: int, phi: float) -> tuple[int, float, bool]:
    """Arc that may touch beside another one, its gap [m] less that of the other, and its side; -1: none may.

    The side is True where the arc comes down as the orientation rises.
    """
    phi -= whole_turns(phi)
    phi -= within(body, arc, phi)
    rising = rises(body, arc, phi)
    other = partner(body, arc, rising)
    return other, apart(body, arc, other, phi) if other >= 0 else math.inf, rising


@kernel
def begin_with_approaching(body: np.void, contact: np.void, point: np.void, touchdown: np.void) -> None:
    """Let a straight side that lands flat begin with its other end, if the one chosen moves away.

    A touch that moves away by rounding alone has no other end at the surface, and stays as it is.
    """
    if point["v_n"] > 0.0:
        other, gap, _ = beside_now(body, int(point["arc"]), contact["phi"])
        if other >= 0 and abs(gap) <= normal.NO_DEPTH * body["size"]:
            change_point(body, other, contact, point)
            touchdown["arc"], touchdown["v_t"] = point["arc"], point["v_t"]
            touchdown["a"], touchdown["b"] = arms_now(body, other, contact)
