"""First root of a power series on a step, certified: docs/physics.md, section 10."""

from __future__ import annotations

import math

import numpy as np

from sledenv.kernel.jit import kernel

UNIT = 2.3e-16
MOST_ITERATIONS = 1000
PATIENCE = 12


@kernel
def horner(series: np.ndarray, t: float) -> float:
    """Value of a power series at ``t``."""
    value = 0.0
    for k in range(series.shape[0] - 1, -1, -1):
        value = value * t + series[k]
    return value


@kernel
def _curvature(q: np.ndarray, first: int, end: float) -> float:
    """Bound on the second derivative of the series ``q[first:]`` on [0, end]."""
    total = 0.0
    power = 1.0
    for k in range(first + 2, q.shape[0]):
        j = k - first
        total += j * (j - 1) * abs(q[k]) * power
        power *= end
    return total


@kernel
def first_root(q: np.ndarray, step: float, vanishing: int, noise: float) -> float:
    """First t in [0, step] at which a series that starts positive becomes negative, inf if it stays positive.

    Parameters
    ----------
    q : ndarray, shape (order + 1,)
        Coefficients; overwritten.
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
    size = q.shape[0]
    power = 1.0
    total = 0.0
    for k in range(size):
        q[k] *= power
        power *= step
        if k >= vanishing:
            total += abs(q[k])
    tiny = 4.0 * UNIT * total
    first = vanishing
    while first < size and abs(q[first]) <= (tiny + noise if first == 0 else tiny):
        first += 1
    if first == size:
        return math.inf
    if q[first] < 0.0:
        return 0.0
    rest = 0.0
    for k in range(first + 2, size):
        rest += abs(q[k])
    slope = q[first + 1] if first + 1 < size else 0.0
    if q[first] + min(slope, 0.0) - rest > 0.0:
        return math.inf
    # |second derivative| <= curvature on [0, end]: go to the first root of the parabola below the series, which is
    # never past a root of the series itself. Where that takes long the bound is too wide: shorten its interval.
    s = 0.0
    end = 1.0
    curvature = _curvature(q, first, end)
    value = q[first]
    for i in range(MOST_ITERATIONS):
        if i % PATIENCE == PATIENCE - 1 and 2.0 * s < end:
            end = 2.0 * s
            curvature = _curvature(q, first, end)
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
            curvature = _curvature(q, first, end)
        value = 0.0
        slope = 0.0
        for k in range(size - 1, first - 1, -1):
            slope = slope * s + value
            value = value * s + q[k]
        if value <= tiny:
            if slope < 0.0:
                s = min(max(s - value / slope, 0.0), 1.0)
            return s * step
    return s * step
