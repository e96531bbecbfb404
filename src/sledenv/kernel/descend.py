"""The loop that is the dataflow: flight, touchdown, contact, rebound, again and again, until the descent ends."""

from __future__ import annotations

import math

import numpy as np

from sledenv.kernel.chord import NOW_ROWS
from sledenv.kernel.chord import ROWS as CHORD_ROWS
from sledenv.kernel.flight import arrive_at, finish_time, touchdown_time
from sledenv.kernel.geometry import arms, incline_of, lowest_support, whole_turns
from sledenv.kernel.jit import allocating, kernel
from sledenv.kernel.laws import Law, touch
from sledenv.kernel.params import Body, Incline, Limits, Slope, State
from sledenv.kernel.records import CHORD, FINISH, LOG_FULL, NON_FINITE, RUNNING, TIMEOUT
from sledenv.kernel.rows import WIDTH, table
from sledenv.kernel.series import ROWS, Z_ROWS
from sledenv.kernel.state import (
    ARM_A,
    ARM_B,
    FEATURE,
    GAP,
    HYSTERESIS,
    IMPULSE_N,
    IMPULSE_R,
    IMPULSE_T,
    OMEGA,
    ON_CHORD,
    PHI,
    ROLLING,
    SLIDING,
    STATE_SIZE,
    STORED,
    TIME,
    V_N,
    V_T,
    X,
)
from sledenv.kernel.trajectory import add_sample

SLIDE_ROLL, STOP_ROLL, SLIDE, STUCK, SPIN_REVERSAL, SLIP_REVERSAL, DOUBLE_REVERSAL = range(1, 8)
NEARLY_STUCK = 0.05  # of the entry speed


@kernel
def contact_mode(slip_before: float, omega_before: float, slip: float, omega: float) -> int:
    """Mode code of a contact from the slip velocity and the spin at its two ends: docs/physics.md, section 3."""
    slip_reversed = slip_before * slip < 0.0
    spin_reversed = omega_before * omega < 0.0
    if slip == 0.0:
        return STUCK if omega == 0.0 else STOP_ROLL
    if omega == 0.0:
        return SLIDE
    if slip_reversed:
        return DOUBLE_REVERSAL if spin_reversed else SLIP_REVERSAL
    return SPIN_REVERSAL if spin_reversed else SLIDE_ROLL


@kernel
def stuck_code(body: Body, entry_speed: float, u: float, omega: float) -> int:
    """2 if the body has neither velocity along the slope nor spin, 1 if both are below 5 % of the entry speed."""
    if u == 0.0 and omega == 0.0:
        return 2
    rim = max(body.radius, body.eccentricity) * abs(omega)
    return 1 if max(abs(u), rim) < NEARLY_STUCK * entry_speed else 0


@kernel
def fly(
    slope: Incline,
    limits: Limits,
    start: float,
    duration: float,
    x: float,
    y: float,
    phi: float,
    u: float,
    v: float,
    omega: float,
    trajectory: np.ndarray,
    samples: int,
) -> int:
    """Add the rows of one flight to the trajectory, its start included; return the number of rows needed."""
    downhill, inward = slope.downhill, slope.inward
    rows = max(1, math.ceil(duration / limits.sample_interval))
    for i in range(rows):
        t = duration * i / rows
        samples = add_sample(
            trajectory,
            samples,
            start + t,
            x + t * (u + 0.5 * downhill * t),
            y + t * (v - 0.5 * inward * t),
            phi + omega * t,
            u + downhill * t,
            v - inward * t,
            omega,
            0.0,
            0.0,
            0.0,
            0,
            0,
            0,
        )
    return samples


@kernel
def energy(body: Body, slope: Incline, y: float, x: float, u: float, v: float, omega: float) -> tuple[float, float]:
    """Kinetic and potential energy [J]."""
    kinetic = 0.5 * body.mass * (u * u + v * v) + 0.5 * body.inertia * omega * omega
    downhill, inward = slope.downhill, slope.inward
    return kinetic, body.mass * (y * inward - x * downhill)


