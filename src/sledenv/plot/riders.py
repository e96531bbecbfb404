"""A sled and its rider as a reader expects them, inside the outline: runners, deck, and a body head first."""

from __future__ import annotations

import functools
import math
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from sledenv.plot.shapes import DISTINCT, body_outline, strobe_times
from sledenv.simulation.bodies import Body
from sledenv.simulation.interpolation import states_at
from sledenv.simulation.sleds import FRAME, LEGS, RIDER, RUNNER

HULL: Final = "#fbe8d9"  # what is inside the outline, but neither sled nor rider
TOUCHED: Final = "#d673ae"  # the pieces of the part that touches
STEEL, DECK, SUIT, TROUSERS, SLEEVE, HELMET, DARK = (
    "#59646f",
    "#c3ccd5",
    "#7fa8c9",
    "#9dbcd6",
    "#b9d0e3",
    "#d55e00",
    "#2d343c",
)
_FINE: Final = 24  # points of a circle
_APART: Final = 1.6  # sizes of the body between two poses
Circle = tuple[float, float, float]  # x, y and radius [m]


class Piece(NamedTuple):
    """Something to be filled."""

    part: str  # of the body
    colour: str  # "#rrggbb"
    points: np.ndarray  # [m] from the mass centre, frame of the body; closed, shape (n, 2)


class _Anchors(NamedTuple):
    """Arcs of an outline on which a picture of sled and rider hangs."""

    head: Circle
    hips: Circle
    feet: Circle
    bow: Circle
    begin: float  # [rad] of the bow, at its front
    end: float
    round: float  # [m] radius of the ends of the runners


@functools.lru_cache(maxsize=64)
def pieces(body: Body) -> tuple[Piece, ...]:
    """Return what to draw inside the outline of a sled with its rider, from back to front; nothing for other bodies.

    It all follows from the arcs of the outline: the head is the foremost circle of the part "rider", the hips are the
    other one, and both lie on the deck; the feet are the rearmost circle of the part "legs", and the runners are the
    bow with its round ends.

    Parameters
    ----------
    body : Body
        Such as :func:`sledenv.sled` returns.
    """
    anchors = _anchors(body)
    if anchors is None:
        return ()
    outline = body_outline(body, 0.0, 0.0, 0.0, 257)
    drawn = []
    for part, colour, points in _drawn(anchors):
        inside = _clipped(points, outline)
        if len(inside) > 2:
            drawn.append(Piece(part, colour, np.concatenate([inside, inside[:1]])))
    return tuple(drawn)


def pose_times(body: Body, rows: np.ndarray, interval: float) -> np.ndarray:
    """Return the times [s] of the poses of a strobe picture, as :func:`sledenv.plot.shapes.strobe_times` does.

    Poses of a sled with its rider are further apart, as one could not tell them from one another.
    """
    return strobe_times(body, rows, interval, _APART if pieces(body) else DISTINCT)


def strobe_poses(body: Body, rows: np.ndarray, interval: float) -> np.ndarray:
    """Return the states at :func:`pose_times`, shape (n, 6), columns as in :class:`State`."""
    return states_at(rows, pose_times(body, rows, interval))


def _anchors(body: Body) -> _Anchors | None:
    """Arcs of a sled with its rider, None of any other body."""
    arcs = body.arcs
    if set(body.parts) != {RUNNER, FRAME, LEGS, RIDER}:
        return None
    rider, legs = (sorted({arc[:3] for arc in arcs if arc.part == part}) for part in (RIDER, LEGS))
    bows = [k for k in range(len(arcs)) if all(arcs[j % len(arcs)].part == RUNNER for j in (k - 1, k, k + 1))]
    if len(rider) < 2 or not legs or len(bows) != 1:
        return None
    (k,) = bows
    front, bow, rear = arcs[k - 1], arcs[k], arcs[(k + 1) % len(arcs)]
    if not (bow.begin < rear.begin and 2.0 * max(front.radius, rear.radius) < bow.radius):
        return None
    return _Anchors(rider[-1], rider[0], legs[0], bow[:3], bow.begin, rear.begin, min(front.radius, rear.radius))


