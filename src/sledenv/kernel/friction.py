"""The box rule: the one set-valued force resolution that every contact model calls.

Three velocities of the contact are set-valued together: slip ``v_t``, spin ``omega`` and gap rate ``v_n``. Each that is
nonzero fixes its force by its sign; each that is zero either stays locked, its force within bounds, or leaves with
either sign. The branch of least violation is the answer: docs/physics.md, section 4.
"""

from __future__ import annotations

import math

from sledenv.kernel.jit import kernel

TIE = 1e-12  # violations closer than this are equal; the branch listed first, with more locks, is then taken


@kernel
def compliance(mass: float, inertia: float, a: float, b: float) -> tuple[float, float, float, float, float, float]:
    """Entries tt, tw, tn, ww, wn, nn of the symmetric W that maps (F, M, N) to rates: docs/physics.md (4.1)."""
    return (
        1.0 / mass + b * b / inertia,
        b / inertia,
        -a * b / inertia,
        1.0 / inertia,
        -a / inertia,
        1.0 / mass + a * a / inertia,
    )


@kernel
def branch_forces(
    w: tuple[float, float, float, float, float, float],
    drive_t: float,
    drive_n: float,
    friction: float,
    arm: float,
    normal: float,
    locked_normal: bool,
    slip: int,
    spin: int,
) -> tuple[float, float, float]:
    """Forces (F, M, N) of one branch: ``slip``, ``spin`` are -1, 0 (locked) or 1; Cramer's rule on three equations."""
    w_tt, w_tw, w_tn, w_ww, w_wn, w_nn = w
    # Each row is either "the rate vanishes" or "the force sits on its bound".
    if slip == 0:
        t0, t1, t2, t3 = w_tt, w_tw, w_tn, -drive_t
    else:
        t0, t1, t2, t3 = 1.0, 0.0, slip * friction, 0.0
    if spin == 0:
        r0, r1, r2, r3 = w_tw, w_ww, w_wn, 0.0
    else:
        r0, r1, r2, r3 = 0.0, 1.0, spin * arm, 0.0
    if locked_normal:
        n0, n1, n2, n3 = w_tn, w_wn, w_nn, -drive_n
    else:
        n0, n1, n2, n3 = 0.0, 0.0, 1.0, normal
    c0 = r1 * n2 - r2 * n1
    c1 = r2 * n0 - r0 * n2
    c2 = r0 * n1 - r1 * n0
    determinant = t0 * c0 + t1 * c1 + t2 * c2
    force = (t3 * c0 + t1 * (r2 * n3 - r3 * n2) + t2 * (r3 * n1 - r1 * n3)) / determinant
    moment = (t0 * (r3 * n2 - r2 * n3) + t3 * c1 + t2 * (r0 * n3 - r3 * n0)) / determinant
    normal_force = (t0 * (r1 * n3 - r3 * n1) + t1 * (r3 * n0 - r0 * n3) + t3 * c2) / determinant
    return force, moment, normal_force


@kernel
def _excluded(sign: int, branch: int) -> bool:
    """Whether a velocity of this sign cannot follow the branch."""
    return sign != 0 and (branch == 0 or (sign > 0) != (branch > 0))


@kernel
def resolve(
    w: tuple[float, float, float, float, float, float],
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
        From :func:`compliance`.
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
    w_tt, w_tw, w_tn, w_ww, w_wn, w_nn = w
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
                violation = 0.0
                if abs(slip) != 1:
                    if slip_branch == 0:
                        violation += max(0.0, abs(force) - friction * normal) / scale
                    else:
                        rate = w_tt * force + w_tw * moment + w_tn * normal + drive_t
                        violation += max(0.0, -slip_branch * rate) / (w_tt * scale)
                if abs(spin) != 1:
                    if spin_branch == 0:
                        violation += max(0.0, abs(moment) - arm * normal) / (length * scale)
                    else:
                        rate = w_tw * force + w_ww * moment + w_wn * normal
                        violation += max(0.0, -spin_branch * rate) / (w_ww * length * scale)
                if abs(gap_rate) != 1:
                    if normal_branch == 0:
                        violation += max(0.0, normal - closing_normal, opening_normal - normal) / scale
                    else:
                        rate = w_tn * force + w_wn * moment + w_nn * normal + drive_n
                        violation += max(0.0, -normal_branch * rate) / (w_nn * scale)
                # A singular branch (NaN) compares false and is never chosen.
                if violation < least - TIE:
                    least = violation
                    best = (normal_branch, slip_branch, spin_branch)
    return best
