"""The ground as kernels read it: pieces of profiles, of one lane or of many."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.entries import run_build_each, run_build_pieces, run_heights
from sledenv.kernel.geometry import PIECE

Floats = NDArray[np.float64]


def pieces_of(vertices: Floats) -> np.ndarray:
    """Return the pieces of ground with their bends, kernel.geometry.PIECE of shape (n + 1,), of (n, 3) vertices."""
    pieces = np.zeros(len(vertices) + 1, PIECE)
    run_build_pieces(vertices, pieces)
    return pieces


def heights_on(pieces: np.ndarray, x: Floats) -> Floats:
    """Heights [m] of the ground at places [m], of any shape."""
    heights = np.empty(np.shape(x))
    run_heights(pieces, np.ascontiguousarray(x, float).reshape(-1), heights.reshape(-1))
    return heights


@functools.cache
def plane() -> np.ndarray:
    """Return the one piece of ground of a plane, which nobody writes to."""
    return pieces_of(np.empty((0, 3)))


class Grounds(NamedTuple):
    """Ground of many lanes."""

    pieces: np.ndarray  # of kernel.geometry.PIECE
    places: Floats  # of the first piece of each lane, and of the one behind its last, shape (1 or N, 2)

    @classmethod
    def of(cls, vertices: Sequence[Floats], numbers: Iterable[int] | None = None) -> Self:
        """Return the ground of vertices of shapes (n, 3), one for all lanes, or those that lanes have by number."""
        if not vertices:
            return cls(plane(), np.empty((0, 2)))
        if len(vertices) == 1:
            pieces = pieces_of(vertices[0]) if len(vertices[0]) else plane()
            return cls(pieces, np.array([[0.0, len(pieces)]]))
        ends = np.cumsum([len(one) + 1 for one in vertices])
        places, pieces = np.stack([np.r_[0, ends[:-1]], ends], axis=-1).astype(float), np.zeros(ends[-1], PIECE)
        run_build_each(np.concatenate(vertices), places, pieces)
        return cls(pieces, places if numbers is None else places[list(numbers)])

    @classmethod
    def drawn(cls, vertices: Floats) -> Self:
        """Return the ground of vertices of shape (N, M, 3), inf behind the last one of each; each has M + 1 places."""
        count, most = vertices.shape[:2]
        there = np.isfinite(vertices[..., 0]).sum(axis=1)
        pieces, begins = np.zeros(count * (most + 1), PIECE), np.arange(count) * (most + 1.0)
        places = np.stack([begins, begins + there + 1.0], axis=-1)
        run_build_each(vertices.reshape(-1, 3), places, pieces)
        return cls(pieces, places)
