"""Two points that touch at once: their forces, and the branch that they follow; docs/physics.md, section 8.2.

Each point is a contact of its own, with its gap, its slip and its forces. The points share the body: its rates follow
from the forces of both. A body that turns locks one gap rate and one slip at most, each at either point. A body that
does not turn moves both points alike, and only the sum of the forces that lock it is determined.

Everything but the choice itself is a program. The branch of the second point is called ``other``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import scalar
from sledenv.compiler.values import absolute, equal, larger, less, not_more, sign, smaller, where
from sledenv.kernel import normal
from sledenv.kernel.friction import CLEAR, TIE, Branch, beyond, excluded, in_turn


class Point(NamedTuple):
    """One of the two points at an instant."""

    a: Any  # [m] arms
    b: Any  # [m]
    # Centrifugal terms [m/s^2]: dv_n/dt = dv/dt - a domega/dt - lift,
    lift: Any
    sweep: Any  # dv_t/dt = du/dt + b domega/dt - sweep
    friction: Any  # [-]
    arm: Any  # [m] of its rolling resistance
    closing: Any  # [N] normal force while the gap closes,
    opening: Any  # [N] and while it opens


class Held(NamedTuple):
    """How a turning body yields to the forces of its locked velocities; zeros stand for what is not locked."""

    # Rates of u, v and omega under a unit normal force where the gap rate is locked, with its friction and moment,
    n_u: Any
    n_v: Any
    n_w: Any
    # and of u and omega under a unit tangential force where the slip is locked.
    s_u: Any
    s_w: Any
    # Arm a [m] of the point whose gap rate is locked, arm b [m] of the point whose slip is locked.
    a: Any
    b: Any
    # Inverse of the matrix from both forces to the rates of both locked velocities.
    nn: Any
    ns: Any
    sn: Any
    ss: Any


class Forces(NamedTuple):
    """What acts on both points, and the rates of the body under it."""

    normal_1: Any  # [N]
    normal_2: Any
    tangential_1: Any  # [N]
    tangential_2: Any
    moment: Any  # [N m]
    excess: Any  # [N m] by which it exceeds the rolling resistance of a body that does not turn
    u: Any  # [m/s^2]
    v: Any  # [m/s^2]
    omega: Any  # [rad/s^2]


def pick(at_first: Any, at_second: Any, first: Any, second: Any) -> Any:
    """``first`` where the first mask is true, else ``second`` where the second one is, else 0."""
    return where(at_first, first, where(at_second, second, 0.0))


def branch_of(contact: Any, point: Any) -> Branch:
    """Branch that a point is in."""
    return Branch(point.gap_rate, point.slip, contact.spin)


def both_points(space: Any, count: int = 2) -> tuple[Point, Point]:
    """Both points at the start of a step. If all normal forces are nearly zero, they are made larger by one factor.

    If there is only one, the other has no forces.
    """
    contact = space.contact
    shallow = normal.NO_DEPTH * contact.size
    given = list(zip(space.points, space.steps, strict=True))[:count]
    within = [normal.bounds_of(contact, point, 0.0) for point, _ in given]
    least, largest = shallow * contact.k_closing, within[0][0]
    if count > 1:
        largest = larger(largest, within[1][0])
    tiny = not_more(largest, normal.ROUNDING / normal.NO_DEPTH * least)
    scale = where(less(largest, least), least / largest, 1.0)
    found = []
    for (point, step), forces in zip(given, within, strict=True):
        limit = normal.bounds_of(contact, point, shallow)
        closing, opening = (where(tiny, p, scale * q) for p, q in zip(limit, forces, strict=True))
        a, b = point.h * step.sine, point.r - point.h * step.cosine
        square = contact.omega * contact.omega
        lift, sweep = point.h * step.cosine * square, -a * square
        found.append(Point(a, b, lift, sweep, point.friction, point.arm, closing, opening))
    return found[0], found[1] if count > 1 else found[0]._replace(arm=0.0, closing=0.0, opening=0.0)


def hold(contact: Any, one: Point, two: Point, branch: Branch, other: Branch) -> Held:
    """How a turning body is held; NaN where a normal force accelerates the surfaces of a locked gap to each other."""
    gap_1, gap_2 = equal(branch.gap_rate, 0.0), equal(other.gap_rate, 0.0)
    slip_1, slip_2 = equal(branch.slip, 0.0), equal(other.slip, 0.0)
    per_mass = contact.per_mass
    mu = -pick(gap_1, gap_2, branch.slip * one.friction, other.slip * two.friction)
    a, below = pick(gap_1, gap_2, one.a, two.a), pick(gap_1, gap_2, one.b, two.b)
    n_v = pick(gap_1, gap_2, per_mass, per_mass)
    n_u, n_w = mu * n_v, (mu * below - a - branch.spin * pick(gap_1, gap_2, one.arm, two.arm)) * n_v * contact.ratio
    b, s_u = pick(slip_1, slip_2, one.b, two.b), pick(slip_1, slip_2, per_mass, per_mass)
    s_w = b * s_u * contact.ratio
    k_nn, k_ns, k_sn = n_v - a * n_w, -a * s_w, n_u + b * n_w
    ss = where(slip_1 | slip_2, 1.0 / (s_u + b * s_w), 0.0)
    yielding = k_nn - k_ns * k_sn * ss
    nn = where(gap_1 | gap_2, where(less(0.0, yielding), 1.0 / yielding, math.nan), 0.0)
    ns, sn = -nn * k_ns * ss, -nn * k_sn * ss
    return Held(n_u, n_v, n_w, s_u, s_w, a, b, nn, ns, sn, ss - k_sn * ns * ss)


def locking(held: Held, lift: Any, sweep: Any, u: Any, v: Any, omega: Any) -> tuple[Any, Any]:
    """Normal and tangential force [N] that keep locked velocities at zero; ``u``, ``v``, ``omega``: rates without."""
    miss_n, miss_s = lift - v + held.a * omega, sweep - u - held.b * omega
    return held.nn * miss_n + held.ns * miss_s, held.sn * miss_n + held.ss * miss_s


def _turned(contact: Any, one: Point, two: Point, branch: Branch, other: Branch) -> Forces:
    """Forces on a body that turns."""
    gap_1, gap_2 = equal(branch.gap_rate, 0.0), equal(other.gap_rate, 0.0)
    slip_1, slip_2 = equal(branch.slip, 0.0), equal(other.slip, 0.0)
    per_mass = contact.per_mass
    n_1 = where(gap_1, 0.0, where(less(branch.gap_rate, 0.0), one.closing, one.opening))
    n_2 = where(gap_2, 0.0, where(less(other.gap_rate, 0.0), two.closing, two.opening))
    f_1, f_2 = -branch.slip * one.friction * n_1, -other.slip * two.friction * n_2
    moment = -branch.spin * (one.arm * n_1 + two.arm * n_2)
    u, v = (f_1 + f_2) * per_mass + contact.downhill, (n_1 + n_2) * per_mass - contact.inward
    omega = (one.b * f_1 - one.a * n_1 + (two.b * f_2 - two.a * n_2) + moment) * per_mass * contact.ratio
    held = hold(contact, one, two, branch, other)
    lift, sweep = pick(gap_1, gap_2, one.lift, two.lift), pick(slip_1, slip_2, one.sweep, two.sweep)
    push, force = locking(held, lift, sweep, u, v, omega)
    u, v = u + held.n_u * push + held.s_u * force, v + held.n_v * push
    omega = omega + held.n_w * push + held.s_w * force
    moment = moment - branch.spin * pick(gap_1, gap_2, one.arm, two.arm) * push
    f_1 = where(slip_1, force, where(gap_1, -branch.slip * one.friction * push, f_1))
    f_2 = where(slip_2, force, where(gap_2, -other.slip * two.friction * push, f_2))
    return Forces(where(gap_1, push, n_1), where(gap_2, push, n_2), f_1, f_2, moment, 0.0, u, v, omega)


def couples(one: Point, two: Point, n_1: Any, n_2: Any, force: Any) -> tuple[Any, Any, Any, Any]:
    """Two moments [N m], each with its bound, on a body that slips at neither point: it turns if one exceeds its bound.

    For the first moment all of the tangential force acts at the second point. Friction at the first point may oppose it
    there: this gives a couple that helps rolling resistance. For the second moment the points are exchanged.
    """
    turning, load = one.a * n_1 + two.a * n_2, one.arm * n_1 + two.arm * n_2
    apart = absolute(one.b - two.b)
    couple_1, couple_2 = apart * one.friction * n_1, apart * two.friction * n_2
    return turning - two.b * force, load + couple_1, turning - one.b * force, load + couple_2


def unturned(contact: Any, one: Point, two: Point, branch: Branch, count: int = 2) -> Forces:
    """Forces on a body that does not turn: both points move alike. If there is only one, the other has no forces.

    Locked normal forces are shared so that no rolling moment is needed, as far as their bounds allow. A locked
    tangential force is shared in proportion to the bounds of friction, but for ``excess`` it is shared, within these
    bounds, so that it best keeps the body from turning. Both arms b are equal but for the depths.
    """
    mass = 1.0 / contact.per_mass
    locked, sticks = equal(branch.gap_rate, 0.0), equal(branch.slip, 0.0)
    n_1, n_2 = (where(less(branch.gap_rate, 0.0), point.closing, point.opening) for point in (one, two))
    total = where(locked, mass * contact.inward, n_1 + n_2)
    needed = -mass * contact.downhill
    evenly = where(less(0.0, total), needed / total, 0.0)
    share_1, share_2 = (where(sticks, evenly, -branch.slip * point.friction) for point in (one, two))
    lever_1, lever_2 = one.a - share_1 * one.b, two.a - share_2 * two.b
    balanced = total
    if count > 1:
        balanced = where(less(0.0, two.closing), total * lever_2 / (lever_2 - lever_1), total)
    least, most = larger(total - two.closing, one.opening), smaller(total - two.opening, one.closing)
    balanced = where(not_more(least, most), smaller(larger(balanced, least), most), balanced)
    n_1, n_2 = where(locked, balanced, n_1), where(locked, total - balanced, n_2)
    bound_1, bound_2 = one.friction * n_1, two.friction * n_2
    bound = bound_1 + bound_2
    second = where(sticks, where(less(0.0, bound), needed / bound * bound_2, evenly * n_2), share_2 * n_2)
    force = where(sticks, needed, share_1 * n_1 + second)
    moment = lever_1 * n_1 + lever_2 * n_2
    excess = absolute(moment) - (one.arm * n_1 + two.arm * n_2)
    toward = where(less(moment, 0.0), -1.0, 1.0)
    moment_1, load_1, moment_2, load_2 = couples(one, two, n_1, n_2, force)
    excess = where(sticks, larger(toward * moment_1 - load_1, toward * moment_2 - load_2), excess)
    u, v = force * contact.per_mass + contact.downhill, total * contact.per_mass - contact.inward
    return Forces(n_1, n_2, force - second, second, moment, excess, u, v, 0.0)


def _missed(point: Point, signs: Branch, branch: Branch, push: Any, force: Any, found: Forces, per_mass: Any) -> Any:
    """By how much one point breaks the conditions of its branch, as a force."""
    outside = larger(push - point.closing, point.opening - push)
    rate_n = found.v - point.a * found.omega - point.lift
    rate_t = found.u + point.b * found.omega - point.sweep
    slack = absolute(force) - point.friction * push
    missed = beyond(signs.gap_rate, branch.gap_rate, outside, rate_n, per_mass)
    return missed + beyond(signs.slip, branch.slip, slack, rate_t, per_mass)


def _judge(still: bool) -> Callable[..., tuple[Any]]:
    """Return the program that gives by how much a branch of both points breaks its conditions, over the normal force.

    That is NaN if the branch has no forces.
    """

    def program(space: Any, signs: Branch, signs_2: Branch, branch: Branch, other: Branch) -> tuple[Any]:
        contact = space.contact
        one, two = both_points(space)
        found = unturned(contact, one, two, branch) if still else _turned(contact, one, two, branch, other)
        per_mass = contact.per_mass
        missed = _missed(one, signs, branch, found.normal_1, found.tangential_1, found, per_mass)
        missed = missed + _missed(two, signs_2, other, found.normal_2, found.tangential_2, found, per_mass)
        turned = beyond(signs.spin, branch.spin, found.excess, found.omega, per_mass * contact.ratio) / contact.size
        return ((missed + turned) / larger(contact.inward / per_mass, absolute(found.normal_1 + found.normal_2)),)

    return program


def _turns(locked: Any, free: Any, velocity: Any, side: Any) -> Any:
    """Mask of whether the other point of a body that turns may have the sign ``free``.

    ``locked`` is the sign of the same velocity at this point. If it is not 0, every sign is possible. If it is 0, the
    point is locked: ``free`` is then not 0, and it is the sign ``side`` that the turning gives. ``side`` does not count
    if it is 0, or if the other point has a ``velocity`` already.
    """
    may = equal(absolute(velocity), 1.0) | equal(side, 0.0) | equal(free, side)
    return ~equal(locked, 0.0) | (~equal(free, 0.0) & may)


def _compatible(space: Any, signs: Branch, signs_2: Branch, branch: Branch, other: Branch) -> tuple[Any]:
    """1 if one body can follow both branches, else 0.

    A spin that starts makes the gap rates of the points differ, by the spin times the difference of the arms a. It
    makes the slips differ, by the spin times the difference of the gaps. Equal gaps differ once the body has turned.
    """
    one, two = space.points
    along = one.h * space.steps[0].sine - two.h * space.steps[1].sine
    across = one.gap - two.gap
    equal_gaps = not_more(absolute(across), normal.NO_DEPTH * space.contact.size)
    spinning = equal(absolute(signs.spin), 1.0)  # the velocities themselves say it
    opens = where(spinning, 0.0, branch.spin * sign(along))
    slips = where(equal_gaps, -sign(along), where(spinning, 0.0, branch.spin * sign(across)))
    alike = equal(branch.gap_rate, other.gap_rate) & equal(branch.slip, other.slip)
    apart = (
        _turns(branch.gap_rate, other.gap_rate, signs_2.gap_rate, opens)
        & _turns(other.gap_rate, branch.gap_rate, signs.gap_rate, -opens)
        & _turns(branch.slip, other.slip, signs_2.slip, slips)
        & _turns(other.slip, branch.slip, signs.slip, -slips)
    )
    still = equal(branch.spin, 0.0)
    return (where((still & alike) | (~still & apart), 1.0, 0.0),)


_may_be = scalar(_compatible)
_violation_still, _violation_turning = scalar(_judge(still=True)), scalar(_judge(still=False))


@kernel
def _unfit(signs: Branch, branch: Branch, rigid: bool) -> bool:
    """Whether velocities with these signs cannot follow a branch."""
    return (
        excluded(signs.gap_rate, branch.gap_rate)
        or excluded(signs.slip, branch.slip)
        or excluded(signs.spin, branch.spin)
        or (rigid and branch.gap_rate < 0)
    )


@kernel
def resolve_pair(space: np.void, signs: Branch, signs_2: Branch, side: int, trial: int) -> tuple[Branch, Branch, float]:
    """Choose the branches of two points that touch at once, by the box rule; return them and their violation.

    The least violation is taken, and of equal ones the first. Branches with a locked spin come first, of these the ones
    with a locked slip, of these the ones with a locked gap rate. ``signs`` and ``signs_2`` are those of the velocities
    of each point, as in :func:`sledenv.kernel.friction.resolve`. ``side`` is the sign of spin that is tried first, 1 or
    -1; the mirror image has the other one. Several branches may have no clear violation, while all but one of them end
    at once: ``trial`` = n > 0 takes the n-th of them, or if there are fewer, the branch of least violation.
    """
    branch, other = Branch(signs.gap_rate, signs.slip, signs.spin), Branch(signs_2.gap_rate, signs_2.slip, signs.spin)
    if abs(signs.spin * signs.slip * signs_2.slip * signs.gap_rate * signs_2.gap_rate) == 1:
        return branch, other, 0.0  # no velocity is zero
    best, best_2 = Branch(0, 0, 0), Branch(0, 0, 0)
    rigid, least = space["contact"]["rigid"] != 0.0, 1e300
    for turn in range(27):
        spin = side * in_turn(turn // 9)
        sense = spin if spin != 0 else side
        branch = Branch(in_turn(turn % 3), sense * in_turn(turn // 3 % 3), spin)
        if _unfit(signs, branch, rigid):
            continue
        for turn_2 in range(9):
            other = Branch(in_turn(turn_2 % 3), sense * in_turn(turn_2 // 3), spin)
            if _unfit(signs_2, other, rigid) or not _may_be(space, signs, signs_2, branch, other)[0] > 0.0:
                continue
            if spin == 0:
                violation = _violation_still(space, signs, signs_2, branch, other)[0]
            else:
                violation = _violation_turning(space, signs, signs_2, branch, other)[0]
            # A branch without forces has the violation NaN: this compares false, so the branch is never chosen.
            if violation < least - TIE:
                best, best_2, least = branch, other, violation
            if trial == 0 and violation == 0.0:
                return best, best_2, least  # no later branch is better
            if trial > 0 and violation <= CLEAR:
                trial -= 1
                if trial == 0:
                    return branch, other, violation
    return best, best_2, least
