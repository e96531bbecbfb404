"""Reference for one compliant contact in double precision: extrapolation in place of series, trials in place of a rule.

Newton's laws as in tests/oracles.py, of which nothing is used, nor of sledenv. Within a mode the motion is integrated
by the method of Gragg, Bulirsch and Stoer: the modified midpoint rule with 2, 4, ..., 14 substeps, extrapolated to
order 14. A mode rests on guards: a free velocity keeps its sign, a locked force stays within its bounds, the surfaces
stay in touch. The first time at which one fails is found by bisection; a guard that falls at the start of a step and
rises at its end is looked at where it is least. Which mode comes next is tried: every combination of signs and locks
takes a short step, and the one whose guards hold from the start on is the answer.
"""

from __future__ import annotations

import math

import numba
import numpy as np

MASS, RADIUS, ECCENTRICITY, INERTIA, HALF_ANGLE, STIFFNESS, ASYMMETRY, FRICTION, ARM, CORNER_ARM, SLOPE, GRAVITY = (
    range(12)
)
X, PHI, GAP, U, V, OMEGA = range(6)
SEPARATED, TIMEOUT, JAMMED, BOTH_CORNERS, UNDECIDED = range(5)
TAIL, ARC, NOSE = 1, 0, -1
GUARDS = 9
COLUMNS = 7
FIRST_TRIAL = 1e-2  # of the unit of time
MOST_TRIALS = 7  # each a tenth of the one before
LEAVING = 1e-7  # of the unit of time before the end of a contact: from there on velocities change by 1e-14
MOST_BISECTED = 60
SLIGHT = 1e-12  # relative rounding error of a force at its bound, and of an acceleration from there

compiled = numba.njit(cache=True, error_model="numpy")


@compiled
def point(p: np.ndarray, feature: int, phi: float) -> tuple[float, float]:
    """(a, b): the touching point, or a corner, lies at (-a, -b) from the mass centre."""
    sine, cosine = math.sin(phi), math.cos(phi)
    if feature == ARC:
        return p[ECCENTRICITY] * sine, p[RADIUS] - p[ECCENTRICITY] * cosine
    across = -feature * p[RADIUS] * math.sin(p[HALF_ANGLE])
    above = p[ECCENTRICITY] - p[RADIUS] * math.cos(p[HALF_ANGLE])
    return above * sine - across * cosine, -across * sine - above * cosine


@compiled
def arm_of(p: np.ndarray, feature: int) -> float:
    return p[ARM] if feature == ARC else p[CORNER_ARM]


@compiled
def forces(p: np.ndarray, feature: int, mode: np.ndarray, y: np.ndarray) -> tuple[float, float, float]:
    """(F, M, N) from a linear equation for each: the law of a free velocity, no acceleration of a locked one."""
    m, inertia = p[MASS], p[INERTIA]
    a, b = point(p, feature, y[PHI])
    square = y[OMEGA] * y[OMEGA]
    turning = ((p[RADIUS] if feature == ARC else 0.0) - b) * square  # da/dphi omega^2
    friction, arm = (mode[0] * p[FRICTION], mode[1] * arm_of(p, feature))
    slip_row = (1.0, 0.0, friction, 0.0)
    spin_row = (0.0, 1.0, arm, 0.0)
    gap_row = (0.0, 0.0, 1.0, -p[STIFFNESS] * (1.0 - mode[2] * p[ASYMMETRY]) * y[GAP])
    if mode[0] == 0:
        pull = p[GRAVITY] * math.sin(p[SLOPE]) + a * square
        slip_row = (1.0 / m + b * b / inertia, b / inertia, -a * b / inertia, -pull)
    if mode[1] == 0:
        spin_row = (b, 1.0, -a, 0.0)
    if mode[2] == 0:
        push = p[GRAVITY] * math.cos(p[SLOPE]) + turning
        gap_row = (-a * b / inertia, -a / inertia, 1.0 / m + a * a / inertia, push)
    # F and M as linear functions of N from the first two rows
    divisor = slip_row[0] * spin_row[1] - slip_row[1] * spin_row[0]
    force = (slip_row[3] * spin_row[1] - slip_row[1] * spin_row[3]) / divisor
    moment = (slip_row[0] * spin_row[3] - slip_row[3] * spin_row[0]) / divisor
    force_n = (slip_row[1] * spin_row[2] - slip_row[2] * spin_row[1]) / divisor
    moment_n = (slip_row[2] * spin_row[0] - slip_row[0] * spin_row[2]) / divisor
    yielding = gap_row[2] + gap_row[0] * force_n + gap_row[1] * moment_n
    normal = (gap_row[3] - gap_row[0] * force - gap_row[1] * moment) / yielding
    return force + force_n * normal, moment + moment_n * normal, normal


