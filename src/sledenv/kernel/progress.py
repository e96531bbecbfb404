"""How a contact goes on from step to step, whether it touches with one point or with both ends of the chord."""

from __future__ import annotations

import math

import numpy as np

from sledenv.kernel import events, records
from sledenv.kernel.friction import Branch
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Incline, Limits
from sledenv.kernel.series import longest_step

MOST_STALLED = 60  # events in a row without any progress in time
STRETCHED = 1.08  # a step may be longer by this factor to end with an event; its last terms are four times larger then
NO_DEPTH = 1e-12  # of the size: a contact that is shallower is resolved in the limit of a vanishing normal force


@kernel
def sign_of(value: float) -> int:
    """-1, 0 or 1."""
    return 1 if value > 0.0 else (-1 if value < 0.0 else 0)


@kernel
def _leading_zeros(velocity: np.ndarray, sign: float) -> int:
    """Number of leading coefficients to be passed over in a search for where a released velocity returns to zero.

    An acceleration that vanishes by construction does so up to the error of the time of release. If it opposes ``sign``
    it is passed over, but kept: the release came early by that much, and the motion is right once it has caught up.
    """
    return 1 if sign * velocity[1] > 0.0 else 2


@kernel
def speed_scale(slope: Incline, size: float, v_n: float, v_t: float, omega: float) -> float:
    """Scale [m/s] of the velocities of a contact."""
    fastest = max(abs(v_n), abs(v_t), size * abs(omega))
    return max(fastest, math.sqrt(slope.gravity * size), 1e-12)


@kernel
def _forget_zeros(contact: np.void) -> None:
    """Let no velocity be zero by construction, nor just released."""
    contact["gap_zeros"] = contact["slip_zeros"] = contact["spin_zeros"] = 0.0
    contact["gap_left"] = contact["slip_left"] = contact["spin_left"] = 0.0


@kernel
def forget_branch(contact: np.void) -> None:
    """Put the branch of a contact at its beginning, before any has been chosen."""
    contact["gap_rate"] = contact["slip"] = contact["spin"] = contact["stalled"] = 0.0
    _forget_zeros(contact)


@kernel
def signs_of(velocity: float, left: float) -> int:
    """Sign of a velocity for the box rule: 2 or -2 where it is zero but has just been released."""
    return sign_of(velocity) if left == 0.0 else 2 * int(left)


@kernel
def take_branch(branch: Branch, contact: np.void) -> None:
    """Write what the velocities do from here on, and what that makes of friction."""
    # What has just left the bound of its force starts without acceleration too, if no other force has jumped.
    jumps = (
        (contact["gap_rate"] != branch.gap_rate) + (contact["slip"] != branch.slip) + (contact["spin"] != branch.spin)
    )
    leaving = 2.0 if jumps == 1 else 1.0
    contact["gap_zeros"] = (leaving if contact["gap_left"] != 0.0 else 1.0) if contact["v_n"] == 0.0 else 0.0
    contact["slip_zeros"] = (leaving if contact["slip_left"] != 0.0 else 1.0) if contact["v_t"] == 0.0 else 0.0
    contact["spin_zeros"] = (leaving if contact["spin_left"] != 0.0 else 1.0) if contact["omega"] == 0.0 else 0.0
    contact["gap_rate"], contact["slip"], contact["spin"] = branch.gap_rate, branch.slip, branch.spin
    contact["mu"] = -branch.slip * contact["friction"]
    contact["rho"] = -branch.spin * contact["arm"]


@kernel
def bound_step(limits: Limits, most: float, contact: np.void, step: np.void) -> int:
    """Find how long the series of a step hold, up to ``most``; return a status, TIMEOUT if the time ends with it."""
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
def time_passes(before: float, contact: np.void, step: np.void) -> bool:
    """Count the steps without any progress since the time ``before``; say whether this one had a length."""
    contact["stalled"] = 0.0 if contact["time"] > before else contact["stalled"] + 1.0
    if not step["length"] * step["unit"] > 0.0:
        return False
    _forget_zeros(contact)
    return True


@kernel
def stop_or_release(contact: np.void, step: np.void) -> None:
    """Let slip or spin be zero at the end of a step, if that is what happens there, and free if it is released."""
    event = int(step["event"])
    if event in (events.SLIP_ZERO, events.SLIP_RELEASED):
        contact["v_t"], contact["slip_left"] = 0.0, step["released"]
    elif event in (events.SPIN_ZERO, events.SPIN_RELEASED):
        contact["omega"], contact["spin_left"] = 0.0, step["released"]
