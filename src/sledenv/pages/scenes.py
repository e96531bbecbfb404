"""A body as the scripts of pages draw it: templates/scene.js."""

from __future__ import annotations

from typing import Any

from sledenv.plot.riders import HULL, TOUCHED, pieces
from sledenv.plot.shapes import body_outline, heavy_side
from sledenv.simulation.bodies import Body

_BODY, _HEAVY = "#f6c7a3", "#d55e00"


def drawn_body(body: Body) -> dict[str, Any]:
    """Return an outline [m] from the mass centre, and what is in it: pieces of sled and rider, or the heavy side."""
    found = [piece._asdict() for piece in pieces(body)]
    heavy = {"part": "", "colour": _HEAVY, "points": heavy_side(body, 0.0, 0.0, 0.0)}
    outline = body_outline(body, 0.0, 0.0, 0.0)
    return {"outline": outline, "hull": HULL if found else _BODY, "touched": TOUCHED, "pieces": found or [heavy]}
