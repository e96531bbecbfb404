"""Contact with extent in time, event-driven, in power series of high order: docs/physics.md, sections 5 and 6.

One loop serves the paper's two-stiffness law and the sustained contact of rigid surfaces, where the normal force is
unbounded and the gap stays closed until that force would become negative. The body touches with one point, or with two
while both ends of a straight side are down.

Between events the forces are analytic, so a step is a power series of the state and every event the first root of one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import straight
from sledenv.compiler.values import equal, where
from sledenv.kernel import events, joining, normal, progress, records
from sledenv.kernel.friction import CLEAR, Bounds, Branch, Drive, Mobility, resolve, sign_of
from sledenv.kernel.ground import piece_at
from sledenv.kernel.outline import arms, whole_turns, within
from sledenv.kernel.pair import resolve_pair
from sledenv.kernel.params import Incline, Limits
from sledenv.kernel.recurrence import expand
from sledenv.kernel.roots import locate
from sledenv.kernel.sampling import rolling_part, sample_step
from sledenv.kernel.state import followed_by
from sledenv.kernel.step import begin_step, complete, expect, orient

SOUGHT = 1.1  # lengths of the step: an expected root is sought if the guess lies within so many
NO_LOAD = 1e-9  # of the force that drives the slip: a smaller normal force counts as none
LASTING = 1e-12  # [units] a branch that lasts less is due to rounding
UNITS = 0.7  # unit of time of a step of two points over that of one: two springs are stiffer


def _signs(contact: Any, point: Any) -> Any:
    """In a program: code of the signs of a branch, 0 to 26."""
    return (point.gap_rate + 1.0) + 3.0 * (point.slip + 1.0) + 9.0 * (contact.spin + 1.0)


def _noting(contact: Any, one: Any, two: Any) -> None:
    """Program that adds the branch of a contact to its sequence, unless it is the last one there."""
    both = where(equal(contact.count, 1.0), 0.0, 1.0 + _signs(contact, two))
    branch = _signs(contact, one) + 27.0 * (one.arc + 1.0 + 16.0 * both)
    contact.sequence = where(equal(branch, contact.branch), contact.sequence, followed_by(contact.sequence, branch))
    contact.branch = branch


_note = straight(_noting)


@kernel
def _begin(body: np.void, slope: Incline, space: np.void) -> None:
    """Set up a contact at its start; its orientation becomes one within the interval of its arc."""
    contact, points, ground = space["contact"], space["points"], space["ground"]
    point = points[0]
    turns = whole_turns(contact["phi"])
    contact["phi"] -= turns
    turn = within(body, int(point["arc"]), contact["phi"])
    contact["turns"] = turns + turn
    contact["phi"] -= turn
    size = body["size"]
    contact["size"] = size
    contact["scale"] = progress.speed_scale(slope, size, point["v_n"], point["v_t"], contact["omega"])
    contact["per_mass"], contact["ratio"] = 1.0 / body["mass"], body["mass"] / body["inertia"]
    contact["inward"], contact["downhill"] = slope.inward, slope.downhill
    progress.forget_branch(contact, points)
    point["at_edge"], point["other_left"], contact["undecided"] = 0.0, 0.0, 1.0
    if contact["rigid"] == 0.0:  # rigid surfaces have hit each other before, see rigid.py
        point["piece"] = 0.0
        if ground["count"] > 1.0:
            a, _ = arms(body, int(point["arc"]), contact["phi"])
            point["piece"] = piece_at(ground, contact["x"] - a)
    progress.write_arc(body, ground, 0.0, contact, point)


@kernel
def _resolved(body: np.void, contact: np.void, point: np.void, step: np.void) -> Branch:
    """Branch of a contact of one point from here on, by the box rule."""
    v_n, v_t, omega = point["v_n"], point["v_t"], contact["omega"]
    if v_n != 0.0 and v_t != 0.0 and omega != 0.0:
        return Branch(sign_of(v_n), sign_of(v_t), sign_of(omega))
    a, b = point["h"] * step["sine"], point["r"] - point["h"] * step["cosine"]
    square = omega * omega
    drive = Drive(
        contact["downhill"] + a * square,
        -contact["inward"] - point["h"] * step["cosine"] * square,
    )
    shallow = normal.NO_DEPTH * contact["size"]
    if abs(drive.t) > normal.NO_DEPTH * abs(drive.n) and contact["rigid"] == 0.0:
        shallow = min(shallow, NO_LOAD * body["mass"] * abs(drive.t) / contact["k_closing"])
    closing, opening = normal.bounds(contact, point, shallow)
    return resolve(
        Mobility(1.0 / body["mass"], 1.0 / body["inertia"], a, b),
        drive,
        point["friction"],
        point["arm"],
        contact["size"],
        Bounds(closing, opening),
        progress.signs(contact, point),
    )


@kernel
def _tried(number: int, contact: np.void, point: np.void) -> Branch:
    """One of the branches that the velocities of a contact of one point admit.

    The box rule sees the forces of an instant. Where they and the drives grow from zero together it may choose a branch
    that ends at once; the right one is then the one in which time advances.
    """
    v_n, v_t, omega = point["v_n"], point["v_t"], contact["omega"]
    side = progress.side(contact)
    sense = side if number // 9 != 1 else -side  # it may matter whether a slip is tried before its lock or after that
    return Branch(
        sign_of(v_n) if v_n != 0.0 else number % 3 - 1,
        sign_of(v_t) if v_t != 0.0 else sense * (number // 3 % 3 - 1),
        sign_of(omega) if omega != 0.0 else side * (number // 9 - 1),
    )


@kernel
def _choose(body: np.void, contact: np.void, point: np.void, step: np.void) -> None:
    """Choose the branch that a contact of one point follows from here on, and write what depends on it."""
    trial = progress.trial(contact)
    if trial > 0:
        branch = _tried(progress.TRIALS - trial, contact, point)
    else:
        branch = _resolved(body, contact, point, step)
    progress.take_branch(branch, contact, point)


@kernel
def _choose_both(body: np.void, space: np.void) -> int:
    """Choose the branch of both points. Rigid points that are to leave do so at once: RUNNING then goes on with one."""
    contact, points, steps = space["contact"], space["points"], space["steps"]
    trial = progress.trial(contact)
    if trial > 0:  # recent releases may be due to rounding
        progress.forget_zeros(contact, points)
    signs, other_signs = progress.signs(contact, points[0]), progress.signs(contact, points[1])
    branch, other, violation = resolve_pair(space, signs, other_signs, progress.side(contact), trial)
    progress.take_branch(branch, contact, points[0])
    progress.take_branch(other, contact, points[1])
    leaves, other_leaves = branch.gap_rate > 0, other.gap_rate > 0
    if contact["rigid"] != 0.0 and (violation > CLEAR or (leaves and other_leaves)):
        if not contact["inward"] > 0.0:
            return records.SEPARATED
        # Friction tips the body over the point ahead, and no finite force prevents it: an impact there follows.
        joining.part(body, points[0]["v_t"] * points[0]["h"] * steps[0]["sine"] < 0.0, space)
        return records.INCONSISTENT
    if contact["rigid"] != 0.0 and (leaves or other_leaves):
        joining.part(body, not leaves, space)
    return records.RUNNING


@kernel
def _look(body: np.void, limits: Limits, flight: np.void, space: np.void) -> int:
    """Choose the branch of a contact, if it may change; return the status: RUNNING if a step follows."""
    contact, points, steps = space["contact"], space["points"], space["steps"]
    paired = contact["count"] > 1.0
    if paired:
        orient(contact, points[0], steps[0])
        orient(contact, points[1], steps[1])
        if contact["undecided"] != 0.0:
            status = _choose_both(body, space)
            if status != records.RUNNING:
                return status
    if contact["count"] == 1.0:
        progress.watch_nearer(body, contact, points[0])
        orient(contact, points[0], steps[0])
        if contact["undecided"] != 0.0:
            _choose(body, contact, points[0], steps[0])
    return _standing(limits, flight, space)


@kernel
def _standing(limits: Limits, flight: np.void, space: np.void) -> int:
    """Status of a contact before a step: RUNNING if there is to be one."""
    contact, point, step = space["contact"], space["points"][0], space["steps"][0]
    lies = contact["count"] > 1.0 and contact["spin"] == 0.0 and point["gap_rate"] == 0.0
    if lies and flight["t_on_chord"] == math.inf:
        flight["t_on_chord"], flight["x_on_chord"] = contact["time"], contact["x"]
    status = records.RUNNING
    if point["gap_rate"] == 0.0 and point["slip"] == 0.0 and contact["spin"] == 0.0:
        status = records.JAMMED
    elif lies and limits.end_on_chord != 0.0:
        status = records.TUMBLED
    elif contact["rigid"] != 0.0 and point["gap_rate"] > 0.0:
        turning = point["h"] * step["cosine"] * contact["omega"] * contact["omega"]
        status = records.INCONSISTENT if contact["inward"] + turning > 0.0 else records.SEPARATED
    elif flight["steps"] >= limits.max_steps or contact["stalled"] > progress.MOST_STALLED:
        status = records.STEP_BUDGET
    return status


@kernel
def _prepare(slope: Incline, space: np.void) -> None:
    """Write what the series of a step need: the unit of time, and the bounds of locked normal forces."""
    contact, points, steps = space["contact"], space["points"], space["steps"]
    unit = progress.settled_unit(contact["size"], slope.gravity, contact["omega"])
    if contact["count"] == 1.0:
        begin_step(contact, points[0], steps[0])
        if points[0]["gap_rate"] == 0.0:
            steps[0]["unit"] = unit
    else:
        for i in range(2):
            if points[i]["gap_rate"] != 0.0:
                unit = min(unit, UNITS * points[i]["pace"])
        steps[0]["unit"] = steps[1]["unit"] = unit
    for i in range(int(contact["count"])):
        steps[i]["largest"], steps[i]["least"] = normal.bounds(contact, points[i], 0.0)


@kernel
def _bound(limits: Limits, space: np.void) -> int:
    """Find how long the series of a step hold, and complete it up to there or to what is likely to end it.

    Returns what ``bound_step`` does, or INCONSISTENT.
    """
    contact, points, steps = space["contact"], space["points"], space["steps"]
    point, step = points[0], steps[0]
    if contact["count"] > 1.0:
        bounded = progress.bound_step(limits, progress.MOST_UNITS, contact, point, step)
        if bounded != records.NON_FINITE:
            bounded = progress.bound_step(limits, step["length"], contact, points[1], steps[1])
        if bounded != records.NON_FINITE:
            step["length"], step["event"] = steps[1]["length"], events.NOTHING
            complete(contact, point, step)
            complete(contact, points[1], steps[1])
        return bounded
    if point["gap_rate"] != 0.0:
        expect(contact, point, step)
    else:
        step["expected"] = events.NOTHING
    if contact["rigid"] != 0.0 and not 0.0 <= step["normal"][0] <= contact["most_normal"]:
        return records.INCONSISTENT
    bounded = progress.bound_step(limits, progress.MOST_UNITS, contact, point, step)
    if bounded != records.NON_FINITE:
        _foresee(contact, point, step)
    return bounded


@kernel
def _turns_back(
    before: float, end: float, series: np.ndarray, event: int, contact: np.void, point: np.void, step: np.void
) -> None:
    """Let a step end where a velocity has become zero, if it has changed its sign by the end of the step."""
    if before * end < 0.0:
        length = step["length"]
        at = locate(series, length * before / (before - end), length)
        if at > 0.0:
            step["length"], step["event"] = at, event
            complete(contact, point, step)


@kernel
def _foresee(contact: np.void, point: np.void, step: np.void) -> None:
    """Complete a step up to what is likely to end it, sought where it is expected and up to ``step["most"]``."""
    step["event"] = events.NOTHING
    expected = int(step["expected"])
    # A gap rate that starts from zero has a root there, which the search might find.
    sought = expected == events.SEPARATION or (expected == events.RATE_ZERO and point["gap_zeros"] == 0.0)
    if sought and step["guess"] < SOUGHT * step["length"]:
        series = normal.load_series(contact, step) if expected == events.SEPARATION else step["v_n"]
        at = locate(series, step["guess"], step["most"])
        if at > 0.0:
            step["length"], step["event"] = at, expected
    complete(contact, point, step)
    if point["slip"] != 0.0 and point["slip_zeros"] == 0.0:
        _turns_back(point["v_t"], step["v_t_end"], step["v_t"], events.SLIP_ZERO, contact, point, step)
    if contact["spin"] != 0.0 and contact["spin_zeros"] == 0.0:
        _turns_back(contact["omega"], step["omega_end"], step["omega"], events.SPIN_ZERO, contact, point, step)


@kernel
def _step(slope: Incline, limits: Limits, space: np.void) -> int:
    """Find the series of a step and its first event; return what ``bound_step`` does, or INCONSISTENT.

    The contact itself stays where it is.
    """
    contact, points, steps = space["contact"], space["points"], space["steps"]
    _prepare(slope, space)
    expand(space)
    bounded = _bound(limits, space)
    if bounded != records.RUNNING and bounded != records.TIMEOUT:
        return bounded
    foreseen = steps[0]["length"]
    events.first_event(space["finish"], space)
    if steps[0]["length"] < foreseen:  # something else happens before
        for i in range(int(contact["count"])):
            complete(contact, points[i], steps[i])
    return bounded


@kernel
def _feel(body: np.void, space: np.void) -> int:
    """Apply to a contact what happens at the end of a step; return its status, RUNNING if it goes on.

    Where one of two points has left, the contact goes on with the other.
    """
    contact, points, steps = space["contact"], space["points"], space["steps"]
    if contact["count"] == 1.0:
        status = progress.follow_event(body, space["finish"], 0, space)
        if status == records.TWO_POINTS and contact["rigid"] == 0.0:
            # With both ends of a flat arc in the slope one point no longer says where the surfaces push.
            sunk = body["sinks"][int(points[0]["arc"])] != 0.0
            return records.RUNNING if not sunk and joining.join(body, space) else records.BURIED
        return status
    if steps[1]["event"] != events.NOTHING:
        contact["undecided"] = 1.0
    leaves = other_leaves = False
    for i in range(2):
        status = progress.follow_event(body, space["finish"], i, space)
        if status != records.RUNNING and status != records.SEPARATED:
            return status
        if status == records.SEPARATED:
            leaves, other_leaves = leaves or i == 0, other_leaves or i == 1
    joining.agree(contact, points)
    if not leaves and not other_leaves:
        return records.RUNNING
    contact["undecided"] = 1.0
    gone = (leaves or _up(points[0])) and (other_leaves or _up(points[1]))
    joining.part(body, other_leaves, space)
    return records.SEPARATED if gone else records.RUNNING


@kernel
def _up(point: np.void) -> bool:
    """Whether a point is off the slope and does not come down."""
    return bool(point["gap"] >= 0.0 and point["v_n"] >= 0.0)


@kernel
def follow(
    body: np.void,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    space: np.void,
    trajectory: np.ndarray,
) -> int:
    """Follow a contact from touchdown to separation, rest or the end of the slope: docs/physics.md, section 5.

    Parameters
    ----------
    body : record of BODY
    slope, limits
        See :mod:`sledenv.kernel.params`.
    flight : record of OUTCOME
        Whose contact it is; its steps and its rows of the trajectory are counted.
    space : record of SPACE
        Its ``contact`` and the first of its ``points`` hold the state at touchdown, overwritten by that at the end, and
        how the surfaces meet: the fields of CONTACT from those of :mod:`sledenv.kernel.normal`.
        Impulses and losses are added up. Rigid surfaces start at rest, without gap or gap rate; ``count`` is 2 if they
        touch with two points.
    trajectory : ndarray of TRAJECTORY
        Rows are added while there is room; length 0 records nothing.

    Returns
    -------
    int
        SEPARATED, of rigid surfaces INCONSISTENT or TWO_POINTS; or the status with which the descent ends.
    """
    contact, points, steps = space["contact"], space["points"], space["steps"]
    joined = contact["count"] > 1.0
    contact["count"] = 1.0
    _begin(body, slope, space)
    if joined:
        joining.join(body, space)
    while True:
        if progress.touches(body, limits.end_part, contact, points):
            return _ended(records.TUMBLED, contact)
        status = _look(body, limits, flight, space)
        if status != records.RUNNING:
            break
        flight["steps"] += 1
        space["work"] += 1.0
        bounded = _step(slope, limits, space)
        if bounded != records.RUNNING and bounded != records.TIMEOUT:
            status = bounded
            break
        step = steps[0]
        if contact["undecided"] != 0.0 and step["length"] > LASTING:
            _note(contact, points[0], points[1])
        if trajectory.shape[0] > 0 and step["length"] > 0.0:
            sample_step(body, limits, flight, space, trajectory)
        if contact["count"] > 1.0:
            step["moment_impulse"] = rolling_part(step["moment_impulse"], points, steps)
        contact["undecided"] = 1.0 if progress.move_on(contact, points, steps) else 0.0
        event = int(step["event"])
        status = _feel(body, space)
        if status == records.FINISH:
            _, b = progress.arms_now(body, int(points[0]["arc"]), contact)
            u = points[0]["v_t"] - b * contact["omega"]
            if progress.passes_line(limits, contact["time"], u, flight, space):
                status = records.RUNNING
        if status != records.RUNNING:
            break
        if contact["undecided"] == 0.0 and event == events.NOTHING and bounded == records.TIMEOUT:
            status = records.TIMEOUT
            break
        if event != events.NOTHING and event != events.MIDDLE_PASSED:
            contact["undecided"] = 1.0
    contact["held"] = 1.0
    if status == records.JAMMED or status == records.TUMBLED:  # no step has been made in this branch
        steps[0]["unit"], steps[0]["length"] = 1.0, 0.0
        expand(space)
    return _ended(status, contact)


@kernel
def _ended(status: int, contact: np.void) -> int:
    """Give the orientation of a contact that has ended its whole turns back; return the status."""
    contact["phi"] += contact["turns"]
    return status
