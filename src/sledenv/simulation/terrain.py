"""Sections of terrain as they are surveyed: their order, the plane under them, and what is too steep filled up."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sledenv.kernel.entries import run_directions
from sledenv.simulation.bends import MOST_VERTICES, STEEPEST
from sledenv.simulation.rules import POSITIVE, STEEPNESS, Rule, checked, numbers_of, warn_user
from sledenv.simulation.smoothing import fit_ground

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

_STEEPEST: Rule = (lambda v: (v > 0.0) & (v <= STEEPEST), f"in (0, {STEEPEST:.6g}] rad, which are 80 degrees")
_SPARE: Final = 1e-6  # of the slope of a fill, so that it is no steeper than asked for after rounding
_LEAST: Final = 1e-6  # [m] along x of a fill
_MOVED: Final = 1e-5  # [m] under a fill, from which on a point counts as moved


class Reader(NamedTuple):
    """Names for the points of a section in messages, and remedies against steep faces of whoever reads it."""

    points: str  # such as "lines"
    place: Callable[[int], str]  # one of them, such as "line 4"
    columns: tuple[str, str]  # names of both coordinates
    steepest: str  # the key or argument that fills steep faces up,
    most: str = "80"  # and the most that it may be given
    plane: str = ""  # " to the plane", if that may be another than the horizon
    tilt: str = ""  # and what to do about it, in words that end in ", "


class Section(NamedTuple):
    """Ground whose heights are those of a section, or above them where that was too steep."""

    vertices: Floats  # x, y [m], x increasing, shape (m, 2)
    pieces: Ints  # which piece of the section the one behind each vertex is of, shape (m,)
    moved: int  # points of the section that are under the ground
    most: float  # [m] how far the farthest of them is from it


class _Piece(NamedTuple):
    """A straight piece of ground."""

    x: float  # [m] where it begins
    y: float
    end_x: float  # [m] where it ends
    end_y: float
    number: int  # of the piece of the section


class Surveyed(NamedTuple):
    """A section of terrain over its plane."""

    vertices: Floats  # x along the plane and y off it [m], shape (n, 2), filled where they were too steep
    told: Floats  # vertices and their radii [m] that tell it within the tolerance, shape (m, 3)
    angle: float  # [rad] of the plane


def ground_of(
    x: ArrayLike, z: ArrayLike, angle: float | None, tolerance: float | None, steepest: float | None
) -> Surveyed:
    """Return the ground of a section of terrain: see :meth:`sledenv.Slope.from_terrain`."""
    columns = [numbers_of(f"Slope.from_terrain.{name}", given, "numbers [m]") for name, given in (("x", x), ("z", z))]
    for name, column in zip("xz", columns, strict=True):
        if column.ndim != 1 or len(column) != len(columns[0]) or len(column) < 2:
            raise ValueError(f"Slope.from_terrain.{name} has shape {column.shape}: must be (n,), as x, with n >= 2")
        if not np.isfinite(column).all():
            k = int(np.argmax(~np.isfinite(column)))
            raise ValueError(f"Slope.from_terrain.{name}[{k}] = {float(column[k])!r}: must be a finite number [m]")
    if angle is not None:
        checked("Slope.from_terrain", "angle", angle, STEEPNESS)
    if steepest is not None:
        checked("Slope.from_terrain", "steepest", steepest, _STEEPEST)
    if tolerance is not None:
        checked("Slope.from_terrain", "tolerance", tolerance, POSITIVE)
    points = np.column_stack(columns) + 0.0
    reader = Reader("points", lambda k: f"x[{k}]", ("x", "z"), "steepest", "math.radians(80)", " to the plane")
    vertices, told = over_plane(points, None if angle is None else math.degrees(angle), reader)
    reader = reader._replace(tilt=f"or tilt the plane of {told:g} degrees, ")
    section = checked_section(points, vertices, reader, steepest)
    try:
        ground = fitted(section.vertices, tolerance, "tolerance")
    except ValueError as error:
        raise ValueError(f"Slope.from_terrain {error}") from error
    return Surveyed(section.vertices, ground, math.radians(told) if angle is None else angle)


def fitted(vertices: Floats, tolerance: float | None, name: str) -> Floats:
    """Return ground by few vertices and their radii [m], shape (m, 3), if there is a tolerance [m], else sharp.

    Raises
    ------
    ValueError
        If there are too many vertices, naming the argument or key of the tolerance.
    """
    told = (
        np.column_stack([vertices, np.zeros(len(vertices))]) if tolerance is None else fit_ground(vertices, tolerance)
    )
    if len(told) > MOST_VERTICES:
        given, remedy = "", f"{name}, say 0.01, lets pieces and arcs tell the ground"
        if tolerance is not None:
            given, remedy = f" with {name.rpartition('.')[2]} = {tolerance}", "give more"
        remedy += ", the most that the ground moves by that"
        raise ValueError(f"holds {len(told)} vertices{given}: must hold at most {MOST_VERTICES}; {remedy}")
    return told


def over_plane(points: Floats, angle_deg: float | None, reader: Reader) -> tuple[Floats, float]:
    """Measure a section of terrain over a plane whose origin is the ground at x = 0.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Horizontal distance and elevation [m], one behind the other.
    angle_deg : float or None
        Of the plane; None for that through the first and the last point, to a millionth of a degree.
    reader : Reader
        What messages call them.

    Returns
    -------
    ndarray, shape (n, 2)
        Along the plane and off it [m].
    float
        The angle [deg].

    Raises
    ------
    ValueError
        If there is no ground at x = 0.
    """
    x, z = points.T
    name = reader.columns[0]
    if not x.min() <= 0.0 < x.max():
        if (np.diff(x) <= 0.0).any():
            _check_order(points, reader)
        reach = f"{name} runs from {x.min():g} to {x.max():g} m"
        raise ValueError(f"{reach}: must hold 0, where descents start; shift it so that it does")
    told = round(math.degrees(math.atan2(z[0] - z[-1], x[-1] - x[0])), 6) if angle_deg is None else angle_deg
    cosine, sine = np.empty(1), np.empty(1)
    run_directions(np.radians([told]), cosine, sine)
    over = np.flatnonzero((np.minimum(x[:-1], x[1:]) <= 0.0) & (np.maximum(x[:-1], x[1:]) >= 0.0))
    ends = points[over[0] : over[0] + 2]  # of the first piece over x = 0; of a vertical one the upper end is ground
    z = z - np.interp(0.0, *ends[np.argsort(ends[:, 0], kind="stable")].T)
    return np.column_stack([x * cosine - z * sine, x * sine + z * cosine]) + 0.0, told


def checked_section(given: Floats, vertices: Floats, reader: Reader, steepest: float | None = None) -> Section:
    """Return ground in which x increases and no piece is too steep.

    Parameters
    ----------
    given : ndarray, shape (n, 2)
        Points of the surface, one behind the other [m], in the columns of the reader.
    vertices : ndarray, shape (n, 2)
        The same along the plane and off it [m].
    reader : Reader
        What messages call them.
    steepest : float, optional
        Angle [rad] to the plane in (0, 80 degrees], up to which faces that are steeper, and overhangs, are filled up.
        The ground then is the lowest one that holds all points and has no steeper face.

    Raises
    ------
    ValueError
        Naming a point that is not in the order of x, or behind a piece that is too steep, if ``steepest`` is None.
    """
    if steepest is not None and (np.diff(given[:, 0]) > 0.0).any():
        section = _filled(vertices, math.tan(steepest))
        if section.moved:
            filled = f"{section.moved} of {len(vertices)} points are under what was filled up"
            warn_user(f"{reader.steepest}: {filled}, {section.most:.3g} m from the ground at most")
        return section
    _check_order(given, reader)
    if (problem := too_steep(vertices, reader.plane)) is not None:
        k, text = problem
        remedy = f"move a vertex, {reader.tilt}or fill it up: {reader.steepest}, say {reader.most}"
        raise ValueError(f"{reader.place(k)}: the piece from {reader.place(k - 1)} to here {text}; {remedy}")
    return Section(vertices, np.arange(len(vertices)), 0, 0.0)


def too_steep(vertices: Floats, plane: str = " to the plane") -> tuple[int, str] | None:
    """Return the first vertex, of shape (n, 2), whose piece before it is steeper than allowed, and what is wrong."""
    along, up = np.diff(vertices, axis=0).T
    steep = ~((along > 0.0) & (np.abs(up) <= math.tan(STEEPEST) * along))
    if not steep.any():
        return None
    k = int(np.argmax(steep))
    angle = math.degrees(math.atan2(up[k], along[k]))
    return k + 1, f"is {angle:.3g} degrees steep{plane}: must be at most {math.degrees(STEEPEST):g} degrees"


def _check_order(points: Floats, reader: Reader) -> None:
    """Raise ValueError unless x increases from point to point."""
    x, y = points.T
    falls = np.flatnonzero(np.diff(x) <= 0.0)
    if not falls.size:
        return
    k = int(falls[0])
    here, before = reader.place(k + 1), reader.place(k)
    name, height = reader.columns
    fill = f"{reader.steepest}, say {reader.most}, fills "
    if x[k + 1] < x[k]:
        remedy = f"put the {reader.points} in the order of x; {fill}overhangs up"
        if not (np.diff(x) > 0.0).any():
            remedy = f"put the {reader.points} in the order of x: all of them run backwards"
        raise ValueError(f"{here}: {name} = {x[k + 1]:g}: must be > {x[k]:g} m, that of {before}; {remedy}")
    if y[k + 1] == y[k]:
        raise ValueError(f"{here}: {name} = {x[k]:g}, {height} = {y[k]:g}: repeats {before}; leave one of them out")
    raise ValueError(
        f"{here}: {name} = {x[k]:g}: is a vertical step from {height} = {y[k]:g} in {before} to {y[k + 1]:g} m; "
        f"let it lean: x must increase, and no piece may be steeper{reader.plane} than "
        f"{math.degrees(STEEPEST):g} degrees; {fill}it up"
    )


# Filling.


def _filled(points: Floats, steepest: float) -> Section:
    """Fill a surface, shape (n, 2), up to faces of some slope [-] at most."""
    along, up = np.diff(points, axis=0).T
    if ((along > 0.0) & (np.abs(up) <= steepest * along)).all():
        return Section(points, np.arange(len(points)), 0, 0.0)
    last, steepest = len(points) - 2, steepest * (1.0 - _SPARE)
    pieces = _raised(_from_above(_snapped(points)), steepest, last)
    pieces = _mirrored(_raised(_mirrored(pieces, last), steepest, last), last)
    pieces = [piece for piece in pieces if piece.end_x > piece.x]
    vertices = np.array([*(piece[:2] for piece in pieces), pieces[-1][2:4]])
    numbers = np.array([*(piece.number for piece in pieces), last + 1])
    depths = np.interp(points[:, 0], *vertices.T) - points[:, 1]
    under = np.flatnonzero(depths > _MOVED)
    distances = [_distance(points[k], depths[k], vertices) for k in under]
    return Section(vertices, numbers, len(under), max(distances, default=0.0))


def _snapped(points: Floats) -> Floats:
    """Return points, shape (n, 2), of which none is next to another along x by less than a fill may be wide."""
    order = np.argsort(points[:, 0], kind="stable")
    x = points[order, 0]
    firsts = np.maximum.accumulate(np.where(np.diff(x, prepend=-math.inf) > _LEAST, np.arange(len(x)), 0))
    snapped = points.copy()
    snapped[order, 0] = x[firsts]
    return snapped


def _from_above(points: Floats) -> list[_Piece]:
    """Return what is seen of a surface, shape (n, 2), from above; where a piece begins, the ground may jump.

    A point that is higher than the pieces to both of its sides is a piece without length.
    """
    x = np.unique(points[:, 0])
    middle = 0.5 * (x[:-1] + x[1:])
    highest, seen = np.full(len(middle), -math.inf), np.zeros(len(middle), np.intp)
    for k, (one, other) in enumerate(pairwise(points)):
        ends = np.array(sorted([one.tolist(), other.tolist()]))
        part = slice(*np.searchsorted(x, ends[:, 0]))
        heights = np.interp(middle[part], *ends.T)
        over = heights > highest[part]
        highest[part][over], seen[part][over] = heights[over], k
    order = np.lexsort(points.T[::-1])  # by x, then by y: the last one of each x is the highest
    tops = order[np.searchsorted(points[order, 0], x, side="right") - 1]
    pieces: list[_Piece] = []

    def stand(place: float, top: int, *sides: float) -> None:
        height = float(points[top, 1])
        if height > max(sides):
            pieces.append(_Piece(place, height, place, height, min(top, len(points) - 2)))

    for begin, end, k, top in zip(x.tolist(), x[1:].tolist(), seen.tolist(), tops.tolist(), strict=False):
        ends = np.array(sorted(points[k : k + 2].tolist()))
        first, last = np.interp([begin, end], *ends.T).tolist()
        stand(begin, top, first, *(piece.end_y for piece in pieces[-1:]))
        if pieces and pieces[-1].number == k:
            pieces[-1] = pieces[-1]._replace(end_x=end, end_y=last)
        else:
            pieces.append(_Piece(begin, first, end, last, k))
    stand(float(x[-1]), int(tops[-1]), pieces[-1].end_y)
    return pieces


def _raised(pieces: list[_Piece], steepest: float, last: int) -> list[_Piece]:
    """Fill up behind whatever falls more steeply than a slope [-]; ``last`` is the number of the last piece."""
    done: list[_Piece] = []
    face: int | None = None  # the piece that is steep, while what is filled in front of it is above the ground
    for piece in pieces:
        x, y, end_x, end_y, number = piece
        height = done[-1].end_y if done else y
        if end_x == x:
            if y > height or not done:
                done.append(piece)
                face = None
            continue
        if height <= y:  # a step up is left to the mirror image
            height, face = y, None
        elif face is None:
            face = min(done[-1].number + 1, last)
        fall, width = (y - end_y) / (end_x - x), end_x - x
        if face is None and fall <= steepest:
            done.append(piece)
            continue
        face = number if face is None else face
        reach = (height - y) / (steepest - fall) if fall < steepest else math.inf
        if reach <= _LEAST:
            done.append(_Piece(x, height, end_x, end_y, number))
            face = None
        elif reach >= width:
            done.append(_Piece(x, height, end_x, height - steepest * width, face))
        elif width - reach <= _LEAST:
            done.append(_Piece(x, height, end_x, end_y, face))
            face = None
        else:
            foot = x + reach, height - steepest * reach
            done += [_Piece(x, height, *foot, face), _Piece(*foot, end_x, end_y, number)]
            face = None
    return done


def _mirrored(pieces: list[_Piece], last: int) -> list[_Piece]:
    return [_Piece(-end_x, end_y, -x, y, last - number) for x, y, end_x, end_y, number in reversed(pieces)]


def _distance(point: Floats, depth: float, vertices: Floats) -> float:
    """Distance [m] of a point from ground that it is under by some depth [m]."""
    first, last = np.searchsorted(vertices[:, 0], [point[0] - depth, point[0] + depth])
    vertices = vertices[max(first - 1, 0) : last + 1]
    along, to = np.diff(vertices, axis=0), point - vertices[:-1]
    share = np.clip((to * along).sum(axis=1) / (along * along).sum(axis=1), 0.0, 1.0)
    return float(np.hypot(*(to - share[:, np.newaxis] * along).T).min())
