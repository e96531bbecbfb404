"""Vectors in straight-line programs, and power series as rows of coefficients: three vectors of eight each."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np
from llvmlite import ir

from sledenv.compiler.trace import block
from sledenv.compiler.values import DOUBLE, Value, absolute, constant, fma

EIGHT = 8
WIDTH: Final = 24  # numbers of a series: three vectors of eight
TERMS = 19  # of a series; zeros fill up its row to WIDTH
COUNT = np.arange(WIDTH + 0.0).reshape(-1, EIGHT)  # place of each number of a row
_VARIABLE = np.minimum(COUNT[0], 1.0)  # without the constant term,
_LATER = np.where(COUNT[0] > 1.0, 1.0, 0.0)  # and without the linear one
_EVEN, _ODD = range(0, 2 * EIGHT, 2), range(1, 2 * EIGHT, 2)
# Gauss's rule with eight nodes on [0, 1]; written out, so that the bits do not depend on the version of a library.
_LOWER = [0.019855071751231884, 0.10166676129318664, 0.2372337950418355, 0.4082826787521751]
_UPPER = [0.591717321247825, 0.7627662049581645, 0.8983332387068134, 0.9801449282487681]
NODES = np.array(_LOWER + _UPPER)
_RISING = [0.05061426814518813, 0.11119051722668724, 0.15685332293894363, 0.181341891689181]
WEIGHTS = np.array(_RISING + _RISING[::-1])


def side_by_side(*numbers: Any) -> Any:
    """Vector of some numbers."""
    builder = next((number.builder for number in numbers if isinstance(number, Value)), None)
    if builder is None:
        return np.array(numbers)
    known = [0.0 if isinstance(number, Value) else float(number) for number in numbers]
    vector: Any = constant(ir.VectorType(DOUBLE, len(numbers)), known)
    for i, number in enumerate(numbers):
        if isinstance(number, Value):
            vector = builder.insert_element(vector, number.value, ir.Constant(ir.IntType(32), i))
    return Value(builder, vector)


def repeated(number: Any, count: int) -> Any:
    """Vector of the same number."""
    return shuffled(side_by_side(number), None, [0] * count)


def shuffled(a: Any, b: Any, places: Sequence[int]) -> Any:
    """Vector of the elements of ``a`` and then ``b`` at some places; ``b`` may be None."""
    if isinstance(b, Value):
        a = Value(b.builder, b.lift(a))
    if not isinstance(a, Value):
        return (a if b is None else np.concatenate([a, b]))[list(places)]
    mask = ir.Constant(ir.VectorType(ir.IntType(32), len(places)), list(places))
    other = ir.Constant(a.value.type, ir.Undefined) if b is None else a.lift(b)
    return a.make(a.builder.shuffle_vector(a.value, other, mask))


def element(vector: Any, i: int) -> Any:
    """Number at a place of a vector."""
    if not isinstance(vector, Value):
        return vector[i]
    return vector.make(vector.builder.extract_element(vector.value, ir.Constant(ir.IntType(32), i)))


# Sums of eight vectors of eight at once: each step adds two halves of which neither leaves its 128 bits until it must.
_FOLDS = (
    ((0, 8, 2, 10, 4, 12, 6, 14), (1, 9, 3, 11, 5, 13, 7, 15)),
    ((0, 1, 8, 9, 4, 5, 12, 13), (2, 3, 10, 11, 6, 7, 14, 15)),
    ((0, 1, 2, 3, 8, 9, 10, 11), (4, 5, 6, 7, 12, 13, 14, 15)),
)


def sums(vectors: Sequence[Any]) -> list[Any]:
    """Sum of the elements of each of some vectors of eight."""
    found = []
    for first in range(0, len(vectors), 8):
        part = list(vectors[first : first + 8])
        count = len(part)
        part += [part[0]] * (8 - count)
        for low, high in _FOLDS:
            part = [shuffled(a, b, low) + shuffled(a, b, high) for a, b in zip(part[::2], part[1::2], strict=True)]
        found += [element(part[0], i) for i in range(count)]
    return found


# Rows.


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
    """Sum of a row, in eight parts: see :func:`sums`."""
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
