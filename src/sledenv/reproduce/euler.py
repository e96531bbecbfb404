"""The paper's own method, explicit Euler with a fixed step and plain sign functions: docs/physics.md, section 2."""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple, get_args

import numba
import numpy as np

from sledenv.simulation.bodies import Body
from sledenv.simulation.checks import checked_descent
from sledenv.simulation.lanes import new_log, new_trajectory
from sledenv.simulation.outcomes import RECORDS, Descent, Record, descent_of
from sledenv.simulation.records import (
    FINISH,
    LOG_FULL,
    NON_FINITE,
    OUTCOME,
    RUNNING,
    TIMEOUT,
    TRAJECTORY,
    Mode,
)
from sledenv.simulation.rules import POSITIVE, checked, checked_choice, made
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import DEFAULT, changed

FrictionSign = Literal["dissipative", "printed"]

_STEPS = 1_000_000  # of one call, some hundredths of a second: an interrupt takes effect between two calls
_FIRST_ROWS = 4096  # of a trajectory, which grows
_TURN: Final = 2.0 * math.pi
_NEARLY_STUCK: Final = 0.05  # of the entry speed
_SLIDE_ROLL, _STOP_ROLL, _SLIDE, _STUCK, _SPIN_REVERSAL, _SLIP_REVERSAL, _DOUBLE_REVERSAL = map(int, Mode)

_compiled = numba.njit(cache=True, error_model="numpy")


class _Given(NamedTuple):
    """Numbers that stay the same in a descent."""

    stiffness: float  # [N/m]
    asymmetry: float  # [-]
    friction: float  # [-]
    arc_arm: float  # [m] rolling arms of arcs
    corner_arm: float  # [m] and of corners
    downhill: float  # [m/s^2] gravity along the slope,
    inward: float  # [m/s^2] and along the inward normal
    length: float  # [m] where the descent finishes
    max_time: float  # [s]
    max_rebounds: int
    step: float  # [s]
    moment_sign: float  # 1 of friction as it is, -1 as the paper prints it
    stride: int  # steps between two rows of the trajectory


class _Point(NamedTuple):
    """A point of the body: where it is, how it moves and how the slope pushes it."""

    a: float  # [m] arms: it lies at (-a, -b) from the mass centre
    b: float  # [m]
    gap: float  # [m]
    v_n: float  # [m/s] gap rate
    v_t: float  # [m/s] slip velocity
    normal: float  # [N]
    bound: float  # [N] of friction
    force: float  # [N] along the slope
    moment: float  # [N m] of rolling resistance


# State of a contact between two steps, besides the sums in its rebound.
_CONTACT: Final = np.dtype([("touching", "i8"), ("slip", "f8")])  # [m/s] slip velocity at the touchdown


