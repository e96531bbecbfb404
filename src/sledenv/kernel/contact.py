"""Contact with extent in time, event-driven, in power series of high order: docs/physics.md, sections 5 and 6.

One loop serves the paper's two-stiffness law and the sustained contact of rigid surfaces, where the normal force is
unbounded and the gap stays closed until that force would become negative.

Between events the forces are analytic, so a step is a power series of the state and every event the first root of one.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import of_step
from sledenv.compiler.values import equal, where
from sledenv.kernel import events, normal, progress, records
from sledenv.kernel.chord import complete_both, feel_both, join, look_at_both, prepare_both, rolling_part, unite
from sledenv.kernel.friction import Bounds, Branch, Drive, Mobility, resolve, sign_of
from sledenv.kernel.geometry import sine_and_cosine, whole_turns
from sledenv.kernel.params import Body, Incline, Limits
from sledenv.kernel.recurrence import expand
from sledenv.kernel.roots import horner, locate
from sledenv.kernel.state import followed_by
from sledenv.kernel.step import begin_step, complete, expect, orient
from sledenv.kernel.trajectory import (
    CONTACT_ROWS,
    next_row,
    rows_to_write,
    write_corner,
    write_forces,
    write_motion,
    write_slip,
)

SOUGHT = 1.1  # lengths of the step: an expected root is sought if the guess lies within so many
NO_LOAD = 1e-9  # of the force that drives the slip: a smaller normal force counts as none
LASTING = 1e-12  # [units] a branch that lasts less is due to rounding


def _signs(point: Any) -> Any:
    """In a program: code of the signs of a branch, 0 to 26."""
    return (point.gap_rate + 1.0) + 3.0 * (point.slip + 1.0) + 9.0 * (point.spin + 1.0)


def _noting(contact: Any, second: Any) -> None:
    """Program that adds the branch of a contact to its sequence, unless it is the last one there."""
    both = where(equal(contact.paired, 0.0), 0.0, 1.0 + _signs(second))
    branch = _signs(contact) + 27.0 * (contact.feature + 5.0 * both)
    contact.sequence = where(equal(branch, contact.branch), contact.sequence, followed_by(contact.sequence, branch))
    contact.branch = branch


_note = of_step(_noting)


@kernel
def _begin(body: Body, slope: Incline, limits: Limits, contact: np.void) -> None:
    """Set up a contact at its start; its orientation becomes one within a turn."""
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
    contact["at_edge"], contact["other_left"], contact["undecided"] = 0.0, 0.0, 1.0
    progress.write_feature(body, contact)


@kernel
def _resolved(body: Body, contact: np.void, step: np.void) -> Branch:
    """Branch of a contact from here on, by the box rule."""
    v_n, v_t, omega = contact["v_n"], contact["v_t"], contact["omega"]
    if v_n != 0.0 and v_t != 0.0 and omega != 0.0:
        return Branch(sign_of(v_n), sign_of(v_t), sign_of(omega))
    a, b = contact["h"] * step["sine"], contact["r"] - contact["h"] * step["cosine"]
    square = omega * omega
    drive = Drive(
        contact["downhill"] + a * square,
        -contact["inward"] - contact["h"] * step["cosine"] * square,
    )
    shallow = normal.NO_DEPTH * contact["size"]
    if abs(drive.t) > normal.NO_DEPTH * abs(drive.n) and contact["k_closing"] < math.inf:
        shallow = min(shallow, NO_LOAD * body.mass * abs(drive.t) / contact["k_closing"])
    closing, opening = normal.bounds(contact, shallow)
    return resolve(
        Mobility(1.0 / body.mass, 1.0 / body.inertia, a, b),
        drive,
        contact["friction"],
        contact["arm"],
        contact["size"],
        Bounds(closing, opening),
        progress.signs(contact),
    )


@kernel
def _tried(number: int, contact: np.void) -> Branch:
    """One of the branches that the velocities of a contact admit.

    The box rule sees the forces of an instant. Where they and the drives grow from zero together it may choose a branch
    that ends at once; the right one is then the one in which time advances.
    """
    v_n, v_t, omega = contact["v_n"], contact["v_t"], contact["omega"]
    side = progress.side(contact)
    sense = side if number // 9 != 1 else -side  # it may matter whether a slip is tried before its lock or after that
    return Branch(
        sign_of(v_n) if v_n != 0.0 else number % 3 - 1,
        sign_of(v_t) if v_t != 0.0 else sense * (number // 3 % 3 - 1),
        sign_of(omega) if omega != 0.0 else side * (number // 9 - 1),
    )


@kernel
def _choose(body: Body, contact: np.void, step: np.void) -> None:
    """Choose the branch that a contact follows from here on, and write what depends on it."""
    trial = progress.trial(contact)
    branch = _tried(progress.TRIALS - trial, contact) if trial > 0 else _resolved(body, contact, step)
    progress.take_branch(branch, contact)


@kernel
def _standing(limits: Limits, flight: np.void, contact: np.void, step: np.void) -> int:
    """Status of a contact before a step: RUNNING if there is to be one."""
    if contact["gap_rate"] == 0.0 and contact["slip"] == 0.0 and contact["spin"] == 0.0:
        return records.JAMMED
    if contact["k_closing"] == math.inf and contact["gap_rate"] > 0.0:
        turning = contact["h"] * step["cosine"] * contact["omega"] * contact["omega"]
        return records.INCONSISTENT if contact["inward"] + turning > 0.0 else records.SEPARATED
    if flight["steps"] >= limits.max_steps or contact["stalled"] > progress.MOST_STALLED:
        return records.STEP_BUDGET
    return records.RUNNING


@kernel
def _prepare(slope: Incline, contact: np.void, step: np.void) -> None:
    """Write what the series of a step need, and the bounds of a locked normal force."""
    begin_step(contact, step)
    step["largest"], step["least"] = normal.bounds(contact, 0.0)
    if contact["gap_rate"] == 0.0:
        step["unit"] = progress.settled_unit(contact["size"], slope.gravity, contact["omega"])


@kernel
def _bound(limits: Limits, contact: np.void, step: np.void) -> int:
    """Find what is likely to end a step, and how long its series hold; return what ``bound_step`` does."""
    if contact["gap_rate"] != 0.0:
        expect(contact, step)
    else:
        step["expected"] = events.NOTHING
    if contact["k_closing"] == math.inf and not 0.0 <= step["normal"][0] <= contact["most_normal"]:
        return records.INCONSISTENT
    return progress.bound_step(limits, progress.MOST_UNITS, contact, step)


@kernel
def _turns_back(before: float, end: float, series: np.ndarray, event: int, contact: np.void, step: np.void) -> None:
    """Let a step end where a velocity has become zero, if it has changed its sign by the end of the step."""
    if before * end < 0.0:
        length = step["length"]
        at = locate(series, length * before / (before - end), length)
        if at > 0.0:
            step["length"], step["event"] = at, event
            complete(contact, step)


@kernel
def _foresee(contact: np.void, step: np.void) -> None:
    """Complete a step up to what is likely to end it, sought where it is expected and up to ``step["most"]``."""
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
def _forces(contact: np.void, step: np.void, t: float) -> tuple[float, float, float]:
    """Normal force, tangential force [N] and moment [N m] of a point during a step."""
    push = horner(step["normal"], t)
    force = contact["mu"] * push if contact["slip"] != 0.0 else horner(step["force"], t)
    moment = contact["rho"] * push if contact["spin"] != 0.0 else horner(step["moment"], t)
    return push, force, moment


@kernel
def write_contact(space: np.void, t: float, row: np.void) -> None:
    """Fill the forces of a row at a time of the step."""
    contact, second, step, second_step = space["contact"], space["second"], space["step"], space["second_step"]
    feature, slip, spin = int(contact["feature"]), int(contact["slip"]), int(contact["spin"])
    push, force, moment = _forces(contact, step, t)
    if contact["paired"] == 0.0:
        write_forces(row, push, force, moment, feature, slip, spin)
        write_corner(row, feature, push, force)
    else:
        push_2, force_2, moment_2 = _forces(second, second_step, t)
        if slip == 0 and spin == 0:  # only their sum is determined
            force, force_2 = force * push / (push + push_2), force * push_2 / (push + push_2)
        moment = rolling_part(moment + moment_2, contact["arm"] * push, second["arm"] * push_2)
        write_forces(row, push + push_2, force + force_2, moment, records.CHORD, slip, spin)
        write_corner(row, feature, push, force)
        write_corner(row, int(second["feature"]), push_2, force_2)
    write_slip(row, horner(step["v_t"], t), contact["friction"])


@kernel
def _sample_step(limits: Limits, flight: np.void, space: np.void, trajectory: np.ndarray) -> None:
    """Add rows over one step, both its ends included: forces may jump between it and the next."""
    contact, step = space["contact"], space["step"]
    h, r, shift = contact["h"], contact["r"], contact["shift"]
    unit, length = step["unit"], step["length"]
    rows = max(float(CONTACT_ROWS), np.ceil(length * unit / limits.sample_interval))
    for i in range(rows_to_write(rows + 1.0, flight, trajectory)):
        t = length * (i / rows)  # never beyond the step
        phi, omega = horner(step["phi"], t), horner(step["omega"], t)
        sine, cosine = sine_and_cosine(phi + shift)
        a, b = h * sine, r - h * cosine
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
        write_contact(space, t, row)


@kernel
def _look(body: Body, limits: Limits, flight: np.void, contact: np.void, step: np.void) -> int:
    """Choose the branch of a contact of one point, if it may change; return the status: RUNNING if a step follows."""
    orient(contact, step)
    if contact["undecided"] != 0.0:
        _choose(body, contact, step)
    return _standing(limits, flight, contact, step)


@kernel
def _step(body: Body, slope: Incline, limits: Limits, space: np.void) -> int:
    """Find the series of a step and its first event; return what ``bound_step`` does, or INCONSISTENT.

    The contact itself stays where it is.
    """
    contact, second, step, second_step = space["contact"], space["second"], space["step"], space["second_step"]
    paired = contact["paired"] != 0.0
    if paired:
        prepare_both(slope, space)
    else:
        _prepare(slope, contact, step)
    expand(space)
    if paired:
        bounded = complete_both(limits, space)
    else:
        bounded = _bound(limits, contact, step)
    if bounded != records.RUNNING and bounded != records.TIMEOUT:
        return bounded
    if not paired:
        _foresee(contact, step)
    foreseen = step["length"]
    events.first_event(body, space)
    if step["length"] < foreseen:  # something else happens before
        complete(contact, step)
        if paired:
            complete(second, second_step)
    return bounded


@kernel
def _feel(body: Body, contact: np.void, step: np.void, second: np.void) -> int:
    """Apply to a contact of one point what happens at the end of a step; return its status, RUNNING if it goes on."""
    status = progress.follow_event(body, contact, step)
    if status == records.BOTH_CORNERS and contact["k_closing"] < math.inf:
        # With both ends of a flat arc in the slope one point no longer says where the surfaces push.
        sunk = contact["feature"] == records.ARC and body.half_angle <= 0.5 * math.pi
        return records.RUNNING if not sunk and join(body, contact, second) else records.BURIED
    return status


@kernel
def follow(
    body: Body,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    space: np.void,
    trajectory: np.ndarray,
) -> int:
    """Follow a contact from touchdown to separation, rest or the end of the slope: docs/physics.md, section 5.

    The body touches with one point, or with two while both ends of its chord are down.

    Parameters
    ----------
    body, slope, limits
        See :mod:`sledenv.kernel.params`.
    flight : record of OUTCOME
        Whose contact it is; its steps and its rows of the trajectory are counted.
    space : record of SPACE
        Its ``contact`` holds the state at touchdown, overwritten by that at the end, and how the surfaces meet: the
        fields of CONTACT from those of :mod:`sledenv.kernel.normal` to ``most_normal``. Impulses and losses are added
        up. Rigid surfaces start at rest, without gap or gap rate, ``paired`` if they touch with two points.
    trajectory : ndarray of TRAJECTORY
        Rows are added while there is room; length 0 records nothing.

    Returns
    -------
    int
        SEPARATED, of rigid surfaces INCONSISTENT or BOTH_CORNERS; or the status with which the descent ends.
    """
    contact, second, step, second_step = space["contact"], space["second"], space["step"], space["second_step"]
    _begin(body, slope, limits, contact)
    if contact["paired"] != 0.0:
        join(body, contact, second)
    while True:
        status = records.RUNNING
        if contact["paired"] != 0.0:
            status = look_at_both(body, limits, flight, space)
        if contact["paired"] == 0.0 and status == records.RUNNING:
            status = _look(body, limits, flight, contact, step)
        if status != records.RUNNING:
            break
        flight["steps"] += 1
        space["work"] += 1.0
        bounded = _step(body, slope, limits, space)
        if bounded != records.RUNNING and bounded != records.TIMEOUT:
            status = bounded
            break
        if contact["undecided"] != 0.0 and step["length"] > LASTING:
            _note(contact, second)
        if trajectory.shape[0] > 0 and step["length"] > 0.0:
            _sample_step(limits, flight, space, trajectory)
        both = contact["paired"] != 0.0
        if both:
            loads = contact["arm"] * step["normal_impulse"], second["arm"] * second_step["normal_impulse"]
            step["moment_impulse"] = rolling_part(step["moment_impulse"], *loads)
        contact["undecided"] = 1.0 if progress.move_on(contact, step) else 0.0
        if both:
            status = feel_both(body, contact, second, step, second_step)
        else:
            status = _feel(body, contact, step, second)
        if status != records.RUNNING:
            break
        if contact["undecided"] == 0.0 and step["event"] == events.NOTHING and bounded == records.TIMEOUT:
            status = records.TIMEOUT
            break
        if step["event"] != events.NOTHING and step["event"] != events.MIDDLE_PASSED:
            contact["undecided"] = 1.0
    contact["held"] = 1.0
    if status == records.JAMMED or status == records.TUMBLED:  # no step has been made in this branch
        step["unit"], step["length"] = 1.0, 0.0
        expand(space)
    contact["phi"] += contact["turns"]
    contact["stored"] = normal.stored(contact)
    if contact["paired"] != 0.0:
        unite(contact, second)
    return status
