"""Power series of one step of a contact of one point that turns: docs/physics.md, section 5.

Most steps are of that kind, so they have programs, by whether gap rate and slip are locked; recurrence.py has the
others. :mod:`sledenv.kernel.step` says how far a step may go and how it ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from sledenv.compiler import rows
from sledenv.compiler.jit import kernel
from sledenv.compiler.rows import EIGHT, TERMS, element, repeated, shuffled, side_by_side
from sledenv.compiler.trace import Program, block, scalar, straight
from sledenv.compiler.values import absolute, fma, larger, not_more, rough_root, smaller, where
from sledenv.kernel import normal
from sledenv.kernel.friction import opposing

ORDER = TERMS - 1  # forces are known to one order less than the motion
EARLIER = 1e3  # tolerances that an earlier term may reach, some times what terms shrink by from there to the last

_SHARES = 1.0 / np.maximum(rows.COUNT, 1.0)
_KEPT = np.where(rows.COUNT < TERMS, 1.0, 0.0)
_NEXT = _KEPT * (rows.COUNT + 1.0)
_FORCES = np.where(rows.COUNT < ORDER, 1.0, 0.0)


def _plus_product(a: Any, b: Any, rest: Any) -> Any:
    """``a * b + rest``, where the rest may be None for nothing."""
    return a * b if rest is None else fma(a, b, rest)


def product(p: Sequence[Any], q: Sequence[Any], k: int, first: int) -> Any:
    """Terms of coefficient ``k`` of a product, from ``first`` on at either end; None if there are none.

    The newest coefficients, towards the ends, come last, and the terms are summed in two chains: little waits for them.
    """
    places = sorted(range(first, k - first + 1), key=lambda i: (abs(2 * i - k), i))
    chains: list[Any] = [None, None]
    for j, i in enumerate(places[:-2]):
        chains[j % 2] = _plus_product(p[i], q[k - i], chains[j % 2])
    found = chains[0] if chains[1] is None else chains[0] + chains[1]
    for i in places[-2:]:
        found = _plus_product(p[i], q[k - i], found)
    return found


class _Spinning(NamedTuple):
    """Coefficients of a motion with spin, in the step's unit of time and per mass; some depend on the branch."""

    turns: list[Any]  # pairs of sine and cosine of theta
    sines: list[Any]
    spins: list[Any]
    gaps: list[Any]  # where the gap is free
    loads: list[Any]  # normal forces where it is locked
    forces: list[Any]  # where the slip is locked


def _turned_on(turn: Any, spin: Any, known: Any, k: int) -> Any:
    """Sine and cosine of term ``k`` + 1: what is known of their products with the spin, and the newest term of that."""
    whole = _plus_product(turn, spin, known) * (np.array([-1.0, 1.0]) / (k + 1))
    return shuffled(whole, None, (1, 0))


