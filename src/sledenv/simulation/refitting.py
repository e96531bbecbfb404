"""Vertices of a ground of straight pieces and arcs moved by least squares, in many windows at once.

Arithmetic is plain, as in :mod:`sledenv.simulation.bends`: a fit is the same on every machine.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.simulation.bends import STEEPEST, Pieces, half_turns, longest, pieces_of

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Bools = NDArray[np.bool_]

SPARE: Final = 0.9  # tolerances: what is this near is near enough, so that something is left for what changes later
_STEPS: Final = 10  # of least squares at most
_HOPELESS: Final = 2.0  # tolerances: a window that is further off after three of them is given up
_PLACES: Final = 16000  # how many heights are compared where there are fewer points, four to a piece at most


class Survey(NamedTuple):
    """A section and how near to it a ground must be."""

    points: Floats  # [m] x = 0 in the middle; shape (n, 2)
    tolerance: float  # [m]
    x: Floats  # [m] where heights are compared in least squares; shape (s,)
    y: Floats  # [m] of the section there
    widths: Floats  # [m] of what each of these places stands for

    def snapped(self, vertices: Floats, fineness: int) -> Floats:
        """Return vertices on a grid, 2^-fineness tolerances fine, so that rounding does not grow from step to step."""
        grid = self.tolerance * 0.5**fineness
        found: Floats = grid * np.round(vertices / grid)
        return found


class Ground(NamedTuple):
    """Straight pieces and arcs."""

    vertices: Floats  # [m] shape (m, 2)
    lengths: Floats  # [m] from a vertex to the ends of its arc at most, inf where its pieces alone limit it; shape (m,)

    def reached(self) -> Floats:
        """Lengths [m] that there are."""
        return np.minimum(self.lengths, longest(self.vertices))

    def pieces(self) -> Pieces:
        """Return the pieces and the arcs."""
        return pieces_of(self.vertices, self.reached())

    def bent(self) -> Floats:
        """Roots of the bending energies of the arcs [m^-0.5], but for a factor; signed."""
        roots: Floats = half_turns(self.vertices) / np.sqrt(self.reached() + 1e-300)
        return roots

    def replaced(self, windows: Windows, other: Ground, theirs: Windows) -> Ground:
        """Return it with what is in the other's windows where its own windows are."""
        count, last, order = len(self.vertices), 0, []
        for (i, j), (begin, end) in zip(windows.pairs(), theirs.pairs(), strict=True):
            order += [np.arange(last, i), np.arange(count + begin, count + end)]
            last = j
        taken = np.concatenate([*order, np.arange(last, count)])
        columns = zip(self, other, strict=True)
        return Ground(*(np.concatenate(pair)[taken] for pair in columns))


class Windows(NamedTuple):
    """Runs of vertices that move together, begin <= k < end, in turn; between two of them are two vertices or more."""

    begin: Ints
    end: Ints

    def pairs(self) -> list[tuple[int, int]]:
        """Return them one by one."""
        return list(zip(self.begin.tolist(), self.end.tolist(), strict=True))

    def members(self) -> Ints:
        """Return the numbers of their vertices in turn."""
        return _runs(self.begin, self.end - self.begin)

    def where(self, wanted: Bools | Ints) -> Windows:
        """Return some of them."""
        return Windows(self.begin[wanted], self.end[wanted])

    def sums(self, values: NDArray[Any], before: int = 1, behind: int = 1) -> NDArray[Any]:
        """Return sums of values, those of some numbers before each window and behind it too."""
        total = np.r_[0, np.cumsum(values)]
        first, last = np.clip([self.begin - before, self.end + behind], 0, len(values))
        found: NDArray[Any] = total[last] - total[first]
        return found

    def any(self, wrong: Bools, before: int = 1, behind: int = 1) -> Bools:
        """Whether anything is wrong there."""
        return np.asarray(self.sums(wrong, before, behind) > 0)


def _runs(begin: Ints, count: Ints) -> Ints:
    """Return whole numbers in turn, of each run from its first one as many as told."""
    found: Ints = np.repeat(begin - np.cumsum(count) + count, count) + np.arange(count.sum())
    return found