def euler_descent(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    launch: State,
    *,
    step: float = 2.5e-7,
    friction_sign: FrictionSign = "dissipative",
    max_time: float = DEFAULT.max_time,
    max_rebounds: int = DEFAULT.max_rebounds,
    record: Record = "rebounds",
    sample_interval: float = DEFAULT.sample_interval,
) -> Descent:
    """Simulate one descent by the paper's method: its equations (10)-(13) with gravity, docs/physics.md, section 2.

    There is one contact point, the lowest of the body: one that lies on a straight side rattles from end to end. Events
    lie on the grid of steps: errors are of first order, and a body at rest chatters. So it neither jams nor settles on
    its chord. An interrupt (Ctrl-C) takes effect within a fraction of a second.

    Parameters
    ----------
    body, law, slope, launch
        As for :func:`sledenv.simulate`.
    step : float
        Time step [s], > 0.
    friction_sign : {"dissipative", "printed"}
        "printed" gives the moment of friction the sign printed in the paper's (10), which creates energy.
    max_time : float
        Longest simulated time [s], > 0.
    max_rebounds : int
        Number of rebounds after which the descent ends with status "log_full".
    record : {"rebounds", "trajectory"}
        "trajectory" also records positions, velocities and contact forces.
    sample_interval : float
        Time [s] between two rows of the trajectory, rounded to a whole number of steps.

    Returns
    -------
    Descent
        Its ``settings`` are None, as :func:`sledenv.simulate` does not repeat it.

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range; nothing is simulated then.
    MemoryError
        If ``max_rebounds`` records, or the rows of the trajectory, take more memory than there is.
    """
    settings = changed(None, max_time=max_time, max_rebounds=max_rebounds, sample_interval=sample_interval)
    step = checked("euler_descent", "step", step, POSITIVE)
    checked_choice("friction_sign", friction_sign, get_args(FrictionSign))
    checked_choice("record", record, RECORDS)
    law = made("law", ContactLaw, law)
    checked_given = checked_descent(body, law, slope, launch, settings)
    body, slope, launch = checked_given.body, checked_given.slope, checked_given.launch
    if slope.profile or slope.zones:
        raise ValueError("slope: must be without profile and zones, Euler's method follows a plane of one surface")
    given = _Given(
        stiffness=law.stiffness,
        asymmetry=law.asymmetry,
        friction=law.friction,
        arc_arm=law.rolling_arm,
        corner_arm=law.corner_rolling_arm,
        downhill=slope.gravity * math.sin(slope.angle),
        inward=slope.gravity * math.cos(slope.angle),
        length=slope.length,
        max_time=settings.max_time,
        max_rebounds=settings.max_rebounds,
        step=step,
        moment_sign=1.0 if friction_sign == "dissipative" else -1.0,
        stride=max(1, round(settings.sample_interval / step)),
    )
    shape = body.record[0]
    log, outcome, contact = new_log(settings.max_rebounds), np.zeros(1, OUTCOME)[0], np.zeros(1, _CONTACT)[0]
    trajectory = np.zeros(_FIRST_ROWS if record == "trajectory" else 0, TRAJECTORY)
    outcome["t_on_chord"] = outcome["x_on_chord"] = outcome["t_line"] = math.inf
    for name, value in zip(State._fields, launch, strict=True):
        outcome[name] = value
    while outcome["status"] == RUNNING:
        if record == "trajectory" and outcome["samples"] == len(trajectory):
            longer = new_trajectory(2 * len(trajectory), settings.sample_interval)
            longer[: len(trajectory)] = trajectory
            trajectory = longer
        _follow(shape, given, outcome, log, contact, trajectory, _STEPS)
    _close_books(shape, given, launch, outcome)
    return descent_of(body, law, slope, launch, outcome, log, trajectory, None)


def _close_books(body: np.void, given: _Given, launch: State, outcome: np.void) -> None:
    """Write the energy ledger of a descent that has ended: docs/physics.md, section 9."""
    found = State.found(tuple(float(outcome[name]) for name in State._fields))
    outcome["initial"] = sum(_energies(body, given, launch))
    outcome["kinetic"], outcome["potential"] = _energies(body, given, found)
    drop = max(0.0, launch.y - float(body["lowest"]))
    along = max(0.0, (given.length if outcome["t_line"] < math.inf else found.x) - launch.x)
    kinetic, _ = _energies(body, given, launch)
    outcome["supplied"] = kinetic + float(body["mass"]) * (drop * given.inward + along * given.downhill)
    if not math.isfinite(sum(found) + float(outcome["kinetic"] + outcome["initial"])):
        outcome["status"] = NON_FINITE


def _energies(body: np.void, given: _Given, state: State) -> tuple[float, float]:
    """Kinetic and potential energy [J] in a state."""
    mass, inertia = float(body["mass"]), float(body["inertia"])
    kinetic = 0.5 * mass * (state.u * state.u + state.v * state.v) + 0.5 * inertia * state.omega * state.omega
    return kinetic, mass * (state.y * given.inward - state.x * given.downhill)


