"""The zones of a slope in pictures: their places, colours and words, and how much friction there is where."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sledenv.simulation.scene import AnyLaw, Slope

LINE: Final = "#788a9c"  # around a band, with which one as slippery as the ground around it is seen
_ICE, _SNOW, _MAT = (200, 231, 252), (216, 221, 227), (152, 162, 172)  # as slippery as can be, as the ground, rough


class Band(NamedTuple):
    """A zone, to be drawn as a band below the surface."""

    begin: float  # [m] along the slope
    end: float
    colour: str  # "#rrggbb": light blue where it is more slippery than the ground around it, darker where less so
    words: str  # its friction
    brief: str  # the same where there is less room

    def label(self, room: float) -> str:
        """What there is room for, which is so many letters wide; nothing if need be."""
        return next((text for text in (self.words, self.brief) if len(text) + 1.0 <= room), "")


def bands(slope: Slope, friction: float, left: float = -math.inf, right: float = math.inf) -> list[Band]:
    """Return the zones of a slope to be drawn between two places [m], cut off there.

    Parameters
    ----------
    slope : Slope
        Its zones.
    friction : float
        Of the ground around them [-].
    left, right : float
        What is in sight [m].
    """
    found = []
    for zone in slope.zones:
        begin, end = max(zone.begin, left), min(zone.end, right)
        if begin < end:
            brief = f"{zone.friction:.3g}"
            found.append(Band(begin, end, _colour(zone.friction, friction), f"friction {brief}", brief))
    return found


def _colour(friction: float, around: float) -> str:
    both = friction + around
    share = (friction - around) / both if both > 0.0 else 0.0
    most = _MAT if share > 0.0 else _ICE
    return "#" + "".join(f"{round(a + abs(share) * (b - a)):02x}" for a, b in zip(_SNOW, most, strict=True))


def frictions(law: AnyLaw, slope: Slope, places: ArrayLike) -> np.ndarray:
    """Return the Coulomb coefficient [-] at places along a slope [m], of the same shape."""
    where = np.asarray(places, dtype=float)
    found = np.full(where.shape, law.friction)
    for zone in slope.zones:
        found[(where >= zone.begin) & (where < zone.end)] = zone.friction
    return found
