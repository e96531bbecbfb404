"""How the body touches the slope, for Python, and how high it must be so that no part of it is under the ground.

The geometry is the kernel's own, so that both agree to the last bit.

A body that comes down onto the ground along the normal of the slope's plane is stopped by one of two things. A piece
stops it where the point of the body that is outermost against the normal of the piece lies over the piece, or over one
that is joined to it by dips: there the line of the piece bounds the ground. A crest stops it between the points that
are outermost against the two pieces: there the steepest of the lines through the crest that support the body does.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.arithmetic import TURN
from sledenv.kernel.entries import run_directions, run_lowest
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import crests, tangents

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

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


def resting_heights(bodies: np.ndarray, x: Floats, phi: Floats, vertices: Floats) -> Floats:
    """Heights [m] of mass centres over the plane of the slope at which the bodies touch the ground from above.

    Parameters
    ----------
    bodies : ndarray of kernel.outline.BODY, shape (1,) or (N,)
    x : ndarray, shape (N,)
        Places [m] of the mass centres along the slope.
    phi : ndarray, shape (N,)
        Orientations [rad] in [-pi, pi].
    vertices : ndarray, shape (n, 2)
        Of the profile: ``Slope.vertices``.

    Returns
    -------
    ndarray, shape (N,)
        A body that is lower by some length is under the ground by as much, along the normal of the slope's plane.
    """
    if not len(vertices):
        return support_heights(bodies, phi)
    first = np.searchsorted(vertices[:, 0], x - bodies["size"])
    last = np.searchsorted(vertices[:, 0], x + bodies["size"], side="right")
    heights, ends = np.empty(len(x)), np.cumsum(last - first + 1)
    begin = 0
    while begin < len(x):
        done = ends[begin - 1] if begin else 0
        end = max(begin + 1, int(np.searchsorted(ends, done + _PAIRS, side="right")))
        part = slice(begin, end)
        records = bodies if len(bodies) == 1 else bodies[part]
        heights[part] = _heights(records, x[part], phi[part], vertices, first[part], last[part])
        begin = end
    return heights


def _heights(records: np.ndarray, x: Floats, phi: Floats, vertices: Floats, first: Indices, last: Indices) -> Floats:
    """As :func:`resting_heights`, of bodies that have the pieces from ``first`` to ``last`` under them."""
    counts = last - first + 1
    starts = np.cumsum(counts) - counts
    lane = np.repeat(np.arange(len(x)), counts)
    piece = np.arange(len(lane)) - np.repeat(starts - first, counts)
    along, up = tangents(vertices).T
    cosine, sine = directions(phi)
    outline = _Outline(records, lane, phi, cosine, sine)
    a, b = outline.arms(along[piece], up[piece])
    foot = x[lane] - a * along[piece] + b * up[piece]  # x of the outermost point
    on = vertices[np.maximum(piece - 1, 0)]
    stops = on[:, 1] + (b + (x[lane] - on[:, 0]) * up[piece]) / along[piece]
    low, high = _bounds(vertices)
    stops[(foot < low[piece]) | (foot > high[piece])] = -math.inf
    crest = np.flatnonzero((piece > first[lane]) & (foot < low[piece]))  # that piece begins at a crest, or behind one
    crest = crest[crests(vertices)[piece[crest] - 1]]
    crest = crest[foot[crest - 1] > vertices[piece[crest] - 1, 0]]
    if len(crest):
        at = piece[crest]
        cone = np.arctan2(up[[at - 1, at]], along[[at - 1, at]])
        stops[crest] = _on_crest(outline.of(crest), x[lane[crest]], vertices[at - 1], cone)
    found: Floats = np.maximum.reduceat(stops, starts)
    return found


def _bounds(vertices: Floats) -> tuple[Floats, Floats]:
    """Places [m] of the crests before and behind each piece, -inf and inf where there is none, shapes (n + 1,)."""
    x, crest = vertices[:, 0], crests(vertices)
    before = np.maximum.accumulate(np.where(crest, x, -math.inf))
    behind = np.minimum.accumulate(np.where(crest, x, math.inf)[::-1])[::-1]
    return np.r_[-math.inf, before], np.r_[behind, math.inf]


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