@_compiled
def _follow(
    body: np.void,
    given: _Given,
    flight: np.void,
    log: np.ndarray,
    contact: np.void,
    trajectory: np.ndarray,
    most: int,
) -> None:
    """Follow a descent for so many steps at most, to its end, or until there is no room for another row."""
    rows = trajectory.shape[0]
    for _ in range(most):
        if flight["samples"] == rows and rows > 0:
            return
        arc, lowest = _lowest(body, given, flight)
        status, inside = _status(given, flight, lowest), lowest.gap < 0.0
        rebound = log[min(flight["rebounds"], given.max_rebounds - 1)]
        if inside and contact["touching"] == 0:
            _touch_down(body, flight, contact, lowest, arc, rebound)
        if contact["touching"] != 0 and (not inside or status != RUNNING):
            _take_off(body, flight, contact, lowest, rebound)
            if status == RUNNING and flight["rebounds"] >= given.max_rebounds:
                status = LOG_FULL
        contact["touching"] = 1 if inside else 0
        if rows > 0 and (flight["steps"] % given.stride == 0 or status != RUNNING):
            row = trajectory[flight["samples"]]
            flight["samples"] += 1
            _write_motion(flight, row)
            if inside:
                _write_forces(body, flight, lowest, arc, row)
        flight["status"] = status
        if status != RUNNING:
            flight["stored"] = 0.5 * given.stiffness * (1.0 + given.asymmetry) * min(lowest.gap, 0.0) ** 2
            return
        if inside:
            _add_up(given, flight, lowest, rebound)
        _move(body, given, flight, lowest)


@_compiled
def _lowest(body: np.void, given: _Given, flight: np.void) -> tuple[int, _Point]:
    """Return the lowest arc and its lowest point, with the forces on it: numbers of equations are the paper's.

    Where two arcs meet, the larger one is taken; of two equal ones the one at the larger angle, as in the mirror.
    """
    local = flight["phi"] - _TURN * np.rint(flight["phi"] / _TURN)
    begin, radius, last = body["begin"], body["r"], int(body["count"]) - 1
    arc = 0
    while arc < last and local > begin[arc + 1]:
        arc += 1
    after = arc
    while after < last and local == begin[after + 1]:
        after += 1
    if not (radius[arc] > radius[after] or (radius[arc] == radius[after] and math.copysign(1.0, local) < 0.0)):
        arc = after
    sine, cosine = math.sin(local), math.cos(local)
    along, across, r, omega = body["along"][arc], body["across"][arc], radius[arc], flight["omega"]
    a, level = along * sine + across * cosine, along * cosine - across * sine
    b = r - level
    if r > body["size"] and level > 0.0:  # r and level are large and nearly equal
        h = body["h"][arc]
        b = (r - h) + a * a / (h + level)
    gap, v_n, v_t = flight["y"] - b, flight["v"] - a * omega, flight["u"] + b * omega
    if not gap < 0.0:
        return arc, _Point(a, b, gap, v_n, v_t, 0.0, 0.0, 0.0, 0.0)
    arm = given.corner_arm if body["corner"][arc] != 0.0 else given.arc_arm
    normal = -given.stiffness * (1.0 - given.asymmetry * np.sign(v_n)) * gap  # (13)
    bound = given.friction * normal
    force, moment = -bound * np.sign(v_t), -arm * normal * np.sign(omega)  # (11)
    return arc, _Point(a, b, gap, v_n, v_t, normal, bound, force, moment)


@_compiled
def _status(given: _Given, flight: np.void, lowest: _Point) -> int:
    """Whether the descent goes on, or why it ends here."""
    if not math.isfinite(lowest.gap + lowest.v_n + lowest.v_t):
        return NON_FINITE
    if flight["x"] >= given.length:
        flight["t_line"], flight["u_line"] = flight["t"], flight["u"]
        return FINISH
    return TIMEOUT if flight["t"] >= given.max_time else RUNNING


@_compiled
def _move(body: np.void, given: _Given, flight: np.void, p: _Point) -> None:
    """Move a body by one step of time, under the forces on its lowest point."""
    dt, mass = given.step, body["mass"]
    flight["x"] += dt * flight["u"]
    flight["y"] += dt * flight["v"]
    flight["phi"] += dt * flight["omega"]
    flight["u"] += dt * (p.force / mass + given.downhill)
    flight["v"] += dt * (p.normal / mass - given.inward)
    turning = -p.a * p.normal + given.moment_sign * p.b * p.force + p.moment
    flight["omega"] += dt * turning / body["inertia"]  # (10)
    flight["steps"] += 1
    flight["t"] = flight["steps"] * dt


