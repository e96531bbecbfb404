"""Contact of the chord: both corners touch, each by the two-stiffness law of its own; docs/physics.md, section 8.

With ``theta`` = phi - pi the arms of the corners are ``a = -H sin(theta) -+ L cos(theta)`` and
``b = H cos(theta) -+ L sin(theta)``; H is the distance of the mass centre from the chord, L half the chord. The two
normal forces are independent; the chord slips as one, at the mean of the two arms b, which differ by no more than the
penetrations do.
"""

from __future__ import annotations

import math

import numpy as np

from sledenv.kernel.contact import MOST_STALLED, Pair, sign_of
from sledenv.kernel.friction import mobility, resolve
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, Limits, Slope
from sledenv.kernel.records import CHORD, FINISH, NON_FINITE, NOSE, RUNNING, STEP_BUDGET, TAIL, TIMEOUT, TUMBLED
from sledenv.kernel.roots import first_root, horner
from sledenv.kernel.series import ORDER, integral, product
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

TOGETHER = 1e-12  # of the speed scale: gap rates of the two corners that are equal but for rounding
ONE_CORNER = -3  # status: one corner has left, the other still touches

# Rows of the table of series, which is the one of a single contact.
THETA, X_, Y, V, SLIP, SPIN, GAP_1, GAP_2, SINE, COSINE = range(10)
NORMAL_1, NORMAL_2, NORMAL, FORCE, MOMENT, ARM, DRIVE, TURNING, SPIN_RATE, SQUARE, DIVISOR, SCRATCH = range(10, 22)


@kernel
def chord_lengths(body: Body) -> tuple[float, float]:
    """Distance H [m] of the mass centre from the chord, and half of the length L [m] of the chord."""
    return (
        body.eccentricity - body.radius * math.cos(body.half_angle),
        body.radius * math.sin(body.half_angle),
    )


@kernel
def _expand(
    body: Body,
    pair: Pair,
    slope: Slope,
    stiffness_1: float,
    stiffness_2: float,
    slip: int,
    spin: int,
    start: np.ndarray,
    c: np.ndarray,
) -> None:
    """Fill ``c`` with the series of one step from the first eight entries of ``start``: docs/physics.md (8.4)."""
    m = body.mass
    height, half = chord_lengths(body)
    downhill = slope.gravity * math.sin(slope.angle)
    inward = slope.gravity * math.cos(slope.angle)
    mu = -slip * pair.friction
    rho = -spin * pair.corner_rolling_arm
    for row in range(8):
        c[row, 0] = start[row]
    sine, cosine, spins, speed = c[SINE], c[COSINE], c[SPIN], c[V]
    sine[0] = math.sin(start[THETA])
    cosine[0] = math.cos(start[THETA])
    for k in range(ORDER):
        one = 1.0 if k == 0 else 0.0
        c[ARM, k] = height * cosine[k]
        c[SQUARE, k] = product(spins, spins, k)
        c[NORMAL_1, k] = -stiffness_1 * c[GAP_1, k]
        c[NORMAL_2, k] = -stiffness_2 * c[GAP_2, k]
        c[NORMAL, k] = c[NORMAL_1, k] + c[NORMAL_2, k]
        # -(a_1 N_1 + a_2 N_2)
        c[TURNING, k] = 0.0
        for i in range(k + 1):
            total, difference = c[NORMAL, k - i], c[NORMAL_1, k - i] - c[NORMAL_2, k - i]
            c[TURNING, k] += height * sine[i] * total + half * cosine[i] * difference
        c[DRIVE, k] = downhill * one - height * product(sine, c[SQUARE], k)
        if spin == 0:
            c[SPIN_RATE, k] = 0.0
            c[FORCE, k] = -m * c[DRIVE, k] if slip == 0 else mu * c[NORMAL, k]
            c[MOMENT, k] = -c[TURNING, k] - product(c[ARM], c[FORCE], k)
        else:
            c[MOMENT, k] = rho * c[NORMAL, k]
            if slip == 0:
                c[DIVISOR, k] = body.inertia * one + m * product(c[ARM], c[ARM], k)
                rest = c[TURNING, k] + c[MOMENT, k] - m * product(c[ARM], c[DRIVE], k)
                for i in range(k):
                    rest -= c[SPIN_RATE, i] * c[DIVISOR, k - i]
                c[SPIN_RATE, k] = rest / c[DIVISOR, 0]
                c[FORCE, k] = -m * (c[DRIVE, k] + product(c[ARM], c[SPIN_RATE], k))
            else:
                c[FORCE, k] = mu * c[NORMAL, k]
                rest = c[TURNING, k] + c[MOMENT, k] + product(c[ARM], c[FORCE], k)
                c[SPIN_RATE, k] = rest / body.inertia
        after = 1.0 / (k + 1)
        slip_rate = c[FORCE, k] / m + c[DRIVE, k] + product(c[ARM], c[SPIN_RATE], k)
        c[SLIP, k + 1] = 0.0 if slip == 0 else slip_rate * after
        speed[k + 1] = (c[NORMAL, k] / m - inward * one) * after
        tilt = height * product(sine, spins, k)
        lever = half * product(cosine, spins, k)
        c[GAP_1, k + 1] = (speed[k] + tilt + lever) * after
        c[GAP_2, k + 1] = (speed[k] + tilt - lever) * after
        c[X_, k + 1] = (c[SLIP, k] - product(c[ARM], spins, k)) * after
        c[Y, k + 1] = speed[k] * after
        c[THETA, k + 1] = spins[k] * after
        spins[k + 1] = c[SPIN_RATE, k] * after
        sine[k + 1] = product(cosine, spins, k) * after
        cosine[k + 1] = -product(sine, spins, k) * after
    for row in (NORMAL_1, NORMAL_2, NORMAL, FORCE, MOMENT):
        c[row, ORDER] = 0.0


