"""Outlines of bodies: how arcs and straight sides join, hulls of circles, and areas with their moments.

An outline is convex and closed: docs/physics.md, section 8. Coordinates are those of the body at phi = 0: x downhill,
y away from the slope. As the orientation phi rises, the lowest point goes around the outline clockwise. At phi it is
where the outline has the normal (-sin phi, -cos phi).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel import arithmetic
from sledenv.kernel.entries import run_directions
from sledenv.kernel.outline import MOST_ARCS
from sledenv.simulation.rules import FINITE, MEASURE_OR_0, NOT_NEGATIVE, Rule, checked, checked_flag

Floats = NDArray[np.float64]

TURN: Final = 2.0 * math.pi
LARGEST_RADIUS: Final = 1e6  # of an arc, over the size of the body
SHORTEST: Final = 1e-9  # side, over the size of the body, and turn from one side to the next [rad]
_ROUNDED: Final = 1e-12  # of the size: what is closer is at one place
_ROUNDED_ARC: Final = 4e-15  # of the radius of an arc: the same, where its centre is far away
# Gauss-Legendre quadrature with 16 nodes: those of a library have other last digits on other processors.
_HALF_OF_NODES: Final = (
    0.09501250983763744,
    0.2816035507792589,
    0.45801677765722737,
    0.6178762444026438,
    0.755404408355003,
    0.8656312023878318,
    0.9445750230732326,
    0.9894009349916499,
)
_HALF_OF_WEIGHTS: Final = (
    0.18945061045506864,
    0.18260341504492364,
    0.16915651939500265,
    0.1495959888165767,
    0.12462897125553407,
    0.0951585116824926,
    0.062253523938647456,
    0.027152459411754176,
)
_NODES = np.array([*(-node for node in reversed(_HALF_OF_NODES)), *_HALF_OF_NODES])
_WEIGHTS = np.array([*reversed(_HALF_OF_WEIGHTS), *_HALF_OF_WEIGHTS])
_IN_TURN: Rule = (lambda v: (v >= -math.pi) & (v < math.pi), "in [-pi, pi) rad")


class Arc(NamedTuple):
    """One arc of an outline: docs/physics.md, section 8."""

    x: float  # [m] its centre, from the mass centre in the frame of the body: downhill,
    y: float  # [m] and away from the slope
    radius: float  # [m] >= 0; 0 is a corner
    begin: float  # [rad] in [-pi, pi): orientation from which on, as it rises, this arc is the lowest
    part: str = "arc"  # name
    side: str = "side"  # name of the straight side up to the next arc, if there is one
    corner: bool | None = None  # whether ContactLaw.corner_rolling_arm holds for it; None: if the radius is 0


class Outline(NamedTuple):
    """Measures of an outline that follow from its arcs; each array has one entry for each arc."""

    size: float  # [m] largest distance from the mass centre
    lowest: float  # [m] smallest support height
    sides: Floats  # [m] length of the straight side up to the next arc
    steps: Floats  # [m] how much higher the next arc is where it should be as low as this one
    rounding: Floats  # [m] shortest side that is not a smooth join

    @property
    def holds_the_mass_centre(self) -> bool:
        """Whether the mass centre lies within the outline or on it, but for rounding."""
        return self.lowest >= -float(self.rounding.max())


def sines_and_cosines(angles: Floats) -> tuple[Floats, Floats]:
    """Sine and cosine of many angles [rad] within a few turns, of any shape: the same bits on every platform."""
    given = np.asarray(angles, float)
    sine, cosine = np.empty(given.shape), np.empty(given.shape)
    run_directions(np.ravel(given), cosine.ravel(), sine.ravel())
    return sine, cosine


def angle_of(sine: float, cosine: float) -> float:
    """Angle [rad] in [-pi, pi) of a direction of any length: the same bits on every platform."""
    angle = arithmetic.angle_of(float(sine), float(cosine))
    return angle if abs(angle) < math.pi else -math.pi


# Checks.


def checked_arcs(owner: str, given: Any) -> tuple[Arc, ...]:
    """Return the arcs of an outline around the mass centre with floats for numbers, or raise an error.

    Raises
    ------
    TypeError, ValueError
        Naming the arc, its field, the value and what is allowed: see :class:`sledenv.Body`.
    """
    arcs, outline = checked_outline(owner, given)
    if not outline.holds_the_mass_centre:
        raise ValueError(
            f"{owner}.arcs: the outline passes the mass centre at {outline.lowest!r} m: must be >= 0, or the mass "
            "centre would pass below the slope"
        )
    return arcs


def checked_outline(owner: str, given: Any) -> tuple[tuple[Arc, ...], Outline]:
    """Return the arcs of an outline in any frame, and its measures, as :func:`checked_arcs` does."""
    if isinstance(given, str | bytes) or not isinstance(given, Sequence):
        raise TypeError(f"{owner}.arcs = {given!r}: must be a sequence of arcs")
    if not 1 <= len(given) <= MOST_ARCS:
        raise ValueError(f"{owner}.arcs has {len(given)} arcs: must have 1 to {MOST_ARCS}")
    arcs = tuple(_checked_arc(f"{owner}.arcs[{k}]", arc) for k, arc in enumerate(given))
    if len(arcs) == 1:
        arcs = (arcs[0]._replace(begin=-math.pi),)
    return arcs, _joined(owner, arcs)


def _checked_arc(owner: str, given: Any) -> Arc:
    if not isinstance(given, tuple) or not 4 <= len(given) <= len(Arc._fields):
        raise TypeError(f"{owner} = {given!r}: must be an Arc")
    arc = Arc(*given)
    for field in ("part", "side"):
        name = getattr(arc, field)
        if not isinstance(name, str):
            raise TypeError(f"{owner}.{field} = {name!r}: must be a word")
        if not name:
            raise ValueError(f"{owner}.{field} = {name!r}: must have a letter")
    radius = checked(owner, "radius", arc.radius, NOT_NEGATIVE)
    return Arc(
        checked(owner, "x", arc.x, FINITE) + 0.0,  # no -0.0
        checked(owner, "y", arc.y, FINITE) + 0.0,
        radius,
        checked(owner, "begin", arc.begin, _IN_TURN) + 0.0,
        arc.part,
        arc.side,
        radius == 0.0 if arc.corner is None else checked_flag(f"{owner}.corner", arc.corner),
    )


def _joined(owner: str, arcs: tuple[Arc, ...]) -> Outline:
    """Measure an outline, or raise ValueError unless its arcs follow one another and it is convex."""
    for k in range(len(arcs)):
        before = arcs[k - 1].begin - (TURN if k == 0 else 0.0)
        if not arcs[k].begin - before >= SHORTEST:
            raise ValueError(
                f"{owner}.arcs[{k}].begin = {arcs[k].begin!r}: must rise from arc to arc, by {SHORTEST} rad or more, "
                f"from {before!r} rad here"
            )
    outline = outline_of(arcs)
    _check_size(owner, arcs, outline.size)
    for k in range(len(arcs) if len(arcs) > 1 else 0):
        _check_join(owner, arcs, outline, k)
    return outline


def _check_size(owner: str, arcs: tuple[Arc, ...], size: float) -> None:
    accepts, allowed = MEASURE_OR_0
    if not accepts(size):
        raise ValueError(f"{owner}.arcs: the size {size!r} m must be {allowed} m")
    for k, arc in enumerate(arcs):
        if arc.radius > LARGEST_RADIUS * size:
            raise ValueError(
                f"{owner}.arcs[{k}].radius = {arc.radius!r}: must be in [0, {LARGEST_RADIUS:g} * size] = "
                f"[0, {LARGEST_RADIUS * size!r}] m"
            )


def _check_join(owner: str, arcs: tuple[Arc, ...], outline: Outline, k: int) -> None:
    """Raise ValueError unless an arc and the next one join, or have a straight side between them."""
    after = (k + 1) % len(arcs)
    there = f"{owner}.arcs[{after}].begin = {arcs[after].begin!r}"
    between = f"between the arcs {k} and {after}"
    step, side, shortest = float(outline.steps[k]), float(outline.sides[k]), SHORTEST * outline.size
    if max(abs(one - other) for one, other in zip(arcs[k][:3], arcs[after][:3], strict=True)) <= outline.rounding[k]:
        raise ValueError(f"{owner}.arcs: {k} and {after} are of one circle: must be given as one arc")
    if not abs(step) <= shortest:
        raise ValueError(
            f"{there}: the outline is open or crosses itself there: the step of {step!r} m {between} must be in "
            f"[{-shortest!r}, {shortest!r}] m"
        )
    if side < 0.0:
        raise ValueError(f"{there}: the outline is not convex: the side of {side!r} m {between} must be >= 0")
    if 0.0 < side < shortest:
        raise ValueError(f"{there}: the side of {side!r} m {between} must be 0 or >= {shortest!r} m")


def outline_of(arcs: Sequence[Arc]) -> Outline:
    """Measure an outline; of one that is open, the steps say so."""
    with np.errstate(all="ignore"):
        return _outline_of(arcs)


def _outline_of(arcs: Sequence[Arc]) -> Outline:
    x, y, r, begin = columns(arcs)
    sine, cosine = (np.roll(of, -1) for of in sines_and_cosines(begin))  # where each arc ends
    a, b = y * sine - x * cosine, r - x * sine - y * cosine
    following = [np.roll(of, -1) for of in (x, y, r)]
    sides = following[1] * sine - following[0] * cosine - a
    steps = b - (following[2] - following[0] * sine - following[1] * cosine)
    h = np.hypot(x, y)
    size, lowest = 0.0, math.inf
    for k, arc in enumerate(arcs):
        turn = turn_of(arcs, k)
        away, towards = (_ahead(angle_of(s * arc.x, s * arc.y), arc.begin) <= turn for s in (-1.0, 1.0))
        before = arms_of(arc, arc.begin)
        size = max(size, r[k] + h[k] if away else 0.0, math.hypot(a[k], b[k]), math.hypot(*before))
        lowest = min(lowest, r[k] - h[k] if towards else math.inf, b[k], before[1])
    rounding = np.maximum(_ROUNDED * size, _ROUNDED_ARC * np.maximum(r, following[2]))
    smooth = (np.abs(sides) <= rounding) if len(arcs) > 1 else np.ones(1, bool)
    return Outline(float(size), float(lowest), np.where(smooth, 0.0, sides), steps, rounding)


def arms_of(arc: Arc, phi: float) -> tuple[float, float]:
    """Arms ``a``, ``b`` [m] of an arc at an orientation [rad]: its lowest point is (-a, -b) from the mass centre."""
    (sine,), (cosine,) = sines_and_cosines(np.array([phi]))
    return float(arc.y * sine - arc.x * cosine), float(arc.radius - arc.x * sine - arc.y * cosine)


def columns(arcs: Sequence[Arc]) -> tuple[Floats, Floats, Floats, Floats]:
    """Return x, y [m] of the centres, radii [m] and ``begin`` [rad] of arcs, each of shape (arcs,)."""
    x, y, r, begin = np.array([arc[:4] for arc in arcs], float).T
    return x, y, r, begin


def _ahead(angle: float, start: float) -> float:
    """Return by how much an angle [rad] lies ahead of another, in [0, 2 pi)."""
    return (angle - start) % TURN


def turn_of(arcs: Sequence[Arc], k: int) -> float:
    """Length [rad] of the interval in which an arc is the lowest."""
    return _ahead(arcs[(k + 1) % len(arcs)].begin, arcs[k].begin) if len(arcs) > 1 else TURN


# Building outlines.


def shifted(arcs: Sequence[Arc], x: float, y: float) -> tuple[Arc, ...]:
    """Return an outline moved by (x, y) [m]."""
    return tuple(arc._replace(x=arc.x + x, y=arc.y + y) for arc in arcs)


def in_order(arcs: Sequence[Arc]) -> tuple[Arc, ...]:
    """Return arcs that follow one another clockwise, so that the one with the smallest ``begin`` is the first."""
    return tuple(sorted(arcs, key=lambda arc: arc.begin))


def polygon_of(points: Floats, rounding: float, parts: Sequence[str], sides: Sequence[str]) -> tuple[Arc, ...]:
    """Return a convex polygon as :func:`sledenv.simulation.shapes.polygon` describes it; the frame is kept."""
    along = np.roll(points, -1, axis=0) - points
    lengths = np.array([math.hypot(*side) for side in along.tolist()])
    if not lengths.min() > 0.0:
        k = int(lengths.argmin())
        raise ValueError(
            f"polygon.points[{k}] = {points[k].tolist()}: must differ from the next one; the last joins the first"
        )
    after = along / lengths[:, np.newaxis]  # directions of the sides before and after each corner
    before = np.roll(after, 1, axis=0)
    turns = before[:, 1] * after[:, 0] - before[:, 0] * after[:, 1]  # their sines, positive if clockwise
    order = list(range(len(points)))
    if turns.sum() < 0.0:  # arcs follow one another clockwise
        order.reverse()
        before, after, turns = -after, -before, -turns
        sides = [sides[k - 1] for k in range(len(points))]
    begins = [angle_of(y, -x) for x, y in before.tolist()]
    falls = sum(begins[k] >= begins[following] for k, following in zip(order, [*order[1:], order[0]], strict=True))
    if turns.min() < SHORTEST or falls != 1:
        k = int(turns.argmin())
        raise ValueError(
            f"polygon.points[{k}] = {points[k].tolist()!r}: the polygon must be strictly convex; the outline must turn "
            f"by {SHORTEST} rad or more at each corner, and once around in all; a hull leaves out what lies within"
        )
    if rounding > 0.0:
        cosines = (before * after).sum(axis=1)
        with np.errstate(divide="ignore"):  # a needle has no room for any radius
            tangents = turns / (1.0 + cosines)  # of half the turn: what each of the two sides loses, over the radius
        largest = float((lengths / (tangents + np.roll(tangents, -1))).min())
        if not rounding < largest:
            raise ValueError(
                f"polygon.rounding = {rounding!r}: must be in [0, {largest!r}) m, so that a length of each side is left"
            )
        inward = np.column_stack([(before + after)[:, 1], -(before + after)[:, 0]])
        points = points + rounding * inward / (1.0 + cosines)[:, np.newaxis]
    x, y = points.T.tolist()
    return in_order([Arc(x[k], y[k], rounding, begins[k], parts[k], sides[k]) for k in order])


def hull_of_circles(circles: Floats, parts: Sequence[str], sides: Sequence[str]) -> tuple[Arc, ...]:
    """Return the convex hull of circles, shape (N, 3) of x, y, radius [m]; the frame is kept.

    ``parts`` has a name for each circle, ``sides`` one for the straight side that follows it clockwise. Circles within
    others are left out, and so is what sticks out by no more than rounding. A circle may have several of the arcs.

    Raises
    ------
    ValueError
        If squares of the numbers overflow or vanish, so that no hull can be told.
    """
    rows = zip(circles.tolist(), parts, sides, strict=True)
    given = [Arc(x, y, r, -math.pi, part, side) for (x, y, r), part, side in rows]
    left = _not_within(given)
    now = max(left, key=lambda arc: math.hypot(arc.x, arc.y) + arc.radius)
    if len(left) == 1:
        return (now,)
    now = now._replace(begin=angle_of(-now.x, -now.y))  # its point that is furthest from the origin is on the hull
    arcs: list[Arc] = []
    gone = 0.0
    for _ in range(2 * len(left)):  # a hull of n circles has at most 2n - 1 arcs
        turn, now = _next_of(now, left)
        gone += turn
        if gone >= TURN:
            return in_order(arcs)
        arcs.append(now)
    largest = float(np.abs(circles).max())
    raise ValueError(f"circles: no hull can be told of them, the largest of their numbers being {largest:g} m")


def fewer_circles(circles: Floats, most: int) -> tuple[list[int], float]:
    """Choose circles whose hull has few arcs and hardly differs from the hull of all.

    Parameters
    ----------
    circles : ndarray, shape (N, 3)
        x, y, radius [m].
    most : int
        How many arcs the hull may have.

    Returns
    -------
    chosen : list of int
        Their rows, in order. Each is the one that stuck out farthest of the hull of those before, in 3,600 directions.
    depth : float
        By how much [m] their hull lies within that of all, at most.
    """
    heights = _heights(circles, np.linspace(-math.pi, math.pi, 3600, endpoint=False))
    reached, chosen, arcs = heights.min(axis=0), list[int](), tuple[Arc, ...]()
    while True:
        beyond = (heights - reached).max(axis=1)
        k = int(beyond.argmax())
        names = [""] * (len(chosen) + 1)
        more = hull_of_circles(circles[[*chosen, k]], names, names)
        if chosen and (len(more) > most or beyond[k] <= SHORTEST * np.abs(circles).max()):
            break
        chosen.append(k)
        reached, arcs = np.maximum(reached, heights[k]), more
    # How far a circle sticks out of the hull is largest towards it from an arc, or where an arc ends.
    apart = (circles[:, np.newaxis, :2] - circles[chosen, :2]).reshape(-1, 2)
    angles = np.append(np.arctan2(-apart[:, 0], -apart[:, 1]), [arc.begin for arc in arcs])
    heights = _heights(circles, angles)
    return sorted(chosen), float((heights.max(axis=0) - heights[chosen].max(axis=0)).max())


def _heights(circles: Floats, angles: Floats) -> Floats:
    """Heights [m] of circles along the normals of orientations [rad], shape (circles, angles)."""
    sine, cosine = sines_and_cosines(angles)
    return circles[:, :2] @ -np.stack([sine, cosine]) + circles[:, 2:]


def _not_within(circles: list[Arc]) -> list[Arc]:
    """Return the circles that do not lie within another one; of equal ones the first."""
    rounding = _ROUNDED * max(math.hypot(one.x - other.x, one.y - other.y) for one in circles for other in circles)
    left: list[Arc] = []
    for one in sorted(circles, key=lambda arc: -arc.radius):  # a larger one is not within a smaller one
        if all(math.hypot(one.x - o.x, one.y - o.y) > o.radius - one.radius + rounding for o in left):
            left.append(one)
    return left


def _next_of(now: Arc, circles: list[Arc]) -> tuple[float, Arc]:
    """Turn [rad] up to the side that leaves a circle of a hull, and the circle to which it leads.

    Of several circles along one side it is the one at its end.
    """
    found = []
    for arc in circles:
        if arc[:3] != now[:3]:
            length, begin = _tangent(now, arc)
            turn = _ahead(begin, now.begin)
            found.append((turn if turn < TURN - SHORTEST else turn - TURN, length, arc._replace(begin=begin)))
    nearest = min(turn for turn, _, _ in found)
    turn, _, arc = max((one for one in found if one[0] <= nearest + SHORTEST), key=lambda one: one[1])
    return turn, arc


def _tangent(one: Arc, other: Arc) -> tuple[float, float]:
    """Length [m] of the side from a circle to the next one clockwise, and the orientation [rad] at which it is lowest.

    Neither of them lies within the other one.
    """
    x, y, grows = other.x - one.x, other.y - one.y, other.radius - one.radius
    apart = math.hypot(x, y)
    length = math.sqrt(max((apart - grows) * (apart + grows), 0.0))
    # The side leaves the line of the centres by the angle with these legs.
    return length, angle_of(y * length + x * grows, y * grows - x * length)


def bulged(
    arcs: Sequence[Arc], k: int, radius: float, part: str = "arc", corner: bool | None = None
) -> tuple[Arc, ...]:
    """Return an outline with an arc in place of a straight side, which joins the arcs at its ends smoothly.

    A rod becomes the segment of docs/physics.md, section 1; a hull of circles becomes a sled on bent runners.

    Parameters
    ----------
    arcs : sequence of Arc
        The outline.
    k : int
        The arc that the side follows clockwise.
    radius : float
        Of the new arc [m].
    part : str
        Its name.
    corner : bool, optional
        Whether ``ContactLaw.corner_rolling_arm`` holds for it.

    Returns
    -------
    tuple of Arc

    Raises
    ------
    ValueError
        If the radius is so small that the new arc would go beyond the arcs at its ends.
    """
    if not 0 <= k < len(arcs) or len(arcs) < 2:
        raise ValueError(f"k = {k!r}: no straight side follows this one of {len(arcs)} arcs")
    one, other = arcs[k], arcs[(k + 1) % len(arcs)]
    x, y, grows = other.x - one.x, other.y - one.y, other.radius - one.radius
    apart = math.hypot(x, y)
    near, far = radius - one.radius, radius - other.radius
    along = 0.5 * (apart + grows * (near + far) / apart)
    if not near >= abs(along):
        raise ValueError(f"radius = {radius!r}: too small to join the arcs {k} and {(k + 1) % len(arcs)}")
    inward = math.sqrt((near - along) * (near + along))
    new = Arc(
        one.x + (along * x + inward * y) / apart,
        one.y + (along * y - inward * x) / apart,
        radius,
        0.0,
        part,
        corner=corner,
    )
    begin = angle_of(new.x - one.x, new.y - one.y)
    end = angle_of(new.x - other.x, new.y - other.y)
    before, side, after = _ahead(begin, one.begin), turn_of(arcs, k), _ahead(end, other.begin)
    if not (far > 0.0 and 0.0 < before < side and 0.0 < after < turn_of(arcs, (k + 1) % len(arcs))):
        raise ValueError(f"radius = {radius!r}: too small to join the arcs {k} and {(k + 1) % len(arcs)}")
    left = [arc for arc in arcs if arc is not other]
    return in_order([*left, other._replace(begin=end), new._replace(begin=begin)])


def mass_properties(arcs: Sequence[Arc]) -> tuple[float, tuple[float, float], float]:
    """Area of an outline, its centroid and its moment of inertia, in closed form: docs/physics.md, section 8.

    The outline is put together from triangles between the ends of its arcs and from the segments between arcs and their
    chords. No term is negative, so that no digits are lost to a flat arc, whose centre is far away.

    Parameters
    ----------
    arcs : sequence of Arc
        In any frame.

    Returns
    -------
    area : float
        [m^2]
    centroid : tuple of float
        x, y [m] in the frame of the arcs.
    inertia : float
        Polar moment about the centroid of a uniform lamina, over its mass [m^2].

    Raises
    ------
    ValueError
        If the outline has no area.
    """
    x, y, r, begin = columns(arcs)
    half = 0.5 * np.array([turn_of(arcs, k) for k in range(len(arcs))])
    ends = np.empty((len(arcs), 2, 2))  # of each arc: first and last point
    for i, angle in enumerate((begin, begin + 2.0 * half)):
        sine, cosine = sines_and_cosines(angle)
        ends[:, i] = np.column_stack([x - r * sine, y - r * cosine])
    sine, cosine = sines_and_cosines(begin + half)
    area, height, inertia = segment_moments(half)
    outward = -np.column_stack([sine, cosine]) * (r * height)[:, np.newaxis]
    areas, centres, inertias = _triangles(ends.reshape(-1, 2))
    areas = np.append(areas, area * r**2)
    total = math.fsum(areas)
    if not total > 0.0:
        raise ValueError(f"arcs have an area of {total!r} m^2: must be > 0")
    centres = np.vstack([centres, ends.mean(axis=1) + outward])
    centroid = math.fsum(areas * centres[:, 0]) / total, math.fsum(areas * centres[:, 1]) / total
    squares = (centres[:, 0] - centroid[0]) ** 2 + (centres[:, 1] - centroid[1]) ** 2
    return total, centroid, math.fsum(areas * (np.append(inertias, inertia * r**2) + squares)) / total


def _triangles(points: Floats) -> tuple[Floats, Floats, Floats]:
    """Areas, centroids and inertias over mass of the triangles of a convex polygon, clockwise, around its middle."""
    middle = points.mean(axis=0)
    one = points - middle
    other = np.roll(one, -1, axis=0)
    areas = 0.5 * (one[:, 1] * other[:, 0] - one[:, 0] * other[:, 1])
    squares = sum((side**2).sum(axis=1) for side in (one, other, other - one))
    return areas, middle + (one + other) / 3.0, squares / 36.0


def segment_moments(alpha: Floats) -> tuple[Floats, Floats, Floats]:
    """Areas of segments of half-angles (N,), heights of their centroids above the chord, and inertias over mass.

    All for a radius of 1. They are sums over strips along the chord, of which no term is negative: no digits are lost
    where the half-angle is small, and 16 nodes are exact but for rounding up to a full disc.
    """
    angle = alpha[:, np.newaxis]
    t = 0.5 * angle * (1.0 + _NODES)  # the strip at cos(t) from the centre of the arc, half as wide as sin(t)
    half, high, low = (sines_and_cosines(one)[0] for one in (t, 0.5 * (angle + t), 0.25 * angle * (1.0 - _NODES)))
    above = 2.0 * high * low  # the chord
    share = _WEIGHTS * half**2
    area = alpha * share.sum(axis=1)
    share = _WEIGHTS * (half / half.max(axis=1, keepdims=True)) ** 2
    share /= share.sum(axis=1, keepdims=True)
    height = (share * above).sum(axis=1)
    inertia = (share * ((above - height[:, np.newaxis]) ** 2 + half**2 / 3.0)).sum(axis=1)
    return area, height, inertia
