"""What ends a step of a contact, and when: each event is the first root of a series."""

from __future__ import annotations

import math

import numpy as np

from sledenv.kernel.geometry import has_corners
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body
from sledenv.kernel.records import ARC, NOSE, TAIL
from sledenv.kernel.roots import first_root
from sledenv.kernel.series import ORDER, R_COSINE, R_FORCE, R_MOMENT, R_NORMAL, R_SCRATCH, R_SINE
from sledenv.kernel.state import GAP, OMEGA, PHI, V_N, V_T, X

FLAT = 1e-13  # [rad] rounding error of an orientation after many turns

NOTHING, SEPARATION, RATE_ZERO, SLIP_ZERO, SPIN_ZERO = range(5)
RATE_RELEASED, SLIP_RELEASED, SPIN_RELEASED, FEATURE_ENDS, CHORD_DOWN, SLOPE_ENDS = range(5, 11)


@kernel
def both_signs(value: float) -> tuple[int, int]:
    """Both signs, that of ``value`` first: the order must not tell a body from its mirror image."""
    return (-1, 1) if value < 0.0 else (1, -1)


@kernel
def series_root(c: np.ndarray, row: int, sign: int, step: float, vanishing: int) -> float:
    """Time at which ``sign`` times a series, positive at first, becomes negative; see :func:`first_root`."""
    q = c[R_SCRATCH]
    for k in range(ORDER + 1):
        q[k] = sign * c[row, k]
    return first_root(q, step, vanishing, 0.0)


@kernel
def bound_root(c: np.ndarray, load: int, row: int, sign: int, factor: float, step: float) -> float:
    """Time at which ``sign`` times a locked force exceeds ``factor`` times its load."""
    q = c[R_SCRATCH]
    for k in range(ORDER):
        q[k] = factor * c[load, k] - sign * c[row, k]
    q[ORDER] = 0.0
    noise = 1e-15 * (abs(factor * c[load, 0]) + abs(c[row, 0]))
    return first_root(q, step, 0, noise)


@kernel
def _normal_root(c: np.ndarray, sign: int, limit: float, step: float) -> float:
    """Time at which the normal force of a locked gap passes ``limit``, upwards if ``sign`` is 1."""
    q = c[R_SCRATCH]
    for k in range(ORDER):
        q[k] = -sign * c[R_NORMAL, k]
    q[0] += sign * limit
    q[ORDER] = 0.0
    return first_root(q, step, 0, 1e-15 * (abs(limit) + abs(c[R_NORMAL, 0])))


@kernel
def _feature_end(body: Body, feature: int, c: np.ndarray, step: float, vanishing: int) -> float:
    """Time at which the contact passes from the arc to a corner or back."""
    omega = c[OMEGA, 0]
    q = c[R_SCRATCH]
    best = math.inf
    for side in (1, -1):
        if feature == ARC:
            sign = -side
        elif (feature == TAIL and side == 1) or (feature == NOSE and side == -1):
            sign = side
        else:
            continue
        for k in range(ORDER + 1):
            q[k] = sign * c[PHI, k]
        q[0] -= sign * side * body.half_angle
        at_edge = vanishing if abs(q[0]) <= 1e-15 * (body.half_angle + abs(omega) * step) else 0
        best = min(best, first_root(q, step, at_edge, 0.0))
    return best


@kernel
def _chord_down(body: Body, feature: int, shift: float, c: np.ndarray, step: float) -> float:
    """Time at which the corner on the other side comes down: docs/physics.md, section 8.2."""
    q = c[R_SCRATCH]
    if feature == ARC:
        # Beyond the far end of the arc, which only a body that is pressed in deep brings so low.
        radius, across = body.radius, 1.0 if c[PHI, 0] > 0.0 else -1.0
        cosine, sine = radius * math.cos(body.half_angle), across * radius * math.sin(body.half_angle)
        for k in range(ORDER + 1):
            q[k] = c[GAP, k] - cosine * c[R_COSINE, k] + sine * c[R_SINE, k]
        q[0] += radius
        reach = radius
    else:
        reach = 2.0 * body.radius * math.sin(body.half_angle) * (1.0 if feature == TAIL else -1.0)
        for k in range(ORDER + 1):
            q[k] = c[GAP, k] + reach * (c[R_SINE, k] * math.cos(shift) - c[R_COSINE, k] * math.sin(shift))
    return first_root(q, step, 0, FLAT * abs(reach))