@kernel
def begin(launch: State, flight: np.void) -> None:
    """Put a flight at its launch: nothing touched, nothing lost."""
    flight["status"] = RUNNING
    flight["rebounds"] = 0
    flight["samples"] = 0
    flight["steps"] = 0
    flight["t"] = 0.0
    flight["x"] = launch.x
    flight["y"] = launch.y
    flight["phi"] = launch.phi
    flight["u"] = launch.u
    flight["v"] = launch.v
    flight["omega"] = launch.omega
    flight["trim"] = 0.0
    flight["stored"] = 0.0
    flight["hysteresis"] = 0.0
    flight["sliding"] = 0.0
    flight["rolling"] = 0.0
    flight["rotor"] = 0.0
    flight["work"] = 0.0
    flight["absorbed"] = 0.0


@kernel
def trim(body: Body, rotor_inertia: float, flight: np.void, spin: float) -> None:
    """Let the rider's rotor lend ``spin`` [rad/s] to the body in flight: docs/physics.md, section 9.

    Parameters
    ----------
    body : Body
    rotor_inertia : float
        Moment of inertia of the rotor [kg m^2], > 0; the same throughout a descent.
    flight : record of OUTCOME
        Where the descent is, see :func:`hop`.
    spin : float
        What the body spins faster than with the rotor at rest [rad/s].
    """
    change = spin - flight["trim"]
    if change != 0.0:  # or a spin of -0.0 would lose its sign
        omega = flight["omega"]
        rotor = 0.5 * (body.inertia * spin) ** 2 / rotor_inertia
        done = body.inertia * change * (omega + 0.5 * change) + rotor - flight["rotor"]
        flight["omega"] = omega + change
        flight["trim"] = spin
        flight["rotor"] = rotor
        if done > 0.0:
            flight["work"] += done
        else:
            flight["absorbed"] -= done


@kernel
def close_books(body: Body, slope: Incline, launch: State, flight: np.void) -> None:
    """Bring the energy ledger up to the state of a flight: docs/physics.md, section 9."""
    x, y, u, v, omega = flight["x"], flight["y"], flight["u"], flight["v"], flight["omega"]
    kinetic, potential = energy(body, slope, launch.y, launch.x, launch.u, launch.v, launch.omega)
    drop = max(0.0, launch.y - lowest_support(body))
    along = max(0.0, x - launch.x)
    flight["initial"] = kinetic + potential
    downhill, inward = slope.downhill, slope.inward
    flight["supplied"] = kinetic + body.mass * (drop * inward + along * downhill) + flight["work"]
    flight["kinetic"], flight["potential"] = energy(body, slope, y, x, u, v, omega)
    finite = math.isfinite(x + y + flight["phi"] + u + v + omega + flight["kinetic"] + flight["initial"])
    if flight["status"] != RUNNING and not finite:
        flight["status"] = NON_FINITE


@kernel
def write_rebound(
    body: Body,
    rebound: np.void,
    before: np.ndarray,
    state: np.ndarray,
    feature: int,
    b: float,
    a: float,
    u: float,
    v: float,
) -> None:
    """Fill one rebound record from the contact states at touchdown and at separation."""
    u_after = state[V_T] - b * state[OMEGA]
    rebound["t"] = state[TIME]
    rebound["x"] = state[X]
    rebound["phi"] = state[PHI]
    rebound["duration"] = state[TIME] - before[TIME]
    rebound["feature"] = CHORD if state[ON_CHORD] != 0.0 else feature
    rebound["mode"] = contact_mode(before[V_T], before[OMEGA], state[V_T], state[OMEGA])
    rebound["normal_impulse"] = state[IMPULSE_N]
    rebound["tangential_impulse"] = state[IMPULSE_T]
    rebound["rolling_impulse"] = state[IMPULSE_R]
    rebound["u_before"] = u
    rebound["v_before"] = v
    rebound["omega_before"] = before[OMEGA]
    rebound["u_after"] = u_after
    rebound["v_after"] = state[V_N] + a * state[OMEGA]
    rebound["omega_after"] = state[OMEGA]
    rebound["loss_hysteresis"] = state[HYSTERESIS]
    rebound["loss_sliding"] = state[SLIDING]
    rebound["loss_rolling"] = state[ROLLING]
    rebound["stuck"] = stuck_code(body, math.sqrt(u * u + v * v), u_after, state[OMEGA])


