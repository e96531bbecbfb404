"""A body and a slope as the scripts of pages draw them: templates/scene.js."""

from __future__ import annotations

from typing import Any

from sledenv.plot.grounds import bands
from sledenv.plot.riders import HULL, TOUCHED, pieces
from sledenv.plot.shapes import body_outline, heavy_side
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import Slope


def drawn_body(body: Body) -> dict[str, Any]:
    """Return outlines [m] from the mass centre; of a sled with its rider also the pieces of both, and their colours."""
    drawn: dict[str, Any] = {"outline": body_outline(body, 0.0, 0.0, 0.0), "heavy": heavy_side(body, 0.0, 0.0, 0.0)}
    found = [piece._asdict() for piece in pieces(body)]
    return drawn | {"pieces": found, "hull": HULL, "touched": TOUCHED} if found else drawn


def drawn_slope(slope: Slope, friction: float) -> dict[str, Any]:
    """Return angle and length of a slope, null without end, and its zones in ground of some friction."""
    return {"angle": slope.angle, "length": slope.length, "zones": [band._asdict() for band in bands(slope, friction)]}
