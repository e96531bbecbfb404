"""Where the body is and what it looks like: the geometry that the figures and the renderer share."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from sledenv.descent import Descent
from sledenv.kernel.geometry import arms, feature_at, whole_turns
from sledenv.kernel.params import Body, State

_DRAWABLE = 1e12  # [m], [rad], [m/s]: beyond it (an overflow, as a rule) there is nothing to draw
_DISTINCT = 0.3  # of the size of the body: two poses that differ less are drawn as one


def body_outline(body: Body, x: float, y: float, phi: float, points: int = 64) -> np.ndarray:
    """Return the closed outline of a body in the slope frame.

    Parameters
    ----------
    body : Body
        Its shape; a rod (radius 0) is drawn from the end that touches to the mass centre.
    x, y : float
        Mass centre [m].
    phi : float
        Orientation [rad].
    points : int
        Number of points on the arc, >= 2.

    Returns
    -------
    ndarray, shape (n, 2)
        Columns x, y [m]; the first point is repeated as the last, save for a rod, which has two points.
    """
    centre = np.array([x - body.eccentricity * math.sin(phi), y + body.eccentricity * math.cos(phi)])
    if body.radius == 0.0:
        return np.array([centre, (x, y)])
    angle = phi + np.linspace(-body.half_angle, body.half_angle, points)
    arc = centre + body.radius * np.stack([np.sin(angle), -np.cos(angle)], axis=-1)
    return np.concatenate([arc, arc[:1]])


def heavy_side(body: Body, x: float, y: float, phi: float, points: int = 64) -> np.ndarray:
    """Return the outline of the half of the body that holds the mass centre, which shows how the body is turned.

    Parameters and result are those of :func:`body_outline`.
    """
    return body_outline(body._replace(half_angle=min(body.half_angle, math.pi / 2)), x, y, phi, points)


def arc_centre(body: Body, x: float, y: float, phi: float) -> tuple[float, float]:
    """Return the centre O [m] of the arc, slope frame, of a body whose mass centre is at ``x``, ``y`` [m]."""
    return x - body.eccentricity * math.sin(phi), y + body.eccentricity * math.cos(phi)


def reach(body: Body) -> float:
    """Return the largest distance [m] of a point of the body from its mass centre."""
    return float(np.hypot(*body_outline(body, 0.0, 0.0, 0.0, 65).T).max())


def to_world(points: ArrayLike, angle: float) -> np.ndarray:
    """Rotate slope-frame points so that the slope descends to the right.

    Parameters
    ----------
    points : array_like, shape (..., 2)
        Along the slope and normal to it [m].
    angle : float
        Inclination of the slope [rad].

    Returns
    -------
    ndarray, shape (..., 2)
        Horizontal distance and height [m].
    """
    along, normal = np.moveaxis(np.asarray(points, dtype=float), -1, 0)
    cosine, sine = math.cos(angle), math.sin(angle)
    return np.stack([along * cosine + normal * sine, normal * cosine - along * sine], axis=-1)


def drawable_rows(descent: Descent) -> np.ndarray:
    """Return the rows of the trajectory that can be drawn, at least one: a numerical overflow is left out.

    Raises
    ------
    ValueError
        If the descent was simulated without ``record="trajectory"``.
    """
    rows = descent.trajectory
    if len(rows) == 0:
        raise ValueError('the descent has no trajectory: simulate(..., record="trajectory") keeps it')
    values = np.stack([rows[name] for name in ("t", *State._fields)])
    drawable = (np.abs(values) < _DRAWABLE).all(axis=0)  # False for NaN
    if drawable.any():
        drawn: np.ndarray = rows[drawable]
        return drawn
    row = rows[:1].copy()
    for name in ("t", *State._fields):
        row[name] = np.clip(np.nan_to_num(row[name]), -_DRAWABLE, _DRAWABLE)
    return row


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


def strobe_states(body: Body, rows: np.ndarray, interval: float) -> np.ndarray:
    """Return the states of a strobe picture: at equal intervals of time and at the end.

    Parameters
    ----------
    body : Body
        Its size tells which poses would lie on top of each other and are left out.
    rows : ndarray of TRAJECTORY, shape (m,)
        At least one row.
    interval : float
        Between two poses [s], > 0.

    Returns
    -------
    ndarray, shape (n, 6)
        Columns as in :class:`State`, n >= 1.
    """
    start, end = float(rows["t"][0]), float(rows["t"][-1])
    times = start + interval * np.arange(max(1, math.ceil((end - start) / interval - 1e-9)))
    states = states_at(rows, np.append(times, end))
    size = reach(body)
    weights = np.array([1.0, 1.0, size]) / max(size, 1e-9)
    kept = [len(states) - 1]
    for i in range(len(states) - 2, -1, -1):
        shift = np.abs(states[kept, :3] - states[i, :3]) @ weights
        if shift.min() > _DISTINCT:
            kept.append(i)
    return states[kept[::-1]]


def contact_spans(descent: Descent, until: float = math.inf) -> np.ndarray:
    """Return where on the slope each contact began and ended.

    Parameters
    ----------
    descent : Descent
        With its trajectory.
    until : float
        Time [s]; later contacts are left out and the current one ends here.

    Returns
    -------
    ndarray, shape (n, 2)
        Place of the contact point along the slope [m] at touchdown and at separation.
    """
    rows = drawable_rows(descent)
    begun = descent.rebounds[descent.rebounds["t"] - descent.rebounds["duration"] <= until]
    ends = np.stack([begun["t"] - begun["duration"], np.minimum(begun["t"], until)], axis=-1)
    states = states_at(rows, ends.ravel())
    places = [_contact_place(descent.body, x, phi) for x, phi in states[:, [0, 2]].tolist()]
    return np.array(places, dtype=float).reshape(-1, 2)


def _contact_place(body: Body, x: float, phi: float) -> float:
    """Place along the slope [m] of the lowest point of the body."""
    local = phi - whole_turns(phi)
    return x - arms(body, feature_at(body, local), local)[0]
