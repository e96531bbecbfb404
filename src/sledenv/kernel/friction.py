"""The box rule: the one set-valued force resolution that every contact model calls.

Three velocities of the contact are set-valued together: slip ``v_t``, spin ``omega`` and gap rate ``v_n``. Each that is
nonzero fixes its force by its sign; each that is zero either stays locked, its force within bounds, or leaves with
either sign. The branch of least violation is the answer: docs/physics.md, section 4.2.
"""

from __future__ import annotations

import math
from typing import Any

from sledenv.kernel.jit import kernel
from sledenv.kernel.trace import absolute, larger, less, scalar, where

TIE = 1e-12  # violations closer than this are equal; the branch listed first, with more locks, is then taken
CLEAR = 1e-9  # violations above this are told from none


@kernel
def mobility(mass: float, inertia: float, a: float, b: float) -> tuple[float, float, float, float]:
    """What a body at the arms ``a``, ``b`` [m] opposes to contact forces: 1/mass, 1/inertia, a, b."""
    return 1.0 / mass, 1.0 / inertia, a, b


def rates_of(w: Any, drive_t: Any, drive_n: Any, force: Any, moment: Any, normal: Any) -> tuple[Any, Any, Any]:
    """Rates of (v_t, omega, v_n) under the contact forces, as a program and as a kernel: docs/physics.md (4.1)."""
    per_mass, per_inertia, a, b = w
    spin_rate = (moment - a * normal + b * force) * per_inertia
    return force * per_mass + drive_t + b * spin_rate, spin_rate, normal * per_mass + drive_n - a * spin_rate


rates = kernel(rates_of)


def opening_of(
    per_mass: Any, per_inertia: Any, a: Any, b: Any, mu: Any, rho: Any, drive_n: Any, closing: Any, opening: Any
) -> tuple[Any, Any]:
    """Program of how a contact at its deepest opens: the rate of its gap rate [m/s^2], and above which it clearly does.

    ``mu`` and ``rho`` are tangential force and moment over the normal force, ``closing`` and ``opening`` its bounds.
    """
    yielding = per_mass - a * (rho - a + mu * b) * per_inertia
    largest = larger(absolute(drive_n), larger(yielding, per_mass + a * a * per_inertia) * closing)
    return where(less(0.0, yielding), drive_n + yielding * opening, -math.inf), CLEAR * largest


_opening = scalar(opening_of)


@kernel
def branch_forces(
    w: tuple[float, float, float, float],
    drive_t: float,
    drive_n: float,
    friction: float,
    arm: float,
    normal: float,
    locked_normal: bool,
    slip: int,
    spin: int,
) -> tuple[float, float, float]:
    """Forces (F, M, N) of one branch; ``slip``, ``spin`` are -1, 0 (locked) or 1: docs/physics.md, section 4.2.

    Each force is solved for in turn: a general solution of the three equations would cancel for a slender body. Where a
    normal force would pull the surfaces together (the Painleve region) a locked gap repels: the branch is NaN.
    """
    per_mass, per_inertia, a, b = w
    mass = 1.0 / per_mass
    if spin == 0:
        if locked_normal:
            normal = -mass * drive_n
        force = -mass * drive_t if slip == 0 else -slip * friction * normal
        return force, a * normal - b * force, normal
    if slip == 0:
        lever = -spin * arm - a  # of the normal force about the mass centre
        hinge = 1.0 + mass * b * b * per_inertia
        if locked_normal:
            yielding = hinge - mass * a * lever * per_inertia
            if not yielding > 0.0:
                return math.nan, math.nan, math.nan
            spin_rate = -mass * (lever * drive_n + b * drive_t) * per_inertia / yielding
            normal = mass * (a * spin_rate - drive_n)
        else:
            spin_rate = (lever * normal - mass * b * drive_t) * per_inertia / hinge
        return -mass * (drive_t + b * spin_rate), -spin * arm * normal, normal
    if locked_normal:
        yielding = per_mass - a * (-spin * arm - a - slip * friction * b) * per_inertia
        if not yielding > 0.0:
            return math.nan, math.nan, math.nan
        normal = -drive_n / yielding
    return -slip * friction * normal, -spin * arm * normal, normal


