"""How finely a polyline may be cut for a body and a stiffness: docs/physics.md, section 12.

An arc of radius r that lies in a dip presses on no more than the two or three pieces next to it, as long as the
parallel of the ground at a distance r rises over each piece by more than a spring is pressed:
theta (s - r theta) >= m g/c, of a piece of length s between turns of theta. Where several pieces in a row, each between
two dips, do not keep this, more springs than those bear the body.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.params import SLOPE_FIELDS, ZONE_FIELDS, ContactLaw, Slope, Zone
from sledenv.simulation.scene import Tracks

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

IN_A_ROW: Final = 3  # so many pieces that are too short make a ground too fine: of noise, one or two may be
_PAIRS: Final = 1 << 14  # of a body and a place that are looked at together

_STIFFNESS, _GRAVITY = ContactLaw._fields.index("stiffness"), Slope._fields.index("gravity")
_OF_ZONE = Zone._fields.index("stiffness")


class TooFine(NamedTuple):
    """Where a lane has pieces that are shorter than the rule allows."""

    lane: int  # the first one that has
    x: float  # [m] where they are shortest
    depth: float  # [m] to which its weight presses the body in
    allowed: float  # [m] up to which they are long enough


class _Rows(NamedTuple):
    """Places where so many pieces lie in a row, each between two dips without a radius."""

    x: Floats  # [m] middle of each, shape (w,)
    lengths: Floats  # [m] of the pieces, shape (w, IN_A_ROW)
    turns: Floats  # [rad] mean of both ends of a piece, the same shape
    whole: Floats  # [rad] turn from the piece before them to the one behind, shape (w,)
    tracks: Indices  # of which track each is, shape (w,), in order


def too_fine(bodies: np.ndarray, laws: np.ndarray, slopes: np.ndarray, tracks: Tracks) -> TooFine | None:
    """Return where a ground is cut too finely for a body and a stiffness, of lanes as they are checked."""
    rows = _rows_of(tracks)
    if not len(rows.x):
        return None
    stiffness = laws[:, _STIFFNESS]
    own = slopes[:, SLOPE_FIELDS + _OF_ZONE :: ZONE_FIELDS]
    if own.size:
        stiffness = np.fmin(stiffness, np.fmin.reduce(own, axis=1))  # of the softest zone
    depths = bodies["mass"] * slopes[:, _GRAVITY] / stiffness
    rows = _shorter(rows, float(depths.max()), bodies)
    if not len(rows.x):
        return None
    begins = np.searchsorted(rows.tracks, np.arange(len(tracks.vertices) + 1))
    if len(bodies) == 1:  # over each track once
        allowed, places = _allowed(rows, bodies, begins[:-1], begins[1:])
        return _first(rows, depths, allowed[tracks.numbers], places[tracks.numbers], 0)
    begins, ends = np.broadcast_to(begins[tracks.numbers], len(bodies)), begins[tracks.numbers + 1]
    ends = np.broadcast_to(ends, len(bodies))
    for part in _parts(ends - begins):
        allowed, places = _allowed(rows, bodies[part], begins[part], ends[part])
        found = _first(rows, depths[part] if len(depths) > 1 else depths, allowed, places, part.start)
        if found is not None:
            return found
    return None


def _rows_of(tracks: Tracks) -> _Rows:
    """Return where pieces lie in a row between dips."""
    one = len(tracks.vertices) == 1
    vertices = tracks.vertices[0] if one else np.concatenate(tracks.vertices)
    along = np.diff(vertices[:, :2], axis=0)
    dips = np.zeros(len(vertices), bool)
    # The first and the last vertex of a track are left out: no piece lies on their other side.
    crossed = along[:-1, 0] * along[1:, 1] - along[:-1, 1] * along[1:, 0]
    dips[1:-1] = (crossed > 0.0) & (vertices[1:-1, 2] == 0.0)
    if not one:
        ends = np.cumsum([len(each) for each in tracks.vertices])
        inside = ends[ends < len(vertices)]
        dips[inside] = dips[inside - 1] = False
    count = max(len(vertices) - IN_A_ROW, 0)
    together = dips[:count]
    for k in range(1, IN_A_ROW + 1):
        together = together & dips[k : k + count]
    first = np.flatnonzero(together)
    joints = first[:, np.newaxis] + np.arange(IN_A_ROW + 1)
    if not len(first):
        none = np.empty(0)
        return _Rows(none, none, none, none, first)
    turns = np.arctan2(crossed[joints - 1], (along[joints - 1] * along[joints]).sum(axis=-1))
    return _Rows(
        0.5 * (vertices[first, 0] + vertices[first + IN_A_ROW, 0]),
        np.sqrt((along[joints[:, :-1]] ** 2).sum(axis=-1)),
        0.5 * (turns[:, 1:] + turns[:, :-1]),
        turns.sum(axis=1),
        np.zeros(len(first), np.intp) if one else np.searchsorted(ends, first, side="right"),
    )


def _shorter(rows: _Rows, depth: float, bodies: np.ndarray) -> _Rows:
    """Return those rows that are too short at a depth [m] for some radius of one of the bodies."""
    middle, span = rows.lengths / rows.turns, depth / rows.turns**2
    low, high = (middle - span).max(axis=1), (middle + span).min(axis=1)
    short = (low < high) & (high >= 0.0) & (low <= bodies["r"].max())
    return _Rows(*(column[short] for column in rows))


def _parts(counts: Indices) -> Iterator[slice]:
    """Split lanes into parts, each with not many more rows than are looked at together."""
    numbers = np.cumsum(counts) // _PAIRS
    edges = np.flatnonzero(np.diff(numbers)) + 1
    for begin, end in zip([0, *edges.tolist()], [*edges.tolist(), len(counts)], strict=True):
        yield slice(begin, end)


def _allowed(rows: _Rows, bodies: np.ndarray, begins: Indices, ends: Indices) -> tuple[Floats, Indices]:
    """Return the depth [m] up to which rows from ``begins`` to ``ends`` are long enough, and the shortest of them.

    One or more of N, for each of N bodies, or for one body.
    """
    counts = ends - begins
    allowed, places = np.full(len(counts), math.inf), np.zeros(len(counts), np.intp)
    some = np.flatnonzero(counts)
    if not len(some):
        return allowed, places
    counts = counts[some]
    starts = np.cumsum(counts) - counts
    whose = np.repeat(np.arange(len(some)), counts)
    row = np.arange(len(whose)) - starts[whose] + begins[some][whose]
    of_body = some[whose] if len(bodies) > 1 else np.zeros(1, np.intp)
    turns, lengths, whole = rows.turns[row], rows.lengths[row], rows.whole[row]
    least = np.full(len(row), math.inf)
    for a in range(int(bodies["arcs"].max())):
        radius, half = bodies["r"][of_body, a, np.newaxis], bodies["half"][of_body, a]
        rise = np.abs(turns * (lengths - radius * turns)).max(axis=1)
        # An arc that turns by less than the ground does there lies on fewer pieces.
        lies = (a < bodies["arcs"][of_body]) & (2.0 * half >= whole)
        least = np.minimum(least, np.where(lies, rise, math.inf))
    allowed[some] = np.minimum.reduceat(least, starts)
    shortest = np.flatnonzero(least == allowed[some][whose])
    places[some] = row[shortest[np.searchsorted(shortest, starts)]]
    return allowed, places


def _first(rows: _Rows, depths: Floats, allowed: Floats, places: Indices, lane: int) -> TooFine | None:
    """Return the first lane from one on that is pressed in deeper than is allowed, or None."""
    depths, allowed, places = np.broadcast_arrays(depths, allowed, places)
    wrong = depths > allowed
    if not np.count_nonzero(wrong):
        return None
    k = int(np.argmax(wrong))
    return TooFine(lane + k, float(rows.x[places[k]]), float(depths[k]), float(allowed[k]))
