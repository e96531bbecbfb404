"""The best launch of each context, by a dense search of all that is chosen: what every regret is measured against."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter
from scipy.stats import qmc

from sledenv.benchmark.landing import Landing
from sledenv.benchmark.problem import TREMBLE, TREMBLES, Problem
from sledenv.envs.inputs import Contexts
from sledenv.machine.files import replacing
from sledenv.scenarios.scenario import Context, Split
from sledenv.scenarios.sections import CONTROLS

GRID: Final = {name: control.searched for name, control in CONTROLS.items()}  # launches of the dense search
FINE: Final = 32  # cells for each of these on the bounds of the box, where many optima lie, or if one alone is chosen
STARTS: Final = 24  # local maxima of the grid that are refined, and as many of the bounds together
KEPT: Final = 8  # of these, after half of the levels
LEVELS: Final = 12  # of refinement, each with half the width
NEIGHBOURS: Final = 60  # launches tried around each start at each level
SEARCHES: Final = (2, 6)  # of a context, by different grids: always, and at most where they do not agree
_OTHER: Final = (0, -3, 5, -7, 9, -11)  # cells more along each axis of the grid of each of them
AGREED: Final = 1e-3  # by how much the best two may differ, relative to the best
STEADY: Final = 8  # launches that are refined under a tremble
STEADY_LEVELS: Final = 5
STEADY_NEIGHBOURS: Final = 16
NEAR: Final = 0.01  # what counts as near the optimum, relative to its reward
_BLOCK = 1 << 18  # descents at a time
_BOUND = 0.95 / 0.05  # the bound of 95 % on what is left, by the difference of the best two searches
_SAME = 1e-9  # rewards that differ by less come from the same physics


class JamMap(NamedTuple):
    """Expected reward of the launches of one context on a grid."""

    launches: tuple[NDArray[np.float64], ...]  # for each thing that is chosen, its values in [-1, 1]
    rewards: NDArray[np.float64]  # an axis for each of these


def jam_map(
    problem: Problem, contexts: Contexts, grid: Mapping[str, int] = GRID, split: Split = "test"
) -> list[JamMap]:
    """Try a grid of launches in each context of an array of shape (n, 11).

    ``grid`` says how many values are tried of each control that is chosen, both bounds among them, but of orientations
    a full turn apart only one. Launch noise is that of a split.
    """
    axes = grid_axes(problem, grid)
    points = _points(axes)
    rewards = _expect(problem, contexts, np.broadcast_to(points, (len(contexts), *points.shape)), split)
    return [JamMap(axes, row.reshape([len(axis) for axis in axes])) for row in rewards]


def best_launches(problem: Problem, contexts: Contexts) -> pd.DataFrame:
    """Search the best launch of each context of an array of shape (n, 11).

    Returns
    -------
    DataFrame
        One row a context: its fields; ``action_0``, ... and ``reward`` of the best launch found; ``left``, by how much
        a better one may be missed (see below), with ``left_high``, the bound of 95 %, and ``searches``, from how many;
        ``steady_0``, ... of the best launch under a tremble, see
        :meth:`~sledenv.benchmark.problem.Problem.trembling`, and its mean reward ``steady``; and, from a grid of
        launches, ``uniform`` (mean reward), ``width`` (share of launches within 1 % of the best) and ``step_median``,
        ``step_p99`` (difference of reward between neighbours).

    Notes
    -----
    Each context is searched twice, by other grids and other points around their maxima, and again where the best two
    results differ by more than ``AGREED``. The best less the second best is ``left``: added to the best, it is the
    estimate of the maximum, and its bound of 50 %, that two largest values give, and 19 times that its bound of 95 %
    (Robson and Whitlock, Biometrika 51, 1964).
    """
    landings, best, left, searches = _searched(problem, contexts)
    steady, steadily = _steadiest(problem, contexts, landings)
    landing = Landing(problem)
    launches, steady = landing.launches(contexts, landings), landing.launches(contexts, steady)
    # The grid of launches says what the landscape is like; no cell of a map may lie above the optimum that it shows.
    maps = jam_map(problem, contexts)
    rewards = np.array([one.rewards.ravel() for one in maps])
    higher = rewards.max(axis=1) > best
    launches[higher] = _points(maps[0].launches)[rewards.argmax(axis=1)][higher]
    left = np.where(higher, rewards.max(axis=1) - best, left)
    best = np.maximum(best, rewards.max(axis=1))
    table = pd.DataFrame(contexts, columns=list(Context._fields))
    table[[f"action_{i}" for i in range(launches.shape[1])]] = launches
    table["reward"] = best
    table["left"] = np.minimum(left, 1.0 - best)
    table["left_high"] = np.minimum(_BOUND * left, 1.0 - best)
    table["searches"] = searches
    table[[f"steady_{i}" for i in range(launches.shape[1])]] = steady
    table["steady"] = steadily
    table["uniform"] = rewards.mean(axis=1)
    table["width"] = (rewards >= (1.0 - NEAR) * best[:, np.newaxis]).mean(axis=1)
    steps = [np.abs(_differences(problem, one.rewards)) for one in maps]
    table["step_median"] = [float(np.median(one)) for one in steps]
    table["step_p99"] = [float(np.quantile(one, 0.99)) for one in steps]
    return table


def oracle(problem: Problem, contexts: Contexts, folder: Path) -> pd.DataFrame:
    """Return :func:`best_launches`, from a Parquet file of ``folder`` if it has been searched before.

    The name of the file holds a hash of the scenario, the control, the contexts and the settings of the search. A file
    of older physics is recognised, because its launches do not earn their rewards any more, and written anew.
    """
    path = folder / f"oracle-{problem.scenario.id}-{_key(problem, contexts)}.parquet"
    if path.is_file():
        table = pd.read_parquet(path)
        if np.allclose(rewards_again(problem, table), table["reward"], rtol=0.0, atol=_SAME):
            return table
    table = best_launches(problem, contexts)
    folder.mkdir(parents=True, exist_ok=True)
    with replacing(path, ".parquet") as part:
        table.to_parquet(part, index=False)
    return table


def map_table(problem: Problem, contexts: Contexts) -> pd.DataFrame:
    """Return the jam maps of contexts as one table.

    Returns
    -------
    DataFrame
        One row a launch: ``context``, the number of its row; each of ``CONTROLS`` in [-1, 1], NaN where it is not
        chosen; ``reward``.
    """
    parts = [pd.DataFrame({name: np.empty(0) for name in ("context", *CONTROLS, "reward")})]
    for i, one in enumerate(jam_map(problem, contexts) if len(contexts) else []):
        grid = dict(zip(problem.task.controlled, np.meshgrid(*one.launches, indexing="ij"), strict=True))
        none = np.full(one.rewards.shape, np.nan)
        columns = {name: grid.get(name, none).ravel() for name in CONTROLS}
        parts.append(pd.DataFrame({"context": i, **columns, "reward": one.rewards.ravel()}))
    return pd.concat(parts[1:] or parts, ignore_index=True)


def actions_of(problem: Problem, table: pd.DataFrame) -> NDArray[np.float64]:
    """Return the best launches of a table of :func:`best_launches`, shape (n, k)."""
    columns = [f"action_{i}" for i in range(len(problem.task.controlled))]
    return np.asarray(table[columns], np.float64)


def rewards_again(problem: Problem, table: pd.DataFrame) -> NDArray[np.float64]:
    """Simulate the best launches of a table once more and return their expected rewards, shape (n,)."""
    contexts = table[list(Context._fields)].to_numpy()
    return problem.expect(contexts, actions_of(problem, table)[:, np.newaxis], "test")[:, 0]


def _searched(
    problem: Problem, contexts: Contexts
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Search until the best two searches agree.

    Returns the best landings, shape (n, k), what they earn, by how much that is more than the second best search has
    found, and how many searches there were, shapes (n,).
    """
    landings = np.zeros((len(contexts), problem.actions))
    best, second = np.full((2, len(contexts)), -np.inf)
    searches = np.zeros(len(contexts), np.int64)
    least, most = SEARCHES
    for number in range(most):
        still = np.arange(len(contexts)) if number < least else np.flatnonzero(best - second > AGREED * best)
        if not still.size:
            break
        found, earned = _search(problem, contexts[still], number)
        higher = earned > best[still]
        landings[still[higher]] = found[higher]
        second[still] = np.maximum(second[still], np.minimum(best[still], earned))
        best[still] = np.maximum(best[still], earned)
        searches[still] += 1
    return landings, best, best - second, searches


