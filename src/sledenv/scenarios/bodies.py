"""Body of a scenario's file: one of the kinds that the simulator makes, or a choice of them."""

from __future__ import annotations

import math
import re
from abc import abstractmethod
from typing import Annotated, Final, Literal, Self

import numpy as np
from pydantic import Field, StrictBool, StrictStr, ValidationInfo, field_validator, model_validator

from sledenv.scenarios.configuration import Pair, Point, Points, Quantity, Section, Whole
from sledenv.simulation.bodies import Body, holds_its_mass_centre, least_eccentricity, segment
from sledenv.simulation.outlines import Arc, hull_of_circles, mass_properties
from sledenv.simulation.shapes import circular_segment, hull, lamina, polygon
from sledenv.simulation.sleds import sled

_ROWS: Final = 200  # of an outline; how many arcs it may have is up to the simulator
# Of rocks: convex hulls of rounded points on an ellipse, with the mass of an ellipsoid.
_UNEVEN: Final = 0.35  # of the angle between two points of an even rock: how far each may be off its place
_SHAPES: Final = 2**32
_ELLIPSOID: Final = 2.0 / 3.0  # of the cylinder around it
_GYRATION: Final = 0.8  # moment of inertia of an ellipsoid over that of an elliptic cylinder, of the same mass


class BodySection(Section):
    """Keys of all bodies."""

    kind: str
    drag_area_m2: Annotated[float, Quantity("[0, inf) m^2")] = 0.0  # c_d A: docs/physics.md, 9.2

    @abstractmethod
    def build(self) -> Body:
        """Return the body of the simulator."""


class DiscBody(BodySection):
    """A full disc whose mass centre lies off its axis."""

    kind: Literal["disc"]
    mass_kg: Annotated[float, Quantity("[1e-50, 1e+50] kg")]
    radius_m: Annotated[float, Quantity("[1e-50, 1e+50] m")]
    eccentricity_m: Annotated[float, Quantity("[0, 1e+50] m")]
    inertia_kg_m2: Annotated[float, Quantity("[1e-250, 1e+150] kg m^2")]  # about the mass centre

    @field_validator("eccentricity_m")
    @classmethod
    def _mass_centre_inside(cls, eccentricity: float, info: ValidationInfo) -> float:
        radius = info.data.get("radius_m", math.inf)
        if eccentricity >= radius:
            raise ValueError(f"must be a number in [0, radius_m) = [0, {radius:g}) m")
        return eccentricity

    @field_validator("inertia_kg_m2")
    @classmethod
    def _mass_within_the_rim(cls, inertia: float, info: ValidationInfo) -> float:
        if {"mass_kg", "radius_m", "eccentricity_m"} <= info.data.keys():
            mass, radius, eccentricity = (info.data[key] for key in ("mass_kg", "radius_m", "eccentricity_m"))
            highest = mass * (radius - eccentricity) * (radius + eccentricity)
            if inertia > highest * (1.0 + 1e-9):
                raise ValueError(f"must be a number in (0, m (r^2 - h^2)] = (0, {highest:g}] kg m^2")
        return inertia

    def build(self) -> Body:
        """Return the body of the simulator."""
        numbers = self.mass_kg, self.radius_m, self.eccentricity_m, self.inertia_kg_m2
        return segment(*numbers, drag_area=self.drag_area_m2)


class SegmentBody(BodySection):
    """A uniform lamina bounded by an arc and its chord."""

    kind: Literal["segment"]
    mass_kg: Annotated[float, Quantity("[1e-50, 1e+50] kg")]
    radius_m: Annotated[float, Quantity("[1e-50, 1e+50] m")]
    half_angle_deg: Annotated[float, Quantity("(0, 180] deg")]  # of the arc

    def build(self) -> Body:
        """Return the body of the simulator."""
        return circular_segment(self.mass_kg, self.radius_m, math.radians(self.half_angle_deg), self.drag_area_m2)


