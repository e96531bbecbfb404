"""The impact of a straight side that lands flat: both its ends hit at once; docs/physics.md, section 8.

Two rigid impacts at the same time have no unique limit. The one taken here is that of springs at both ends whose
stiffness grows: they get short, so the configuration is frozen and gravity plays no part. The duration then does not
matter, and the stiffness of compression may be taken as the mass times 1/s^2.

The body lies flat, so both ends have the same arm b and slip alike. Between events the motion is linear, and its power
series are short.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.rows import NODES, TERMS, WEIGHTS
from sledenv.kernel.friction import TIE, in_turn, sign_of
from sledenv.kernel.roots import first_root, horner

CLOSING, OPENING, LOCKED, AWAY = range(4)  # what the gap at an end does, while it is pressed in or off the slope
ENDS, ENDLESS = range(2)
MOST_STEPS: Final = 2000
REACH: Final = 1.5  # [rad] of the fastest oscillation in a unit of time: the last term is below 2e-14 then
NOISE: Final = 4e-16  # of the largest force: rounding of a force
CANCELLED: Final = 1e-13  # of its terms: a smaller sum of series is rounding
LEAST_RATE: Final = 1e-13  # of the speed of approach: a slower end stands still


class Side(NamedTuple):
    """A straight side that lands flat."""

    mass: float  # [kg]
    per_inertia: float  # [1/(kg m^2)]
    a_1: float  # [m] arms of its ends
    a_2: float
    b: float  # [m]
    friction_1: float  # [-] at its ends
    friction_2: float
    arm_1: float  # [m] rolling arms
    arm_2: float
    size: float  # [m] of the body
    opening: float  # [N/m] over mass: stiffness while the gap opens, the square of the restitution


class Phase(NamedTuple):
    """What happens until the next event."""

    gap_1: int
    gap_2: int
    slip: int
    spin: int


class Yielding(NamedTuple):
    """Forces and rates under unit loads at the ends, those at locked ends included: pairs, one for each load."""

    normal_1: tuple[float, float]
    normal_2: tuple[float, float]
    force: tuple[float, float]
    moment: tuple[float, float]
    v_1: tuple[float, float]
    v_2: tuple[float, float]
    v_t: tuple[float, float]
    omega: tuple[float, float]


class Event(NamedTuple):
    """What ends a phase."""

    length: float  # [units] of the phase
    row: int  # of the depth or velocity that is zero there, -1 if nothing happens
    released: int  # sign of slip or spin, or what the gap does, if that has been locked; 0, or -1 of a gap


@kernel
def _of(pair: tuple[float, float], load_1: float, load_2: float) -> float:
    return pair[0] * load_1 + pair[1] * load_2


@kernel
def _turning(side: Side, slip: int, spin: int, a: float, friction: float, arm: float) -> tuple[float, float]:
    """Tangential force and rate of spin under a unit normal force at one end."""
    if spin == 0:
        return -slip * friction, 0.0
    lever = -a - spin * arm
    mass_b = side.mass * side.b * side.per_inertia
    force = -slip * friction if slip != 0 else -mass_b * lever / (1.0 + mass_b * side.b)
    return force, (lever + side.b * force) * side.per_inertia


@kernel
def _yielding(side: Side, phase: Phase) -> Yielding:
    """How a body yields in a phase; NaN where a normal force presses the surfaces of a locked end together."""
    force_1, spin_1 = _turning(side, phase.slip, phase.spin, side.a_1, side.friction_1, side.arm_1)
    force_2, spin_2 = _turning(side, phase.slip, phase.spin, side.a_2, side.friction_2, side.arm_2)
    per_mass = 1.0 / side.mass
    m_11, m_12 = per_mass - side.a_1 * spin_1, per_mass - side.a_1 * spin_2
    m_21, m_22 = per_mass - side.a_2 * spin_1, per_mass - side.a_2 * spin_2
    n_1, n_2 = (1.0, 0.0), (0.0, 1.0)
    if phase.gap_1 == LOCKED and phase.gap_2 == LOCKED:
        n_1, n_2 = (0.0, 0.0), (0.0, 0.0)
    elif phase.gap_1 == LOCKED:
        n_1 = (0.0, -m_12 / m_11 if m_11 > 0.0 else math.nan)
    elif phase.gap_2 == LOCKED:
        n_2 = (-m_21 / m_22 if m_22 > 0.0 else math.nan, 0.0)
    force = (force_1 * n_1[0] + force_2 * n_2[0], force_1 * n_1[1] + force_2 * n_2[1])
    spin = (spin_1 * n_1[0] + spin_2 * n_2[0], spin_1 * n_1[1] + spin_2 * n_2[1])
    moment = (
        spin[0] / side.per_inertia + side.a_1 * n_1[0] + side.a_2 * n_2[0] - side.b * force[0],
        spin[1] / side.per_inertia + side.a_1 * n_1[1] + side.a_2 * n_2[1] - side.b * force[1],
    )
    v_1 = (m_11 * n_1[0] + m_12 * n_2[0], m_11 * n_1[1] + m_12 * n_2[1])
    v_2 = (m_21 * n_1[0] + m_22 * n_2[0], m_21 * n_1[1] + m_22 * n_2[1])
    v_t = (force[0] * per_mass + side.b * spin[0], force[1] * per_mass + side.b * spin[1])
    if phase.gap_1 == LOCKED:
        v_1 = (0.0, 0.0)
    if phase.gap_2 == LOCKED:
        v_2 = (0.0, 0.0)
    if phase.slip == 0:
        v_t = (0.0, 0.0)
    return Yielding(n_1, n_2, force, moment, v_1, v_2, v_t, spin)


@kernel
def _stiffness(side: Side, gap: int) -> float:
    """Stiffness [N/m] of an end; 0 where it is locked, as its load then follows from the other one."""
    if gap == CLOSING:
        return side.mass
    return side.mass * side.opening if gap == OPENING else 0.0


@kernel
def _missed_at(side: Side, gap: int, depth: float, speed: float, normal: float, rate: float) -> float:
    """By how much an end breaks the conditions of what its gap does, as a force [N]."""
    if speed != 0.0:
        return 0.0
    if gap == LOCKED:
        return max(normal - side.mass * depth, side.mass * side.opening * depth - normal, 0.0)
    return side.mass * max(rate if gap == CLOSING else -rate, 0.0)


@kernel
def _moving(depth: float, speed: float) -> int:
    """What the gap of an end does that has some speed [m/s]."""
    if speed < 0.0:
        return CLOSING if depth >= 0.0 else AWAY
    return OPENING if depth > 0.0 else AWAY


@kernel
def _may(gap: int, depth: float, speed: float, left: int) -> bool:
    """Whether the gap of an end of some depth [m] and speed [m/s] may do that; ``left`` is what it has to do, or -1."""
    if left >= 0:
        return gap == left
    if speed != 0.0:
        return gap == _moving(depth, speed)
    return gap != AWAY if depth > 0.0 else (gap == AWAY or (gap == CLOSING and depth == 0.0))


@kernel
def _violation(side: Side, phase: Phase, left: Phase, ends: np.ndarray) -> tuple[float, float]:
    """By how much a phase breaks its conditions, as a force [N], and the loads at the ends."""
    depth_1, depth_2, v_1, v_2, v_t, omega = ends[0], ends[1], ends[2], ends[3], ends[4], ends[5]
    load_1 = _stiffness(side, phase.gap_1) * max(depth_1, 0.0)
    load_2 = _stiffness(side, phase.gap_2) * max(depth_2, 0.0)
    if not max(depth_1, depth_2) > 0.0:  # at the touch: the forces that are about to grow
        load_1 = _stiffness(side, phase.gap_1) * max(-v_1, 0.0)
        load_2 = _stiffness(side, phase.gap_2) * max(-v_2, 0.0)
    to = _yielding(side, phase)
    normal_1, normal_2 = _of(to.normal_1, load_1, load_2), _of(to.normal_2, load_1, load_2)
    missed = _missed_at(side, phase.gap_1, depth_1, v_1, normal_1, _of(to.v_1, load_1, load_2))
    missed += _missed_at(side, phase.gap_2, depth_2, v_2, normal_2, _of(to.v_2, load_1, load_2))
    if phase.slip == 0:
        most = side.friction_1 * normal_1 + side.friction_2 * normal_2
        missed += max(abs(_of(to.force, load_1, load_2)) - most, 0.0)
    elif v_t == 0.0 and left.slip == 0:
        missed += side.mass * max(-phase.slip * _of(to.v_t, load_1, load_2), 0.0)
    if phase.spin == 0:
        held = side.arm_1 * normal_1 + side.arm_2 * normal_2
        missed += max(abs(_of(to.moment, load_1, load_2)) - held, 0.0) / side.size
    elif omega == 0.0 and left.spin == 0:
        missed += max(-phase.spin * _of(to.omega, load_1, load_2), 0.0) / (side.per_inertia * side.size)
    return missed, load_1 + load_2


@kernel
def _choose(side: Side, ends: np.ndarray, left: Phase, first: int) -> Phase:
    """Choose what happens next: the phase of least violation, locks first. ``left`` is what has just been released."""
    slips, spins = sign_of(ends[4]), sign_of(ends[5])
    if ends[2] * ends[3] * ends[4] * ends[5] != 0.0:  # the velocities leave no choice
        return Phase(_moving(ends[0], ends[2]), _moving(ends[1], ends[3]), slips, spins)
    best, least = Phase(AWAY, AWAY, 0, 0), math.inf
    for gap_2 in (LOCKED, AWAY, CLOSING, OPENING):
        if not _may(gap_2, ends[1], ends[3], left.gap_2):
            continue
        for gap_1 in (LOCKED, AWAY, CLOSING, OPENING):
            if not _may(gap_1, ends[0], ends[2], left.gap_1):
                continue
            for i in range(9):
                slip, spin = first * in_turn(i % 3), first * in_turn(i // 3)
                if (slips != 0 and slip != slips) or (spins != 0 and spin != spins):
                    continue
                if (left.slip != 0 and slip != left.slip) or (left.spin != 0 and spin != left.spin):
                    continue
                phase = Phase(gap_1, gap_2, slip, spin)
                missed, load = _violation(side, phase, left, ends)
                if missed < least - TIE * load:
                    best, least = phase, missed
    return best


@kernel
def _unit(side: Side, phase: Phase, to: Yielding) -> float:
    """Unit of time [s] of a phase, in which its series converge; inf if no end pushes, so that the impact is over."""
    stiff_1, stiff_2 = _stiffness(side, phase.gap_1), _stiffness(side, phase.gap_2)
    fastest = max(
        abs(to.v_1[0]) * stiff_1 + abs(to.v_1[1]) * stiff_2, abs(to.v_2[0]) * stiff_1 + abs(to.v_2[1]) * stiff_2
    )
    return REACH / math.sqrt(fastest) if fastest > 0.0 else math.inf


@kernel
def _expand(side: Side, phase: Phase, to: Yielding, ends: np.ndarray, unit: float, rows: np.ndarray) -> None:
    """Fill the series of depths, gap rates, slip, spin and loads."""
    stiff_1, stiff_2 = _stiffness(side, phase.gap_1), _stiffness(side, phase.gap_2)
    for i in range(6):
        rows[i, 0] = ends[i]
    for k in range(TERMS):
        # An end off the slope has no load, and no stiffness either.
        rows[6, k] = stiff_1 * rows[0, k]
        rows[7, k] = stiff_2 * rows[1, k]
        if k + 1 < TERMS:
            w = unit / (k + 1)
            load_1, load_2 = rows[6, k] * w, rows[7, k] * w
            rows[0, k + 1], rows[1, k + 1] = -rows[2, k] * w, -rows[3, k] * w
            rows[2, k + 1], rows[3, k + 1] = _of(to.v_1, load_1, load_2), _of(to.v_2, load_1, load_2)
            rows[4, k + 1], rows[5, k + 1] = _of(to.v_t, load_1, load_2), _of(to.omega, load_1, load_2)


@kernel
def _root(rows: np.ndarray, row: int, factor: float, load_1: float, load_2: float, length: float, zeros: int) -> float:
    """Time at which ``factor`` times a series plus multiples of the loads, positive at first, becomes negative."""
    sought = rows[8]
    sought[:] = 0.0
    terms, left = 0.0, 0.0
    for k in range(TERMS):
        sought[k] = factor * rows[row, k] + load_1 * rows[6, k] + load_2 * rows[7, k]
        terms += abs(factor * rows[row, k]) + abs(load_1 * rows[6, k]) + abs(load_2 * rows[7, k])
        left += abs(sought[k])
    if left <= CANCELLED * terms:
        return math.inf  # nothing is left but rounding
    noise = NOISE * (abs(factor * rows[row, 0]) + abs(load_1 * rows[6, 0]) + abs(load_2 * rows[7, 0]))
    return first_root(sought, length, zeros, noise)


@kernel
def _zeros(velocity: float, slope: float, released: bool) -> int:
    """Leading coefficients of a velocity that are zero by construction."""
    if velocity != 0.0:
        return 0
    return 2 if released and not slope > 0.0 else 1


@kernel
def _end_events(
    side: Side, end: int, gap: int, to: tuple[float, float], left: int, event: Event, rows: np.ndarray
) -> Event:
    """First event of an end, if it comes before the one that is given."""
    speed = rows[2 + end, 0]
    if gap == LOCKED:
        for released, sign, stiff in ((OPENING, 1.0, side.opening), (CLOSING, -1.0, 1.0)):
            at = _root(rows, end, -sign * side.mass * stiff, sign * to[0], sign * to[1], event.length, 0)
            if at < math.inf:
                event = Event(at, 2 + end, released)
        return event
    if gap == AWAY:
        at = _root(rows, end, -1.0, 0.0, 0.0, event.length, 1 if rows[end, 0] == 0.0 else 0)
        return Event(at, end, 0) if at < math.inf else event
    sign = -1.0 if gap == CLOSING else 1.0
    at = _root(rows, 2 + end, sign, 0.0, 0.0, event.length, _zeros(speed, sign * rows[2 + end, 1], left >= 0))
    if at < math.inf:
        event = Event(at, 2 + end, -1)
    if gap == OPENING:
        at = _root(rows, end, 1.0, 0.0, 0.0, event.length, 0)
        if at < math.inf:
            event = Event(at, end, 0)
    return event


@kernel
def _bound(to: Yielding, factor_1: float, factor_2: float) -> tuple[float, float]:
    """Bound under unit loads of a force, or of the rolling moment, by factors of the normal forces."""
    first, second = to.normal_1, to.normal_2
    return factor_1 * first[0] + factor_2 * second[0], factor_1 * first[1] + factor_2 * second[1]


@kernel
def _first_event(side: Side, phase: Phase, to: Yielding, left: Phase, first: int, rows: np.ndarray) -> Event:
    """First event of a phase within a unit of time."""
    event = _end_events(side, 0, phase.gap_1, to.normal_1, left.gap_1, Event(1.0, -1, 0), rows)
    event = _end_events(side, 1, phase.gap_2, to.normal_2, left.gap_2, event, rows)
    for row, sign, released, force, bound in (
        (4, phase.slip, left.slip, to.force, _bound(to, side.friction_1, side.friction_2)),
        (5, phase.spin, left.spin, to.moment, _bound(to, side.arm_1, side.arm_2)),
    ):
        if sign != 0:
            zeros = _zeros(rows[row, 0], sign * rows[row, 1], released != 0)
            at = _root(rows, row, float(sign), 0.0, 0.0, event.length, zeros)
            if at < math.inf:
                event = Event(at, row, 0)
            continue
        for way in (first, -first):
            load_1, load_2 = bound[0] - way * force[0], bound[1] - way * force[1]
            at = _root(rows, row, 0.0, load_1, load_2, event.length, 0)
            if at < math.inf:
                event = Event(at, row, -way)
    return event


@kernel
def _move(side: Side, phase: Phase, event: Event, ends: np.ndarray, rows: np.ndarray) -> float:
    """Go to the end of a phase; return the loss [J] between loading and unloading."""
    lost = 0.0
    for end in range(2):
        gap = phase.gap_1 if end == 0 else phase.gap_2
        before = ends[end]
        if gap != LOCKED:
            ends[end] = horner(rows[end], event.length)
            ends[2 + end] = horner(rows[2 + end], event.length)
        if gap == OPENING:
            ends[end] = max(ends[end], 0.0)
            lost += 0.5 * side.mass * (1.0 - side.opening) * (before * before - ends[end] * ends[end])
        # Of two events at the same time the later one must not leave its velocity with the wrong sign.
        if (gap == CLOSING and ends[2 + end] > 0.0) or (gap == OPENING and ends[2 + end] < 0.0):
            ends[2 + end] = 0.0
        if gap == AWAY and ends[end] > 0.0:
            ends[end] = 0.0
    for row, sign in ((4, phase.slip), (5, phase.spin)):
        ends[row] = horner(rows[row], event.length) if sign != 0 else 0.0
        if sign * ends[row] < 0.0:
            ends[row] = 0.0
    if event.row >= 0:
        ends[event.row] = 0.0
    return lost


@kernel
def _after(event: Event, left: Phase) -> Phase:
    """What has been released after an event, and ``left`` before it without any time between."""
    if event.row == 4:
        return Phase(left.gap_1, left.gap_2, event.released, left.spin)
    if event.row == 5:
        return Phase(left.gap_1, left.gap_2, left.slip, event.released)
    if event.row == 2:
        return Phase(event.released, left.gap_2, left.slip, left.spin)
    if event.row == 3:
        return Phase(left.gap_1, event.released, left.slip, left.spin)
    return left


@kernel
def _rolled(to: Yielding, unit: float, length: float, rows: np.ndarray) -> float:
    """Loss [J] to rolling resistance in a phase with spin."""
    lost = 0.0
    for i in range(len(NODES)):
        at = NODES[i] * length
        load_1, load_2 = horner(rows[6], at), horner(rows[7], at)
        lost -= WEIGHTS[i] * horner(rows[5], at) * _of(to.moment, load_1, load_2)
    return max(lost * length * unit, 0.0)


@kernel
def _twisted(to: Yielding, unit: float, length: float, rows: np.ndarray) -> float:
    """Impulse [N m s] of rolling resistance in a phase with spin."""
    load_1, load_2, power = 0.0, 0.0, unit
    for k in range(TERMS):
        power *= length
        load_1, load_2 = load_1 + rows[6, k] * power / (k + 1), load_2 + rows[7, k] * power / (k + 1)
    return _of(to.moment, load_1, load_2)


@kernel
def hit_flat(side: Side, first: int, ends: np.ndarray, lost: np.ndarray, rows: np.ndarray) -> int:
    """Follow the impact of both ends of a straight side.

    Parameters
    ----------
    side : Side
    first : int
        Sign of slip and spin that is tried first, 1 or -1; the mirror image has the other one.
    ends : ndarray, shape (6,)
        Depths of both ends, zeros; their gap rates [m/s], slip velocity [m/s] and spin [rad/s] at touch. Afterwards
        these velocities at the end; an end that has left may approach again, which is another impact.
    lost : ndarray, shape (3,)
        Set to the losses [J] between loading and unloading, and to rolling resistance, and to the impulse of that.
    rows : ndarray, shape (9, WIDTH)
        Work space.

    Returns
    -------
    int
        ENDS; or ENDLESS, if MOST_STEPS are not enough.
    """
    fastest = max(abs(ends[2]), abs(ends[3]))
    lost[0] = lost[1] = lost[2] = 0.0
    left = Phase(-1, -1, 0, 0)
    for _ in range(MOST_STEPS):
        phase = _choose(side, ends, left, first)
        to = _yielding(side, phase)
        unit = _unit(side, phase, to)
        if not unit < math.inf:
            break
        _expand(side, phase, to, ends, unit, rows)
        event = _first_event(side, phase, to, left, first, rows)
        if phase.spin != 0:
            lost[1] += _rolled(to, unit, event.length, rows)
            lost[2] += _twisted(to, unit, event.length, rows)
        lost[0] += _move(side, phase, event, ends, rows)
        if event.length > 0.0:
            left = Phase(-1, -1, 0, 0)
        left = _after(event, left)
        for end in range(2):  # without restitution an end that opens gives nothing back
            if side.opening == 0.0 and ends[2 + end] > 0.0 and ends[end] > 0.0:
                lost[0] += 0.5 * side.mass * ends[end] * ends[end]
                ends[end] = 0.0
    else:
        return ENDLESS
    for end in range(2):
        lost[0] += 0.5 * side.mass * max(ends[end], 0.0) ** 2
        if abs(ends[2 + end]) <= LEAST_RATE * fastest:
            ends[2 + end] = 0.0
    if ends[2] == 0.0 and ends[3] == 0.0:
        ends[5] = 0.0
    return ENDS
