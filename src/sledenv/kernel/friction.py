"""The box rule: the one set-valued force resolution that every contact model calls.

Three velocities of the contact are resolved together: slip ``v_t``, spin ``omega`` and gap rate ``v_n``. A velocity
that is not zero fixes its force by its sign. A velocity that is zero stays locked, with its force within bounds, or
leaves with either sign. The branch of least violation is the answer: docs/physics.md, section 4.2.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import copy_into_callers, scalar
from sledenv.compiler.values import absolute, equal, less, where

TIE = 1e-12  # violations closer than this count as equal: the first branch is then taken, and locks come first
CLEAR = 1e-9  # a violation above this is more than rounding


class Mobility(NamedTuple):
    """How a body yields to a force at the contact point."""

    per_mass: float  # [1/kg]
    per_inertia: float  # [1/(kg m^2)]
    a: float  # [m] arms of the contact point
    b: float  # [m]


class Drive(NamedTuple):
    """Rates of the velocities without contact forces."""

    t: float  # [m/s^2] of v_t
    n: float  # [m/s^2] of v_n


class Bounds(NamedTuple):
    """Normal force while the gap closes, and while it opens; it lies between these where ``v_n`` is locked."""

    closing: float  # [N] inf of a rigid contact: its gap cannot close
    opening: float  # [N] 0 of a rigid contact


class Branch(NamedTuple):
    """Signs of ``v_n``, ``v_t`` and ``omega``, 0 where a velocity is locked."""

    gap_rate: int
    slip: int
    spin: int


def opposing(contact: Any, point: Any) -> tuple[Any, Any]:
    """In a program: tangential force [-] and rolling moment [m] over the normal force, where it slips, and spins."""
    return -point.slip * point.friction, -contact.spin * point.arm


def rates_of(w: Any, drive: Any, force: Any, moment: Any, normal: Any) -> tuple[Any, Any, Any]:
    """Rates of (v_t, omega, v_n) under the contact forces, as a program and as a kernel: docs/physics.md (4.1)."""
    spin_rate = (moment - w.a * normal + w.b * force) * w.per_inertia
    return force * w.per_mass + drive.t + w.b * spin_rate, spin_rate, normal * w.per_mass + drive.n - w.a * spin_rate


rates = kernel(rates_of)


@kernel
def _clearly_opens(w: Mobility, mu: float, rho: float, drive_n: float, bounds: Bounds) -> bool:
    """Whether the gap of a contact at its deepest opens with an acceleration that is more than rounding.

    ``mu`` and ``rho`` are the tangential force and the moment over the normal force.
    """
    copy_into_callers()
    yielding = w.per_mass - w.a * (rho - w.a + mu * w.b) * w.per_inertia
    largest = max(abs(drive_n), max(yielding, w.per_mass + w.a * w.a * w.per_inertia) * bounds.closing)
    return yielding > 0.0 and drive_n + yielding * bounds.opening > CLEAR * largest


@kernel
def branch_forces(
    w: Mobility, drive: Drive, friction: float, arm: float, normal: float, locked_normal: bool, slip: int, spin: int
) -> tuple[float, float, float]:
    """Forces (F, M, N) of one branch; ``slip``, ``spin`` are -1, 0 (locked) or 1: docs/physics.md, section 4.2.

    The forces are found one after the other: a general solution of the three equations would cancel for a slender body.
    The forces of a locked gap are NaN where a normal force accelerates the surfaces towards each other (the Painleve
    region).
    """
    copy_into_callers()
    mass = 1.0 / w.per_mass
    if spin == 0:
        if locked_normal:
            normal = -mass * drive.n
        force = -mass * drive.t if slip == 0 else -slip * friction * normal
        return force, w.a * normal - w.b * force, normal
    if slip == 0:
        lever = -spin * arm - w.a  # of the normal force about the mass centre
        hinge = 1.0 + mass * w.b * w.b * w.per_inertia
        if locked_normal:
            yielding = hinge - mass * w.a * lever * w.per_inertia
            if not yielding > 0.0:
                return math.nan, math.nan, math.nan
            spin_rate = -mass * (lever * drive.n + w.b * drive.t) * w.per_inertia / yielding
            normal = mass * (w.a * spin_rate - drive.n)
        else:
            spin_rate = (lever * normal - mass * w.b * drive.t) * w.per_inertia / hinge
        return -mass * (drive.t + w.b * spin_rate), -spin * arm * normal, normal
    if locked_normal:
        yielding = w.per_mass - w.a * (-spin * arm - w.a - slip * friction * w.b) * w.per_inertia
        if not yielding > 0.0:
            return math.nan, math.nan, math.nan
        normal = -drive.n / yielding
    return -slip * friction * normal, -spin * arm * normal, normal


@kernel
def sign_of(value: float) -> int:
    """-1, 0 or 1."""
    return 1 if value > 0.0 else (-1 if value < 0.0 else 0)


@kernel
def in_turn(number: int) -> int:
    """0, 1 and -1 for the numbers 0, 1 and 2: locks come first."""
    return number if number < 2 else -1


@kernel
def excluded(sign: int, branch: int) -> bool:
    """Whether a velocity of this sign cannot follow the branch."""
    return sign != 0 and (branch == 0 or (sign > 0) != (branch > 0))


def beyond(velocity: Any, branch: Any, excess: Any, rate: Any, yielding: Any) -> Any:
    """In a program: how far a velocity is from the condition of its branch, as a force; 0 if it meets the condition.

    A locked velocity has a force within its bound: ``excess`` is that force minus the bound. A velocity that leaves
    zero has a rate with the sign of its branch: a wrong rate counts as the force that makes it, ``yielding`` being the
    rate under a unit force. A velocity that is not zero has no condition.
    """
    missed = where(equal(branch, 0.0), excess, -branch * rate / yielding)
    return where(equal(absolute(velocity), 1.0), 0.0, where(less(missed, 0.0), 0.0, missed))


_beyond = scalar(lambda velocity, branch, excess, rate, yielding: (beyond(velocity, branch, excess, rate, yielding),))


@kernel
def _violation(
    w: Mobility, drive: Drive, friction: float, arm: float, length: float, bounds: Bounds, signs: Branch, branch: Branch
) -> float:
    """By how much a branch breaks its conditions, over the normal force; NaN if the branch has no forces."""
    copy_into_callers()
    given = bounds.closing if branch.gap_rate < 0 else bounds.opening
    locked = branch.gap_rate == 0
    force, moment, normal = branch_forces(w, drive, friction, arm, given, locked, branch.slip, branch.spin)
    rate_t, rate_w, rate_n = rates(w, drive, force, moment, normal)
    w_tt = w.per_mass + w.b * w.b * w.per_inertia
    w_nn = w.per_mass + w.a * w.a * w.per_inertia
    found = _beyond(signs.slip, branch.slip, abs(force) - friction * normal, rate_t, w_tt)[0]
    found += _beyond(signs.spin, branch.spin, abs(moment) - arm * normal, rate_w, w.per_inertia)[0] / length
    outside = max(normal - bounds.closing, bounds.opening - normal)
    found += _beyond(signs.gap_rate, branch.gap_rate, outside, rate_n, w_nn)[0]
    if found == 0.0:
        return 0.0  # without any force the quotient would be 0 / 0
    return found / max(abs(normal), bounds.closing if bounds.closing < math.inf else abs(drive.n) / w_nn)


@kernel
def resolve(
    w: Mobility, drive: Drive, friction: float, arm: float, length: float, bounds: Bounds, signs: Branch
) -> Branch:
    """Choose the branch of a contact whose velocities have the given signs: docs/physics.md (4.3).

    Parameters
    ----------
    w, drive, bounds
        How the body yields, what drives it, and the bounds of the normal force.
    friction, arm : float
        Coulomb coefficient f [-] and rolling arm delta [m].
    length : float
        Size of the body [m], which makes the violation of a moment comparable with that of a force.
    signs : Branch
        Signs of ``v_n``, ``v_t`` and ``omega``. 0 stands for a velocity that is exactly zero; 2 or -2 for one that is
        zero and has just been released with this sign, with its force at the bound.

    Returns
    -------
    Branch
        Which branch to follow.
    """
    copy_into_callers()
    turning_back = signs.gap_rate == 0 and abs(signs.slip) == 1 and abs(signs.spin) == 1 and bounds.closing < math.inf
    # Most calls are for a contact at its deepest that clearly opens. Every other branch then has a violation.
    if turning_back and _clearly_opens(w, -signs.slip * friction, -signs.spin * arm, drive.n, bounds):
        return Branch(1, signs.slip, signs.spin)
    best = Branch(0, 0, 0)
    least = 1e300
    for gap_rate in (0, -1, 1):
        if excluded(signs.gap_rate, gap_rate) or (gap_rate < 0 and bounds.closing == math.inf):
            continue
        for slip in (0, 1, -1):
            if excluded(signs.slip, slip):
                continue
            for spin in (0, 1, -1):
                if excluded(signs.spin, spin):
                    continue
                branch = Branch(gap_rate, slip, spin)
                violation = _violation(w, drive, friction, arm, length, bounds, signs, branch)
                # A branch without forces has the violation NaN: this compares false, so the branch is never chosen.
                if violation < least - TIE:
                    least = violation
                    best = branch
                    if violation == 0.0:
                        return best  # no later branch is better
    return best