@_compiled
def _touch_down(body: np.void, flight: np.void, contact: np.void, lowest: _Point, arc: int, rebound: np.void) -> None:
    """Begin the record of a contact."""
    contact["slip"] = lowest.v_t
    rebound["t_touchdown"], rebound["x_contact"] = flight["t"], flight["x"] - lowest.a
    rebound["u_before"], rebound["v_before"], rebound["omega_before"] = flight["u"], flight["v"], flight["omega"]
    rebound["feature"] = int(body["part"][arc])


@_compiled
def _add_up(given: _Given, flight: np.void, point: _Point, rebound: np.void) -> None:
    """Add up impulses and losses of a point over one step in contact, and keep peaks."""
    dt, depth = given.step, -min(point.gap, 0.0)
    rebound["peak_force"] = max(rebound["peak_force"], point.normal)
    rebound["peak_penetration"] = max(rebound["peak_penetration"], depth)
    rebound["normal_impulse"] += point.normal * dt
    rebound["tangential_impulse"] += point.force * dt
    rebound["rolling_impulse"] += point.moment * dt
    rebound["loss_sliding"] -= point.force * point.v_t * dt
    rebound["loss_rolling"] -= point.moment * flight["omega"] * dt
    if point.v_n > 0.0:
        rebound["loss_hysteresis"] += 2.0 * given.stiffness * given.asymmetry * depth * point.v_n * dt


@_compiled
def _take_off(body: np.void, flight: np.void, contact: np.void, lowest: _Point, rebound: np.void) -> None:
    """Complete the record of a contact that has ended, and book what it has lost."""
    u, omega = flight["u"], flight["omega"]
    rebound["t"], rebound["x"], rebound["phi"] = flight["t"], flight["x"], flight["phi"]
    rebound["duration"] = flight["t"] - rebound["t_touchdown"]
    rebound["u_after"], rebound["v_after"], rebound["omega_after"] = u, flight["v"], omega
    rebound["mode"] = _mode(contact["slip"], rebound["omega_before"], lowest.v_t, omega)
    entry = math.sqrt(rebound["u_before"] ** 2 + rebound["v_before"] ** 2)
    if u == 0.0 and omega == 0.0:
        rebound["stuck"] = 2
    elif max(abs(u), body["size"] * abs(omega)) < _NEARLY_STUCK * entry:
        rebound["stuck"] = 1
    flight["hysteresis"] += rebound["loss_hysteresis"]
    flight["sliding"] += rebound["loss_sliding"]
    flight["rolling"] += rebound["loss_rolling"]
    flight["rebounds"] += 1


@_compiled
def _mode(slip_before: float, omega_before: float, slip: float, omega: float) -> int:
    """Mode code of a contact from the slip velocity and the spin at its two ends: docs/physics.md, section 3."""
    if slip == 0.0:
        return _STUCK if omega == 0.0 else _STOP_ROLL
    if omega == 0.0:
        return _SLIDE
    if slip_before * slip < 0.0:
        return _DOUBLE_REVERSAL if omega_before * omega < 0.0 else _SLIP_REVERSAL
    return _SPIN_REVERSAL if omega_before * omega < 0.0 else _SLIDE_ROLL


@_compiled
def _write_motion(flight: np.void, row: np.void) -> None:
    """Fill the time and the motion of a row."""
    row["t"], row["x"], row["y"], row["phi"] = flight["t"], flight["x"], flight["y"], flight["phi"]
    row["u"], row["v"], row["omega"] = flight["u"], flight["v"], flight["omega"]


@_compiled
def _write_forces(body: np.void, flight: np.void, point: _Point, arc: int, row: np.void) -> None:
    """Fill the contact forces of a row, and where they act."""
    row["normal"], row["tangential"], row["rolling"] = point.normal, point.force, point.moment
    row["feature"] = int(body["part"][arc])
    row["slip"], row["spin"] = int(np.sign(point.v_t)), int(np.sign(flight["omega"]))
    row["slip_velocity"], row["friction_ratio"] = point.v_t, point.force / point.bound if point.bound > 0.0 else 0.0
    contact = row["contacts"][0]
    contact["x"], contact["normal_y"], contact["part"] = flight["x"] - point.a, 1.0, row["feature"]
    contact["normal"], contact["tangential"] = point.normal, point.force
    row["touching"] = 1
