"""Bodies on springs over a profile, or over zones of a plane, by geometry alone: slow, obvious, an oracle.

It remembers nothing of a contact. At each instant it lists which arc is in which piece of the ground or in which round
dip, and which crest, sharp or round, is in which arc or under which side (docs/physics.md, section 12), presses each
pair by its depth and sums the forces:

    N = k x,  k = k_close while the gap closes and k_open while it opens;   F = -f N sgn(slip);   M = -arm N sgn(spin)

Each sign is replaced by a straight line within a small speed ``layer``, so that a body that sticks creeps. An embedded
Runge-Kutta pair of order 5(4) keeps its own steps small, and ends one where the list changes. Two layers, one half of
the other, give the limit and how far it can be trusted.

Geometry alone creates energy where a pair comes into the list with a depth (a crest that has entered the body next to
a pressed arc, and comes under a side), or leaves it with one. ``Passage.jumped`` is how much: such a passage is no
oracle.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from sledenv import Body, ContactLaw, Slope, State

CX, CY, R, MIDDLE, HALF, BEFORE, AFTER, SX, SY, DX, DY, LENGTH = range(12)  # of a row for an arc and the side behind it
PX, PY, TX, TY = range(4)  # of a row for a piece
QX, QY, RHO, FX, FY, HX, HY, FROMX, FROMY, UPTOX, UPTOY = range(11)  # of a bend: centre, tangents, begin and end
CLOSING, OPENING, MASS, INERTIA, SIZE, GX, GY, LAYER = range(8)  # of the constants
BEGIN, END, FRICTION, ARM = range(4)  # of a zone; the first one is all of the ground, with what the law has
WHICH, GAP, RATE, SLIP, NX, NY, LX, LY = range(8)  # of a pair that touches
MOST = 32  # pairs
LEVEL = [(0.0, 0.0), (1.0, 0.0)]
HAIR = 1e-9  # [s] how closely a change of the list is found
ORDER = 1e-11  # error of a step over the speed scale

# Dormand and Prince (1980), table 2
A = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
E = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


class Scene(NamedTuple):
    """Body and ground as tables."""

    arcs: np.ndarray
    pieces: np.ndarray
    reach: np.ndarray  # (pieces, arcs, 2) between which places along a piece [m] the foot of an arc may lie
    crests: np.ndarray  # bends, the sharp ones with radius 0
    hollows: np.ndarray


class Passage(NamedTuple):
    """A ride on springs, at each end of a contact."""

    rows: np.ndarray  # (contacts, 7) t, x, y, phi, u, v, omega when nothing touches any more
    jumped: float  # [J] created or lost where pairs came or went with a depth
    done: bool  # whether that was all; if not, the steps were used up: a body that sticks or lies takes many


def scene(body: Body, profile: list[tuple[float, float]], rounding: Sequence[float] = ()) -> Scene:
    """Return the tables of a body over a profile, whose vertices have radii [m], or none; a corner touches no crest."""
    count = len(body.arcs)
    arcs = np.zeros((count, 12))
    for k, arc in enumerate(body.arcs):
        following = body.arcs[(k + 1) % count]
        end = following.begin + (2.0 * math.pi if k == count - 1 else 0.0)
        out = np.array([-math.sin(end), -math.cos(end)])
        begins = np.array([arc.x, arc.y]) + arc.radius * out
        length = float(np.hypot(*(np.array([following.x, following.y]) + following.radius * out - begins)))
        arcs[k, : MIDDLE + 1] = arc.x, arc.y, arc.radius, 0.5 * (arc.begin + end)
        arcs[k, HALF] = 0.5 * (end - arc.begin)
        arcs[k, SX:] = *begins, out[1], -out[0], length if length > 1e-9 * body.size else 0.0
        arcs[k, AFTER] = count > 1 and arcs[k, LENGTH] == 0.0
    arcs[:, BEFORE] = np.roll(arcs[:, AFTER], 1)
    points = np.array(profile, float)
    along = np.diff(points, axis=0)
    lengths = np.hypot(*along.T)
    tangents = np.vstack([[1.0, 0.0], along / lengths[:, np.newaxis], [1.0, 0.0]])
    turns = tangents[:-1, 0] * tangents[1:, 1] - tangents[:-1, 1] * tangents[1:, 0]
    bends = np.array(list(bends_at(points, tangents, lengths, turns, rounding))).reshape(-1, 11)
    pieces = np.column_stack([points[np.maximum(np.arange(len(tangents)) - 1, 0)], tangents])
    reach = np.zeros((len(pieces), count, 2))
    for j, piece in enumerate(pieces):
        for a in range(count):
            # A dip that is no rounder than the arc bounds no line: both are touched across it.
            ends = (turns <= 0.0) | (bends[:, RHO] > arcs[a, R])
            before, behind = np.flatnonzero(ends[:j]), j + np.flatnonzero(ends[j:])
            first = (bends[before[-1], UPTOX:] - piece[:TX]) @ piece[TX:] if len(before) else -math.inf
            last = (bends[behind[0], FROMX:UPTOX] - piece[:TX]) @ piece[TX:] if len(behind) else math.inf
            reach[j, a] = first, last
    return Scene(arcs, pieces, reach, bends[turns < 0.0], bends[(turns > 0.0) & (bends[:, RHO] > 0.0)])


def bends_at(
    points: np.ndarray, tangents: np.ndarray, lengths: np.ndarray, turns: np.ndarray, rounding: Sequence[float]
) -> Iterator[list[float]]:
    """Return a row for the bend at each vertex: the arc that touches both pieces, or the vertex with radius 0."""
    free = np.r_[math.inf, lengths, math.inf]
    for k, point in enumerate(points):
        half = math.tan(0.5 * math.asin(abs(turns[k]))) if tangents[k] @ tangents[k + 1] > 0.0 else math.nan
        if math.isnan(half):  # more than a right angle
            half = 1.0 / math.tan(0.5 * math.asin(abs(turns[k])))
        span = min((rounding[k] if len(rounding) else 0.0) * half, 0.49 * min(free[k], free[k + 1]))
        radius = span / half if span > 0.0 else 0.0
        begin, end = point - span * tangents[k], point + span * tangents[k + 1]
        normal = np.array([-tangents[k, 1], tangents[k, 0]])
        centre = begin + math.copysign(radius, turns[k]) * normal
        yield [*centre, radius, *tangents[k], *tangents[k + 1], *begin, *end]


JOIN = 1e-11  # [rad], [m] by which features overlap, so that rounding leaves no crest between two


@njit(cache=True)
def add(pairs, count, which, gap, nx, ny, lx, ly, z):
    if count == MOST:
        return count
    pairs[count, WHICH], pairs[count, GAP] = which, gap
    px, py = z[3] - ly * z[5], z[4] + lx * z[5]
    pairs[count, RATE], pairs[count, SLIP] = nx * px + ny * py, ny * px - nx * py
    pairs[count, NX], pairs[count, NY], pairs[count, LX], pairs[count, LY] = nx, ny, lx, ly
    return count + 1


@njit(cache=True)
def turned(angle):
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@njit(cache=True)
def height_over(piece, x, y):
    return piece[TX] * (y - piece[PY]) - piece[TY] * (x - piece[PX])


@njit(cache=True)
def over_ground(pieces, crests, hollows, x, y):
    """Return how far a place is over the ground: only the sign counts."""
    over = height_over(pieces[0], x, y)
    for j in range(1, len(pieces)):
        if pieces[j, PX] <= x:
            over = height_over(pieces[j], x, y)
    for bend in crests:
        if bend[FROMX] < x < bend[UPTOX]:
            over = y - bend[QY] - math.sqrt(bend[RHO] ** 2 - (x - bend[QX]) ** 2)
    for bend in hollows:
        if bend[FROMX] < x < bend[UPTOX]:
            over = y - bend[QY] + math.sqrt(bend[RHO] ** 2 - (x - bend[QX]) ** 2)
    return over


@njit(cache=True)
def nearest(arcs, bx, by):
    """Gap to the feature that is next to a place in the body: of all whose reach it is in; 500 more for sides."""
    least, which = -math.inf, -1
    for a in range(len(arcs)):
        arc = arcs[a]
        ex, ey = bx - arc[CX], by - arc[CY]
        gap = math.sqrt(ex * ex + ey * ey) - arc[R]
        if gap > least and abs(turned(math.atan2(-ex, -ey) - arc[MIDDLE])) <= arc[HALF] + JOIN:
            least, which = gap, a
        ex, ey = bx - arc[SX], by - arc[SY]
        gap, along = -arc[DY] * ex + arc[DX] * ey, arc[DX] * ex + arc[DY] * ey
        if arc[LENGTH] > 0.0 and gap > least and along >= -JOIN and along <= arc[LENGTH] + JOIN:
            least, which = gap, 500 + a
    return least, which


@njit(cache=True)
def on_crest(arcs, crest, code, z, S, C, pairs, count):
    """List what a crest is in: an arc or a side; a side that leans beyond a piece, with the point where that ends."""
    for part in range(3 if crest[RHO] > 0.0 else 1):
        qx = crest[QX] if part == 0 else (crest[FROMX] if part == 1 else crest[UPTOX])
        qy = crest[QY] if part == 0 else (crest[FROMY] if part == 1 else crest[UPTOY])
        rho = crest[RHO] if part == 0 else 0.0
        dx, dy = qx - z[0], qy - z[1]
        away, which = nearest(arcs, C * dx + S * dy, -S * dx + C * dy)
        gap = away - rho
        if which < 0 or gap >= 0.0 or (which < 500 and part > 0):
            continue
        arc = arcs[which % 500]
        if which < 500:
            rx, ry = C * arc[CX] - S * arc[CY], S * arc[CX] + C * arc[CY]
            nx, ny = (rx - dx) / (away + arc[R]), (ry - dy) / (away + arc[R])
        else:
            nx, ny = C * arc[DY] + S * arc[DX], S * arc[DY] - C * arc[DX]
        before, behind = nx * crest[FX] + ny * crest[FY], nx * crest[HX] + ny * crest[HY]
        leans = 1 if before < 0.0 else (2 if behind > 0.0 else 0)
        if which < 500:
            if leans == 0:  # otherwise one of the pieces beside the crest faces the arc
                return add(pairs, count, code + which, gap, nx, ny, rx - arc[R] * nx, ry - arc[R] * ny, z)
        elif leans == part or crest[RHO] == 0.0:
            return add(pairs, count, code + which, gap, nx, ny, dx + away * nx, dy + away * ny, z)
    return count


@njit(cache=True)
def faces_hollow(arcs, a, rho, off):
    """Whether an arc touches a round dip with what faces it, beyond its ends only where no other can."""
    arc = arcs[a]
    if abs(off) <= arc[HALF]:
        return True
    if off > 0.0:
        return arc[AFTER] == 0.0 or arcs[(a + 1) % len(arcs), R] >= rho
    return arc[BEFORE] == 0.0 or arcs[(a - 1) % len(arcs), R] >= rho


@njit(cache=True)
def touching(arcs, pieces, reach, crests, hollows, z, size, pairs):
    """List all pairs that are closed at (x, y, phi, u, v, omega); return how many."""
    count = 0
    x, y, S, C = z[0], z[1], math.sin(z[2]), math.cos(z[2])
    over = over_ground(pieces, crests, hollows, x, y)
    for j in range(len(pieces)):
        piece = pieces[j]
        nx, ny = -piece[TY], piece[TX]
        height = height_over(piece, x, y)
        if height > size or height <= 0.0 < over:  # far above, or behind it, on the other side of a ridge
            continue
        tilt = math.atan2(piece[TY], piece[TX])
        for a in range(len(arcs)):
            arc = arcs[a]
            rx, ry = C * arc[CX] - S * arc[CY], S * arc[CX] + C * arc[CY]
            cx, cy = x + rx - piece[PX], y + ry - piece[PY]
            gap, foot = nx * cx + ny * cy - arc[R], piece[TX] * cx + piece[TY] * cy
            if gap >= 0.0 or foot < reach[j, a, 0] or foot > reach[j, a, 1]:
                continue
            off = turned(z[2] - tilt - arc[MIDDLE])
            if (off < -arc[HALF] and arc[BEFORE] == 1.0) or (off >= arc[HALF] and arc[AFTER] == 1.0):
                continue
            count = add(pairs, count, 1000 * j + a, gap, nx, ny, rx - arc[R] * nx, ry - arc[R] * ny, z)
    for k in range(len(hollows)):
        bend, code = hollows[k], 1000 * (len(pieces) + k)
        dx, dy = bend[QX] - x, bend[QY] - y
        if dx * dx + dy * dy < max(bend[RHO] - size, 0.0) ** 2:
            continue
        for a in range(len(arcs)):
            arc = arcs[a]
            rx, ry = C * arc[CX] - S * arc[CY], S * arc[CX] + C * arc[CY]
            ex, ey = dx - rx, dy - ry
            away = math.sqrt(ex * ex + ey * ey)
            gap = bend[RHO] - away - arc[R]
            if gap >= 0.0 or arc[R] >= bend[RHO]:
                continue
            nx, ny = ex / away, ey / away
            # A foot on the bend is ahead of where it begins, and not ahead of where it ends.
            if nx * bend[FX] + ny * bend[FY] >= 0.0 or nx * bend[HX] + ny * bend[HY] <= 0.0:
                continue
            if not faces_hollow(arcs, a, bend[RHO], turned(z[2] - math.atan2(-nx, ny) - arc[MIDDLE])):
                continue
            count = add(pairs, count, code + a, gap, nx, ny, rx - arc[R] * nx, ry - arc[R] * ny, z)
    for k in range(len(crests)):
        dx, dy = crests[k, QX] - x, crests[k, QY] - y
        if dx * dx + dy * dy <= (size + crests[k, RHO]) ** 2:
            count = on_crest(arcs, crests[k], 1000 * (len(pieces) + len(hollows) + k), z, S, C, pairs, count)
    return count


@njit(cache=True)
def sign(speed, layer):
    return min(max(speed / layer, -1.0), 1.0)


@njit(cache=True)
def zone_at(zones, x):
    found = 0
    for k in range(1, len(zones)):
        if zones[k, BEGIN] <= x < zones[k, END]:
            found = k
    return zones[found]


@njit(cache=True)
def slope_of(arcs, pieces, reach, crests, hollows, zones, law, z, pairs, out):
    """Rates of (x, y, phi, u, v, omega); return how many pairs touch."""
    count = touching(arcs, pieces, reach, crests, hollows, z, law[SIZE], pairs)
    fx, fy, moment = law[MASS] * law[GX], law[MASS] * law[GY], 0.0
    for i in range(count):
        p = pairs[i]
        turn = sign(p[RATE], law[LAYER])
        stiffness = 0.5 * (law[CLOSING] + law[OPENING]) - 0.5 * (law[CLOSING] - law[OPENING]) * turn
        normal = -stiffness * p[GAP]
        zone = zone_at(zones, z[0] + p[LX])
        force = -zone[FRICTION] * normal * sign(p[SLIP], law[LAYER])
        px, py = normal * p[NX] + force * p[NY], normal * p[NY] - force * p[NX]
        fx += px
        fy += py
        moment += p[LX] * py - p[LY] * px - zone[ARM] * normal * sign(z[5] * law[SIZE], law[LAYER])
    out[0], out[1], out[2] = z[3], z[4], z[5]
    out[3], out[4], out[5] = fx / law[MASS], fy / law[MASS], moment / law[INERTIA]
    return count


@njit(cache=True)
def same(one, m, other, n):
    return m == n and (one[:n, WHICH] == other[:n, WHICH]).all()


@njit(cache=True)
def jump(law, one, m, other, n, step):
    """Energy [J] of pairs that came or went with a depth that no gap rate explains."""
    gone = come = rates = 0.0
    for i in range(m):
        if not held(other, n, one[i, WHICH]):
            gone += one[i, GAP] ** 2
            rates += abs(one[i, RATE])
    for i in range(n):
        if not held(one, m, other[i, WHICH]):
            come += other[i, GAP] ** 2
            rates += abs(other[i, RATE])
    if abs(math.sqrt(gone) - math.sqrt(come)) <= 2.0 * step * rates:
        return 0.0
    return 0.5 * law[CLOSING] * abs(gone - come)


@njit(cache=True)
def held(pairs, count, which):
    return (pairs[:count, WHICH] == which).any()


@njit(cache=True)
def integrate(arcs, pieces, reach, crests, hollows, zones, law, z, contacts, max_time, steps, rows):
    """Follow a body until it has left the ground some times; return how many times, and the energy jumped."""
    rates, stage, after = np.zeros((7, 6)), np.zeros(6), np.zeros(6)
    pairs, now, trial = np.zeros((MOST, 8)), np.zeros((MOST, 8)), np.zeros((MOST, 8))
    frequency = math.sqrt(law[CLOSING] / law[MASS])
    longest = 0.1 / frequency
    t, step, found, jumped = 0.0, 1e-3 * longest, 0, 0.0
    count = slope_of(arcs, pieces, reach, crests, hollows, zones, law, z, now, rates[0])
    while t < max_time and found < contacts and steps > 0:
        steps -= 1
        for i in range(1, 7):
            for q in range(6):
                total = 0.0
                for k in range(i):
                    total += A[i, k] * rates[k, q]
                stage[q] = z[q] + step * total
            into = trial if i == 6 else pairs
            reached = slope_of(arcs, pieces, reach, crests, hollows, zones, law, stage, into, rates[i])
        after[:] = stage
        error = 0.0
        speed = max(abs(z[3]), abs(z[4]), law[SIZE] * abs(z[5]), math.sqrt(9.81 * law[SIZE]))
        for q in range(6):
            total = 0.0
            for k in range(7):
                total += E[k] * rates[k, q]
            unit = (frequency if q < 3 else 1.0) * (law[SIZE] if q % 3 == 2 else 1.0)
            error = max(error, abs(step * total) * unit / (ORDER * speed))
        changes = not same(now, count, trial, reached)
        if step > HAIR and (error > 1.0 or changes):
            step = max(HAIR, step * (0.25 if changes else max(0.2, 0.9 * error**-0.2)))
            continue
        t += step
        z[:] = after
        if changes:
            jumped += jump(law, now, count, trial, reached, step)
        if count > 0 and reached == 0:
            rows[found, 0] = t
            rows[found, 1:] = z
            found += 1
        count = reached
        now[:] = trial
        rates[0] = rates[6]
        step = min(longest, step * min(5.0, 0.9 * max(error, 1e-6) ** -0.2))
    return found, jumped, steps > 0


def follow(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    launch: State,
    *,
    contacts: int,
    max_time: float,
    layer: float,
    steps: int,
) -> Passage:
    """Follow a launch until the body has left the ground ``contacts`` times; one rolling arm holds for all arcs."""
    zones = np.array([(-math.inf, math.inf, *law[2:4]), *(zone[:4] for zone in slope.zones)])
    gravity = slope.gravity * math.sin(slope.angle), -slope.gravity * math.cos(slope.angle)
    springs = law.stiffness * (1.0 + law.asymmetry), law.stiffness * (1.0 - law.asymmetry)
    constants = np.array([*springs, body.mass, body.inertia, body.size, *gravity, layer])
    rows, tables = np.zeros((contacts, 7)), scene(body, list(slope.profile) or LEVEL, slope.rounding)
    found, jumped, done = integrate(*tables, zones, constants, np.array(launch, float), contacts, max_time, steps, rows)
    return Passage(rows[:found], jumped, done)


def depths(tables: Scene, poses: np.ndarray, size: float) -> np.ndarray:
    """How deep arcs are in pieces and dips, and crests in the body [m], at poses (N, 3) of x, y, phi: shape (N, 2)."""
    deepest = np.zeros((len(poses), 2))
    _depths(*tables, np.ascontiguousarray(poses, float), size, deepest)
    return deepest


@njit(cache=True)
def _depths(arcs, pieces, reach, crests, hollows, poses, size, deepest):
    pairs, z = np.zeros((MOST, 8)), np.zeros(6)
    for i in range(len(poses)):
        z[:3] = poses[i]
        for k in range(touching(arcs, pieces, reach, crests, hollows, z, size, pairs)):
            column = 0 if pairs[k, WHICH] < 1000 * (len(pieces) + len(hollows)) else 1
            deepest[i, column] = max(deepest[i, column], -pairs[k, GAP])


def resting_height(
    body: Body, profile: list[tuple[float, float]], x: float, phi: float, rounding: Sequence[float] = ()
) -> float:
    """Height [m] of the mass centre where the body just touches the ground at a place and an orientation."""
    tables = scene(body, profile, rounding)
    low, high = min(y for _, y in profile) - body.size, max(y for _, y in profile) + 2.0 * body.size
    for _ in range(80):
        middle = 0.5 * (low + high)
        if depths(tables, np.array([[x, middle, phi]]), body.size).max() > 0.0:
            low = middle
        else:
            high = middle
    return high
