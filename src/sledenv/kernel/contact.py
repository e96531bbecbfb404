"""Contact with extent in time, event-driven, in power series of high order: docs/physics.md, sections 5 and 6.

One loop serves the paper's two-stiffness law and the sustained contact of rigid surfaces, where the normal force is
unbounded and the gap stays closed until that force would become negative.

Between events the forces are analytic, so a step is a power series of the state and every event the first root of one.
"""

from __future__ import annotations

import math

import numpy as np

from sledenv.kernel import events, normal, progress, records
from sledenv.kernel.friction import Branch, Drive, Mobility, resolve
from sledenv.kernel.geometry import feature_geometry, other_corner, whole_turns
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, Incline, Limits
from sledenv.kernel.roots import horner, locate
from sledenv.kernel.series import expand
from sledenv.kernel.step import advance, begin_step, complete, expect, orient
from sledenv.kernel.trace import copy_into_callers
from sledenv.kernel.trajectory import CONTACT_ROWS, next_row, write_forces, write_motion

TRIALS = 27  # last events without any progress in time, in which every branch is tried
MOST_UNITS = 2.0  # length of a step
SOUGHT = 1.1  # a root is sought if it is expected within so many lengths of the step
UNIT_ANGLE = 1.5  # of the contact oscillation in a unit of time
# A contact that is loaded less than this times the force that drives the slip is resolved as if it had no normal force.
NO_LOAD = 1e-9


@kernel
def _tell_feature(body: Body, contact: np.void) -> None:
    """Write what does not change until another feature touches."""
    feature = int(contact["feature"])
    h, r, shift = feature_geometry(body, feature)
    contact["h"], contact["r"], contact["shift"] = h, r, shift
    contact["arm"] = contact["arc_arm"] if feature == records.ARC else contact["corner_arm"]
    contact["other"], contact["other_sine"], contact["other_cosine"] = other_corner(body, feature, shift)
    # The spring moves less than the mass where it turns the body.
    moved = contact["per_mass"] * (1.0 + contact["ratio"] * h * h)
    contact["pace_closing"] = UNIT_ANGLE / math.sqrt(normal.stiffness(True, contact) * moved)
    opening = normal.stiffness(False, contact)
    contact["pace_opening"] = UNIT_ANGLE / math.sqrt(opening * moved) if opening > 0.0 else math.inf


@kernel
def _begin(body: Body, slope: Incline, limits: Limits, contact: np.void) -> None:
    """Write what does not change during a contact; its orientation becomes one within a turn."""
    turns = whole_turns(contact["phi"])
    contact["phi"] -= turns
    # At +-pi, where the corners change over, rounding must not give one corner the angle of the other.
    feature, phi = contact["feature"], contact["phi"]
    wrong = (feature == records.TAIL and phi < 0.0) or (feature == records.NOSE and phi > 0.0)
    other_turn = math.copysign(2.0 * math.pi, phi) if wrong else 0.0
    contact["turns"] = turns + other_turn
    contact["phi"] -= other_turn
    size = body.radius + body.eccentricity
    contact["size"] = size
    contact["scale"] = progress.speed_scale(slope, size, contact["v_n"], contact["v_t"], contact["omega"])
    contact["per_mass"], contact["ratio"] = 1.0 / body.mass, body.mass / body.inertia
    contact["inward"], contact["downhill"], contact["length"] = slope.inward, slope.downhill, slope.length
    contact["tolerance"] = limits.tolerance
    progress.forget_branch(contact)
    contact["at_edge"] = 0.0
    _tell_feature(body, contact)


@kernel
def _resolved(body: Body, contact: np.void, step: np.void) -> Branch:
    """Branch of a contact from here on, by the box rule."""
    copy_into_callers()
    v_n, v_t, omega = contact["v_n"], contact["v_t"], contact["omega"]
    if v_n != 0.0 and v_t != 0.0 and omega != 0.0:
        return Branch(progress.sign_of(v_n), progress.sign_of(v_t), progress.sign_of(omega))
    a, b = contact["h"] * step["sine"], contact["r"] - contact["h"] * step["cosine"]
    square = omega * omega
    drive = Drive(
        contact["downhill"] + a * square,
        -contact["inward"] - contact["h"] * step["cosine"] * square,
    )
    shallow = progress.NO_DEPTH * contact["size"]
    if abs(drive.t) > progress.NO_DEPTH * abs(drive.n) and contact["k_closing"] < math.inf:
        shallow = min(shallow, NO_LOAD * body.mass * abs(drive.t) / contact["k_closing"])
    return resolve(
        Mobility(1.0 / body.mass, 1.0 / body.inertia, a, b),
        drive,
        contact["friction"],
        contact["arm"],
        contact["size"],
        normal.bounds(shallow, contact),
        Branch(
            progress.signs_of(v_n, contact["gap_left"]),
            progress.signs_of(v_t, contact["slip_left"]),
            progress.signs_of(omega, contact["spin_left"]),
        ),
    )


