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
    first_event,
    other_corner,
)
from sledenv.kernel.friction import mobility, resolve
from sledenv.kernel.geometry import feature_geometry, whole_turns
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, Incline, Limits
from sledenv.kernel.records import ARC, FINISH, JAMMED, NON_FINITE, NOSE, RUNNING, STEP_BUDGET, TAIL, TIMEOUT
from sledenv.kernel.roots import horner
from sledenv.kernel.series import (
    E_OMEGA,
    E_V_T,
    R_FORCE,
    R_MOMENT,
    R_NORMAL,
    Z_ARM,
    Z_AT_EDGE,
    Z_CHOOSE,
    Z_COSINE,
    Z_DOWNHILL,
    Z_EVENT,
    Z_EXPECTED,
    Z_FRICTION,
    Z_GAP_RATE,
    Z_GAP_ZEROS,
    Z_GUESS,
    Z_H,
    Z_INWARD,
    Z_K_CLOSING,
    Z_K_OPENING,
    Z_LARGEST,
    Z_LEAST,
    Z_LEFT_GAP,
    Z_LEFT_SLIP,
    Z_LEFT_SPIN,
    Z_LENGTH,
    Z_MAX_TIME,
    Z_MOST,
    Z_MOST_STEPS,
    Z_MU,
    Z_OTHER,
    Z_OTHER_COSINE,
    Z_OTHER_SINE,
    Z_PACE,
    Z_PACE_CLOSING,
    Z_PACE_OPENING,
    Z_PER_MASS,
    Z_R,
    Z_RATIO,
    Z_RHO,
    Z_ROOT,
    Z_SCALE,
    Z_SHIFT,
    Z_SINE,
    Z_SIZE,
    Z_SLIP,
    Z_SLIP_ZEROS,
    Z_SPIN,
    Z_SPIN_ZEROS,
    Z_STALLED,
    Z_STATE,
    Z_STEP,
    Z_STEPS,
    Z_STIFFNESS,
    Z_TOLERANCE,
    Z_TURNS,
    Z_UNIT,
    complete,
    complete_locked,
    expand,
    locate,
    longest_step,
)
from sledenv.kernel.state import (
    FEATURE,
    GAP,
    OMEGA,
    PHI,
    STORED,
    TIME,
    V_N,
    V_T,
    X,
)
from sledenv.kernel.step import DEEPEST, MOST_UNITS, NO_DEPTH, SOUGHT, STRETCHED, advance, expect, orient, tell
from sledenv.kernel.trace import set_apart
from sledenv.kernel.trajectory import CONTACT_ROWS, add_sample

INCONSISTENT = -1  # status: a rigid sliding contact admits no finite normal force
BOTH_CORNERS = -2  # status: the second corner has come down
PAUSED = -4  # status: the next step may be an ordinary one, see step.py
MOST_STALLED = 60  # events in a row without any progress in time
TRIALS = 27  # of them the last ones, in which every branch is tried
# A contact that is loaded less than this share of the force that drives the slip, or is as shallow as NO_DEPTH, is
# resolved in the limit of a vanishing normal force.
NO_LOAD = 1e-9
UNIT_ANGLE = 1.5  # of the contact oscillation in a unit of time
NEVER = 1 << 60


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
    body: Body, pair: Pair, state: np.ndarray, z: np.ndarray, left_gap: int, left_slip: int, left_spin: int
) -> tuple[int, int, int]:
    """Signs of v_n, v_t and omega from here on, by the box rule; ``left_...``: just released with that sign."""
    if state[V_N] != 0.0 and state[V_T] != 0.0 and state[OMEGA] != 0.0:
        return sign_of(state[V_N]), sign_of(state[V_T]), sign_of(state[OMEGA])
    a, b = z[Z_H] * z[Z_SINE], z[Z_R] - z[Z_H] * z[Z_COSINE]
    square = state[OMEGA] * state[OMEGA]
    size = body.radius + body.eccentricity
    drive_t = z[Z_DOWNHILL] + a * square
    drive_n = -z[Z_INWARD] - z[Z_H] * z[Z_COSINE] * square
    shallow = NO_DEPTH * size
    if abs(drive_t) > NO_DEPTH * abs(drive_n) and pair.k_closing < math.inf:
        shallow = min(shallow, NO_LOAD * body.mass * abs(drive_t) / pair.k_closing)
    depth = max(-state[GAP], shallow)
    return resolve(
        mobility(body.mass, body.inertia, a, b),
        drive_t,
        drive_n,
        pair.friction,
        z[Z_ARM],
        size,
        pair.k_closing * depth,
        pair.k_opening * depth,
        2 * left_gap if left_gap != 0 else sign_of(state[V_N]),
        2 * left_slip if left_slip != 0 else sign_of(state[V_T]),
        2 * left_spin if left_spin != 0 else sign_of(state[OMEGA]),
    )


