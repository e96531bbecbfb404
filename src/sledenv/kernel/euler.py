"""The paper's own method, explicit Euler with a fixed step and plain sign functions, kept as a reference."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.kernel import motion
from sledenv.kernel.descend import begin, book_losses, clear_sums, close_books, write_rebound
from sledenv.kernel.geometry import arms, feature_at, has_corners, incline_of, whole_turns
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, ContactLaw, Incline, Limits, Slope, State
from sledenv.kernel.records import ARC, FINISH, LOG_FULL, NON_FINITE, RUNNING, STEP_BUDGET, TIMEOUT, TUMBLED
from sledenv.kernel.trace import straight
from sledenv.kernel.trajectory import next_row, write_forces, write_motion


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
def _look(body: Body, flight: np.void, contact: np.void) -> tuple[float, float]:
    """Write where the lowest point of the body is and how it moves; return its arms ``a``, ``b`` [m]."""
    local = flight["phi"] - whole_turns(flight["phi"])
    feature = feature_at(body, local)
    a, b = arms(body, feature, local)
    contact["time"], contact["x"], contact["phi"] = flight["t"], flight["x"], flight["phi"]
    contact["feature"] = feature
    contact["gap"] = flight["y"] - b
    contact["v_n"] = flight["v"] - a * flight["omega"]
    contact["v_t"] = flight["u"] + b * flight["omega"]
    contact["omega"] = flight["omega"]
    return a, b


@kernel
def _status(body: Body, slope: Incline, limits: Limits, flight: np.void, contact: np.void) -> int:
    """Whether the descent goes on, or why it ends here."""
    if not math.isfinite(contact["gap"] + contact["v_n"] + contact["v_t"]):
        return NON_FINITE
    if contact["x"] >= slope.length:
        return FINISH
    if has_corners(body) and contact["feature"] != ARC:
        local = contact["phi"] - whole_turns(contact["phi"])
        both_corners = 2.0 * body.radius * math.sin(body.half_angle)
        if contact["gap"] + both_corners * abs(math.sin(local)) < 0.0:  # the other corner is in the slope too
            return TUMBLED
    if flight["t"] >= limits.max_time:
        return TIMEOUT
    return STEP_BUDGET if flight["steps"] >= limits.max_steps else RUNNING


@kernel
def _touch_down(flight: np.void, contact: np.void) -> None:
    """Keep the state at a touchdown; nothing has been added up yet."""
    contact["time_before"], contact["phi_before"] = contact["time"], contact["phi"]
    contact["u_before"], contact["v_before"] = flight["u"], flight["v"]
    contact["v_t_before"], contact["omega_before"] = contact["v_t"], contact["omega"]
    contact["feature_before"] = contact["feature"]
    clear_sums(contact)
    contact["on_chord"] = 0.0


@kernel
def _take_off(body: Body, flight: np.void, rebound: np.void, contact: np.void, a: float, b: float) -> None:
    """Record a contact that has ended."""
    write_rebound(body, rebound, contact, a, b)
    flight["rebounds"] += 1
    book_losses(contact, flight)


@kernel
def _forces(law: ContactLaw, contact: np.void) -> tuple[float, float, float]:
    """Normal force [N], force along the slope [N] and rolling moment [N m]; (10)-(13) are the paper's equations."""
    arm = law.rolling_arm if contact["feature"] == ARC else law.corner_rolling_arm
    normal = -law.stiffness * (1.0 - law.asymmetry * np.sign(contact["v_n"])) * contact["gap"]  # (13)
    return normal, -law.friction * normal * np.sign(contact["v_t"]), -arm * normal * np.sign(contact["omega"])  # (11)


@kernel
def _add_up(law: ContactLaw, contact: np.void, normal: float, force: float, moment: float, dt: float) -> None:
    """Add up impulses and losses over one step in contact."""
    contact["normal_impulse"] += normal * dt
    contact["tangential_impulse"] += force * dt
    contact["rolling_impulse"] += moment * dt
    contact["sliding"] -= force * contact["v_t"] * dt
    contact["rolling"] -= moment * contact["omega"] * dt
    if contact["v_n"] > 0.0:
        contact["hysteresis"] -= 2.0 * law.stiffness * law.asymmetry * contact["gap"] * contact["v_n"] * dt


@kernel
def descend_euler(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    launch: State,
    limits: Limits,
    log: np.ndarray,
    contacts: np.ndarray,
    trajectory: np.ndarray,
    outcomes: np.ndarray,
) -> None:
    """Simulate one descent by explicit Euler: paper equations (10)-(13) with gravity, docs/physics.md, section 2.

    Its events lie on the grid of steps: errors are of first order, and a body at rest chatters.

    Parameters
    ----------
    body, law, slope, launch, limits
        See :mod:`sledenv.kernel.params`. ``limits.step`` is the time step [s]; ``limits.printed_sign`` = 1 takes the
        moment of friction with the paper's printed sign, which creates energy.
    log : ndarray of REBOUND
        As long as ``limits.max_rebounds`` or longer.
    contacts : ndarray of CONTACT, shape (1,)
        Work space.
    trajectory : ndarray of TRAJECTORY
        Rows are written while there is room; ``outcomes[0]["samples"]`` tells how many were needed.
    outcomes : ndarray of OUTCOME, shape (1,)
        Overwritten.
    """
    flight, contact = outcomes[0], contacts[0]
    incline = incline_of(slope)
    dt = limits.step
    moment_sign = -1.0 if limits.printed_sign == 1.0 else 1.0
    stride = max(1, round(limits.sample_interval / dt))
    begin(launch, flight)
    touching = False
    while True:
        a, b = _look(body, flight, contact)
        status = _status(body, incline, limits, flight, contact)
        inside = contact["gap"] < 0.0
        if inside and not touching:
            _touch_down(flight, contact)
        if touching and (not inside or status != RUNNING):
            _take_off(body, flight, log[flight["rebounds"]], contact, a, b)
            if status == RUNNING and flight["rebounds"] >= limits.max_rebounds:
                status = LOG_FULL
        touching = inside
        normal, force, moment = _forces(law, contact) if inside else (0.0, 0.0, 0.0)
        if trajectory.shape[0] > 0 and (flight["steps"] % stride == 0 or status != RUNNING):
            row = next_row(trajectory, flight)
            x, y, phi = flight["x"], flight["y"], flight["phi"]
            write_motion(row, flight["t"], x, y, phi, flight["u"], flight["v"], flight["omega"])
            slip = int(np.sign(contact["v_t"])) if inside else 0
            spin = int(np.sign(contact["omega"])) if inside else 0
            write_forces(row, normal, force, moment, int(contact["feature"]) if inside else 0, slip, spin)
        if status != RUNNING:
            break
        if inside:
            _add_up(law, contact, normal, force, moment, dt)
        _step_on(body, incline, flight, normal, force, dt)
        flight["phi"] += dt * flight["omega"]
        flight["omega"] += dt * (-a * normal + moment_sign * b * force + moment) / body.inertia
        flight["steps"] += 1
        flight["t"] = flight["steps"] * dt
    flight["status"] = status
    flight["stored"] = 0.5 * law.stiffness * (1.0 + law.asymmetry) * min(contact["gap"], 0.0) ** 2
    close_books(body, incline, launch, flight)