@compiled
def rates(p: np.ndarray, feature: int, mode: np.ndarray, y: np.ndarray) -> np.ndarray:
    force, moment, normal = forces(p, feature, mode, y)
    a, b = point(p, feature, y[PHI])
    return np.array(
        [
            y[U],
            y[OMEGA],
            0.0 if mode[2] == 0 else y[V] - a * y[OMEGA],
            force / p[MASS] + p[GRAVITY] * math.sin(p[SLOPE]),
            normal / p[MASS] - p[GRAVITY] * math.cos(p[SLOPE]),
            (b * force + moment - a * normal) / p[INERTIA],
        ]
    )


@compiled
def advanced(p: np.ndarray, feature: int, mode: np.ndarray, y: np.ndarray, time: float) -> np.ndarray:
    """The state a time later, in the same mode."""
    table = np.zeros((COLUMNS, 6))
    start = rates(p, feature, mode, y)
    for j in range(COLUMNS):
        n = 2 * (j + 1)
        h = time / n
        before, now = y.copy(), y + h * start
        for _ in range(n - 1):
            before, now = now, before + 2.0 * h * rates(p, feature, mode, now)
        column = now
        for i in range(j):  # Aitken and Neville: table[i] becomes the value from steps j - i to j
            previous = table[i].copy()
            table[i] = column
            ratio = (n / (2.0 * (j - i))) ** 2
            column = column + (column - previous) / (ratio - 1.0)
        table[j] = column
    return table[COLUMNS - 1]


@compiled
def guards(p: np.ndarray, feature: int, mode: np.ndarray, y: np.ndarray) -> np.ndarray:
    """What is positive while the mode lasts: slip (2), spin (2), gap rate (2), touch, feature, other corner.

    The slack of a locked force is relative to it.
    """
    found = np.full(GUARDS, math.inf)
    a, b = point(p, feature, y[PHI])
    force, moment, normal = forces(p, feature, mode, y)
    velocities = (y[U] + b * y[OMEGA], y[OMEGA], y[V] - a * y[OMEGA])
    least, most = -p[STIFFNESS] * (1.0 - p[ASYMMETRY]) * y[GAP], -p[STIFFNESS] * (1.0 + p[ASYMMETRY]) * y[GAP]
    bounds = (
        (force + p[FRICTION] * normal, p[FRICTION] * normal - force),
        (moment + arm_of(p, feature) * normal, arm_of(p, feature) * normal - moment),
        (normal - least, most - normal),
    )
    sizes = (p[FRICTION] * abs(normal) + abs(force), arm_of(p, feature) * abs(normal) + abs(moment), abs(normal) + most)
    jumps = (p[FRICTION], arm_of(p, feature), p[ASYMMETRY])
    for i in range(3):
        if jumps[i] > 0.0:
            if mode[i] == 0:
                found[2 * i], found[2 * i + 1] = bounds[i][0] / sizes[i], bounds[i][1] / sizes[i]
            else:
                found[2 * i] = mode[i] * velocities[i]
    found[6] = -y[GAP]
    if p[RADIUS] > 0.0 and p[HALF_ANGLE] < math.pi:
        found[7] = p[HALF_ANGLE] - abs(y[PHI]) if feature == ARC else feature * y[PHI] - p[HALF_ANGLE]
        tail, nose = y[GAP] + b - point(p, TAIL, y[PHI])[1], y[GAP] + b - point(p, NOSE, y[PHI])[1]
        if feature == ARC:
            found[8] = max(tail, nose)
        else:
            found[8] = nose if feature == TAIL else tail
    return found


