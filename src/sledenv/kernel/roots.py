"""First root of a power series on a step, certified: docs/physics.md, section 10."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from sledenv.compiler import rows
from sledenv.compiler.jit import kernel
from sledenv.compiler.rows import EIGHT, TERMS, WIDTH, element, repeated, shuffled, side_by_side, sums
from sledenv.compiler.trace import block, scalar, write_series
from sledenv.compiler.values import absolute, fma, smaller, where_less

UNIT = 2.3e-16
MOST_ITERATIONS = 1000
PATIENCE = 12
CLOSE = 3e-17  # error of a root [units of the variable] that counts as rounding
MOST_APPROACHES = 5  # to a root


def _value(coefficients: Sequence[Any], s: Any) -> Any:
    """Value of a polynomial, in four chains that run side by side."""
    square = s * s
    fourth = square * square
    chains = []
    for first in range(4):
        terms = coefficients[first::4]
        chain = terms[-1]
        for term in reversed(terms[:-1]):
            chain = fma(chain, fourth, term)
        chains.append(chain)
    return fma(fma(chains[3], s, chains[2]), square, fma(chains[1], s, chains[0]))


def _value_of_row(q: Any, s: Any) -> tuple[Any]:
    """Value of a series of TERMS numbers, with the bits of :func:`_value`: its chains run two by two, as vectors."""
    square = s * s
    fourth = square * square
    pairs, last = repeated(fourth, 2), TERMS - 3  # the fourth chain has a term less than the others
    lower = block(q, last, 2)
    upper = side_by_side(fma(q[last + 2], fourth, q[last - 2]), q[last - 1])
    for first in range(last - 4, -1, -4):
        lower = fma(lower, pairs, block(q, first, 2))
    for first in range(last - 6, 0, -4):
        upper = fma(upper, pairs, block(q, first, 2))
    both = fma(shuffled(lower, upper, (1, 3)), repeated(s, 2), shuffled(lower, upper, (0, 2)))
    return (fma(element(both, 1), square, element(both, 0)),)


_at = scalar(_value_of_row)


@kernel
def horner(series: np.ndarray, t: float) -> float:
    """Value of a power series of TERMS numbers at ``t``, by Horner's rule in four chains."""
    return _at(series, t)[0]


def _approach(q: Any, s: Any) -> tuple[Any, ...]:
    """Come closer to a root of a series by Chebyshev's method, of third order.

    Besides the new place: the step of Newton's method, which is zero at a root only (that of this method also where its
    two parts cancel), and the error that is left if it was close.
    """
    series = [q[k] for k in range(TERMS)]
    rate = [float(k) * series[k] for k in range(1, TERMS)]
    bend = [float(k) * rate[k] for k in range(1, TERMS - 1)]
    per_slope = 1.0 / _value(rate, s)
    step = _value(series, s) * per_slope
    bent = step * _value(bend, s) * per_slope
    return s - fma(0.5 * step, bent, step), step, absolute(step) * fma(step, step, bent * bent)


def _certificate(q: Any, s: Any) -> tuple[Any, ...]:
    """Number that is positive if a root of a series is known to be its first: docs/physics.md, 10.1.

    The series is (t - s) B, and its root is the first if B has none in [0, s]. There the coefficients of B, times the
    powers of s, are the sums of all later terms.
    """
    later = rows.sums_from(rows.times(rows.read(q), rows.powers(s)))
    first, second = element(later[0], 1), element(later[0], 2)
    (rest,) = sums([rows.sizes(later)])
    against = where_less(first, 0.0, -second, second)
    return (absolute(first) + smaller(against, 0.0) - (rest - absolute(second)),)


def _scaling(q: Any, step: Any) -> tuple[Any, ...]:
    """Make the interval of a series [0, 1]; sizes of all terms and of those from the quadratic one on, and its end."""
    row = rows.times(rows.read(q), rows.powers(step))
    write_series(q, row)
    return tuple(sums([rows.added([absolute(part) for part in row]), rows.sizes(row), rows.added(row)]))


_SECOND = rows.COUNT * (rows.COUNT - 1.0)


def _bending(q: Any, end: Any) -> tuple[Any, ...]:
    """Bound on the second derivative of a series on [0, end]."""
    row = [absolute(part) for part in rows.times(rows.read(q), rows.powers(end))]
    return (sums([rows.added(rows.times(row, _SECOND))])[0] / (end * end),)