@allocating
def work_space() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Arrays that :func:`hop` works in; it may get the same ones again and again."""
    tables, told = table(ROWS + CHORD_ROWS, WIDTH), np.zeros(Z_ROWS + NOW_ROWS)  # of a contact, and of the chord
    return tables, told, np.zeros(STATE_SIZE), np.zeros(STATE_SIZE)


@kernel
def arrive(
    body: Body,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    touchdown: float,
    state: np.ndarray,
    before: np.ndarray,
    trajectory: np.ndarray,
) -> int:
    """Move a flight to its touchdown, or to whatever ends it before; return its status, RUNNING at a touchdown.

    Arguments are those of :func:`land`; the state of the contact is written to ``state`` and to ``before``.
    """
    t, x, y, phi = flight["t"], flight["x"], flight["y"], flight["phi"]
    u, v, omega = flight["u"], flight["v"], flight["omega"]
    status = RUNNING
    left = limits.max_time - t
    duration = touchdown
    finish = finish_time(x, u, slope.downhill, slope.length)
    if finish <= min(duration, left):
        duration = finish
        status = FINISH
    elif not duration <= left:
        duration = left
        status = TIMEOUT
    if not math.isfinite(duration):
        return NON_FINITE
    if trajectory.shape[0] > 0:
        samples = flight["samples"]
        flight["samples"] = fly(slope, limits, t, duration, x, y, phi, u, v, omega, trajectory, samples)
    t, x, y, phi, u, v, feature, a, b, v_n, v_t = arrive_at(
        body, duration, t, x, y, phi, u, v, omega, slope.downhill, slope.inward
    )
    if status == FINISH:
        x = slope.length
    flight["t"], flight["x"], flight["y"], flight["phi"] = t, x, y, phi
    flight["u"], flight["v"] = u, v
    if status == RUNNING:
        # Contact, in its own coordinates; the energy of the rounding error in y is far below that of the ledger.
        for i in range(STATE_SIZE):
            state[i] = 0.0
        state[TIME] = t
        state[X] = x
        state[PHI] = phi
        state[V_N] = v_n
        state[V_T] = v_t
        state[OMEGA] = omega
        state[FEATURE] = feature
        state[ARM_A], state[ARM_B] = a, b
        for i in range(STATE_SIZE):
            before[i] = state[i]
    return status


@kernel
def depart(
    body: Body,
    flight: np.void,
    rebound: np.void,
    log_length: int,
    status: int,
    steps: int,
    samples: int,
    state: np.ndarray,
    before: np.ndarray,
) -> int:
    """Record a contact and put the flight at its end; return the status of the descent.

    The flight is at the touchdown, ``status``, ``steps`` and ``samples`` are what :func:`touch` returns.
    """
    a, b = before[ARM_A], before[ARM_B]
    if state[PHI] != before[PHI] or state[FEATURE] != before[FEATURE]:
        a, b = arms(body, int(state[FEATURE]), state[PHI] - whole_turns(state[PHI]))
    write_rebound(body, rebound, before, state, int(before[FEATURE]), b, a, flight["u"], flight["v"])
    flight["t"], flight["x"], flight["phi"], flight["omega"] = state[TIME], state[X], state[PHI], state[OMEGA]
    flight["y"] = b + state[GAP]
    flight["u"], flight["v"] = rebound["u_after"], rebound["v_after"]
    flight["rebounds"] += 1
    flight["steps"] = steps
    flight["samples"] = samples
    flight["stored"] = state[STORED]
    flight["hysteresis"] += state[HYSTERESIS]
    flight["sliding"] += state[SLIDING]
    flight["rolling"] += state[ROLLING]
    if status == RUNNING and flight["rebounds"] == log_length:
        status = LOG_FULL
    return status


@kernel
def land(
    body: Body,
    law: Law,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    touchdown: float,
    rebound: np.void,
    log_length: int,
    space: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    trajectory: np.ndarray,
) -> None:
    """Follow one hop whose touchdown is known, up to the rebound or to whatever ends the descent.

    ``touchdown`` is the duration [s] of the flight, inf if it is longer than ``limits.max_time`` allows; the other
    arguments are those of :func:`hop`.
    """
    c, z, state, before = space
    status = arrive(body, slope, limits, flight, touchdown, state, before, trajectory)
    if status == RUNNING:
        samples = flight["samples"]
        status, steps, samples = touch(body, law, slope, limits, state, c, z, flight["steps"], trajectory, samples)
        status = depart(body, flight, rebound, log_length, status, steps, samples, state, before)
    flight["status"] = status
    if status != RUNNING and trajectory.shape[0] > 0:
        t, x, y, phi = flight["t"], flight["x"], flight["y"], flight["phi"]
        u, v, omega = flight["u"], flight["v"], flight["omega"]
        samples = flight["samples"]
        flight["samples"] = add_sample(trajectory, samples, t, x, y, phi, u, v, omega, 0.0, 0.0, 0.0, 0, 0, 0)


@kernel
def hop(
    body: Body,
    law: Law,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    rebound: np.void,
    log_length: int,
    space: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    trajectory: np.ndarray,
) -> None:
    """Follow one hop: the flight, the touchdown and the contact up to the rebound, or whatever ends the descent.

    Parameters
    ----------
    body, law, slope, limits
        See :mod:`sledenv.kernel.params`; the type of the law chooses the contact, at compile time.
    flight : record of OUTCOME
        Where the descent is, with status RUNNING: at its launch or at a rebound. Moved on; its ledger is left to
        :func:`close_books`.
    rebound : record of REBOUND
        Overwritten if there was a contact, that is if ``flight["rebounds"]`` has grown.
    log_length : int
        Number of rebounds at which the descent ends with status LOG_FULL.
    space : tuple of ndarray
        See :func:`work_space`.
    trajectory : ndarray of TRAJECTORY
        Rows are written while there is room; ``flight["samples"]`` tells how many were needed.
    """
    y, phi, v, omega = flight["y"], flight["phi"], flight["v"], flight["omega"]
    touchdown = touchdown_time(body, slope.inward, y, phi, v, omega, limits.max_time - flight["t"])
    land(body, law, slope, limits, flight, touchdown, rebound, log_length, space, trajectory)


@kernel
def descend(
    body: Body,
    law: Law,
    slope: Slope,
    launch: State,
    limits: Limits,
    rebounds: np.ndarray,
    space: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    trajectory: np.ndarray,
    outcome: np.void,
) -> None:
    """Simulate one descent: hop after hop.

    Parameters
    ----------
    body, law, slope, launch, limits
        See :mod:`sledenv.kernel.params`; the type of the law chooses the contact, at compile time.
    rebounds : ndarray of REBOUND, shape (max_rebounds,)
        The log; a descent that fills it ends with status LOG_FULL.
    space : tuple of ndarray
        See :func:`work_space`.
    trajectory : ndarray of TRAJECTORY
        Rows are written while there is room; ``outcome["samples"]`` tells how many were needed.
    outcome : record of OUTCOME
        Overwritten.
    """
    begin(launch, outcome)
    incline = incline_of(slope)
    while outcome["status"] == RUNNING:
        rebound = rebounds[outcome["rebounds"]]
        hop(body, law, incline, limits, outcome, rebound, rebounds.shape[0], space, trajectory)
    close_books(body, incline, launch, outcome)
