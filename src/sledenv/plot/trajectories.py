"""What figures compute from the rows of a trajectory."""

from __future__ import annotations

import numpy as np

from sledenv.plot.shapes import contact_arms, drawable_rows
from sledenv.simulation.outcomes import Descent

_LATE = 1e-9  # [s] rounding of the beginning of a contact, which is its end less its duration


def touching_arms(descent: Descent, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the arms [m] of what touches in each row, zero in flight; of the lower one of two points."""
    found = contact_arms(descent.body, rows["phi"], rows["feature"])
    found[rows["feature"] == 0] = 0.0
    return found[:, 0], found[:, 1]


def kinetic(descent: Descent, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the energy [J] of translation and of rotation in each row."""
    speed_squared = np.square(rows["u"]) + np.square(rows["v"])
    return 0.5 * descent.body.mass * speed_squared, 0.5 * descent.body.inertia * np.square(rows["omega"])


def slip_velocity(descent: Descent, rows: np.ndarray) -> np.ndarray:
    """Return the velocity of the touching point along the slope [m/s] in each row in contact."""
    _, b = touching_arms(descent, rows)
    velocity: np.ndarray = rows["u"] + b * rows["omega"]
    return velocity


def penetration(descent: Descent, rows: np.ndarray) -> np.ndarray:
    """Return how deep what touches is in the slope [m] in each row, zero in flight."""
    _, b = touching_arms(descent, rows)
    return np.where(rows["feature"] > 0, np.maximum(b - rows["y"], 0.0), 0.0)


def rows_between(descent: Descent, start: float, stop: float) -> np.ndarray:
    """Return the rows of the trajectory between two times [s].

    Raises
    ------
    ValueError
        If the trajectory is missing or has fewer than two rows in the interval.
    """
    rows = drawable_rows(descent)
    rows = rows[(rows["t"] >= start) & (rows["t"] <= stop)]
    if len(rows) < 2:
        raise ValueError(f"start = {start!r}, stop = {stop!r}: fewer than two rows of the trajectory lie in between")
    return rows


def gap_rate(descent: Descent, rows: np.ndarray) -> np.ndarray:
    """Return the rate of the gap [m/s] in each row in contact."""
    a, _ = touching_arms(descent, rows)
    rate: np.ndarray = rows["v"] - a * rows["omega"]
    return rate


def contact_rows(descent: Descent, number: int = 0) -> np.ndarray:
    """Return the rows of one contact, from touchdown to separation.

    Raises
    ------
    ValueError
        If the trajectory is missing, or there is no such contact or it takes no time.
    """
    every = drawable_rows(descent)
    if not 0 <= number < len(descent.rebounds):
        raise ValueError(f"number = {number!r}: must be in [0, {len(descent.rebounds)}), the contacts of the descent")
    rebound = descent.rebounds[number]
    begin = rebound["t"] - rebound["duration"]
    rows: np.ndarray = every[(every["feature"] > 0) & (every["t"] >= begin - _LATE) & (every["t"] <= rebound["t"])]
    if len(rows) < 2 or rows["t"][-1] <= rows["t"][0]:
        raise ValueError(f"number = {number!r}: this contact takes no time, as between rigid surfaces")
    return rows