@kernel
def slope_end(length: float, c: np.ndarray, step: float) -> float:
    """Time at which the mass centre reaches the end of the slope."""
    q = c[R_SCRATCH]
    for k in range(ORDER + 1):
        q[k] = -c[X, k]
    q[0] += length
    return first_root(q, step, 0, 0.0)


@kernel
def first_event(
    body: Body,
    feature: int,
    shift: float,
    friction: float,
    arm: float,
    closing_normal: float,
    opening_normal: float,
    length: float,
    branch: tuple[int, int, int],
    vanishing: tuple[int, int, int],
    at_edge: int,
    c: np.ndarray,
    step: float,
) -> tuple[float, int, int]:
    """Find the first event of a step.

    Parameters
    ----------
    body : Body
    feature, shift
        What touches, and its angle from :func:`feature_geometry`.
    friction, arm : float
        Coulomb coefficient [-] and rolling arm [m] of the feature.
    closing_normal, opening_normal : float
        Bounds of the normal force [N] where the gap is locked; inf and 0 if the contact is rigid.
    length : float
        End of the slope [m].
    branch : tuple of int
        Signs of v_n, v_t and omega, 0 where locked.
    vanishing : tuple of int
        Number of leading coefficients of v_n, v_t and omega that are zero by construction.
    at_edge : int
        1 if the contact has just passed from one feature to the other.
    c : ndarray, shape (ROWS, ORDER + 1)
        The series of the step.
    step : float
        Length of the step [s].

    Returns
    -------
    tuple
        Time of the event (``step`` if there is none), its code, and the sign with which a released velocity leaves.
    """
    gap_rate, slip, spin = branch
    event = NOTHING
    released = 0
    # Each event found shortens the interval in which the next one is sought.
    if gap_rate == 0:
        if closing_normal < math.inf:
            at = _normal_root(c, 1, closing_normal, step)
            if at < math.inf:
                step, event, released = at, RATE_RELEASED, -1
        at = _normal_root(c, -1, opening_normal, step)
        if at < math.inf:
            step, event, released = at, RATE_RELEASED, 1
    else:
        at = series_root(c, V_N, gap_rate, step, vanishing[0])
        if at < math.inf:
            step, event = at, RATE_ZERO
        if gap_rate > 0:
            at = series_root(c, GAP, -1, step, 0)
            if at < math.inf:
                step, event = at, SEPARATION
    # Every slack of a locked force vanishes with the normal force: rounding must not let it beat the separation.
    before = step * (1.0 - 1e-12) if event == SEPARATION else math.inf
    if slip == 0:
        for sign in both_signs(c[R_FORCE, 0]):
            at = bound_root(c, R_NORMAL, R_FORCE, sign, friction, step)
            if at < before:
                step, event, released = at, SLIP_RELEASED, -sign
    else:
        at = series_root(c, V_T, slip, step, vanishing[1])
        if at < math.inf:
            step, event = at, SLIP_ZERO
    if spin == 0:
        for sign in both_signs(c[R_MOMENT, 0]):
            at = bound_root(c, R_NORMAL, R_MOMENT, sign, arm, step)
            if at < before:
                step, event, released = at, SPIN_RELEASED, -sign
    else:
        at = series_root(c, OMEGA, spin, step, vanishing[2])
        if at < math.inf:
            step, event = at, SPIN_ZERO
    if has_corners(body):
        at = _feature_end(body, feature, c, step, at_edge)
        if at < math.inf:
            step, event = at, FEATURE_ENDS
        if feature != ARC or body.half_angle > 0.5 * math.pi:
            at = _chord_down(body, feature, shift, c, step)
            if at < math.inf:
                step, event = at, CHORD_DOWN
    if length < math.inf:
        at = slope_end(length, c, step)
        if at < math.inf:
            step, event = at, SLOPE_ENDS
    return step, event, released
