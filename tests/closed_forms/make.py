"""Bodies of every kind: round ones, segments, one without an arc, a wheel; other outlines; which arc of one touches."""

from __future__ import annotations

import math

from sledenv.simulation import shapes
from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.shapes import circular_segment, hull, polygon
from tests.bodies import lowest_arc, rod

DISC = segment(1.0, 0.1, 0.05, 7.5e-3)
SLED = circular_segment(100.0, 0.5, math.radians(110.0))
SHELL = circular_segment(10.0, 0.5, math.radians(50.0))
ROD = rod(1.0, 1.0, 1.0 / 3.0)
WHEEL = segment(1.0, 0.1, 0.0, 0.005)
BODIES = {"disc": DISC, "sled": SLED, "shell": SHELL, "rod": ROD, "wheel": WHEEL}

SQUARE = polygon(2.0, [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
STONE = [(0.0, 0.0), (0.9, -0.1), (1.1, 0.3), (0.7, 0.8), (0.1, 0.6)]
OUTLINES = {
    "square": SQUARE,
    "stone": polygon(3.0, STONE),
    "pebble": polygon(3.0, STONE, rounding=0.1),
    "skate": hull(
        5.0,
        [(-0.6, 0.0, 0.1), (0.5, 0.1, 0.3), (0.0, 0.5, 0.0)],
        ["heel", "toe", "top"],
        ["back", "front", "runner"],
        inertia=0.9,
        centre=(0.0, 0.0),
    ),
    "plank": shapes.rod(2.0, 1.5, 0.2),
}


def touching(body: Body, phi: float) -> tuple[float, float, bool]:
    """Arms a, b [m] of the arc that is lowest at an orientation, and whether it is a corner."""
    arc, a, b = lowest_arc(body, phi)
    return a, b, bool(arc.corner)
