"""The contact of docs/physics.md as a hybrid system for general integrators: rates, guards and the choice of the mode.

Written apart from the package's kernel, the way a user of scipy or heyoka would, for a disc (no corners). The state in
contact is (x, phi, gap, v_n, v_t, omega), so that a locked velocity stays exactly zero. A mode is the triple of signs
of v_n, v_t and omega, 0 where that velocity is locked. A guard is positive while its mode holds.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numba
import numpy as np

from perf.harness import Floats
from perf.reference import DISC, DOWNHILL, INWARD, LAUNCH, LAW

Mode = tuple[int, int, int]

X, PHI, GAP, V_N, V_T, OMEGA = range(6)
SEPARATED = 9  # the last of the guards
_TIE = 1e-12
_MODES: tuple[Mode, ...] = tuple(itertools.product((0, -1, 1), (0, 1, -1), (0, 1, -1)))
CLOSING, OPENING = LAW.stiffness * (1.0 + LAW.asymmetry), LAW.stiffness * (1.0 - LAW.asymmetry)
START: Floats = np.array(LAUNCH)  # x, y, phi, u, v, omega


def contact(sine: Any, cosine: Any, gap: Any, turning: Any, mode: Mode, slip: Any, spin: Any) -> tuple[Any, ...]:
    """Arm b, rates (v_n, v_t, omega) and loads (friction, rolling moment, normal force) of a mode; numbers or symbols.

    ``turning`` is omega, and ``slip`` and ``spin`` are the signs of v_t and omega where the mode does not hold them.
    """
    a = DISC.eccentricity * sine
    lower = DISC.eccentricity * cosine
    b = DISC.radius - lower
    square = turning * turning
    drive_t = DOWNHILL + a * square
    drive_n = -INWARD - lower * square
    normal = -(CLOSING if mode[0] < 0 else OPENING) * gap  # of the spring, where v_n is not held
    if mode[2] == 0:
        if mode[0] == 0:
            normal = -DISC.mass * drive_n
        force = -DISC.mass * drive_t if mode[1] == 0 else -slip * LAW.friction * normal
        moment = a * normal - b * force
    else:
        lever = -spin * LAW.rolling_arm - a
        if mode[1] == 0:
            hinge = DISC.inertia + DISC.mass * b * b
            if mode[0] == 0:
                turn = -DISC.mass * (lever * drive_n + b * drive_t) / (hinge - DISC.mass * a * lever)
                normal = DISC.mass * (a * turn - drive_n)
            else:
                turn = (lever * normal - DISC.mass * b * drive_t) / hinge
            force = -DISC.mass * (drive_t + b * turn)
        else:
            if mode[0] == 0:
                normal = -drive_n / (1.0 / DISC.mass - a * (lever - slip * LAW.friction * b) / DISC.inertia)
            force = -slip * LAW.friction * normal
        moment = -spin * LAW.rolling_arm * normal
    turn = (moment - a * normal + b * force) / DISC.inertia
    rates = normal / DISC.mass + drive_n - a * turn, force / DISC.mass + drive_t + b * turn, turn
    return b, rates, (force, moment, normal)


_contact = numba.njit(error_model="numpy")(contact)


@numba.njit(error_model="numpy")
def _at(z: Floats, mode: Mode) -> Any:
    """What :func:`contact` says of a state."""
    return _contact(math.sin(z[PHI]), math.cos(z[PHI]), z[GAP], z[OMEGA], mode, mode[1], mode[2])


@numba.njit(error_model="numpy")
def rates(t: float, z: Floats, mode: Mode) -> Floats:
    """Right-hand side in contact."""
    b, free, _ = _at(z, mode)
    out = np.zeros(6)
    out[X] = z[V_T] - b * z[OMEGA]
    out[PHI] = z[OMEGA]
    out[GAP] = z[V_N]
    for i in range(3):
        if mode[i] != 0:
            out[V_N + i] = free[i]
    return out


def guards(z: Any, mode: Mode, slip: Any, spin: Any, loads: Any) -> tuple[Any, ...]:
    """Values of all guards: of v_n, v_t and omega each that it reaches zero, and that its lock yields to + or to -."""
    _, _, gap, v_n, v_t, omega = z
    force, moment, normal = loads
    return (
        mode[0] * v_n,
        normal + OPENING * gap,
        -CLOSING * gap - normal,
        slip * v_t,
        LAW.friction * normal + force,
        LAW.friction * normal - force,
        spin * omega,
        LAW.rolling_arm * normal + moment,
        LAW.rolling_arm * normal - moment,
        -gap,  # separated
    )


_guards = numba.njit(error_model="numpy")(guards)


@numba.njit(error_model="numpy")
def guard(kind: int, z: Floats, mode: Mode) -> float:
    """Value of a guard."""
    loads = _at(z, mode)[2] if kind % 3 else (0.0, 0.0, 0.0)  # what locks alone ask for
    return float(_guards((z[0], z[1], z[2], z[3], z[4], z[5]), mode, mode[1], mode[2], loads)[kind])


def guards_of(mode: Mode) -> list[int]:
    """Guards that can end a mode."""
    found = [kind for i, sign in enumerate(mode) for kind in ((3 * i,) if sign else (3 * i + 1, 3 * i + 2))]
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
    size = DISC.radius + DISC.eccentricity
    y[GAP] = min(z[GAP], -1e-12 * size)
    depth = -y[GAP]
    scale = CLOSING * depth
    best = (0, 0, 0)
    least = np.inf
    for mode in _MODES:
        closing, slip, spin = mode
        if _open(z[V_N], left[0], closing) and _open(z[V_T], left[1], slip) and _open(z[OMEGA], left[2], spin):
            _, (rate_n, rate_t, turn), (force, moment, normal) = _at(y, mode)
            violation = 0.0
            if z[V_N] == 0.0:
                over = max(0.0, normal - scale, OPENING * depth - normal)
                violation += over if closing == 0 else max(0.0, -closing * DISC.mass * rate_n)
            if z[V_T] == 0.0:
                over = max(0.0, abs(force) - LAW.friction * normal)
                violation += over if slip == 0 else max(0.0, -slip * DISC.mass * rate_t)
            if z[OMEGA] == 0.0:
                over = max(0.0, abs(moment) - LAW.rolling_arm * normal) / size
                violation += over if spin == 0 else max(0.0, -spin * DISC.inertia * turn) / size
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
    left[which] = (0, 1, -1)[kind % 3]
    return choose(z, (left[0], left[1], left[2]))


@numba.njit(error_model="numpy")
def touch_down(flight: Floats) -> Floats:
    """Contact state of a body that meets the slope."""
    a = DISC.eccentricity * math.sin(flight[2])
    b = DISC.radius - DISC.eccentricity * math.cos(flight[2])
    return np.array([flight[0], flight[2], 0.0, flight[4] - a * flight[5], flight[3] + b * flight[5], flight[5]])


@numba.njit(error_model="numpy")
def lift_off(z: Floats) -> Floats:
    """Flight state (x, y, phi, u, v, omega) of a body that leaves the slope, a rounding error above it.

    Event locators look for a change of sign: a gap that is zero or negative by rounding would hide the next touchdown.
    """
    a = DISC.eccentricity * math.sin(z[PHI])
    b = DISC.radius - DISC.eccentricity * math.cos(z[PHI])
    return np.array([z[X], b + 1e-16, z[PHI], z[V_T] - b * z[OMEGA], z[V_N] + a * z[OMEGA], z[OMEGA]])


@numba.njit(error_model="numpy")
def flight_gap(t: float, y: Floats) -> float:
    """Gap in flight."""
    return float(y[1] + DISC.eccentricity * math.cos(y[2]) - DISC.radius)


@numba.njit(error_model="numpy")
def flight_rates(t: float, y: Floats) -> Floats:
    """Right-hand side in flight."""
    return np.array([y[3], y[4], y[5], DOWNHILL, -INWARD, 0.0])
