"""What ends a step of a contact, and when: each event is the first root of a series."""

from __future__ import annotations

import math

import numpy as np

from sledenv.kernel.geometry import has_corners
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body
from sledenv.kernel.records import ARC, NOSE, TAIL
from sledenv.kernel.roots import first_root, horner
from sledenv.kernel.rows import WIDTH
from sledenv.kernel.series import (
    E_SAFE_FORCE,
    E_SAFE_FORCE_BACK,
    E_SAFE_GAP,
    E_SAFE_LARGEST,
    E_SAFE_LEAST,
    E_SAFE_MOMENT,
    E_SAFE_MOMENT_BACK,
    E_SAFE_OMEGA,
    E_SAFE_OTHER,
    E_SAFE_V_N,
    E_SAFE_V_T,
    E_TRAVEL,
    E_TURN,
    R_COSINE,
    R_FORCE,
    R_MOMENT,
    R_NORMAL,
    R_SCRATCH,
    R_SINE,
    Z_ARM,
    Z_FRICTION,
    Z_LARGEST,
    Z_LEAST,
    Z_OTHER,
    Z_OTHER_COSINE,
    Z_OTHER_SINE,
    Z_PHI,
    Z_STEP,
    Z_THETA,
    Z_UNIT,
    Z_X,
)
from sledenv.kernel.state import GAP, OMEGA, PHI, V_N, V_T, X

FLAT = 1e-13  # [rad] rounding error of an orientation after many turns
MOST_POLISHED = 4

NOTHING, SEPARATION, RATE_ZERO, SLIP_ZERO, SPIN_ZERO = range(5)
RATE_RELEASED, SLIP_RELEASED, SPIN_RELEASED, FEATURE_ENDS, CHORD_DOWN, SLOPE_ENDS, MIDDLE_PASSED = range(5, 12)


@kernel
def both_signs(value: float) -> tuple[int, int]:
    """Both signs, that of ``value`` first: the order must not tell a body from its mirror image."""
    return (-1, 1) if value < 0.0 else (1, -1)


@kernel
def before_separation(at: float) -> float:
    """Time before which a release comes before a separation.

    Every slack of a locked force vanishes with the normal force: rounding must not let it beat the separation.
    """
    return at * (1.0 - 1e-12)


@kernel
def series_root(c: np.ndarray, row: int, sign: int, step: float, vanishing: int) -> float:
    """Time at which ``sign`` times a series, positive at first, becomes negative; see :func:`first_root`."""
    q = c[R_SCRATCH]
    for k in range(WIDTH):
        q[k] = sign * c[row, k]
    return first_root(q, step, vanishing, 0.0)


@kernel
def bound_root(c: np.ndarray, load: int, row: int, sign: int, factor: float, step: float) -> float:
    """Time at which ``sign`` times a locked force exceeds ``factor`` times its load."""
    q = c[R_SCRATCH]
    for k in range(WIDTH):
        q[k] = factor * c[load, k] - sign * c[row, k]
    noise = 1e-15 * (abs(factor * c[load, 0]) + abs(c[row, 0]))
    return first_root(q, step, 0, noise)


@kernel
def _normal_root(c: np.ndarray, sign: int, limit: float, step: float) -> float:
    """Time at which the normal force of a locked gap passes ``limit``, upwards if ``sign`` is 1."""
    q = c[R_SCRATCH]
    for k in range(WIDTH):
        q[k] = -sign * c[R_NORMAL, k]
    q[0] += sign * limit
    return first_root(q, step, 0, 1e-15 * (abs(limit) + abs(c[R_NORMAL, 0])))


