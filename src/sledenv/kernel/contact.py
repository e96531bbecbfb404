"""Contact with extent in time, event-driven, in power series of high order: docs/physics.md, sections 5 and 6.

One loop serves the paper's two-stiffness law and the sustained contact of rigid surfaces, where the normal force is
unbounded and the gap stays closed until that force would become negative.

Between events the forces are analytic, so a step is a power series of the state and every event the first root of one.
"""

from __future__ import annotations

import math

import numpy as np

from sledenv.kernel.events import first_event
from sledenv.kernel.friction import Bounds, Branch, Drive, Mobility, resolve
from sledenv.kernel.geometry import feature_geometry, other_corner, whole_turns
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, Incline, Limits
from sledenv.kernel.records import (
    ARC,
    BOTH_CORNERS,
    FINISH,
    INCONSISTENT,
    JAMMED,
    NON_FINITE,
    NOSE,
    RUNNING,
    SEPARATED,
    STEP_BUDGET,
    TAIL,
    TIMEOUT,
)
from sledenv.kernel.roots import horner, locate
from sledenv.kernel.series import expand, longest_step
from sledenv.kernel.step import (
    CHORD_DOWN,
    FEATURE_ENDS,
    MIDDLE_PASSED,
    NOTHING,
    RATE_RELEASED,
    RATE_ZERO,
    SEPARATION,
    SLIP_RELEASED,
    SLIP_ZERO,
    SLOPE_ENDS,
    SPIN_RELEASED,
    SPIN_ZERO,
    advance,
    begin_step,
    complete,
    expect,
    orient,
)
from sledenv.kernel.trace import copy_into_callers
from sledenv.kernel.trajectory import CONTACT_ROWS, next_row, write_forces, write_motion

MOST_STALLED = 60  # events in a row without any progress in time
TRIALS = 27  # of them the last ones, in which every branch is tried
MOST_UNITS = 2.0  # length of a step
SOUGHT = 1.1  # a root is sought if it is expected within so many lengths of the step,
STRETCHED = 1.08  # which may be longer by this factor to end there: its last terms are four times larger then
UNIT_ANGLE = 1.5  # of the contact oscillation in a unit of time
# A contact that is loaded less than NO_LOAD times the force that drives the slip, or is shallower than NO_DEPTH times
# the size of the body, is resolved in the limit of a vanishing normal force.
NO_LOAD = 1e-9
NO_DEPTH = 1e-12


@kernel
def sign_of(value: float) -> int:
    """-1, 0 or 1."""
    return 1 if value > 0.0 else (-1 if value < 0.0 else 0)


@kernel
def leading_zeros(velocity: np.ndarray, sign: float) -> int:
    """Number of leading coefficients to be passed over in a search for where a released velocity returns to zero.

    An acceleration that vanishes by construction does so up to the error of the time of release. If it opposes ``sign``
    it is passed over, but kept: the release came early by that much, and the motion is right once it has caught up.
    """
    return 1 if sign * velocity[1] > 0.0 else 2


@kernel
def _tell_feature(body: Body, contact: np.void) -> None:
    """Write what does not change until another feature touches."""
    feature = int(contact["feature"])
    h, r, shift = feature_geometry(body, feature)
    contact["h"], contact["r"], contact["shift"] = h, r, shift
    contact["arm"] = contact["arc_arm"] if feature == ARC else contact["corner_arm"]
    contact["other"], contact["other_sine"], contact["other_cosine"] = other_corner(body, feature, shift)
    # The spring moves less than the mass where it turns the body.
    moved = contact["per_mass"] * (1.0 + contact["ratio"] * h * h)
    contact["pace_closing"] = UNIT_ANGLE / math.sqrt(contact["k_closing"] * moved)
    opening = contact["k_opening"]
    contact["pace_opening"] = UNIT_ANGLE / math.sqrt(opening * moved) if opening > 0.0 else math.inf


