"""Where along a line something ceases to hold: bracketed by shrinking steps, then bisected."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def bracket(steps: Floats, fine: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Largest step that is fine, or 0, and smallest that is not, or inf, of the last axis, on which steps shrink."""
    bad = fine.shape[-1] - np.count_nonzero(fine, axis=-1, keepdims=True)  # so many come first
    low = np.take_along_axis(np.append(steps, np.zeros((*steps.shape[:-1], 1)), axis=-1), bad, -1)
    high = np.where(bad > 0, np.take_along_axis(steps, np.maximum(bad - 1, 0), -1), np.inf)
    return low[..., 0], high[..., 0]


def least_of_smaller(values: NDArray[Any]) -> NDArray[Any]:
    """Least of the values at each step and at all smaller ones, of the last axis, on which steps shrink."""
    return np.minimum.accumulate(values[..., ::-1], axis=-1)[..., ::-1]


def bisected(
    low: Floats, high: Floats, holds: Callable[[Floats], NDArray[np.bool_]], times: int
) -> tuple[Floats, Floats]:
    """Halve brackets, shape (N,), so that ``holds`` is true at the low ends and false at the high ones."""
    for _ in range(times):
        middle = 0.5 * (low + high)
        fine = holds(middle)
        low, high = np.where(fine, middle, low), np.where(fine, high, middle)
    return low, high
