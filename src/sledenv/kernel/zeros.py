"""The guaranteed first zero of a polynomial: no earlier one is passed over."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.contacts import DEEPEST, ORDER, WIDTH

# Bernstein coefficients of degree ORDER of the powers of a variable in [0, 1].
_BERNSTEIN: Final = np.array(
    [[math.comb(j, k) / math.comb(ORDER, k) if k <= j else 0.0 for k in range(ORDER + 1)] for j in range(ORDER + 1)]
)
_ENDS: Final = 4e-16  # of a zero: it has been found
_NARROW: Final = 1e-12  # part of the step: two zeros as near as this are one
NONE: Final = 1e300  # no zero


@kernel
def first_zero(p: np.ndarray, end: float, zeros: int, stack: np.ndarray) -> float:
    """First time in [0, end) at which a polynomial is no longer positive that is positive at first; NONE if never.

    Parameters
    ----------
    p : ndarray, shape (ORDER + 1,)
        Its coefficients, in time [s].
    end : float
        How far it is looked at [s].
    zeros : int
        Number of leading coefficients that are zero by construction: what is left is divided by that power of time.
    stack : ndarray, shape (DEEPEST, WIDTH + 2)
        Work space; its first row takes the coefficients in units of ``end``.
    """
    q = stack[0]
    power, fall, rise, whole = 1.0, 0.0, 0.0, 0.0
    for _ in range(zeros):
        power *= end
    m = ORDER - zeros
    for k in range(m + 1):
        term = p[k + zeros] * power
        q[k] = term
        whole += term
        if k > 0:
            fall += min(term, 0.0)
        power *= end
    if q[0] + fall > 0.0:
        return NONE
    if q[0] <= 0.0:
        return NONE if q[0] == 0.0 and whole == 0.0 and fall == 0.0 else 0.0  # of nothing at all, or the first time
    if _lowest(q[0], q[1], q[2]) + (fall - min(q[1], 0.0) - min(q[2], 0.0)) > 0.0:
        return NONE
    for k in range(1, m + 1):
        rise += k * max(q[k], 0.0)
    if q[1] < 0.0 and rise + q[1] < 0.0:  # it falls throughout
        return NONE if whole > 0.0 else end * _refine(q, m, 0.0, 1.0, q[0] / (q[0] - whole))
    for k in range(m + 1, ORDER + 1):
        q[k] = 0.0
    return _by_halves(m, end, stack)


@kernel
def _lowest(a: float, b: float, c: float) -> float:
    """Lowest value of ``a + b t + c t^2`` for t in [0, 1]."""
    if c > 0.0 and -2.0 * c < b < 0.0:
        return a - b * b / (4.0 * c)
    return min(a, a + b + c)


@kernel
def _refine(q: np.ndarray, m: int, low: float, high: float, guess: float) -> float:
    """Zero of a polynomial that is positive at ``low`` and not at ``high``: Newton's method within its bracket."""
    t = guess
    for _ in range(80):
        value, rate = 0.0, 0.0
        for k in range(m, -1, -1):
            rate = rate * t + value
            value = value * t + q[k]
        if value > 0.0:
            low = t
        else:
            high = t
        then = t - value / rate if rate != 0.0 else low
        if not low <= then <= high:
            then = 0.5 * (low + high)
        if abs(then - t) <= _ENDS * abs(t):
            break
        t = then
    return t


@kernel
def _changes(row: np.ndarray) -> int:
    """How often the sign changes among Bernstein coefficients: there are no more zeros than that."""
    changes, last = 0, row[0]
    for j in range(1, ORDER + 1):
        if row[j] != 0.0:
            if (row[j] > 0.0) != (last > 0.0):
                changes += 1
            last = row[j]
    return changes


@kernel
def _halve(row: np.ndarray, left: np.ndarray, right: np.ndarray) -> None:
    """Write the Bernstein coefficients of both halves of an interval; ``right`` may be the row itself."""
    for j in range(ORDER + 1):
        left[j] = row[j]
    for r in range(ORDER + 1):
        right[ORDER - r] = left[ORDER]
        for j in range(ORDER, r, -1):
            left[j] = 0.5 * (left[j] + left[j - 1])


@kernel
def _by_halves(m: int, end: float, stack: np.ndarray) -> float:
    """First zero, where Bernstein coefficients of ever smaller halves prove that there is none before."""
    q, row = stack[0], stack[1]
    for j in range(ORDER + 1):
        total = 0.0
        for k in range(j + 1):
            total += _BERNSTEIN[j, k] * q[k]
        row[j] = total
    row[WIDTH], row[WIDTH + 1] = 0.0, 1.0
    depth = 1
    while depth > 0:
        row = stack[depth]
        low, high = row[WIDTH], row[WIDTH + 1]
        depth -= 1
        if row[0] <= 0.0:
            return float(low * end)
        changes = _changes(row)
        if changes == 0:
            continue
        if changes == 1:
            return end * _refine(q, m, low, high, 0.5 * (low + high))
        if high - low < _NARROW or depth + 3 > DEEPEST - 1:
            return float(low * end)
        # The left half comes next: it lies on top.
        middle = 0.5 * (low + high)
        left, right = stack[depth + 2], stack[depth + 1]
        _halve(row, left, right)
        right[WIDTH], right[WIDTH + 1] = middle, high
        left[WIDTH], left[WIDTH + 1] = low, middle
        depth += 2
    return NONE
