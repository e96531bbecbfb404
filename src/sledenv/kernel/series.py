"""Power series of the state over one step of a contact, by recurrence: docs/physics.md, section 5.

The programs below are straight lines of arithmetic, see :mod:`sledenv.kernel.trace`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sledenv.kernel import rows
from sledenv.kernel.jit import kernel
from sledenv.kernel.roots import CLOSE, MOST_APPROACHES, approach, certificate
from sledenv.kernel.rows import TERMS, WIDTH
from sledenv.kernel.state import GAP, OMEGA, PHI, V_N, V_T, X
from sledenv.kernel.trace import (
    absolute,
    block,
    compiled,
    element,
    fma,
    larger,
    not_more,
    repeated,
    rough_root,
    scalar,
    shuffled,
    side_by_side,
    smaller,
    sums,
    where,
    where_less,
)

ORDER = TERMS - 1
EARLIER = 1e3  # tolerances that an earlier term may reach, some times what terms shrink by from there to the last

# Rows of the table of series; those of the state have the numbers that they have in the contact state. Time is counted
# in a unit of the step's own, so a coefficient is what its term adds at the end of one unit.
R_NORMAL, R_FORCE, R_MOMENT, R_SINE, R_COSINE, R_SCRATCH = range(7, 13)
ROWS = 13

# What the programs are told and what they answer.
(
    Z_PER_MASS,  # [1/kg]
    Z_RATIO,  # [1/m^2] mass over inertia
    Z_H,  # [m] of the feature
    Z_R,  # [m]
    Z_SHIFT,  # [rad]
    Z_K_CLOSING,  # [N/m] of the law
    Z_K_OPENING,
    Z_PACE_CLOSING,  # [s] unit of time as long as the spin is slow
    Z_PACE_OPENING,
    Z_INWARD,  # [m/s^2] gravity along the inward normal
    Z_DOWNHILL,  # [m/s^2] and along the slope
    # The gap of the corner on the other side is that of the feature, this,
    Z_OTHER,  # [m]
    Z_OTHER_SINE,  # [m] and these times sine and cosine of theta.
    Z_OTHER_COSINE,
    Z_SIZE,  # [m] of the body
    Z_SCALE,  # [m/s] of the velocities
    Z_TOLERANCE,
    Z_LENGTH,  # [m] of the slope
    Z_MAX_TIME,  # [s]
    Z_MOST_STEPS,
    Z_MU,  # [-] tangential force over normal force
    Z_RHO,  # [m] rolling moment over normal force
    Z_STIFFNESS,  # [N/m] of the branch
    Z_PACE,  # [s] and its unit of time
    Z_STEPS,  # spent
    Z_GAP_RATE,  # the branch: signs of v_n, v_t and omega, 0 where locked,
    Z_SLIP,
    Z_SPIN,
    Z_GAP_ZEROS,  # and number of their leading coefficients that are zero by construction
    Z_SLIP_ZEROS,
    Z_SPIN_ZEROS,
) = range(31)
Z_BRANCH = Z_MU  # rows from here on change with the branch,
Z_TOLD = Z_SPIN_ZEROS + 1  # and those before with the feature
(
    Z_THETA,  # [rad] orientation of the feature,
    Z_SINE,  # [-] its sine
    Z_COSINE,  # and cosine
    Z_UNIT,  # [s] unit of time
    Z_X,  # the state at the start of the step
    Z_PHI,
    Z_GAP,
    Z_V_N,
    Z_V_T,
    Z_OMEGA,
    Z_PER_PULSATION,  # [s] of the contact oscillation,
    Z_ABEAM,  # [m] direction of the phase angle up to what ends it,
    Z_AHEAD,
    Z_EXPECTED,  # code of the event that is expected,
    Z_GUESS,  # [units] where its root is,
    Z_MOST,  # up to where it is sought,
    Z_ROOT,  # and where it was found
    Z_STEP,  # [units] length of the step
    Z_EVENT,  # code of what happens at its end
    E_X,  # the state at its end
    E_PHI,
    E_GAP,
    E_V_N,
    E_V_T,
    E_OMEGA,
    E_NORMAL,  # [N s] impulse
    E_FORCE,  # [N s] of the tangential force where the slip is locked
    E_MOMENT,  # [N m s] of the moment where the spin is locked
    E_SLIP,  # [J] integral of the normal force times the slip velocity,
    E_SPIN,  # [N] and times the spin
    E_TRAVEL,  # [m] most that x changes by on the way
    E_TURN,  # [rad] and phi
    E_SAFE_GAP,  # > 0 if a quantity keeps the sign of the branch on the way, or does so once it has left zero
    E_SAFE_V_N,
    E_SAFE_V_T,
    E_SAFE_OMEGA,
    E_SAFE_OTHER,
    # For locked velocities: bounds of the forces, and > 0 if these stay within.
    Z_FRICTION,  # [-]
    Z_ARM,  # [m]
    Z_LEAST,  # [N]
    Z_LARGEST,
    E_SAFE_LEAST,
    E_SAFE_LARGEST,
    E_SAFE_FORCE,  # below its bound,
    E_SAFE_FORCE_BACK,  # and above the negative of that
    E_SAFE_MOMENT,
    E_SAFE_MOMENT_BACK,
    # What a contact that is interrupted between two steps goes on with, besides.
    Z_TURNS,  # [rad] that its angle leaves out
    Z_AT_EDGE,
    Z_LEFT_GAP,  # signs with which velocities have just been released
    Z_LEFT_SLIP,
    Z_LEFT_SPIN,
    Z_STALLED,
    Z_CHOOSE,
    # An ordinary step: whether it may be one, and the search for roots.
    Z_FINE,
    Z_SEEKING,
    Z_FOUND,
    Z_BEFORE,
) = range(Z_TOLD, Z_TOLD + 58)
Z_ROWS = Z_TOLD + 58
Z_STATE = Z_X - X  # offset of the state, whose order is that of the contact state,
E_STATE = E_X - X  # and of that at the end


def _plus_product(a: Any, b: Any, rest: Any) -> Any:
    """``a * b + rest``, where the rest may be None for nothing."""
    return a * b if rest is None else fma(a, b, rest)


def _product(p: Sequence[Any], q: Sequence[Any], k: int, first: int) -> Any:
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


_SHARES = 1.0 / np.maximum(rows.COUNT, 1.0)
_KEPT = np.where(rows.COUNT < TERMS, 1.0, 0.0)
_NEXT = _KEPT * (rows.COUNT + 1.0)
_FORCES = np.where(rows.COUNT < ORDER, 1.0, 0.0)  # are known to one order less


def spinning(gap_locked: bool, slip_locked: bool) -> Any:
    """Return the program that fills the table in a branch with spin: docs/physics.md (5.5)-(5.9).

    Inside, a velocity is per unit of time, an acceleration per unit squared and a force per mass and unit squared. All
    products are summed at once, side by side: those of sine and cosine with the spin, and those of levers with forces.
    """

    def program(z: Any, c: Any) -> None:
        unit, ratio, h, r, mu, rho = z[Z_UNIT], z[Z_RATIO], z[Z_H], z[Z_R], z[Z_MU], z[Z_RHO]
        square = unit * unit
        inward, downhill = square * z[Z_INWARD], square * z[Z_DOWNHILL]
        stiffness = -(z[Z_STIFFNESS] * z[Z_PER_MASS] * square)  # normal force over gap
        # Spin rate that a force at the lever gives; the load is the normal force where the gap is locked, else the gap.
        per_lever = ratio if gap_locked else ratio * stiffness
        lever_sine, lever_cosine = -(h * per_lever), -(mu * h * per_lever)
        lever_rest = fma(mu, r, rho) * per_lever
        a_0, b_0 = h * z[Z_SINE], fma(-h, z[Z_COSINE], r)
        if slip_locked:
            lever_cosine, lever_rest = 0.0, rho * per_lever
        sine, cosine, spin = [z[Z_SINE]], [z[Z_COSINE]], [unit * z[Z_OMEGA]]
        turn, twice = [side_by_side(sine[0], cosine[0])], [repeated(spin[0], 2)]
        gap: list[Any] = [z[Z_GAP], unit * z[Z_V_N]]
        normal: list[Any] = []
        force: list[Any] = []
        load = normal if gap_locked else gap
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
                inner = _product(left, right, k, 2)
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
                    normal.append(fma(k * a_0, rest, lift))
                force.append(-fma(k * b_0, rest, sweep) if slip_locked else 0.0)
                right.append(shuffled(twice[k], side_by_side(load[k - 1], force[k - 1]), range(4)))
            # Sine and cosine after it.
            whole = _plus_product(turn[0], twice[k], known) * (np.array([-1.0, 1.0]) / (k + 1))
            turn.append(shuffled(whole, None, (1, 0)))
            sine.append(element(turn[k + 1], 0))
            cosine.append(element(turn[k + 1], 1))
            if not gap_locked and k > 0:
                free = gap[k - 1] * (stiffness * (1.0 / (k * (k + 1))))
                gap.append(fma(h, cosine[k + 1], fma(-0.5, inward, free) if k == 1 else free))

        # The rows of the table.
        per_unit = 1.0 / unit
        in_seconds = repeated(per_unit, rows.EIGHT)
        masses = repeated(per_unit * per_unit / z[Z_PER_MASS], rows.EIGHT)
        spins, (sines, cosines) = rows.of(spin[:TERMS]), rows.apart(turn[:TERMS])
        loads = rows.of(normal[:ORDER] if gap_locked else gap[:TERMS])
        nothing = [np.zeros(rows.EIGHT)] * 3
        reach, height = repeated(r, rows.EIGHT), repeated(h, rows.EIGHT)
        nexts = rows.times(rows.moved_back(sines, sine[1:]), _NEXT)
        sweeps = [fma(reach, p, -(height * q)) for p, q in zip(spins, nexts, strict=True)]
        if gap_locked:
            gaps, rates = rows.of([z[Z_GAP]]), nothing
            normals = [p * masses for p in loads]
        else:
            rates = [p * (in_seconds * n) for p, n in zip(rows.moved_back(loads, gap[1:]), _NEXT, strict=True)]
            gaps = loads
            rates = rows.with_first(rates, z[Z_V_N])
            stiff = repeated(-z[Z_STIFFNESS], rows.EIGHT)
            normals = [p * (stiff * kept) for p, kept in zip(loads, _FORCES, strict=True)]
        if slip_locked:
            speeds, slips = [-p for p in sweeps], nothing  # the speed is that of the mass centre along the slope
            rows.write(c, R_FORCE, [p * masses for p in rows.of(force[:ORDER])])
        else:
            driven = repeated(mu if gap_locked else mu * stiffness, rows.EIGHT)
            speeds = [p * (driven * share) for p, share in zip(rows.moved_on(loads, 0.0), _SHARES, strict=True)]
            start = fma(unit, z[Z_V_T], -element(sweeps[0], 0))
            speeds[0] = speeds[0] + side_by_side(start, downhill, *([0.0] * 6))
            slips = [(p + q) * (in_seconds * kept) for p, q, kept in zip(speeds, sweeps, _KEPT, strict=True)]
            slips = rows.with_first(slips, z[Z_V_T])
        rows.write(c, X, rows.times(rows.moved_on(speeds, z[Z_X]), _SHARES * _KEPT))
        rows.write(c, PHI, rows.times(rows.moved_on(spins, z[Z_PHI]), _SHARES * _KEPT))
        rows.write(c, OMEGA, [p * in_seconds for p in spins])
        for row, series in (
            (GAP, gaps),
            (V_N, rates),
            (V_T, slips),
            (R_NORMAL, normals),
            (R_SINE, sines),
            (R_COSINE, cosines),
        ):
            rows.write(c, row, series)

    return program


def _gliding_on(gap_locked: bool, slip_locked: bool) -> Any:
    """Return the program that fills the table in a branch without spin."""

    def program(z: Any, c: Any) -> None:
        unit, h, r, mu = z[Z_UNIT], z[Z_H], z[Z_R], z[Z_MU]
        square = unit * unit
        inward, downhill = square * z[Z_INWARD], square * z[Z_DOWNHILL]
        stiffness = -(z[Z_STIFFNESS] * z[Z_PER_MASS] * square)
        a, b = h * z[Z_SINE], fma(-h, z[Z_COSINE], r)
        per_unit = 1.0 / unit
        mass = 1.0 / z[Z_PER_MASS] * per_unit * per_unit
        gap: list[Any] = [z[Z_GAP], 0.0 if gap_locked else unit * z[Z_V_N]]
        for k in range(ORDER):
            free = 0.0 if gap_locked else gap[k] * (stiffness * (1.0 / ((k + 1) * (k + 2))))
            gap.append(fma(-0.5, inward, free) if k == 0 and not gap_locked else free)
        if gap_locked:
            normal = [inward * mass]
        else:
            normal = [-(z[Z_STIFFNESS] * coefficient) for coefficient in gap[:ORDER]]
        force = [-(downhill * mass)] if slip_locked else [mu * coefficient for coefficient in normal]
        moment = [a * coefficient for coefficient in normal]
        for k, coefficient in enumerate(force):
            moment[k] = fma(-b, coefficient, moment[k])
        speed, pull = [unit * z[Z_V_T]], square * z[Z_PER_MASS]
        if not slip_locked:
            speed += [coefficient * (pull * (1.0 / (k + 1))) for k, coefficient in enumerate(force)]
            speed[1] = speed[1] + downhill
        for row, series in (
            (X, [z[Z_X], *([] if slip_locked else [v * (1.0 / (k + 1)) for k, v in enumerate(speed[:ORDER])])]),
            (PHI, [z[Z_PHI]]),
            (GAP, gap[:TERMS]),
            (V_N, [] if gap_locked else [z[Z_V_N], *(gap[k + 1] * ((k + 1.0) * per_unit) for k in range(1, TERMS))]),
            (V_T, [] if slip_locked else [z[Z_V_T], *(v * per_unit for v in speed[1:])]),
            (OMEGA, []),
            (R_NORMAL, normal),
            (R_MOMENT, moment),
            (R_SINE, [z[Z_SINE]]),
            (R_COSINE, [z[Z_COSINE]]),
        ):
            rows.write(c, row, rows.of(series))
        if slip_locked:
            rows.write(c, R_FORCE, rows.of(force))

    return program


# Branches by which of gap rate, slip and spin is locked.
_free = compiled(spinning(False, False))
_sticking = compiled(spinning(False, True))
_sliding = compiled(_gliding_on(False, False))
_stuck = compiled(_gliding_on(False, True))
_settled = compiled(spinning(True, False))
_rolling = compiled(spinning(True, True))
_gliding = compiled(_gliding_on(True, False))


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(rows.EIGHT)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS  # on [0, 1]


_closer, _certainty = scalar(lambda q, s: approach(q, s, TERMS)), scalar(certificate)


@kernel
def locate(row: int, z: np.ndarray, c: np.ndarray) -> bool:
    """Find where a row of the table is zero, near Z_GUESS and up to Z_MOST; say whether that is its first root."""
    q = c[row]
    s = z[Z_GUESS]
    before = z[Z_MOST]
    for _ in range(MOST_APPROACHES):
        s, step, error = _closer(q, s)
        if not abs(step) < before:
            return False
        before = 0.25 * abs(step)
        if error <= CLOSE:
            z[Z_ROOT] = s
            return 0.0 < s <= z[Z_MOST] and _certainty(q, s)[0] > 0.0
    return False


_HEEDED = np.array([ORDER - 3, ORDER - 1, ORDER, ORDER])  # orders of the terms that bound a step, the last one twice
_ALLOWED = np.array([EARLIER, 1.0, 1.0, 1.0])


def longest(size: Any, scale: Any, tolerance: Any, most: Any, c: Any) -> tuple[Any, ...]:
    """Program of :func:`longest_step`."""
    count = len(_HEEDED)
    heeded = []
    for row in (V_N, V_T, OMEGA):
        # One block of the table: what has just been written at once can be read at once.
        last = block(c, row * WIDTH + ORDER - 2, count)
        heeded.append(absolute(shuffled(last, repeated(c[row * WIDTH + ORDER - 3], count), (count, 1, 2, 2))))
    normal, slip, spin = heeded
    largest = larger(larger(normal, slip), repeated(size, count) * spin)
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
    sane = (normal + slip + spin) * 0.0
    step, unsound = most, 0.0
    for i in reversed(range(count - 1)):
        step, unsound = smaller(step, element(steps, i)), unsound + element(sane, i)
    return (step + unsound,)


_MOTION = (X, GAP, V_N, V_T, OMEGA)
# A power t^k on [0, 1] lies below its chord t by so much at most.
_ORDERS = np.maximum(rows.COUNT, 2.0)
_SAGS = np.where(rows.COUNT > 1.0, (_ORDERS - 1.0) * _ORDERS ** (-_ORDERS / (_ORDERS - 1.0)), 0.0)
_SAGS_TO_ONE = np.where(rows.COUNT > 1.0, 1.0 - _SAGS, 0.0)


def _sagging(terms: Sequence[Any], leaving: Any = None) -> Any:
    """How far a polynomial may sag below the chord between its ends, in eight parts: docs/physics.md (10.3).

    Where ``leaving`` is 1 instead of 0, of a polynomial that starts from zero: below the line from there to its end.
    """
    sags: Any = _SAGS
    if leaving is not None:
        leave = repeated(leaving, rows.EIGHT)
        sags = [fma(leave, rest, sag) for rest, sag in zip(_SAGS_TO_ONE, _SAGS, strict=True)]
    return rows.added(rows.times([larger(part, np.zeros(rows.EIGHT)) for part in terms], sags))


def ends(c: Any, table: Sequence[int], s: Any) -> list[Any]:
    """Values at ``s`` of some rows of a table."""
    powers = rows.without_constant(rows.powers(s))
    terms = [rows.added(rows.times(rows.read(c, row), powers)) for row in table]
    return [c[row * WIDTH] + end for row, end in zip(table, sums(terms), strict=True)]


def completion(z: Any, c: Any, corners: bool = True) -> None:
    """State and work at the end of a step of Z_STEP units, and whether anything changes its sign on the way.

    Integrals are taken by Gauss's rule with eight nodes, whose error is below that of the series. A body without
    corners has no other one.
    """
    s, unit = z[Z_STEP], z[Z_UNIT]
    time = s * unit
    powers = rows.without_constant(rows.powers(s))
    nodes = repeated(s, rows.EIGHT) * _NODES
    normal, slip, spin = (rows.values(c, row, TERMS, nodes) for row in (R_NORMAL, V_T, OMEGA))
    load = normal * _WEIGHTS
    terms = {row: rows.times(rows.read(c, row), powers) for row in (*_MOTION, *((R_SINE, R_COSINE) if corners else ()))}
    starts = {row: c[row * WIDTH] for row in _MOTION}
    velocities = (
        (V_N, E_SAFE_V_N, z[Z_GAP_RATE], z[Z_GAP_ZEROS]),
        (V_T, E_SAFE_V_T, z[Z_SLIP], z[Z_SLIP_ZEROS]),
        (OMEGA, E_SAFE_OMEGA, z[Z_SPIN], z[Z_SPIN_ZEROS]),
    )
    sagging = [_sagging([-part for part in terms[GAP]])]
    for row, _, sign, zeros in velocities:
        signs = repeated(sign, rows.EIGHT)
        sagging.append(_sagging([signs * part for part in terms[row]], smaller(zeros, 1.0)))
    other = []
    if corners:
        sines, cosines = repeated(z[Z_OTHER_SINE], rows.EIGHT), repeated(z[Z_OTHER_COSINE], rows.EIGHT)
        around = zip(terms[R_SINE], terms[R_COSINE], terms[GAP], strict=True)
        other = [fma(sines, p, fma(cosines, q, r)) for p, q, r in around]
    *ends, turned, impulse, slid = sums(
        [*(rows.added(terms[row]) for row in _MOTION), spin * _WEIGHTS, load, load * slip]
    )
    others = []
    if corners:
        others = [_sagging(other), rows.added(other), _sagging([absolute(part) for part in terms[OMEGA]])]
    rolled, rest, gap_sags, *sags = sums([load * spin, rows.sizes(terms[X]), *sagging, *others])
    for row, end in zip(_MOTION, ends, strict=True):
        z[E_STATE + row] = starts[row] + end
    z[E_PHI] = fma(time, turned, z[Z_PHI])
    z[E_NORMAL] = time * impulse
    z[E_SLIP] = time * slid
    z[E_SPIN] = time * rolled
    z[E_TRAVEL] = absolute(c[X * WIDTH + 1] * s) + rest
    z[E_SAFE_GAP] = smaller(-starts[GAP], -z[E_GAP]) - gap_sags
    for (row, safe, sign, zeros), sag in zip(velocities, sags, strict=False):
        end = sign * z[E_STATE + row]
        # A second leading coefficient that is zero by construction is left out, and the third does not make it sag.
        first, second = sign * c[row * WIDTH + 1] * s, sign * c[row * WIDTH + 2] * s * s
        later = end - first + larger(second, 0.0)
        start = sign * starts[row]
        least = where_less(zeros, 0.5, smaller(start, end), where_less(zeros, 1.5, end, later))
        z[safe] = least - sag
    if corners:
        start = fma(z[Z_OTHER_SINE], c[R_SINE * WIDTH], fma(z[Z_OTHER_COSINE], c[R_COSINE * WIDTH], starts[GAP]))
        start = start + z[Z_OTHER]
        z[E_SAFE_OTHER] = smaller(start, start + sags[4]) - sags[3]
        z[E_TURN] = time * (larger(absolute(starts[OMEGA]), absolute(z[E_OMEGA])) + sags[5])


def _slack(z: Any, c: Any) -> None:
    """Impulses of the forces of locked velocities over a step of Z_STEP units, and whether they stay within bounds."""
    s = z[Z_STEP]
    time = s * z[Z_UNIT]
    powers = rows.without_constant(rows.powers(s))
    nodes = repeated(s, rows.EIGHT) * _NODES
    tables = (R_NORMAL, R_FORCE, R_MOMENT)
    terms = {row: rows.times(rows.read(c, row), powers) for row in tables}
    sizes = ([absolute(part) for part in terms[row]] for row in (R_FORCE, R_MOMENT))
    less_load = [-part for part in terms[R_NORMAL]]
    sagging = [_sagging(row) for row in (terms[R_NORMAL], less_load, *sizes)]
    pushes = [rows.values(c, row, TERMS, nodes) * _WEIGHTS for row in (R_FORCE, R_MOMENT)]
    *changes, impulse, twist, sag, rise, force_sag, moment_sag = sums(
        [*(rows.added(terms[row]) for row in tables), *pushes, *sagging]
    )
    starts = {row: c[row * WIDTH] for row in tables}
    ends = {row: starts[row] + change for row, change in zip(tables, changes, strict=True)}
    for answer, row, sign, factor, sags in (
        (E_SAFE_FORCE, R_FORCE, 1.0, z[Z_FRICTION], force_sag),
        (E_SAFE_FORCE_BACK, R_FORCE, -1.0, z[Z_FRICTION], force_sag),
        (E_SAFE_MOMENT, R_MOMENT, 1.0, z[Z_ARM], moment_sag),
        (E_SAFE_MOMENT_BACK, R_MOMENT, -1.0, z[Z_ARM], moment_sag),
    ):
        slacks = [fma(factor, of[R_NORMAL], -sign * of[row]) for of in (starts, ends)]
        z[answer] = smaller(*slacks) - fma(factor, sag, sags)
    z[E_FORCE] = time * impulse
    z[E_MOMENT] = time * twist
    z[E_SAFE_LEAST] = smaller(starts[R_NORMAL], ends[R_NORMAL]) - z[Z_LEAST] - sag
    z[E_SAFE_LARGEST] = z[Z_LARGEST] - larger(starts[R_NORMAL], ends[R_NORMAL]) - rise


_complete = compiled(lambda z, c: completion(z, c))
_longest = scalar(longest)
_complete_locked = compiled(_slack)


@kernel
def complete(z: np.ndarray, c: np.ndarray) -> None:
    """Answer how a step of Z_STEP units ends, and whether anything changes its sign on the way."""
    _complete(z, c)


@kernel
def complete_locked(z: np.ndarray, c: np.ndarray) -> None:
    """Answer what the forces of locked velocities do up to Z_STEP, and whether they stay within their bounds."""
    _complete_locked(z, c)


@kernel
def expand_free(z: np.ndarray, c: np.ndarray) -> None:
    """Fill the table where gap, slip and spin are free."""
    _free(z, c)


@kernel
def _expand_sticking(z: np.ndarray, c: np.ndarray) -> None:
    _sticking(z, c)


@kernel
def _expand_sliding(z: np.ndarray, c: np.ndarray) -> None:
    _sliding(z, c)


@kernel
def _expand_stuck(z: np.ndarray, c: np.ndarray) -> None:
    _stuck(z, c)


@kernel
def _expand_settled(z: np.ndarray, c: np.ndarray) -> None:
    _settled(z, c)


@kernel
def _expand_rolling(z: np.ndarray, c: np.ndarray) -> None:
    _rolling(z, c)


@kernel
def _expand_gliding(z: np.ndarray, c: np.ndarray) -> None:
    _gliding(z, c)


@kernel
def expand(gap_rate: int, slip: int, spin: int, z: np.ndarray, c: np.ndarray) -> None:
    """Fill the table ``c`` with the series of one step in the given branch: docs/physics.md (5.5)-(5.9).

    Parameters
    ----------
    gap_rate, slip, spin : int
        The branch: signs of v_n, v_t and omega, 0 where locked, at least one of them free.
    z : ndarray, shape (Z_ROWS,)
        See the names above.
    c : ndarray, shape (ROWS, WIDTH)
        Overwritten.
    """
    if spin != 0:
        if gap_rate != 0:
            if slip != 0:
                expand_free(z, c)
            else:
                _expand_sticking(z, c)
        elif slip != 0:
            _expand_settled(z, c)
        else:
            _expand_rolling(z, c)
    elif gap_rate == 0:
        _expand_gliding(z, c)
    elif slip != 0:
        _expand_sliding(z, c)
    else:
        _expand_stuck(z, c)


@kernel
def longest_step(size: float, scale: float, tolerance: float, most: float, c: np.ndarray) -> float:
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
        In units of the time of the series, as the answer is.
    c : ndarray, shape (at least 7, WIDTH)
        The series of the velocities.
    """
    return _longest(size, scale, tolerance, most, c)[0]