def _recurrence(contact: Any, point: Any, step: Any, gap_locked: bool, slip_locked: bool) -> _Spinning:
    """Coefficients of a motion with spin, one order after the other: docs/physics.md (5.5)-(5.9).

    All products are summed at once, side by side: those of sine and cosine with the spin, and those of levers with
    forces.
    """
    unit, ratio, h, r = step.unit, contact.ratio, point.h, point.r
    mu, rho = opposing(contact, point)
    square = unit * unit
    inward, downhill = square * contact.inward, square * contact.downhill
    stiffness = -(point.stiffness * contact.per_mass * square)  # normal force over load
    # Spin rate that a force at the lever gives; the load is the normal force itself where the gap is locked.
    per_lever = ratio if gap_locked else ratio * stiffness
    lever_sine, lever_cosine = -(h * per_lever), -(mu * h * per_lever)
    lever_rest = fma(mu, r, rho) * per_lever
    a_0, b_0 = h * step.sine, fma(-h, step.cosine, r)
    if slip_locked:
        lever_cosine, lever_rest = 0.0, rho * per_lever
    sine, cosine, spin = [step.sine], [step.cosine], [unit * contact.omega]
    turn, twice = [side_by_side(sine[0], cosine[0])], [repeated(spin[0], 2)]
    gap: list[Any] = [point.gap, unit * point.v_n]
    load: list[Any] = []
    force: list[Any] = []
    per_unit = 1.0 / unit
    lever, arm = [], []
    divisor: Any = 1.0
    left: list[Any] = []  # sine, cosine, lever, arm
    right: list[Any] = [None]  # spin, spin, load, force; the last two of the term before
    for k in range(ORDER + 1):
        # Lever of the normal force, and arm of a locked tangential one.
        level = lever_sine * sine[k] if slip_locked else fma(lever_sine, sine[k], lever_cosine * cosine[k])
        lever.append(level + lever_rest if k == 0 else level)
        arm.append((b_0 if k == 0 else -(h * cosine[k])) * ratio if slip_locked else 0.0)
        left.append(shuffled(turn[k], side_by_side(lever[k], arm[k]), range(4)))
        known = None  # sine and cosine times the spin, without the newest coefficient of that
        if k == 0:
            if gap_locked:
                divisor = divisor - lever[0] * a_0
            if slip_locked:
                divisor = divisor + arm[0] * b_0
            divisor = 1.0 / divisor
        else:
            if not gap_locked:
                load.append(normal.load(contact, gap[k - 1], k * per_unit * gap[k]))
            inner = product(left, right, k, 2)
            known = None if inner is None else shuffled(inner, None, (0, 1))
            # The newest coefficient of the spin: the forces before, each with the levers.
            rest = None
            if inner is not None:
                rest = element(inner, 2) + element(inner, 3) if slip_locked else element(inner, 2)
            for i in sorted({1, k - 1} - {0, k}):
                known = _plus_product(turn[i], twice[k - i], known)
                rest = _plus_product(lever[i], load[k - 1 - i], rest)
                if slip_locked:
                    rest = fma(arm[i], force[k - 1 - i], rest)
            known = _plus_product(turn[k], twice[0], known)
            if gap_locked:  # the lift that the other coefficients of the spin give to the contact point
                lift = (k * h) * element(known, 0)
                lift = lift + inward if k == 1 else lift
                rest = _plus_product(lever[0], lift, rest)
            else:
                rest = _plus_product(lever[0], load[k - 1], rest)
            if slip_locked:  # and the sweep
                sweep = (-k * h) * element(known, 1)
                sweep = sweep + downhill if k == 1 else sweep
                rest = fma(-arm[0], sweep, rest)
            rest = rest * ((1.0 / k) * divisor)
            spin.append(rest)
            twice.append(repeated(rest, 2))
            if gap_locked:
                load.append(fma(k * a_0, rest, lift))
            force.append(-fma(k * b_0, rest, sweep) if slip_locked else 0.0)
            right.append(shuffled(twice[k], side_by_side(load[k - 1], force[k - 1]), range(4)))
        # Sine and cosine after it.
        turn.append(_turned_on(turn[0], twice[k], known, k))
        sine.append(element(turn[k + 1], 0))
        cosine.append(element(turn[k + 1], 1))
        if not gap_locked and k > 0:
            free = load[k - 1] * (stiffness * (1.0 / (k * (k + 1))))
            gap.append(fma(h, cosine[k + 1], fma(-0.5, inward, free) if k == 1 else free))
    return _Spinning(turn[:TERMS], sine, spin[:TERMS], gap, load, force)