@kernel
def _feature_end(body: Body, feature: int, c: np.ndarray, step: float, vanishing: int) -> float:
    """Time at which the contact passes from the arc to a corner or back."""
    q = c[R_SCRATCH]
    best = math.inf
    for side in (1, -1):
        if feature == ARC:
            sign = -side
        elif (feature == TAIL and side == 1) or (feature == NOSE and side == -1):
            sign = side
        else:
            continue
        for k in range(WIDTH):
            q[k] = sign * c[PHI, k]
        q[0] -= sign * side * body.half_angle
        at_edge = vanishing if abs(q[0]) <= 1e-15 * (body.half_angle + abs(c[PHI, 1]) * step) else 0
        best = min(best, first_root(q, step, at_edge, 0.0))
    return best


@kernel
def other_corner(body: Body, feature: int, shift: float) -> tuple[float, float, float]:
    """What the gap of the corner on the other side has over that of the feature: docs/physics.md, section 8.2.

    Returns
    -------
    tuple of float
        A constant [m], and the factors of sine and cosine of ``phi + shift``; inf, 0, 0 where no corner can come down.
        Where the arc touches, the factor of the sine is that for ``phi > 0``; it changes its sign with ``phi``.
    """
    if not has_corners(body):
        return math.inf, 0.0, 0.0
    across = body.radius * math.sin(body.half_angle)
    if feature == ARC:
        if body.half_angle <= 0.5 * math.pi:
            return math.inf, 0.0, 0.0
        # Beyond the far end of the arc, which only a body that is pressed in deep brings so low.
        return body.radius, across, -body.radius * math.cos(body.half_angle)
    reach = 2.0 * across * (1.0 if feature == TAIL else -1.0)
    return 0.0, reach * math.cos(shift), -reach * math.sin(shift)


@kernel
def _chord_down(z: np.ndarray, c: np.ndarray, step: float) -> float:
    """Time at which the corner on the other side comes down."""
    q = c[R_SCRATCH]
    for k in range(WIDTH):
        q[k] = c[GAP, k] + z[Z_OTHER_SINE] * c[R_SINE, k] + z[Z_OTHER_COSINE] * c[R_COSINE, k]
    q[0] += z[Z_OTHER]
    at = first_root(q, step, 0, FLAT * (abs(z[Z_OTHER_SINE]) + abs(z[Z_OTHER_COSINE])))
    if 0.0 < at < math.inf:
        # The step is chosen for the velocities: sine and cosine may converge less.
        for _ in range(MOST_POLISHED):
            theta = z[Z_THETA] - z[Z_PHI] + horner(c[PHI], at)
            sine, cosine = math.sin(theta), math.cos(theta)
            gap = horner(c[GAP], at) + z[Z_OTHER] + z[Z_OTHER_SINE] * sine + z[Z_OTHER_COSINE] * cosine
            turning = z[Z_OTHER_SINE] * cosine - z[Z_OTHER_COSINE] * sine
            rate = z[Z_UNIT] * (horner(c[V_N], at) + turning * horner(c[OMEGA], at))
            if not rate < 0.0:
                break
            at = max(at - gap / rate, 0.0)
    return at if at <= step else math.inf


@kernel
def slope_end(length: float, c: np.ndarray, step: float) -> float:
    """Time at which the mass centre reaches the end of the slope."""
    q = c[R_SCRATCH]
    for k in range(WIDTH):
        q[k] = -c[X, k]
    q[0] += length
    return first_root(q, step, 0, 0.0)


