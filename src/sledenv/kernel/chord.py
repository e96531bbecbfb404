"""Contact of the chord: both corners touch, each by the two-stiffness law of its own; docs/physics.md, section 8.

With ``theta`` = phi - pi the point of each side lies at the arms ``a = -A sin(theta) - B cos(theta)`` and ``b = r + A
cos(theta) - B sin(theta)``. While it is a corner, ``A`` is the distance of the mass centre from the chord, ``B`` half
the chord (negative on the side of the nose) and ``r`` zero; where a body presses in so deep that it turns past the end
of its arc, the arc takes over on that side with ``A = h``, ``B = 0`` and its radius. The two normal forces are
independent; the body slips as one, at the mean of the two arms b, which differ by no more than the penetrations do.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sledenv.kernel.contact import MOST_STALLED, Pair, leading_zeros, sign_of
from sledenv.kernel.events import before_separation, both_signs, bound_root, series_root, slope_end
from sledenv.kernel.friction import mobility, resolve
from sledenv.kernel.geometry import corner_lengths
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, Incline, Limits
from sledenv.kernel.records import (
    ARC,
    BURIED,
    CHORD,
    FINISH,
    NON_FINITE,
    NOSE,
    RUNNING,
    STEP_BUDGET,
    TAIL,
    TIMEOUT,
    TUMBLED,
)
from sledenv.kernel.roots import first_root, horner
from sledenv.kernel.rows import WIDTH
from sledenv.kernel.series import (
    ORDER,
    R_COSINE,
    R_FORCE,
    R_MOMENT,
    R_NORMAL,
    R_SCRATCH,
    R_SINE,
    longest_step,
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
from sledenv.kernel.step import NO_DEPTH
from sledenv.kernel.trajectory import CONTACT_ROWS, add_sample

TOGETHER = 1e-12  # of the speed scale: gap rates of the two sides that are equal but for rounding
TOUCHING = 1e-9  # of the size: gap of the second corner where it starts to touch
ONE_CORNER = -3  # status: one side has left, the other still touches

# Rows of the table of series, beside those of a single contact: GAP is the gap of the side of the tail, V_N the
# velocity of the mass centre; PHI counts from the orientation in which the chord lies flat. Time is in seconds.
Y = 0
# SPEED is the velocity of the mass centre along the slope; the moment of the other forces is the product of sine and
# PULL_SINE and that of cosine and PULL_COSINE.
GAP_2, SPEED, NORMAL_1, NORMAL_2, LOAD, PULL_SINE, PULL_COSINE = range(13, 20)
ROWS = 20
NOW_ROWS = GAP_2 + 1
STATE_ROWS = (Y, X, PHI, GAP, V_N, V_T, OMEGA, GAP_2)


class Side(NamedTuple):
    """Where one of the two contacts lies; see the top of this module."""

    along: float  # [m] A
    across: float  # [m] B
    radius: float  # [m] r
    rolling_arm: float  # [m] delta


@kernel
def _side(body: Body, pair: Pair, tail: bool, on_arc: bool) -> Side:
    if on_arc:
        return Side(body.eccentricity, 0.0, body.radius, pair.rolling_arm)
    height, half = corner_lengths(body)
    return Side(height, half if tail else -half, 0.0, pair.corner_rolling_arm)


@kernel
def _arms(side: Side, theta: float) -> tuple[float, float]:
    sine, cosine = math.sin(theta), math.cos(theta)
    return -side.along * sine - side.across * cosine, side.radius + side.along * cosine - side.across * sine


@kernel
def _mean(one: Side, two: Side) -> Side:
    """Where the body slips."""
    return Side(0.5 * (one.along + two.along), 0.5 * (one.across + two.across), 0.5 * (one.radius + two.radius), 0.0)


@kernel
def product(p: np.ndarray, q: np.ndarray, k: int, first: int) -> float:
    """Coefficient ``k`` of the product of two series, without the first so many coefficients of ``p``."""
    total = 0.0
    for i in range(first, k + 1):
        total += p[i] * q[k - i]
    return total


@kernel
def integral(series: np.ndarray, t: float) -> float:
    """Integral of a force or power series from 0 to ``t``."""
    total = 0.0
    for k in range(ORDER - 1, -1, -1):
        total = total * t + series[k] / (k + 1)
    return total * t


@kernel
def _expand(
    body: Body,
    friction: float,
    slope: Incline,
    one: Side,
    two: Side,
    stiffness_1: float,
    stiffness_2: float,
    slip: int,
    spin: int,
    now: np.ndarray,
    c: np.ndarray,
) -> None:
    """Fill ``c`` with the series of one step from the state rows of ``now``: docs/physics.md (8.4)."""
    m = body.mass
    downhill, inward = slope.downhill, slope.inward
    mean = _mean(one, two)
    for row in STATE_ROWS:
        c[row, 0] = now[row]
    sine, cosine, spins, rise, speed = c[R_SINE], c[R_COSINE], c[OMEGA], c[V_N], c[SPEED]
    pull_sine, pull_cosine = c[PULL_SINE], c[PULL_COSINE]
    sine[0], cosine[0] = math.sin(now[PHI]), math.cos(now[PHI])
    arm = mean.radius + mean.along * cosine[0] - mean.across * sine[0]
    speed[0] = now[V_T] - arm * spins[0]
    tilt, lever = sine[0] * spins[0], cosine[0] * spins[0]  # products of sine and cosine with the spin
    for k in range(ORDER):
        after = 1.0 / (k + 1)
        weight, drive = (inward, downhill) if k == 0 else (0.0, 0.0)
        n_1, n_2 = -stiffness_1 * c[GAP, k], -stiffness_2 * c[GAP_2, k]
        normal, load = n_1 + n_2, one.rolling_arm * n_1 + two.rolling_arm * n_2
        c[NORMAL_1, k], c[NORMAL_2, k], c[R_NORMAL, k], c[LOAD, k] = n_1, n_2, normal, load
        c[GAP, k + 1] = (rise[k] + one.along * tilt + one.across * lever) * after
        c[GAP_2, k + 1] = (rise[k] + two.along * tilt + two.across * lever) * after
        c[X, k + 1] = speed[k] * after
        c[Y, k + 1] = rise[k] * after
        c[PHI, k + 1] = spins[k] * after
        sine[k + 1], cosine[k + 1] = lever * after, -tilt * after
        rise[k + 1] = (normal / m - weight) * after
        # What depends on the spin to come is left out at first: its own coefficient, and the force that comes with it.
        tilt, lever = product(sine, spins, k + 1, 1), product(cosine, spins, k + 1, 1)
        drift = mean.along * lever - mean.across * tilt
        pull_sine[k] = one.along * n_1 + two.along * n_2
        pull_cosine[k] = one.across * n_1 + two.across * n_2
        turning = product(pull_sine, sine, k, 0) + product(pull_cosine, cosine, k, 0)
        force = -slip * friction * normal
        spin_rate = 0.0
        if spin != 0:
            moment = -spin * load
            if slip == 0:
                held = (k + 1) * drift + drive
                spin_rate = (turning + moment - m * arm * held) / (body.inertia + m * arm * arm)
                force = -m * (arm * spin_rate + held)
            else:
                spin_rate = (turning + moment + arm * force) / body.inertia
        else:
            if slip == 0:
                force = -m * drive
            moment = -turning - arm * force
        c[R_FORCE, k], c[R_MOMENT, k] = force, moment
        pull_sine[k] -= mean.across * force
        pull_cosine[k] += mean.along * force
        spins[k + 1] = spin_rate * after
        speed[k + 1] = (force / m + drive) * after
        tilt += sine[0] * spins[k + 1]
        lever += cosine[0] * spins[k + 1]
        slipping = speed[k + 1] + mean.radius * spins[k + 1] + mean.along * lever - mean.across * tilt
        c[V_T, k + 1] = 0.0 if slip == 0 else slipping
    for row in (R_NORMAL, NORMAL_1, NORMAL_2, LOAD, R_FORCE, R_MOMENT):
        c[row, ORDER] = 0.0


@kernel
def _rate_root(c: np.ndarray, row: int, sign: float, step: float, vanishing: int) -> float:
    """First zero of the derivative of a gap."""
    q = c[R_SCRATCH]
    for k in range(ORDER):
        q[k] = sign * (k + 1) * c[row, k + 1]
    q[ORDER:] = 0.0
    return first_root(q, step, vanishing, 0.0)


@kernel
def _edge_root(c: np.ndarray, sign: float, edge: float, step: float, at_edge: int) -> float:
    """Time at which ``sign * theta`` falls below ``edge``."""
    q = c[R_SCRATCH]
    for k in range(WIDTH):
        q[k] = sign * c[PHI, k]
    q[0] -= edge
    return first_root(q, step, at_edge, 0.0)


@kernel
def _loss(c: np.ndarray, bound: int, row: int, factor: float, step: float) -> float:
    """Work of ``factor`` times the bound of a friction force against the velocity in ``row``."""
    q = c[R_SCRATCH]
    for k in range(ORDER):
        q[k] = factor * product(c[bound], c[row], k, 0)
    return max(integral(q, step), 0.0)


@kernel
def chord_contact(
    body: Body,
    pair: Pair,
    slope: Incline,
    limits: Limits,
    state: np.ndarray,
    c: np.ndarray,
    now: np.ndarray,
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
        That of the feature that came down first; overwritten by that of the one that touches last.
    c, now : ndarray, shapes (ROWS, WIDTH) and (NOW_ROWS,)
        Work space.
    steps, trajectory, samples
        As for :func:`sledenv.kernel.contact.contact`.

    Returns
    -------
    tuple of int
        Status (ONE_CORNER where one side has left, RUNNING where both have, TUMBLED where a side comes to rest, BURIED
        where both corners are in the slope with the arc between them down), steps and samples.
    """
    size = body.radius + body.eccentricity
    downhill, inward = slope.downhill, slope.inward
    _, half = corner_lengths(body)
    edge = math.pi - body.half_angle  # of theta, where the arc takes over from a corner
    turns = math.pi * (2.0 * math.floor(state[PHI] / (2.0 * math.pi)) + 1.0)  # the odd multiple of pi nearby
    theta = state[PHI] - turns
    started = int(state[FEATURE])
    tail_first = started == TAIL or (started == ARC and theta < 0.0)
    arc_1, arc_2 = started == ARC and tail_first, started == ARC and not tail_first
    one, two = _side(body, pair, True, arc_1), _side(body, pair, False, arc_2)
    a, b = _arms(one if tail_first else two, theta)
    _, b_other = _arms(two if tail_first else one, theta)
    # Of two corners the difference of the arms suffers no cancellation.
    other = state[GAP] + (b - b_other if started == ARC else (-2.0 if tail_first else 2.0) * half * math.sin(theta))
    if abs(other) > TOUCHING * size:
        return BURIED, steps, samples
    omega = state[OMEGA]
    c[:] = 0.0
    now[:] = 0.0
    now[PHI] = theta
    now[X] = state[X]
    now[Y] = state[GAP] + b
    now[V_N] = state[V_N] + a * omega
    now[OMEGA] = omega
    now[V_T] = state[V_T] + (_arms(_mean(one, two), theta)[1] - b) * omega
    if abs(now[V_T]) <= 1e-15 * (abs(state[V_T]) + size * abs(omega)):
        now[V_T] = 0.0
    now[GAP] = state[GAP] if tail_first else min(other, 0.0)
    now[GAP_2] = min(other, 0.0) if tail_first else state[GAP]
    scale = max(abs(now[V_N]), abs(now[V_T]), size * abs(omega), math.sqrt(slope.gravity * size), 1e-12)
    sign_1 = 1 if now[V_N] - _arms(one, theta)[0] * omega > 0.0 else -1
    sign_2 = 1 if now[V_N] - _arms(two, theta)[0] * omega > 0.0 else -1
    slip, spin = 0, 0
    zero_1, zero_2, zero_slip, zero_spin = 0, 0, 0, 0  # leading coefficients that vanish by construction
    at_edge = 0  # the side whose feature has just changed
    left_slip, left_spin = 0, 0  # signs with which velocities have just been released
    choose = True
    stalled = 0
    while True:
        k_1 = pair.k_closing if sign_1 < 0 else pair.k_opening
        k_2 = pair.k_closing if sign_2 < 0 else pair.k_opening
        if choose:
            shallow = NO_DEPTH * size
            depth_1, depth_2 = max(-now[GAP], shallow), max(-now[GAP_2], shallow)
            if min(-now[GAP], -now[GAP_2]) > 0.0 and max(-now[GAP], -now[GAP_2]) < shallow:
                lift = shallow / max(-now[GAP], -now[GAP_2])  # both are loaded: their ratio counts
                depth_1, depth_2 = -now[GAP] * lift, -now[GAP_2] * lift
            n_1, n_2 = k_1 * depth_1, k_2 * depth_2
            # For the box rule the two normal forces act as their sum, at the arm of their resultant.
            lever = (_arms(one, now[PHI])[0] * n_1 + _arms(two, now[PHI])[0] * n_2) / (n_1 + n_2)
            arm = (one.rolling_arm * n_1 + two.rolling_arm * n_2) / (n_1 + n_2)
            middle = _mean(one, two)
            a, b = _arms(middle, now[PHI])
            locked = (slip, spin)
            _, slip, spin = resolve(
                mobility(body.mass, body.inertia, lever, b),
                downhill + a * now[OMEGA] * now[OMEGA],
                -inward,
                pair.friction,
                arm,
                size,
                n_1 + n_2,
                n_1 + n_2,
                -1,
                2 * left_slip if left_slip != 0 else sign_of(now[V_T]),
                2 * left_spin if left_spin != 0 else sign_of(now[OMEGA]),
            )
            # A friction without a force has no surface to stay on: its velocity passes zero freely.
            if pair.friction == 0.0:
                slip = 1
            if arm == 0.0:
                spin = 1
            leaving = 2 if (slip != locked[0]) + (spin != locked[1]) == 1 else 1
            zero_slip = (leaving if left_slip != 0 else 1) if now[V_T] == 0.0 else 0
            zero_spin = (leaving if left_spin != 0 else 1) if now[OMEGA] == 0.0 else 0
            choose = False
        if steps >= limits.max_steps or stalled > MOST_STALLED:
            status = STEP_BUDGET
            break
        steps += 1
        _expand(body, pair.friction, slope, one, two, k_1, k_2, slip, spin, now, c)
        if zero_slip == 2:
            zero_slip = leading_zeros(c[V_T], slip)
        if zero_spin == 2:
            zero_spin = leading_zeros(c[OMEGA], spin)
        softness = 2.0 / body.mass + 2.0 * size**2 * (1.0 + pair.friction) / body.inertia
        most = 1.4 / math.sqrt(pair.k_closing * softness)
        step = longest_step(size, scale, limits.tolerance, most, c)
        left = max(limits.max_time - state[TIME], 0.0)
        last = step >= left
        step = min(step, left)
        if not math.isfinite(step):
            status = NON_FINITE
            break

        # 0 nothing, 1 and 2 a gap rate is zero, 3 and 4 a side leaves, 5 and 6 slip and spin, 7 the slope ends, 8 and 9
        # the arc takes over from a corner or the corner from the arc, 10 the middle of the arc is lowest
        event = 0
        # The side that came down first is asked first: the order must not tell a body from its mirror image.
        for i in (0, 1):
            tail = (i == 0) == tail_first
            row, sign, zero = (GAP, sign_1, zero_1) if tail else (GAP_2, sign_2, zero_2)
            at = _rate_root(c, row, sign, step, zero)
            if at < math.inf:
                step, event = at, 1 if tail else 2
            if sign > 0:
                at = series_root(c, row, -1, step, 0)
                if at < math.inf:
                    step, event = at, 3 if tail else 4
        # Where one side leaves alone, a release at that very time is left to the contact of the other.
        before = before_separation(step) if event in (3, 4) else math.inf
        release_slip, release_spin = 0, 0
        if slip == 0:
            for sign in both_signs(c[R_FORCE, 0]):
                at = bound_root(c, R_NORMAL, R_FORCE, sign, pair.friction, step)
                if at < before:
                    step, event, release_slip = at, 5, -sign
        elif pair.friction > 0.0:
            at = series_root(c, V_T, slip, step, zero_slip)
            if at < math.inf:
                step, event, release_slip = at, 5, 0
        if spin == 0:
            for sign in both_signs(c[R_MOMENT, 0]):
                at = bound_root(c, LOAD, R_MOMENT, sign, 1.0, step)
                if at < before:
                    step, event, release_spin = at, 6, -sign
        elif one.rolling_arm + two.rolling_arm > 0.0:
            at = series_root(c, OMEGA, spin, step, zero_spin)
            if at < math.inf:
                step, event, release_spin = at, 6, 0
        if slope.length < math.inf:
            at = slope_end(slope.length, c, step)
            if at < math.inf:
                step, event = at, 7
        zero_edge = 1 if at_edge == 1 else 0
        at = _edge_root(c, -1.0, edge, step, zero_edge) if arc_1 else _edge_root(c, 1.0, -edge, step, zero_edge)
        if at < math.inf:
            step, event = at, 8
        zero_edge = 1 if at_edge == 2 else 0
        at = _edge_root(c, 1.0, edge, step, zero_edge) if arc_2 else _edge_root(c, -1.0, -edge, step, zero_edge)
        if at < math.inf:
            step, event = at, 9
        if arc_1 or arc_2:
            at = _edge_root(c, 1.0 if arc_1 else -1.0, -math.pi, step, 0)
            if at < math.inf:
                step, event = at, 10

        if trajectory.shape[0] > 0 and step > 0.0:
            middle = _mean(one, two)
            rows = max(CONTACT_ROWS, math.ceil(step / limits.sample_interval))
            for i in range(rows + 1):
                t = step * (i / rows)
                turn = horner(c[PHI], t)
                spin_now = horner(c[OMEGA], t)
                samples = add_sample(
                    trajectory,
                    samples,
                    state[TIME] + t,
                    horner(c[X], t),
                    horner(c[Y], t),
                    turn + turns,
                    horner(c[V_T], t) - _arms(middle, turn)[1] * spin_now,
                    horner(c[V_N], t),
                    spin_now,
                    horner(c[R_NORMAL], t),
                    horner(c[R_FORCE], t),
                    horner(c[R_MOMENT], t),
                    CHORD,
                    slip,
                    spin,
                )
        stalled = 0 if state[TIME] + step > state[TIME] else stalled + 1
        before_1, before_2 = now[GAP], now[GAP_2]
        state[TIME] += step
        state[IMPULSE_N] += integral(c[R_NORMAL], step)
        state[IMPULSE_T] += integral(c[R_FORCE], step)
        state[IMPULSE_R] += integral(c[R_MOMENT], step)
        if slip != 0:
            state[SLIDING] += _loss(c, R_NORMAL, V_T, slip * pair.friction, step)
        if spin != 0:
            state[ROLLING] += _loss(c, LOAD, OMEGA, float(spin), step)
        for row in STATE_ROWS:
            now[row] = horner(c[row], step)
        if event == 3:
            now[GAP] = 0.0
        if event == 4:
            now[GAP_2] = 0.0
        # One sum of both sides: a mirror image exchanges them.
        eased = (before_1 * before_1 - now[GAP] * now[GAP] if sign_1 > 0 else 0.0) + (
            before_2 * before_2 - now[GAP_2] * now[GAP_2] if sign_2 > 0 else 0.0
        )
        state[HYSTERESIS] += 0.5 * (pair.k_closing - pair.k_opening) * eased
        at_edge = 0
        if step > 0.0:
            zero_1, zero_2, zero_slip, zero_spin = 0, 0, 0, 0
            left_slip, left_spin = 0, 0

        if event == 0:
            if last:
                status = TIMEOUT
                break
            if not math.isfinite(now[Y] + now[V_N] + now[OMEGA] + now[V_T]):
                status = NON_FINITE
                break
        elif event in (3, 4):
            status = ONE_CORNER
            break
        elif event == 7:
            now[X] = slope.length
            status = FINISH
            break
        elif event == 10:
            status = BURIED
            break
        elif event == 5:
            now[V_T] = 0.0
            left_slip = release_slip
            choose = True
        elif event == 6:
            now[OMEGA] = 0.0
            left_spin = release_spin
            choose = True
        elif event in (8, 9):
            if event == 8:
                arc_1 = not arc_1
                now[PHI] = -edge
                at_edge = 1
                one = _side(body, pair, True, arc_1)
            else:
                arc_2 = not arc_2
                now[PHI] = edge
                at_edge = 2
                two = _side(body, pair, False, arc_2)
            choose = True
        else:
            # A gap rate is zero: does the side turn back with the other stiffness, or does it rest? After a flat
            # landing both turn at the same time.
            apart = _arms(one, now[PHI])[0] - _arms(two, now[PHI])[0]
            both = abs(apart * now[OMEGA]) <= TOGETHER * scale
            if both:
                now[OMEGA] = 0.0
            turning_1, turning_2 = both or event == 1, both or event == 2
            closes, opens = True, True  # whether every turning side would close, or open
            for sign in (-1, 1):
                trial_1 = sign if turning_1 else sign_1
                trial_2 = sign if turning_2 else sign_2
                k_1 = pair.k_closing if trial_1 < 0 else pair.k_opening
                k_2 = pair.k_closing if trial_2 < 0 else pair.k_opening
                _expand(body, pair.friction, slope, one, two, k_1, k_2, slip, spin, now, c)
                for turning, row in ((turning_1, GAP), (turning_2, GAP_2)):
                    if turning and sign < 0 and not c[row, 2] < 0.0:
                        closes = False
                    if turning and sign > 0 and not c[row, 2] > 0.0:
                        opens = False
            if not closes and not opens:
                status = TUMBLED
                break
            if turning_1:
                sign_1, zero_1 = 1 if opens else -1, 1
            if turning_2:
                sign_2, zero_2 = 1 if opens else -1, 1
            choose = True

    # Back to the coordinates of the side that touches, or of the deeper one.
    tail = now[GAP] < now[GAP_2]
    if now[GAP] == now[GAP_2]:  # flat: the side that came down first, or a mirror image would end on the same side
        tail = now[PHI] < 0.0 or (now[PHI] == 0.0 and tail_first)
    a, b = _arms(one if tail else two, now[PHI])
    on_arc = arc_1 if tail else arc_2
    state[FEATURE] = ARC if on_arc else (TAIL if tail else NOSE)
    state[PHI] = now[PHI] + turns
    state[X] = now[X]
    state[OMEGA] = now[OMEGA]
    state[GAP] = now[GAP] if tail else now[GAP_2]
    state[V_N] = now[V_N] - a * now[OMEGA]
    state[V_T] = now[V_T] - (_arms(_mean(one, two), now[PHI])[1] - b) * now[OMEGA]
    state[STORED] = 0.5 * pair.k_closing * (min(now[GAP], 0.0) ** 2 + min(now[GAP_2], 0.0) ** 2)
    if status == ONE_CORNER and state[GAP] >= 0.0:
        status = RUNNING
    return status, steps, samples