def _drawn(anchors: _Anchors) -> list[tuple[str, str, np.ndarray]]:
    """Part, colour and points of each piece, which may still stick out of the outline."""
    (x, y, r), (hips, _, _), (feet, _, sole) = anchors.head, anchors.hips, anchors.feet
    deck = y - r

    def lying(place: float, radius: float, above: float = 0.0) -> Circle:
        return place, deck + radius + above, radius

    shoulders, ankles = max(x - 1.75 * r, hips), lying(feet + 1.7 * sole, 0.75 * sole)
    visor = np.radians(np.linspace(-62.0, 22.0, 12))
    runner, rear, front = _runner(anchors)
    frame = np.array([(rear[0] - anchors.round, deck), rear, front, (front[0] + anchors.round, deck)])
    return [
        (FRAME, DECK, frame),
        (RUNNER, STEEL, runner),
        (LEGS, TROUSERS, _stadium(lying(hips, 0.72 * r), ankles)),
        (LEGS, DARK, _stadium((feet, deck + sole, sole), ankles)),
        (RIDER, SUIT, _stadium(lying(hips, 0.82 * r), lying(shoulders, r))),
        (RIDER, HELMET, _stadium((x, y, r), (x, y, r))),
        (RIDER, DARK, np.stack([x + r * np.cos(visor), y + r * np.sin(visor)], axis=-1)),
        (
            RIDER,
            SLEEVE,
            _stadium(lying(shoulders - 0.1 * r, 0.36 * r, 0.5 * r), lying(hips - 2.0 * r, 0.24 * r, 0.2 * r)),
        ),
    ]


def _runner(anchors: _Anchors) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of the runner, a bent rod with round ends; and the middles of its rear and its front end."""
    (x, y, radius), thin, half = anchors.bow, anchors.round, np.linspace(0.0, math.pi, _FINE // 2 + 1)
    turn = np.linspace(anchors.begin, anchors.end, _FINE + 1)

    def along(out: float, angle: np.ndarray) -> np.ndarray:
        return np.stack([x - (radius - out) * np.sin(angle), y - (radius - out) * np.cos(angle)], axis=-1)

    def cap(middle: np.ndarray, angle: np.ndarray) -> np.ndarray:
        points: np.ndarray = middle - thin * np.stack([np.sin(angle), np.cos(angle)], axis=-1)
        return points

    front, rear = along(thin, turn[[0, -1]])
    rod = [along(0.0, turn), cap(rear, anchors.end + half), along(2.0 * thin, turn[::-1])]
    rod.append(cap(front, anchors.begin - math.pi + half))
    return np.concatenate(rod), rear, front


def _stadium(one: Circle, other: Circle) -> np.ndarray:
    """Points around two circles, counterclockwise; around the larger one if it holds the other."""
    (x, y, r), (x1, y1, r1) = one, other
    apart = math.hypot(x1 - x, y1 - y)
    if apart <= abs(r1 - r):
        turn = np.linspace(0.0, 2.0 * math.pi, _FINE, endpoint=False)
        x, y, r = max(one, other, key=lambda circle: circle[2])
        return np.stack([x + r * np.cos(turn), y + r * np.sin(turn)], axis=-1)
    towards, spread = math.atan2(y1 - y, x1 - x), math.acos((r - r1) / apart)
    around = np.linspace(towards + spread, towards + 2.0 * math.pi - spread, _FINE)
    ahead = np.linspace(towards - spread, towards + spread, _FINE)
    ends = [(x + r * np.cos(around), y + r * np.sin(around)), (x1 + r1 * np.cos(ahead), y1 + r1 * np.sin(ahead))]
    return np.concatenate([np.stack(end, axis=-1) for end in ends])


def _clipped(points: np.ndarray, outline: np.ndarray) -> np.ndarray:
    """Return the part of a polygon inside a convex outline, which is closed and counterclockwise."""
    left = points
    for begin, end in pairwise(outline):
        along = end - begin
        inside = along[0] * (left - begin)[:, 1] - along[1] * (left - begin)[:, 0]
        kept: list[np.ndarray] = []
        for k in range(len(left)):
            before, now = inside[k - 1], inside[k]
            if (before < 0.0) != (now < 0.0):
                kept.append(left[k - 1] + before / (before - now) * (left[k] - left[k - 1]))
            if now >= 0.0:
                kept.append(left[k])
        if not kept:
            return np.empty((0, 2))
        left = np.array(kept)
    return left
