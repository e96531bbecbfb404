"""Pictures of the body, of its touches and of time, which figures, renderer and replay share."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from sledenv.simulation.bodies import Body, Segment
from sledenv.simulation.interpolation import drawable_rows, rows_of, states_at
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.outlines import mass_properties

_SAME = 1e-9  # of the size of the body: points of an outline that are closer are one
DISTINCT = 0.3  # of the size of the body: two poses that differ less are drawn as one, unless more is asked for


def body_outline(body: Body, x: float, y: float, phi: float, points: int = 64) -> np.ndarray:
    """Return the closed outline of a body in the slope frame.

    Parameters
    ----------
    body : Body
        Its shape.
    x, y : float
        Mass centre [m].
    phi : float
        Orientation [rad].
    points : int
        Number of points on the arc of a segment, >= 2; any other outline is as fine as a circle of its size with so
        many.

    Returns
    -------
    ndarray, shape (n, 2)
        Columns x, y [m], counterclockwise; the first point is repeated as the last.
    """
    if isinstance(body, Segment):
        return _segment_outline(body, body.half_angle, x, y, phi, points)
    return placed(_own_outline(body, points), x, y, phi)


def heavy_side(body: Body, x: float, y: float, phi: float, points: int = 64) -> np.ndarray:
    """Return the outline of the part of the body to be filled darker, which shows how the body is turned.

    Of a segment it is the half that holds the mass centre; of any other body what is below the mass centre at phi = 0.
    Parameters and result are those of :func:`body_outline`.
    """
    if isinstance(body, Segment):
        return _segment_outline(body, min(body.half_angle, math.pi / 2), x, y, phi, points)
    return placed(_lower_part(_own_outline(body, points)), x, y, phi)


def _segment_outline(body: Segment, half_angle: float, x: float, y: float, phi: float, points: int) -> np.ndarray:
    """Return the closed outline of a segment, whose arc may be cut to another half-angle [rad]."""
    angle = phi + np.linspace(-half_angle, half_angle, points)
    arc = arc_centre(body, x, y, phi) + body.radius * np.stack([np.sin(angle), -np.cos(angle)], axis=-1)
    return np.concatenate([arc, arc[:1]])


def _own_outline(body: Body, points: int) -> np.ndarray:
    """Return the closed outline [m] from the mass centre in the frame of the body, counterclockwise."""
    arcs = body.arcs
    ends = [*(arc.begin for arc in arcs[1:]), arcs[0].begin + 2.0 * math.pi]
    drawn = []
    for arc, end in zip(arcs, ends, strict=True):
        pieces = 0
        if arc.radius > 0.0:
            # All pieces bulge out by as much, so that flat arcs have few and so have corners that are hardly rounded.
            share = (end - arc.begin) / (2.0 * math.pi) * math.sqrt(arc.radius / body.size)
            pieces = max(math.ceil((points - 1) * share), 1)
        phi = np.linspace(arc.begin, end, pieces + 1)
        drawn.append(np.stack([arc.x - arc.radius * np.sin(phi), arc.y - arc.radius * np.cos(phi)], axis=-1))
    every = np.concatenate(drawn)[::-1]
    steps = np.hypot(*(every - np.roll(every, 1, axis=0)).T)
    outline = every[steps > _SAME * body.size]  # an arc ends where the next one begins, up to rounding
    if len(outline) == 0:
        outline = every[:1]  # a point
    return np.concatenate([outline, outline[:1]])


def _lower_part(outline: np.ndarray) -> np.ndarray:
    """Return the part of a closed convex outline that is below y = 0; its lowest points if there is none."""
    level = max(float(outline[:, 1].min()), 0.0)
    kept = []
    for one, other in pairwise(outline):
        if one[1] <= level:
            kept.append(one)
        if min(one[1], other[1]) < level < max(one[1], other[1]):
            kept.append(one + (level - one[1]) / (other[1] - one[1]) * (other - one))
    return np.array([*kept, kept[0]])


def placed(points: np.ndarray, x: float, y: float, phi: float) -> np.ndarray:
    """Return points of the frame of a body in the slope frame."""
    cosine, sine = math.cos(phi), math.sin(phi)
    there: np.ndarray = points @ np.array([(cosine, sine), (-sine, cosine)]) + np.array([x, y])
    return there


def arc_centre(body: Segment, x: float, y: float, phi: float) -> tuple[float, float]:
    """Return the centre O [m] of the arc, slope frame, of a segment whose mass centre is at ``x``, ``y`` [m]."""
    return x - body.eccentricity * math.sin(phi), y + body.eccentricity * math.cos(phi)


def spoke(body: Body, x: float, y: float, phi: float) -> np.ndarray:
    """Return the line that shows how far the mass centre lies out of the middle of the body, slope frame.

    It ends at the mass centre, ``x``, ``y`` [m]. Of a segment it begins at the centre of the arc, or at the middle of
    the chord where the segment is shallower than a half disc, because the centre of its arc lies outside of it; of any
    other body at the centroid of its area.

    Returns
    -------
    ndarray, shape (2, 2)
        Columns x, y [m].
    """
    if not isinstance(body, Segment):
        return placed(np.array([_middle(body), (0.0, 0.0)]), x, y, phi)
    below = max(body.radius * math.cos(body.half_angle), 0.0)
    x0, y0 = arc_centre(body, x, y, phi)
    return np.array([(x0 + below * math.sin(phi), y0 - below * math.cos(phi)), (x, y)])


def _middle(body: Body) -> tuple[float, float]:
    """Return the centroid [m] of the area of a body in its own frame; the middle of one that is but a line."""
    try:
        return mass_properties(body.arcs)[1]
    except ValueError:
        x, y = np.mean([arc[:2] for arc in body.arcs], axis=0).tolist()
        return x, y


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


def strobe_times(body: Body, rows: np.ndarray, interval: float, distinct: float = DISTINCT) -> np.ndarray:
    """Return the times [s] of the poses of a strobe picture: at equal intervals and at the end, shape (n,), n >= 1.

    Parameters
    ----------
    body : Body
        Its size tells which poses would lie on top of each other and are left out.
    rows : ndarray of TRAJECTORY, shape (m,)
        At least one row.
    interval : float
        Between two poses [s], > 0.
    distinct : float
        Poses that differ by less, over the size of the body, are drawn as one.
    """
    start, end = float(rows["t"][0]), float(rows["t"][-1])
    times = start + interval * np.arange(max(1, math.ceil((end - start) / interval - 1e-9)))
    times = np.append(times, end)
    states = states_at(rows, times)
    size = body.size
    weights = np.array([1.0, 1.0, size]) / max(size, 1e-9)
    kept = [len(states) - 1]
    for i in range(len(states) - 2, -1, -1):
        shift = np.abs(states[kept, :3] - states[i, :3]) @ weights
        if shift.min() > distinct:
            kept.append(i)
    found: np.ndarray = times[kept[::-1]]
    return found


def contact_paths(descent: Descent) -> list[np.ndarray]:
    """Return where on the slope each rebound touched, from its touchdown to its separation.

    Parameters
    ----------
    descent : Descent
        With its trajectory.

    Returns
    -------
    list of ndarray, shape (n, 2)
        One of each rebound: places x, y [m] of what touched first among the contacts at a time, slope frame, n >= 1. A
        row of NaN lies between two places without a way from one to the other: another contact went on alone.
    """
    rows = drawable_rows(descent)
    paths = []
    for rebound in descent.rebounds:
        within = rows_of(rebound, rows)
        if len(within) == 0:  # without duration, or between two rows
            where = rebound["x_contact"]
            paths.append(np.array([(where, descent.slope.height_at(where))]))
            continue
        path = np.stack([within["contacts"]["x"][:, 0], within["contacts"]["y"][:, 0]], axis=-1)
        jumps = np.hypot(*np.diff(path, axis=0).T) > _SAME * descent.body.size
        paths.append(np.insert(path, np.flatnonzero(jumps & (np.diff(within["t"]) == 0.0)) + 1, np.nan, axis=0))
    return paths
