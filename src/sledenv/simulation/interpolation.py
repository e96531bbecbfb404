"""Where the body is between two rows of a recorded trajectory, and what touches it there."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sledenv.simulation.outcomes import Descent
from sledenv.simulation.rules import checked_kind
from sledenv.simulation.scene import State

_DRAWABLE = 1e12  # [m], [rad], [m/s]: beyond it (an overflow, as a rule) there is nothing to draw
_LATE = 1e-9  # [s] rounding of the beginning of a contact, which is its end less its duration


def drawable_rows(descent: Descent) -> np.ndarray:
    """Return the rows of the trajectory that can be drawn, at least one: a numerical overflow is left out.

    An impact without duration has two rows, the state before it and the state after.

    Raises
    ------
    TypeError, ValueError
        If it is no descent, or was simulated without ``record="trajectory"``.
    """
    rows = checked_kind("descent", descent, Descent).trajectory
    if len(rows) == 0:
        raise ValueError('the descent has no trajectory: simulate(..., record="trajectory") keeps it')
    values = np.stack([rows[name] for name in ("t", *State._fields)])
    drawable = (np.abs(values) < _DRAWABLE).all(axis=0)  # False for NaN
    if drawable.any():  # rows are large: none is copied in vain
        return _with_states_before_impacts(rows if drawable.all() else rows[drawable], descent.rebounds)
    row = rows[:1].copy()
    for name in ("t", *State._fields):
        row[name] = np.clip(np.nan_to_num(row[name]), -_DRAWABLE, _DRAWABLE)
    return row


def _with_states_before_impacts(rows: np.ndarray, rebounds: np.ndarray) -> np.ndarray:
    impacts = rebounds[rebounds["duration"] == 0.0]
    if len(impacts) == 0:
        return rows
    places = np.searchsorted(rows["t"], impacts["t"])
    known = places < len(rows)
    known[known] = rows["t"][places[known]] == impacts["t"][known]
    impacts, places = impacts[known], places[known]
    before = np.zeros(len(impacts), rows.dtype)
    for name in ("t", "x", "y", "phi"):
        before[name] = rows[name][places]
    for rate in State._fields[3:]:
        before[rate] = impacts[f"{rate}_before"]
    return np.insert(rows, places, before)


def states_at(rows: np.ndarray, times: ArrayLike) -> np.ndarray:
    """Interpolate a trajectory.

    Parameters
    ----------
    rows : ndarray of TRAJECTORY, shape (m,)
        At least one row.
    times : array_like, shape (n,)
        Times [s]; those outside the trajectory take its ends.

    Returns
    -------
    ndarray, shape (n, 6)
        Columns as in :class:`State`. Positions follow the recorded velocities, which is exact in flight.
    """
    when = np.asarray(times, dtype=float)
    i = np.clip(np.searchsorted(rows["t"], when, side="right") - 1, 0, max(len(rows) - 2, 0))
    j = np.minimum(i + 1, len(rows) - 1)
    step = rows["t"][j] - rows["t"][i]
    s = np.clip(np.divide(when - rows["t"][i], step, out=np.zeros_like(when), where=step > 0.0), 0.0, 1.0)
    columns = []
    for name, rate in zip(State._fields[:3], State._fields[3:], strict=True):
        start, end = rows[name][i], rows[name][j]
        bend = step * s * (1.0 - s) * ((1.0 - s) * rows[rate][i] - s * rows[rate][j])
        columns.append(start + s * s * (3.0 - 2.0 * s) * (end - start) + bend)
    columns += [rows[rate][i] + s * (rows[rate][j] - rows[rate][i]) for rate in State._fields[3:]]
    return np.stack(columns, axis=-1)


def rows_of(rebound: np.void, rows: np.ndarray) -> np.ndarray:
    """Return the rows of a rebound in which something touches."""
    first = np.searchsorted(rows["t"], rebound["t_touchdown"] - _LATE)
    last = np.searchsorted(rows["t"], rebound["t"], side="right")
    found: np.ndarray = rows[first:last]
    return found[found["touching"] > 0]


def touches_at(rows: np.ndarray, time: float) -> np.ndarray:
    """Return the contacts that there are at ``time`` [s], of CONTACT_FORCES, interpolated between two rows.

    Parameters
    ----------
    rows : ndarray of TRAJECTORY, shape (m,)
        At least one row.
    time : float
        Within them.
    """
    i = max(int(np.searchsorted(rows["t"], time, side="right")) - 1, 0)
    j = min(i + 1, len(rows) - 1)
    now: np.ndarray = rows["contacts"][i, : rows["touching"][i]].copy()
    then = rows["contacts"][j, : rows["touching"][j]]
    step = float(rows["t"][j] - rows["t"][i])
    if step > 0.0 and len(now) == len(then) and (now[["part", "ground"]] == then[["part", "ground"]]).all():
        share = (time - float(rows["t"][i])) / step
        for name in ("x", "y", "normal_x", "normal_y", "normal", "tangential"):
            now[name] += share * (then[name] - now[name])
    return now
