"""Two points that touch at once: their forces, and the branch that they follow; docs/physics.md, section 8.2.

Each point is a contact of its own, with its gap, its slip and its forces. They share the body, so the forces of both
make its rates. A body that turns can hold one gap rate and one slip velocity at zero, whichever point has it. One that
does not turn moves both points alike, and only the sum of what holds it is determined.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sledenv.kernel import normal, progress
from sledenv.kernel.friction import TIE, Bounds, Branch, beyond, excluded, in_turn
from sledenv.programs.jit import kernel
from sledenv.programs.trace import copy_into_callers


class Point(NamedTuple):
    """One of the two points at an instant."""

    a: float  # [m] arms
    b: float  # [m]
    lift: float  # [m/s^2] what the turning of the arms alone takes off the rate of its gap rate,
    sweep: float  # [m/s^2] and off that of its slip
    friction: float  # [-]
    arm: float  # [m] of its rolling resistance
    closing: float  # [N] normal force while the gap closes,
    opening: float  # [N] and while it opens


class Held(NamedTuple):
    """How a turning body answers the forces of its locked velocities; zeros stand for what is not locked."""

    # Rates of u, v and omega under a unit normal force where the gap rate is locked,
    n_u: float
    n_v: float
    n_w: float
    # and of u and omega under a unit tangential force where the slip is.
    s_u: float
    s_w: float
    # Arms [m] of the one and of the other.
    a: float
    b: float
    # Inverse of what both forces do to both locked velocities.
    nn: float
    ns: float
    sn: float
    ss: float


class Forces(NamedTuple):
    """What acts on both points, and the rates of the body under it."""

    normal_1: float  # [N]
    normal_2: float
    tangential_1: float  # [N]
    tangential_2: float
    moment: float  # [N m]
    excess: float  # [N m] by which it is more than rolling resistance bears, of a body that does not turn
    u: float  # [m/s^2]
    v: float  # [m/s^2]
    omega: float  # [rad/s^2]


@kernel
def _point(contact: np.void, step: np.void, within: Bounds, scale: float) -> Point:
    """Return a point at the start of a step, the bounds of its normal force times a number."""
    a, b = contact["h"] * step["sine"], contact["r"] - contact["h"] * step["cosine"]
    square = contact["omega"] * contact["omega"]
    lift = contact["h"] * step["cosine"] * square
    return Point(
        a, b, lift, -a * square, contact["friction"], contact["arm"], scale * within.closing, scale * within.opening
    )


@kernel
def hold(per_mass: float, ratio: float, one: Point, two: Point, branch: Branch, other: Branch) -> Held:
    """Return how a turning body is held; NaN where a locked gap would need surfaces that pull each other."""
    per_inertia = per_mass * ratio
    n_u = n_v = n_w = s_u = s_w = a = b = 0.0
    if branch.gap_rate == 0 or other.gap_rate == 0:
        at, its = (one, branch) if branch.gap_rate == 0 else (two, other)
        mu, a = -its.slip * at.friction, at.a
        n_u, n_v, n_w = mu * per_mass, per_mass, (mu * at.b - a - its.spin * at.arm) * per_inertia
    if branch.slip == 0 or other.slip == 0:
        b = one.b if branch.slip == 0 else two.b
        s_u, s_w = per_mass, b * per_inertia
    k_nn, k_ns, k_sn = n_v - a * n_w, -a * s_w, n_u + b * n_w
    nn = ns = sn = ss = 0.0
    if s_u > 0.0:
        ss = 1.0 / (s_u + b * s_w)
    if n_v > 0.0:
        yielding = k_nn - k_ns * k_sn * ss
        nn = 1.0 / yielding if yielding > 0.0 else math.nan
        ns, sn = -nn * k_ns * ss, -nn * k_sn * ss
        ss -= k_sn * ns * ss
    return Held(n_u, n_v, n_w, s_u, s_w, a, b, nn, ns, sn, ss)


@kernel
def locking(held: Held, lift: float, sweep: float, u: float, v: float, omega: float) -> tuple[float, float]:
    """Normal and tangential force [N] that keep a turning body in place, which has these rates without them."""
    miss_n, miss_s = lift - v + held.a * omega, sweep - u - held.b * omega
    return held.nn * miss_n + held.ns * miss_s, held.sn * miss_n + held.ss * miss_s


@kernel
def _turning(contact: np.void, one: Point, two: Point, branch: Branch, other: Branch) -> Forces:
    """Forces on a body that turns."""
    per_mass, ratio = contact["per_mass"], contact["ratio"]
    held = hold(per_mass, ratio, one, two, branch, other)
    n_1 = 0.0 if branch.gap_rate == 0 else (one.closing if branch.gap_rate < 0 else one.opening)
    n_2 = 0.0 if other.gap_rate == 0 else (two.closing if other.gap_rate < 0 else two.opening)
    f_1, f_2 = -branch.slip * one.friction * n_1, -other.slip * two.friction * n_2
    moment = -branch.spin * (one.arm * n_1 + two.arm * n_2)
    u, v = (f_1 + f_2) * per_mass + contact["downhill"], (n_1 + n_2) * per_mass - contact["inward"]
    omega = (one.b * f_1 - one.a * n_1 + (two.b * f_2 - two.a * n_2) + moment) * per_mass * ratio
    lift = one.lift if branch.gap_rate == 0 else two.lift
    sweep = one.sweep if branch.slip == 0 else two.sweep
    push, force = locking(held, lift, sweep, u, v, omega)
    u, v = u + held.n_u * push + held.s_u * force, v + held.n_v * push
    omega += held.n_w * push + held.s_w * force
    if branch.gap_rate == 0:
        n_1, f_1, moment = push, -branch.slip * one.friction * push, moment - branch.spin * one.arm * push
    elif other.gap_rate == 0:
        n_2, f_2, moment = push, -other.slip * two.friction * push, moment - other.spin * two.arm * push
    if branch.slip == 0:
        f_1 = force
    elif other.slip == 0:
        f_2 = force
    return Forces(n_1, n_2, f_1, f_2, moment, 0.0, u, v, omega)


@kernel
def couples(one: Point, two: Point, n_1: float, n_2: float, force: float) -> tuple[float, float, float, float]:
    """What keeps a body from turning whose slip is locked at both points: moments [N m] and what each is held against.

    The force may all act at one point, and friction at the other one then helps rolling resistance: once so, once so.
    """
    turning, load = one.a * n_1 + two.a * n_2, one.arm * n_1 + two.arm * n_2
    couple = abs(one.b - two.b) * one.friction
    return turning - two.b * force, load + couple * n_1, turning - one.b * force, load + couple * n_2


@kernel
def unturned(contact: np.void, one: Point, two: Point, branch: Branch) -> Forces:
    """Forces on a body that does not turn: both points do the same.

    Locked loads balance each other and the tangential force without a rolling moment, as far as their bounds allow. A
    locked tangential force is shared in proportion to the loads; but the shares may be others, within their bounds, if
    rolling resistance is not enough to keep the body from turning.
    """
    mass = 1.0 / contact["per_mass"]
    n_1, n_2 = (one.closing, two.closing) if branch.gap_rate < 0 else (one.opening, two.opening)
    total = mass * contact["inward"] if branch.gap_rate == 0 else n_1 + n_2
    force = -mass * contact["downhill"] if branch.slip == 0 else -branch.slip * one.friction * total
    share = force / total if total > 0.0 else 0.0
    lever_1, lever_2 = one.a - share * one.b, two.a - share * two.b
    if branch.gap_rate == 0:
        n_1 = total * lever_2 / (lever_2 - lever_1) if two.closing > 0.0 else total
        least, most = max(one.opening, total - two.closing), min(one.closing, total - two.opening)
        if least <= most:
            n_1 = min(max(n_1, least), most)
        n_2 = total - n_1
    moment = lever_1 * n_1 + lever_2 * n_2
    excess = abs(moment) - (one.arm * n_1 + two.arm * n_2)
    if branch.slip == 0:
        sign = -1.0 if moment < 0.0 else 1.0
        moment_1, load_1, moment_2, load_2 = couples(one, two, n_1, n_2, force)
        excess = max(sign * moment_1 - load_1, sign * moment_2 - load_2)
    u, v = force * contact["per_mass"] + contact["downhill"], total * contact["per_mass"] - contact["inward"]
    return Forces(n_1, n_2, force - share * n_2, share * n_2, moment, excess, u, v, 0.0)


@kernel
def forces(contact: np.void, one: Point, two: Point, branch: Branch, other: Branch) -> Forces:
    """Forces on both points at an instant, in a branch of each."""
    if branch.spin == 0:
        return unturned(contact, one, two, branch)
    return _turning(contact, one, two, branch, other)


@kernel
def points(contact: np.void, second: np.void, step: np.void, second_step: np.void) -> tuple[Point, Point]:
    """Return both points at the start of a step, for the box rule: where the forces vanish their ratio is kept.

    Where one point touches alone the other is at the same place, and has no force.
    """
    if contact["paired"] == 0.0:
        one = _point(contact, step, normal.bounds(progress.NO_DEPTH * contact["size"], contact), 1.0)
        return one, Point(one.a, one.b, one.lift, one.sweep, one.friction, one.arm, 0.0, 0.0)
    within, within_2 = normal.bounds(0.0, contact), normal.bounds(0.0, second)
    shallow = progress.NO_DEPTH * contact["size"]
    least, largest, scale = shallow * normal.stiffness(True, contact), max(within.closing, within_2.closing), 1.0
    if largest <= progress.ROUNDING / progress.NO_DEPTH * least:
        within, within_2 = normal.bounds(shallow, contact), normal.bounds(shallow, second)
    elif largest < least:
        scale = least / largest
    return _point(contact, step, within, scale), _point(second, second_step, within_2, scale)


@kernel
def _missed(point: Point, signs: Branch, branch: Branch, normal: float, force: float, found: Forces, w: float) -> float:
    """How far one point is from what its branch wants, as a force; ``w`` is the mobility of the mass [1/kg]."""
    copy_into_callers()
    outside = max(normal - point.closing, point.opening - normal)
    rate_n = found.v - point.a * found.omega - point.lift
    rate_t = found.u + point.b * found.omega - point.sweep
    slack = abs(force) - point.friction * normal
    return beyond(signs.gap_rate, branch.gap_rate, outside, rate_n, w) + beyond(
        signs.slip, branch.slip, slack, rate_t, w
    )


@kernel
def _violation(
    contact: np.void, one: Point, two: Point, signs: Branch, signs_2: Branch, branch: Branch, other: Branch
) -> float:
    """How far a branch of both points is from what it wants, relative to the normal force; NaN if it has no forces."""
    found = forces(contact, one, two, branch, other)
    per_mass = contact["per_mass"]
    missed = _missed(one, signs, branch, found.normal_1, found.tangential_1, found, per_mass)
    missed += _missed(two, signs_2, other, found.normal_2, found.tangential_2, found, per_mass)
    missed += beyond(signs.spin, branch.spin, found.excess, found.omega, per_mass * contact["ratio"]) / contact["size"]
    return float(missed / max(abs(found.normal_1 + found.normal_2), contact["inward"] / per_mass))


@kernel
def _fits(signs: Branch, branch: Branch, rigid: bool) -> bool:
    """Whether velocities of some signs can follow a branch."""
    return not (
        excluded(signs.gap_rate, branch.gap_rate)
        or excluded(signs.slip, branch.slip)
        or excluded(signs.spin, branch.spin)
        or (rigid and branch.gap_rate < 0)
    )


@kernel
def _turns(locked: int, free: int, velocity: int, side: int) -> bool:
    """Whether a velocity, locked at one point of a body that turns, may do this at the other, where it is free.

    ``velocity`` is its sign there, and ``side`` the one that it gets by the turning.
    """
    return locked != 0 or (free != 0 and (abs(velocity) == 1 or side == 0 or free == side))


@kernel
def _go_together(branch: Branch, other: Branch, signs: Branch, signs_2: Branch, opens: int, slips: int) -> bool:
    """Whether one body can do what two branches say: see the top of this module.

    ``opens`` and ``slips`` are the signs that a spin in the direction of the branch gives to the gap rate and to the
    slip of the second point over those of the first, 0 if the rates are to tell.
    """
    if branch.spin == 0:
        return branch.gap_rate == other.gap_rate and branch.slip == other.slip
    return (
        _turns(branch.gap_rate, other.gap_rate, signs_2.gap_rate, opens)
        and _turns(other.gap_rate, branch.gap_rate, signs.gap_rate, -opens)
        and _turns(branch.slip, other.slip, signs_2.slip, slips)
        and _turns(other.slip, branch.slip, signs.slip, -slips)
    )


@kernel
def _sides(spin: int, signs: Branch, along: float, across: float, size: float) -> tuple[int, int]:
    """What a spin that starts does at the second point beyond the first, for :func:`_go_together`.

    Its gap rate gains the difference of the arms, ``along`` [m], times the spin, and its slip that of the gaps,
    ``across`` [m]. Where the gaps are equal they soon differ, by the turning itself.
    """
    if abs(signs.spin) == 1:
        return 0, 0
    opens = spin * progress.sign_of(along)
    return opens, -progress.sign_of(along) if abs(across) <= progress.NO_DEPTH * size else spin * progress.sign_of(
        across
    )


@kernel
def branch_of(contact: np.void) -> Branch:
    """Branch that a point is in."""
    return Branch(int(contact["gap_rate"]), int(contact["slip"]), int(contact["spin"]))


@kernel
def _signs(contact: np.void) -> Branch:
    """Signs of the velocities of a point, for the box rule."""
    return Branch(
        progress.signs_of(contact["v_n"], contact["gap_left"]),
        progress.signs_of(contact["v_t"], contact["slip_left"]),
        progress.signs_of(contact["omega"], contact["spin_left"]),
    )


@kernel
def resolve_pair(contact: np.void, second: np.void, step: np.void, second_step: np.void) -> tuple[Branch, Branch]:
    """Choose the branches of two points that touch at once, by the box rule: the one of least violation.

    Those with more locks are listed first; of equal violations the first is taken.
    """
    signs, signs_2 = _signs(contact), _signs(second)
    one, two = points(contact, second, step, second_step)
    rigid = contact["k_closing"] == math.inf
    best, best_2 = Branch(0, 0, 0), Branch(0, 0, 0)
    least = 1e300
    for number in range(27):
        branch = Branch(in_turn(number % 3), in_turn(number // 3 % 3), in_turn(number // 9))
        if not _fits(signs, branch, rigid):
            continue
        opens, slips = _sides(branch.spin, signs, one.a - two.a, contact["gap"] - second["gap"], contact["size"])
        for number_2 in range(9):
            other = Branch(in_turn(number_2 % 3), in_turn(number_2 // 3), branch.spin)
            if _fits(signs_2, other, rigid) and _go_together(branch, other, signs, signs_2, opens, slips):
                violation = _violation(contact, one, two, signs, signs_2, branch, other)
                # A branch without forces (NaN) compares false and is never chosen.
                if violation < least - TIE:
                    best, best_2, least = branch, other, violation
    return best, best_2
