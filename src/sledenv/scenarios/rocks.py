"""Rocks: convex hulls of rounded points on an ellipse, with the mass of an ellipsoid."""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal

import numpy as np

from sledenv.scenarios.configuration import Quantity, Section, Whole
from sledenv.simulation.bodies import Body
from sledenv.simulation.outlines import hull_of_circles, mass_properties
from sledenv.simulation.shapes import lamina

_UNEVEN: Final = 0.35  # of the angle between two points of an even rock: how far each may be off its place
_SHAPES: Final = 2**32
_ELLIPSOID: Final = 2.0 / 3.0  # of the cylinder around it
_GYRATION: Final = 0.8  # moment of inertia of an ellipsoid over that of an elliptic cylinder, of the same mass


class RockBody(Section):
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
        return one.replace(mass=mass, inertia=_GYRATION * mass * one.inertia)