@compiled
def slopes(p: np.ndarray, feature: int, mode: np.ndarray, y: np.ndarray, time: float) -> np.ndarray:
    """How the guards change over a millionth of a time."""
    ahead = y + 1e-6 * time * rates(p, feature, mode, y)
    return guards(p, feature, mode, ahead) - guards(p, feature, mode, y)


@compiled
def failing(p: np.ndarray, feature: int, mode: np.ndarray, y: np.ndarray, time: float) -> float:
    """A time of a step at which a guard is not positive, inf if they hold: halfway, at the end or in a dip between."""
    halfway = advanced(p, feature, mode, y, 0.5 * time)
    if not guards(p, feature, mode, halfway).min() > 0.0:
        return 0.5 * time
    after = advanced(p, feature, mode, y, time)
    if not guards(p, feature, mode, after).min() > 0.0:
        return time
    start = guards(p, feature, mode, y)
    dips = (start > 0.0) & (slopes(p, feature, mode, y, time) < 0.0) & (slopes(p, feature, mode, after, time) > 0.0)
    for i in np.flatnonzero(dips):
        low, high = 0.0, time
        for _ in range(MOST_BISECTED):
            middle = 0.5 * (low + high)
            there = advanced(p, feature, mode, y, middle)
            if not guards(p, feature, mode, there)[i] > 0.0:
                return middle
            if slopes(p, feature, mode, there, time)[i] < 0.0:
                low = middle
            else:
                high = middle
    return math.inf


@compiled
def without(p: np.ndarray, feature: int, y: np.ndarray, zeros: np.ndarray) -> np.ndarray:
    """The state with some contact velocities exactly zero."""
    y = y.copy()
    a, b = point(p, feature, y[PHI])
    slip, rate = y[U] + b * y[OMEGA], y[V] - a * y[OMEGA]
    if zeros[1]:
        y[OMEGA] = 0.0
    y[U] = (0.0 if zeros[0] else slip) - b * y[OMEGA]
    y[V] = (0.0 if zeros[2] else rate) + a * y[OMEGA]
    return y


@compiled
def begins(p: np.ndarray, feature: int, mode: np.ndarray, zeros: np.ndarray, y: np.ndarray) -> bool:
    """Whether no locked force is beyond its bound, and no velocity of zero pulled to the wrong side.

    Else the mode might last from a little later on: a touchdown without slip is dragged along before it can stick.
    """
    if (guards(p, feature, mode, y)[:6] < -SLIGHT).any():
        return False
    a, b = point(p, feature, y[PHI])
    square = y[OMEGA] * y[OMEGA]
    turning = ((p[RADIUS] if feature == ARC else 0.0) - b) * square  # da/dphi omega^2
    force, moment, normal = forces(p, feature, mode, y)
    spin_terms = np.array([b * force, moment, -a * normal]) / p[INERTIA]
    slip_terms = np.array([force / p[MASS], p[GRAVITY] * math.sin(p[SLOPE]), b * spin_terms.sum(), a * square])
    gap_terms = np.array([normal / p[MASS], -p[GRAVITY] * math.cos(p[SLOPE]), -a * spin_terms.sum(), -turning])
    for i, terms in enumerate((slip_terms, spin_terms, gap_terms)):
        if zeros[i] and mode[i] * terms.sum() < -SLIGHT * np.abs(terms).sum():
            return False
    return True