def _spinning(gap_locked: bool, slip_locked: bool) -> Program:
    """Return the program that fills the series in a branch with spin."""

    def program(contact: Any, point: Any, step: Any) -> None:
        found = _recurrence(contact, point, step, gap_locked, slip_locked)
        unit = step.unit
        per_unit = 1.0 / unit
        in_seconds = repeated(per_unit, EIGHT)
        masses = repeated(per_unit * per_unit / contact.per_mass, EIGHT)  # what makes a force of one per mass
        nothing = [np.zeros(EIGHT)] * 3
        spins, (sines, cosines) = rows.of(found.spins), rows.apart(found.turns)
        if gap_locked:
            gaps, rates, loads = rows.of([point.gap]), nothing, rows.of(found.loads[:ORDER])
            normals = [p * masses for p in loads]
        else:
            gaps = rows.of(found.gaps[:TERMS])
            rates = [p * (in_seconds * n) for p, n in zip(rows.moved_back(gaps, found.gaps[1:]), _NEXT, strict=True)]
            rates = rows.with_first(rates, point.v_n)
            loads = [normal.load(contact, p, q) for p, q in zip(gaps, rates, strict=True)]
            stiff = repeated(-point.stiffness, EIGHT)
            normals = [p * (stiff * kept) for p, kept in zip(loads, _FORCES, strict=True)]
        # How fast the contact point turns away from under the mass centre: slip velocity = speed + sweep.
        reach, height = repeated(point.r, EIGHT), repeated(point.h, EIGHT)
        nexts = rows.times(rows.moved_back(sines, found.sines[1:]), _NEXT)
        sweeps = [fma(reach, p, -(height * q)) for p, q in zip(spins, nexts, strict=True)]
        if slip_locked:
            speeds, slips = [-p for p in sweeps], nothing
            step.force = [p * masses for p in rows.of(found.forces[:ORDER])]
        else:
            square = unit * unit
            stiffness = -(point.stiffness * contact.per_mass * square)
            mu, _ = opposing(contact, point)
            driven = repeated(mu if gap_locked else mu * stiffness, EIGHT)
            speeds = [p * (driven * share) for p, share in zip(rows.moved_on(loads, 0.0), _SHARES, strict=True)]
            start = fma(unit, point.v_t, -element(sweeps[0], 0))
            speeds[0] = speeds[0] + side_by_side(start, square * contact.downhill, *([0.0] * 6))
            slips = [(p + q) * (in_seconds * kept) for p, q, kept in zip(speeds, sweeps, _KEPT, strict=True)]
            slips = rows.with_first(slips, point.v_t)
        step.x = rows.times(rows.moved_on(speeds, contact.x), _SHARES * _KEPT)
        step.phi = rows.times(rows.moved_on(spins, contact.phi), _SHARES * _KEPT)
        step.omega = [p * in_seconds for p in spins]
        step.gap, step.v_n, step.v_t = gaps, rates, slips
        step.normal, step.sines, step.cosines = normals, sines, cosines

    return program


# Branches by what is locked.
expand_free = straight(_spinning(gap_locked=False, slip_locked=False))
expand_sticking = straight(_spinning(gap_locked=False, slip_locked=True))
expand_settled = straight(_spinning(gap_locked=True, slip_locked=False))
expand_rolling = straight(_spinning(gap_locked=True, slip_locked=True))


_HEEDED = np.array([ORDER - 3, ORDER - 1, ORDER, ORDER])  # orders of the terms that bound a step, the last one twice
_ALLOWED = np.array([EARLIER, 1.0, 1.0, 1.0])


def _longest(size: Any, scale: Any, tolerance: Any, most: Any, v_n: Any, v_t: Any, omega: Any) -> tuple[Any, ...]:
    """Program of :func:`longest_step`."""
    count = len(_HEEDED)
    heeded = []
    for series in (v_n, v_t, omega):
        # One block of the series: what has just been written at once can be read at once.
        last = block(series, ORDER - 2, count)
        heeded.append(absolute(shuffled(last, repeated(series[ORDER - 3], count), (count, 1, 2, 2))))
    opening, slip, spin = heeded
    largest = larger(larger(opening, slip), repeated(size, count) * spin)
    powers = {1: most}
    for k in (2, 4, 8, 16):
        powers[k] = powers[k // 2] * powers[k // 2]
    reached = []
    for k in _HEEDED:
        power = 1.0
        for bit in (1, 2, 4, 8, 16):
            power = power * powers[bit] if k & bit else power
        reached.append(power)
    small = repeated(tolerance, count) * _ALLOWED * repeated(scale, count)
    whole = repeated(most, count)
    steps = where(not_more(largest * side_by_side(*reached), small), whole, rough_root(small / largest, _HEEDED))
    sane = (opening + slip + spin) * 0.0
    step, unsound = most, 0.0
    for i in reversed(range(count - 1)):
        step, unsound = smaller(step, element(steps, i)), unsound + element(sane, i)
    return (step + unsound,)


_longest_of = scalar(_longest)


@kernel
def longest_step(
    size: float, scale: float, tolerance: float, most: float, v_n: np.ndarray, v_t: np.ndarray, omega: np.ndarray
) -> float:
    """Step, at most ``most``, of which the last terms of the velocities stay below ``tolerance * scale``.

    Terms come and go as those of a cosine, and a motion from rest has odd ones only: both of the last may happen to be
    small, so an earlier one is heeded too.

    Parameters
    ----------
    size : float
        Of the body [m].
    scale : float
        Of the velocities [m/s].
    tolerance : float
    most : float
        In units of the time of the series, as the answer is; NaN if a term is not finite.
    v_n, v_t, omega : ndarray, shape (WIDTH,)
        The series of the velocities.
    """
    return _longest_of(size, scale, tolerance, most, v_n, v_t, omega)[0]
