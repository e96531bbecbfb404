"""The loop that is the dataflow: flight, touchdown, contact, rebound, again and again, until the descent ends."""

from __future__ import annotations

import math

import numpy as np
from numba import prange

from sledenv.kernel.flight import finish_time, touchdown_time
from sledenv.kernel.geometry import arms, feature_at, lowest_support, whole_turns
from sledenv.kernel.jit import kernel, parallel_kernel
from sledenv.kernel.laws import Law, law_of_row, touch
from sledenv.kernel.params import Body, Limits, Slope, State
from sledenv.kernel.records import CHORD, FINISH, LOG_FULL, NON_FINITE, REBOUND, RUNNING, TIMEOUT, TRAJECTORY
from sledenv.kernel.series import ROWS, TERMS, Z_ROWS
from sledenv.kernel.state import (
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
    slope: Slope,
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
    downhill = slope.gravity * math.sin(slope.angle)
    inward = slope.gravity * math.cos(slope.angle)
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
def energy(body: Body, slope: Slope, y: float, x: float, u: float, v: float, omega: float) -> tuple[float, float]:
    """Kinetic and potential energy [J]."""
    kinetic = 0.5 * body.mass * (u * u + v * v) + 0.5 * body.inertia * omega * omega
    height = y * math.cos(slope.angle) - x * math.sin(slope.angle)
    return kinetic, body.mass * slope.gravity * height


@kernel
def close_books(
    body: Body,
    slope: Slope,
    launch: State,
    status: int,
    t: float,
    x: float,
    y: float,
    phi: float,
    u: float,
    v: float,
    omega: float,
    stored: float,
    hysteresis: float,
    sliding: float,
    rolling: float,
    outcome: np.ndarray,
) -> None:
    """Write the final state and the energy ledger: docs/physics.md, section 9."""
    kinetic, potential = energy(body, slope, launch.y, launch.x, launch.u, launch.v, launch.omega)
    drop = max(0.0, launch.y - lowest_support(body))
    along = max(0.0, x - launch.x)
    outcome["initial"] = kinetic + potential
    outcome["supplied"] = kinetic + body.mass * slope.gravity * (
        drop * math.cos(slope.angle) + along * math.sin(slope.angle)
    )
    outcome["kinetic"], outcome["potential"] = energy(body, slope, y, x, u, v, omega)
    outcome["stored"] = stored
    outcome["hysteresis"] = hysteresis
    outcome["sliding"] = sliding
    outcome["rolling"] = rolling
    if not math.isfinite(x + y + phi + u + v + omega + outcome["kinetic"] + outcome["initial"]):
        status = NON_FINITE
    outcome["status"] = status
    outcome["t"] = t
    outcome["x"] = x
    outcome["y"] = y
    outcome["phi"] = phi
    outcome["u"] = u
    outcome["v"] = v
    outcome["omega"] = omega


@kernel
def write_rebound(
    body: Body,
    rebound: np.ndarray,
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
    rebound["stuck"] = stuck_code(body, math.hypot(u, v), u_after, state[OMEGA])


@kernel
def descend(
    body: Body,
    law: Law,
    slope: Slope,
    launch: State,
    limits: Limits,
    rebounds: np.ndarray,
    trajectory: np.ndarray,
    outcome: np.ndarray,
) -> None:
    """Simulate one descent.

    Parameters
    ----------
    body, law, slope, launch, limits
        See :mod:`sledenv.kernel.params`; the type of the law chooses the contact, at compile time.
    rebounds : ndarray of REBOUND, shape (max_rebounds,)
        The log; a descent that fills it ends with status LOG_FULL.
    trajectory : ndarray of TRAJECTORY
        Rows are written while there is room; ``outcome["samples"]`` tells how many were needed.
    outcome : record of OUTCOME
        Overwritten.
    """
    downhill = slope.gravity * math.sin(slope.angle)
    inward = slope.gravity * math.cos(slope.angle)
    c = np.zeros((ROWS, TERMS))
    z = np.zeros(Z_ROWS)
    state = np.zeros(STATE_SIZE)
    before = np.zeros(STATE_SIZE)
    t = 0.0
    x, y, phi, u, v, omega = launch.x, launch.y, launch.phi, launch.u, launch.v, launch.omega
    stored = 0.0
    hysteresis, sliding, rolling = 0.0, 0.0, 0.0
    count, steps, samples = 0, 0, 0
    status = RUNNING
    while status == RUNNING:
        # Flight, to whatever comes first.
        left = limits.max_time - t
        duration = touchdown_time(body, inward, y, phi, v, omega, left)
        finish = finish_time(x, u, downhill, slope.length)
        touches = duration <= left
        if finish <= min(duration, left):
            duration = finish
            status = FINISH
        elif not touches:
            duration = left
            status = TIMEOUT
        if not math.isfinite(duration):
            status = NON_FINITE
            break
        if trajectory.shape[0] > 0:
            samples = fly(slope, limits, t, duration, x, y, phi, u, v, omega, trajectory, samples)
        t += duration
        x += duration * (u + 0.5 * downhill * duration)
        y += duration * (v - 0.5 * inward * duration)
        u += downhill * duration
        v -= inward * duration
        phi += omega * duration
        if status != RUNNING:
            if status == FINISH:
                x = slope.length
            break

        # Contact, in its own coordinates; the energy of the rounding error in y is far below that of the ledger.
        local = phi - whole_turns(phi)
        feature = feature_at(body, local)
        a, b = arms(body, feature, local)
        state[:] = 0.0
        state[TIME] = t
        state[X] = x
        state[PHI] = phi
        state[V_N] = v - a * omega
        state[V_T] = u + b * omega
        state[OMEGA] = omega
        state[FEATURE] = feature
        before[:] = state
        status, steps, samples = touch(body, law, slope, limits, state, c, z, steps, trajectory, samples)
        a, b = arms(body, int(state[FEATURE]), state[PHI] - whole_turns(state[PHI]))
        write_rebound(body, rebounds[count], before, state, feature, b, a, u, v)
        u = rebounds[count]["u_after"]
        v = rebounds[count]["v_after"]
        count += 1
        t, x, phi, omega = state[TIME], state[X], state[PHI], state[OMEGA]
        y = b + state[GAP]
        stored = state[STORED]
        hysteresis += state[HYSTERESIS]
        sliding += state[SLIDING]
        rolling += state[ROLLING]
        if status == RUNNING and count == rebounds.shape[0]:
            status = LOG_FULL
    if trajectory.shape[0] > 0:
        samples = add_sample(trajectory, samples, t, x, y, phi, u, v, omega, 0.0, 0.0, 0.0, 0, 0, 0)
    outcome["rebounds"] = count
    outcome["samples"] = samples
    outcome["steps"] = steps
    close_books(body, slope, launch, status, t, x, y, phi, u, v, omega, stored, hysteresis, sliding, rolling, outcome)


@parallel_kernel
def descend_batch(
    body: Body,
    like: Law,
    laws: np.ndarray,
    slopes: np.ndarray,
    launches: np.ndarray,
    limits: Limits,
    rebounds: np.ndarray,
    log_length: int,
    outcomes: np.ndarray,
) -> None:
    """Simulate many descents, one a lane; a lane does not depend on its neighbours or on the number of threads.

    Parameters
    ----------
    body, limits
        Shared by all lanes.
    like : ContactLaw or RigidLaw
        Of which kind the rows of ``laws`` are.
    laws, slopes : ndarray, shapes (N or 1, 5) and (N or 1, 3)
        Fields of the law and of Slope; one row serves all lanes.
    launches : ndarray, shape (N, 6)
        Fields of State.
    rebounds : ndarray of REBOUND, shape (N, log_length) or (0, 0)
        The logs; (0, 0) keeps none.
    log_length : int
        Number of rebounds at which a descent ends with status LOG_FULL.
    outcomes : ndarray of OUTCOME, shape (N,)
        Overwritten.
    """
    for i in prange(launches.shape[0]):
        log = rebounds[i] if rebounds.shape[0] > 0 else np.empty(log_length, REBOUND)
        p = laws[i] if laws.shape[0] > 1 else laws[0]
        q = slopes[i] if slopes.shape[0] > 1 else slopes[0]
        z = launches[i]
        law = law_of_row(like, p)
        slope = Slope(q[0], q[1], q[2])
        launch = State(z[0], z[1], z[2], z[3], z[4], z[5])
        descend(body, law, slope, launch, limits, log, np.empty(0, TRAJECTORY), outcomes[i])