@kernel
def _begin(body: Body, slope: Incline, limits: Limits, contact: np.void) -> None:
    """Write what does not change during a contact; its orientation becomes one within a turn."""
    turns = whole_turns(contact["phi"])
    contact["phi"] -= turns
    # At +-pi, where the corners change over, rounding must not give one corner the angle of the other.
    feature, phi = contact["feature"], contact["phi"]
    wrong = (feature == TAIL and phi < 0.0) or (feature == NOSE and phi > 0.0)
    other_turn = math.copysign(2.0 * math.pi, phi) if wrong else 0.0
    contact["turns"] = turns + other_turn
    contact["phi"] -= other_turn
    size = body.radius + body.eccentricity
    fastest = max(abs(contact["v_n"]), abs(contact["v_t"]), size * abs(contact["omega"]))
    contact["size"] = size
    contact["scale"] = max(fastest, math.sqrt(slope.gravity * size), 1e-12)
    contact["per_mass"], contact["ratio"] = 1.0 / body.mass, body.mass / body.inertia
    contact["inward"], contact["downhill"], contact["length"] = slope.inward, slope.downhill, slope.length
    contact["tolerance"] = limits.tolerance
    contact["gap_rate"] = contact["slip"] = contact["spin"] = 0.0
    contact["gap_zeros"] = contact["slip_zeros"] = contact["spin_zeros"] = 0.0
    contact["gap_left"] = contact["slip_left"] = contact["spin_left"] = 0.0
    contact["at_edge"] = contact["stalled"] = 0.0
    _tell_feature(body, contact)


@kernel
def _signs_of(velocity: float, left: float) -> int:
    """Sign of a velocity for the box rule: 2 or -2 where it is zero but has just been released."""
    return sign_of(velocity) if left == 0.0 else 2 * int(left)