@kernel
def _trial(number: int, state: np.ndarray) -> tuple[int, int, int]:
    """One of the branches that the velocities of a contact admit.

    The box rule sees the forces of an instant. Where they and the drives grow from zero together it may choose a branch
    that ends at once; the right one is then the one that gets anywhere.
    """
    signs = (number % 3 - 1, number // 3 % 3 - 1, number // 9 % 3 - 1)
    return (
        sign_of(state[V_N]) if state[V_N] != 0.0 else signs[0],
        sign_of(state[V_T]) if state[V_T] != 0.0 else signs[1],
        sign_of(state[OMEGA]) if state[OMEGA] != 0.0 else signs[2],
    )


@kernel
def _introduce(
    body: Body,
    pair: Pair,
    slope: Incline,
    feature: int,
    geometry: tuple[float, float, float],
    arm: float,
    z: np.ndarray,
) -> None:
    """Write what the series need and does not change until another feature touches."""
    set_apart()  # or it would be computed ahead wherever it might be needed
    h, r, shift = geometry
    z[Z_PER_MASS] = 1.0 / body.mass
    z[Z_RATIO] = body.mass / body.inertia
    z[Z_H] = h
    z[Z_R] = r
    z[Z_SHIFT] = shift
    z[Z_DOWNHILL], z[Z_INWARD] = slope.downhill, slope.inward
    z[Z_FRICTION] = pair.friction
    z[Z_ARM] = arm
    z[Z_OTHER], z[Z_OTHER_SINE], z[Z_OTHER_COSINE] = other_corner(body, feature, shift)
    # The spring moves less than the mass where it turns the body.
    moved = z[Z_PER_MASS] * (1.0 + z[Z_RATIO] * h * h)
    z[Z_PACE_CLOSING] = UNIT_ANGLE / math.sqrt(pair.k_closing * moved)
    z[Z_PACE_OPENING] = UNIT_ANGLE / math.sqrt(pair.k_opening * moved) if pair.k_opening > 0.0 else math.inf


@kernel
def _tell_branch(pair: Pair, gap_rate: int, slip: int, spin: int, z: np.ndarray) -> None:
    """Write what the series need and does not change until another branch is chosen."""
    z[Z_GAP_RATE], z[Z_SLIP], z[Z_SPIN] = gap_rate, slip, spin
    z[Z_MU] = -slip * z[Z_FRICTION]
    z[Z_RHO] = -spin * z[Z_ARM]
    z[Z_STIFFNESS] = pair.k_closing if gap_rate < 0 else pair.k_opening
    if z[Z_STIFFNESS] > 0.0:
        z[Z_PACE] = z[Z_PACE_CLOSING] if gap_rate < 0 else z[Z_PACE_OPENING]


@kernel
def _settled_unit(size: float, gravity: float, omega: float) -> float:
    """Unit of time [s] of a step with a locked gap, in which nothing oscillates."""
    rate = max(abs(omega), math.sqrt(gravity / size))
    return 0.5 / rate if rate > 0.0 else 1.0


@kernel
def _sooner(row: int, end: float, z: np.ndarray) -> bool:
    """Whether a velocity has changed its sign over the step; then say where it is expected to have been zero."""
    before = z[Z_STATE + row]
    if not before * end < 0.0:
        return False
    z[Z_MOST] = z[Z_STEP]
    z[Z_GUESS] = z[Z_STEP] * before / (before - end)
    return True


@kernel
def _take_step(
    body: Body,
    feature: int,
    length: float,
    branch: tuple[int, int, int],
    vanishing: tuple[int, int, int],
    at_edge: int,
    expected: int,
    z: np.ndarray,
    c: np.ndarray,
) -> tuple[int, int]:
    """Complete a step of Z_STEP units up to its first event; see :func:`first_event`.

    What is likely to end the step is sought first, where it is expected and up to Z_MOST. If the series prove that
    nothing else comes before, that was all.
    """
    _, slip, spin = branch
    event = NOTHING
    # A gap rate that starts from zero has a root there, which the search might find.
    sought = expected == SEPARATION or (expected == RATE_ZERO and vanishing[0] == 0)
    if sought and z[Z_GUESS] < SOUGHT * z[Z_STEP] and locate(GAP if expected == SEPARATION else V_N, z, c):
        z[Z_STEP], event = z[Z_ROOT], expected
    complete(z, c)
    if slip != 0 and vanishing[1] == 0 and _sooner(V_T, z[E_V_T], z) and locate(V_T, z, c):
        z[Z_STEP], event = z[Z_ROOT], SLIP_ZERO
        complete(z, c)
    if spin != 0 and vanishing[2] == 0 and _sooner(OMEGA, z[E_OMEGA], z) and locate(OMEGA, z, c):
        z[Z_STEP], event = z[Z_ROOT], SPIN_ZERO
        complete(z, c)
    if 0 in branch:
        complete_locked(z, c)
    step, event, released = first_event(body, feature, length, branch, vanishing, at_edge, event, z, c)
    if step < z[Z_STEP]:
        z[Z_STEP] = step
        complete(z, c)
        if 0 in branch:
            complete_locked(z, c)
    return event, released


@kernel
def leading_zeros(velocity: np.ndarray, sign: int) -> int:
    """Number of leading coefficients to be passed over in a search for where a released velocity returns to zero.

    An acceleration that vanishes by construction does so up to the error of the time of release. If it opposes ``sign``
    it is passed over, but kept: the release came early by that much, and the motion is right once it has caught up.
    """
    return 1 if sign * velocity[1] > 0.0 else 2


@kernel
def _sample_step(
    geometry: tuple[float, float, float],
    feature: int,
    slip: int,
    spin: int,
    turns: float,
    start: float,
    interval: float,
    z: np.ndarray,
    c: np.ndarray,
    trajectory: np.ndarray,
    samples: int,
) -> int:
    """Add rows over one step, both its ends included: forces may jump between it and the next."""
    h, r, shift = geometry
    unit, step = z[Z_UNIT], z[Z_STEP]
    rows = max(CONTACT_ROWS, math.ceil(step * unit / interval))
    for i in range(rows + 1):
        t = step * (i / rows)  # never beyond the step
        phi = horner(c[PHI], t)
        omega = horner(c[OMEGA], t)
        normal = horner(c[R_NORMAL], t)
        a = h * math.sin(phi + shift)
        b = r - h * math.cos(phi + shift)
        samples = add_sample(
            trajectory,
            samples,
            start + t * unit,
            horner(c[X], t),
            horner(c[GAP], t) + b,
            phi + turns,
            horner(c[V_T], t) - b * omega,
            horner(c[V_N], t) + a * omega,
            omega,
            normal,
            z[Z_MU] * normal if slip != 0 else horner(c[R_FORCE], t),
            z[Z_RHO] * normal if spin != 0 else horner(c[R_MOMENT], t),
            feature,
            slip,
            spin,
        )
    return samples


@kernel
def begin_contact(
    body: Body, pair: Pair, slope: Incline, limits: Limits, state: np.ndarray, z: np.ndarray, steps: int
) -> None:
    """Prepare a contact for :func:`follow`; arguments are those of :func:`contact`."""
    turns = whole_turns(state[PHI])
    state[PHI] -= turns
    feature = int(state[FEATURE])
    # At +-pi, where the corners change over, rounding must not give one corner the angle of the other.
    wrong = (feature == TAIL and state[PHI] < 0.0) or (feature == NOSE and state[PHI] > 0.0)
    shift_turn = math.copysign(2.0 * math.pi, state[PHI]) if wrong else 0.0
    turns += shift_turn
    state[PHI] -= shift_turn
    size = body.radius + body.eccentricity
    z[Z_SIZE] = size
    z[Z_SCALE] = max(abs(state[V_N]), abs(state[V_T]), size * abs(state[OMEGA]), math.sqrt(slope.gravity * size), 1e-12)
    z[Z_TOLERANCE] = limits.tolerance
    z[Z_LENGTH] = slope.length
    z[Z_MAX_TIME] = limits.max_time
    z[Z_MOST_STEPS] = limits.max_steps
    z[Z_STEPS] = steps
    z[Z_K_CLOSING], z[Z_K_OPENING] = pair.k_closing, pair.k_opening
    z[Z_TURNS] = turns
    z[Z_GAP_RATE], z[Z_SLIP], z[Z_SPIN] = 0.0, 0.0, 0.0
    z[Z_GAP_ZEROS], z[Z_SLIP_ZEROS], z[Z_SPIN_ZEROS] = 0.0, 0.0, 0.0
    z[Z_LEFT_GAP], z[Z_LEFT_SLIP], z[Z_LEFT_SPIN] = 0.0, 0.0, 0.0
    z[Z_AT_EDGE], z[Z_STALLED], z[Z_CHOOSE] = 0.0, 0.0, 1.0
    geometry = feature_geometry(body, feature)
    arm = pair.rolling_arm if feature == ARC else pair.corner_rolling_arm
    _introduce(body, pair, slope, feature, geometry, arm, z)


@kernel
def go_on(event: float, advanced: bool, z: np.ndarray) -> None:
    """Prepare a contact for :func:`follow` after steps abreast, if there were any, and the event at their end."""
    if advanced:
        z[Z_LEFT_GAP], z[Z_LEFT_SLIP], z[Z_LEFT_SPIN] = 0.0, 0.0, 0.0
    deepest = z[Z_GAP_ZEROS] == DEEPEST
    if deepest:
        z[Z_GAP_ZEROS] = 0.0
    z[Z_CHOOSE] = 1.0 if deepest or event in (SLIP_ZERO, SPIN_ZERO) else 0.0


@kernel
def choose_free(body: Body, pair: Pair, state: np.ndarray, z: np.ndarray) -> bool:
    """Choose the branch of a contact in which no velocity has been released; say whether all are free from here on."""
    if state[V_N] == 0.0 or state[V_T] == 0.0 or state[OMEGA] == 0.0:  # else the branch is theirs
        orient(z, state)
    gap_rate, slip, spin = _choose_branch(body, pair, state, z, 0, 0, 0)
    if gap_rate == 0 or slip == 0 or spin == 0:
        return False
    _tell_branch(pair, gap_rate, slip, spin, z)
    z[Z_GAP_ZEROS] = 1.0 if state[V_N] == 0.0 else 0.0
    z[Z_SLIP_ZEROS] = 1.0 if state[V_T] == 0.0 else 0.0
    z[Z_SPIN_ZEROS] = 1.0 if state[OMEGA] == 0.0 else 0.0
    z[Z_CHOOSE] = 0.0
    return True


@kernel
def end_contact(pair: Pair, state: np.ndarray, z: np.ndarray) -> None:
    """Complete the state at the end of a contact."""
    state[PHI] += z[Z_TURNS]
    if pair.k_closing < math.inf:
        state[STORED] = 0.5 * pair.k_closing * state[GAP] * state[GAP]


@kernel
def contact(
    body: Body,
    pair: Pair,
    slope: Incline,
    limits: Limits,
    state: np.ndarray,
    c: np.ndarray,
    z: np.ndarray,
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
    c, z : ndarray, shapes (ROWS, WIDTH) and (Z_ROWS,)
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
    begin_contact(body, pair, slope, limits, state, z, steps)
    return follow(body, pair, slope, limits, state, c, z, NEVER, trajectory, samples)


@kernel
def follow(
    body: Body,
    pair: Pair,
    slope: Incline,
    limits: Limits,
    state: np.ndarray,
    c: np.ndarray,
    z: np.ndarray,
    pause: int,
    trajectory: np.ndarray,
    samples: int,
) -> tuple[int, int, int]:
    """Follow a contact that has begun to its end, or until it may be paused.

    Parameters are those of :func:`contact`, and ``pause``: the number of steps after which the status may be PAUSED,
    if the next step may be an ordinary one. What it goes on with lies in ``state`` and ``z``.
    """
    feature = int(state[FEATURE])
    turns = z[Z_TURNS]
    size, scale = z[Z_SIZE], z[Z_SCALE]
    rigid = pair.k_closing == math.inf
    steps = int(z[Z_STEPS])
    gap_rate, slip, spin = int(z[Z_GAP_RATE]), int(z[Z_SLIP]), int(z[Z_SPIN])
    # Leading coefficients that are zero by construction.
    gap_zeros, slip_zeros, spin_zeros = int(z[Z_GAP_ZEROS]), int(z[Z_SLIP_ZEROS]), int(z[Z_SPIN_ZEROS])
    # Signs with which velocities have just been released.
    left_gap, left_slip, left_spin = int(z[Z_LEFT_GAP]), int(z[Z_LEFT_SLIP]), int(z[Z_LEFT_SPIN])
    at_edge, stalled, choose = int(z[Z_AT_EDGE]), int(z[Z_STALLED]), z[Z_CHOOSE] != 0.0
    pause += steps
    while True:
        oriented = False
        if choose:
            locked = (gap_rate, slip, spin)
            oriented = state[V_N] == 0.0 or state[V_T] == 0.0 or state[OMEGA] == 0.0  # else the branch is theirs
            if oriented:
                orient(z, state)
            gap_rate, slip, spin = _choose_branch(body, pair, state, z, left_gap, left_slip, left_spin)
            if stalled >= MOST_STALLED - TRIALS and not rigid:
                gap_rate, slip, spin = _trial(MOST_STALLED - stalled, state)
            # What has just left the bound of its force starts without acceleration too, if no other force has jumped.
            jumps = (gap_rate != locked[0]) + (slip != locked[1]) + (spin != locked[2])
            leaving = 2 if jumps == 1 else 1
            gap_zeros = (leaving if left_gap != 0 else 1) if state[V_N] == 0.0 else 0
            slip_zeros = (leaving if left_slip != 0 else 1) if state[V_T] == 0.0 else 0
            spin_zeros = (leaving if left_spin != 0 else 1) if state[OMEGA] == 0.0 else 0
            choose = False
            _tell_branch(pair, gap_rate, slip, spin, z)
        if gap_rate == 0 and slip == 0 and spin == 0:
            status = JAMMED
            break
        if not oriented and pause > steps:
            orient(z, state)
            oriented = True
        if rigid and gap_rate > 0:
            turning = z[Z_H] * z[Z_COSINE] * state[OMEGA] * state[OMEGA]
            pressed = z[Z_INWARD] + turning > 0.0
            status = INCONSISTENT if pressed else RUNNING
            break
        if steps >= limits.max_steps or stalled > MOST_STALLED:
            status = STEP_BUDGET
            break
        if (
            steps >= pause
            and gap_rate * slip * spin != 0
            and max(gap_zeros, slip_zeros, spin_zeros) < 2
            and at_edge + stalled == 0
        ):
            z[Z_STEPS] = steps
            z[Z_GAP_ZEROS], z[Z_SLIP_ZEROS], z[Z_SPIN_ZEROS] = gap_zeros, slip_zeros, spin_zeros
            z[Z_LEFT_GAP], z[Z_LEFT_SLIP], z[Z_LEFT_SPIN] = left_gap, left_slip, left_spin
            z[Z_AT_EDGE], z[Z_STALLED], z[Z_CHOOSE] = 0.0, 0.0, 0.0
            return PAUSED, steps, samples
        steps += 1
        if not oriented:
            orient(z, state)
        tell(z, state)
        z[Z_LEAST] = -pair.k_opening * state[GAP]
        z[Z_LARGEST] = math.inf if rigid else -pair.k_closing * state[GAP]
        if gap_rate == 0:
            z[Z_UNIT] = _settled_unit(size, slope.gravity, state[OMEGA])
        expand(gap_rate, slip, spin, z, c)
        expected = NOTHING
        if gap_rate != 0:
            expect(z)
            expected = int(z[Z_EXPECTED])
        if rigid and not 0.0 <= c[R_NORMAL, 0] <= pair.most_normal:
            status = INCONSISTENT
            break
        if gap_zeros == 2:
            gap_zeros = leading_zeros(c[V_N], gap_rate)
        if slip_zeros == 2:
            slip_zeros = leading_zeros(c[V_T], slip)
        if spin_zeros == 2:
            spin_zeros = leading_zeros(c[OMEGA], spin)
        step = longest_step(size, scale, limits.tolerance, MOST_UNITS, c)
        left = max(limits.max_time - state[TIME], 0.0) / z[Z_UNIT]
        last = step >= left
        step = min(step, left)
        if not math.isfinite(step):
            status = NON_FINITE
            break
        z[Z_GAP_ZEROS], z[Z_SLIP_ZEROS], z[Z_SPIN_ZEROS] = gap_zeros, slip_zeros, spin_zeros
        z[Z_STEP], z[Z_MOST] = step, STRETCHED * step if STRETCHED * step < left else step
        event, sign_after = _take_step(
            body,
            feature,
            slope.length,
            (gap_rate, slip, spin),
            (gap_zeros, slip_zeros, spin_zeros),
            at_edge,
            expected,
            z,
            c,
        )
        if trajectory.shape[0] > 0 and z[Z_STEP] > 0.0:
            samples = _sample_step(
                (z[Z_H], z[Z_R], z[Z_SHIFT]),
                feature,
                slip,
                spin,
                turns,
                state[TIME],
                limits.sample_interval,
                z,
                c,
                trajectory,
                samples,
            )
        step = z[Z_STEP] * z[Z_UNIT]
        stalled = 0 if state[TIME] + step > state[TIME] else stalled + 1
        z[Z_EVENT] = event
        advance(z, state)
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
        elif event == MIDDLE_PASSED:
            state[PHI] = math.copysign(0.0, -z[Z_OTHER_SINE])
        elif event == FEATURE_ENDS:
            if feature == ARC:
                feature = TAIL if state[PHI] > 0.0 else NOSE
            else:
                feature = ARC
            state[FEATURE] = feature
            state[PHI] = math.copysign(body.half_angle, state[PHI])
            geometry = feature_geometry(body, feature)
            arm = pair.rolling_arm if feature == ARC else pair.corner_rolling_arm
            _introduce(body, pair, slope, feature, geometry, arm, z)
            at_edge = 1
            choose = True
    end_contact(pair, state, z)
    return status, steps, samples
