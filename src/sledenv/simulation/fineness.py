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

from sledenv.kernel.params import Zone
from sledenv.simulation.scenes import Scenes

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

IN_A_ROW: Final = 3  # so many pieces that are too short make a ground too fine: of noise, one or two may be
_PAIRS: Final = 1 << 14  # of a body and a place that are looked at together

_OF_ZONE: Final = Zone._fields.index("stiffness")


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


def too_fine(scenes: Scenes) -> TooFine | None:
    """Return where a ground is cut too finely for a body and a stiffness."""
    rows, bodies = scenes.rows, scenes.bodies
    places, numbers = np.unique(np.stack([rows["ground"], rows["ground_end"]], axis=-1), axis=0, return_inverse=True)
    numbers = numbers.ravel()  # NumPy 2.0.0 alone gives a column
    vertices = [scenes.pieces[begin + 1 : end] for begin, end in places.astype(np.intp).tolist()]
    found = _rows_of(vertices)
    if not len(found.x):
        return None
    depths = scenes.of_body("mass") * rows["gravity"] / _softest(scenes)
    found = _shorter(found, float(depths.max()), bodies)
    if not len(found.x):
        return None
    begins = np.searchsorted(found.tracks, np.arange(len(vertices) + 1))
    if len(bodies) == 1:  # over each track once
        allowed, at = _allowed(found, bodies, begins[:-1], begins[1:])
        return _first(found, depths, allowed[numbers], at[numbers], 0)
    for part in _parts(begins[numbers + 1] - begins[numbers]):
        own = bodies[scenes.body[part]]
        allowed, at = _allowed(found, own, begins[numbers[part]], begins[numbers[part] + 1])
        wrong = _first(found, depths[part], allowed, at, part.start)
        if wrong is not None:
            return wrong
    return None


def _softest(scenes: Scenes) -> Floats:
    """Return the stiffness [N/m] of the softest surface of each lane."""
    rows, own = scenes.rows, np.r_[scenes.zones[:, _OF_ZONE], math.nan]
    if len(own) == 1:
        return np.asarray(rows["stiffness"])
    ends = np.stack([rows["zones"], rows["zones_end"]], axis=-1).astype(np.intp)
    # Of a lane without zones reduceat tells that which would be its first one.
    softest = np.fmin.reduceat(own, ends.ravel())[::2]
    stiffness: Floats = np.fmin(rows["stiffness"], np.where(ends[:, 1] > ends[:, 0], softest, math.nan))
    return stiffness


def _rows_of(grounds: list[np.ndarray]) -> _Rows:
    """Return where pieces lie in a row between dips, of grounds: pieces without the first one, told by their vertex."""
    vertices = np.concatenate(grounds)
    x, y = vertices["x"], vertices["y"]
    along = np.stack([np.diff(x), np.diff(y)], axis=-1)
    dips = np.zeros(len(vertices), bool)
    # The first and the last vertex of a track are left out: no piece lies on their other side.
    crossed = along[:-1, 0] * along[1:, 1] - along[:-1, 1] * along[1:, 0]
    dips[1:-1] = (crossed > 0.0) & (vertices["radius"][1:-1] == 0.0)
    ends = np.cumsum([len(each) for each in grounds])
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
        0.5 * (x[first] + x[first + IN_A_ROW]),
        np.sqrt((along[joints[:, :-1]] ** 2).sum(axis=-1)),
        0.5 * (turns[:, 1:] + turns[:, :-1]),
        turns.sum(axis=1),
        np.searchsorted(ends, first, side="right"),
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