@kernel
def _excluded(sign: int, branch: int) -> bool:
    """Whether a velocity of this sign cannot follow the branch."""
    return sign != 0 and (branch == 0 or (sign > 0) != (branch > 0))


@kernel
def resolve(
    w: tuple[float, float, float, float],
    drive_t: float,
    drive_n: float,
    friction: float,
    arm: float,
    length: float,
    closing_normal: float,
    opening_normal: float,
    gap_rate: int,
    slip: int,
    spin: int,
) -> tuple[int, int, int]:
    """Choose the branch of a contact whose velocities have the given signs: docs/physics.md (4.3).

    Parameters
    ----------
    w : tuple of float
        From :func:`mobility`.
    drive_t, drive_n : float
        Rates of ``v_t`` and ``v_n`` [m/s^2] without contact forces.
    friction, arm : float
        Coulomb coefficient f [-] and rolling arm delta [m].
    length : float
        Size of the body [m], which makes the violation of a moment comparable with that of a force.
    closing_normal, opening_normal : float
        Normal force [N] while the gap closes and while it opens; where ``v_n`` is locked it lies between them. A rigid
        contact has inf and 0: its gap cannot close.
    gap_rate, slip, spin : int
        Signs of ``v_n``, ``v_t`` and ``omega``; 0 where the velocity is exactly zero, 2 or -2 where it is zero but has
        just been released with that sign, its force at the bound.

    Returns
    -------
    tuple of int
        Signs (gap rate, slip, spin) of the branch to follow, 0 where the velocity stays locked.
    """
    per_mass, per_inertia, a, b = w
    w_tt = per_mass + b * b * per_inertia
    w_nn = per_mass + a * a * per_inertia
    if gap_rate == 0 and abs(slip) == 1 and abs(spin) == 1 and closing_normal < math.inf:
        # Most often: a contact at its deepest, which clearly opens; no other branch can be without violation then.
        rate, clear = _opening(*w, -slip * friction, -spin * arm, drive_n, closing_normal, opening_normal)
        if rate > clear:
            return 1, slip, spin
    best = (0, 0, 0)
    least = 1e300
    for normal_branch in (0, -1, 1):
        if _excluded(gap_rate, normal_branch) or (normal_branch < 0 and closing_normal == math.inf):
            continue
        given = closing_normal if normal_branch < 0 else opening_normal
        for slip_branch in (0, 1, -1):
            if _excluded(slip, slip_branch):
                continue
            for spin_branch in (0, 1, -1):
                if _excluded(spin, spin_branch):
                    continue
                force, moment, normal = branch_forces(
                    w, drive_t, drive_n, friction, arm, given, normal_branch == 0, slip_branch, spin_branch
                )
                reference = closing_normal if closing_normal < math.inf else abs(drive_n) / w_nn
                scale = max(abs(normal), reference)
                rate_t, rate_w, rate_n = rates(w, drive_t, drive_n, force, moment, normal)
                violation = 0.0
                if abs(slip) != 1:
                    if slip_branch == 0:
                        violation += max(0.0, abs(force) - friction * normal) / scale
                    else:
                        violation += max(0.0, -slip_branch * rate_t) / (w_tt * scale)
                if abs(spin) != 1:
                    if spin_branch == 0:
                        violation += max(0.0, abs(moment) - arm * normal) / (length * scale)
                    else:
                        violation += max(0.0, -spin_branch * rate_w) / (per_inertia * length * scale)
                if abs(gap_rate) != 1:
                    if normal_branch == 0:
                        violation += max(0.0, normal - closing_normal, opening_normal - normal) / scale
                    else:
                        violation += max(0.0, -normal_branch * rate_n) / (w_nn * scale)
                # A singular branch (NaN) compares false and is never chosen.
                if violation < least - TIE:
                    least = violation
                    best = (normal_branch, slip_branch, spin_branch)
                    if violation == 0.0:
                        return best  # which none of those behind it can beat
    return best
