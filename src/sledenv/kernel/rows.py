"""Arithmetic of power series in straight-line programs: a row of coefficients, as three vectors of eight."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from sledenv.kernel.state import WIDTH
from sledenv.kernel.trace import absolute, block, element, fma, repeated, shuffled, side_by_side

EIGHT = 8
TERMS = 19  # of a series; zeros fill up its row to WIDTH
COUNT = np.arange(WIDTH + 0.0).reshape(-1, EIGHT)  # place of each number of a row
_VARIABLE = np.minimum(COUNT[0], 1.0)  # without the constant term,
_LATER = np.where(COUNT[0] > 1.0, 1.0, 0.0)  # and without the linear one
_EVEN, _ODD = range(0, 2 * EIGHT, 2), range(1, 2 * EIGHT, 2)


def powers(s: Any) -> list[Any]:
    """Powers of ``s`` from 0 on."""
    square = s * s
    fourth = square * square
    two = side_by_side(1.0, s)
    four = shuffled(two, two * repeated(square, 2), range(4))
    first = shuffled(four, four * repeated(fourth, 4), range(EIGHT))
    eighth = repeated(fourth * fourth, EIGHT)
    second = first * eighth
    return [first, second, second * eighth]


def without_constant(row: Sequence[Any]) -> list[Any]:
    """Row without the constant term."""
    return [row[0] * _VARIABLE, *row[1:]]


def read(series: Any) -> list[Any]:
    """Row of a series."""
    return [block(series, i, EIGHT) for i in range(0, WIDTH, EIGHT)]


def of(numbers: Sequence[Any]) -> list[Any]:
    """Row of up to WIDTH numbers, with zeros behind them."""
    padded = [*numbers, *([0.0] * (WIDTH - len(numbers)))]
    return [side_by_side(*padded[i : i + EIGHT]) for i in range(0, WIDTH, EIGHT)]


def apart(pairs: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """Rows of the first and of the second numbers of up to WIDTH pairs."""
    joined = [*pairs, *([np.zeros(2)] * (WIDTH - len(pairs)))]
    for count in (4, EIGHT):
        joined = [shuffled(a, b, range(count)) for a, b in zip(joined[::2], joined[1::2], strict=True)]
    fours = list(zip(joined[::2], joined[1::2], strict=True))
    return [shuffled(a, b, _EVEN) for a, b in fours], [shuffled(a, b, _ODD) for a, b in fours]


def times(row: Sequence[Any], other: Any) -> list[Any]:
    """Products of the numbers of two rows, place by place."""
    return [a * b for a, b in zip(row, other, strict=True)]


def moved_on(row: Sequence[Any], first: Any) -> list[Any]:
    """Row with each number one place further, and a new first one."""
    behind = [repeated(first, EIGHT), *row]
    return [shuffled(a, b, range(EIGHT - 1, 2 * EIGHT - 1)) for a, b in pairwise(behind)]


def moved_back(row: Sequence[Any], numbers: Sequence[Any]) -> list[Any]:
    """Row of ``numbers``, whose first are those of a row without its first one."""
    return [*(shuffled(a, b, range(1, EIGHT + 1)) for a, b in pairwise(row)), of(numbers)[-1]]


def with_first(row: Sequence[Any], first: Any) -> list[Any]:
    """Row with another first number."""
    return [shuffled(row[0], repeated(first, EIGHT), (EIGHT, *range(1, EIGHT))), *row[1:]]


def added(row: Sequence[Any]) -> Any:
    """Sum of a row, in eight parts: see :func:`sledenv.kernel.trace.sums`."""
    return row[0] + row[1] + row[2]


def sizes(row: Sequence[Any]) -> Any:
    """What the absolute values of a row add up to from the third on, in eight parts."""
    return absolute(row[0] * _LATER) + absolute(row[1]) + absolute(row[2])


def values(series: Any, terms: int, s: Any) -> Any:
    """Values of the first terms of a series at eight places."""
    square = s * s
    chains = []
    for first in (0, 1):
        chain: Any = None
        for k in reversed(range(first, terms, 2)):
            coefficient = repeated(series[k], EIGHT)
            chain = coefficient if chain is None else fma(chain, square, coefficient)
        chains.append(chain)
    return fma(chains[1], s, chains[0])


def sums_from(row: Sequence[Any]) -> list[Any]:
    """Sum of each number of a row and all behind it."""
    found: list[Any] = []
    for part in reversed(row):
        for shift in (1, 2, 4):
            part = part + shuffled(part, np.zeros(EIGHT), range(shift, shift + EIGHT))
        found.insert(0, part if not found else part + repeated(element(found[0], 0), EIGHT))
    return found
