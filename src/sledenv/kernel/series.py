"""Power series of the state over one step of a contact, by recurrence: docs/physics.md, section 5."""

from __future__ import annotations

import math

import numpy as np

from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, Slope
from sledenv.kernel.state import GAP, OMEGA, PHI, V_N, V_T, X

ORDER = 20

# Rows of the table of series; the first seven line up with the contact state.
R_NORMAL, R_FORCE, R_MOMENT, R_SINE, R_COSINE, R_A, R_B, R_SPIN_RATE = range(7, 15)
R_SQUARE, R_DRIVE_T, R_DRIVE_N, R_LEVER, R_DIVISOR, R_POWER_SLIDING, R_POWER_ROLLING, R_SCRATCH = range(15, 23)
ROWS = 23


@kernel
def product(p: np.ndarray, q: np.ndarray, k: int) -> float:
    """Coefficient ``k`` of the product of two series."""
    total = 0.0
    for i in range(k + 1):
        total += p[i] * q[k - i]
    return total


@kernel
def expand(
    body: Body,
    geometry: tuple[float, float, float],
    friction: float,
    arm: float,
    slope: Slope,
    stiffness: float,
    gap_rate: int,
    slip: int,
    spin: int,
    state: np.ndarray,
    c: np.ndarray,
) -> None:
    """Fill the table ``c`` with the series of one step in the given branch: docs/physics.md (5.5)-(5.9).

    Parameters
    ----------
    body, slope
        See :mod:`sledenv.kernel.params`.
    geometry : tuple of float
        Of the touching feature, from :func:`feature_geometry`.
    friction, arm : float
        Coulomb coefficient [-] and rolling arm [m] of the feature.
    stiffness : float
        Normal stiffness [N/m] of the branch; not used where ``gap_rate`` is 0.
    gap_rate, slip, spin : int
        The branch: signs of v_n, v_t and omega, 0 where locked.
    state : ndarray, shape (STATE_SIZE,)
        Contact state at the start of the step.
    c : ndarray, shape (ROWS, ORDER + 1)
        Overwritten.
    """
    m = body.mass
    inertia = body.inertia
    h, r, shift = geometry
    downhill = slope.gravity * math.sin(slope.angle)
    inward = slope.gravity * math.cos(slope.angle)
    mu = -slip * friction
    rho = -spin * arm

    x, phi, gap, v_n, v_t, omega = c[X], c[PHI], c[GAP], c[V_N], c[V_T], c[OMEGA]
    normal, force, moment = c[R_NORMAL], c[R_FORCE], c[R_MOMENT]
    sine, cosine, a, b, spin_rate = c[R_SINE], c[R_COSINE], c[R_A], c[R_B], c[R_SPIN_RATE]
    square, drive_t, drive_n, lever, divisor = c[R_SQUARE], c[R_DRIVE_T], c[R_DRIVE_N], c[R_LEVER], c[R_DIVISOR]

    x[0], phi[0], gap[0] = state[X], state[PHI], state[GAP]
    v_n[0], v_t[0], omega[0] = state[V_N], state[V_T], state[OMEGA]
    sine[0] = math.sin(state[PHI] + shift)
    cosine[0] = math.cos(state[PHI] + shift)

    for k in range(ORDER):
        one = 1.0 if k == 0 else 0.0
        a[k] = h * sine[k]
        b[k] = r * one - h * cosine[k]
        square[k] = product(omega, omega, k)
        drive_t[k] = downhill * one + product(a, square, k)  # vdot_t without contact forces and spin rate
        drive_n[k] = inward * one + h * product(cosine, square, k)  # minus the same of v_n
        if gap_rate != 0:
            normal[k] = -stiffness * gap[k]
        if spin == 0:
            spin_rate[k] = 0.0
            if gap_rate == 0:
                normal[k] = m * drive_n[k]
            force[k] = -m * drive_t[k] if slip == 0 else mu * normal[k]
            moment[k] = product(a, normal, k) - product(b, force, k)
        else:
            if slip == 0:
                lever[k] = rho * one - a[k]
                divisor[k] = inertia * one + m * product(b, b, k)
                rest = -m * product(b, drive_t, k)
                if gap_rate == 0:
                    divisor[k] -= m * product(a, lever, k)
                    rest += m * product(lever, drive_n, k)
                else:
                    rest += product(lever, normal, k)
                for i in range(k):
                    rest -= spin_rate[i] * divisor[k - i]
                spin_rate[k] = rest / divisor[0]
                if gap_rate == 0:
                    normal[k] = m * (product(a, spin_rate, k) + drive_n[k])
                force[k] = -m * (product(b, spin_rate, k) + drive_t[k])
            else:
                lever[k] = rho * one - a[k] + mu * b[k]
                if gap_rate == 0:
                    divisor[k] = one - m / inertia * product(a, lever, k)
                    rest = m * drive_n[k]
                    for i in range(k):
                        rest -= normal[i] * divisor[k - i]
                    normal[k] = rest / divisor[0]
                spin_rate[k] = product(lever, normal, k) / inertia
                force[k] = mu * normal[k]
            moment[k] = rho * normal[k]
        after = 1.0 / (k + 1)
        omega[k + 1] = spin_rate[k] * after
        v_t[k + 1] = 0.0 if slip == 0 else (force[k] / m + drive_t[k] + product(b, spin_rate, k)) * after
        v_n[k + 1] = 0.0 if gap_rate == 0 else (normal[k] / m - drive_n[k] - product(a, spin_rate, k)) * after
        gap[k + 1] = v_n[k] * after
        sine[k + 1] = product(cosine, omega, k) * after
        cosine[k + 1] = -product(sine, omega, k) * after
        phi[k + 1] = omega[k] * after
        x[k + 1] = (v_t[k] - product(b, omega, k)) * after
        c[R_POWER_SLIDING, k] = 0.0 if slip == 0 else -mu * product(normal, v_t, k)
        c[R_POWER_ROLLING, k] = 0.0 if spin == 0 else -rho * product(normal, omega, k)
    for row in (R_NORMAL, R_FORCE, R_MOMENT, R_POWER_SLIDING, R_POWER_ROLLING):
        c[row, ORDER] = 0.0


@kernel
def step_size(c: np.ndarray, length: float, scale: float, tolerance: float) -> float:
    """Step [s] whose first neglected terms stay below ``tolerance * scale`` in every velocity."""
    step = math.inf
    for k in (ORDER - 1, ORDER):
        size = max(abs(c[V_N, k]), abs(c[V_T, k]), length * abs(c[OMEGA, k]))
        if size > 0.0:
            step = min(step, math.exp(math.log(tolerance * scale / size) / k))
    return step


@kernel
def integral(series: np.ndarray, t: float) -> float:
    """Integral of a force or power series from 0 to ``t``."""
    total = 0.0
    for k in range(ORDER - 1, -1, -1):
        total = total * t + series[k] / (k + 1)
    return total * t
