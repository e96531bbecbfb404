"""How the body touches the slope, for Python, and how high it must be so that no part of it is under the ground.

The geometry is the kernel's own, so that both agree to the last bit.

A body that comes down onto the ground along the normal of the slope's plane is stopped by one of two things. A piece
stops it where the point of the body that is outermost against the normal of the piece lies over the piece, or over one
that is joined to it by dips: there the line of the piece bounds the ground. A crest stops it between the points that
are outermost against the two pieces: there the steepest of the lines through the crest that support the body does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.arithmetic import TURN
from sledenv.kernel.entries import run_directions, run_lowest
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import Tracks, crests, tangents

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

FLAT: Final = 1e-6  # [rad] by which a body may be turned and still lies flat
_MANY_TURNS = 1e5  # [rad]
_HALVINGS: Final = 60  # of the turn of a crest
_PAIRS: Final = 1 << 14  # of a body and a piece that are looked at together


def lowest_arms(bodies: np.ndarray, phi: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Which arc is lowest at each of many orientations [rad], shape (N,), and its arms a, b [m], shape (N, 2).

    The contact point lies at (-a, -b) from the mass centre. ``bodies`` is one record of kernel.outline.BODY, or N.
    """
    phi = np.ascontiguousarray(phi, float)
    arcs, arms = np.empty(len(phi), np.int64), np.empty((len(phi), 2))
    run_lowest(bodies, phi, arcs, arms)
    return arcs, arms


def arms_beside(body: Body, phi: float) -> Floats:
    """Arms a, b [m] of the lowest points just to both sides of an orientation [rad], shape (2, 2).

    Where a body lies flat they are those of the ends of its side.
    """
    return lowest_arms(body.record, np.array([phi - FLAT, phi + FLAT]))[1]


def support_height(body: Body, phi: float) -> float:
    """Height [m] of the mass centre above the slope when the lowest point of the body touches it."""
    return float(support_heights(body.record, np.array([phi]))[0])


def support_heights(bodies: Body | np.ndarray, phi: Floats) -> Floats:
    """Support height [m] at each of many orientations [rad], shape (N,), of one body or of N records of bodies."""
    return lowest_arms(bodies.record if isinstance(bodies, Body) else bodies, phi)[1][:, 1]


def directions(phi: Floats) -> tuple[Floats, Floats]:
    """Cosine and sine of many angles [rad], shapes (N,): the same whatever N is, NaN where an angle is infinite."""
    cosine, sine = np.empty(len(phi)), np.empty(len(phi))
    with np.errstate(invalid="ignore"):
        run_directions(np.where(np.abs(phi) < _MANY_TURNS, phi, within_a_turn(phi)), cosine, sine)
    return cosine, sine


def within_a_turn(phi: Floats) -> Floats:
    """Return angles less their whole turns, in [-pi, pi], odd as a mirror is; within that they are left as they are.

    Nothing is rounded, but a turn is the double 2 pi, 4e-17 of itself off. Over all turns this adds up to 0.6 of the
    distance of ``phi`` to the next double at most: hardly more than ``phi`` itself was rounded.
    """
    rest = np.fmod(phi, TURN)
    return np.where(np.abs(rest) > np.pi, rest - np.copysign(TURN, rest), rest)


# Over a profile.


class _Ground(NamedTuple):
    """The pieces of the ground of some tracks, one track behind the other."""

    along: Floats  # unit tangents
    up: Floats
    x: Floats  # [m] the vertex where a piece begins; of the first one of a track: where it ends
    y: Floats
    crest: NDArray[np.bool_]  # whether it begins at a crest
    low: Floats  # [m] places of the crests before and behind it, -inf and inf where there is none
    high: Floats
    starts: Indices  # the first piece of each track

    @classmethod
    def of(cls, vertices: Sequence[Floats]) -> Self:
        """Return the ground of profiles with such vertices, shapes (n, 2)."""
        counts = np.array([len(one) + 1 for one in vertices])
        starts = np.cumsum(counts) - counts
        parts = [(*tangents(one).T, *one[np.r_[0, : len(one)]].T, np.r_[False, crests(one)]) for one in vertices]
        along, up, x, y, crest = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        track, number = np.repeat(starts, counts), np.arange(len(x))
        before = np.maximum.accumulate(np.where(crest, number, -1))
        behind = np.minimum.accumulate(np.where(crest, number, len(x))[::-1])[::-1]
        behind = np.r_[behind[1:], len(x)]
        low = np.where(before >= track, x[before], -math.inf)
        high = np.where(behind < track + np.repeat(counts, counts), np.r_[x, 0.0][behind], math.inf)
        return cls(along, up, x, y, crest.astype(bool), low, high, starts)


