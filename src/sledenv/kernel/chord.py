"""Both ends of the chord touch at once: how the second point joins the first, a step of both, and how they part.

The point that touched first is ``space["contact"]``, the other ``space["second"]``: a contact with an orientation of
its own, a turn away, so that the two are mirror images of each other where the chord lies flat. Time, place, spin and
what the body is subject to are the same in both. Each adds up impulses and losses, put together when they part.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.kernel import events, normal, progress, records
from sledenv.kernel.pair import resolve_pair
from sledenv.kernel.params import Body, Incline, Limits
from sledenv.kernel.recurrence import expand
from sledenv.kernel.roots import first_root, horner
from sledenv.kernel.state import CONTACT, PEAKS, SUMS, add, clear, copy
from sledenv.kernel.step import complete, orient
from sledenv.programs.jit import kernel
from sledenv.programs.trace import of_step, straight
from sledenv.programs.values import larger

SAME_RATE = 1e-12  # of the speed scale: gap rates of two points that are equal but for rounding; likewise moments
TOUCHING = 1e-9  # of the size: gap of the second point where it starts to touch
UNITS = 0.7  # of time of a point alone in that of both: springs side by side are stiffer

_OWN = tuple(name for name in CONTACT.names or () if name not in (*SUMS, *PEAKS, "filling"))
_take = of_step(lambda contact, second: copy(second, contact, _OWN))
_start = straight(lambda contact: clear(contact, (*PEAKS, *SUMS)))


def _adding(contact: Any, second: Any) -> None:
    """Program that hands over to the first point what the second has added up."""
    add(second, contact, SUMS)
    for name in PEAKS:
        setattr(contact, name, larger(getattr(contact, name), getattr(second, name)))


_add = of_step(_adding)


@kernel
def join(body: Body, contact: np.void, second: np.void) -> bool:
    """Let the corner on the other side touch too; say whether it is there."""
    phi, omega, gap = contact["phi"], contact["omega"], contact["gap"]
    _take(second, contact)
    _start(second)
    theta = phi + contact["shift"]
    apart = contact["other"] + contact["other_sine"] * math.sin(theta) + contact["other_cosine"] * math.cos(theta)
    turn = math.copysign(2.0 * math.pi, phi)
    second["phi"], second["turns"] = phi - turn, contact["turns"] + turn
    second["feature"] = records.NOSE if phi > 0.0 else records.TAIL
    second["at_edge"] = 0.0
    progress.tell_feature(body, second)
    if not abs(gap + apart) <= TOUCHING * contact["size"]:
        return False
    theta_2 = second["phi"] + second["shift"]
    flat = abs(apart) <= progress.ROUNDING * contact["size"]
    second["gap"] = gap if flat else min(gap + apart, 0.0)
    second["v_n"] += (contact["h"] * math.sin(theta) - second["h"] * math.sin(theta_2)) * omega
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
    contact["paired"] = 0.0
    progress.tell_feature(body, contact)


@kernel
def _agree(contact: np.void, second: np.void) -> None:
    """Let the velocities of both points be those of one body, where some of them are zero or nearly so.

    Each point follows its own. By rounding, what is to be zero at one then is not quite so at the other, and a slip
    that is all due to the turning, as the other point sticks, would be lost.
    """
    small = SAME_RATE * contact["scale"]
    apart, sticking = contact["gap"] - second["gap"], contact["v_t"] == 0.0 and second["v_t"] == 0.0
    settled = contact["v_n"] == 0.0 or second["v_n"] == 0.0
    if settled and abs(contact["v_n"] - second["v_n"]) <= small:
        contact["omega"] = 0.0
    if sticking and abs(contact["omega"]) * contact["size"] <= small:
        contact["omega"] = 0.0
    if contact["omega"] == 0.0 or second["omega"] == 0.0:
        contact["omega"] = second["omega"] = 0.0
        zero = contact["v_n"] == 0.0 or second["v_n"] == 0.0
        contact["v_n"] = second["v_n"] = 0.0 if zero else contact["v_n"]
        zero = contact["v_t"] == 0.0 or second["v_t"] == 0.0
        contact["v_t"] = second["v_t"] = 0.0 if zero else contact["v_t"]
        if contact["spin"] == 0.0:  # what held both alike lets both go
            second["slip_left"] = contact["slip_left"]
    elif abs(apart) > progress.NO_DEPTH * contact["size"]:
        if contact["v_t"] == 0.0 and (contact["slip"] == 0.0 or sticking):
            second["v_t"] = apart * contact["omega"]
        elif second["v_t"] == 0.0 and second["slip"] == 0.0:
            contact["v_t"] = -apart * contact["omega"]
    second["spin_left"] = contact["spin_left"]


@kernel
def look_at_both(body: Body, limits: Limits, flight: np.void, space: np.void) -> int:
    """Choose the branch of both points, if it may change; return the status, RUNNING if a step is to be made.

    Rigid points that are to leave do so at once: the contact may then go on with one.
    """
    contact, second, step, second_step = space["contact"], space["second"], space["step"], space["second_step"]
    orient(contact, step)
    orient(second, second_step)
    if contact["undecided"] != 0.0:
        branch, other = resolve_pair(contact, second, step, second_step)
        progress.take_branch(branch, contact)
        progress.take_branch(other, second)
        rigid = contact["k_closing"] == math.inf
        if rigid and branch.gap_rate > 0 and other.gap_rate > 0:
            if not contact["inward"] > 0.0:
                return records.SEPARATED
            # Friction would turn the body over the corner ahead, faster than any finite force could let it.
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
def _passes_flat(contact: np.void, second: np.void, step: np.void, second_step: np.void, slip: float) -> float:
    """Time at which the chord lies flat, while one point sticks and the second has over it a slip of this sign.

    That slip is the difference of the gaps times the spin, too small to be looked for by itself.
    """
    sign = slip * contact["spin"]
    q = step["scratch"]
    q[:] = sign * (step["gap"] - second_step["gap"])
    flat = abs(contact["gap"] - second["gap"]) <= progress.NO_DEPTH * contact["size"]
    vanishing = 0 if not flat else (1 if contact["omega"] != 0.0 else 2)
    return first_root(q, step["length"], vanishing, 0.0)


@kernel
def _vanishes(moment: np.ndarray, load: np.ndarray, size: float, length: float) -> bool:
    """Whether a moment is nothing but the rounding errors of two that balance, under a load [N]."""
    rounding = SAME_RATE * size * max(abs(load[0]), abs(horner(load, length)))
    return bool(max(abs(moment[0]), abs(horner(moment, length))) <= rounding)


@kernel
def _first_event(body: Body, space: np.void) -> None:
    """Let the step of both points end with the first event of either."""
    contact, second, step, second_step = space["contact"], space["second"], space["step"], space["second_step"]
    step["event"] = second_step["event"] = events.NOTHING
    step["released"] = second_step["released"] = 0.0
    turning, settled = contact["spin"] != 0.0, contact["gap_rate"] == 0.0 and second["gap_rate"] == 0.0
    together = space["together"]
    if not turning:  # what holds both is held against the sum of what bounds it
        together[:] = step["normal"] + second_step["normal"]
        step["safe_moment"] = step["safe_moment_back"] = 0.0
    if not settled:
        events.gap_events(contact, step)
    if turning and second["slip"] == 0.0:
        events.happens(_passes_flat(contact, second, step, second_step, -contact["slip"]), events.SLIP_ZERO, step)
    else:
        events.slip_events(contact, step, step["normal"] if turning else together)
    if turning:
        events.spin_events(contact, step, step["moment"], step["normal"], 1.0)
    elif not settled:
        for i in range(2):
            if not _vanishes(space["moments"][i], together, contact["size"], step["length"]):
                events.spin_events(contact, step, space["moments"][i], space["loads"][i], 1.0)
    events.corner_events(body, contact, step)
    events.slope_event(contact, step)
    second_step["length"] = step["length"]
    if not settled:
        events.gap_events(second, second_step)
    if turning and contact["slip"] == 0.0:
        at = _passes_flat(contact, second, second_step, step, -second["slip"])
        events.happens(at, events.SLIP_ZERO, second_step)
    elif turning:
        events.slip_events(second, second_step, second_step["normal"])
    events.corner_events(body, second, second_step)
    if second_step["event"] != events.NOTHING:
        step["length"], step["event"] = second_step["length"], events.NOTHING


@kernel
def step_of_both(body: Body, slope: Incline, limits: Limits, space: np.void) -> int:
    """Go up to what ends a step of both points; return what :func:`sledenv.kernel.progress.bound_step` does."""
    contact, second, step, second_step = space["contact"], space["second"], space["step"], space["second_step"]
    step["unit"] = second_step["unit"] = _unit(slope, contact, second)
    step["largest"], step["least"] = normal.bounds(0.0, contact)
    second_step["largest"], second_step["least"] = normal.bounds(0.0, second)
    expand(space)
    bounded = progress.bound_step(limits, progress.MOST_UNITS, contact, step)
    if math.isfinite(step["length"]):
        bounded = progress.bound_step(limits, step["length"], second, second_step)
    if bounded == records.NON_FINITE:
        return bounded
    step["length"] = foreseen = second_step["length"]
    complete(contact, step)
    complete(second, second_step)
    _first_event(body, space)
    if step["length"] < foreseen:
        complete(contact, step)
        complete(second, second_step)
    return bounded


@kernel
def feel_both(body: Body, contact: np.void, second: np.void, step: np.void, second_step: np.void) -> int:
    """Move the second point on too, and let both feel what happens at the end of a step; return the status."""
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
