"""Files of ground: profiles and sections of terrain out of CSV, checked line by line, and fitted."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.simulation.bends import height_of
from sledenv.simulation.records import MOST_ZONES
from sledenv.simulation.scene import MOST_VERTICES, STEEPEST
from sledenv.simulation.smoothing import fit_ground
from sledenv.simulation.support import directions

Floats = NDArray[np.float64]

FLAT: Final = ("x_m", "y_m")  # columns of a profile: along the plane of the slope, and over it
TERRAIN: Final = ("x_m", "z_m")  # of a section: horizontal, and over the sea
MATERIAL: Final = "material"  # of the piece that begins in a line; optional
_COLUMNS = f"{', '.join(FLAT)} (along the plane of the slope, and over it) or {', '.join(TERRAIN)} (horizontal, height)"


class Ground(NamedTuple):
    """What a file says of the ground."""

    vertices: Floats  # x along the plane of the slope and y over it [m], shape (n, 2), as in the file
    told: Floats  # vertices and their radii [m] that tell it within the tolerance, shape (m, 3)
    deviation: float  # [m] most that a vertex of the file has moved by that, along the normal of the plane
    materials: tuple[str, ...]  # of the piece behind each vertex, "" where none is named; () without the column
    angle_deg: float | None  # of the plane, where the file is a section of terrain


def read_ground(path: str, angle_deg: float | None = None, tolerance: float | None = None) -> Ground:
    """Read a profile or a section of terrain.

    Parameters
    ----------
    path : str
        Of a CSV file whose first line names the columns: ``x_m, y_m``, vertices over the plane of the slope, or
        ``x_m, z_m``, a section of terrain. A column ``material`` may name that of the piece that begins in its line.
        Lines that are empty or begin with # are skipped.
    angle_deg : float, optional
        Of the plane over which terrain is measured; by default that through its first and its last place, to a
        millionth of a degree. Its origin is the ground at x_m = 0.
    tolerance : float, optional
        Tell the ground by few straight pieces and arcs, so that it moves by at most this [m], along the normal of the
        plane: see :func:`sledenv.simulation.smoothing.fit_ground`.

    Raises
    ------
    OSError, ValueError
        Naming the line, its value and what is allowed.
    """
    header, lines, rows, materials = _rows(path)
    x, y = np.array([_numbers(header, row, line) for row, line in zip(rows, lines, strict=True)]).T
    _check_order(header, lines, x, y)
    told: float | None = None
    if header[1] == TERRAIN[1]:
        if not x[0] <= 0.0 < x[-1]:
            raise ValueError(
                f"x_m runs from {x[0]:g} to {x[-1]:g} m: must hold 0, where descents start; shift it so that it does"
            )
        mean = math.degrees(math.atan2(y[0] - y[-1], x[-1] - x[0]))
        told = round(mean, 6) if angle_deg is None else angle_deg
        (cosine,), (sine,) = directions(np.radians([told]))
        z = y - np.interp(0.0, x, y)
        x, y = x * cosine - z * sine, x * sine + z * cosine
    vertices = np.column_stack([x, y]) + 0.0
    problem = too_steep(vertices)
    if problem is not None:
        k, text = problem
        over = "" if told is None else f" of {told:g} degrees"
        raise ValueError(f"line {lines[k]}: the piece from line {lines[k - 1]} to here {text}{over}")
    sharp = np.column_stack([vertices, np.zeros(len(x))])
    return _fitted(Ground(vertices, sharp, 0.0, materials, told), tolerance)


def too_steep(vertices: Floats) -> tuple[int, str] | None:
    """Return the first vertex, of shape (n, 2), whose piece before it is steeper than allowed, and what is wrong."""
    along, up = np.diff(vertices, axis=0).T
    steep = ~((along > 0.0) & (np.abs(up) <= math.tan(STEEPEST) * along))
    if not steep.any():
        return None
    k = int(np.argmax(steep))
    angle = math.degrees(math.atan2(up[k], along[k]))
    most = f"{math.degrees(STEEPEST):g} degrees"
    return k + 1, f"is {angle:.3g} degrees steep to the plane: must be at most {most}; move a vertex, or tilt the plane"


def _rows(path: str) -> tuple[tuple[str, ...], list[int], list[list[str]], tuple[str, ...]]:
    """Return the columns of numbers, and of each row its line, its numbers as text and its material."""
    lines: list[int] = []
    rows: list[list[str]] = []
    with Path(path).open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        try:
            for row in reader:
                cells = [cell.strip() for cell in row]
                if any(cells) and not cells[0].startswith("#"):
                    lines.append(reader.line_num)
                    rows.append(cells)
        except UnicodeDecodeError as problem:
            raise ValueError(f"must be text in UTF-8, but byte {problem.start + 1} is not") from problem
    header = rows[0] if rows else []
    named = tuple(name for name in header if name != MATERIAL)
    if sorted(named) not in (sorted(FLAT), sorted(TERRAIN)) or len(set(header)) < len(header):
        first = f"line {lines[0]} = {','.join(header)!r}" if rows else "the file is empty"
        raise ValueError(f"{first}: must name the columns, {_COLUMNS}, and {MATERIAL} if there is one; with commas")
    for line, row in zip(lines[1:], rows[1:], strict=True):
        if len(row) != len(header):
            raise ValueError(f"line {line}: has {len(row)} values: must have {len(header)}, {', '.join(header)}")
    if len(rows) < 3:
        raise ValueError(f"holds {max(len(rows) - 1, 0)} vertices: must hold at least 2")
    columns = FLAT if FLAT[1] in named else TERRAIN
    numbers = [[row[header.index(name)] for name in columns] for row in rows[1:]]
    materials = tuple(row[header.index(MATERIAL)] for row in rows[1:]) if MATERIAL in header else ()
    return columns, lines[1:], numbers, materials


def _numbers(header: tuple[str, ...], texts: list[str], line: int) -> list[float]:
    """Return the numbers of a line, or raise ValueError."""
    found = []
    for name, text in zip(header, texts, strict=True):
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            gap = (
                "" if text else "; leave out the line where nothing is known: the ground is straight between the others"
            )
            raise ValueError(
                f"line {line}: {name} = {text!r}: must be a finite number of metres, with a decimal point{gap}"
            )
        found.append(number)
    return found


def _check_order(header: tuple[str, ...], lines: list[int], x: Floats, y: Floats) -> None:
    """Raise ValueError unless x increases from line to line."""
    falls = np.flatnonzero(np.diff(x) <= 0.0)
    if not falls.size:
        return
    k = int(falls[0])
    here, before = f"line {lines[k + 1]}", f"line {lines[k]}"
    name, height = header
    if x[k + 1] < x[k]:
        remedy = "put the lines in the order of x" + ("" if (np.diff(x) > 0.0).any() else ": all of them run backwards")
        raise ValueError(f"{here}: {name} = {x[k + 1]:g}: must be > {x[k]:g} m, that of {before}; {remedy}")
    if y[k + 1] == y[k]:
        raise ValueError(f"{here}: {name} = {x[k]:g}, {height} = {y[k]:g}: repeats {before}; leave one of them out")
    raise ValueError(
        f"{here}: {name} = {x[k]:g}: is a vertical step from {height} = {y[k]:g} in {before} to {y[k + 1]:g} m; "
        "let it lean: x must increase, and no piece may be steeper to the plane than "
        f"{math.degrees(STEEPEST):g} degrees"
    )


def _fitted(ground: Ground, tolerance: float | None) -> Ground:
    """Return a ground told by pieces and arcs within a tolerance [m], or raise ValueError for too many vertices."""
    if tolerance is not None:
        told = fit_ground(ground.vertices, tolerance)
        x, y = ground.vertices.T
        ground = ground._replace(told=told, deviation=float(np.abs(height_of(told, x) - y).max()))
    if len(ground.told) > MOST_VERTICES:
        given, remedy = "", "slope.tolerance_m, say 0.01, lets pieces and arcs tell the ground"
        if tolerance is not None:
            given, remedy = f" with tolerance_m = {tolerance}", "give more"
        remedy += ", the most that the ground moves by that"
        raise ValueError(f"holds {len(ground.told)} vertices{given}: must hold at most {MOST_VERTICES}; {remedy}")
    return ground


# Zones by piece.


def placed(zones: Any, ground: Ground, length: float) -> Any:
    """Return the zones of a file of configuration, those that are given by pieces or by a material by their places.

    What is no list of mappings is returned as it is. A zone that holds the finish, at x = ``length`` [m], goes on; what
    is behind it is left out.

    Raises
    ------
    ValueError
        Naming the zone, its value and what is allowed.
    """
    if not isinstance(zones, list | tuple) or not all(isinstance(zone, dict) for zone in zones):
        return zones
    if not any({"pieces", MATERIAL} & zone.keys() for zone in zones):
        return zones
    found: list[dict[str, Any]] = []
    for k, zone in enumerate(zones):
        rest = {key: value for key, value in zone.items() if key not in ("pieces", MATERIAL)}
        both = [key for key in ("begin_m", "end_m", "pieces", MATERIAL) if zone.get(key) is not None]
        if len(both) > 1 and both != ["begin_m", "end_m"]:
            raise ValueError(
                f"zones.{k}: must have either begin_m and end_m, pieces or {MATERIAL}, not {' and '.join(both)}"
            )
        if zone.get("pieces") is not None:
            found.append(rest | _reach(*_pieces(zone["pieces"], k, ground), ground, length))
        elif zone.get(MATERIAL) is not None:
            reaches = (_reach(*run, ground, length) for run in _runs(zone[MATERIAL], k, ground))
            found += [rest | reach for reach in reaches if reach["begin_m"] < length]
        else:
            found.append(rest)
    if len(found) > MOST_ZONES:
        remedy = "let the commonest be that of the contact, without a zone, or join pieces"
        zones_made = f"zones: the materials make {len(found)} zones, one behind the other"
        raise ValueError(f"{zones_made}: must be at most {MOST_ZONES}; {remedy}")
    return sorted(found, key=_begin)


def _pieces(value: Any, k: int, ground: Ground) -> tuple[int, int]:
    most = len(ground.vertices) - 2
    if most < 0:
        raise ValueError(f"zones.{k}.pieces = {value!r}: must be left out: the slope has no profile")
    whole = isinstance(value, list | tuple) and all(type(number) is int for number in value) and len(value) == 2
    if not whole or not 0 <= value[0] <= value[1] <= most:
        allowed = f"a pair [first, last] of whole numbers in [0, {most}], pieces of the profile"
        raise ValueError(f"zones.{k}.pieces = {value!r}: must be {allowed}")
    return value[0], value[1]


def _runs(name: Any, k: int, ground: Ground) -> list[tuple[int, int]]:
    """Return the first and the last of the pieces of a material, of each run of them."""
    known = sorted(set(ground.materials) - {""})
    if name not in known:
        allowed = f"one of {', '.join(known)}" if known else f"left out: the profile has no column {MATERIAL}"
        raise ValueError(f"zones.{k}.{MATERIAL} = {name!r}: must be {allowed}")
    of_it = np.r_[False, np.array(ground.materials) == name, False]
    begins, ends = np.flatnonzero(~of_it[:-1] & of_it[1:]), np.flatnonzero(of_it[:-1] & ~of_it[1:])
    return list(zip(begins.tolist(), (ends - 1).tolist(), strict=True))


def _reach(first: int, last: int, ground: Ground, length: float) -> dict[str, Any]:
    """Return where pieces begin and end; what goes on behind the last vertex or the finish has no end."""
    x = [*ground.vertices[:, 0].tolist(), math.inf]
    return {"begin_m": x[first], "end_m": x[last + 1] if x[last + 1] <= length else None}


def _begin(zone: dict[str, Any]) -> float:
    begin = zone.get("begin_m")
    begin = begin[0] if isinstance(begin, list | tuple) and begin else begin
    return float(begin) if isinstance(begin, int | float) else math.inf
