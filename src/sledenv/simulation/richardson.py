"""Derivatives from differences over smaller and smaller steps, extrapolated (Richardson), with their errors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_ORDERS = 7  # times that differences are extrapolated
_ROUNDING = 4.0 * np.finfo(float).eps


def derivatives_of(here: Floats, there: Floats, fine: NDArray[np.bool_], steps: Floats) -> tuple[Floats, Floats]:
    """Derivatives of Q quantities, and their errors, shapes (Q, P).

    Parameters
    ----------
    here : ndarray, shape (Q,)
        The quantities of the descent that is looked at,
    there : ndarray, shape (P * 2 * K, Q)
        and of each lane.
    fine : ndarray of bool, shape (P, 2, K)
        Which lanes count.
    steps : ndarray, shape (P, 2, K)
        How much the parameter of a lane is less, or more.
    """
    moved = np.moveaxis((there - here).reshape(*steps.shape, -1), -1, 0)  # (Q, P, 2, K)
    below, above = np.moveaxis(np.where(fine, moved, np.nan), 2, 0)
    less, more = np.moveaxis(steps, 1, 0)
    widths = np.stack([more + less, more, less])[:, np.newaxis]  # (3, 1, P, K)
    differences = np.stack([above - below, above, -below]) / widths
    rounding = _ROUNDING * np.abs(here)[:, np.newaxis, np.newaxis] / widths
    return _extrapolated(differences, rounding, np.array([4.0, 2.0, 2.0])[:, np.newaxis, np.newaxis, np.newaxis])


def _extrapolated(column: Floats, rounding: Floats, ratios: Floats) -> tuple[Floats, Floats]:
    """Best of the estimates that follow from differences over smaller and smaller steps, and their errors.

    Parameters
    ----------
    column : ndarray, shape (kinds, Q, P, K)
        Differences of several kinds over steps that are halved each time.
    rounding : ndarray, shape (kinds, Q, P, K)
        Their rounding errors.
    ratios : ndarray, shape (kinds, 1, 1, 1)
        Of the leading errors of two steps in a row; those of each further term are so much larger.
    """
    best, least = np.full(column.shape[1:3], np.nan), np.full(column.shape[1:3], np.inf)
    for order in range(1, _ORDERS + 1):
        coarse, fine = column[..., :-1], column[..., 1:]
        column = fine + (fine - coarse) / (ratios**order - 1.0)
        errors = np.maximum(np.abs(column - fine), np.abs(column - coarse)) + rounding[..., order:]
        for values, of_kind in zip(column, np.where(np.isnan(errors), np.inf, errors), strict=True):
            at = of_kind.argmin(axis=-1)[..., np.newaxis]
            error, value = (np.take_along_axis(table, at, -1)[..., 0] for table in (of_kind, values))
            best, least = np.where(error < least, value, best), np.minimum(error, least)
    return best, np.where(np.isnan(best), np.nan, least)
