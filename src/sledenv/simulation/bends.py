"""A ground of straight pieces and arcs, told by vertices with radii: its bends, its pieces and its heights.

Arithmetic is plain, without a mathematical library, so that every machine has the same bits.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

MOST_VERTICES: Final = 16384
STEEPEST: Final = math.radians(80.0)  # of a piece, to the plane
LARGEST_SHARE: Final = 0.49  # of a straight piece that the bend at one of its ends may take


class Bends(NamedTuple):
    """Arcs in the place of m vertices: each that touches both pieces next to it."""

    signs: Floats  # +1 a crest, -1 a dip, 0 where the ground is sharp or does not turn; shape (m,)
    radii: Floats  # [m] of the arcs, 0 where the sign is 0; shape (m,)
    lengths: Floats  # [m] from a vertex back to where its arc begins, and on to where it ends; shape (m,)
    centres: Floats  # [m] of the arcs, the vertex itself where the sign is 0; shape (m, 2)
    begins: Floats  # [m] where the arcs begin; shape (m, 2)
    ends: Floats  # [m] where they end; shape (m, 2)


class Pieces(NamedTuple):
    """Straight pieces and arcs in turn, 2 m + 1 of m vertices, from level ground to level ground."""

    begins: Floats  # [m] x where they begin, -inf of the first; shape (2 m + 1,)
    places: Floats  # [m] a point of each; shape (2 m + 1, 2)
    sines: Floats  # [-] of the slope there
    curvatures: Floats  # [1/m] > 0 in a dip, 0 of what is straight

    def numbers(self, x: Floats) -> Ints:
        """Return which piece is at places x [m], same shape."""
        return np.asarray(np.searchsorted(self.begins, x, side="right") - 1)

    def sines_at(self, x: Floats, k: Ints) -> Floats:
        """Sines of the slope [-] of pieces k at places x [m], same shape."""
        sines: Floats = np.clip(self.sines[k] + self.curvatures[k] * (x - self.places[k, 0]), -1.0, 1.0)
        return sines

    def heights(self, x: Floats, k: Ints) -> Floats:
        """Heights [m] of pieces k at places x [m], same shape; without cancellation however large the radius."""
        first, here = self.sines[k], self.sines_at(x, k)
        along = x - self.places[k, 0]
        heights: Floats = self.places[k, 1] + along * (first + here) / (cosines(first) + cosines(here))
        return heights


def bends(rounded: ArrayLike) -> Bends:
    """Return the arcs that take the place of the vertices of a ground.

    Parameters
    ----------
    rounded : array_like, shape (m, 3)
        Vertices x, y and radii [m], x increasing, radii >= 0. A radius with which an arc would begin or end further
        from its vertex than 0.49 of the shorter piece next to it is made smaller. The level ground before the first
        vertex and behind the last one has no end.

    Examples
    --------
    >>> bends([(0, 0, 1), (4, 3, 0.5), (8, 3, 0)]).lengths.round(4).tolist()
    [0.3333, 0.1667, 0.0]
    """
    table = np.asarray(rounded, float).reshape(-1, 3)
    vertices = table[:, :2]
    turns = half_turns(vertices)
    lengths = np.minimum(table[:, 2] * np.abs(turns), longest(vertices))
    radii = np.divide(lengths, np.abs(turns), out=np.zeros(len(table)), where=lengths > 0.0)
    signs = np.where(lengths > 0.0, -np.sign(turns), 0.0)
    begins, ends = _touched(vertices, lengths)
    upwards = tangents(vertices)[:-1, ::-1] * [-1.0, 1.0]
    return Bends(signs, radii, lengths, begins - (signs * radii)[:, np.newaxis] * upwards, begins, ends)


def height_of(rounded: ArrayLike, x: ArrayLike) -> Floats:
    """Return heights [m] of a ground, told as to :func:`bends`, at places x [m] of any shape, same shape.

    Examples
    --------
    >>> height_of([(0, 0, 1), (4, 3, 0.5), (8, 3, 0)], [-1, 0, 2, 100]).round(4).tolist()
    [0.0, 0.0572, 1.5, 3.0]
    """
    table, places = np.asarray(rounded, float).reshape(-1, 3), np.asarray(x, float)
    if not len(table):
        return np.zeros(places.shape)
    pieces = pieces_of(table[:, :2], bends(table).lengths)
    return pieces.heights(places, pieces.numbers(places))


def pieces_of(vertices: Floats, lengths: Floats) -> Pieces:
    """Return straight pieces and arcs, of vertices of shape (m, 2), m > 0, and the lengths [m] of :class:`Bends`."""
    places = np.empty((2 * len(vertices) + 1, 2))
    places[1::2], places[2::2] = _touched(vertices, lengths)
    places[0] = places[1]
    curvatures = np.zeros(len(places))
    np.divide(half_turns(vertices), lengths, out=curvatures[1::2], where=lengths > 0.0)
    sines = np.repeat(tangents(vertices)[:, 1], 2)[:-1]
    return Pieces(np.r_[-math.inf, places[1:, 0]], places, sines, curvatures)


def _touched(vertices: Floats, lengths: Floats) -> tuple[Floats, Floats]:
    """Return where arcs begin and end, lengths [m] from their vertices, both of shape (m, 2)."""
    ways = tangents(vertices)
    return vertices - lengths[:, np.newaxis] * ways[:-1], vertices + lengths[:, np.newaxis] * ways[1:]


def tangents(vertices: Floats) -> Floats:
    """Unit tangents of the straight pieces, level ones first and last, shape (m + 1, 2); vertices of shape (m, 2)."""
    level, along = np.array([[1.0, 0.0]]), np.diff(vertices, axis=0)
    return np.concatenate([level, along / norms(along)[:, np.newaxis], level])


def norms(vectors: Floats) -> Floats:
    """Return the lengths of vectors of shape (m, 2), shape (m,)."""
    found: Floats = np.sqrt(vectors[:, 0] * vectors[:, 0] + vectors[:, 1] * vectors[:, 1])
    return found


def half_turns(vertices: Floats) -> Floats:
    """Tangent [-] of half the turn at vertices of shape (m, 2): > 0 in a dip, < 0 on a crest; shape (m,)."""
    ways = tangents(vertices)
    (before_x, before_y), (behind_x, behind_y) = ways[:-1].T, ways[1:].T
    sines, cosines = before_x * behind_y - before_y * behind_x, before_x * behind_x + before_y * behind_y
    found: Floats = sines / (1.0 + cosines)
    return found


def longest(vertices: Floats) -> Floats:
    """Return how far [m] from vertices of shape (m, 2) their arcs may begin and end, shape (m,)."""
    pieces = np.r_[math.inf, norms(np.diff(vertices, axis=0)), math.inf]
    found: Floats = LARGEST_SHARE * np.minimum(pieces[:-1], pieces[1:])
    return found


def cosines(sines: Floats) -> Floats:
    """Cosines [-] of slopes, from their sines."""
    found: Floats = np.sqrt((1.0 - sines) * (1.0 + sines))
    return found
