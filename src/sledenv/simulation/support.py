"""How the body touches the slope, for Python, and how high it must be so that no part of it is under the ground.

The geometry is the kernel's own, so that both agree to the last bit.

A body that comes down onto the ground along the normal of the slope's plane is stopped by one of two things. A piece
stops it where the point of the body that is outermost against the normal of the piece lies over the piece, or over one
that is joined to it by dips: there the line of the piece bounds the ground. A crest stops it between the points that
are outermost against the two pieces: there that of its tangents does which touches the body where it touches the crest.
A round dip stops it where one of its arcs touches it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.arithmetic import TURN
from sledenv.kernel.entries import run_directions, run_lowest
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import Tracks, pieces_of

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

    pieces: np.ndarray  # of kernel.geometry.PIECE
    low: Floats  # [m] where the crest before a piece ends, and that behind it begins; -inf and inf where there is none
    high: Floats
    starts: Indices  # the first piece of each track

    @classmethod
    def of(cls, vertices: Sequence[Floats]) -> Self:
        """Return the ground of profiles with such vertices, shapes (n, 3)."""
        counts = np.array([len(one) + 1 for one in vertices])
        starts = np.cumsum(counts) - counts
        pieces = np.concatenate([pieces_of(one) for one in vertices])
        track, number = np.repeat(starts, counts), np.arange(len(pieces))
        crest = pieces["bend"] > 0
        before = np.maximum.accumulate(np.where(crest, number, -1))
        behind = np.minimum.accumulate(np.where(crest, number, len(pieces))[::-1])[::-1]
        behind = np.r_[behind[1:], len(pieces)]
        low = np.where(before >= track, pieces["ex"][before], -math.inf)
        high = np.where(behind < track + np.repeat(counts, counts), np.r_[pieces["bx"], 0.0][behind], math.inf)
        return cls(pieces, low, high, starts)


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
    begins = np.array([vertices[0, :2] if len(vertices) else (math.inf, 0.0) for vertices in tracks.vertices])
    for track, vertices in enumerate(tracks.vertices):
        if len(vertices) and vertices[0, 2] > 0.0:
            begins[track, 0] = pieces_of(vertices)["bx"][1]
    over = x + sizes >= begins[numbers, 0]  # before the first bend the ground is level
    heights: Floats = begins[numbers, 1] + support_heights(bodies, phi)
    lanes = np.flatnonzero(over)
    if not len(lanes):
        return heights
    tracked = np.unique(numbers[lanes]).tolist()
    ground = _Ground.of([tracks.vertices[track] for track in tracked])
    first, last = np.empty(len(x), np.intp), np.empty(len(x), np.intp)
    for track, start in zip(tracked, ground.starts, strict=True):
        on, own = tracks.lanes(track), slice(start + 1, start + 1 + len(tracks.vertices[track]))
        first[on] = start + np.searchsorted(ground.pieces["ex"][own], x[on] - sizes[on])
        last[on] = start + np.searchsorted(ground.pieces["bx"][own], x[on] + sizes[on], side="right")
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
    number = np.arange(len(lane)) - np.repeat(starts - first, counts)
    piece = ground.pieces[number]
    along, up = piece["tx"], piece["ty"]
    cosine, sine = directions(phi)
    outline = _Outline(records, lane, phi, cosine, sine)
    a, b = outline.arms(along, up)
    foot = x[lane] - a * along + b * up  # x of the outermost point
    stops = piece["y"] + (b + (x[lane] - piece["x"]) * up) / along
    stops[(foot < ground.low[number]) | (foot > ground.high[number])] = -math.inf
    crest = np.flatnonzero((number > first[lane]) & (foot < piece["ex"]) & (piece["bend"] > 0))
    crest = crest[foot[crest - 1] > piece["bx"][crest]]
    dip = np.flatnonzero((number > first[lane]) & (piece["bend"] < 0))
    for some, height in ((crest, _on_crest), (dip, _in_dip)):
        if len(some):
            at = number[some]
            cone = ground.pieces["tilt"][[at - 1, at]]
            found_there = height(outline.of(some), x[lane[some]], ground.pieces[at], cone)
            stops[some] = np.maximum(stops[some], found_there)
    found: Floats = np.maximum.reduceat(stops, starts)
    return found


def _on_crest(outline: _Outline, x: Floats, bend: np.ndarray, cone: Floats) -> Floats:
    """Heights [m] at which bodies with mass centres at ``x`` [m] lie on crests, all of shape (M,).

    ``cone`` [rad] holds the inclinations of the pieces before and behind, shape (2, M): the tangent of the crest that
    supports a body there is between them, and there the outermost point of the body changes from behind it to before
    it.
    """
    before, behind = cone
    for _ in range(_HALVINGS):
        middle = 0.5 * (before + behind)
        along, up = directions(middle)
        a, b = outline.arms(along, up)
        past = x - a * along + b * up > bend["qx"] - bend["radius"] * up
        behind, before = np.where(past, behind, middle), np.where(past, middle, before)
    heights: Floats = bend["qy"] + (b + bend["radius"] + (x - bend["qx"]) * up) / along
    return heights


def _in_dip(outline: _Outline, x: Floats, bend: np.ndarray, cone: Floats) -> Floats:
    """As :func:`_on_crest`, in round dips, which an arc touches that is rounder; -inf where none does.

    Its centre is then as far from that of the dip as the dip is rounder.
    """
    arcs, inside = outline.arcs(), bend["radius"][:, np.newaxis]
    across = x[:, np.newaxis] + arcs["x"] - bend["qx"][:, np.newaxis]
    with np.errstate(invalid="ignore"):
        below = np.sqrt((inside - arcs["r"]) ** 2 - across * across)
    tilt = np.arctan2(across, below)
    local = within_a_turn(outline.phi[:, np.newaxis] - tilt)
    faces = np.zeros(local.shape, bool)
    for turned in (local - TURN, local, local + TURN):
        faces |= (turned >= arcs["low"] - FLAT) & (turned <= arcs["high"] + FLAT)
    fits = arcs["is_one"] & (arcs["r"] < inside) & faces
    fits &= (tilt >= cone[0][:, np.newaxis]) & (tilt <= cone[1][:, np.newaxis])
    heights = np.where(fits, bend["qy"][:, np.newaxis] - below - arcs["y"], -math.inf)
    found: Floats = heights.max(axis=1)
    return found


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

    def arcs(self) -> dict[str, NDArray[Any]]:
        """Return where the centres of arcs are from the mass centre, radii, ends of intervals; and which there are.

        All have shape (M, arcs).
        """
        record = np.zeros(len(self.lane), np.intp) if len(self.records) == 1 else self.lane
        most = int(self.records["count"].max())
        fields = {name: self.records[name][record, :most] for name in ("across", "along", "r", "low", "high")}
        cosine, sine = self.cosine[:, np.newaxis], self.sine[:, np.newaxis]
        return {
            "x": -cosine * fields["across"] - sine * fields["along"],
            "y": cosine * fields["along"] - sine * fields["across"],
            "r": fields["r"],
            "low": fields["low"],
            "high": fields["high"],
            "is_one": np.arange(most) < self.records["count"][record][:, np.newaxis],
        }

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
