"""Bodies of common shapes, built from a few numbers: segments, discs, rods, polygons, hulls of circles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sledenv.kernel.outline import MOST_ARCS
from sledenv.simulation.bodies import Body, Segment
from sledenv.simulation.outlines import (
    Arc,
    Floats,
    checked_outline,
    fewer_circles,
    hull_of_circles,
    mass_properties,
    outline_of,
    polygon_of,
    segment_moments,
    shifted,
)
from sledenv.simulation.rules import INERTIA, MEASURE, MEASURE_OR_0, NOT_NEGATIVE, PLACE, Rule, checked, numbers_of

_HALF_ANGLE: Rule = (lambda v: (v >= 1e-40) & (v <= math.pi), "in [1e-40, pi] rad")  # or the inertia is no number
_THIN = 0.3  # [rad] half-angle below which the closed form of a segment loses digits


def circular_segment(mass: float, radius: float, half_angle: float, drag_area: float = 0.0) -> Segment:
    """Return the uniform lamina bounded by an arc and its chord: docs/physics.md, section 8.

    Parameters
    ----------
    mass : float
        Mass [kg], > 0.
    radius : float
        Radius of the arc [m], > 0.
    half_angle : float
        Half of the angle that the arc subtends [rad] in [1e-40, pi].
    drag_area : float
        [m^2], as of :class:`Body`; 0 by default.

    Returns
    -------
    Segment
        With the eccentricity and the inertia of the lamina.
    """
    mass = checked("circular_segment", "mass", mass, MEASURE)
    radius = checked("circular_segment", "radius", radius, MEASURE)
    alpha = checked("circular_segment", "half_angle", half_angle, _HALF_ANGLE)
    if alpha < _THIN:
        _, height, inertia = (float(moment[0]) for moment in segment_moments(np.array([alpha])))
        eccentricity, inertia = radius * min(math.cos(alpha) + height, 1.0), mass * radius**2 * inertia
        return Segment(mass, radius, eccentricity, inertia, alpha, drag_area)
    sine, cosine = math.sin(alpha), math.cos(alpha)
    area = alpha - sine * cosine  # of the segment, over r^2
    eccentricity = 2.0 * radius * sine**3 / (3.0 * area)
    about_arc_centre = 0.5 * mass * radius**2 * (1.0 + 2.0 * sine**3 * cosine / (3.0 * area))
    return Segment(mass, radius, eccentricity, about_arc_centre - mass * eccentricity**2, alpha, drag_area)


def disc(
    mass: float, radius: float, eccentricity: float = 0.0, inertia: float | None = None, drag_area: float = 0.0
) -> Segment:
    """Return a disc, uniform by default: docs/physics.md, section 1.

    Parameters
    ----------
    mass : float
        Mass [kg], > 0.
    radius : float
        Radius [m], > 0.
    eccentricity : float
        Distance [m] of the mass centre from the centre, in [0, radius].
    inertia : float, optional
        Moment of inertia about the mass centre [kg m^2], > 0; ``mass * radius**2 / 2`` by default. It must be given
        where the eccentricity is not 0, for the disc is not uniform then.
    drag_area : float
        [m^2], as of :class:`Body`; 0 by default.

    Returns
    -------
    Segment
        With half_angle pi.

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range.
    """
    mass, radius = checked("disc", "mass", mass, MEASURE), checked("disc", "radius", radius, MEASURE)
    within: Rule = (lambda h: (h >= 0.0) & (h <= radius), f"in [0, radius] = [0, {radius!r}] m")
    eccentricity = checked("disc", "eccentricity", eccentricity, within)
    if inertia is None:
        if eccentricity > 0.0:
            raise ValueError("disc.inertia = None: must be given where the eccentricity is not 0")
        inertia = 0.5 * mass * radius**2
    return Segment(mass, radius, eccentricity, checked("disc", "inertia", inertia, INERTIA), drag_area=drag_area)


# Other outlines.


def lamina(
    mass: float,
    arcs: Sequence[Arc],
    inertia: float | None = None,
    centre: ArrayLike | None = None,
    drag_area: float = 0.0,
) -> Body:
    """Return a body whose arcs are given in any frame, uniform by default: docs/physics.md, section 8.

    Parameters
    ----------
    mass : float
        Mass [kg], > 0.
    arcs : sequence of Arc
        As those of :class:`Body`, but from any point.
    inertia, centre : optional
        As for :func:`polygon`; both must be given where the outline has no area.
    drag_area : float
        [m^2], as of :class:`Body`; 0 by default.

    Returns
    -------
    Body

    Raises
    ------
    TypeError, ValueError
        As :class:`Body` and :func:`polygon` do.
    """
    mass = checked("lamina", "mass", mass, MEASURE)
    arcs, _ = checked_outline("lamina", arcs)
    return _weighed("lamina", mass, arcs, inertia, centre, drag_area)


def rod(
    mass: float, length: float, thickness: float = 0.0, inertia: float | None = None, drag_area: float = 0.0
) -> Body:
    """Return a rod that lies along x at phi = 0, with its mass centre in the middle: docs/physics.md, section 8.

    Its ends are the parts "nose", downhill at phi = 0, and "tail"; its sides are "bottom" and "top".

    Parameters
    ----------
    mass : float
        Mass [kg], > 0.
    length : float
        Whole length [m], > thickness.
    thickness : float
        [m], >= 0; the ends are half circles. 0, the default, is a line between two corners.
    inertia : float, optional
        Moment of inertia about the mass centre [kg m^2], > 0; that of a uniform rod by default.
    drag_area : float
        [m^2], as of :class:`Body`; 0 by default.

    Returns
    -------
    Body

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range.
    """
    mass, length = checked("rod", "mass", mass, MEASURE), checked("rod", "length", length, MEASURE)
    thickness = checked("rod", "thickness", thickness, MEASURE_OR_0)
    if not length > thickness:
        raise ValueError(f"rod.length = {length!r}: must be in (thickness, inf) = ({thickness!r}, inf) m")
    half, r = 0.5 * (length - thickness), 0.5 * thickness
    arcs = Arc(half, 0.0, r, -math.pi, "nose", "bottom"), Arc(-half, 0.0, r, 0.0, "tail", "top")
    if inertia is None:
        inertia = mass * (mass_properties(arcs)[2] if thickness > 0.0 else length**2 / 12.0)
    return Body(mass, checked("rod", "inertia", inertia, INERTIA), arcs, drag_area)


def polygon(
    mass: float,
    points: ArrayLike,
    rounding: float = 0.0,
    parts: Sequence[str] | None = None,
    sides: Sequence[str] | None = None,
    inertia: float | None = None,
    centre: ArrayLike | None = None,
    drag_area: float = 0.0,
) -> Body:
    """Return a convex polygon, with corners that may be rounded: docs/physics.md, section 8.

    Parameters
    ----------
    mass : float
        Mass [kg], > 0.
    points : array_like of float, shape (N, 2)
        Corners x, y [m] in any frame whose axes are those of the body at phi = 0, in either direction of turn: from 3
        to as many as a :class:`sledenv.Body` may have arcs.
    rounding : float
        Radius [m] of circles that touch both sides of a corner from within and round it off, >= 0; 0 by default. A
        length of every side must be left.
    parts, sides : sequence of str, optional
        Names of the corners, and of the sides from each corner to the one after it. "corner 1", "side 1" and so on by
        default.
    inertia : float, optional
        Moment of inertia about the mass centre [kg m^2], > 0; that of the uniform lamina by default. It must be given
        where ``centre`` is.
    centre : array_like of float, shape (2,), optional
        The mass centre [m] in the frame of the corners; that of the uniform lamina by default.
    drag_area : float
        [m^2], as of :class:`Body`; 0 by default.

    Returns
    -------
    Body

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range; also if a corner is no corner, or if the polygon is not
        convex. Of too many corners the message says which will do.
    """
    mass = checked("polygon", "mass", mass, MEASURE)
    corners = _table("polygon", "points", points, 2)
    if not 3 <= len(corners) <= MOST_ARCS:
        remedy = _remedy(np.column_stack([corners, np.zeros(len(corners))]))
        raise ValueError(f"polygon.points has {len(corners)} rows: must have 3 to {MOST_ARCS}{remedy}")
    rounding = checked("polygon", "rounding", rounding, NOT_NEGATIVE)
    parts = _names("polygon", "parts", parts, "corner", corners)
    sides = _names("polygon", "sides", sides, "side", corners)
    return _weighed("polygon", mass, polygon_of(corners, rounding, parts, sides), inertia, centre, drag_area)


def hull(
    mass: float,
    circles: ArrayLike,
    parts: Sequence[str] | None = None,
    sides: Sequence[str] | None = None,
    inertia: float | None = None,
    centre: ArrayLike | None = None,
    drag_area: float = 0.0,
) -> Body:
    """Return a body whose outline is the convex hull of circles: docs/physics.md, section 8.

    Parameters
    ----------
    mass : float
        Mass [kg], > 0.
    circles : array_like of float, shape (N, 3)
        Centres x, y [m] in any frame whose axes are those of the body at phi = 0, and radii [m], >= 0. Those that lie
        within the hull are left out.
    parts, sides : sequence of str, optional
        Names of the circles, and of the straight sides that follow each of them clockwise. "circle 1", "side 1" and so
        on by default.
    inertia, centre : optional
        As for :func:`polygon`; both must be given where the hull is a line or a point.
    drag_area : float
        [m^2], as of :class:`Body`; 0 by default.

    Returns
    -------
    Body

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range. Of too many circles the message says which will do.
    """
    mass = checked("hull", "mass", mass, MEASURE)
    table = _table("hull", "circles", circles, 3)
    for k, radius in enumerate(table[:, 2].tolist()):
        checked(f"hull.circles[{k}]", "radius", radius, MEASURE_OR_0)
    parts = _names("hull", "parts", parts, "circle", table)
    sides = _names("hull", "sides", sides, "side", table)
    arcs = hull_of_circles(table, parts, sides)
    if len(arcs) > MOST_ARCS:
        raise ValueError(f"hull.circles: the hull has {len(arcs)} arcs: must have 1 to {MOST_ARCS}{_remedy(table)}")
    return _weighed("hull", mass, arcs, inertia, centre, drag_area)


def _remedy(circles: Floats) -> str:
    """Return which circles will do where there are too many, empty if they span no outline."""
    chosen, depth = fewer_circles(circles, MOST_ARCS)
    if len(chosen) < 3:
        return ""
    return f"; rows {chosen} alone, counted from 0, make an outline that lies {depth:.2g} m within it at most"


def _weighed(
    owner: str, mass: float, arcs: tuple[Arc, ...], inertia: float | None, centre: ArrayLike | None, drag_area: float
) -> Body:
    """Return the body of an outline in any frame, uniform where its inertia and its mass centre are not given."""
    if centre is not None:
        if inertia is None:
            raise ValueError(f"{owner}.inertia = None: must be given where {owner}.centre is")
        ((x, y),) = _table(owner, "centre", [centre], 2).tolist()
        if not outline_of(shifted(arcs, -x, -y)).holds_the_mass_centre:
            raise ValueError(f"{owner}.centre = {(x, y)!r}: must lie within the outline")
    else:
        try:
            _, (x, y), uniform = mass_properties(arcs)
        except ValueError as error:
            raise ValueError(f"{owner}.centre = None: must be given where the outline has no area") from error
        inertia = mass * uniform if inertia is None else inertia
    return Body(mass, checked(owner, "inertia", inertia, INERTIA), shifted(arcs, -x, -y), drag_area)


def _table(owner: str, name: str, given: Any, columns: int) -> Floats:
    """Return a table of lengths [m], shape (N, columns), N > 0."""
    table: Floats = numbers_of(f"{owner}.{name}", given, "numbers")
    if table.ndim != 2 or table.shape[1] != columns or not len(table):
        raise ValueError(f"{owner}.{name} has shape {table.shape}: must be (N, {columns})")
    for k, row in enumerate(table.tolist()):
        for value in row:
            checked(owner, f"{name}[{k}]", value, PLACE)
    return table


def _names(owner: str, name: str, given: Sequence[str] | None, default: str, table: NDArray[Any]) -> list[str]:
    """Return a name for each row of a table."""
    if given is None:
        return [f"{default} {k}" for k in range(1, len(table) + 1)]
    if isinstance(given, str) or not isinstance(given, Sequence) or not all(isinstance(word, str) for word in given):
        raise TypeError(f"{owner}.{name} = {given!r}: must be a sequence of names")
    if len(given) != len(table):
        raise ValueError(f"{owner}.{name} has {len(given)} names: must have {len(table)}")
    for k, word in enumerate(given):
        if not word:
            raise ValueError(f"{owner}.{name}[{k}] = {word!r}: must have a letter")
    return list(given)
