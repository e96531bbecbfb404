"""Compiled parts of an audit: geometry and forces of rows of a trajectory, their integrals, and offsets of springs."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numba import njit

from tests.audit_geometry import (
    CREST,
    CX,
    CY,
    OUTLINE,
    PX,
    PY,
    QX,
    QY,
    RHO,
    SIGN,
    TX,
    TY,
    R,
    clearance,
    leave,
    measure,
    outside,
    piece_at,
)

MOST: Final = 8  # contacts of a row
X, Y, PHI, U, V, OMEGA = range(6)  # of a motion
AT_X, AT_Y, NX, NY, LOAD, PULL = range(6)  # of a contact: place, normal, normal and tangential force
CLOSING, OPENING, FRICTION, ARM, MASS, INERTIA, SIZE, DOWN_X, DOWN_Y, NEAR, FAST, WEIGHT = range(12)  # of the constants
# What is found of a row, after OUTLINE, CREST and CENTRE: how deep [m] contacts press the body in by geometry, and by
# their springs at most; how much deeper springs are than geometry, and the other way round; how far touching points
# are above and under the ground; how far within the outline the body's points are that touch; whether a normal is not
# that of the ground; the force and its moment; over weight and loads the least load, how far friction and rolling are
# beyond their bounds, and the power with which they drive the body; the energy of springs, NaN where it is not known.
(
    PRESSED,
    SPRINGS,
    DEEPER,
    SHALLOWER,
    AIR,
    UNDER,
    WITHIN,
    ODD,
    FORCE_X,
    FORCE_Y,
    MOMENT,
    LEAST,
    GRIP,
    ROLL,
    DRIVE,
    STORED,
    STRENGTH,
) = range(3, 20)
COLUMNS: Final = 20
# What is found of depths and offsets of a row: how far something is beyond what explains it, by how much springs have
# changed at once, and whether something is explained.
TOO_DEEP, IN_FLIGHT, SPRING, DRIFT, CHANGED, TOO_LOW, TOO_FAR_IN, EXPLAINED, INSIDE, BORN, MERGED, PASSED = range(12)
ALLOWED: Final = 12
GROWN: Final = 1.02  # how much deeper springs may have been pressed between two rows than in both
ROUGH: Final = 1e-4  # of the loads: they are recorded less accurately than the motion
EPSILON: Final = 2.0**-52


@njit(cache=True)
def touched(arcs: Any, x: float, y: float, nx: float, ny: float, near: float) -> tuple[float, float]:
    """How deep [m] a point of the ground is in the body along its normal, and how far within the outline that ends.

    All is in the frame of the body. The body touches it with an arc whose centre is on the normal, or with a straight
    side across it; where it has neither, the second is infinite.
    """
    depth, within = 0.0, math.inf
    for k in range(len(arcs)):
        arc = arcs[k]
        ex, ey = x - arc[CX], y - arc[CY]
        if abs(ex * ny - ey * nx) <= near + 1e-13 * arc[R]:
            found = max(-outside(arcs, arc[CX] - arc[R] * nx, arc[CY] - arc[R] * ny)[0], 0.0)
            if found < within:
                depth, within = ex * nx + ey * ny + arc[R], found
    if within > near:
        found, ox, oy = leave(arcs, x, y, -nx, -ny)
        if found == found and ox * nx + oy * ny < 0.0 and abs(ox * ny - oy * nx) < 1e-9:
            depth, within = found, 0.0
    return depth, within


@njit(cache=True)
def is_normal(pieces: Any, bends: Any, j: int, x: float, y: float, nx: float, ny: float, near: float) -> bool:
    """Whether a normal at a point is that of the line of a piece, or of the bend or the crest behind the piece.

    A side that is pressed in may turn beyond the end of a round crest: it stays there as on a sharp one.
    """
    piece = pieces[j]
    dx, dy = x - piece[PX], y - piece[PY]
    if abs(piece[TX] * dy - piece[TY] * dx) <= near and abs(nx * piece[TX] + ny * piece[TY]) < 1e-9:
        return True
    if j == len(bends):
        return False
    ex, ey = x - bends[j, QX], y - bends[j, QY]
    if bends[j, RHO] == 0.0:
        return bool(bends[j, SIGN] > 0.0 and abs(ex) <= near and abs(ey) <= near)
    for k in (j, j + 1):
        bx, by = ex + bends[j, RHO] * pieces[k, TY], ey - bends[j, RHO] * pieces[k, TX]
        if bends[j, SIGN] > 0.0 and abs(bx) <= near and abs(by) <= near:
            return True
    return bool(abs(ex * ny - ey * nx) <= near and abs(math.sqrt(ex * ex + ey * ey) - bends[j, RHO]) <= near)


@njit(cache=True)
def has_normal(pieces: Any, bends: Any, x: float, y: float, nx: float, ny: float, near: float) -> bool:
    """Whether a normal at a point is that of any part of the ground, sought from there outwards."""
    middle = piece_at(pieces, x)
    for away in range(len(pieces)):
        if middle - away >= 0 and is_normal(pieces, bends, middle - away, x, y, nx, ny, near):
            return True
        if middle + away < len(pieces) and is_normal(pieces, bends, middle + away, x, y, nx, ny, near):
            return True
    return False


@njit(cache=True)
def pressed_in(contacts: Any, depths: Any, count: int) -> float:
    """How deep [m] a point of a body can be in the ground that contacts press in by some depths along their normals."""
    deepest = 0.0
    for i in range(count):
        deepest = max(deepest, depths[i])
        for k in range(i):
            c = contacts[i, NX] * contacts[k, NX] + contacts[i, NY] * contacts[k, NY]
            square = 1.0 - c * c
            if square > 1e-12 and depths[i] > 0.0 and depths[k] > 0.0:
                a, b = (depths[i] - c * depths[k]) / square, (depths[k] - c * depths[i]) / square
                if a >= 0.0 and b >= 0.0:  # in the dip between both
                    deepest = max(deepest, math.sqrt(a * depths[i] + b * depths[k]))
    return deepest


@njit(cache=True)
def look_at_row(
    arcs: Any,
    pieces: Any,
    bends: Any,
    law: Any,
    motion: Any,
    rolling: float,
    contacts: Any,
    count: int,
    found: Any,
    offsets: Any,
) -> None:
    """Write what is found of the contacts of a row, and the offset [m] of each spring from the geometry, or NaN."""
    S, C, omega = math.sin(motion[PHI]), math.cos(motion[PHI]), motion[OMEGA]
    depths, springs, slips = np.zeros(MOST), np.zeros(MOST), np.zeros(MOST)
    loads = bound = 0.0
    found[LEAST] = math.inf
    found[MOMENT] = rolling
    for i in range(count):
        contact = contacts[i]
        nx, ny, load, pull = contact[NX], contact[NY], contact[LOAD], contact[PULL]
        dx, dy = contact[AT_X] - motion[X], contact[AT_Y] - motion[Y]
        depth, within = touched(arcs, C * dx + S * dy, C * dy - S * dx, C * nx + S * ny, C * ny - S * nx, law[NEAR])
        lx, ly = dx - depth * nx, dy - depth * ny  # the body's point
        px, py = motion[U] - ly * omega, motion[V] + lx * omega
        rate, slip = nx * px + ny * py, ny * px - nx * py
        least, most = load / law[CLOSING], load / law[OPENING]
        if rate > law[FAST]:
            least = most
        elif rate < -law[FAST]:
            most = least
        depths[i], springs[i], slips[i] = depth, most, slip
        offsets[i] = most - depth if most == least else math.nan
        found[STORED] += 0.5 * law[CLOSING] * most * most if most == least else math.nan
        found[DEEPER] = max(found[DEEPER], least - depth)
        found[SHALLOWER] = max(found[SHALLOWER], depth - most)
        air = clearance(pieces, bends, contact[AT_X], contact[AT_Y])
        found[AIR], found[UNDER] = max(found[AIR], air), max(found[UNDER], -air)
        found[WITHIN] = max(found[WITHIN], within)
        if not has_normal(pieces, bends, contact[AT_X], contact[AT_Y], nx, ny, law[NEAR]):
            found[ODD] = 1.0
        fx, fy = load * nx + pull * ny, load * ny - pull * nx
        found[FORCE_X] += fx
        found[FORCE_Y] += fy
        found[MOMENT] += lx * fy - ly * fx
        found[LEAST] = min(found[LEAST], load)
        found[STRENGTH] += (abs(load) + abs(pull)) * (1.0 / law[MASS] + law[SIZE] ** 2 / law[INERTIA])
        loads += abs(load)
        bound = max(bound, abs(pull) - law[FRICTION] * load)
    scale = law[WEIGHT] + loads
    found[PRESSED], found[SPRINGS] = pressed_in(contacts, depths, count), pressed_in(contacts, springs, count)
    found[LEAST] /= scale
    found[GRIP], found[ROLL] = bound / scale, (abs(rolling) - law[ARM] * loads) / (scale * law[SIZE])
    found[DRIVE] = rolling * omega / scale
    for i in range(count):
        found[DRIVE] = max(found[DRIVE], contacts[i, PULL] * slips[i] / scale)


@njit(cache=True)
def look_at_rows(
    arcs: Any,
    samples: Any,
    pieces: Any,
    bends: Any,
    law: Any,
    motions: Any,
    rolling: Any,
    contacts: Any,
    touching: Any,
    found: Any,
    offsets: Any,
) -> None:
    """Write what is found of all rows; ``found`` is zero, ``offsets`` NaN."""
    for i in range(len(motions)):
        measure(arcs, samples, pieces, bends, law[SIZE], motions[i], found[i])
        if touching[i] > 0:
            look_at_row(
                arcs, pieces, bends, law, motions[i], rolling[i], contacts[i], touching[i], found[i], offsets[i]
            )


@njit(cache=True)
def explain(
    times: Any, touching: Any, contacts: Any, found: Any, offsets: Any, near: float, steps: Any, out: Any
) -> None:
    """Write what is beyond what springs explain, and what offsets do.

    ``offset`` is how deep springs have been pressed since there was certainly none. A spring has none while there has
    been one contact only that nothing was deeper than; whether one that neither closes nor opens has one is not known.
    ``steps`` numbers the steps in which rows were recorded.
    """
    offset, free = 0.0, False
    for i in range(len(times)):
        depth, count = max(found[i, OUTLINE], found[i, CREST]), touching[i]
        if count == 0:
            if depth > near:
                out[i, IN_FLIGHT], out[i, INSIDE] = depth - GROWN * offset, 1.0
            else:
                offset, free = 0.0, False
            continue
        pressed, spring = found[i, PRESSED], max(found[i, DEEPER], found[i, SHALLOWER])
        if i > 0 and count == 1 == touching[i - 1] and times[i] == times[i - 1]:
            one, two = contacts[i - 1, 0], contacts[i, 0]
            if abs(one[NX] * two[NY] - one[NY] * two[NX]) > 1e-9 and spring > near:
                out[i, PASSED], free = 1.0, True
        odd = depth > pressed + near or found[i, UNDER] > pressed + near
        offset, free = max(offset, found[i, SPRINGS]), free or odd or count > 1
        slack = GROWN * offset if free else 0.0
        out[i, TOO_DEEP], out[i, TOO_LOW] = depth - slack - found[i, SPRINGS], found[i, UNDER] - slack - pressed
        out[i, TOO_FAR_IN], out[i, SPRING] = found[i, WITHIN] - slack - pressed, found[i, DEEPER] - slack
        if not free:
            out[i, SPRING] = spring
        known = True
        for c in range(count):
            known = known and offsets[i, c] == offsets[i, c]
            if i > 0 and steps[i] == steps[i - 1]:
                drift = abs(offsets[i, c] - offsets[i - 1, c])
                out[i, DRIFT] = max(out[i, DRIFT], drift if drift == drift else 0.0)
        if i > 0 and steps[i] != steps[i - 1] and times[i] == times[i - 1]:
            if count > touching[i - 1] and found[i, SHALLOWER] > max(found[i - 1, SHALLOWER], 0.0) + near:
                out[i, BORN] = 1.0
            if 0 < count < touching[i - 1] and found[i, DEEPER] > max(found[i - 1, DEEPER], 0.0) + near:
                out[i, MERGED] = 1.0
            if known and found[i - 1, STORED] == found[i - 1, STORED]:
                out[i, CHANGED] = abs(found[i, STORED] - found[i - 1, STORED])
        if odd or spring > near:
            out[i, EXPLAINED] = 1.0
        elif known and spring < 0.01 * near:
            offset, free = found[i, SPRINGS], count > 1


# Integrals.


def _weights() -> np.ndarray:
    """Weights of nine equidistant values, for the integral over each interval between them, shape (8, 9)."""
    nodes, powers = np.linspace(-1.0, 1.0, 9), np.arange(9)
    ends = nodes[:, np.newaxis] ** (powers + 1) / (powers + 1)
    return np.linalg.solve((nodes[:, np.newaxis] ** powers).T, np.diff(ends, axis=0).T).T * 4.0


WEIGHTS: Final = np.ascontiguousarray(_weights())


@njit(cache=True)
def number_steps(times: Any, touching: Any, steps: Any) -> None:
    """Number the steps of rows: those of contacts end where a row has the time of the one before; flights are steps."""
    for i in range(1, len(times)):
        goes_on = touching[i] > 0 and touching[i] == touching[i - 1] and times[i] > times[i - 1]
        steps[i] = steps[i - 1] + (0 if goes_on else 1)


@njit(cache=True)
def are_even(times: Any) -> bool:
    """Whether times are equidistant, up to how they are rounded."""
    count = len(times) - 1
    length = times[count] - times[0]
    for k in range(1, count):
        if abs(times[k] - times[0] - length * k / count) > 1e-9 * length + 2.0 * EPSILON * abs(times[count]):
            return False
    return True


@njit(cache=True)
def follow_forces(law: Any, times: Any, touching: Any, motions: Any, steps: Any, found: Any, out: Any) -> None:
    """Write how far rows are from where the rows before and the forces put them.

    Columns of ``out``: velocities [m/s] and places [m] that the forces do not explain, and those that jump between two
    rows of one time, the angular ones times the size.
    """
    size, rates = law[SIZE], np.zeros((9, 3))
    i = 0
    while i < len(times) - 1:
        last = i
        while last + 1 < len(times) and steps[last + 1] == steps[i]:
            last += 1
        if last == i:
            between(law, times, touching, motions, found, i, out)
            i += 1
            continue
        begin = i
        while begin < last:
            even = begin + 8 <= last and are_even(times[begin : begin + 9])
            if not even and begin > i and last - i >= 8 and are_even(times[last - 8 : last + 1]):
                begin, even = last - 8, True
            if not even:
                between(law, times, touching, motions, found, begin, out)
                begin += 1
                continue
            h = (times[begin + 8] - times[begin]) / 8.0
            rounding, strongest = 2.0 * EPSILON * abs(times[begin + 8]), 0.0
            for k in range(9):
                rates[k, 0] = found[begin + k, FORCE_X] / law[MASS] + law[DOWN_X]
                rates[k, 1] = found[begin + k, FORCE_Y] / law[MASS] + law[DOWN_Y]
                rates[k, 2] = found[begin + k, MOMENT] / law[INERTIA]
                strongest = max(strongest, found[begin + k, STRENGTH])
            for k in range(8):
                row = begin + k + 1
                for q in range(3):
                    unit = size if q == 2 else 1.0
                    push = move = 0.0
                    for p in range(9):
                        push += WEIGHTS[k, p] * rates[p, q]
                        move += WEIGHTS[k, p] * motions[begin + p, U + q]
                    change = abs(motions[row, U + q] - motions[row - 1, U + q] - h * push)
                    slack = strongest * (ROUGH * h + rounding)
                    out[row, 0] = max(out[row, 0], unit * change - slack)
                    move = abs(motions[row, q] - motions[row - 1, q] - h * move) - 4.0 * EPSILON * abs(motions[row, q])
                    out[row, 1] = max(out[row, 1], unit * (move - rounding * abs(motions[row, U + q])))
            begin += 8
        i = last
        if i + 1 < len(times):
            between(law, times, touching, motions, found, i, out)
            i += 1


@njit(cache=True)
def between(law: Any, times: Any, touching: Any, motions: Any, found: Any, i: int, out: Any) -> None:
    """Write how far a row is from where the one before puts it: by gravity alone, or with any force of the two rows."""
    h, size = times[i + 1] - times[i], law[SIZE]
    rounding = 4.0 * EPSILON * abs(times[i + 1])
    jumps = 2 if h == 0.0 else 0
    for q in range(3):
        unit, push, most = (size if q == 2 else 1.0), (0.0 if q == 2 else law[DOWN_X + q]), 0.0
        if touching[i] > 0:
            column, mass = FORCE_X + q, law[INERTIA] if q == 2 else law[MASS]
            most = 1.5 * max(abs(found[i, column]), abs(found[i + 1, column])) / mass
        speed = max(abs(motions[i, U + q]), abs(motions[i + 1, U + q]))
        change = abs(motions[i + 1, U + q] - motions[i, U + q] - h * push) - (h + rounding) * most
        out[i + 1, jumps] = max(out[i + 1, jumps], unit * (change - rounding * abs(push)))
        move = abs(motions[i + 1, q] - motions[i, q] - h * motions[i, U + q] - 0.5 * h * h * push)
        allowed = 0.5 * h * h * most + rounding * speed + 4.0 * EPSILON * abs(motions[i, q])
        out[i + 1, jumps + 1] = max(out[i + 1, jumps + 1], unit * (move - allowed))
