"""Terrain: a section of a hillside, with the material of each of its pieces, and what rocks meet there."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator

from sledenv.scenarios.configuration import Quantity, Section
from sledenv.scenarios.terrain import read_ground
from sledenv.simulation.records import MOST_ZONES
from sledenv.simulation.scene import MOST_VERTICES, STEEPEST

COLUMNS: Final = ("x_m", "z_m", "material")


class Place(NamedTuple):
    """A point of a section."""

    x: float  # [m] horizontal, from 0 on
    z: float  # [m] height
    material: str  # of the piece that begins here


class Run(NamedTuple):
    """Pieces of one material, one behind the other."""

    material: str
    begin: float  # [m]
    end: float  # [m], inf for the last one


def _checked(given: Any) -> tuple[Place, ...]:
    """Return the points of a section, or raise ValueError that says which is wrong and on which line of a table."""
    if not isinstance(given, list | tuple) or not 2 <= len(given) <= MOST_VERTICES:
        raise ValueError(
            f"must be the name of a CSV file, or a list of 2 to {MOST_VERTICES} points [x_m, z_m, material]"
        )
    places: list[Place] = []
    number = Quantity("(-inf, inf) m")
    for k, point in enumerate(given):
        where = f"point {k + 1} (line {k + 2} of a CSV file)"
        if not isinstance(point, list | tuple) or len(point) != len(COLUMNS) or not isinstance(point[2], str):
            raise ValueError(f"{where} is {point!r}: must be [x_m, z_m, material]")
        try:
            place = Place(number.number(point[0]), number.number(point[1]), point[2])
        except ValueError as error:
            raise ValueError(f"{where} is {point!r}: {error}") from None
        if not places and place.x != 0.0:
            raise ValueError(f"{where}, x_m = {place.x:g}: must be 0, for places are told from there")
        if places:
            _check_piece(where, places[-1], place)
        places.append(place)
    runs = len(_runs(tuple(places)))
    if runs > MOST_ZONES:
        raise ValueError(f"the material changes {runs - 1} times: may change {MOST_ZONES - 1} times")
    return tuple(places)


def _check_piece(where: str, before: Place, here: Place) -> None:
    if not here.x > before.x:
        raise ValueError(f"{where}, x_m = {here.x:g}: must be above that of the point before, {before.x:g}")
    if abs(here.z - before.z) > math.tan(STEEPEST) * (here.x - before.x):
        steep = math.degrees(math.atan2(abs(here.z - before.z), here.x - before.x))
        raise ValueError(
            f"{where}: the piece before it is {steep:.1f} degrees steep, must be at most {math.degrees(STEEPEST):g}: "
            "move one of its ends along x"
        )


def _runs(places: tuple[Place, ...]) -> list[Run]:
    pieces = places[:-1]
    first = [k for k, place in enumerate(pieces) if k == 0 or place.material != pieces[k - 1].material]
    ends = [pieces[k].x for k in first[1:]] + [math.inf]
    return [Run(pieces[k].material, pieces[k].x, end) for k, end in zip(first, ends, strict=True)]


class TerrainSection(Section):
    """The hillside."""

    section: Annotated[tuple[Place, ...], BeforeValidator(_checked)]

    @property
    def runs(self) -> list[Run]:
        """Pieces of one material each, in order along x."""
        return _runs(self.section)

    @property
    def length(self) -> float:
        """Where the section ends [m]."""
        return self.section[-1].x

    @property
    def vertices(self) -> NDArray[np.float64]:
        """Points x and height over the last point [m], shape (n, 2)."""
        last = self.section[-1].z
        return np.array([(place.x, place.z - last) for place in self.section])


class MaterialSection(Section):
    """What the ground is made of, as far as a rock feels it."""

    restitution: Annotated[float, Quantity("(0, 1]")]
    friction: Annotated[float, Quantity("[0, inf)")]
    rolling_arm_m: Annotated[float, Quantity("[0, inf) m")]
    stiffness_n_m: Annotated[float, Quantity("(0, inf) N/m")]


def read_section(file: Path) -> list[list[Any]]:
    """Read the points of a section from a table with the columns ``x_m``, ``z_m`` and ``material``.

    Raises
    ------
    ValueError
        Naming the file, the line and what is wrong there.
    """
    try:
        ground = read_ground(str(file), 0.0)
    except (OSError, ValueError) as problem:
        raise ValueError(f"{file}: {problem}") from problem
    if ground.angle_deg is None or not ground.materials:
        raise ValueError(f"{file}: must have the columns {', '.join(COLUMNS)}")
    points = zip(ground.vertices.tolist(), ground.materials, strict=True)
    return [[x, z, material] for (x, z), material in points]
