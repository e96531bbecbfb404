"""Bodies: their makers, and the outlines that they are made of.

:func:`segment`, :func:`circular_segment`, :func:`disc`, :func:`rod`, :func:`polygon`, :func:`hull` and :func:`sled`
make a :class:`Body`, which is a mass, a moment of inertia and an outline of :class:`Arc`.
"""

from sledenv.simulation.bodies import Body, Segment, segment
from sledenv.simulation.outlines import Arc
from sledenv.simulation.shapes import circular_segment, disc, hull, polygon, rod
from sledenv.simulation.sleds import sled

__all__ = [
    "Arc",
    "Body",
    "Segment",
    "circular_segment",
    "disc",
    "hull",
    "polygon",
    "rod",
    "segment",
    "sled",
]
