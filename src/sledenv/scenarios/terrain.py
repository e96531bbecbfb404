"""Files of ground: profiles and sections of terrain out of CSV, checked line by line, and fitted."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.machine.files import read_text
from sledenv.machine.text_tables import check_quotes
from sledenv.simulation.bends import MOST_VERTICES, height_of
from sledenv.simulation.records import MOST_ZONES
from sledenv.simulation.terrain import Reader, checked_section, fitted, over_plane

Floats = NDArray[np.float64]

FLAT: Final = ("x_m", "y_m")  # columns of a profile: along the plane of the slope, and over it
TERRAIN: Final = ("x_m", "z_m")  # of a section: horizontal, and over the sea
MATERIAL: Final = "material"  # of the piece that begins in a line; optional
_MOST_BYTES: Final = 2**23
_MOST_LINES: Final = 4 * MOST_VERTICES  # of which a tolerance makes few vertices, in a minute
_HEADER: Final = (
    f"must name the columns, {', '.join(FLAT)} (along the plane of the slope, and over it) or {', '.join(TERRAIN)} "
    f"(horizontal, height), and {MATERIAL} if there is one; with commas"
)
_COMMENT: Final = "#"
_NUMBER: Final = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")


class Rows(NamedTuple):
    """Points that the lines of a file hold, one behind the other."""

    columns: tuple[str, str]  # FLAT or TERRAIN
    lines: list[int]  # of the file, from 1 on; shape (n,)
    points: Floats  # [m] shape (n, 2)
    materials: tuple[str, ...]  # of the piece behind each point, "" where none is named; () without the column

    def reader(self, steepest: str) -> Reader:
        """Return how messages call its points, and the key that fills up what is steep."""
        return Reader("lines", lambda k: f"line {self.lines[k]}", self.columns, steepest)


class Ground(NamedTuple):
    """Ground that a file tells."""

    vertices: Floats  # x along the plane of the slope and y over it [m], as in the file or filled up, shape (n, 2)
    told: Floats  # vertices and their radii [m] that tell it within the tolerance, shape (m, 3)
    deviation: float  # [m] most that a vertex of the file has moved by that, along the normal of the plane
    materials: tuple[str, ...]  # of the piece behind each vertex, "" where none is named; () without the column
    angle_deg: float | None  # of the plane, where the file is a section of terrain
    numbers: NDArray[np.intp]  # of the piece of the file behind each vertex, shape (n,)


def read_ground(
    path: str, angle_deg: float | None = None, tolerance: float | None = None, steepest_deg: float | None = None
) -> Ground:
    """Read a profile or a section of terrain.

    Parameters
    ----------
    path : str
        Of a CSV file as :func:`read_rows` takes it.
    angle_deg : float, optional
        Of the plane over which terrain is measured; by default that through its first and its last place, to a
        millionth of a degree. Its origin is the ground at x_m = 0.
    tolerance : float, optional
        Tell the ground by few straight pieces and arcs, so that it moves by at most this [m], along the normal of the
        plane: see :func:`sledenv.simulation.smoothing.fit_ground`.
    steepest_deg : float, optional
        Fill faces up that are steeper to the plane, and overhangs, and warn by how much: see
        :func:`sledenv.simulation.terrain.checked_section`.

    Raises
    ------
    OSError, ValueError
        Naming the line, its value and what is allowed.
    """
    rows = read_rows(path)
    vertices, told = rows.points, None
    reader = rows.reader("slope.steepest_deg")._replace(plane=" to the plane", tilt="or tilt the plane, ")
    if rows.columns == TERRAIN:
        vertices, told = over_plane(rows.points, angle_deg, reader)
        reader = reader._replace(tilt=f"or tilt the plane of {told:g} degrees, ")
    section = checked_section(
        rows.points, vertices, reader, None if steepest_deg is None else math.radians(steepest_deg)
    )
    fit = fitted(section.vertices, tolerance, "slope.tolerance_m")
    x, y = section.vertices.T
    deviation = 0.0 if tolerance is None else float(np.abs(height_of(fit, x) - y).max())
    materials = tuple(rows.materials[k] for k in section.pieces) if rows.materials else ()
    return Ground(section.vertices, fit, deviation, materials, told, section.pieces)


def read_rows(path: str) -> Rows:
    """Read the points of a profile or of a section of terrain.

    Parameters
    ----------
    path : str
        Of a CSV file whose first line names the columns: ``x_m, y_m``, vertices over the plane of the slope, or
        ``x_m, z_m``, a section of terrain. A column ``material`` may name that of the piece that begins in its line.
        Lines that are empty or begin with # are skipped.

    Raises
    ------
    OSError, ValueError
        Naming the line, its value and what is allowed.
    """
    text = read_text(Path(path), _MOST_BYTES)
    if (count := text.count("\n")) > _MOST_LINES:
        raise ValueError(f"has {count} lines: must have at most {_MOST_LINES}; leave some out, or cut the section")
    header: list[str] = []
    lines: list[int] = []
    rows: list[list[str]] = []
    comment = 0  # line of the first comment that names columns
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith(_COMMENT):
            comment = comment or number * (FLAT[0] in line)
            continue
        cells = [cell.strip() for cell in next(csv.reader([line]), [])]
        if not any(cells):
            continue
        if not header:
            _check_header(cells, number, comment)
            header = cells
            continue
        check_quotes(line, number)
        if len(cells) != len(header):
            raise ValueError(f"line {number}: has {len(cells)} values: must have {len(header)}, {', '.join(header)}")
        lines.append(number)
        rows.append(cells)
    if not header:
        raise ValueError(f"the file is empty: {_HEADER}")
    if len(rows) < 2:
        raise ValueError(f"holds {len(rows)} vertices: must hold at least 2")
    columns = FLAT if FLAT[1] in header else TERRAIN
    places = [header.index(name) for name in columns]
    points = [
        [_number(name, row[k], number) for name, k in zip(columns, places, strict=True)]
        for number, row in zip(lines, rows, strict=True)
    ]
    materials = tuple(row[header.index(MATERIAL)] for row in rows) if MATERIAL in header else ()
    return Rows(columns, lines, np.array(points) + 0.0, materials)


def _check_header(cells: list[str], number: int, comment: int) -> None:
    """Raise ValueError unless the cells of a line name the columns, without telling them: any file may be given."""
    named = sorted(name for name in cells if name != MATERIAL)
    if named not in (sorted(FLAT), sorted(TERRAIN)) or len(set(cells)) < len(cells):
        hint = f"; line {comment} is a comment: leave out its {_COMMENT}, as numpy.savetxt(..., comments='') does"
        raise ValueError(f"line {number}: {_HEADER}{hint if comment else ''}")


def _number(name: str, text: str, line: int) -> float:
    """Return the number that a cell holds, or raise ValueError."""
    number = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(number):
        gap = "" if text else "; leave out the line where nothing is known: the ground is straight between the others"
        raise ValueError(
            f"line {line}: {name} = {text!r}: must be a finite number of metres, with a decimal point{gap}"
        )
    return number


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
            found += [rest | _reach(*run, ground, length) for run in _pieces(zone["pieces"], k, ground)]
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


def named(material: Any) -> Any:
    """Return the name of a material as text, for numbers are as good; anything else as it is."""
    return material if isinstance(material, bool) or not isinstance(material, int | float) else str(material)


def _pieces(value: Any, k: int, ground: Ground) -> list[tuple[int, int]]:
    """Return the first and the last of the pieces that are asked for, of each run of them over what was filled up."""
    if not len(ground.numbers):
        raise ValueError(f"zones.{k}.pieces = {value!r}: must be left out: the slope has no profile")
    most = int(ground.numbers[-1]) - 1
    whole = isinstance(value, list | tuple) and all(type(number) is int for number in value) and len(value) == 2
    if not whole or not 0 <= value[0] <= value[1] <= most:
        allowed = f"a pair [first, last] of whole numbers in [0, {most}], pieces of the profile"
        raise ValueError(f"zones.{k}.pieces = {value!r}: must be {allowed}")
    found = _runs_of((ground.numbers >= value[0]) & (ground.numbers <= value[1]))
    if not found:
        raise ValueError(f"zones.{k}.pieces = {value!r}: all of them are under what slope.steepest_deg filled up")
    return found


def _runs_of(wanted: Any) -> list[tuple[int, int]]:
    """Return the first and the last of each run of what is wanted, a mask."""
    there = np.r_[False, wanted, False]
    begins, ends = np.flatnonzero(~there[:-1] & there[1:]), np.flatnonzero(there[:-1] & ~there[1:])
    return list(zip(begins.tolist(), (ends - 1).tolist(), strict=True))


def _runs(name: Any, k: int, ground: Ground) -> list[tuple[int, int]]:
    """Return the first and the last of the pieces of a material, of each run of them."""
    known = sorted(set(ground.materials) - {""})
    name = named(name)
    if name not in known:
        allowed = f"one of {', '.join(known)}" if known else f"left out: the profile has no column {MATERIAL}"
        raise ValueError(f"zones.{k}.{MATERIAL} = {name!r}: must be {allowed}")
    return _runs_of(np.array(ground.materials) == name)


def _reach(first: int, last: int, ground: Ground, length: float) -> dict[str, Any]:
    """Return where pieces begin and end; what goes on behind the last vertex or the finish has no end."""
    x = [*ground.vertices[:, 0].tolist(), math.inf]
    return {"begin_m": x[first], "end_m": x[last + 1] if x[last + 1] <= length else None}


def _begin(zone: dict[str, Any]) -> float:
    begin = zone.get("begin_m")
    begin = begin[0] if isinstance(begin, list | tuple) and begin else begin
    return float(begin) if isinstance(begin, int | float) else math.inf