@kernel
def first_event(
    body: Body,
    feature: int,
    length: float,
    branch: tuple[int, int, int],
    vanishing: tuple[int, int, int],
    at_edge: int,
    event: int,
    z: np.ndarray,
    c: np.ndarray,
) -> tuple[float, int, int]:
    """Find the first event of a step that has been completed.

    The answers of :func:`sledenv.kernel.series.complete` tell most of what cannot happen; the rest is sought.

    Parameters
    ----------
    body : Body
    feature : int
        What touches.
    length : float
        End of the slope [m].
    branch : tuple of int
        Signs of v_n, v_t and omega, 0 where locked.
    vanishing : tuple of int
        Number of leading coefficients of v_n, v_t and omega that are zero by construction.
    at_edge : int
        1 if the contact has just passed from one feature to the other.
    event : int
        What happens at the end of the step, NOTHING if that is not known.
    z, c : ndarray, shapes (Z_ROWS,) and (ROWS, WIDTH)
        The series of the step, completed.

    Returns
    -------
    tuple
        Time of the event in units (that of the step if there is none), its code, and the sign with which a released
        velocity leaves.
    """
    gap_rate, slip, spin = branch
    step = z[Z_STEP]
    released = 0
    # Each event found shortens the interval in which the next one is sought.
    if gap_rate == 0:
        if z[Z_LARGEST] < math.inf and not z[E_SAFE_LARGEST] > 0.0:
            at = _normal_root(c, 1, z[Z_LARGEST], step)
            if at < math.inf:
                step, event, released = at, RATE_RELEASED, -1
        if not z[E_SAFE_LEAST] > 0.0:
            at = _normal_root(c, -1, z[Z_LEAST], step)
            if at < math.inf:
                step, event, released = at, RATE_RELEASED, 1
    else:
        if event != RATE_ZERO and not z[E_SAFE_V_N] > 0.0:
            at = series_root(c, V_N, gap_rate, step, vanishing[0])
            if at < math.inf:
                step, event = at, RATE_ZERO
        if gap_rate > 0 and event != SEPARATION and not z[E_SAFE_GAP] > 0.0:
            at = series_root(c, GAP, -1, step, 0)
            if at < math.inf:
                step, event = at, SEPARATION
    before = before_separation(step) if event == SEPARATION else math.inf
    if slip == 0:
        for sign in both_signs(c[R_FORCE, 0]):
            if not z[E_SAFE_FORCE if sign > 0 else E_SAFE_FORCE_BACK] > 0.0:
                at = bound_root(c, R_NORMAL, R_FORCE, sign, z[Z_FRICTION], step)
                if at < before:
                    step, event, released = at, SLIP_RELEASED, -sign
    elif event != SLIP_ZERO and not z[E_SAFE_V_T] > 0.0:
        at = series_root(c, V_T, slip, step, vanishing[1])
        if at < math.inf:
            step, event = at, SLIP_ZERO
    if spin == 0:
        for sign in both_signs(c[R_MOMENT, 0]):
            if not z[E_SAFE_MOMENT if sign > 0 else E_SAFE_MOMENT_BACK] > 0.0:
                at = bound_root(c, R_NORMAL, R_MOMENT, sign, z[Z_ARM], step)
                if at < before:
                    step, event, released = at, SPIN_RELEASED, -sign
    elif event != SPIN_ZERO and not z[E_SAFE_OMEGA] > 0.0:
        at = series_root(c, OMEGA, spin, step, vanishing[2])
        if at < math.inf:
            step, event = at, SPIN_ZERO
    if has_corners(body):
        inside = body.half_angle - abs(z[Z_PHI])
        if at_edge != 0 or not (inside if feature == ARC else -inside) > z[E_TURN]:
            at = _feature_end(body, feature, c, step, at_edge)
            if at < math.inf:
                step, event = at, FEATURE_ENDS
        if z[Z_OTHER] < math.inf and not z[E_SAFE_OTHER] > 0.0:
            at = _chord_down(z, c, step)
            if at < math.inf and feature == ARC and z[Z_OTHER_SINE] * horner(c[PHI], at) < 0.0:
                # By then the other end of the arc is further away: that one is heeded from the middle on.
                at = series_root(c, PHI, 1 if z[Z_OTHER_SINE] > 0.0 else -1, step, 0)
                if at < math.inf:
                    step, event = at, MIDDLE_PASSED
            elif at < math.inf:
                step, event = at, CHORD_DOWN
    if not length - z[Z_X] > z[E_TRAVEL]:
        at = slope_end(length, c, step)
        if at < math.inf:
            step, event = at, SLOPE_ENDS
    return step, event, released