@kernel
def _root(c: np.ndarray, row: int, sign: float, step: float, vanishing: int) -> float:
    q = c[SCRATCH]
    for k in range(ORDER + 1):
        q[k] = sign * c[row, k]
    return first_root(q, step, vanishing, 0.0)


@kernel
def _rate_root(c: np.ndarray, row: int, sign: float, step: float, vanishing: int) -> float:
    """First zero of the derivative of a gap."""
    q = c[SCRATCH]
    for k in range(ORDER):
        q[k] = sign * (k + 1) * c[row, k + 1]
    q[ORDER] = 0.0
    return first_root(q, step, vanishing, 0.0)


@kernel
def _bound_root(c: np.ndarray, row: int, sign: float, factor: float, step: float) -> float:
    """Time at which ``sign`` times a locked force exceeds ``factor`` times the normal force."""
    q = c[SCRATCH]
    for k in range(ORDER + 1):
        q[k] = factor * c[NORMAL, k] - sign * c[row, k]
    noise = 1e-15 * (abs(factor * c[NORMAL, 0]) + abs(c[row, 0]))
    return first_root(q, step, 0, noise)


@kernel
def _loss(c: np.ndarray, row: int, factor: float, step: float) -> float:
    """Work of the bound of a friction force against the velocity in ``row``."""
    q = c[SCRATCH]
    for k in range(ORDER):
        q[k] = factor * product(c[NORMAL], c[row], k)
    return max(integral(q, step), 0.0)