@kernel
def _trial(number: int, contact: np.void) -> Branch:
    """One of the branches that the velocities of a contact admit.

    The box rule sees the forces of an instant. Where they and the drives grow from zero together it may choose a branch
    that ends at once; the right one is then the one that gets anywhere.
    """
    v_n, v_t, omega = contact["v_n"], contact["v_t"], contact["omega"]
    return Branch(
        progress.sign_of(v_n) if v_n != 0.0 else number % 3 - 1,
        progress.sign_of(v_t) if v_t != 0.0 else number // 3 % 3 - 1,
        progress.sign_of(omega) if omega != 0.0 else number // 9 % 3 - 1,
    )


@kernel
def _choose(body: Body, contact: np.void, step: np.void) -> None:
    """Choose the branch that a contact follows from here on, and write what depends on it."""
    copy_into_callers()
    branch = _resolved(body, contact, step)
    stalled = int(contact["stalled"])
    if stalled >= progress.MOST_STALLED - TRIALS and contact["k_closing"] < math.inf:
        branch = _trial(progress.MOST_STALLED - stalled, contact)
    progress.take_branch(branch, contact)
    closing = branch.gap_rate < 0
    contact["stiffness"] = normal.stiffness(closing, contact)
    if contact["stiffness"] > 0.0:
        contact["pace"] = contact["pace_closing"] if closing else contact["pace_opening"]


@kernel
def _standing(limits: Limits, flight: np.void, contact: np.void, step: np.void) -> int:
    """Status of a contact before a step: RUNNING if there is to be one."""
    copy_into_callers()
    if contact["gap_rate"] == 0.0 and contact["slip"] == 0.0 and contact["spin"] == 0.0:
        return records.JAMMED
    if contact["k_closing"] == math.inf and contact["gap_rate"] > 0.0:
        turning = contact["h"] * step["cosine"] * contact["omega"] * contact["omega"]
        return records.INCONSISTENT if contact["inward"] + turning > 0.0 else records.SEPARATED
    if flight["steps"] >= limits.max_steps or contact["stalled"] > progress.MOST_STALLED:
        return records.STEP_BUDGET
    return records.RUNNING


@kernel
def _settled_unit(size: float, gravity: float, omega: float) -> float:
    """Unit of time [s] of a step with a locked gap, in which nothing oscillates."""
    rate = max(abs(omega), math.sqrt(gravity / size))
    return 0.5 / rate if rate > 0.0 else 1.0


@kernel
def _prepare(slope: Incline, contact: np.void, step: np.void) -> None:
    """Tell a step what its series need, and what a locked normal force is held against."""
    copy_into_callers()
    begin_step(contact, step)
    step["largest"], step["least"] = normal.bounds(0.0, contact)
    if contact["gap_rate"] == 0.0:
        step["unit"] = _settled_unit(contact["size"], slope.gravity, contact["omega"])


@kernel
def _bound(limits: Limits, contact: np.void, step: np.void) -> int:
    """Find what is likely to end a step, and how long its series hold; return what ``bound_step`` does."""
    copy_into_callers()
    if contact["gap_rate"] != 0.0:
        expect(contact, step)
    else:
        step["expected"] = events.NOTHING
    if contact["k_closing"] == math.inf and not 0.0 <= step["normal"][0] <= contact["most_normal"]:
        return records.INCONSISTENT
    return progress.bound_step(limits, MOST_UNITS, contact, step)


@kernel
def _turns_back(before: float, end: float, series: np.ndarray, event: int, contact: np.void, step: np.void) -> None:
    """Let a step end where a velocity has become zero, if it has changed its sign by the end of the step."""
    copy_into_callers()
    if before * end < 0.0:
        length = step["length"]
        at = locate(series, length * before / (before - end), length)
        if at > 0.0:
            step["length"], step["event"] = at, event
            complete(contact, step)


@kernel
def _foresee(contact: np.void, step: np.void) -> None:
    """Complete a step up to what is likely to end it, sought where it is expected and up to ``step["most"]``."""
    copy_into_callers()
    step["event"] = events.NOTHING
    expected = int(step["expected"])
    # A gap rate that starts from zero has a root there, which the search might find.
    sought = expected == events.SEPARATION or (expected == events.RATE_ZERO and contact["gap_zeros"] == 0.0)
    if sought and step["guess"] < SOUGHT * step["length"]:
        series = normal.load_series(contact, step) if expected == events.SEPARATION else step["v_n"]
        at = locate(series, step["guess"], step["most"])
        if at > 0.0:
            step["length"], step["event"] = at, expected
    complete(contact, step)
    if contact["slip"] != 0.0 and contact["slip_zeros"] == 0.0:
        _turns_back(contact["v_t"], step["v_t_end"], step["v_t"], events.SLIP_ZERO, contact, step)
    if contact["spin"] != 0.0 and contact["spin_zeros"] == 0.0:
        _turns_back(contact["omega"], step["omega_end"], step["omega"], events.SPIN_ZERO, contact, step)