def _climbing(q: Any, s: Any) -> tuple[Any, ...]:
    """Value and slope of a series at ``s`` > 0."""
    row = rows.times(rows.read(q), rows.powers(s))
    value, slope = sums([rows.added(row), rows.added(rows.times(row, rows.COUNT))])
    return value, slope / s


def _shifting(q: Any) -> tuple[Any, ...]:
    """Divide a series by its variable, without its constant term, which is returned."""
    row = rows.read(q)
    later = [*row[1:], np.zeros(EIGHT)]
    write_series(q, [shuffled(a, b, range(1, EIGHT + 1)) for a, b in zip(row, later, strict=True)])
    return (element(row[0], 0),)


_shift = scalar(_shifting)
_scaled, _bent, _value_and_slope = scalar(_scaling), scalar(_bending), scalar(_climbing)
_certainty = scalar(_certificate)


_closer = scalar(_approach)


@kernel
def locate(q: np.ndarray, guess: float, most: float) -> float:
    """Root of a series of TERMS numbers near a guess and up to some place, if it is surely the first one; else -1."""
    s = guess
    before = most
    for _ in range(MOST_APPROACHES):
        s, step, error = _closer(q, s)
        if not abs(step) < before:
            return -1.0
        before = 0.25 * abs(step)
        if error <= CLOSE:
            return s if 0.0 < s <= most and _certainty(q, s)[0] > 0.0 else -1.0
    return -1.0


@kernel
def _drop(q: np.ndarray, count: int) -> None:
    """Divide a series by its variable to the power ``count``: its leading coefficients are taken for zero."""
    for _ in range(count):
        _shift(q)


@kernel
def _scale(q: np.ndarray, step: float) -> tuple[float, float, float]:
    """Make the interval of a series [0, 1]; see the program."""
    return _scaled(q, step)  # type: ignore[return-value]


@kernel
def _curvature(q: np.ndarray, end: float) -> float:
    """Bound on the second derivative of a series on [0, end]."""
    return _bent(q, end)[0]


@kernel
def first_root(q: np.ndarray, step: float, vanishing: int, noise: float) -> float:
    """First t in [0, step] at which a series that starts positive becomes negative, inf if it stays positive.

    Parameters
    ----------
    q : ndarray, shape (WIDTH,)
        Coefficients, zeros from TERMS on; overwritten.
    step : float
        End of the interval.
    vanishing : int
        Number of leading coefficients that are zero by construction (a velocity that has just left zero, say): they
        are dropped, or their rounding error would be taken for a root.
    noise : float
        Absolute rounding error of the leading coefficient.

    Returns
    -------
    float
        The root; 0 if the series starts negative or turns negative at once.
    """
    if vanishing > 0:
        if not step > 0.0:
            return math.inf
        _drop(q, vanishing)
        noise = 0.0
    size, rest, last = _scale(q, step)
    tiny = 4.0 * UNIT * size
    first = 0
    while first < WIDTH and abs(q[first]) <= (tiny + noise if first == 0 else tiny):
        first += 1
    if first == WIDTH:
        return math.inf
    if q[first] < 0.0:
        return 0.0
    if first > 0:
        _drop(q, first)
        _, rest, last = _scale(q, 1.0)
    value, slope = q[0], q[1]
    if value + min(slope, 0.0) - rest > 0.0:
        return math.inf
    if last < -tiny:  # there is a root; what lies straight ahead is nearly always the first
        at = locate(q, value / (value - last), 1.0)
        if at > 0.0:
            return at * step
    # |second derivative| <= curvature on [0, end]: go to the first root of the parabola below the series, which is
    # never past a root of the series itself. Where that takes long the bound is too wide: shorten its interval.
    s = 0.0
    end = 1.0
    curvature = _curvature(q, end)
    for i in range(MOST_ITERATIONS):
        if i % PATIENCE == PATIENCE - 1 and 2.0 * s < end:
            end = 2.0 * s
            curvature = _curvature(q, end)
        root = math.sqrt(slope * slope + 2.0 * curvature * value)
        if slope < 0.0:
            s += 2.0 * value / (root - slope)
        elif curvature > 0.0:
            s += (slope + root) / curvature
        else:
            s = 2.0
        if s > end:
            if end == 1.0:
                return math.inf
            s = end
            end = min(1.0, 2.0 * end)
            curvature = _curvature(q, end)
        value, slope = _value_and_slope(q, s)
        if value <= tiny:
            if slope < 0.0:
                s = min(max(s - value / slope, 0.0), 1.0)
            return s * step
    return s * step
