"""Contact with extent in time, event-driven, in power series of high order: docs/physics.md, sections 5 and 6.

One loop serves the paper's two-stiffness law and the sustained contact of rigid surfaces, where the normal force is
unbounded and the gap stays closed until that force would become negative.

Between events the forces are analytic, so a step is a power series of the state and every event the first root of one.
The state is kept in contact coordinates (gap, v_n, v_t, omega, phi, x): a locked velocity is then exactly zero, and the
gap suffers no cancellation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sledenv.kernel.events import (
    CHORD_DOWN,
    FEATURE_ENDS,
    NOTHING,
    RATE_RELEASED,
    RATE_ZERO,
    SEPARATION,
    SLIP_RELEASED,
    SLIP_ZERO,
    SLOPE_ENDS,
    SPIN_RELEASED,
    SPIN_ZERO,
    first_event,
)
from sledenv.kernel.friction import mobility, resolve
from sledenv.kernel.geometry import arms, feature_geometry, whole_turns
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, Limits, Slope
from sledenv.kernel.records import ARC, FINISH, JAMMED, NON_FINITE, NOSE, RUNNING, STEP_BUDGET, TAIL, TIMEOUT
from sledenv.kernel.roots import horner
from sledenv.kernel.series import (
    R_FORCE,
    R_MOMENT,
    R_NORMAL,
    R_POWER_ROLLING,
    R_POWER_SLIDING,
    expand,
    integral,
    step_size,
)
from sledenv.kernel.state import (
    FEATURE,
    GAP,
    HYSTERESIS,
    IMPULSE_N,
    IMPULSE_R,
    IMPULSE_T,
    OMEGA,
    PHI,
    ROLLING,
    SLIDING,
    STORED,
    TIME,
    V_N,
    V_T,
    X,
)
from sledenv.kernel.trajectory import add_sample

INCONSISTENT = -1  # status: a rigid sliding contact admits no finite normal force
BOTH_CORNERS = -2  # status: the second corner has come down
MOST_STALLED = 60  # events in a row without any progress in time
# A contact shallower than this share of the size of the body, or loaded less than this share of the force that drives
# the slip, is resolved in the limit of a vanishing normal force.
NO_DEPTH = 1e-12
NO_LOAD = 1e-9


class Pair(NamedTuple):
    """How two surfaces meet while they touch."""

    k_closing: float  # [N/m] while the gap closes; inf if rigid
    k_opening: float  # [N/m] while it opens; 0 if rigid
    friction: float  # [-] f
    rolling_arm: float  # [m] delta of the arc
    corner_rolling_arm: float  # [m] delta of a corner
    most_normal: float  # [N] above which a rigid contact counts as having no finite normal force


@kernel
def sign_of(value: float) -> int:
    """-1, 0 or 1."""
    return 1 if value > 0.0 else (-1 if value < 0.0 else 0)


@kernel
def _choose_branch(
    body: Body,
    pair: Pair,
    slope: Slope,
    feature: int,
    arm: float,
    state: np.ndarray,
    left_gap: int,
    left_slip: int,
    left_spin: int,
) -> tuple[int, int, int]:
    """Signs of v_n, v_t and omega from here on, by the box rule; ``left_...``: just released with that sign."""
    h, _, shift = feature_geometry(body, feature)
    a, b = arms(body, feature, state[PHI])
    square = state[OMEGA] * state[OMEGA]
    size = body.radius + body.eccentricity
    drive_t = slope.gravity * math.sin(slope.angle) + a * square
    drive_n = -slope.gravity * math.cos(slope.angle) - h * math.cos(state[PHI] + shift) * square
    shallow = NO_DEPTH * size
    if abs(drive_t) > NO_DEPTH * abs(drive_n) and pair.k_closing < math.inf:
        shallow = min(shallow, NO_LOAD * body.mass * abs(drive_t) / pair.k_closing)
    depth = max(-state[GAP], shallow)
    return resolve(
        mobility(body.mass, body.inertia, a, b),
        drive_t,
        drive_n,
        pair.friction,
        arm,
        size,
        pair.k_closing * depth,
        pair.k_opening * depth,
        2 * left_gap if left_gap != 0 else sign_of(state[V_N]),
        2 * left_slip if left_slip != 0 else sign_of(state[V_T]),
        2 * left_spin if left_spin != 0 else sign_of(state[OMEGA]),
    )


@kernel
def _longest_step(
    body: Body,
    feature: int,
    friction: float,
    arm: float,
    stiffness: float,
    gap_rate: int,
    scale: float,
    tolerance: float,
    state: np.ndarray,
    c: np.ndarray,
) -> float:
    """Step [s] that keeps the truncation error of the series below the tolerance."""
    step = step_size(c, body.radius + body.eccentricity, scale, tolerance)
    if gap_rate != 0:
        # Below half a contact oscillation, or the bound on the curvature of the series becomes useless.
        a, b = arms(body, feature, state[PHI])
        softness = 1.0 / body.mass + abs(a) * (abs(a) + friction * abs(b) + arm) / body.inertia
        step = min(step, 1.4 / math.sqrt(stiffness * softness))
    if state[OMEGA] != 0.0:
        step = min(step, 1.0 / abs(state[OMEGA]))  # sine and cosine converge fast
    return step


@kernel
def drop_pull(velocity: np.ndarray, sign: int) -> int:
    """Clear the second coefficient if it opposes ``sign``; return the number of leading coefficients that vanish."""
    if sign * velocity[1] > 0.0:
        return 1
    velocity[1] = 0.0
    return 2


@kernel
def _advance(state: np.ndarray, c: np.ndarray, step: float) -> None:
    """Move the state, the impulses and the losses to the end of the step."""
    state[TIME] += step
    for row in (X, PHI, GAP, V_N, V_T, OMEGA):
        state[row] = horner(c[row], step)
    state[IMPULSE_N] += integral(c[R_NORMAL], step)
    state[IMPULSE_T] += integral(c[R_FORCE], step)
    state[IMPULSE_R] += integral(c[R_MOMENT], step)
    # The powers of friction are never negative; the integral of a vanishing one may be, by rounding.
    state[SLIDING] += max(integral(c[R_POWER_SLIDING], step), 0.0)
    state[ROLLING] += max(integral(c[R_POWER_ROLLING], step), 0.0)


@kernel
def _sample_step(
    body: Body,
    geometry: tuple[float, float, float],
    feature: int,
    slip: int,
    spin: int,
    turns: float,
    start: float,
    step: float,
    interval: float,
    c: np.ndarray,
    trajectory: np.ndarray,
    samples: int,
) -> int:
    """Add rows over one step, its start included, close enough to draw the contact."""
    h, r, shift = geometry
    rows = max(3, math.ceil(step / interval))
    for i in range(rows):
        t = step * i / rows
        phi = horner(c[PHI], t)
        omega = horner(c[OMEGA], t)
        a = h * math.sin(phi + shift)
        b = r - h * math.cos(phi + shift)
        samples = add_sample(
            trajectory,
            samples,
            start + t,
            horner(c[X], t),
            horner(c[GAP], t) + b,
            phi + turns,
            horner(c[V_T], t) - b * omega,
            horner(c[V_N], t) + a * omega,
            omega,
            horner(c[R_NORMAL], t),
            horner(c[R_FORCE], t),
            horner(c[R_MOMENT], t),
            feature,
            slip,
            spin,
        )
    return samples


@kernel
def contact(
    body: Body,
    pair: Pair,
    slope: Slope,
    limits: Limits,
    state: np.ndarray,
    c: np.ndarray,
    steps: int,
    trajectory: np.ndarray,
    samples: int,
) -> tuple[int, int, int]:
    """Follow one contact from touchdown to separation, rest or the end of the slope: docs/physics.md, section 5.

    Parameters
    ----------
    body, slope, limits
        See :mod:`sledenv.kernel.params`.
    pair : Pair
        How the two surfaces meet; a rigid pair starts at rest, without gap or gap rate.
    state : ndarray, shape (STATE_SIZE,)
        Contact state at touchdown; overwritten by the state at the end. Impulses and losses are accumulated.
    c : ndarray, shape (ROWS, ORDER + 1)
        Work space.
    steps : int
        Integration steps spent so far.
    trajectory : ndarray of TRAJECTORY
        Rows are added while there is room; length 0 records nothing.
    samples : int
        Rows that were needed so far.

    Returns
    -------
    tuple of int
        Status (RUNNING after a separation, or one of the two above), steps and samples.
    """
    turns = whole_turns(state[PHI])
    state[PHI] -= turns
    feature = int(state[FEATURE])
    # At +-pi, where the corners change over, rounding must not give one corner the angle of the other.
    wrong = (feature == TAIL and state[PHI] < 0.0) or (feature == NOSE and state[PHI] > 0.0)
    shift_turn = math.copysign(2.0 * math.pi, state[PHI]) if wrong else 0.0
    turns += shift_turn
    state[PHI] -= shift_turn
    geometry = feature_geometry(body, feature)
    arm = pair.rolling_arm if feature == ARC else pair.corner_rolling_arm
    size = body.radius + body.eccentricity
    rigid = pair.k_closing == math.inf
    scale = max(abs(state[V_N]), abs(state[V_T]), size * abs(state[OMEGA]), math.sqrt(slope.gravity * size), 1e-12)
    gap_rate, slip, spin = 0, 0, 0
    gap_zeros, slip_zeros, spin_zeros, at_edge = 0, 0, 0, 0  # leading coefficients that are zero by construction
    choose = True
    left_gap, left_slip, left_spin = 0, 0, 0  # signs with which velocities have just been released
    stalled = 0
    while True:
        if choose:
            locked = (gap_rate, slip, spin)
            gap_rate, slip, spin = _choose_branch(
                body, pair, slope, feature, arm, state, left_gap, left_slip, left_spin
            )
            # What has just left the bound of its force starts without acceleration too, if no other force has jumped.
            jumps = (gap_rate != locked[0]) + (slip != locked[1]) + (spin != locked[2])
            leaving = 2 if jumps == 1 else 1
            gap_zeros = (leaving if left_gap != 0 else 1) if state[V_N] == 0.0 else 0
            slip_zeros = (leaving if left_slip != 0 else 1) if state[V_T] == 0.0 else 0
            spin_zeros = (leaving if left_spin != 0 else 1) if state[OMEGA] == 0.0 else 0
            choose = False
        if gap_rate == 0 and slip == 0 and spin == 0:
            status = JAMMED
            break
        if rigid and gap_rate > 0:
            h, _, shift = geometry
            turning = h * math.cos(state[PHI] + shift) * state[OMEGA] * state[OMEGA]
            pressed = slope.gravity * math.cos(slope.angle) + turning > 0.0
            status = INCONSISTENT if pressed else RUNNING
            break
        if steps >= limits.max_steps or stalled > MOST_STALLED:
            status = STEP_BUDGET
            break
        steps += 1
        stiffness = pair.k_closing if gap_rate < 0 else pair.k_opening
        expand(body, geometry, pair.friction, arm, slope, stiffness, gap_rate, slip, spin, state, c)
        if rigid and not 0.0 <= c[R_NORMAL, 0] <= pair.most_normal:
            status = INCONSISTENT
            break
        # An acceleration that vanishes by construction must not pull back by rounding.
        if gap_zeros == 2:
            gap_zeros = drop_pull(c[V_N], gap_rate)
        if slip_zeros == 2:
            slip_zeros = drop_pull(c[V_T], slip)
        if spin_zeros == 2:
            spin_zeros = drop_pull(c[OMEGA], spin)
        step = _longest_step(body, feature, pair.friction, arm, stiffness, gap_rate, scale, limits.tolerance, state, c)
        left = max(limits.max_time - state[TIME], 0.0)
        last = step >= left
        step = min(step, left)
        if not math.isfinite(step):
            status = NON_FINITE
            break
        depth = -state[GAP]
        step, event, sign_after = first_event(
            body,
            feature,
            geometry[2],
            pair.friction,
            arm,
            math.inf if rigid else pair.k_closing * depth,
            pair.k_opening * depth,
            slope.length,
            (gap_rate, slip, spin),
            (gap_zeros, slip_zeros, spin_zeros),
            at_edge,
            c,
            step,
        )
        if trajectory.shape[0] > 0:
            samples = _sample_step(
                body,
                geometry,
                feature,
                slip,
                spin,
                turns,
                state[TIME],
                step,
                limits.sample_interval,
                c,
                trajectory,
                samples,
            )
        stalled = 0 if state[TIME] + step > state[TIME] else stalled + 1
        _advance(state, c, step)
        if event == SEPARATION:
            state[GAP] = 0.0
        if gap_rate > 0:
            state[HYSTERESIS] += 0.5 * (pair.k_closing - pair.k_opening) * (depth * depth - state[GAP] * state[GAP])
        at_edge = 0
        if step > 0.0:
            gap_zeros, slip_zeros, spin_zeros = 0, 0, 0
            left_gap, left_slip, left_spin = 0, 0, 0
            # Two events at the same time: the later one by rounding must not leave its velocity with the wrong sign.
            for row, sign in ((V_N, gap_rate), (V_T, slip), (OMEGA, spin)):
                if sign * state[row] < 0.0:
                    state[row] = 0.0
                    choose = True

        if event == NOTHING:
            if last:
                status = TIMEOUT
                break
            if not math.isfinite(state[X] + state[PHI] + state[GAP] + state[V_N] + state[V_T] + state[OMEGA]):
                status = NON_FINITE
                break
        elif event == SEPARATION:
            status = RUNNING
            break
        elif event == SLOPE_ENDS:
            state[X] = slope.length
            status = FINISH
            break
        elif event == CHORD_DOWN:
            status = BOTH_CORNERS
            break
        elif event == RATE_ZERO:
            state[V_N] = 0.0
            left_gap = 0
            choose = True
        elif event == SLIP_ZERO:
            state[V_T] = 0.0
            left_slip = 0
            choose = True
        elif event == SPIN_ZERO:
            state[OMEGA] = 0.0
            left_spin = 0
            choose = True
        elif event == RATE_RELEASED:
            if rigid:
                status = RUNNING
                break
            left_gap = sign_after
            choose = True
        elif event == SLIP_RELEASED:
            left_slip = sign_after
            choose = True
        elif event == SPIN_RELEASED:
            left_spin = sign_after
            choose = True
        elif event == FEATURE_ENDS:
            if feature == ARC:
                feature = TAIL if state[PHI] > 0.0 else NOSE
            else:
                feature = ARC
            state[PHI] = math.copysign(body.half_angle, state[PHI])
            geometry = feature_geometry(body, feature)
            arm = pair.rolling_arm if feature == ARC else pair.corner_rolling_arm
            at_edge = 1
            choose = True
    state[PHI] += turns
    state[FEATURE] = feature
    if not rigid:
        state[STORED] = 0.5 * pair.k_closing * state[GAP] * state[GAP]
    return status, steps, samples
