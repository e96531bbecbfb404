"""Both ends of the chord touch at once: how the second point joins the first, a step of both, and how they part.

The point that touched first is ``space["contact"]``, the other ``space["second"]``. The orientation of the second
differs by a whole turn, so that the two are mirror images of each other where the chord lies flat. Time, place, spin
and what the body is subject to are the same in both. Impulses and losses are summed for each, and added when they part.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import of_step, straight
from sledenv.compiler.values import absolute, equal, larger, less, not_more, where
from sledenv.kernel import events, normal, progress, records
from sledenv.kernel.friction import CLEAR
from sledenv.kernel.geometry import sine_and_cosine
from sledenv.kernel.pair import resolve_pair
from sledenv.kernel.params import Body, Incline, Limits
from sledenv.kernel.state import CONTACT, PEAKS, SUMS, add, clear, copy
from sledenv.kernel.step import complete, orient

SAME_RATE = 1e-12  # of the speed scale: gap rates of two points that are equal but for rounding
NO_SLIP = 1e-24  # of it: slips that are zero but for rounding
MOST_TURNING = 1e4  # times that: where the gap rates are equal, a slower rim counts as no spin
AT_SURFACE = 1e-9  # of the size: the second point starts to touch if its gap is below this
UNITS = 0.7  # unit of time of a step of both points over that of one: two springs are stiffer

_OWN = tuple(name for name in CONTACT.names or () if name not in (*SUMS, *PEAKS, "sequence", "branch", "filling"))
_take = of_step(lambda contact, second: copy(second, contact, _OWN))
_start = straight(lambda contact: clear(contact, (*PEAKS, *SUMS)))


def _adding(contact: Any, second: Any) -> None:
    """Program that hands over to the first point what the second has added up."""
    add(second, contact, SUMS)
    for name in PEAKS:
        setattr(contact, name, larger(getattr(contact, name), getattr(second, name)))


def _agreeing(contact: Any, second: Any) -> None:
    """Program that makes the velocities of both points those of one body, where some are zero or nearly so.

    Each is integrated by itself, so rounding makes of a zero at one point a small number at the other. If one point
    sticks, the slip of the other becomes what the spin makes of the difference of the gaps.
    """
    small, omega = SAME_RATE * contact.scale, contact.omega
    apart = contact.gap - second.gap
    quiet = NO_SLIP * contact.scale
    rests, second_rests = not_more(absolute(contact.v_t), quiet), not_more(absolute(second.v_t), quiet)
    settled = equal(contact.v_n, 0.0) | equal(second.v_n, 0.0)
    # If both points have the same arm a, their gap rates are equal whatever the spin.
    slow = not_more(absolute(omega) * contact.size, MOST_TURNING * small)
    alike = settled & slow & not_more(absolute(contact.v_n - second.v_n), small)
    stuck = rests & second_rests & not_more(absolute(omega) * contact.size, small)
    still = alike | stuck | equal(omega, 0.0) | equal(second.omega, 0.0)
    # Of a body that does not turn both velocities are the same; if one point sticks the other slips by the turning.
    together = where(rests | second_rests, 0.0, contact.v_t)
    far = less(normal.NO_DEPTH * contact.size, absolute(apart))
    holds = rests & (equal(contact.slip, 0.0) | second_rests)
    second_holds = second_rests & equal(second.slip, 0.0) & ~holds
    slip = where(far & second_holds, -apart * omega, contact.v_t)
    second_slip = where(far & holds, apart * omega, second.v_t)
    contact.v_t, second.v_t = where(still, together, slip), where(still, together, second_slip)
    rate = where(settled, 0.0, contact.v_n)
    contact.v_n, second.v_n = where(still, rate, contact.v_n), where(still, rate, second.v_n)
    contact.omega, second.omega = where(still, 0.0, omega), where(still, 0.0, second.omega)
    # A lock that both points share is released at both.
    second.slip_left = where(still & equal(contact.spin, 0.0), contact.slip_left, second.slip_left)
    second.spin_left = contact.spin_left


_add, _agree = of_step(_adding), of_step(_agreeing)


@kernel
def join(body: Body, contact: np.void, second: np.void) -> bool:
    """Let the corner on the other side touch too; False if it is not at the surface."""
    phi, omega, gap = contact["phi"], contact["omega"], contact["gap"]
    _take(second, contact)
    _start(second)
    theta = phi + contact["shift"]
    sine, cosine = sine_and_cosine(theta)
    apart = contact["other"] + contact["other_sine"] * sine + contact["other_cosine"] * cosine
    turn = math.copysign(2.0 * math.pi, phi)
    second["phi"], second["turns"] = phi - turn, contact["turns"] + turn
    second["feature"] = records.NOSE if phi > 0.0 else records.TAIL
    second["at_edge"] = 0.0
    progress.write_feature(body, second)
    if not abs(gap + apart) <= AT_SURFACE * contact["size"]:
        return False
    sine_2, _ = sine_and_cosine(second["phi"] + second["shift"])
    flat = abs(apart) <= normal.ROUNDING * contact["size"]
    second["gap"] = gap if flat else min(gap + apart, 0.0)
    second["v_n"] += (contact["h"] * sine - second["h"] * sine_2) * omega
    second["v_t"] += (gap - second["gap"]) * omega
    for point in (contact, second):
        point["other"], point["other_sine"], point["other_cosine"] = math.inf, 0.0, 0.0
        point["paired"], point["on_chord"] = 1.0, 1.0
    progress.forget_branch(contact)
    progress.forget_branch(second)
    _agree(contact, second)
    return True


@kernel
def _part(body: Body, first_stays: bool, contact: np.void, second: np.void) -> None:
    """Go on with one of the points alone."""
    _add(contact, second)
    if not first_stays:
        _take(contact, second)
    contact["paired"], contact["other_left"] = 0.0, 1.0
    progress.write_feature(body, contact)


@kernel
def look_at_both(body: Body, limits: Limits, flight: np.void, space: np.void) -> int:
    """Choose the branch of both points, if it may change; return the status, RUNNING if a step is to be made.

    Rigid points that are to leave do so at once: the contact may then go on with one.
    """
    contact, second, step, second_step = space["contact"], space["second"], space["step"], space["second_step"]
    orient(contact, step)
    orient(second, second_step)
    if contact["undecided"] != 0.0:
        trial = progress.trial(contact)
        if trial > 0:  # recent releases may be due to rounding
            progress.forget_zeros(contact)
            progress.forget_zeros(second)
        branch, other, violation = resolve_pair(
            space, progress.signs(contact), progress.signs(second), progress.side(contact), trial
        )
        progress.take_branch(branch, contact)
        progress.take_branch(other, second)
        rigid = contact["k_closing"] == math.inf
        if rigid and (violation > CLEAR or (branch.gap_rate > 0 and other.gap_rate > 0)):
            if not contact["inward"] > 0.0:
                return records.SEPARATED
            # Friction tips the body over the corner ahead, and no finite force prevents it: an impact there follows.
            _part(body, contact["v_t"] * contact["h"] * step["sine"] < 0.0, contact, second)
            return records.INCONSISTENT
        if rigid and (branch.gap_rate > 0 or other.gap_rate > 0):
            _part(body, branch.gap_rate == 0, contact, second)
            return records.RUNNING
    if contact["spin"] == 0.0 and contact["gap_rate"] == 0.0:
        if flight["t_on_chord"] == math.inf:
            flight["t_on_chord"], flight["x_on_chord"] = contact["time"], contact["x"]
        if contact["slip"] == 0.0:
            return records.JAMMED
        if limits.end_on_chord != 0.0:
            return records.TUMBLED
    spent = flight["steps"] >= limits.max_steps or contact["stalled"] > progress.MOST_STALLED
    return records.STEP_BUDGET if spent else records.RUNNING


@kernel
def _unit(slope: Incline, contact: np.void, second: np.void) -> float:
    """Unit of time [s] of a step of both points."""
    unit = progress.settled_unit(contact["size"], slope.gravity, contact["omega"])
    for point in (contact, second):
        if point["gap_rate"] != 0.0:
            unit = min(unit, UNITS * point["pace"])
    return unit


@kernel
def prepare_both(slope: Incline, space: np.void) -> None:
    """Write what the series of a step of both points need, and the bounds of locked normal forces."""
    contact, second, step, second_step = space["contact"], space["second"], space["step"], space["second_step"]
    step["unit"] = second_step["unit"] = _unit(slope, contact, second)
    step["largest"], step["least"] = normal.bounds(contact, 0.0)
    second_step["largest"], second_step["least"] = normal.bounds(second, 0.0)


@kernel
def complete_both(limits: Limits, space: np.void) -> int:
    """Complete a step of both points, as long as its series hold; return what ``bound_step`` does."""
    contact, second, step, second_step = space["contact"], space["second"], space["step"], space["second_step"]
    bounded = progress.bound_step(limits, progress.MOST_UNITS, contact, step)
    if bounded != records.NON_FINITE:
        bounded = progress.bound_step(limits, step["length"], second, second_step)
    if bounded == records.NON_FINITE:
        return bounded
    step["length"] = second_step["length"]
    step["event"] = events.NOTHING
    complete(contact, step)
    complete(second, second_step)
    return bounded


@kernel
def rolling_part(moment: float, first_load: float, second_load: float) -> float:
    """Part of a moment that rolling resistance holds; the rest is a couple of the friction of both points.

    A body that does not turn needs a certain moment; the loads are the most that each point's rolling resistance gives.
    """
    most = first_load + second_load
    return min(max(moment, -most), most)


@kernel
def feel_both(body: Body, contact: np.void, second: np.void, step: np.void, second_step: np.void) -> int:
    """Move the second point on too, and apply what happens to both at the end of a step; return the status.

    SEPARATED says that both points have left. Where one has, the contact goes on with the other.
    """
    if progress.move_on(second, second_step) or second_step["event"] != events.NOTHING:
        contact["undecided"] = 1.0
    status, other = progress.follow_event(body, contact, step), progress.follow_event(body, second, second_step)
    leaves, second_leaves = status == records.SEPARATED, other == records.SEPARATED
    if status != records.RUNNING and not leaves:
        return status
    if other != records.RUNNING and not second_leaves:
        return other
    _agree(contact, second)
    if not leaves and not second_leaves:
        return records.RUNNING
    contact["undecided"] = 1.0
    gone = (leaves or contact["gap"] >= 0.0) and (second_leaves or second["gap"] >= 0.0)
    _part(body, second_leaves, contact, second)
    return records.SEPARATED if gone else records.RUNNING


@kernel
def unite(contact: np.void, second: np.void) -> None:
    """End a contact of both points as one record."""
    _add(contact, second)
    contact["stored"] += normal.stored(second)
