"""Area, centroid and moment of inertia of an outline, in closed form."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np

from sledenv.simulation.outlines import Arc, Floats, columns, directions, turn_of


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
        sine, cosine = directions(angle)
        ends[:, i] = np.column_stack([x - r * sine, y - r * cosine])
    sine, cosine = directions(begin + half)
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


@functools.cache
def _nodes() -> tuple[Floats, Floats]:
    nodes, weights = np.polynomial.legendre.leggauss(16)
    return nodes, weights


def segment_moments(alpha: Floats) -> tuple[Floats, Floats, Floats]:
    """Areas of segments of half-angles (N,), heights of their centroids above the chord, and inertias over mass.

    All for a radius of 1. They are sums over strips along the chord, of which no term is negative: no digits are lost
    where the half-angle is small, and 16 nodes are exact but for rounding up to a full disc.
    """
    angle = alpha[:, np.newaxis]
    nodes, weights = _nodes()
    t = 0.5 * angle * (1.0 + nodes)  # the strip at cos(t) from the centre of the arc, half as wide as sin(t)
    half, _ = directions(t)
    above = 2.0 * directions(0.5 * (angle + t))[0] * directions(0.25 * angle * (1.0 - nodes))[0]  # the chord
    share = weights * half**2
    area = alpha * share.sum(axis=1)
    share = weights * (half / half.max(axis=1, keepdims=True)) ** 2
    share /= share.sum(axis=1, keepdims=True)
    height = (share * above).sum(axis=1)
    inertia = (share * ((above - height[:, np.newaxis]) ** 2 + half**2 / 3.0)).sum(axis=1)
    return area, height, inertia
