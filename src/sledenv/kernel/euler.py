"""The paper's own method, explicit Euler with a fixed step and plain sign functions, kept as a reference."""

from __future__ import annotations

import math

import numpy as np

from sledenv.kernel.descend import begin, close_books, write_rebound
from sledenv.kernel.geometry import arms, feature_at, has_corners, incline_of, whole_turns
from sledenv.kernel.jit import allocating
from sledenv.kernel.params import Body, ContactLaw, Limits, Slope, State
from sledenv.kernel.records import ARC, FINISH, LOG_FULL, NON_FINITE, RUNNING, STEP_BUDGET, TIMEOUT, TUMBLED
from sledenv.kernel.state import (
    GAP,
    HYSTERESIS,
    IMPULSE_N,
    IMPULSE_R,
    IMPULSE_T,
    OMEGA,
    PHI,
    ROLLING,
    SLIDING,
    STATE_SIZE,
    TIME,
    V_N,
    V_T,
    X,
)
from sledenv.kernel.trajectory import add_sample


@allocating
def descend_euler(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    launch: State,
    limits: Limits,
    rebounds: np.ndarray,
    trajectory: np.ndarray,
    outcome: np.void,
) -> None:
    """Simulate one descent by explicit Euler: paper equations (10)-(13) with gravity, docs/physics.md, section 2.

    The arguments are those of :func:`sledenv.kernel.descend.descend`. ``limits.step`` is the time step [s];
    ``limits.printed_sign`` = 1 takes the moment of friction with the paper's printed sign, which creates energy. Its
    events lie on the grid of steps: errors are of first order, and a body at rest chatters.
    """
    dt = limits.step
    downhill = slope.gravity * math.sin(slope.angle)
    inward = slope.gravity * math.cos(slope.angle)
    moment_sign = -1.0 if limits.printed_sign == 1.0 else 1.0
    corners = has_corners(body)
    both_corners = 2.0 * body.radius * math.sin(body.half_angle)
    stride = max(1, round(limits.sample_interval / dt))
    state = np.zeros(STATE_SIZE)
    before = np.zeros(STATE_SIZE)
    x, y, phi, u, v, omega = launch.x, launch.y, launch.phi, launch.u, launch.v, launch.omega
    hysteresis, sliding, rolling = 0.0, 0.0, 0.0
    u_before, v_before = 0.0, 0.0
    feature_before = ARC
    touching = False
    count, samples, index = 0, 0, 0
    a, b, gap = 0.0, 0.0, 0.0
    status = RUNNING
    while True:
        local = phi - whole_turns(phi)
        feature = feature_at(body, local)
        a, b = arms(body, feature, local)
        gap = y - b
        v_n = v - a * omega
        v_t = u + b * omega
        if not math.isfinite(gap + v_n + v_t):
            status = NON_FINITE
        elif x >= slope.length:
            status = FINISH
        elif corners and feature != ARC and gap + both_corners * abs(math.sin(local)) < 0.0:
            status = TUMBLED
        elif index * dt >= limits.max_time:
            status = TIMEOUT
        elif index >= limits.max_steps:
            status = STEP_BUDGET
        inside = gap < 0.0
        if inside and not touching:
            state[:] = 0.0
            state[TIME] = index * dt
            state[X], state[PHI], state[V_N], state[V_T], state[OMEGA] = x, phi, v_n, v_t, omega
            before[:] = state
            u_before, v_before, feature_before = u, v, feature
        if touching and (not inside or status != RUNNING):
            state[TIME] = index * dt
            state[X], state[PHI], state[GAP] = x, phi, gap
            state[V_N], state[V_T], state[OMEGA] = v_n, v_t, omega
            write_rebound(body, rebounds[count], before, state, feature_before, b, a, u_before, v_before)
            hysteresis += state[HYSTERESIS]
            sliding += state[SLIDING]
            rolling += state[ROLLING]
            count += 1
            if status == RUNNING and count == rebounds.shape[0]:
                status = LOG_FULL
        touching = inside
        normal, force, moment = 0.0, 0.0, 0.0
        if inside:
            arm = law.rolling_arm if feature == ARC else law.corner_rolling_arm
            normal = -law.stiffness * (1.0 - law.asymmetry * np.sign(v_n)) * gap  # (13)
            force = -law.friction * normal * np.sign(v_t)  # (11)
            moment = -arm * normal * np.sign(omega)
        if trajectory.shape[0] > 0 and (index % stride == 0 or status != RUNNING):
            samples = add_sample(
                trajectory,
                samples,
                index * dt,
                x,
                y,
                phi,
                u,
                v,
                omega,
                normal,
                force,
                moment,
                feature if inside else 0,
                int(np.sign(v_t)) if inside else 0,
                int(np.sign(omega)) if inside else 0,
            )
        if status != RUNNING:
            break
        if inside:
            state[IMPULSE_N] += normal * dt
            state[IMPULSE_T] += force * dt
            state[IMPULSE_R] += moment * dt
            state[SLIDING] -= force * v_t * dt
            state[ROLLING] -= moment * omega * dt
            if v_n > 0.0:
                state[HYSTERESIS] -= 2.0 * law.stiffness * law.asymmetry * gap * v_n * dt
        x += dt * u
        y += dt * v
        phi += dt * omega
        u += dt * (force / body.mass + downhill)
        v += dt * (normal / body.mass - inward)
        omega += dt * (-a * normal + moment_sign * b * force + moment) / body.inertia
        index += 1
    begin(launch, outcome)
    outcome["status"] = status
    outcome["rebounds"] = count
    outcome["samples"] = samples
    outcome["steps"] = index
    outcome["t"], outcome["x"], outcome["y"], outcome["phi"] = index * dt, x, y, phi
    outcome["u"], outcome["v"], outcome["omega"] = u, v, omega
    outcome["stored"] = 0.5 * law.stiffness * (1.0 + law.asymmetry) * min(gap, 0.0) ** 2
    outcome["hysteresis"] = hysteresis
    outcome["sliding"] = sliding
    outcome["rolling"] = rolling
    close_books(body, incline_of(slope), launch, outcome)
