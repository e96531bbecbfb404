"""Where a body of arcs and straight sides lies over a ground of straight pieces and arcs: distances, by geometry alone.

The body is convex and has no sharp corner. Its outline is told by the outward normals: an arc has those between its
begin and its end, a straight side the one where both of its arcs meet. So the signed distance of a point from the body
is the largest of n . (p - c) - r over all arcs and their normals, inside as outside.

The ground is a polyline, level before its first and behind its last vertex. A vertex may be rounded by an arc that
touches both of its pieces: a bend. It is the graph of a function, so that a point is under the ground where it is lower
than the height there; how deep it is under the ground is its distance from the nearest point of pieces and bends.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit

from sledenv import Body

CX, CY, R, MX, MY, COS, AX, AY, BX, BY, SIDE = range(11)  # of an arc
PX, PY, TX, TY, LOW, HIGH, LEFT, RIGHT = range(8)  # of a piece
QX, QY, RHO, SIGN, FX, FY, GX, GY = range(8)  # of a bend
OUTLINE, CREST, CENTRE = range(3)  # of what is measured of a pose
ON_ARC: Final = 7  # points of each arc, and of each side, at which the outline is sampled
OVERLAP: Final = 1e-11  # [-] and of the length of a side: features overlap by this, so that rounding leaves no gap
ROUNDEST: Final = 0.49  # of the shorter piece beside a vertex: as much of it a bend may take


class Outline(NamedTuple):
    """A body as tables."""

    # Each arc: centre, radius, the outward normal in its middle and the cosine of half its angle, the outward normals
    # where it begins and ends, and the length of the straight side after it.
    arcs: np.ndarray
    samples: np.ndarray  # (n, 2) points of the outline


class Ground(NamedTuple):
    """A ground as tables."""

    # Each piece: a point, its tangent, where it begins and ends along that, seen from the point, and as x.
    pieces: np.ndarray
    # Each vertex: centre and radius of its bend, 1 on a crest and -1 in a dip, the tangents before and behind it.
    bends: np.ndarray


def outline_of(body: Body) -> Outline:
    """Return the tables of a body without sharp corners."""
    count = len(body.arcs)
    arcs = np.zeros((count, 11))
    samples = []
    for k, arc in enumerate(body.arcs):
        if not arc.radius > 0.0:
            raise ValueError(f"arc {k} is a sharp corner")
        after = body.arcs[(k + 1) % count]
        end = after.begin + (2.0 * math.pi if k == count - 1 else 0.0)
        for first, angle in ((MX, 0.5 * (arc.begin + end)), (AX, arc.begin), (BX, end)):
            arcs[k, first : first + 2] = -math.sin(angle), -math.cos(angle)
        arcs[k, : R + 1], arcs[k, COS] = arc[:3], math.cos(0.5 * (end - arc.begin))
        middle = np.array([arc.x, arc.y])
        angles = np.linspace(arc.begin, end, ON_ARC)
        samples += [middle + arc.radius * np.array([-math.sin(angle), -math.cos(angle)]) for angle in angles]
        beyond = np.array([after.x, after.y]) + after.radius * arcs[k, [BX, BY]]
        length = float(np.hypot(*(beyond - samples[-1])))
        if count > 1 and length > 1e-9 * body.size:
            arcs[k, SIDE] = length
            samples += [samples[-1] + share * (beyond - samples[-1]) for share in np.arange(1, ON_ARC) / ON_ARC]
    return Outline(arcs, np.array(samples))


def ground_of(profile: Sequence[Sequence[float]], radii: Sequence[float] | None = None) -> Ground:
    """Return the tables of a ground; ``radii`` [m] of its vertices, 0 where they are sharp, as they are by default."""
    points = np.array(profile, float).reshape(-1, 2)
    count = len(points)
    given = np.zeros(count) if radii is None else np.array(radii, float)
    along = np.diff(points, axis=0)
    lengths = np.hypot(*along.T)
    tangents = np.vstack([[[1.0, 0.0]], along / lengths[:, np.newaxis], [[1.0, 0.0]]] if count else [[1.0, 0.0]])
    pieces, bends = np.zeros((count + 1, 8)), np.zeros((count, 8))
    starts = points[np.maximum(np.arange(count + 1) - 1, 0)] if count else np.zeros((1, 2))
    pieces[:, :LOW] = np.column_stack([starts, tangents])
    pieces[:, HIGH] = np.r_[0.0 if count else math.inf, lengths, math.inf][: count + 1]
    pieces[0, LOW] = -math.inf
    before, behind = tangents[:-1], tangents[1:]
    turns = np.arctan2(before[:, 0] * behind[:, 1] - before[:, 1] * behind[:, 0], (before * behind).sum(axis=1))
    shorter = np.minimum(np.r_[math.inf, lengths][:count], np.r_[lengths, math.inf][:count])
    steep = np.tan(0.5 * np.abs(turns))
    cuts = np.minimum(given * steep, ROUNDEST * shorter)
    bends[:, RHO] = np.divide(cuts, steep, out=np.zeros(count), where=steep > 0.0)
    bends[:, SIGN] = np.where(turns < 0.0, 1.0, -1.0)
    up = np.column_stack([-(before + behind)[:, 1], (before + behind)[:, 0]])
    up /= np.hypot(*up.T)[:, np.newaxis]
    bends[:, :RHO] = points - (bends[:, SIGN] * bends[:, RHO] / np.cos(0.5 * turns))[:, np.newaxis] * up
    bends[:, FX:] = np.column_stack([before, behind])
    pieces[:-1, HIGH] -= cuts
    pieces[1:, LOW] += cuts
    pieces[:, LEFT] = pieces[:, PX] + pieces[:, LOW] * pieces[:, TX]
    pieces[:, RIGHT] = pieces[:, PX] + pieces[:, HIGH] * pieces[:, TX]
    return Ground(pieces, bends)


@njit(cache=True)
def piece_at(pieces: Any, x: float) -> int:
    """Return the last piece that begins at or before a place."""
    low, high = 0, len(pieces) - 1
    while low < high:
        middle = (low + high + 1) // 2
        if pieces[middle, LEFT] <= x:
            low = middle
        else:
            high = middle - 1
    return low


@njit(cache=True)
def height_at(pieces: Any, bends: Any, x: float) -> float:
    """Height [m] of the ground."""
    j = piece_at(pieces, x)
    piece = pieces[j]
    if x <= piece[RIGHT]:
        return float(piece[PY] + (x - piece[PX]) * piece[TY] / piece[TX])
    bend = bends[j]
    return float(bend[QY] + bend[SIGN] * math.sqrt(max(bend[RHO] ** 2 - (x - bend[QX]) ** 2, 0.0)))


@njit(cache=True)
def clearance(pieces: Any, bends: Any, x: float, y: float) -> float:
    """Distance [m] of a point from the ground, < 0 under it."""
    above = y - height_at(pieces, bends, x)
    least = abs(above)
    begin, end = x - least, x + least
    for j in range(max(piece_at(pieces, begin) - 1, 0), len(pieces)):
        piece = pieces[j]
        if piece[LEFT] > end:
            break
        dx, dy = x - piece[PX], y - piece[PY]
        foot = min(max(piece[TX] * dx + piece[TY] * dy, piece[LOW]), piece[HIGH])
        dx, dy = dx - foot * piece[TX], dy - foot * piece[TY]
        least = min(least, math.sqrt(dx * dx + dy * dy))
        if j < len(bends) and bends[j, RHO] > 0.0:
            bend = bends[j]
            ex, ey = bend[SIGN] * (x - bend[QX]), bend[SIGN] * (y - bend[QY])
            if is_between(bend, ex, ey):
                least = min(least, abs(math.sqrt(ex * ex + ey * ey) - bend[RHO]))
    return least if above >= 0.0 else -least


@njit(cache=True)
def is_between(bend: Any, nx: float, ny: float) -> bool:
    """Whether a normal out of the ground, of any length, lies between those at both ends of a bend."""
    before, behind = nx * bend[FX] + ny * bend[FY], nx * bend[GX] + ny * bend[GY]
    return bool(bend[SIGN] * before >= 0.0 and bend[SIGN] * behind <= 0.0)


@njit(cache=True)
def is_on(arc: Any, nx: float, ny: float, slack: float) -> bool:
    """Whether an arc has an outward normal, given in the frame of the body with any length."""
    return bool(nx * arc[MX] + ny * arc[MY] >= (arc[COS] - slack) * math.sqrt(nx * nx + ny * ny))


@njit(cache=True)
def outside(arcs: Any, x: float, y: float) -> tuple[float, float, float]:
    """Distance [m] of a point in the frame of the body from the outline, < 0 inside, and the outward normal there."""
    best, nx, ny = -math.inf, 0.0, 0.0
    for k in range(len(arcs)):
        arc = arcs[k]
        ex, ey = x - arc[CX], y - arc[CY]
        distance = math.sqrt(ex * ex + ey * ey)
        if len(arcs) == 1 or is_on(arc, ex, ey, 0.0):
            if distance - arc[R] > best:
                best = distance - arc[R]
                nx, ny = (ex / distance, ey / distance) if distance > 0.0 else (arc[MX], arc[MY])
            continue
        for first in (AX, BX):
            found = arc[first] * ex + arc[first + 1] * ey - arc[R]
            if found > best:
                best, nx, ny = found, arc[first], arc[first + 1]
    return best, nx, ny


@njit(cache=True)
def leave(arcs: Any, x: float, y: float, dx: float, dy: float) -> tuple[float, float, float]:
    """How far [m] a point moves along a direction until it leaves the body, and the outward normal there.

    All is in the frame of the body. Less than 0 where it has left it before; NaN if the line misses the body.
    """
    best, nx, ny = -math.inf, 0.0, 0.0
    for k in range(len(arcs)):
        arc, after = arcs[k], arcs[(k + 1) % len(arcs)]
        ex, ey = x - arc[CX], y - arc[CY]
        middle, aside = ex * dx + ey * dy, ex * dy - ey * dx
        if abs(aside) <= arc[R]:
            s = -middle + math.sqrt((arc[R] - aside) * (arc[R] + aside))
            wx, wy = ex + s * dx, ey + s * dy
            if s > best and (len(arcs) == 1 or is_on(arc, wx, wy, OVERLAP)):
                best, nx, ny = s, wx / arc[R], wy / arc[R]
        ox, oy = arc[BX], arc[BY]
        steep = ox * dx + oy * dy
        if arc[SIDE] > 0.0 and steep > 0.0:
            s = (arc[R] - ox * ex - oy * ey) / steep
            wx, wy = x + s * dx - after[CX], y + s * dy - after[CY]
            left = -(oy * wx - ox * wy)  # up to the end of the side
            if s > best and -OVERLAP * arc[SIDE] <= left <= (1.0 + OVERLAP) * arc[SIDE]:
                best, nx, ny = s, ox, oy
    return (best, nx, ny) if best > -math.inf else (math.nan, nx, ny)


@njit(cache=True)
def highest_within(pieces: Any, bends: Any, begin: float, end: float) -> float:
    """Height [m] that no ground between two places exceeds."""
    highest = max(height_at(pieces, bends, begin), height_at(pieces, bends, end))
    for j in range(piece_at(pieces, begin), len(pieces)):
        if pieces[j, LEFT] > end:
            break
        for s in (pieces[j, LOW], pieces[j, HIGH]):
            if abs(s) < math.inf:
                highest = max(highest, pieces[j, PY] + s * pieces[j, TY])
        if j < len(bends) and bends[j, SIGN] > 0.0:
            highest = max(highest, bends[j, QY] + bends[j, RHO])
    return highest


@njit(cache=True)
def deeper(pieces: Any, bends: Any, x: float, y: float, deepest: float) -> float:
    """Return how deep [m] a point is under the ground, or a depth if that is more."""
    if height_at(pieces, bends, x) - y <= deepest:  # the nearest point of the ground is no farther than that above
        return deepest
    return max(deepest, -clearance(pieces, bends, x, y))


@njit(cache=True)
def beyond(
    arcs: Any, pieces: Any, bends: Any, pose: Any, x: float, y: float, nx: float, ny: float, deepest: float
) -> float:
    """Return how deep [m] the outline is where a ray from a point leaves the body, or a depth if that is more."""
    S, C, dx, dy = math.sin(pose[2]), math.cos(pose[2]), x - pose[0], y - pose[1]
    s, _, _ = leave(arcs, C * dx + S * dy, C * dy - S * dx, C * nx + S * ny, C * ny - S * nx)
    return deeper(pieces, bends, x + s * nx, y + s * ny, deepest) if s > 0.0 else deepest


@njit(cache=True)
def measure_crest(arcs: Any, pieces: Any, bends: Any, pose: Any, bend: Any, deepest: float) -> tuple[float, float]:
    """Return how deep [m] the outline is near a crest, or a depth if that is more, and how deep the crest is in it."""
    S, C, dx, dy = math.sin(pose[2]), math.cos(pose[2]), bend[QX] - pose[0], bend[QY] - pose[1]
    gap, ox, oy = outside(arcs, C * dx + S * dy, C * dy - S * dx)
    ox, oy = C * ox - S * oy, S * ox + C * oy
    depth = 0.0
    if gap < bend[RHO] and (bend[RHO] == 0.0 or is_between(bend, -ox, -oy)):
        depth = bend[RHO] - gap
        deepest = deeper(pieces, bends, bend[QX] - gap * ox, bend[QY] - gap * oy, deepest)
    nx, ny = bend[FY] + bend[GY], -bend[FX] - bend[GX]
    length = math.sqrt(nx * nx + ny * ny)
    return beyond(arcs, pieces, bends, pose, bend[QX], bend[QY], nx / length, ny / length, deepest), depth


@njit(cache=True)
def measure_dip(arcs: Any, pieces: Any, bends: Any, pose: Any, bend: Any, deepest: float) -> float:
    """Return how deep [m] the outline is at a dip, or a depth if that is more."""
    if bend[RHO] == 0.0:
        deepest = beyond(arcs, pieces, bends, pose, bend[QX], bend[QY], bend[FY], -bend[FX], deepest)
        return beyond(arcs, pieces, bends, pose, bend[QX], bend[QY], bend[GY], -bend[GX], deepest)
    x, y, S, C = pose[0], pose[1], math.sin(pose[2]), math.cos(pose[2])
    for k in range(len(arcs)):
        arc = arcs[k]
        rx, ry = C * arc[CX] - S * arc[CY], S * arc[CX] + C * arc[CY]
        ex, ey = x + rx - bend[QX], y + ry - bend[QY]
        distance = math.sqrt(ex * ex + ey * ey)
        if distance + arc[R] > bend[RHO] and distance > 0.0:
            ex, ey = ex / distance, ey / distance
            if len(arcs) == 1 or is_on(arc, C * ex + S * ey, C * ey - S * ex, OVERLAP):
                deepest = deeper(pieces, bends, x + rx + arc[R] * ex, y + ry + arc[R] * ey, deepest)
    return deepest


@njit(cache=True)
def measure(arcs: Any, samples: Any, pieces: Any, bends: Any, size: float, pose: Any, out: Any) -> None:
    """Write how deep [m] a body at a pose (x, y, phi) is in the ground, and how deep its mass centre.

    The first is the depth of the deepest point of its outline, the second how deep crests are in the body, along the
    normal out of it: of a sharp one the point, of a round one the deepest point. Both are 0 where nothing touches. The
    first is that of samples and of all points that are next to the middle of a piece, to a vertex or to its bisector:
    no larger than the true one, and as large but where the nearest places of the ground are not beside each other.
    """
    x, y, S, C = pose[0], pose[1], math.sin(pose[2]), math.cos(pose[2])
    out[OUTLINE] = out[CREST] = 0.0
    out[CENTRE] = -clearance(pieces, bends, x, y)
    begin, end = x - size, x + size
    if y - size >= highest_within(pieces, bends, begin, end):
        return
    deepest = 0.0
    for k in range(len(samples)):
        px, py = x + C * samples[k, 0] - S * samples[k, 1], y + S * samples[k, 0] + C * samples[k, 1]
        deepest = deeper(pieces, bends, px, py, deepest)
    for j in range(max(piece_at(pieces, begin) - 1, 0), len(pieces)):
        piece = pieces[j]
        if piece[LEFT] > end:
            break
        nx, ny = piece[TY], -piece[TX]  # into the ground
        bx, by = C * nx + S * ny, C * ny - S * nx
        for k in range(len(arcs)):
            arc = arcs[k]
            if len(arcs) == 1 or is_on(arc, bx, by, OVERLAP):
                px = x + C * arc[CX] - S * arc[CY] + arc[R] * nx
                py = y + S * arc[CX] + C * arc[CY] + arc[R] * ny
                deepest = deeper(pieces, bends, px, py, deepest)
        if j < len(bends) and (bends[j, QX] - x) ** 2 + (bends[j, QY] - y) ** 2 < (size + bends[j, RHO]) ** 2:
            if bends[j, SIGN] > 0.0:
                deepest, depth = measure_crest(arcs, pieces, bends, pose, bends[j], deepest)
                out[CREST] = max(out[CREST], depth)
            else:
                deepest = measure_dip(arcs, pieces, bends, pose, bends[j], deepest)
    out[OUTLINE] = deepest


@njit(cache=True)
def measure_all(arcs: Any, samples: Any, pieces: Any, bends: Any, size: float, poses: Any, out: Any) -> None:
    """Write what `measure` finds of each pose."""
    for i in range(len(poses)):
        measure(arcs, samples, pieces, bends, size, poses[i], out[i])


@njit(cache=True)
def _touching_height(arcs: Any, pieces: Any, bends: Any, size: float, x: float, phi: float) -> float:
    S, C = math.sin(phi), math.cos(phi)
    highest = -math.inf
    for j in range(max(piece_at(pieces, x - size) - 1, 0), len(pieces)):
        piece = pieces[j]
        if piece[LEFT] > x + size:
            break
        bx, by = C * piece[TY] - S * piece[TX], -C * piece[TX] - S * piece[TY]
        for k in range(len(arcs)):
            arc = arcs[k]
            if len(arcs) == 1 or is_on(arc, bx, by, OVERLAP):
                px = C * arc[CX] - S * arc[CY] + arc[R] * piece[TY]
                py = S * arc[CX] + C * arc[CY] - arc[R] * piece[TX]
                if piece[LEFT] <= x + px <= piece[RIGHT]:
                    highest = max(highest, piece[PY] + (x + px - piece[PX]) * piece[TY] / piece[TX] - py)
        if j < len(bends):
            dx = bends[j, QX] - x
            down, _, _ = leave(arcs, C * dx, -S * dx, -S, -C)
            if down == down:
                highest = max(highest, bends[j, QY] + down)
    return highest


def touching_height(body: Body, profile: Sequence[Sequence[float]], x: float, phi: float) -> float:
    """Height [m] of the mass centre where a body that comes down on a ground of sharp vertices first touches it."""
    arcs, _ = outline_of(body)
    return float(_touching_height(arcs, *ground_of(profile), body.size, x, phi))
