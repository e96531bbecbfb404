"""The ground in pictures: its line, what of it is in sight, and the places, colours and words of zones."""

from __future__ import annotations

import itertools
import math
from typing import Final, NamedTuple

import numpy as np

from sledenv.simulation.grounds import pieces_of
from sledenv.simulation.scene import Slope, tangents

_CHORD: Final = math.radians(3.0)  # by which a chord of a bend turns
_SAGITTA: Final = 1e-3  # [m] how far a chord is from its bend at most
LINE: Final = "#788a9c"  # around a band, with which one as slippery as the ground around it is seen
_ICE, _SNOW, _MAT = (200, 231, 252), (216, 221, 227), (152, 162, 172)  # as slippery as can be, as the ground, rough


def surface(vertices: np.ndarray, left: float, right: float) -> np.ndarray:
    """Return the line of the ground between two places.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3) or (n, 2)
        ``Slope.vertices``, or a line that this function has returned and that goes further.
    left, right : float
        Along the slope [m].

    Returns
    -------
    ndarray, shape (m, 2)
        Columns x, y [m] in the slope frame, m >= 2: both places, and the vertices between them, or points of their
        bends, so close that a chord turns by less than 3 degrees and is at most a millimetre from its bend.
    """
    line = _line(vertices) if vertices.shape[1] == 3 else vertices
    between = line[(left < line[:, 0]) & (line[:, 0] < right)]
    heights = np.interp([left, right], *line.T) if len(line) else np.zeros(2)
    return np.insert(np.stack([[left, right], heights], axis=-1), 1, between, axis=0)


def _line(vertices: np.ndarray) -> np.ndarray:
    """Return vertices, and points of bends in place of those that have a radius, shape (m, 2)."""
    if not vertices[:, 2].any():
        return vertices[:, :2]
    points: list[np.ndarray] = []
    pieces = pieces_of(vertices)
    for before, bend in itertools.pairwise(pieces):
        widest = min(_CHORD, math.sqrt(8.0 * _SAGITTA / bend["radius"])) if bend["radius"] > 0.0 else math.inf
        count = math.ceil(abs(bend["tilt"] - before["tilt"]) / widest)
        tilts = before["tilt"] + (bend["tilt"] - before["tilt"]) * np.linspace(0.0, 1.0, count + 1)
        out = bend["bend"] * bend["radius"] * np.stack([-np.sin(tilts), np.cos(tilts)], axis=-1)
        centre = np.array([bend["qx"], bend["qy"]])
        points.append(out + centre if bend["radius"] > 0.0 else centre[np.newaxis])
    return np.concatenate(points)


def below(line: np.ndarray, depth: float) -> np.ndarray:
    """Return the points so far [m] below each piece of a line of the ground, shape (n, 2) as the line."""
    along = tangents(line)[1:-1]
    before, behind = along[[0, *range(len(along))]], along[[*range(len(along)), -1]]
    both = before + behind
    aside = np.stack([both[:, 1], -both[:, 0]], axis=-1) / (1.0 + (before * behind).sum(axis=1))[:, np.newaxis]
    return np.asarray(line + depth * aside)


def in_sight(line: np.ndarray, shown: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[float, float]:
    """Return between which places [m] a line of the ground is in a picture; the first is larger if it is nowhere.

    Parameters
    ----------
    line : ndarray, shape (n, 2)
        In the slope frame [m].
    shown : ndarray, shape (n, 2)
        The same points where the picture has them, in any unit.
    low, high : ndarray, shape (2,)
        Two opposite corners of the picture in that unit.
    """
    start, step = shown[:-1], np.diff(shown, axis=0)
    with np.errstate(over="ignore"):
        crossed = np.sort((np.array([low, high])[:, np.newaxis] - start) / np.where(step == 0.0, 1e-300, step), axis=0)
    enters, leaves = np.maximum(crossed[0].max(axis=1), 0.0), np.minimum(crossed[1].min(axis=1), 1.0)
    x, inside = line[:-1, 0], enters <= leaves
    if not inside.any():
        return math.inf, -math.inf
    first, last = ((x + share * np.diff(line[:, 0]))[inside] for share in (enters, leaves))
    return float(first[0]), float(last[-1])


class Band(NamedTuple):
    """A zone, to be drawn as a band below the surface."""

    begin: float  # [m] along the slope
    end: float
    colour: str  # "#rrggbb": light blue where it is more slippery than the ground around it, darker where less so
    words: str  # its friction
    brief: str  # the same where there is less room

    def label(self, room: float) -> str:
        """Return the words for which a room so many letters wide is enough; none if need be."""
        return next((text for text in (self.words, self.brief) if len(text) + 1.0 <= room), "")

    def outline(self, vertices: np.ndarray, depth: float) -> np.ndarray:
        """Corners [m] of the band, so deep below each piece of the ground of :func:`surface`, shape (n, 2)."""
        line = surface(vertices, self.begin, self.end)
        return np.concatenate([line, below(line, depth)[::-1]])


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
