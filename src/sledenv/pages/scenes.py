"""A body as the scripts of pages draw it: templates/scene.js."""

from __future__ import annotations

from typing import Any

from sledenv.plot.riders import HULL, TOUCHED, pieces
from sledenv.plot.shapes import body_outline, heavy_side
from sledenv.simulation.bodies import Body


def drawn_body(body: Body) -> dict[str, Any]:
    """Return outlines [m] from the mass centre; of a sled with its rider also the pieces of both, and their colours."""
    drawn: dict[str, Any] = {"outline": body_outline(body, 0.0, 0.0, 0.0), "heavy": heavy_side(body, 0.0, 0.0, 0.0)}
    found = [piece._asdict() for piece in pieces(body)]
    return drawn | {"pieces": found, "hull": HULL, "touched": TOUCHED} if found else drawn