@kernel
def chord_contact(
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
    """Follow a contact from the moment the second corner comes down until one leaves or the body lies on its chord.

    Parameters
    ----------
    body, slope, limits
        See :mod:`sledenv.kernel.params`.
    pair : Pair
        Compliant.
    state
        That of the corner that came down first; overwritten by that of the one that touches last.
    c, steps, trajectory, samples
        As for :func:`sledenv.kernel.contact.contact`.

    Returns
    -------
    tuple of int
        Status (ONE_CORNER where one corner has left, RUNNING where both have, TUMBLED where a corner comes to rest),
        steps and samples.
    """
    height, half = chord_lengths(body)
    size = body.radius + body.eccentricity
    downhill = slope.gravity * math.sin(slope.angle)
    inward = slope.gravity * math.cos(slope.angle)
    feature_side = 1.0 if state[FEATURE] == TAIL else -1.0
    turns = math.pi * (2.0 * math.floor(state[PHI] / (2.0 * math.pi)) + 1.0)  # the odd multiple of pi nearby
    theta = state[PHI] - turns
    sine, cosine = math.sin(theta), math.cos(theta)
    a = -height * sine - feature_side * half * cosine
    b = height * cosine - feature_side * half * sine
    omega = state[OMEGA]
    now = np.zeros(8)
    now[THETA] = theta
    now[X_] = state[X]
    now[Y] = state[GAP] + b
    now[V] = state[V_N] + a * omega
    now[SPIN] = omega
    now[SLIP] = state[V_T] + (height * cosine - b) * omega
    if abs(now[SLIP]) <= 1e-15 * (abs(state[V_T]) + size * abs(omega)):
        now[SLIP] = 0.0
    other = state[GAP] + 2.0 * feature_side * -half * sine  # gap of the other corner
    now[GAP_1] = state[GAP] if feature_side > 0 else min(other, 0.0)
    now[GAP_2] = min(other, 0.0) if feature_side > 0 else state[GAP]
    scale = max(abs(now[V]), abs(now[SLIP]), size * abs(omega), math.sqrt(slope.gravity * size), 1e-12)
    slip, spin = sign_of(now[SLIP]), sign_of(now[SPIN])
    sign_1, sign_2 = -1, -1
    zero_1, zero_2, zero_slip, zero_spin = 0, 0, 0, 0  # leading coefficients that are zero by construction
    choose = True
    stalled = 0
    first = True
    while True:
        sine, cosine = math.sin(now[THETA]), math.cos(now[THETA])
        rate_1 = now[V] + (height * sine + half * cosine) * now[SPIN]
        rate_2 = now[V] + (height * sine - half * cosine) * now[SPIN]
        if first:
            sign_1 = 1 if rate_1 > 0.0 else -1
            sign_2 = 1 if rate_2 > 0.0 else -1
            first = False
        k_1 = pair.k_closing if sign_1 < 0 else pair.k_opening
        k_2 = pair.k_closing if sign_2 < 0 else pair.k_opening
        if choose:
            n_1 = max(-k_1 * now[GAP_1], 1e-12 * k_1 * size)
            n_2 = max(-k_2 * now[GAP_2], 1e-12 * k_2 * size)
            # For the box rule the two normal forces act as their sum, at the arm of their resultant.
            arm = -height * sine - half * cosine * (n_1 - n_2) / (n_1 + n_2)
            square = now[SPIN] * now[SPIN]
            _, slip, spin = resolve(
                mobility(body.mass, body.inertia, arm, height * cosine),
                downhill - height * sine * square,
                -inward,
                pair.friction,
                pair.corner_rolling_arm,
                size,
                n_1 + n_2,
                n_1 + n_2,
                -1,
                sign_of(now[SLIP]),
                sign_of(now[SPIN]),
            )
            # A friction without a force has no surface to stay on: its velocity passes zero freely.
            if pair.friction == 0.0:
                slip = 1
            if pair.corner_rolling_arm == 0.0:
                spin = 1
            choose = False
            zero_slip = 1 if now[SLIP] == 0.0 else 0
            zero_spin = 1 if now[SPIN] == 0.0 else 0
        if steps >= limits.max_steps or stalled > MOST_STALLED:
            status = STEP_BUDGET
            break
        steps += 1
        _expand(body, pair, slope, k_1, k_2, slip, spin, now, c)
        step = math.inf
        for k in (ORDER - 1, ORDER):
            large = max(abs(c[V, k]), abs(c[SLIP, k]), size * abs(c[SPIN, k]))
            if large > 0.0:
                step = min(step, math.exp(math.log(limits.tolerance * scale / large) / k))
        softness = 2.0 / body.mass + 2.0 * (abs(height) + half) ** 2 * (1.0 + pair.friction) / body.inertia
        step = min(step, 1.4 / math.sqrt(pair.k_closing * softness))
        left = max(limits.max_time - state[TIME], 0.0)
        last = step >= left
        step = min(step, left)
        if not math.isfinite(step):
            status = NON_FINITE
            break

        # 0 nothing, 1 and 2 a gap rate is zero, 3 and 4 a corner leaves, 5 and 6 slip and spin, 7 the slope ends
        event = 0
        at = _rate_root(c, GAP_1, sign_1, step, zero_1)
        if at < math.inf:
            step, event = at, 1
        at = _rate_root(c, GAP_2, sign_2, step, zero_2)
        if at < math.inf:
            step, event = at, 2
        if sign_1 > 0:
            at = _root(c, GAP_1, -1.0, step, 0)
            if at < math.inf:
                step, event = at, 3
        if sign_2 > 0:
            at = _root(c, GAP_2, -1.0, step, 0)
            if at < math.inf:
                step, event = at, 4
        leave_slip, leave_spin = 0, 0
        if slip == 0:
            for sign in (1, -1):
                at = _bound_root(c, FORCE, sign, pair.friction, step)
                if at < math.inf:
                    step, event, leave_slip = at, 5, -sign
        elif pair.friction > 0.0:
            at = _root(c, SLIP, slip, step, zero_slip)
            if at < math.inf:
                step, event, leave_slip = at, 5, 0
        if spin == 0:
            for sign in (1, -1):
                at = _bound_root(c, MOMENT, sign, pair.corner_rolling_arm, step)
                if at < math.inf:
                    step, event, leave_spin = at, 6, -sign
        elif pair.corner_rolling_arm > 0.0:
            at = _root(c, SPIN, spin, step, zero_spin)
            if at < math.inf:
                step, event, leave_spin = at, 6, 0
        if slope.length < math.inf:
            q = c[SCRATCH]
            for k in range(ORDER + 1):
                q[k] = -c[X_, k]
            q[0] += slope.length
            at = first_root(q, step, 0, 0.0)
            if at < math.inf:
                step, event = at, 7

        if trajectory.shape[0] > 0:
            for i in range(3):
                t = step * i / 3
                turn = horner(c[THETA], t)
                spin_now = horner(c[SPIN], t)
                samples = add_sample(
                    trajectory,
                    samples,
                    state[TIME] + t,
                    horner(c[X_], t),
                    horner(c[Y], t),
                    turn + turns,
                    horner(c[SLIP], t) - height * math.cos(turn) * spin_now,
                    horner(c[V], t),
                    spin_now,
                    horner(c[NORMAL], t),
                    horner(c[FORCE], t),
                    horner(c[MOMENT], t),
                    CHORD,
                    slip,
                    spin,
                )
        stalled = 0 if state[TIME] + step > state[TIME] else stalled + 1
        before_1, before_2 = now[GAP_1], now[GAP_2]
        state[TIME] += step
        state[IMPULSE_N] += integral(c[NORMAL], step)
        state[IMPULSE_T] += integral(c[FORCE], step)
        state[IMPULSE_R] += integral(c[MOMENT], step)
        if slip != 0:
            state[SLIDING] += _loss(c, SLIP, slip * pair.friction, step)
        if spin != 0:
            state[ROLLING] += _loss(c, SPIN, spin * pair.corner_rolling_arm, step)
        for row in range(8):
            now[row] = horner(c[row], step)
        if event == 3:
            now[GAP_1] = 0.0
        if event == 4:
            now[GAP_2] = 0.0
        # One sum of both corners: a mirror image exchanges them.
        eased = (before_1 * before_1 - now[GAP_1] * now[GAP_1] if sign_1 > 0 else 0.0) + (
            before_2 * before_2 - now[GAP_2] * now[GAP_2] if sign_2 > 0 else 0.0
        )
        state[HYSTERESIS] += 0.5 * (pair.k_closing - pair.k_opening) * eased
        zero_1, zero_2, zero_slip, zero_spin = 0, 0, 0, 0

        if event == 0:
            if last:
                status = TIMEOUT
                break
            if not math.isfinite(now[Y] + now[V] + now[SPIN] + now[SLIP]):
                status = NON_FINITE
                break
        elif event in (3, 4):
            status = ONE_CORNER
            break
        elif event == 7:
            now[X_] = slope.length
            status = FINISH
            break
        elif event == 5:
            now[SLIP] = 0.0
            slip = leave_slip
            zero_slip = 2
            choose = leave_slip == 0
        elif event == 6:
            now[SPIN] = 0.0
            spin = leave_spin
            zero_spin = 2
            choose = leave_spin == 0
        else:
            # A gap rate is zero: does the corner turn back with the other stiffness, or does it rest? After a flat
            # landing both turn at the same time.
            sine, cosine = math.sin(now[THETA]), math.cos(now[THETA])
            both = abs(2.0 * half * cosine * now[SPIN]) <= TOGETHER * scale
            if both:
                now[SPIN] = 0.0
            turning_1, turning_2 = both or event == 1, both or event == 2
            pulls, pushes = True, True  # whether every turning corner would close, or open
            for sign in (-1, 1):
                trial_1 = sign if turning_1 else sign_1
                trial_2 = sign if turning_2 else sign_2
                k_1 = pair.k_closing if trial_1 < 0 else pair.k_opening
                k_2 = pair.k_closing if trial_2 < 0 else pair.k_opening
                _expand(body, pair, slope, k_1, k_2, slip, spin, now, c)
                for turning, row in ((turning_1, GAP_1), (turning_2, GAP_2)):
                    if turning and sign < 0 and not c[row, 2] < 0.0:
                        pulls = False
                    if turning and sign > 0 and not c[row, 2] > 0.0:
                        pushes = False
            if not pulls and not pushes:
                status = TUMBLED
                break
            if turning_1:
                sign_1, zero_1 = 1 if pushes else -1, 1
            if turning_2:
                sign_2, zero_2 = 1 if pushes else -1, 1
            choose = True

    # Back to the coordinates of the corner that touches, or of the deeper one.
    tail = now[GAP_1] < now[GAP_2] or (now[GAP_1] == now[GAP_2] and now[THETA] < 0.0)
    side = 1.0 if tail else -1.0
    sine, cosine = math.sin(now[THETA]), math.cos(now[THETA])
    a = -height * sine - side * half * cosine
    b = height * cosine - side * half * sine
    state[FEATURE] = TAIL if tail else NOSE
    state[PHI] = now[THETA] + turns
    state[X] = now[X_]
    state[OMEGA] = now[SPIN]
    state[GAP] = now[GAP_1] if tail else now[GAP_2]
    state[V_N] = now[V] - a * now[SPIN]
    state[V_T] = now[SLIP] - (height * cosine - b) * now[SPIN]
    state[STORED] = 0.5 * pair.k_closing * (min(now[GAP_1], 0.0) ** 2 + min(now[GAP_2], 0.0) ** 2)
    if status == ONE_CORNER and state[GAP] >= 0.0:
        status = RUNNING
    return status, steps, samples
