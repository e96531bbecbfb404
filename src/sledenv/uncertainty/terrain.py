"""Terrain: a section of a hillside, with the material of each of its pieces, and what rocks meet there."""

from __future__ import annotations

import csv
import math
from collections import defaultdict
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, ValidationInfo, model_validator

from sledenv.scenarios.configuration import Quantity, Section
from sledenv.scenarios.terrain import MATERIAL, TERRAIN, named, read_rows
from sledenv.simulation.records import MOST_ZONES
from sledenv.simulation.terrain import Reader, checked_section, fitted

Floats = NDArray[np.float64]

COLUMNS: Final = (*TERRAIN, MATERIAL)
_STEEPEST: Final = "terrain.steepest_deg"


class Place(NamedTuple):
    """A point of a section."""

    x: float  # [m] horizontal, from 0 on
    z: float  # [m] elevation
    material: str  # of the piece that begins here


class Run(NamedTuple):
    """Pieces of one material, one behind the other."""

    material: str
    begin: float  # [m]
    end: float  # [m], inf for the last one


def _checked(given: Any, info: ValidationInfo) -> tuple[Place, ...]:
    """Return the points of a section, or raise ValueError that says which is wrong."""
    if not isinstance(given, list | tuple) or len(given) < 2:
        raise ValueError("must be the name of a CSV file, or a list of at least 2 points [x_m, z_m, material]")
    number, points, materials = Quantity("(-inf, inf) m"), [], []
    for k, point in enumerate(given):
        where = f"point {k + 1} is {point!r}"
        if not isinstance(point, list | tuple) or len(point) != len(COLUMNS) or not isinstance(named(point[2]), str):
            raise ValueError(f"{where}: must be [x_m, z_m, material]")
        try:
            points.append([number.number(point[0]), number.number(point[1])])
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
        materials.append(named(point[2]).strip())
    reader = Reader("points", lambda k: f"point {k + 1}", TERRAIN, _STEEPEST)
    return _section(np.array(points), materials, reader, info.data.get("steepest_deg"))


def _section(points: Floats, materials: Sequence[str], reader: Reader, steepest: float | None) -> tuple[Place, ...]:
    """Return the points of a section, filled up where it is too steep, or raise ValueError."""
    empty = [k for k, material in enumerate(materials[:-1]) if not material]
    if empty:
        raise ValueError(f"{reader.place(empty[0])}: material is empty: must name that of the piece that begins there")
    found = checked_section(points, points, reader, None if steepest is None else math.radians(steepest))
    if found.vertices[0, 0] != 0.0:
        first = f"{reader.place(0)}: x_m = {found.vertices[0, 0]:g}"
        raise ValueError(f"{first}: must be 0, for places are told from there; shift all points")
    rows = zip(found.vertices.tolist(), found.pieces, strict=True)
    return tuple(Place(x, z, materials[k]) for (x, z), k in rows)


class TerrainSection(Section):
    """The hillside."""

    steepest_deg: Annotated[float | None, Quantity("(0, 80] deg")] = None  # up to which steep faces are filled up
    # Few straight pieces and arcs may tell the ground, and differ from the points by at most this.
    tolerance_m: Annotated[float | None, Quantity("(0, inf) m")] = None
    section: Annotated[tuple[Place, ...], BeforeValidator(_checked)]

    @property
    def runs(self) -> list[Run]:
        """Pieces of one material each, in order along x."""
        pieces = self.section[:-1]
        first = [k for k, place in enumerate(pieces) if k == 0 or place.material != pieces[k - 1].material]
        ends = [pieces[k].x for k in first[1:]] + [math.inf]
        return [Run(pieces[k].material, pieces[k].x, end) for k, end in zip(first, ends, strict=True)]

    @property
    def commonest(self) -> str:
        """The material of most runs, of several the longest: that of the ground outside of all zones."""
        runs: dict[str, int] = defaultdict(int)
        lengths: dict[str, float] = defaultdict(float)
        for run in self.runs:
            runs[run.material] += 1
            lengths[run.material] += min(run.end, self.length) - run.begin
        return max(runs, key=lambda material: (runs[material], lengths[material]))

    @property
    def zones(self) -> list[Run]:
        """Runs of all other materials; one that begins with the section is also what the ground before it is of."""
        commonest = self.commonest
        zones = [run for run in self.runs if run.material != commonest]
        return [run._replace(begin=-self.length) if run.begin == 0.0 else run for run in zones]

    @property
    def length(self) -> float:
        """Where the section ends [m]."""
        return self.section[-1].x

    @property
    def points(self) -> Floats:
        """Points x and elevation [m], shape (n, 2)."""
        return np.array([(place.x, place.z) for place in self.section])

    @property
    def vertices(self) -> Floats:
        """Vertices x and height over the last point, and the radii of their bends [m], shape (m, 3)."""
        return _ground(self)

    @model_validator(mode="after")
    def _zones_fit(self) -> Self:
        if len(self.zones) > MOST_ZONES:
            made = f"the materials make {len(self.zones)} runs beside those of the commonest, {self.commonest}"
            raise ValueError(f"{made}: must be at most {MOST_ZONES}; join short ones with their neighbours")
        try:
            _ground(self)
        except ValueError as error:
            raise ValueError(f"section {error}") from error
        return self


@lru_cache
def _ground(terrain: TerrainSection) -> Floats:
    return fitted(terrain.points - (0.0, terrain.section[-1].z), terrain.tolerance_m, "terrain.tolerance_m")


class MaterialSection(Section):
    """A material of the ground, as far as a rock feels it."""

    restitution: Annotated[float, Quantity("(0, 1]")]
    friction: Annotated[float, Quantity("[0, inf)")]
    rolling_arm_m: Annotated[float, Quantity("[0, inf) m")]
    stiffness_n_m: Annotated[float, Quantity("(0, inf) N/m")]


def read_section(file: Path, steepest_deg: Any = None) -> list[list[Any]]:
    """Read the points of a section from a table with the columns ``x_m``, ``z_m`` and ``material``.

    Parameters
    ----------
    file : Path
        As :func:`sledenv.scenarios.terrain.read_rows` takes it.
    steepest_deg : float, optional
        What ``steepest_deg`` of a terrain is given.

    Raises
    ------
    ValueError
        Naming the file, the line and what is wrong there. A ``steepest_deg`` that is none is left to whoever asks.
    """
    try:
        steepest = TerrainSection.quantities()["steepest_deg"].read(steepest_deg) if steepest_deg is not None else None
    except ValueError:
        steepest = None
    try:
        rows = read_rows(str(file))
        if rows.columns != TERRAIN or not rows.materials:
            raise ValueError(f"its first line must name the columns {', '.join(COLUMNS)}")
        places = _section(rows.points, rows.materials, rows.reader(_STEEPEST), steepest)
    except (OSError, ValueError, csv.Error) as problem:
        raise ValueError(f"{file}: {problem}") from problem
    return [list(place) for place in places]
