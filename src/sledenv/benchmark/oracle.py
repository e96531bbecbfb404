"""The best launch of each context, by a dense search of all that is chosen: what every regret is measured against."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import qmc

from sledenv.benchmark.landing import Landing
from sledenv.benchmark.problem import Problem
from sledenv.envs.task import Contexts
from sledenv.files import replacing
from sledenv.scenario import CONTROLS, Context, Split

GRID: Final = {name: control.searched for name, control in CONTROLS.items()}  # launches of the dense search
FINE: Final = 32  # cells for each of these on the bounds of the box, where many optima lie, or if one alone is chosen
STARTS: Final = 36  # local maxima of the grid that are refined, and as many of the bounds together
KEPT: Final = 8  # of these, after half of the levels
LEVELS: Final = 12  # of refinement, each with half the width
NEIGHBOURS: Final = 60  # launches tried around each start at each level
NEAR: Final = 0.01  # what counts as near the optimum, relative to its reward
_BLOCK = 1 << 18  # descents at a time
_SAME = 1e-9  # rewards that differ by less come from the same physics


class JamMap(NamedTuple):
    """Expected reward of the launches of one context on a grid."""

    launches: tuple[NDArray[np.float64], ...]  # for each thing that is chosen, its values in [-1, 1]
    rewards: NDArray[np.float64]  # an axis for each of these


def jam_map(
    problem: Problem, contexts: Contexts, grid: Mapping[str, int] = GRID, split: Split = "test"
) -> list[JamMap]:
    """Try a grid of launches in each context of an array of shape (n, 8).

    ``grid`` says how many values are tried of each control that is chosen, both bounds among them, but of orientations
    a full turn apart only one. Launch noise is that of a split.
    """
    axes = _axes(problem, grid)
    points = _points(axes)
    rewards = _expect(problem, contexts, np.broadcast_to(points, (len(contexts), *points.shape)), split)
    return [JamMap(axes, row.reshape([len(axis) for axis in axes])) for row in rewards]


def best_launches(problem: Problem, contexts: Contexts) -> pd.DataFrame:
    """Search the best launch of each context of an array of shape (n, 8).

    Returns
    -------
    DataFrame
        One row a context: its fields; ``action_0``, ... and ``reward`` of the best launch found; and, from a grid of
        launches, ``uniform`` (mean reward), ``width`` (share of launches within 1 % of the best) and ``step_median``,
        ``step_p99`` (difference of reward between neighbours).
    """
    launches, best = _search(problem, contexts)
    # The grid of launches says what the landscape is like; no cell of a map may lie above the optimum that it shows.
    maps = jam_map(problem, contexts)
    rewards = np.array([one.rewards.ravel() for one in maps])
    higher = rewards.max(axis=1) > best
    launches[higher] = _points(maps[0].launches)[rewards.argmax(axis=1)][higher]
    best = np.maximum(best, rewards.max(axis=1))
    table = pd.DataFrame(contexts, columns=list(Context._fields))
    table[[f"action_{i}" for i in range(launches.shape[1])]] = launches
    table["reward"] = best
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


def _search(problem: Problem, contexts: Contexts) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the best launches found, shape (n, k), and what they earn, shape (n,).

    A grid of landings, see :class:`sledenv.benchmark.landing.Landing`, and finer ones of the bounds of the box, then
    local refinement from their highest maxima: points of a Sobol sequence in a box around each, which halves its width
    at every level. The landscape is made of plateaus with cliffs, so no gradient is used; told by launches, the
    plateaus would be oblique and thin.
    """
    landing = Landing(problem)
    lanes = np.arange(len(contexts))

    def earned(landings: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rewards of landings of shape (n, m, k)."""
        flat = landings.reshape(-1, landings.shape[2])
        launches = landing.launches(np.repeat(contexts, landings.shape[1], axis=0), flat)
        return _expect(problem, contexts, launches.reshape(landings.shape))

    starts, heights = [], []
    for axes, count, apart in _grids(problem):
        cells = _points(axes)
        found = earned(np.broadcast_to(cells, (len(contexts), *cells.shape)))
        shape = [len(axis) for axis in axes]
        highest = np.array([_maxima(problem, row.reshape(shape), count, apart) for row in found])
        starts.append(cells[highest])
        heights.append(found[lanes[:, np.newaxis], highest])
    points, values = np.concatenate(starts, axis=1), np.concatenate(heights, axis=1)
    width = np.array([2.0 / (len(axis) - (not problem.turns[i])) for i, axis in enumerate(_axes(problem, GRID))])
    # An even number of points in pairs that mirror each other, so that a mirror image has a mirror-image optimum.
    cloud = 2.0 * qmc.Sobol(problem.actions, scramble=False).random_base2(5)[1 : NEIGHBOURS // 2 + 1] - 1.0
    cloud = np.concatenate([cloud, -cloud])
    for level in range(LEVELS):
        tried = _inside(problem, points[:, :, np.newaxis] + 0.5**level * width * cloud)
        found = earned(tried.reshape(len(contexts), -1, problem.actions)).reshape(*values.shape, -1)
        best = found.argmax(axis=2)
        better = np.take_along_axis(found, best[..., np.newaxis], 2)[..., 0]
        nearby = np.take_along_axis(tried, best[..., np.newaxis, np.newaxis], 2)[:, :, 0]
        points = np.where((better > values)[..., np.newaxis], nearby, points)
        values = np.maximum(values, better)
        if level == LEVELS // 2 - 1:
            kept = np.argsort(-values, axis=1, kind="stable")[:, :KEPT]
            points, values = np.take_along_axis(points, kept[..., np.newaxis], 1), np.take_along_axis(values, kept, 1)
    return landing.launches(contexts, points[lanes, values.argmax(axis=1)]), values.max(axis=1)


def _key(problem: Problem, contexts: Contexts) -> str:
    settings = [problem.scenario.hash, problem.control, problem.task.solver, *problem.task.noise.tolist()]
    settings += [[CONTROLS[name].searched for name in problem.task.controlled], FINE, STARTS, KEPT, LEVELS, NEIGHBOURS]
    digest = hashlib.sha256(json.dumps(settings).encode())
    digest.update(np.ascontiguousarray(contexts).tobytes())
    return digest.hexdigest()[:16]


def _expect(
    problem: Problem, contexts: Contexts, actions: NDArray[np.float64], split: Split = "test"
) -> NDArray[np.float64]:
    """Evaluate :meth:`Problem.expect` block by block, so that memory stays bounded."""
    rows = max(1, _BLOCK // actions.shape[1])
    parts = [
        problem.expect(contexts[start : start + rows], actions[start : start + rows], split)
        for start in range(0, len(contexts), rows)
    ]
    return np.concatenate(parts)


def _axes(problem: Problem, grid: Mapping[str, int]) -> tuple[NDArray[np.float64], ...]:
    return tuple(
        np.linspace(-1.0, 1.0, grid[name], endpoint=not problem.turns[i])
        for i, name in enumerate(problem.task.controlled)
    )


def _grids(problem: Problem) -> list[tuple[tuple[NDArray[np.float64], ...], int, int]]:
    """Return the grids that are searched: axes, how many maxima are refined, and how many cells they keep apart."""
    chosen = len(problem.task.controlled)
    # Along each axis of a bound. Of n axes the whole bound has the n-th root of FINE: it has more coarse cells anyhow.
    finer = round(FINE ** (1.0 / max(chosen - 1, 1) ** 2))
    fine = _axes(problem, {name: finer * count for name, count in GRID.items()})
    apart = max(finer // 2, 1)  # half a coarse cell
    if chosen == 1:
        return [(fine, STARTS, apart)]
    bounds = [(i, np.array([bound])) for i in range(chosen) if not problem.turns[i] for bound in (-1.0, 1.0)]
    edges = [(*fine[:i], bound, *fine[i + 1 :]) for i, bound in bounds]
    return [(_axes(problem, GRID), STARTS, 1), *((edge, STARTS // len(edges), apart) for edge in edges)]


def _points(axes: tuple[NDArray[np.float64], ...]) -> NDArray[np.float64]:
    """Return the cells of a grid, shape (m, axes)."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def _inside(problem: Problem, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Put launches into the box: a full turn wraps around, everything else stops at its bounds."""
    columns = [
        (points[..., i] + 1.0) % 2.0 - 1.0 if problem.turns[i] else np.clip(points[..., i], -1.0, 1.0)
        for i in range(points.shape[-1])
    ]
    return np.stack(columns, axis=-1)


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