@kernel
def _resolved(body: Body, contact: np.void, step: np.void) -> Branch:
    """Branch of a contact from here on, by the box rule."""
    copy_into_callers()
    v_n, v_t, omega = contact["v_n"], contact["v_t"], contact["omega"]
    if v_n != 0.0 and v_t != 0.0 and omega != 0.0:
        return Branch(sign_of(v_n), sign_of(v_t), sign_of(omega))
    a, b = contact["h"] * step["sine"], contact["r"] - contact["h"] * step["cosine"]
    square = omega * omega
    drive = Drive(
        contact["downhill"] + a * square,
        -contact["inward"] - contact["h"] * step["cosine"] * square,
    )
    shallow = NO_DEPTH * contact["size"]
    if abs(drive.t) > NO_DEPTH * abs(drive.n) and contact["k_closing"] < math.inf:
        shallow = min(shallow, NO_LOAD * body.mass * abs(drive.t) / contact["k_closing"])
    depth = max(-contact["gap"], shallow)
    return resolve(
        Mobility(1.0 / body.mass, 1.0 / body.inertia, a, b),
        drive,
        contact["friction"],
        contact["arm"],
        contact["size"],
        Bounds(contact["k_closing"] * depth, contact["k_opening"] * depth),
        Branch(
            _signs_of(v_n, contact["gap_left"]),
            _signs_of(v_t, contact["slip_left"]),
            _signs_of(omega, contact["spin_left"]),
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
        sign_of(v_n) if v_n != 0.0 else number % 3 - 1,
        sign_of(v_t) if v_t != 0.0 else number // 3 % 3 - 1,
        sign_of(omega) if omega != 0.0 else number // 9 % 3 - 1,
    )


@kernel
def _choose(body: Body, contact: np.void, step: np.void) -> None:
    """Choose the branch that a contact follows from here on, and write what depends on it."""
    copy_into_callers()
    branch = _resolved(body, contact, step)
    stalled = int(contact["stalled"])
    if stalled >= MOST_STALLED - TRIALS and contact["k_closing"] < math.inf:
        branch = _trial(MOST_STALLED - stalled, contact)
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
    closing = branch.gap_rate < 0
    contact["stiffness"] = contact["k_closing"] if closing else contact["k_opening"]
    if contact["stiffness"] > 0.0:
        contact["pace"] = contact["pace_closing"] if closing else contact["pace_opening"]


@kernel
def _standing(limits: Limits, flight: np.void, contact: np.void, step: np.void) -> int:
    """Status of a contact before a step: RUNNING if there is to be one."""
    copy_into_callers()
    if contact["gap_rate"] == 0.0 and contact["slip"] == 0.0 and contact["spin"] == 0.0:
        return JAMMED
    if contact["k_closing"] == math.inf and contact["gap_rate"] > 0.0:
        turning = contact["h"] * step["cosine"] * contact["omega"] * contact["omega"]
        return INCONSISTENT if contact["inward"] + turning > 0.0 else SEPARATED
    if flight["steps"] >= limits.max_steps or contact["stalled"] > MOST_STALLED:
        return STEP_BUDGET
    return RUNNING


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
    step["least"] = -contact["k_opening"] * contact["gap"]
    step["largest"] = math.inf if contact["k_closing"] == math.inf else -contact["k_closing"] * contact["gap"]
    if contact["gap_rate"] == 0.0:
        step["unit"] = _settled_unit(contact["size"], slope.gravity, contact["omega"])


@kernel
def _bound(limits: Limits, contact: np.void, step: np.void) -> int:
    """Find how long the series of a step hold; return a status, TIMEOUT if the time ends with the step."""
    copy_into_callers()
    if contact["gap_rate"] != 0.0:
        expect(contact, step)
    else:
        step["expected"] = NOTHING
    if contact["k_closing"] == math.inf and not 0.0 <= step["normal"][0] <= contact["most_normal"]:
        return INCONSISTENT
    if contact["gap_zeros"] == 2.0:
        contact["gap_zeros"] = leading_zeros(step["v_n"], contact["gap_rate"])
    if contact["slip_zeros"] == 2.0:
        contact["slip_zeros"] = leading_zeros(step["v_t"], contact["slip"])
    if contact["spin_zeros"] == 2.0:
        contact["spin_zeros"] = leading_zeros(step["omega"], contact["spin"])
    v_n, v_t, omega = step["v_n"], step["v_t"], step["omega"]
    length = longest_step(contact["size"], contact["scale"], contact["tolerance"], MOST_UNITS, v_n, v_t, omega)
    left = max(limits.max_time - contact["time"], 0.0) / step["unit"]
    if not math.isfinite(min(length, left)):
        return NON_FINITE
    step["length"] = min(length, left)
    step["most"] = STRETCHED * length if STRETCHED * length < left else step["length"]
    return TIMEOUT if length >= left else RUNNING


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
    step["event"] = NOTHING
    expected = int(step["expected"])
    # A gap rate that starts from zero has a root there, which the search might find.
    sought = expected == SEPARATION or (expected == RATE_ZERO and contact["gap_zeros"] == 0.0)
    if sought and step["guess"] < SOUGHT * step["length"]:
        at = locate(step["gap"] if expected == SEPARATION else step["v_n"], step["guess"], step["most"])
        if at > 0.0:
            step["length"], step["event"] = at, expected
    complete(contact, step)
    if contact["slip"] != 0.0 and contact["slip_zeros"] == 0.0:
        _turns_back(contact["v_t"], step["v_t_end"], step["v_t"], SLIP_ZERO, contact, step)
    if contact["spin"] != 0.0 and contact["spin_zeros"] == 0.0:
        _turns_back(contact["omega"], step["omega_end"], step["omega"], SPIN_ZERO, contact, step)


@kernel
def _sample_step(limits: Limits, flight: np.void, contact: np.void, step: np.void, trajectory: np.ndarray) -> None:
    """Add rows over one step, both its ends included: forces may jump between it and the next."""
    h, r, shift = contact["h"], contact["r"], contact["shift"]
    slip, spin = int(contact["slip"]), int(contact["spin"])
    unit, length = step["unit"], step["length"]
    rows = max(CONTACT_ROWS, math.ceil(length * unit / limits.sample_interval))
    for i in range(rows + 1):
        t = length * (i / rows)  # never beyond the step
        phi, omega, normal = horner(step["phi"], t), horner(step["omega"], t), horner(step["normal"], t)
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
        force = contact["mu"] * normal if slip != 0 else horner(step["force"], t)
        moment = contact["rho"] * normal if spin != 0 else horner(step["moment"], t)
        write_forces(row, normal, force, moment, int(contact["feature"]), slip, spin)


@kernel
def _move_on(contact: np.void, step: np.void) -> bool:
    """Go to the end of a step; return whether a velocity has passed zero there by rounding, and is zero now."""
    copy_into_callers()
    before = contact["time"]
    advance(contact, step)
    contact["stalled"] = 0.0 if contact["time"] > before else contact["stalled"] + 1.0
    contact["at_edge"] = 0.0
    passed = False
    if step["length"] * step["unit"] > 0.0:
        contact["gap_zeros"] = contact["slip_zeros"] = contact["spin_zeros"] = 0.0
        contact["gap_left"] = contact["slip_left"] = contact["spin_left"] = 0.0
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
    if contact["feature"] == ARC:
        contact["feature"] = TAIL if contact["phi"] > 0.0 else NOSE
    else:
        contact["feature"] = ARC
    contact["phi"] = math.copysign(body.half_angle, contact["phi"])
    contact["at_edge"] = 1.0
    _tell_feature(body, contact)


@kernel
def _follow_event(body: Body, contact: np.void, step: np.void) -> int:
    """Let the contact feel what happens at the end of a step; return its status, RUNNING if it goes on."""
    copy_into_callers()
    event = int(step["event"])
    if event == NOTHING:
        moved = contact["x"] + contact["phi"] + contact["gap"] + contact["v_n"] + contact["v_t"] + contact["omega"]
        return RUNNING if math.isfinite(moved) else NON_FINITE
    if event == SEPARATION:
        return SEPARATED
    if event == SLOPE_ENDS:
        contact["x"] = contact["length"]
        return FINISH
    if event == CHORD_DOWN:
        return BOTH_CORNERS
    if event == RATE_ZERO:
        contact["v_n"], contact["gap_left"] = 0.0, 0.0
    elif event == SLIP_ZERO:
        contact["v_t"], contact["slip_left"] = 0.0, 0.0
    elif event == SPIN_ZERO:
        contact["omega"], contact["spin_left"] = 0.0, 0.0
    elif event == RATE_RELEASED:
        if contact["k_closing"] == math.inf:
            return SEPARATED
        contact["gap_left"] = step["released"]
    elif event == SLIP_RELEASED:
        contact["slip_left"] = step["released"]
    elif event == SPIN_RELEASED:
        contact["spin_left"] = step["released"]
    elif event == MIDDLE_PASSED:
        contact["phi"] = math.copysign(0.0, -contact["other_sine"])
    elif event == FEATURE_ENDS:
        _change_feature(body, contact)
    return RUNNING


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
        if status != RUNNING:
            break
        flight["steps"] += 1
        _prepare(slope, contact, step)
        expand(contact, step)
        bounded = _bound(limits, contact, step)
        if bounded != RUNNING and bounded != TIMEOUT:
            status = bounded
            break
        _foresee(contact, step)
        foreseen = step["length"]
        first_event(body, contact, step)
        if step["length"] < foreseen:  # something else happens before
            complete(contact, step)
        if trajectory.shape[0] > 0 and step["length"] > 0.0:
            _sample_step(limits, flight, contact, step, trajectory)
        choose = _move_on(contact, step)
        status = _follow_event(body, contact, step)
        if status != RUNNING:
            break
        if step["event"] == NOTHING and bounded == TIMEOUT:
            status = TIMEOUT
            break
        choose = choose or step["event"] not in (NOTHING, MIDDLE_PASSED)
    contact["phi"] += contact["turns"]
    if contact["k_closing"] < math.inf:
        contact["stored"] = 0.5 * contact["k_closing"] * contact["gap"] * contact["gap"]
    return status
