"""The contact of docs/physics.md as a hybrid system for general integrators: rates, guards and the choice of the mode.

Written apart from the package's kernel, the way a user of scipy or heyoka would, for a disc (no corners). The state in
contact is (x, phi, gap, v_n, v_t, omega), so that a locked velocity stays exactly zero. A mode is the triple of signs
of v_n, v_t and omega, 0 where that velocity is locked. A guard is positive while its mode holds.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba
import numpy as np

from perf.reference import BODY, LAUNCH, LAW, SLOPE, Floats

Mode = tuple[int, int, int]

X, PHI, GAP, V_N, V_T, OMEGA = range(6)
# Guards; each has a velocity that it concerns and, where a lock gives way, the sign with which the velocity leaves.
RATE_ZERO, RATE_CLOSES, RATE_OPENS, SLIP_ZERO, SLIP_RISES, SLIP_FALLS, SPIN_ZERO, SPIN_RISES, SPIN_FALLS, SEPARATED = (
    range(10)
)
_TIE = 1e-12


class Problem(NamedTuple):
    """Parameters of the hybrid system, SI units."""

    mass: float = BODY.mass
    radius: float = BODY.radius
    eccentricity: float = BODY.eccentricity
    inertia: float = BODY.inertia
    closing: float = LAW.stiffness * (1.0 + LAW.asymmetry)
    opening: float = LAW.stiffness * (1.0 - LAW.asymmetry)
    friction: float = LAW.friction
    arm: float = LAW.rolling_arm
    downhill: float = SLOPE.gravity * math.sin(SLOPE.angle)
    inward: float = SLOPE.gravity * math.cos(SLOPE.angle)


P = Problem()  # frozen into the compiled functions, which are then cheap to call from Python
START: Floats = np.array(LAUNCH)  # x, y, phi, u, v, omega


def forces(
    a: Any, b: Any, drive_t: Any, drive_n: Any, normal: Any, locked: Any, slip: Any, spin: Any
) -> tuple[Any, Any, Any]:
    """Friction, rolling moment and normal force of a mode; numbers or symbols.

    ``locked`` tells of v_n, v_t and omega whether they are held; ``slip`` and ``spin`` are the signs of those that are
    not, ``normal`` is the force of the spring where v_n is not held.
    """
    if locked[2]:
        if locked[0]:
            normal = -P.mass * drive_n
        force = -P.mass * drive_t if locked[1] else -slip * P.friction * normal
        return force, a * normal - b * force, normal
    lever = -spin * P.arm - a
    if locked[1]:
        hinge = P.inertia + P.mass * b * b
        if locked[0]:
            turn = -P.mass * (lever * drive_n + b * drive_t) / (hinge - P.mass * a * lever)
            normal = P.mass * (a * turn - drive_n)
        else:
            turn = (lever * normal - P.mass * b * drive_t) / hinge
        return -P.mass * (drive_t + b * turn), -spin * P.arm * normal, normal
    if locked[0]:
        normal = -drive_n / (1.0 / P.mass - a * (lever - slip * P.friction * b) / P.inertia)
    return -slip * P.friction * normal, -spin * P.arm * normal, normal


_forces = numba.njit(error_model="numpy")(forces)


@numba.njit(error_model="numpy")
def _at(z: Floats, mode: Mode) -> tuple[float, float, float, float, float, float, float]:
    """Arms, drives and forces of a mode at a state."""
    a = P.eccentricity * math.sin(z[PHI])
    lower = P.eccentricity * math.cos(z[PHI])
    b = P.radius - lower
    square = z[OMEGA] * z[OMEGA]
    drive_t = P.downhill + a * square
    drive_n = -P.inward - lower * square
    stiffness = P.closing if mode[0] < 0 else P.opening
    locked = (mode[0] == 0, mode[1] == 0, mode[2] == 0)
    force, moment, normal = _forces(a, b, drive_t, drive_n, -stiffness * z[GAP], locked, mode[1], mode[2])
    return a, b, drive_t, drive_n, force, moment, normal


@numba.njit(error_model="numpy")
def rates(t: float, z: Floats, mode: Mode) -> Floats:
    """Right-hand side in contact."""
    a, b, drive_t, drive_n, force, moment, normal = _at(z, mode)
    turn = (moment - a * normal + b * force) / P.inertia
    out = np.zeros(6)
    out[X] = z[V_T] - b * z[OMEGA]
    out[PHI] = z[OMEGA]
    out[GAP] = z[V_N]
    if mode[0] != 0:
        out[V_N] = normal / P.mass + drive_n - a * turn
    if mode[1] != 0:
        out[V_T] = force / P.mass + drive_t + b * turn
    if mode[2] != 0:
        out[OMEGA] = turn
    return out


@numba.njit(error_model="numpy")
def guard(kind: int, z: Floats, mode: Mode) -> float:
    """Value of a guard."""
    if kind == RATE_ZERO:
        return float(mode[0] * z[V_N])
    if kind == SLIP_ZERO:
        return float(mode[1] * z[V_T])
    if kind == SPIN_ZERO:
        return float(mode[2] * z[OMEGA])
    if kind == SEPARATED:
        return float(-z[GAP])
    _, _, _, _, force, moment, normal = _at(z, mode)
    if kind == RATE_CLOSES:
        return float(-P.closing * z[GAP] - normal)
    if kind == RATE_OPENS:
        return float(normal + P.opening * z[GAP])
    if kind == SLIP_RISES:
        return float(P.friction * normal + force)
    if kind == SLIP_FALLS:
        return float(P.friction * normal - force)
    if kind == SPIN_RISES:
        return float(P.arm * normal + moment)
    return float(P.arm * normal - moment)


def guards_of(mode: Mode) -> list[int]:
    """Guards that can end a mode."""
    found = [RATE_CLOSES, RATE_OPENS] if mode[0] == 0 else [RATE_ZERO]
    found += [SLIP_RISES, SLIP_FALLS] if mode[1] == 0 else [SLIP_ZERO]
    found += [SPIN_RISES, SPIN_FALLS] if mode[2] == 0 else [SPIN_ZERO]
    return [*found, SEPARATED] if mode[0] > 0 else found


@numba.njit(error_model="numpy")
def _open(velocity: float, left: int, branch: int) -> bool:
    """Whether a velocity may follow a branch: a nonzero one keeps its sign, one just released leaves with it."""
    if velocity != 0.0:
        return branch != 0 and (branch > 0) == (velocity > 0.0)
    return left in (0, branch)


@numba.njit(error_model="numpy")
def choose(z: Floats, left: Mode) -> Mode:
    """Mode that violates the laws least, by trying all; ``left`` has the sign of a velocity just released."""
    y = z.copy()
    size = P.radius + P.eccentricity
    y[GAP] = min(z[GAP], -1e-12 * size)
    depth = -y[GAP]
    scale = P.closing * depth
    best = (0, 0, 0)
    least = np.inf
    for gap_rate in (0, -1, 1):
        for slip in (0, 1, -1):
            for spin in (0, 1, -1):
                if not (
                    _open(z[V_N], left[0], gap_rate) and _open(z[V_T], left[1], slip) and _open(z[OMEGA], left[2], spin)
                ):
                    continue
                mode = (gap_rate, slip, spin)
                a, b, drive_t, drive_n, force, moment, normal = _at(y, mode)
                turn = (moment - a * normal + b * force) / P.inertia
                rate_n = P.mass * (normal / P.mass + drive_n - a * turn)
                rate_t = P.mass * (force / P.mass + drive_t + b * turn)
                violation = 0.0
                if z[V_N] == 0.0:
                    over = max(0.0, normal - scale, P.opening * depth - normal)
                    violation += over if gap_rate == 0 else max(0.0, -gap_rate * rate_n)
                if z[V_T] == 0.0:
                    over = max(0.0, abs(force) - P.friction * normal)
                    violation += over if slip == 0 else max(0.0, -slip * rate_t)
                if z[OMEGA] == 0.0:
                    over = max(0.0, abs(moment) - P.arm * normal) / size
                    violation += over if spin == 0 else max(0.0, -spin * P.inertia * turn) / size
                if violation / scale < least - _TIE:
                    least = violation / scale
                    best = mode
    return best


@numba.njit(error_model="numpy")
def next_mode(kind: int, z: Floats) -> Mode:
    """Mode after a guard has reached zero; sets the velocity concerned to exactly zero."""
    which = kind // 3
    z[V_N + which] = 0.0
    left = np.zeros(3, np.int64)
    left[which] = (0, -1, 1)[kind] if which == 0 else (0, 1, -1)[kind % 3]
    return choose(z, (left[0], left[1], left[2]))


@numba.njit(error_model="numpy")
def touch_down(flight: Floats) -> Floats:
    """Contact state of a body that meets the slope."""
    a = P.eccentricity * math.sin(flight[2])
    b = P.radius - P.eccentricity * math.cos(flight[2])
    return np.array([flight[0], flight[2], 0.0, flight[4] - a * flight[5], flight[3] + b * flight[5], flight[5]])


@numba.njit(error_model="numpy")
def lift_off(z: Floats) -> Floats:
    """Flight state (x, y, phi, u, v, omega) of a body that leaves the slope, a rounding error above it.

    Event locators look for a change of sign: a gap that is zero or negative by rounding would hide the next touchdown.
    """
    a = P.eccentricity * math.sin(z[PHI])
    b = P.radius - P.eccentricity * math.cos(z[PHI])
    return np.array([z[X], b + 1e-16, z[PHI], z[V_T] - b * z[OMEGA], z[V_N] + a * z[OMEGA], z[OMEGA]])


@numba.njit(error_model="numpy")
def flight_gap(t: float, y: Floats) -> float:
    """Gap in flight."""
    return float(y[1] + P.eccentricity * math.cos(y[2]) - P.radius)


@numba.njit(error_model="numpy")
def flight_rates(t: float, y: Floats) -> Floats:
    """Right-hand side in flight."""
    return np.array([y[3], y[4], y[5], P.downhill, -P.inward, 0.0])
