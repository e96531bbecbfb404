"""Few vertices with large radii for a surveyed section: straight pieces and arcs within a tolerance of it."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from sledenv.simulation.bends import STEEPEST, cosines, half_turns, longest, norms, tangents
from sledenv.simulation.refitting import (
    SPARE,
    Bools,
    Floats,
    Ground,
    Ints,
    Survey,
    Windows,
    deviations,
    misplaced,
    refitted,
    surveyed,
)

_ROUNDING: Final = 1e-9  # of the tolerance: kept for rounding
_FIRST_SHARE: Final = 0.5  # of the tolerance, with which the first vertices are points of the section
_REACHES: Final = (1, 2)  # how many vertices to either side of one that is left out move, in each of two passes
_KINKED: Final = 4.0  # how many times as large its bending energy may not become
_EVENED: Final = 2  # how many to either side of one move with it when bends are evened
_EVENNESS: Final = 1.0  # weight of their bending energy
_EDGE: Final = 4.0  # tolerances: how far off the longest arc of a vertex is at least that is an edge
_NEARLY: Final = 0.8  # of its longest arc that such a vertex has at most


def fit_ground(vertices: ArrayLike, tolerance: float) -> Floats:
    """Fit straight pieces and arcs to a surveyed section.

    Nowhere, neither between its points nor on the level ground before the first and behind the last one, is the fit
    further from the straight lines between them than the tolerance, measured along y. Within that it has few vertices
    and large radii: a smooth hill is told by arcs that nearly touch each other, an edge keeps a small radius. Noise
    whose peaks are within the tolerance is smoothed out. A mirror image has the mirrored fit.

    Parameters
    ----------
    vertices : array_like, shape (n, 2)
        Points x, y [m] of the section, x increasing; from none to the next steeper than 80 degrees.
    tolerance : float
        Most that the fit may differ from the section [m], > 0, along y.

    Returns
    -------
    ndarray, shape (m, 3)
        Vertices x, y and their radii [m], as :func:`sledenv.simulation.bends.bends` takes them, 2 <= m <= n. The first
        and the last one have the heights of those of the section, and lie not beyond them.

    Raises
    ------
    ValueError
        Naming what is wrong.

    Examples
    --------
    A crest of radius 20 m, surveyed each 0.2 m:

    >>> x = np.linspace(-8.0, 8.0, 81)
    >>> fitted = fit_ground(np.column_stack([x, np.sqrt(400.0 - x * x)]), 0.01)
    >>> fitted[:, 2].round(1).tolist()
    [0.5, 14.0, 17.3, 18.3, 17.3, 14.0, 0.5]
    """
    section = np.asarray(vertices, float)
    _check(section, tolerance)
    origin = 0.5 * (section[0] + section[-1])
    survey = surveyed(section - origin, tolerance * (1.0 - _ROUNDING))
    points = _polygon(survey.points, _FIRST_SHARE * tolerance)
    ground = _lengthened(survey, Ground(points, np.zeros(len(points))), SPARE)
    for reach in _REACHES:
        ground = _thinned(survey, ground, reach)
        ground = _lengthened(survey, _evened(survey, ground), SPARE)
    ground = _lengthened(survey, ground, 1.0)
    turns, lengths = np.abs(half_turns(ground.vertices)), ground.reached()
    radii = np.divide(lengths, turns, out=np.zeros(len(turns)), where=turns * lengths > _ROUNDING * tolerance)
    found = np.column_stack([ground.vertices + origin, radii])
    found[:, 0] = np.clip(found[:, 0], *section[[0, -1], 0])
    found[[0, -1], 1] = section[[0, -1], 1]
    return found


def _check(section: Floats, tolerance: float) -> None:
    """Raise ValueError unless a section can be fitted."""
    if section.ndim != 2 or section.shape[1] != 2 or len(section) < 2:
        raise ValueError(f"vertices have shape {section.shape}: must be (n, 2), n >= 2, columns x, y")
    if not np.isfinite(section).all():
        raise ValueError("vertices must be finite numbers")
    if not 0.0 < tolerance < math.inf:
        raise ValueError(f"tolerance = {tolerance!r}: must be in (0, inf) m")
    wrong = misplaced(section)
    if wrong.any():
        most = f"{math.degrees(STEEPEST):g} degrees"
        raise ValueError(f"vertices[{int(np.argmax(wrong)) + 1}]: must be ahead of the one before, by {most} at most")


def _polygon(points: Floats, tolerance: float) -> Floats:
    """Return those points, of shape (n, 2), without which the lines between them move by more than a tolerance [m].

    After Douglas and Peucker; but of two that are equally far away, as in what is its own mirror image, both are kept.
    """
    x, y = points.T
    kept = np.zeros(len(x), bool)
    kept[[0, -1]] = True
    parts = [(0, len(x) - 1)]
    while parts:
        first, last = parts.pop()
        inside = slice(first + 1, last)
        line = y[first] + (y[last] - y[first]) * ((x[inside] - x[first]) / (x[last] - x[first]))
        away = np.abs(y[inside] - line)
        if away.max(initial=0.0) > tolerance:
            one, other = (first + 1 + np.flatnonzero(away >= (1.0 - 1e-9) * away.max())[[0, -1]]).tolist()
            kept[[one, other]] = True
            parts += [(first, one), (one, other), (other, last)]
    return points[kept]


def _lengthened(survey: Survey, ground: Ground, share: float) -> Ground:
    """Return a ground with longer arcs, each as long as it may be within a share of the tolerance, or as it was."""
    best, most = ground.reached(), longest(ground.vertices)
    tried = most
    for _ in range(20):
        good = deviations(survey, Ground(ground.vertices, tried)) <= share  # none sees the arc of another
        best, most = np.where(good, tried, best), np.where(good, most, tried)
        tried = 0.5 * (best + most)
    return Ground(ground.vertices, np.where(best < longest(ground.vertices), best, math.inf))


def _thinned(survey: Survey, ground: Ground, reach: int) -> Ground:
    """Leave out vertices, some to either side of each moving, until none can be left out within the tolerance."""
    tried = np.zeros(len(ground.vertices) - 1, bool)  # whether a piece cannot be left out
    while len(ground.vertices) > 2:
        windows, middles = _chosen(ground.vertices, tried, reach)
        if not len(middles):
            break
        guess, theirs = _guessed(survey, ground, windows, middles)
        fitted = guess._replace(vertices=refitted(survey, guess, theirs, 0.0)[0])
        kinked = theirs.sums(fitted.bent() ** 2) > _KINKED * windows.sums(ground.bent() ** 2)
        good = ~(theirs.any(deviations(survey, fitted) > 1.0) | kinked)
        ground = ground.replaced(windows.where(good), fitted, theirs.where(good))
        tried[np.floor(middles).astype(int)] = tried[np.ceil(middles - 1.0).astype(int)] = True
        for begin, end in windows.where(good).pairs():
            tried[max(begin - reach - 1, 0) : end + reach] = False
        tried = np.delete(tried, np.unique(np.floor(middles[good])).astype(int))
    return ground


def _chosen(vertices: Floats, tried: Bools, reach: int) -> tuple[Windows, Floats]:
    """Choose pieces to leave out, those first without which the ground moves least, none in sight of another.

    Two that are each other's mirror image and in sight are left out together or, if but one vertex is between them,
    instead of them that one: so the fit of what is its own mirror image is that too.

    Returns
    -------
    Windows, ndarray of shape (w, 2)
        Windows around them, and the first and the last that is left out of each, as a rule the same: k + 0.5 for the
        piece behind vertex k, k for that vertex.
    """
    count, apart = len(vertices), 2 * reach + 5
    turns, lengths = np.abs(half_turns(vertices)), norms(np.diff(vertices, axis=0))
    costs = lengths * (turns[1:] + turns[:-1]) + 1e-12 * lengths.sum()
    offsets = np.abs(vertices[1:, 0] + vertices[:-1, 0]) / (vertices[-1, 0] - vertices[0, 0])
    mantissas, exponents = np.frexp(costs)
    keys = np.stack([np.round(1e8 * offsets), np.round(1e5 * mantissas), exponents])  # mirror images have the same
    order = np.lexsort(keys)
    order = order[~tried[order]]
    twins = np.flatnonzero((keys[:, order[1:]] == keys[:, order[:-1]]).all(axis=0) & (np.abs(np.diff(order)) < apart))
    ends = np.repeat(2 * order[:, np.newaxis] + 1, 2, axis=1)  # doubled
    ends[twins] = np.sort(np.column_stack([order[twins], order[twins + 1]]), axis=1) * 2 + 1
    ends[twins] += np.where(np.diff(ends[twins]) == 2, [1, -1], 0)
    taken, found = np.zeros(2 * count + 4 * apart, bool), []
    for first, last in np.delete(ends, twins + 1, axis=0).tolist():
        if not taken[first + 2 * apart : last + 2 * apart + 1].any():
            found.append((first, last))
            taken[first + 1 : last + 4 * apart] = True
    middles = 0.5 * np.array(sorted(found), float).reshape(-1, 2)
    begin, end = np.ceil(middles[:, 0] - 0.5 - reach), np.floor(middles[:, 1] + 1.5 + reach)
    return Windows(np.maximum(begin, 0).astype(int), np.minimum(end, count).astype(int)), middles


def _guessed(survey: Survey, ground: Ground, windows: Windows, middles: Floats) -> tuple[Ground, Windows]:
    """Return a ground with a vertex fewer in each window, or two, from the better of two guesses, and its windows."""
    fewer = np.where(middles[:, 0] < middles[:, 1], 2, 1)
    count = windows.end - windows.begin - fewer
    begin, end = windows.begin - np.cumsum(fewer) + fewer, np.cumsum(count)
    theirs, in_turn = Windows(begin, begin + count), Windows(end - count, end)
    grounds: list[Ground] = []
    furthest: list[Floats] = []
    for guess in (_collapsed(ground, windows, middles), _respaced(ground, windows, count)):
        new = ground.replaced(windows, guess._replace(vertices=survey.snapped(guess.vertices, 20)), in_turn)
        new.vertices[[0, -1], 1] = survey.points[[0, -1], 1]
        new.vertices[:, 0] = np.clip(new.vertices[:, 0], *survey.points[[0, -1], 0])
        if grounds:
            wrong = theirs.where(theirs.any(misplaced(new.vertices), behind=0))
            new = new.replaced(wrong, grounds[0], wrong)
        away = deviations(survey, new)
        grounds.append(new)
        furthest.append(np.array([away[max(i - 1, 0) : j + 1].max() for i, j in theirs.pairs()]))
    better = theirs.where(furthest[1] < 0.999 * furthest[0])
    return grounds[0].replaced(better, grounds[1], better), theirs


def _collapsed(ground: Ground, windows: Windows, middles: Floats) -> Ground:
    """Return the vertices of windows in turn; those of a piece that is left out are where the pieces next to it meet.

    Where these do not meet between them, they are half way. A vertex that is left out is none of them.
    """
    (vertices, lengths), reached, ways = ground, ground.reached(), tangents(ground.vertices)
    points: list[Floats] = []
    spans: list[Floats] = []
    for (begin, end), ends in zip(windows.pairs(), middles.tolist(), strict=True):
        for middle in sorted(set(ends)):
            k = math.floor(middle)
            points.append(vertices[begin:k])
            spans.append(lengths[begin:k])
            begin = math.ceil(middle) + 1
            if k < middle:
                (ux, uy), (vx, vy) = ways[k].tolist(), ways[k + 2].tolist()
                along, up = (vertices[k + 1] - vertices[k]).tolist()
                sine = ux * vy - uy * vx
                share = (along * vy - up * vx) / sine * ux / along if sine else -1.0
                step = min(max(share, 0.0), 1.0) * along / ux
                between = -1e-9 < share < 1.0 + 1e-9
                meet = vertices[k] + step * ways[k] if between else 0.5 * (vertices[k] + vertices[k + 1])
                points.append(meet[np.newaxis])
                spans.append((reached[k : k + 2] + norms(meet - vertices[k : k + 2])).min(keepdims=True))
        points.append(vertices[begin:end])
        spans.append(lengths[begin:end])
    return Ground(np.concatenate(points), np.concatenate(spans))


def _respaced(ground: Ground, windows: Windows, count: Ints) -> Ground:
    """Return as many vertices as told for each window, all in turn: where evenly spaced tangents of the ground meet.

    Their places are evenly spaced in numbers of pieces, from the one before a window to the one behind it. Where two
    that follow each other do not meet between the places where they touch, a vertex is half way between these.
    """
    pieces = ground.pieces()
    begins, ends = pieces.begins[1::2], pieces.begins[2::2]
    middles = np.r_[begins[0], 0.5 * (ends[:-1] + begins[1:]), ends[-1]]
    spaced = zip(windows.pairs(), count.tolist(), strict=True)
    numbers = np.concatenate([np.linspace(begin, end, n + 1) for (begin, end), n in spaced])
    x = np.interp(numbers, np.arange(len(middles)), middles)
    k = pieces.numbers(x)
    y, sines = pieces.heights(x, k), pieces.sines_at(x, k)
    slopes = sines / cosines(sines)
    along, up, before, behind = np.diff(x), np.diff(y), slopes[:-1], slopes[1:]
    with np.errstate(all="ignore"):
        steps = (up - behind * along) / (before - behind)
    steps = np.where((steps > 0.0) & (steps < along), steps, 0.5 * along)
    rises = 0.5 * (before * steps + up - behind * (along - steps))
    spans = np.minimum(steps / cosines(sines[:-1]), (along - steps) / cosines(sines[1:]))
    inside = np.delete(np.arange(len(along)), np.cumsum(count + 1)[:-1] - 1)
    return Ground(np.column_stack([x[:-1] + steps, y[:-1] + rises])[inside], spans[inside])


def _evened(survey: Survey, ground: Ground) -> Ground:
    """Move vertices where none is an edge, so that the ground is bent less, and more evenly, within the tolerance."""
    vertices, lengths = ground.vertices.copy(), ground.lengths.copy()
    count, apart = len(vertices), 2 * _EVENED + 3
    for first in (0.0, 0.5, 0.75, 1.25):  # in numbers of windows, from the middle to either side
        offsets = np.arange(first * apart, 0.5 * count + apart, apart)
        middles = np.unique(np.r_[-offsets, offsets]) + 0.5 * (count - 1)
        begin, end = np.ceil(middles - _EVENED).astype(int), np.floor(middles + _EVENED).astype(int) + 1
        windows = Windows(np.clip(begin, 0, count), np.clip(end, 0, count))
        most = longest(vertices)
        freed = np.where(most * np.abs(half_turns(vertices)) < 2.0 * _EDGE * survey.tolerance, math.inf, lengths)
        windows = windows.where(windows.end > windows.begin)
        windows = windows.where(~windows.any(freed < _NEARLY * most, 0, 0))
        if not len(windows.begin):
            continue
        moved, better = refitted(survey, Ground(vertices, freed), windows, _EVENNESS)
        for share in (1.0, 0.5, 0.25):
            tried = Ground(vertices.copy(), lengths.copy())
            members = windows.where(better).members()
            tried.vertices[members] += share * (moved - vertices)[members]
            tried.lengths[members] = freed[members]
            good = better & ~windows.any(deviations(survey, tried) > 1.0)
            members = windows.where(good).members()
            vertices[members], lengths[members] = tried.vertices[members], freed[members]
            better &= ~good
    return Ground(vertices, lengths)
