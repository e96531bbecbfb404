"""Numbers that figures compute from the rows of a trajectory, and from the contacts in them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sledenv.simulation.bodies import Body
from sledenv.simulation.interpolation import drawable_rows, rows_of
from sledenv.simulation.outcomes import Descent, contacts_in, ground_name
from sledenv.simulation.rules import Rule, checked
from sledenv.simulation.support import lowest_arms

_SAME = 1e-6  # of the size of the body: two places that are closer are one
_TIME: Rule = (lambda t: t == t, "a number of seconds")
_MOST_LABELS = 6  # of contacts in one figure


class Touches(NamedTuple):
    """The contacts in rows of a trajectory, and how the body moves there; arrays of as many."""

    forces: np.ndarray  # of CONTACTS; rows count from the first one given
    depth: np.ndarray  # [m] of the body in the ground
    gap_rate: np.ndarray  # [m/s]
    slip_velocity: np.ndarray  # [m/s]
    moment: np.ndarray  # [N m] of both forces about the mass centre

    def by_row(self, values: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Sum of values of contacts in each row."""
        found: np.ndarray = np.bincount(self.forces["row"], values, len(rows))
        return found


def touches_in(body: Body, rows: np.ndarray) -> Touches:
    """Return the contacts in rows of a trajectory, and how the body moves there.

    A contact is looked at in the frame of its tangent and its normal, in which the ground is level.
    """
    found = contacts_in(rows)
    at = rows[found["row"]]
    n_x, n_y = found["normal_x"], found["normal_y"]
    across, height = at["x"] - found["x"], at["y"] - found["y"]
    a, height = n_y * across - n_x * height, n_x * across + n_y * height
    b = _below(body, at["phi"] - np.arctan2(-n_x, n_y), a, height)
    gap_rate = n_x * at["u"] + n_y * at["v"] - a * at["omega"]
    slip_velocity = n_y * at["u"] - n_x * at["v"] + b * at["omega"]
    moment = b * found["tangential"] - a * found["normal"]
    return Touches(found, np.maximum(b - height, 0.0), gap_rate, slip_velocity, moment)


def _below(body: Body, phi: np.ndarray, a: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Return how far below the mass centre [m] the body touches level ground at the arm a [m]: about its height."""
    record = body.record[0]
    count = int(record["count"])
    across, along, radius = (record[name][:count, np.newaxis] for name in ("across", "along", "r"))
    cosine, sine = np.cos(phi), np.sin(phi)
    arms = across * cosine + along * sine, radius + across * sine - along * cosine
    off = np.where(np.abs(arms[0] - a) <= _SAME * body.size, np.abs(arms[1] - height), np.inf)  # others lie above it
    nearest = off.argmin(axis=0), np.arange(len(phi))
    _, lowest = lowest_arms(body.record, phi)  # where a side lies on a vertex of the ground, no end of it does
    return np.where(off[nearest] < np.inf, arms[1][nearest], lowest[:, 1])


def labels(descent: Descent, forces: np.ndarray) -> np.ndarray:
    """Return what each contact is called in a figure: the part of the body and, on a profile, what it touches.

    If these were too many, it is the part alone.

    Parameters
    ----------
    descent : Descent
        Its body, and whether it touches a profile.
    forces : ndarray of CONTACTS, shape (k,)
        The contacts that are shown.

    Returns
    -------
    ndarray of str, shape (k,)
    """
    pairs = np.unique(forces[["part", "ground"]])
    profile = bool((descent.contacts["ground"] > 0).any()) and len(pairs) <= _MOST_LABELS
    said = np.full(len(forces), "", dtype=object)
    for part, ground in pairs.tolist():
        words = descent.body.parts[part - 1] + (f" on {ground_name(ground, descent.slope.rounding)}" if profile else "")
        said[(forces["part"] == part) & (forces["ground"] == ground)] = words
    return said


def by_label(descent: Descent, forces: np.ndarray, values: np.ndarray, count: int) -> dict[str, np.ndarray]:
    """Return values of contacts over so many rows for each of the :func:`labels`, NaN where there is no such contact.

    Of contacts at a time with the same label, all but the first along the slope are numbered.
    """
    found: dict[str, np.ndarray] = {}
    said = labels(descent, forces)
    row_before, told = -1, [""]
    for i in np.lexsort((forces["x"], forces["row"])).tolist():
        row, label = int(forces["row"][i]), str(said[i])
        told = [*told, label] if row == row_before else [label]
        name = f"{label}, {told.count(label)}" if told.count(label) > 1 else label
        found.setdefault(name, np.full(count, np.nan))[row] = values[i]
        row_before = row
    return found


def kinetic(descent: Descent, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the energy [J] of translation and of rotation in each row."""
    speed_squared = np.square(rows["u"]) + np.square(rows["v"])
    return 0.5 * descent.body.mass * speed_squared, 0.5 * descent.body.inertia * np.square(rows["omega"])


def rows_between(descent: Descent, start: float, stop: float) -> np.ndarray:
    """Return the rows of the trajectory between two times [s].

    Raises
    ------
    TypeError, ValueError
        If it is no descent, a time is no number, or the trajectory is missing or has fewer than two rows in between.
    """
    rows = drawable_rows(descent)
    start, stop = (checked("interval", name, time, _TIME) for name, time in (("start", start), ("stop", stop)))
    rows = rows[(rows["t"] >= start) & (rows["t"] <= stop)]
    if len(rows) < 2:
        raise ValueError(f"start = {start!r}, stop = {stop!r}: fewer than two rows of the trajectory lie in between")
    return rows


def first_contact(descent: Descent) -> np.ndarray:
    """Return the rows of the first rebound, from touchdown to separation.

    Raises
    ------
    ValueError
        If the trajectory is missing, or there is no rebound or it takes no time.
    """
    every = drawable_rows(descent)
    rows = rows_of(descent.rebounds[0], every) if len(descent.rebounds) else every[:0]
    if len(rows) < 2 or rows["t"][-1] <= rows["t"][0]:
        raise ValueError("the descent has no first contact that takes time, as between rigid surfaces")
    return rows


def opening(descent: Descent, rows: np.ndarray) -> int:
    """Return the first row of a rebound in which no gap closes."""
    touches = touches_in(descent.body, rows)
    return int(np.argmin(touches.by_row(touches.gap_rate < 0.0, rows) > 0.0))