def surveyed(points: Floats, tolerance: float) -> Survey:
    """Return a section, of points of shape (n, 2), with the places where heights are compared."""
    (x, y), (along, up) = points.T, np.diff(points, axis=0).T
    cut = min(max(_PLACES // len(x), 1), 4)
    shares = (np.arange(cut) + 0.5) / cut
    level = (x[-1] - x[0]) * np.ldexp(1.0, -np.arange(2, 14))  # where the arc at the first or the last vertex may be
    inside = [(first[:-1, np.newaxis] + step[:, np.newaxis] * shares).ravel() for first, step in ((x, along), (y, up))]
    places = np.r_[x[0] - level, inside[0], x[-1] + level[::-1]]
    heights = np.r_[np.full(len(level), y[0]), inside[1], np.full(len(level), y[-1])]
    return Survey(points, tolerance, places, heights, np.r_[level, np.repeat(along / cut, cut), level[::-1]])


def misplaced(vertices: Floats) -> Bools:
    """Whether each piece between vertices, shape (m, 2), runs backwards or is too steep; shape (m - 1,)."""
    along, up = np.diff(vertices, axis=0).T
    wrong: Bools = ~((along > 0.0) & (np.abs(up) <= math.tan(STEEPEST) * along))
    return wrong


def deviations(survey: Survey, ground: Ground) -> Floats:
    """Largest difference from the section, in tolerances, from half way before each vertex to half way behind it.

    It is exact. Between two places where a piece of either begins the section is straight, and the difference is
    largest at one of them or where an arc is parallel to it.
    """
    (x, y), pieces = survey.points.T, ground.pieces()
    places = np.sort(np.r_[x, pieces.begins[1:]])
    begin, end = places[:-1], places[1:]
    k = pieces.numbers(begin)
    slopes = np.r_[0.0, np.diff(y) / np.diff(x), 0.0][np.searchsorted(x, begin, side="right")]
    height, curvature = np.interp(begin, x, y), pieces.curvatures[k]
    turn = slopes / np.sqrt(1.0 + slopes * slopes) - pieces.sines[k]
    parallel = pieces.places[k, 0] + np.divide(turn, curvature, out=np.zeros(len(k)), where=curvature != 0.0)
    away = np.zeros(len(k))
    for place in (begin, np.clip(parallel, begin, end), end):
        away = np.maximum(away, np.abs(pieces.heights(place, k) - (height + slopes * (place - begin))))
    middles = 0.5 * (ground.vertices[1:, 0] + ground.vertices[:-1, 0])
    found = np.zeros(len(ground.vertices))
    np.maximum.at(found, np.searchsorted(middles, begin, side="right"), away)
    np.maximum.at(found, np.searchsorted(middles, end, side="left"), away)
    return found / survey.tolerance


class _View(NamedTuple):
    """Sight of windows: their c vertices, one more to either side, and the s places that are compared next to these."""

    near: Ints  # vertices, in turn; shape (c,)
    owners: Ints  # the window of each
    starts: Ints  # of the places, the first one next to each
    counts: Ints  # and how many
    cells: Ints  # for which of these vertices a place is compared; shape (s,)
    x: Floats  # [m]
    y: Floats  # [m]
    shares: Floats  # its width, as a share of the mean piece

    def summed(self, values: Floats) -> Floats:
        """Return sums over the places next to each vertex, shape (c, ...), from values of all, shape (s, ...)."""
        if not len(values):
            return np.zeros((len(self.near), *values.shape[1:]))
        sums: Floats = np.add.reduceat(values, np.minimum(self.starts, len(values) - 1))
        sums[self.counts == 0] = 0.0
        return sums


class _Misfit(NamedTuple):
    away: Floats  # difference at each place, in tolerances; shape (s,)
    bent: Floats  # [m^-0.5] of each of the vertices that are seen; shape (c,)
    costs: Floats  # of each window; shape (w,)
    furthest: Floats  # largest difference, in tolerances


def _view(survey: Survey, vertices: Floats, windows: Windows) -> _View:
    """Return what windows see of vertices of shape (m, 2)."""
    first, last = np.maximum(windows.begin - 1, 0), np.minimum(windows.end + 1, len(vertices))
    near, owners = _runs(first, last - first), np.repeat(np.arange(len(first)), last - first)
    bounds = np.r_[-math.inf, 0.5 * (vertices[1:, 0] + vertices[:-1, 0]), math.inf]
    places: Ints = np.asarray(np.searchsorted(survey.x, bounds))
    counts = places[near + 1] - places[near]
    seen, cells = _runs(places[near], counts), np.repeat(np.arange(len(near)), counts)
    mean = (vertices[last - 1, 0] - vertices[first, 0]) / (last - 1 - first)
    shares = survey.widths[seen] / mean[owners[cells]]
    return _View(near, owners, np.cumsum(counts) - counts, counts, cells, survey.x[seen], survey.y[seen], shares)


def _misfit(survey: Survey, ground: Ground, view: _View, weights: Floats) -> _Misfit:
    """Return how far off a ground is. Bending energies count with the weight of their window, shape (w,).

    Large differences cost more than their squares: the tolerance is for the largest.
    """
    pieces, bent, owners = ground.pieces(), ground.bent()[view.near], view.owners[view.cells]
    away = (pieces.heights(view.x, pieces.numbers(view.x)) - view.y) / survey.tolerance
    squares, furthest = away * away, np.zeros(len(weights))
    costs = np.bincount(owners, view.shares * squares * (1.0 + squares * squares), len(weights))
    np.maximum.at(furthest, owners, np.abs(away))
    return _Misfit(away, bent, costs + weights * np.bincount(view.owners, bent * bent, len(weights)), furthest)


def refitted(survey: Survey, ground: Ground, windows: Windows, evenness: float) -> tuple[Floats, Bools]:
    """Move the vertices of windows, after Levenberg and Marquardt. The ends of the ground keep their heights.

    Parameters
    ----------
    survey, ground, windows
        What is to be met, and from where.
    evenness : float
        Weight of the bending energy, as a share of that which a window has at first: the weight of a mean difference
        of one tolerance is 1. With 0 a window is left as it is once it is near enough.

    Returns
    -------
    ndarray of shape (m, 2), ndarray of bool, shape (w,)
        All vertices [m], and whether those of a window are better than before.
    """
    vertices, (low, high), count = ground.vertices, survey.points[[0, -1], 0], len(windows.begin)
    view = _view(survey, vertices, windows)
    first = _misfit(survey, ground, view, np.zeros(count))
    weights = evenness / np.maximum(np.bincount(view.owners, first.bent * first.bent, count), 1e-300)
    damping, rejected, better = np.full(count, 1e-3), np.zeros(count, int), np.zeros(count, bool)
    running = np.flatnonzero((first.furthest > SPARE) | (evenness > 0.0))
    for step in range(_STEPS):
        if not len(running):
            break
        now, here, weight = Ground(vertices, ground.lengths), windows.where(running), weights[running]
        view, members = _view(survey, vertices, here), here.members()
        owners = np.repeat(np.arange(len(running)), here.end - here.begin)
        before = _misfit(survey, now, view, weight)
        moved = vertices.copy()
        moved[members] += _steps(survey, now, here, view, before, weight, damping[running])
        moved[members] = survey.snapped(moved[members], 10)
        moved[members, 0] = np.clip(moved[members, 0], low, high)
        moved[[0, -1], 1] = vertices[[0, -1], 1]
        wrong = here.any(misplaced(moved), behind=0)
        moved[members[wrong[owners]]] = vertices[members[wrong[owners]]]
        after = _misfit(survey, Ground(moved, ground.lengths), view, weight)
        good = ~wrong & (after.costs < before.costs)
        moved[members[~good[owners]]] = vertices[members[~good[owners]]]
        vertices = moved
        better[running] |= good
        damping[running] *= np.where(good, 0.2, 10.0)
        rejected[running] = np.where(good, 0, rejected[running] + 1)
        furthest = np.where(good, after.furthest, before.furthest)
        done = good & (after.costs > 0.99 * before.costs) | (rejected[running] > 3)
        if not evenness:
            done |= (furthest < SPARE) | (furthest > _HOPELESS) & (step >= 2)
        running = running[~done]
    return vertices, better


def _steps(
    survey: Survey, ground: Ground, windows: Windows, view: _View, misfit: _Misfit, weights: Floats, damping: Floats
) -> Floats:
    """Steps [m] of the vertices of windows, in turn, from damped normal equations: shape (k, 2).

    The ground next to a vertex depends on that one and on those next to it alone. So all derivatives come from three
    other grounds, in each of which every third vertex has moved; along x both ways, so that a mirror image has mirrored
    ones.
    """
    vertices, count, near, pieces = ground.vertices, len(ground.vertices), view.near, ground.pieces()
    k = pieces.numbers(view.x)
    heights, rows = pieces.heights(view.x, k), (np.arange(len(near)), np.arange(len(k)))
    units = np.column_stack([longest(vertices), np.full(count, survey.tolerance)])
    by_vertex, by_place = np.zeros((len(near), 3, 2)), np.zeros((len(k), 3, 2))
    for third in range(3):
        column = (third - near + 1) % 3
        for axis, shift in ((0, 2e-4), (0, -2e-4), (1, 0.05)):
            moved = vertices.copy()
            moved[third::3, axis] += shift * units[third::3, axis]
            other, share = Ground(moved, ground.lengths), (2.0 - axis) * shift
            change = (other.pieces().heights(view.x, k) - heights) / survey.tolerance
            by_vertex[rows[0], column, axis] += (other.bent()[near] - misfit.bent) / share
            by_place[rows[1], column[view.cells], axis] += change / share
    bending, heaving = by_vertex.reshape(-1, 6), by_place.reshape(-1, 6)
    squares, energy = misfit.away * misfit.away, weights[view.owners, np.newaxis] * bending
    pull = (view.shares * (1.0 + 3.0 * squares * squares))[:, np.newaxis] * heaving
    blocks = view.summed(pull[:, :, np.newaxis] * heaving[:, np.newaxis])
    blocks += energy[:, :, np.newaxis] * bending[:, np.newaxis]
    forces = view.summed(pull * misfit.away[:, np.newaxis]) + energy * misfit.bent[:, np.newaxis]

    size, owners = int((windows.end - windows.begin).max()), view.owners[:, np.newaxis]
    columns = 2 * (near - windows.begin[view.owners] + 1)[:, np.newaxis] + np.arange(6)  # from two vertices before
    matrix, right = np.zeros((len(weights), 2 * size + 8, 2 * size + 8)), np.zeros((len(weights), 2 * size + 8))
    np.add.at(matrix, (owners[:, np.newaxis], columns[:, :, np.newaxis], columns[:, np.newaxis]), blocks)
    np.add.at(right, (owners, columns), forces)
    numbers = windows.begin[:, np.newaxis] + np.arange(size)
    free = numbers < windows.end[:, np.newaxis]
    moves = np.stack([free, free & (numbers > 0) & (numbers < count - 1)], axis=-1).reshape(len(weights), -1)
    matrix, right = matrix[:, 4:-4, 4:-4] * (moves[:, :, np.newaxis] & moves[:, np.newaxis]), right[:, 4:-4] * moves
    diagonal = np.einsum("wii->wi", matrix)
    mean = diagonal.sum(axis=1) / np.maximum(moves.sum(axis=1), 1)
    diagonal += np.where(moves, 1e-6 * diagonal + (damping * mean)[:, np.newaxis] + 1e-300, 1.0)
    steps: Floats = -_solved(matrix, right).reshape(len(weights), size, 2)[free] * units[windows.members()]
    return steps


def _solved(matrices: Floats, right: Floats) -> Floats:
    """Solve positive definite equations, shapes (w, k, k) and (w, k), by elimination."""
    table = np.concatenate([matrices, right[:, :, np.newaxis]], axis=2)
    size = right.shape[1]
    for j in range(size):
        table[:, j] /= table[:, j, j, np.newaxis]
        others = np.delete(np.arange(size), j)
        table[:, others] -= table[:, others, j, np.newaxis] * table[:, j, np.newaxis]
    solved: Floats = table[:, :, -1]
    return solved