def _search(problem: Problem, contexts: Contexts, number: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the best landings that one of the searches finds, shape (n, k), and what they earn, shape (n,).

    A grid of landings, see :class:`sledenv.benchmark.landing.Landing`, and finer ones of the bounds of the box, then
    local refinement from their highest maxima. The landscape is made of plateaus with cliffs, so no gradient is used;
    told by launches, the plateaus would be oblique and thin. Every search has a grid and a cloud of its own.
    """
    earned = partial(_earned, problem, contexts)
    # A grid that has both bounds, or all of a turn, is its own mirror image, whatever the number of its cells.
    other = _OTHER[number]
    grid = {name: count + (other if count > -min(_OTHER) else 0) for name, count in GRID.items()}
    starts, heights = [], []
    for axes, count, apart in _grids(problem, grid):
        cells = _points(axes)
        found = earned(np.broadcast_to(cells, (len(contexts), *cells.shape)))
        shape = [len(axis) for axis in axes]
        highest = np.array([_maxima(problem, row.reshape(shape), count, apart) for row in found])
        starts.append(cells[highest])
        heights.append(np.take_along_axis(found, highest, axis=1))
    points, values = np.concatenate(starts, axis=1), np.concatenate(heights, axis=1)
    cloud = _cloud(problem, NEIGHBOURS, number)
    half = LEVELS // 2
    points, values = _highest(*_refined(problem, earned, points, values, cloud, range(half)), KEPT)
    points, values = _refined(problem, earned, points, values, cloud, range(half, LEVELS))
    best, value = _highest(points, values, 1)
    return best[:, 0], value[:, 0]


def _steadiest(
    problem: Problem, contexts: Contexts, landings: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the best landings under a tremble, shape (n, k), and what they earn in the mean, shape (n,).

    A tremble is not much narrower than a cell of the grid: the mean over a cell and its neighbours says where to look.
    From there, and from the best landings without a tremble, it is refined. The result is judged by another tremble
    than that of the search, so that it owes nothing to luck.
    """
    earned = partial(_earned, problem, contexts, split="validation", trembling=True)
    axes = grid_axes(problem, GRID)
    cells, shape = _points(axes), [len(axis) for axis in axes]
    alone = _earned(problem, contexts, np.broadcast_to(cells, (len(contexts), *cells.shape)))
    modes = ["wrap" if turning else "nearest" for turning in problem.turns]
    smooth = [uniform_filter(row.reshape(shape), 3, mode=modes) for row in alone]
    starts = np.array([_maxima(problem, row, 3 * STEADY, 1) for row in smooth])
    points = np.concatenate([landings[:, np.newaxis], cells[starts]], axis=1)
    points, values = _highest(points, earned(points), STEADY)
    cloud = _cloud(problem, STEADY_NEIGHBOURS)
    best, _ = _highest(*_refined(problem, earned, points, values, cloud, range(STEADY_LEVELS)), 1)
    return best[:, 0], _earned(problem, contexts, best, trembling=True)[:, 0]


def _earned(
    problem: Problem,
    contexts: Contexts,
    landings: NDArray[np.float64],
    split: Split = "test",
    *,
    trembling: bool = False,
) -> NDArray[np.float64]:
    """Expected rewards of landings of shape (n, m, k), shape (n, m)."""
    flat = landings.reshape(-1, landings.shape[2])
    launches = Landing(problem).launches(np.repeat(contexts, landings.shape[1], axis=0), flat)
    return _expect(problem, contexts, launches.reshape(landings.shape), split, trembling=trembling)


def _cloud(problem: Problem, count: int, number: int = 0) -> NDArray[np.float64]:
    """Return points of a Sobol sequence in [-1, 1], shape (count, k), other ones for each number.

    An even number, in pairs that mirror each other, so that a mirror image has a mirror-image optimum.
    """
    half = count // 2
    points = qmc.Sobol(problem.actions, scramble=False).random_base2(8)[1 + number * half : 1 + (number + 1) * half]
    return np.concatenate([2.0 * points - 1.0, 1.0 - 2.0 * points])


def _refined(
    problem: Problem,
    earned: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    points: NDArray[np.float64],
    values: NDArray[np.float64],
    cloud: NDArray[np.float64],
    levels: range,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Move points, shape (n, m, k), with their values (n, m), to the best of a cloud around each, level by level.

    A cloud reaches from a cell of the grid to the next at level 0, and half as far at every further level.
    """
    width = np.array([2.0 / (len(axis) - (not problem.turns[i])) for i, axis in enumerate(grid_axes(problem, GRID))])
    for level in levels:
        tried = problem.inside(points[:, :, np.newaxis] + 0.5**level * width * cloud)
        found = earned(tried.reshape(len(points), -1, problem.actions)).reshape(*values.shape, -1)
        best = found.argmax(axis=2)[..., np.newaxis]
        better = np.take_along_axis(found, best, 2)[..., 0]
        nearby = np.take_along_axis(tried, best[..., np.newaxis], 2)[:, :, 0]
        points = np.where((better > values)[..., np.newaxis], nearby, points)
        values = np.maximum(values, better)
    return points, values


def _highest(
    points: NDArray[np.float64], values: NDArray[np.float64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Keep the points of the highest values, the best first."""
    kept = np.argsort(-values, axis=1, kind="stable")[:, :count]
    return np.take_along_axis(points, kept[..., np.newaxis], 1), np.take_along_axis(values, kept, 1)


def _key(problem: Problem, contexts: Contexts) -> str:
    settings = [problem.scenario.hash, problem.control, problem.task.solver, *problem.task.noise.tolist()]
    settings += [
        [CONTROLS[name].searched for name in problem.task.controlled],
        FINE,
        STARTS,
        KEPT,
        LEVELS,
        NEIGHBOURS,
    ]
    settings += [*SEARCHES, AGREED, TREMBLE, TREMBLES, STEADY, STEADY_LEVELS, STEADY_NEIGHBOURS]
    digest = hashlib.sha256(json.dumps(settings).encode())
    digest.update(np.ascontiguousarray(contexts).tobytes())
    return digest.hexdigest()[:16]


def _expect(
    problem: Problem,
    contexts: Contexts,
    actions: NDArray[np.float64],
    split: Split = "test",
    *,
    trembling: bool = False,
) -> NDArray[np.float64]:
    """Evaluate :meth:`~sledenv.benchmark.problem.Problem.expect` block by block, so that memory stays bounded."""
    rows = max(1, _BLOCK // actions.shape[1])
    parts = [
        problem.expect(contexts[start : start + rows], actions[start : start + rows], split, trembling=trembling)
        for start in range(0, len(contexts), rows)
    ]
    return np.concatenate(parts)


def grid_axes(problem: Problem, grid: Mapping[str, int]) -> tuple[NDArray[np.float64], ...]:
    """Return the values in [-1, 1] that a grid has of each control that is chosen, see :func:`jam_map`."""
    return tuple(
        np.linspace(-1.0, 1.0, grid[name], endpoint=not problem.turns[i])
        for i, name in enumerate(problem.task.controlled)
    )


def _grids(problem: Problem, grid: Mapping[str, int]) -> list[tuple[tuple[NDArray[np.float64], ...], int, int]]:
    """Return the grids that are searched: axes, how many maxima are refined, and how many cells they keep apart."""
    chosen = len(problem.task.controlled)
    # Along each axis of a bound. Of n axes the whole bound has the n-th root of FINE: it has more coarse cells anyhow.
    finer = round(FINE ** (1.0 / max(chosen - 1, 1) ** 2))
    fine = grid_axes(problem, {name: finer * count for name, count in grid.items()})
    apart = max(finer // 2, 1)  # half a coarse cell
    if chosen == 1:
        return [(fine, STARTS, apart)]
    bounds = [(i, np.array([bound])) for i in range(chosen) if not problem.turns[i] for bound in (-1.0, 1.0)]
    edges = [(*fine[:i], bound, *fine[i + 1 :]) for i, bound in bounds]
    return [(grid_axes(problem, grid), STARTS, 1), *((edge, STARTS // len(edges), apart) for edge in edges)]


def _points(axes: tuple[NDArray[np.float64], ...]) -> NDArray[np.float64]:
    """Return the cells of a grid, shape (m, axes)."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def _maxima(problem: Problem, rewards: NDArray[np.float64], count: int, apart: int) -> NDArray[np.intp]:
    """Return the flat indices of the highest cells of a grid, shape (count,).

    While there are others, none lies within ``apart`` cells of a higher one.
    """
    left, every = rewards.copy(), rewards.copy()
    chosen = []
    for _ in range(count):
        best = np.unravel_index((left if left.max() >= 0.0 else every).argmax(), left.shape)
        chosen.append(np.ravel_multi_index(best, left.shape))
        near = []
        for i, index in enumerate(best):
            cells = index + np.arange(-apart, apart + 1)
            near.append(cells % left.shape[i] if problem.turns[i] else np.clip(cells, 0, left.shape[i] - 1))
        every[best] = -1.0
        left[np.ix_(*near)] = -1.0
    return np.array(chosen)


def _differences(problem: Problem, rewards: NDArray[np.float64]) -> NDArray[np.float64]:
    """Differences between neighbouring cells of a grid, along all axes."""
    parts = []
    for i in range(rewards.ndim):
        parts.append(np.diff(rewards, axis=i).ravel())
        if problem.turns[i]:
            parts.append((np.take(rewards, 0, i) - np.take(rewards, -1, i)).ravel())
    return np.concatenate(parts)