class SledBody(BodySection):
    """A skeleton sled with its rider, who lies on it head first; its parts are runner, frame, legs and rider."""

    kind: Literal["sled"]
    rider_mass_kg: Annotated[float, Quantity("[1e-50, 1e+50] kg")] = 80.0
    sled_mass_kg: Annotated[float, Quantity("[1e-50, 1e+50] kg")] = 40.0
    rider_height_m: Annotated[float, Quantity("[1e-50, 1e+50] m")] = 1.75
    length_m: Annotated[float, Quantity("[1e-50, 1e+50] m")] = 0.95
    height_m: Annotated[float, Quantity("[1e-50, 1e+50] m")] = 0.1  # of the deck
    bow_radius_m: Annotated[float, Quantity("[1e-50, 1e+50] m")] = 15.0  # of the runners
    balance: Annotated[float, Quantity("(-1, 1)")] = 0.0  # of the rider in front of the middle, over half the length

    @model_validator(mode="after")
    def _holds_together(self) -> Self:
        try:
            self.build()
        except ValueError as error:
            raise ValueError(str(error).removeprefix("sled.")) from None
        return self

    def build(self) -> Body:
        """Return the body of the simulator."""
        given = {
            "rider_height": self.rider_height_m,
            "length": self.length_m,
            "height": self.height_m,
            "bow_radius": self.bow_radius_m,
            "balance": self.balance,
            "drag_area": self.drag_area_m2,
        }
        return sled(self.rider_mass_kg, self.sled_mass_kg, **given)


class OutlinedBody(BodySection):
    """A body that is told by its outline: a uniform lamina, unless its inertia and its mass centre are given."""

    mass_kg: Annotated[float, Quantity("[1e-50, 1e+50] kg")]
    inertia_kg_m2: Annotated[float | None, Quantity("[1e-250, 1e+150] kg m^2")] = None  # about the mass centre
    centre_m: Annotated[Pair | None, Point("[-1e+50, 1e+50] m")] = None  # the mass centre, in the frame of the outline

    @model_validator(mode="after")
    def _can_be_built(self) -> Self:
        try:
            self.build()
        except ValueError as error:
            raise ValueError(re.sub(r"\b(?:polygon|hull|lamina|Body)\.(\w+)", self._key, str(error))) from None
        return self

    @classmethod
    def _key(cls, argument: re.Match[str]) -> str:
        """Return the key that an argument of the simulator is told by, if one is: its name with a unit."""
        return next((key for key in cls.model_fields if f"{key}_".startswith(f"{argument[1]}_")), argument[0])

    @property
    def _weight(self) -> tuple[float | None, Pair | None, float]:
        """Last arguments of makers of outlines: inertia, mass centre and drag area."""
        return self.inertia_kg_m2, self.centre_m, self.drag_area_m2


class PolygonBody(OutlinedBody):
    """A convex polygon, with corners that may be rounded."""

    kind: Literal["polygon"]
    points_m: Annotated[tuple[Pair, ...], Points("[-1e+50, 1e+50] m", 3, _ROWS)]  # in either direction of turn
    rounding_m: Annotated[float, Quantity("[0, 1e+50] m")] = 0.0  # radius of the corners
    parts: tuple[StrictStr, ...] | None = None  # names of the corners
    sides: tuple[StrictStr, ...] | None = None  # and of the sides, from each corner to the next one

    def build(self) -> Body:
        """Return the body of the simulator."""
        return polygon(self.mass_kg, self.points_m, self.rounding_m, self.parts, self.sides, *self._weight)


class HullBody(OutlinedBody):
    """The convex hull of circles."""

    kind: Literal["hull"]
    circles_m: Annotated[
        tuple[tuple[float, float, float], ...],
        Points("[-1e+50, 1e+50] m", 1, _ROWS, "triples [x, y, radius]"),
    ]
    parts: tuple[StrictStr, ...] | None = None  # names of the circles
    sides: tuple[StrictStr, ...] | None = None  # and of the straight sides, behind each circle clockwise

    def build(self) -> Body:
        """Return the body of the simulator."""
        return hull(self.mass_kg, self.circles_m, self.parts, self.sides, *self._weight)


class ArcSection(Section):
    """One arc of an outline: see :class:`sledenv.bodies.Arc`."""

    x_m: Annotated[float, Quantity("[-1e+50, 1e+50] m")]
    y_m: Annotated[float, Quantity("[-1e+50, 1e+50] m")]
    radius_m: Annotated[float, Quantity("[0, 1e+50] m")]
    begin_rad: Annotated[float, Quantity("[-3.141592653589793, 3.141592653589793) rad")]
    part: StrictStr = "arc"
    side: StrictStr = "side"
    corner: StrictBool | None = None