@kernel
def _sample_step(limits: Limits, flight: np.void, contact: np.void, step: np.void, trajectory: np.ndarray) -> None:
    """Add rows over one step, both its ends included: forces may jump between it and the next."""
    h, r, shift = contact["h"], contact["r"], contact["shift"]
    slip, spin = int(contact["slip"]), int(contact["spin"])
    unit, length = step["unit"], step["length"]
    rows = max(CONTACT_ROWS, math.ceil(length * unit / limits.sample_interval))
    for i in range(rows + 1):
        t = length * (i / rows)  # never beyond the step
        phi, omega, push = horner(step["phi"], t), horner(step["omega"], t), horner(step["normal"], t)
        a, b = h * math.sin(phi + shift), r - h * math.cos(phi + shift)
        row = next_row(trajectory, flight)
        write_motion(
            row,
            contact["time"] + t * unit,
            horner(step["x"], t),
            horner(step["gap"], t) + b,
            phi + contact["turns"],
            horner(step["v_t"], t) - b * omega,
            horner(step["v_n"], t) + a * omega,
            omega,
        )
        force = contact["mu"] * push if slip != 0 else horner(step["force"], t)
        moment = contact["rho"] * push if spin != 0 else horner(step["moment"], t)
        write_forces(row, push, force, moment, int(contact["feature"]), slip, spin)


@kernel
def _move_on(contact: np.void, step: np.void) -> bool:
    """Go to the end of a step; return whether a velocity has passed zero there by rounding, and is zero now."""
    copy_into_callers()
    before = contact["time"]
    advance(contact, step)
    contact["at_edge"] = 0.0
    passed = False
    if progress.time_passes(before, contact, step):
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
    _tell_feature(body, contact)


@kernel
def _follow_event(body: Body, contact: np.void, step: np.void) -> int:
    """Let the contact feel what happens at the end of a step; return its status, RUNNING if it goes on."""
    copy_into_callers()
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
        contact["phi"] = math.copysign(0.0, -contact["other_sine"])
    elif event == events.FEATURE_ENDS:
        _change_feature(body, contact)
    else:
        progress.stop_or_release(contact, step)
    return records.RUNNING


@kernel
def follow(
    body: Body,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    contact: np.void,
    step: np.void,
    trajectory: np.ndarray,
) -> int:
    """Follow one contact from touchdown to separation, rest or the end of the slope: docs/physics.md, section 5.

    Parameters
    ----------
    body, slope, limits
        See :mod:`sledenv.kernel.params`.
    flight : record of OUTCOME
        Whose contact it is; its steps and its rows of the trajectory are counted.
    contact : record of CONTACT
        State at touchdown and how the surfaces meet (``k_closing`` to ``most_normal``), overwritten by the state at the
        end; impulses and losses are added up. Rigid surfaces start at rest, without gap or gap rate.
    step : record of STEP
        Work space.
    trajectory : ndarray of TRAJECTORY
        Rows are added while there is room; length 0 records nothing.

    Returns
    -------
    int
        SEPARATED, BOTH_CORNERS or INCONSISTENT; or the status with which the descent ends.
    """
    _begin(body, slope, limits, contact)
    choose = True
    while True:
        orient(contact, step)
        if choose:
            _choose(body, contact, step)
        status = _standing(limits, flight, contact, step)
        if status != records.RUNNING:
            break
        flight["steps"] += 1
        _prepare(slope, contact, step)
        expand(contact, step)
        bounded = _bound(limits, contact, step)
        if bounded != records.RUNNING and bounded != records.TIMEOUT:
            status = bounded
            break
        _foresee(contact, step)
        foreseen = step["length"]
        events.first_event(body, contact, step)
        if step["length"] < foreseen:  # something else happens before
            complete(contact, step)
        if trajectory.shape[0] > 0 and step["length"] > 0.0:
            _sample_step(limits, flight, contact, step, trajectory)
        choose = _move_on(contact, step)
        status = _follow_event(body, contact, step)
        if status != records.RUNNING:
            break
        if step["event"] == events.NOTHING and bounded == records.TIMEOUT:
            status = records.TIMEOUT
            break
        choose = choose or step["event"] not in (events.NOTHING, events.MIDDLE_PASSED)
    contact["phi"] += contact["turns"]
    if contact["k_closing"] < math.inf:
        contact["stored"] = normal.per_square(contact)[0] * contact["gap"] * contact["gap"]
    return status
