"""How a contact goes on from step to step: what every point that touches has in common."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import straight
from sledenv.compiler.values import equal, less, root, where
from sledenv.kernel import events, normal, records
from sledenv.kernel.friction import Branch, sign_of
from sledenv.kernel.geometry import arms, feature_geometry, other_corner, whole_turns
from sledenv.kernel.params import Body, Incline, Limits
from sledenv.kernel.series import longest_step
from sledenv.kernel.step import advance

MOST_UNITS = 2.0  # [units] longest step
UNIT_ANGLE = 1.5  # [rad] of the contact oscillation in a unit of time
MOST_STALLED = 60  # events in a row without any progress in time
TRIALS = 27  # last of these, in which branches are tried in turn
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
def forget_zeros(contact: np.void) -> None:
    """Let no velocity be zero by construction, nor just released."""
    contact["gap_zeros"] = contact["slip_zeros"] = contact["spin_zeros"] = 0.0
    contact["gap_left"] = contact["slip_left"] = contact["spin_left"] = 0.0


@kernel
def forget_branch(contact: np.void) -> None:
    """Put the branch of a contact at its beginning, before any has been chosen."""
    contact["gap_rate"] = contact["slip"] = contact["spin"] = contact["stalled"] = 0.0
    forget_zeros(contact)


@kernel
def trial(contact: np.void) -> int:
    """Number of the trial, 1 to TRIALS, of a contact in which no time passes; 0 if it is in none."""
    if contact["k_closing"] == math.inf:
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
def signs(contact: np.void) -> Branch:
    """Signs of the velocities of a contact, for the box rule."""
    return Branch(
        _sign_of(contact["v_n"], contact["gap_left"]),
        _sign_of(contact["v_t"], contact["slip_left"]),
        _sign_of(contact["omega"], contact["spin_left"]),
    )


_VELOCITIES = (("v_n", "gap_rate", "gap"), ("v_t", "slip", "slip"), ("omega", "spin", "spin"))


def _taking(contact: Any, branch: Branch) -> None:
    """Program of :func:`take_branch`."""
    jumps = sum(
        where(equal(getattr(contact, sign), to), 0.0, 1.0) for (_, sign, _), to in zip(_VELOCITIES, branch, strict=True)
    )
    # A released velocity starts without acceleration, so with two zeros, unless another force jumps too. Of two points
    # there may be two in any case; bound_step looks.
    both = less(0.0, contact.paired)
    leaving, starting = where(equal(jumps, 1.0) | both, 2.0, 1.0), where(both, 2.0, 1.0)
    for (velocity, sign, name), to in zip(_VELOCITIES, branch, strict=True):
        zeros = where(equal(getattr(contact, f"{name}_left"), 0.0), starting, leaving)
        setattr(contact, f"{name}_zeros", where(equal(getattr(contact, velocity), 0.0), zeros, 0.0))
        setattr(contact, sign, to)
    contact.mu, contact.rho = -branch.slip * contact.friction, -branch.spin * contact.arm
    closing = less(branch.gap_rate, 0.0)
    contact.stiffness = normal.stiffness(contact, closing)
    pace = where(closing, contact.pace_closing, contact.pace_opening)
    contact.pace = where(less(0.0, contact.stiffness), pace, contact.pace)


_take = straight(_taking)


@kernel
def take_branch(branch: Branch, contact: np.void) -> None:
    """Write a branch: signs of the velocities and their leading zeros, friction, stiffness and unit of time."""
    _take(contact, branch)


@kernel
def bound_step(limits: Limits, most: float, contact: np.void, step: np.void) -> int:
    """Find how long the series of a step hold, up to ``most``, once the leading zeros of the velocities are settled.

    Returns RUNNING, TIMEOUT if the time ends with the step, or NON_FINITE.
    """
    if contact["gap_zeros"] == 2.0:
        contact["gap_zeros"] = _leading_zeros(step["v_n"], contact["gap_rate"])
    if contact["slip_zeros"] == 2.0:
        contact["slip_zeros"] = _leading_zeros(step["v_t"], contact["slip"])
    if contact["spin_zeros"] == 2.0:
        contact["spin_zeros"] = _leading_zeros(step["omega"], contact["spin"])
    v_n, v_t, omega = step["v_n"], step["v_t"], step["omega"]
    length = longest_step(contact["size"], contact["scale"], contact["tolerance"], most, v_n, v_t, omega)
    left = max(limits.max_time - contact["time"], 0.0) / step["unit"]
    if not math.isfinite(min(length, left)):
        return records.NON_FINITE
    step["length"] = min(length, left)
    step["most"] = STRETCHED * length if STRETCHED * length < left else step["length"]
    return records.TIMEOUT if length >= left else records.RUNNING


@kernel
def _time_passes(before: float, contact: np.void, step: np.void) -> bool:
    """Count the steps without any progress since the time ``before``; say whether this one had a length.

    If it had, no velocity is any longer one that has just been released.
    """
    contact["stalled"] = 0.0 if contact["time"] > before else contact["stalled"] + 1.0
    if not step["length"] * step["unit"] > 0.0:
        return False
    forget_zeros(contact)
    return True


@kernel
def _stop_or_release(contact: np.void, step: np.void) -> None:
    """Let slip or spin be zero at the end of a step, if that is what happens there, and free if it is released."""
    event = int(step["event"])
    if event in (events.SLIP_ZERO, events.SLIP_RELEASED):
        contact["v_t"], contact["slip_left"] = 0.0, step["released"]
    elif event in (events.SPIN_ZERO, events.SPIN_RELEASED):
        contact["omega"], contact["spin_left"] = 0.0, step["released"]


def _pacing(contact: Any, moved: Any) -> None:
    """Program of the units of time while the gap closes and opens; ``moved`` is the mobility of the point [1/kg]."""
    for name, closing in (("pace_closing", 1.0), ("pace_opening", 0.0)):
        stiff = normal.stiffness(contact, less(0.0, closing))
        setattr(contact, name, where(less(0.0, stiff), UNIT_ANGLE / root(stiff * moved), math.inf))


_write_paces = straight(_pacing)


@kernel
def write_feature(body: Body, contact: np.void) -> None:
    """Write what does not change until another feature touches."""
    feature = int(contact["feature"])
    h, r, shift = feature_geometry(body, feature)
    contact["h"], contact["r"], contact["shift"] = h, r, shift
    contact["arm"] = contact["arc_arm"] if feature == records.ARC else contact["corner_arm"]
    contact["other"], contact["other_sine"], contact["other_cosine"] = other_corner(body, feature, shift)
    if contact["paired"] != 0.0:  # the other corner is down
        contact["other"], contact["other_sine"], contact["other_cosine"] = math.inf, 0.0, 0.0
    # The largest mobility of the point: a spring that turns the body moves less than its mass.
    moved = contact["per_mass"] * (1.0 + contact["ratio"] * h * h)
    _write_paces(contact, moved)


@kernel
def settled_unit(size: float, gravity: float, omega: float) -> float:
    """Unit of time [s] of a step with a locked gap, in which nothing oscillates."""
    rate = max(abs(omega), math.sqrt(gravity / size))
    return 0.5 / rate if rate > 0.0 else 1.0


@kernel
def move_on(contact: np.void, step: np.void) -> bool:
    """Go to the end of a step; return whether a velocity has passed zero there by rounding, and is zero now."""
    before = contact["time"]
    advance(contact, step)
    contact["at_edge"] = contact["other_left"] = 0.0
    passed = False
    if _time_passes(before, contact, step):
        # Two events at the same time: the later one by rounding must not leave its velocity with the wrong sign.
        if contact["gap_rate"] * contact["v_n"] < 0.0:
            contact["v_n"], passed = 0.0, True
        if contact["slip"] * contact["v_t"] < 0.0:
            contact["v_t"], passed = 0.0, True
        if contact["spin"] * contact["omega"] < 0.0:
            contact["omega"], passed = 0.0, True
    return passed


@kernel
def _change_feature(body: Body, contact: np.void) -> None:
    """Pass from the arc to a corner or back."""
    if contact["feature"] == records.ARC:
        contact["feature"] = records.TAIL if contact["phi"] > 0.0 else records.NOSE
    else:
        contact["feature"] = records.ARC
    contact["phi"] = math.copysign(body.half_angle, contact["phi"])
    contact["at_edge"] = 1.0
    write_feature(body, contact)


@kernel
def follow_event(body: Body, contact: np.void, step: np.void) -> int:
    """Apply what happens at the end of a step to the contact; return its status, RUNNING if it goes on."""
    event = int(step["event"])
    if event == events.NOTHING:
        moved = contact["x"] + contact["phi"] + contact["gap"] + contact["v_n"] + contact["v_t"] + contact["omega"]
        return records.RUNNING if math.isfinite(moved) else records.NON_FINITE
    if event == events.SEPARATION:
        return records.SEPARATED
    if event == events.SLOPE_ENDS:
        contact["x"] = contact["length"]
        return records.FINISH
    if event == events.CHORD_DOWN:
        return records.BOTH_CORNERS
    if event == events.RATE_ZERO:
        contact["v_n"], contact["gap_left"] = 0.0, 0.0
    elif event == events.RATE_RELEASED:
        if contact["k_closing"] == math.inf:
            return records.SEPARATED
        contact["gap_left"] = step["released"]
    elif event == events.MIDDLE_PASSED:
        if contact["paired"] != 0.0:
            return records.BURIED
        contact["phi"] = math.copysign(0.0, -contact["other_sine"])
    elif event == events.FEATURE_ENDS:
        _change_feature(body, contact)
    else:
        _stop_or_release(contact, step)
    return records.RUNNING


@kernel
def arms_now(body: Body, feature: int, contact: np.void) -> tuple[float, float]:
    """Arms [m] of a feature at the orientation of a contact."""
    return arms(body, feature, contact["phi"] - whole_turns(contact["phi"]))


@kernel
def change_corner(body: Body, corner: int, contact: np.void) -> None:
    """Turn the contact of one corner into that of the other, whose code is given."""
    a, b = arms_now(body, int(contact["feature"]), contact)
    u, v = contact["v_t"] - b * contact["omega"], contact["v_n"] + a * contact["omega"]
    a, b = arms_now(body, corner, contact)
    contact["v_t"], contact["v_n"] = u + b * contact["omega"], v - a * contact["omega"]
    contact["feature"] = corner


@kernel
def begin_with_approaching(body: Body, contact: np.void) -> None:
    """Let a chord that lands flat begin with the other corner, if the one chosen moves away."""
    feature = int(contact["feature"])
    if contact["v_n"] > 0.0 and feature != records.ARC:
        change_corner(body, records.NOSE if feature == records.TAIL else records.TAIL, contact)
        contact["feature_before"], contact["v_t_before"] = contact["feature"], contact["v_t"]
        contact["a_before"], contact["b_before"] = arms_now(body, int(contact["feature"]), contact)