class ArcsBody(OutlinedBody):
    """Any convex outline, told by its arcs."""

    kind: Literal["arcs"]
    arcs: Annotated[tuple[ArcSection, ...], Field(min_length=1)]

    def build(self) -> Body:
        """Return the body of the simulator."""
        arcs = [Arc(*(value for _, value in arc)) for arc in self.arcs]
        return lamina(self.mass_kg, arcs, *self._weight)


class CustomBody(BodySection):
    """Any segment of the simulator."""

    kind: Literal["custom"]
    mass_kg: Annotated[float, Quantity("[1e-50, 1e+50] kg")]
    radius_m: Annotated[float, Quantity("[0, 1e+50] m")]
    eccentricity_m: Annotated[float, Quantity("[0, 1e+50] m")]
    inertia_kg_m2: Annotated[float, Quantity("[1e-250, 1e+150] kg m^2")]  # about the mass centre
    half_angle_deg: Annotated[float, Quantity("(0, 180] deg")] = 180.0

    @model_validator(mode="after")
    def _mass_centre_inside(self) -> Self:
        half_angle = math.radians(self.half_angle_deg)
        if not holds_its_mass_centre(self.radius_m, self.eccentricity_m, half_angle):
            least = least_eccentricity(self.radius_m, half_angle)
            allowed = f"[max(radius_m cos(half_angle_deg), 0), radius_m] = [{least:g}, {self.radius_m:g}] m"
            raise ValueError(f"eccentricity_m = {self.eccentricity_m:g}: must be a number in {allowed}")
        return self

    def build(self) -> Body:
        """Return the body of the simulator."""
        numbers = self.mass_kg, self.radius_m, self.eccentricity_m, self.inertia_kg_m2
        return segment(*numbers, math.radians(self.half_angle_deg), self.drag_area_m2)


class RockBody(BodySection):
    """A rock as it is seen from the side; across the plane of motion it is as thick as an ellipsoid.

    Its points lie on an ellipse, at uneven angles that ``shape`` decides: equal numbers are equal rocks.
    """

    kind: Literal["rock"]
    length_m: Annotated[float, Quantity("(0, inf) m")]  # long axis of the ellipse
    width_ratio: Annotated[float, Quantity("(0, 1]")] = 0.8  # short axis of the ellipse over the long one
    depth_ratio: Annotated[float, Quantity("(0, inf)")] = 0.7  # axis across the plane of motion over the long one
    points: Annotated[int, Whole("[3, 12]")] = 8
    rounding: Annotated[float, Quantity("(0, 1)")] = 0.3  # radius of the points over half of the short axis
    density_kg_m3: Annotated[float, Quantity("(0, inf) kg/m^3")] = 2700.0
    shape: Annotated[float, Quantity("[0, 1]")] = 0.5  # which of all rocks with such numbers

    def build(self) -> Body:
        """Return the body of the simulator."""
        uneven = np.random.default_rng(int(self.shape * _SHAPES)).uniform(-_UNEVEN, _UNEVEN, self.points)
        angle = 2.0 * math.pi / self.points * (np.arange(self.points) + uneven)
        half, width = 0.5 * self.length_m, self.width_ratio
        radius = self.rounding * width * half
        x, y = (half - radius) * np.cos(angle), (width * half - radius) * np.sin(angle)
        circles = np.column_stack([x, y, np.full(self.points, radius)])
        names = [f"corner {k}" for k in range(1, self.points + 1)]
        one = lamina(1.0, hull_of_circles(circles, names, ["side"] * self.points))
        area, _, _ = mass_properties(one.arcs)
        mass = self.density_kg_m3 * _ELLIPSOID * area * self.depth_ratio * self.length_m
        return one.replace(mass=mass, inertia=_GYRATION * mass * one.inertia, drag_area=self.drag_area_m2)


OneBody = DiscBody | SegmentBody | SledBody | PolygonBody | HullBody | ArcsBody | CustomBody | RockBody


class ChoiceBody(Section):
    """One of several bodies, drawn anew for each context."""

    kind: Literal["choice"]
    of: Annotated[tuple[Annotated[OneBody, Field(discriminator="kind")], ...], Field(min_length=2, max_length=12)]


AnyBody = OneBody | ChoiceBody