def resting_heights(bodies: np.ndarray, x: Floats, phi: Floats, tracks: Tracks) -> Floats:
    """Heights [m] of mass centres over the plane of the slope at which the bodies touch the ground from above.

    Parameters
    ----------
    bodies : ndarray of kernel.outline.BODY, shape (1,) or (N,)
    x : ndarray, shape (N,)
        Places [m] of the mass centres along the slope.
    phi : ndarray, shape (N,)
        Orientations [rad] in [-pi, pi].
    tracks : Tracks

    Returns
    -------
    ndarray, shape (N,)
        A body that is lower by some length is under the ground by as much, along the normal of the slope's plane.
    """
    if tracks.is_plane:
        return support_heights(bodies, phi)
    sizes, numbers = np.broadcast_to(bodies["size"], x.shape), np.broadcast_to(tracks.numbers, x.shape)
    begins = np.array([vertices[0] if len(vertices) else (math.inf, 0.0) for vertices in tracks.vertices])
    over = x + sizes >= begins[numbers, 0]  # before the first vertex the ground is level
    heights: Floats = begins[numbers, 1] + support_heights(bodies, phi)
    lanes = np.flatnonzero(over)
    if not len(lanes):
        return heights
    tracked = np.unique(numbers[lanes]).tolist()
    ground = _Ground.of([tracks.vertices[track] for track in tracked])
    first, last = np.empty(len(x), np.intp), np.empty(len(x), np.intp)
    for track, start in zip(tracked, ground.starts, strict=True):
        on, places = tracks.lanes(track), tracks.vertices[track][:, 0]
        first[on] = start + np.searchsorted(places, x[on] - sizes[on])
        last[on] = start + np.searchsorted(places, x[on] + sizes[on], side="right")
    ends, begin = np.cumsum(last[lanes] - first[lanes] + 1), 0
    while begin < len(lanes):
        done = ends[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, done + _PAIRS, side="right")))
        part = lanes[begin:end]
        records = bodies if len(bodies) == 1 else bodies[part]
        heights[part] = _heights(records, x[part], phi[part], ground, first[part], last[part])
        begin = end
    return heights


def _heights(records: np.ndarray, x: Floats, phi: Floats, ground: _Ground, first: Indices, last: Indices) -> Floats:
    """As :func:`resting_heights`, of bodies that have the pieces from ``first`` to ``last`` under them."""
    counts = last - first + 1
    starts = np.cumsum(counts) - counts
    lane = np.repeat(np.arange(len(x)), counts)
    piece = np.arange(len(lane)) - np.repeat(starts - first, counts)
    along, up, begin = ground.along, ground.up, ground.x[piece]
    cosine, sine = directions(phi)
    outline = _Outline(records, lane, phi, cosine, sine)
    a, b = outline.arms(along[piece], up[piece])
    foot = x[lane] - a * along[piece] + b * up[piece]  # x of the outermost point
    stops = ground.y[piece] + (b + (x[lane] - begin) * up[piece]) / along[piece]
    stops[(foot < ground.low[piece]) | (foot > ground.high[piece])] = -math.inf
    crest = np.flatnonzero((piece > first[lane]) & (foot < ground.low[piece]) & ground.crest[piece])
    crest = crest[foot[crest - 1] > begin[crest]]
    if len(crest):
        at = piece[crest]
        cone = np.arctan2(up[[at - 1, at]], along[[at - 1, at]])
        place = np.stack([ground.x[at], ground.y[at]], axis=-1)
        stops[crest] = _on_crest(outline.of(crest), x[lane[crest]], place, cone)
    found: Floats = np.maximum.reduceat(stops, starts)
    return found


def _on_crest(outline: _Outline, x: Floats, crest: Floats, cone: Floats) -> Floats:
    """Heights [m] at which bodies with mass centres at ``x`` [m] lie on crests, all of shape (M,), crests (M, 2).

    ``cone`` [rad] holds the inclinations of the pieces before and behind, shape (2, M): the line that supports a body
    at the crest is between them, and there the outermost point of the body changes from behind it to before it.
    """
    high, low = cone
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        along, up = directions(middle)
        a, b = outline.arms(along, up)
        behind = x - a * along + b * up > crest[:, 0]
        low, high = np.where(behind, low, middle), np.where(behind, middle, high)
    heights: Floats = crest[:, 1] + (b + (x - crest[:, 0]) * up) / along
    return heights


class _Outline:
    """Outlines of bodies, one a pair of a body and a piece, as seen from the ground below."""

    def __init__(self, records: np.ndarray, lane: Indices, phi: Floats, cosine: Floats, sine: Floats) -> None:
        self.records, self.lane = records, lane
        self.phi, self.cosine, self.sine = phi[lane], cosine[lane], sine[lane]

    def of(self, pairs: Indices) -> _Outline:
        """Return those of some pairs."""
        some = _Outline.__new__(_Outline)
        some.records, some.lane = self.records, self.lane[pairs]
        some.phi, some.cosine, some.sine = self.phi[pairs], self.cosine[pairs], self.sine[pairs]
        return some

    def arms(self, along: Floats, up: Floats) -> tuple[Floats, Floats]:
        """Arms a, b [m] of the points that are lowest over lines with unit tangents (along, up): kernel/outline.py."""
        local = within_a_turn(self.phi - np.arctan2(up, along))
        sine, cosine = self.sine * along - self.cosine * up, self.cosine * along + self.sine * up
        record = np.zeros(len(local), np.intp) if len(self.records) == 1 else self.lane
        begin = self.records["begin"]
        listed = (np.arange(begin.shape[1]) > 0) & (np.arange(begin.shape[1]) < self.records["count"][:, np.newaxis])
        begin = np.where(listed, begin, math.inf)[record]
        arc = (begin < local[:, np.newaxis]).sum(axis=1)
        x, y, r, h = (self.records[name][record, arc] for name in ("across", "along", "r", "h"))
        a, level = y * sine + x * cosine, y * cosine - x * sine
        flat = (r > self.records["size"][record]) & (level > 0.0)  # r and level are large and nearly equal
        with np.errstate(invalid="ignore", divide="ignore"):
            b = np.where(flat, (r - h) + a * a / (h + level), r - level)
        return a, b