@compiled
def begun(
    p: np.ndarray, feature: int, signs: np.ndarray, zeros: np.ndarray, y: np.ndarray, unit: float
) -> tuple[np.ndarray, float]:
    """The one mode that lasts for a short time, and that time; 0 if there is none or more than one."""
    mode = np.zeros(3, np.int64)
    time = FIRST_TRIAL * unit
    for _ in range(MOST_TRIALS):
        lasting = 0
        answer = mode.copy()
        for code in range(27):
            digits = (code % 3 - 1, code // 3 % 3 - 1, code // 9 - 1)
            fits = True
            for i in range(3):
                mode[i] = digits[i] if zeros[i] else signs[i]
                fits = fits and (zeros[i] or digits[i] == 1)
            if not fits:
                continue
            if begins(p, feature, mode, zeros, y) and failing(p, feature, mode, y, time) == math.inf:
                lasting += 1
                answer = mode.copy()
        if lasting == 1:
            return answer, time
        time *= 0.1
    return mode, 0.0


@compiled
def contact(p: np.ndarray, entry: np.ndarray, max_time: float, fineness: float) -> tuple[int, float, np.ndarray]:
    """How a contact ends (the codes above), when, and the state then.

    Parameters
    ----------
    p : ndarray, shape (12,)
        Body, law and slope, in the order of the names above.
    entry : ndarray, shape (6,)
        State at touchdown, ``phi`` in (-pi, pi) and not at the end of the arc, the gap zero and closing.
    max_time : float
        Where to stop [s].
    fineness : float
        Steps are so many times shorter than by default.
    """
    y, t = entry.copy(), 0.0
    size = p[RADIUS] + p[ECCENTRICITY]
    corners = p[RADIUS] > 0.0 and p[HALF_ANGLE] < math.pi
    feature = (TAIL if y[PHI] > 0.0 else NOSE) if corners and abs(y[PHI]) > p[HALF_ANGLE] else ARC
    softness = 1.0 / p[MASS] + size**2 * (1.0 + p[FRICTION]) / p[INERTIA]
    unit = 1.0 / math.sqrt(p[STIFFNESS] * (1.0 + p[ASYMMETRY]) * softness)
    a, b = point(p, feature, y[PHI])
    speed = max(abs(y[U] + b * y[OMEGA]), abs(y[V] - a * y[OMEGA]), size * abs(y[OMEGA]))
    failed = np.zeros(GUARDS, np.bool_)
    mode = np.ones(3, np.int64)
    fresh = True
    while True:
        if fresh:
            a, b = point(p, feature, y[PHI])
            velocities = np.array([y[U] + b * y[OMEGA], y[OMEGA] * size, y[V] - a * y[OMEGA]])
            jumps = np.array([p[FRICTION], arm_of(p, feature), p[ASYMMETRY]])
            zeros = np.zeros(3, np.bool_)
            for i in range(3):
                met = mode[i] == 0 or failed[2 * i] or abs(velocities[i]) <= 1e-14 * speed
                zeros[i] = jumps[i] > 0.0 and met
            signs = np.where((velocities > 0.0) | (jumps == 0.0), 1, -1)
            y = without(p, feature, y, zeros)
            mode, time = begun(p, feature, signs, zeros, y, unit)
            if time == 0.0:
                # Where a contact ends all bounds vanish with the normal force: rounding decides which fails first.
                if velocities[2] > 0.0 and -y[GAP] < LEAVING * unit * velocities[2]:
                    left = -y[GAP] / velocities[2]
                    return SEPARATED, t + left, advanced(p, feature, signs, y, left)
                return UNDECIDED, t, y
            if not mode.any() and jumps.min() > 0.0:
                return JAMMED, t, y
        else:
            time = min(0.5 * unit, 0.2 / max(abs(y[OMEGA]), 1e-300)) / fineness
        time = min(time, max_time - t)
        high = math.inf if fresh else failing(p, feature, mode, y, time)
        if high == math.inf:
            y = advanced(p, feature, mode, y, time)
            t += time
            fresh = False
            if t >= max_time:
                return TIMEOUT, t, y
            continue
        low = 0.0
        for _ in range(MOST_BISECTED):
            middle = 0.5 * (low + high)
            if guards(p, feature, mode, advanced(p, feature, mode, y, middle)).min() > 0.0:
                low = middle
            else:
                high = middle
        failed = ~(guards(p, feature, mode, advanced(p, feature, mode, y, high)) > 0.0)
        y = advanced(p, feature, mode, y, high)
        t += high
        fresh = True
        if failed[6]:
            return SEPARATED, t, y
        if failed[8]:
            return BOTH_CORNERS, t, y
        if failed[7]:
            side = TAIL if y[PHI] > 0.0 else NOSE
            feature = side if feature == ARC else ARC
            if guards(p, feature, mode, y)[8] < 0.0:
                return BOTH_CORNERS, t, y
            y[PHI] = side * p[HALF_ANGLE] * (1.0 - 1e-15 * (1 if feature == ARC else -1))
