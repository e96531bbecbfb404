"""The paper's own method, explicit Euler with a fixed step and plain sign functions, kept as a reference."""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import straight
from sledenv.kernel import motion
from sledenv.kernel.descend import begin, book_losses, clear_sums, close_books, write_rebound
from sledenv.kernel.ground import arm_on, lay_ground, piece_at
from sledenv.kernel.outline import arc_at, arms, incline_of, whole_turns
from sledenv.kernel.params import ContactLaw, Incline, Limits, Slope, State, reader
from sledenv.kernel.progress import beside_now
from sledenv.kernel.records import FINISH, LOG_FULL, NON_FINITE, RUNNING, STEP_BUDGET, TIMEOUT, Written
from sledenv.kernel.trajectory import next_row, write_forces, write_slip, write_touch


class Point(NamedTuple):
    """A point of the body: where it is, how it moves and how the slope pushes it."""

    arc: int
    a: float  # [m] arms
    b: float  # [m]
    gap: float  # [m]
    v_n: float  # [m/s] gap rate
    v_t: float  # [m/s] slip velocity
    normal: float  # [N]
    bound: float  # [N] of friction
    force: float  # [N] along the slope
    moment: float  # [N m] of rolling resistance


NOWHERE: Final = Point(-1, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

ROW_WORK = 20.0  # [steps] work of a row of the trajectory

_slope_of = reader(Slope)


def _step(body: Any, slope: Any, flight: Any, normal: Any, force: Any, dt: Any) -> None:
    """Program of one step of the mass centre."""
    for name, lost in motion.losses(slope, flight, dt).items():
        setattr(flight, name, getattr(flight, name) + body.mass * lost)
    along, away = motion.accelerations(slope, flight.u, flight.v)
    flight.x, flight.y = flight.x + dt * flight.u, flight.y + dt * flight.v
    flight.u = flight.u + dt * (force / body.mass + along)
    flight.v = flight.v + dt * (normal / body.mass + away)


_step_on = straight(_step)


@kernel
def _point(body: np.void, law: ContactLaw, ground: np.void, flight: np.void, arc: int) -> Point:
    """Lowest point of an arc, and the forces on it: zero above the slope. Numbers of equations are the paper's."""
    a, b = arms(body, arc, flight["phi"] - whole_turns(flight["phi"]))
    omega = flight["omega"]
    gap, v_n, v_t = flight["y"] - b, flight["v"] - a * omega, flight["u"] + b * omega
    if not gap < 0.0:
        return Point(arc, a, b, gap, v_n, v_t, 0.0, 0.0, 0.0, 0.0)
    piece = piece_at(ground, flight["x"] - a)
    arm = arm_on(body, arc, ground, piece)
    normal = -law.stiffness * (1.0 - law.asymmetry * np.sign(v_n)) * gap  # (13)
    bound = ground["friction"][piece] * normal
    force, moment = -bound * np.sign(v_t), -arm * normal * np.sign(omega)  # (11)
    return Point(arc, a, b, gap, v_n, v_t, normal, bound, force, moment)


@kernel
def _turn_on(body: np.void, flight: np.void, p: Point, q: Point, moment_sign: float, dt: float) -> None:
    """Turn over one step of time under the forces on two points."""
    flight["phi"] += dt * flight["omega"]
    push, pull = p.a * p.normal + q.a * q.normal, p.b * p.force + q.b * q.force
    flight["omega"] += dt * (-push + moment_sign * pull + (p.moment + q.moment)) / body["inertia"]


@kernel
def _look(body: np.void, law: ContactLaw, flight: np.void, space: np.void) -> tuple[Point, Point]:
    """Write where the body is lowest and how it moves there. Return this point, and the one across a straight side."""
    arc = arc_at(body, flight["phi"] - whole_turns(flight["phi"]))
    lowest = _point(body, law, space["ground"], flight, arc)
    contact, point = space["contact"], space["points"][0]
    contact["time"], contact["x"], contact["phi"] = flight["t"], flight["x"], flight["phi"]
    point["arc"], contact["omega"] = arc, flight["omega"]
    point["gap"], point["v_n"], point["v_t"] = lowest.gap, lowest.v_n, lowest.v_t
    other, _, rises = beside_now(body, arc, flight["phi"])
    point["rising"] = 1.0 if rises else 0.0
    across = other >= 0 and (other == body["next"][arc] or other == body["previous"][arc]) and body["sinks"][arc] == 0.0
    return lowest, _point(body, law, space["ground"], flight, other) if across else NOWHERE


@kernel
def _status(slope: Incline, limits: Limits, flight: np.void, lowest: Point) -> int:
    """Whether the descent goes on, or why it ends here; the passage of the line is noted."""
    if not math.isfinite(lowest.gap + lowest.v_n + lowest.v_t):
        return NON_FINITE
    if flight["x"] >= slope.length and flight["t_line"] == math.inf:
        flight["t_line"], flight["u_line"] = flight["t"], flight["u"]
    if flight["x"] >= slope.length + limits.run_out:
        return FINISH
    if flight["t"] >= limits.max_time:
        return TIMEOUT
    return STEP_BUDGET if flight["steps"] >= limits.max_steps else RUNNING


@kernel
def _touch_down(flight: np.void, space: np.void, lowest: Point) -> None:
    """Keep the state at a touchdown, and set sums and peaks to zero."""
    contact, touchdown = space["contact"], space["touchdown"]
    touchdown["time"], touchdown["phi"], touchdown["x"] = flight["t"], flight["phi"], flight["x"]
    touchdown["u"], touchdown["v"], touchdown["omega"] = flight["u"], flight["v"], flight["omega"]
    touchdown["v_t"], touchdown["v_n"] = lowest.v_t, lowest.v_n
    touchdown["arc"], touchdown["a"], touchdown["b"] = lowest.arc, lowest.a, lowest.b
    clear_sums(contact)
    contact["peak_force"] = contact["peak_penetration"] = contact["side_touched"] = 0.0


@kernel
def _take_off(body: np.void, flight: np.void, rebound: np.void, space: np.void, lowest: Point) -> None:
    """Record a contact that has ended."""
    contact = space["contact"]
    write_rebound(body, space["touchdown"], contact, space["points"][0], lowest.a, lowest.b, rebound)
    flight["rebounds"] += 1
    book_losses(contact, flight)


@kernel
def _add_up(law: ContactLaw, contact: np.void, point: Point, dt: float) -> None:
    """Add up impulses and losses of a point over one step in contact, and keep peaks."""
    depth = -min(point.gap, 0.0)
    contact["peak_force"] = max(contact["peak_force"], point.normal)
    contact["peak_penetration"] = max(contact["peak_penetration"], depth)
    contact["normal_impulse"] += point.normal * dt
    contact["tangential_impulse"] += point.force * dt
    contact["rolling_impulse"] += point.moment * dt
    contact["sliding"] -= point.force * point.v_t * dt
    contact["rolling"] -= point.moment * contact["omega"] * dt
    if point.v_n > 0.0:
        contact["hysteresis"] += 2.0 * law.stiffness * law.asymmetry * depth * point.v_n * dt


@kernel
def _write_contact(body: np.void, contact: np.void, lowest: Point, other: Point, row: np.void) -> None:
    """Fill the forces of a row."""
    slip, spin = int(np.sign(lowest.v_t)), int(np.sign(contact["omega"]))
    part = int(contact["side_touched"] if other.gap < 0.0 else body["part"][lowest.arc])
    normal, force, moment = lowest.normal + other.normal, lowest.force + other.force, lowest.moment + other.moment
    write_forces(row, normal, force, moment, part, slip, spin)
    write_slip(row, lowest.v_t, lowest.bound + other.bound)
    write_touch(row, row["x"] - lowest.a, int(body["part"][lowest.arc]), lowest.normal, lowest.force)
    if other.gap < 0.0:
        write_touch(row, row["x"] - other.a, int(body["part"][other.arc]), other.normal, other.force)


@kernel
def _begin(launch: State, flight: np.void, point: np.void) -> bool:
    """Begin a descent, or go on with one; return whether the body has been in contact at the last step."""
    if flight["status"] == RUNNING and flight["steps"] > 0:
        return bool(point["gap"] < 0.0)
    begin(launch, flight)
    return False


@kernel
def _note_side(body: np.void, lowest: Point, other: Point, space: np.void) -> None:
    """Write which straight side is in the slope with both its ends, if one is."""
    if other.gap < 0.0:
        side = body["rising_side"] if space["points"][0]["rising"] != 0.0 else body["falling_side"]
        space["contact"]["side_touched"] = side[lowest.arc]


@kernel
def _move(
    body: np.void,
    law: ContactLaw,
    incline: Incline,
    limits: Limits,
    flight: np.void,
    space: np.void,
    points: tuple[Point, Point],
) -> None:
    """Move a descent by one step of time, under the forces on both points."""
    (lowest, other), dt = points, limits.step
    if lowest.gap < 0.0:
        _add_up(law, space["contact"], lowest, dt)
        _add_up(law, space["contact"], other, dt)
    _step_on(body, incline, flight, lowest.normal + other.normal, lowest.force + other.force, dt)
    _turn_on(body, flight, lowest, other, -1.0 if limits.printed_sign == 1.0 else 1.0, dt)
    flight["steps"] += 1
    flight["t"] = flight["steps"] * dt


def descend_euler(
    bodies: np.ndarray,
    law: ContactLaw,
    slopes: np.ndarray,
    launch: State,
    limits: Limits,
    written: Written,
    spaces: np.ndarray,
) -> None:
    """Simulate one descent by explicit Euler: paper equations (10)-(13) with gravity, docs/physics.md, section 2.

    While both ends of the chord are below the surface, each has a spring, friction and rolling resistance of its own.
    Events lie on the grid of steps: errors are of first order, and a body at rest chatters. So it neither jams nor
    settles on its chord. A call returns once it has done ``limits.most_work``, with status RUNNING. The next call then
    goes on where this one has stopped.

    Parameters
    ----------
    bodies : ndarray of BODY, shape (1,)
    slopes : ndarray, one row
        Fields of Slope and of its zones.
    law, launch, limits
        See :mod:`sledenv.kernel.params`. ``limits.step`` is the time step [s]; ``limits.printed_sign`` = 1 takes the
        moment of friction with the paper's printed sign, which creates energy.
    written : Written
        Its flight is zeros or a descent that has ended, to begin a descent; the descent itself, to go on with it. Its
        log has at least ``limits.max_rebounds`` records.
    spaces : ndarray of SPACE, shape (1,)
        Work space. It may be that of a descent that has ended.
    """
    body, flight, space = bodies[0], written.flights[0], spaces[0]
    log, trajectory = written.logs[0], written.trajectory
    incline = incline_of(_slope_of(slopes, 0))
    lay_ground(law, slopes[0], space["ground"])
    stride = max(1, round(limits.sample_interval / limits.step))
    touching, work = _begin(launch, flight, space["points"][0]), 0.0
    while True:
        lowest, other = _look(body, law, flight, space)
        status, inside = _status(incline, limits, flight, lowest), lowest.gap < 0.0
        if inside and not touching:
            _touch_down(flight, space, lowest)
        _note_side(body, lowest, other, space)
        if touching and (not inside or status != RUNNING):
            _take_off(body, flight, log[flight["rebounds"]], space, lowest)
            if status == RUNNING and flight["rebounds"] >= limits.max_rebounds:
                status = LOG_FULL
        touching = inside
        if trajectory.shape[0] > 0 and (flight["steps"] % stride == 0 or status != RUNNING):
            row = next_row(trajectory, flight)
            work += ROW_WORK
            if inside:
                _write_contact(body, space["contact"], lowest, other, row)
        if status != RUNNING:
            break
        _move(body, law, incline, limits, flight, space, (lowest, other))
        work += 1.0
        if work >= limits.most_work:
            break
    flight["status"] = status
    deep = min(lowest.gap, 0.0) ** 2 + min(other.gap, 0.0) ** 2
    flight["stored"] = 0.5 * law.stiffness * (1.0 + law.asymmetry) * deep
    close_books(body, incline, launch, flight)
