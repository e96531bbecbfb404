"""Bumps and errors that whole numbers draw, of many contexts at once.

The vertices of N grounds are an array of shape (N, M, 3), columns x, y and the radius with which each is rounded [m].
Where a ground has fewer than M, the rest of its row is inf.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.scenarios.configuration import Pair
from sledenv.simulation.support import directions

Floats = NDArray[np.float64]


TRACKS: Final = 2**32  # how many numbers there are, each of which draws a track
LEAST: Final = 1e-3  # [m] shorter pieces are left out

_GOLDEN = 0x9E3779B97F4A7C15
_MIX = (30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)


class Bumps(NamedTuple):
    """Lowest and highest numbers [m] of what each bump of a track is drawn from."""

    gap: Pair  # level ground before the bump
    face: Pair  # length along the slope on which it rises
    top: Pair  # level ground on it
    back: Pair | None  # length on which it falls; that of its face if None
    height: Pair
    begin: float  # where the first gap begins
    end: float  # behind which there is no bump
    rounding: float = 0.0  # of all vertices

    @property
    def longest(self) -> float:
        """How far [m] one bump may reach along the slope, its gap included."""
        return self.gap[1] + self.face[1] + self.top[1] + (self.back or self.face)[1]

    def draw(self, tracks: NDArray[np.float64]) -> Floats:
        """Return the vertices of tracks of given numbers, whole ones in [0, 2^32), shapes (N,) and (N, M, 3).

        The same number is the same track on every machine: SplitMix64 turns it into numbers in [0, 1), of which each
        bump takes five, and all else is plain arithmetic. As many bumps follow each other as end before ``end``. A gap
        or a top of less than a millimetre is none.
        """
        count = self.most()
        ranges = np.array([self.gap, self.face, self.top, self.back or self.face, self.height])
        low, high = ranges.T
        drawn = np.minimum(low + (high - low) * _uniform(tracks, len(ranges) * count).reshape(-1, count, 5), high)
        if self.back is None:
            drawn[..., 3] = drawn[..., 1]
        lengths = np.where(drawn[..., :4] < LEAST, 0.0, drawn[..., :4]).reshape(len(drawn), -1)
        x = np.cumsum(np.column_stack([np.full(len(drawn), self.begin), lengths]), axis=1)
        y = drawn[..., 4:] * (0.0, 1.0, 1.0, 0.0)
        fits = np.repeat(x[:, 4::4] <= self.end, 4, axis=1)
        # Without a gap or a top, two vertices are one.
        kept = fits & np.c_[np.ones(len(x), bool), x[:, 2:] > x[:, 1:-1]]
        return _packed(x[:, 1:], y.reshape(len(drawn), -1), self.rounding, kept)

    def most(self) -> int:
        """Return how many bumps there can be."""
        shortest = self.gap[0] + self.face[0] + self.top[0] + (self.back or self.face)[0]
        return max(int((self.end - self.begin) / shortest) + 1, 0)


def standard_normals(numbers: Floats, decisions: NDArray[np.int64]) -> Floats:
    """Return the normal deviates that whole numbers in [0, 2^32) mean at decisions in [0, 2^20), shapes (N,).

    They have nothing to do with the bumps of the same numbers, and are the same on every machine.
    """
    first, second = _uniform(numbers + float(TRACKS) * (decisions + 1.0), 2).T
    return normal_pairs(first, second)[0]


def normal_pairs(first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """Return two independent normal deviates for each two numbers in [0, 1), all of shape (N,): Box and Muller."""
    length = np.sqrt(-2.0 * _logarithms(1.0 - first))
    cosine, sine = directions(2.0 * np.pi * second)
    return length * cosine, length * sine


def _logarithms(values: Floats) -> Floats:
    """Return natural logarithms of positive numbers by plain arithmetic, so that every machine has the same bits."""
    mantissa, exponent = np.frexp(values)
    low = mantissa < math.sqrt(0.5)
    mantissa, exponent = np.where(low, 2.0 * mantissa, mantissa), exponent - low
    ratio = (mantissa - 1.0) / (mantissa + 1.0)  # at most 0.172: log m = 2 artanh of it
    square, series = ratio * ratio, np.zeros(len(values))
    for k in range(21, 0, -2):
        series = series * square + 1.0 / k
    logarithms: Floats = exponent * math.log(2.0) + 2.0 * ratio * series
    return logarithms


def _packed(x: Floats, y: Floats, rounding: float, kept: NDArray[np.bool_]) -> Floats:
    """Return the vertices that are kept, one behind the other, with one radius: shapes (N, K) and (N, M, 3)."""
    counts = np.cumsum(kept, axis=1)
    rows, columns = np.nonzero(kept)
    vertices = np.full((len(x), int(counts[:, -1].max(initial=0)) if kept.shape[1] else 0, 3), np.inf)
    vertices[rows, counts[rows, columns] - 1] = np.column_stack([x[kept], y[kept], np.full(len(rows), rounding)])
    return vertices


def _uniform(seeds: Floats, count: int) -> Floats:
    """Return as many numbers in [0, 1) of each of N seeds, whole ones in [0, 2^64): SplitMix64, shape (N, count)."""
    start = _mixed(seeds.astype(np.uint64) + np.uint64(_GOLDEN))  # so that neighbours are nothing alike
    steps = np.arange(1, count + 1, dtype=np.uint64) * np.uint64(_GOLDEN)
    drawn: Floats = (_mixed(start[:, np.newaxis] + steps) >> np.uint64(11)).astype(np.float64) * 2.0**-53
    return drawn


def _mixed(words: NDArray[np.uint64]) -> NDArray[np.uint64]:
    for shift, factor in _MIX:
        words = (words ^ (words >> np.uint64(shift))) * np.uint64(factor)
    return words ^ (words >> np.uint64(31))
