"""The best launch or ride of each context, and an interval for what the best there is earns."""

from __future__ import annotations

import hashlib
import json
import math
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from joblib import cpu_count
from numpy.typing import ArrayLike, NDArray
from scipy import stats
from scipy.ndimage import gaussian_filter1d
from scipy.stats import qmc
from tqdm import tqdm

from sledenv.benchmark.best_rides import SEARCH, best_rides, follow_plans
from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import FIELDS, Contexts, checked_actions
from sledenv.machine.sealed import read_sealed, write_sealed
from sledenv.machine.workers import Call, runner
from sledenv.scenarios.scenario import NOISY, Context
from sledenv.scenarios.sections import CONTROLS

Floats = NDArray[np.float64]

CELLS: Final = 12_000  # descents of a map of a context, at most
SHOWN: Final = 3_000  # of one that is kept to be drawn
STEP: Final = 0.75  # of a map, in standard deviations of the launch noise
COARSE: Final = 16  # steps of a map along what is exact
REACH: Final = 3.0  # standard deviations to which the launch noise is followed
NODES: Final = (8, 32)  # scenes at each cell, for what is noisy and not chosen; with hidden fields
STARTS: Final = 24  # maxima of a map that are tried
KEPT: Final = 6  # of these, to be refined
NEIGHBOURS: Final = 8  # launches tried around each at each level, times draws
DRAWS: Final = 64  # of the launch noise, with which launches are compared
LEVELS: Final = (3, 10)  # of refinement, each with half the width; without launch noise
FINALISTS: Final = 2  # of each search
JUDGED: Final = (8, 256)  # samples of draws that judge the best launch, independent of each other and of the search
SEARCHES: Final = 2
NEAR: Final = 0.01  # what counts as near the optimum, relative to its reward
BLOCK: Final = 10  # contexts that are searched at a time, so that a stop loses no more
_PAYS: Final = 5  # rides whose search takes much longer than to start a process for it
_SAME: Final = 1e-9  # rewards that differ by less come from the same physics


class JamMap(NamedTuple):
    """Expected reward of the launches of one context on a grid."""

    launches: tuple[Floats, ...]  # for each thing that is chosen, its values in [-1, 1]
    rewards: Floats  # an axis for each of these


class _Axis(NamedTuple):
    values: Floats  # beyond [-1, 1] as far as the launch noise reaches
    step: float
    sigma: float  # standard deviation of the launch noise, 0 without
    beyond: int  # how many values lie outside on each side


def jam_map(problem: Problem, contexts: Contexts, cells: int = CELLS, number: int = 0) -> list[JamMap]:
    """Return maps of the expected reward of launches in contexts of shape (n, 12).

    The reward without errors is simulated on a grid, and the noise of what is chosen is a convolution of it with a
    normal distribution. What is noisy but not chosen, and what is hidden, differs from scene to scene, and every
    cell is the mean of some. Where a grid of ``cells`` descents is coarser than the launch noise, the map is, too.

    Parameters
    ----------
    problem : Problem
    contexts : ndarray, shape (n, 12)
    cells : int
        Descents a context, about.
    number : int
        Which of the searches it is: each has a grid and scenes of its own.
    """
    chosen = problem.task.controlled
    free = [name not in chosen for name in NOISY]
    hidden = bool(problem.task.hidden.any())
    nodes = NODES[hidden] if hidden or problem.noise[free].any() else 1
    axes = _axes(problem, cells // nodes, number)
    points = np.stack(np.meshgrid(*(axis.values for axis in axes), indexing="ij"), axis=-1).reshape(-1, len(axes))
    scenes = problem.scenes(contexts, nodes, (1, number), noisy=free)
    rewards = _mean_rewards(problem, scenes, np.broadcast_to(points, (len(contexts), *points.shape)))
    rewards = rewards.reshape(len(contexts), *(len(axis.values) for axis in axes))
    for i, axis in enumerate(axes):
        if axis.sigma:
            mode = "wrap" if problem.turns[i] else "nearest"
            rewards = gaussian_filter1d(rewards, axis.sigma / axis.step, axis=i + 1, mode=mode, truncate=REACH)
    inside = tuple(slice(axis.beyond, len(axis.values) - axis.beyond) for axis in axes)
    launches = tuple(axis.values[part] for axis, part in zip(axes, inside, strict=True))
    return [JamMap(launches, one[inside]) for one in rewards]


def best_launches(problem: Problem, contexts: Contexts) -> pd.DataFrame:
    """Search the best launch of each context of an array of shape (n, 12).

    Returns
    -------
    DataFrame
        One row a context: its fields; ``action_0``, ... of the best launch, in [-1, 1]; its ``reward``, expected over
        the draws with which agents are judged; ``low`` and ``high``, an interval for the expected reward of the best
        launch there is; ``uniform``, the expected reward of a random launch; ``width``, the share of launches whose
        expected reward is within 1 % of the best. With hidden fields ``seen_0``, ..., the launch that is best for what
        is seen, and ``seen``, what that earns in this context.

    Notes
    -----
    Two searches begin at the highest cells of a :func:`jam_map` of their own, compare launches by the same draws of the
    noise and refine the best of them. The best of what both find is judged anew by 8 samples of 256 draws, so that
    it owes nothing to luck: their mean, 2.4 of its standard errors (95 %, 7 degrees of freedom) and a loss that 2,048
    draws may have missed make the interval. Above, it is wider by how far the searches are apart.

    Raises
    ------
    ValueError
        If the problem is one of rides: :func:`best_found` searches those.
    """
    problem.must_be("launch", "the best launches; best_found searches rides")
    table = pd.DataFrame(contexts, columns=list(Context._fields))
    launches, low, high = _searched(problem, contexts, imagined=False)
    maps = jam_map(problem.seeing_all(), contexts, SHOWN)
    rewards = np.array([one.rewards.ravel() for one in maps])
    table[_columns(problem, "action")] = launches
    table["reward"] = rewards_of(problem, contexts, launches)
    table["low"], table["high"] = low, high
    table["uniform"] = rewards.mean(axis=1)
    table["width"] = (rewards >= (1.0 - NEAR) * rewards.max(axis=1, keepdims=True)).mean(axis=1)
    if problem.task.hidden.any():
        seen, _, _ = _searched(problem, contexts, imagined=True)
        table[_columns(problem, "seen")] = seen
        table["seen"] = rewards_of(problem, contexts, seen)
    return table


def best_found(
    problem: Problem, contexts: Contexts, *, progress: bool = False, workers: int | None = 1
) -> pd.DataFrame:
    """Search the best of each context of an array of shape (n, 12): :func:`best_launches`, or of rides the best one.

    Of rides the table has the columns of :func:`sledenv.benchmark.best_rides.best_rides` behind the fields of the
    context, for the draw with which agents are judged: row i has the i-th draw of the launch noise, so that
    ``contexts[5:]`` have other draws than with the first five. With ``progress`` a bar on standard error shows how far
    it is. Rides are searched by so many ``workers``, None as many as there are cores, and launches by threads; the
    table does not depend on their number.
    """
    trials = problem.trials(contexts, "test")
    count = min(workers or cpu_count(), len(trials) // _PAYS) if problem.environment == "descent" else 1
    size = min(BLOCK, math.ceil(len(trials) / count)) if count > 1 else BLOCK
    parts = [trials[start : start + size] for start in range(0, len(trials), size)]
    calls: list[Call] = [(_best_part, (problem, part, number)) for number, part in enumerate(parts)]
    tables: dict[int, pd.DataFrame] = {}
    with tqdm(total=len(trials), desc="searching the best", unit=" contexts", disable=not progress) as bar:
        for number, table in runner(count)(calls) if count > 1 else (call(*given) for call, given in calls):
            tables[number] = table
            bar.update(len(table))
    return pd.concat([tables[number] for number in range(len(parts))], ignore_index=True)


def _best_part(problem: Problem, trials: Contexts, number: int) -> tuple[int, pd.DataFrame]:
    return number, _best(problem, trials)


def oracle(problem: Problem, contexts: Contexts, folder: Path) -> pd.DataFrame:
    """Return :func:`best_found`, from a Parquet file of ``folder`` if it has been searched before.

    The name of the file holds a hash of the scenario, the control, the contexts and the settings of the search. A file
    of older physics is recognised, because what it holds does not earn its rewards any more, and so is one that has
    been changed; both are written anew. Contexts are searched in blocks, each with a file of its own until all are
    done, so that a search that is stopped goes on.
    """
    trials = problem.trials(contexts, "test")
    path = _path(problem, trials, folder)
    table = _left(problem, path, trials)
    if table is not None:
        return table
    starts = range(0, len(contexts), BLOCK)
    table = pd.concat([_block(problem, trials, path, start) for start in starts], ignore_index=True)
    write_sealed(table, path)
    for start in starts:
        _block_file(path, start).unlink()
    return table


def search_block(problem: Problem, contexts: Contexts, folder: Path, start: int) -> None:
    """Do a part of :func:`oracle`: search the ``BLOCK`` contexts from one on, unless they have been."""
    trials = problem.trials(contexts, "test")
    path = _path(problem, trials, folder)
    if _left(problem, path, trials) is None:
        _block(problem, trials, path, start)


def _path(problem: Problem, trials: Contexts, folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder / f"oracle-{problem.scenario.id}-{_key(problem, trials)}.parquet"


def _block_file(path: Path, start: int) -> Path:
    return path.with_name(f"{path.stem}-from{start:06d}.parquet")


def _block(problem: Problem, trials: Contexts, path: Path, start: int) -> pd.DataFrame:
    """Return the table of a block of contexts, from its file if it has been searched before."""
    file, part = _block_file(path, start), trials[start : start + BLOCK]
    block = _left(problem, file, part)
    if block is None:
        block = _best(problem, part)
        write_sealed(block, file)
    return block


def _best(problem: Problem, trials: Contexts) -> pd.DataFrame:
    """Search the best launch or ride of contexts that are judged by trials of shape (n, t, 12) or (n, t, 14)."""
    contexts = trials[:, 0, :FIELDS]
    if problem.environment == "launch":
        return best_launches(problem, contexts)
    fields = pd.DataFrame(contexts, columns=list(Context._fields))
    return pd.concat([fields, best_rides(problem, trials[:, 0])], axis=1)


def _left(problem: Problem, file: Path, trials: Contexts) -> pd.DataFrame | None:
    """Return a table that has been searched before, None if there is none, or not of this physics."""
    table = read_sealed(file, "searching")
    same = table is not None and np.allclose(_earned(problem, trials, table), table["reward"], rtol=0.0, atol=_SAME)
    return table if same else None


def map_table(problem: Problem, contexts: Contexts) -> pd.DataFrame:
    """Return the jam maps of contexts as one table.

    Returns
    -------
    DataFrame
        One row a launch: ``context``, the number of its row; each of ``CONTROLS`` in [-1, 1], NaN where it is not
        chosen; ``reward``.
    """
    parts = [pd.DataFrame({name: np.empty(0) for name in ("context", *CONTROLS, "reward")})]
    for i, one in enumerate(jam_map(problem, contexts, SHOWN) if len(contexts) else []):
        grid = dict(zip(problem.task.controlled, np.meshgrid(*one.launches, indexing="ij"), strict=True))
        none = np.full(one.rewards.shape, np.nan)
        columns = {name: grid.get(name, none).ravel() for name in CONTROLS}
        parts.append(pd.DataFrame({"context": i, **columns, "reward": one.rewards.ravel()}))
    return pd.concat(parts[1:] or parts, ignore_index=True)


def actions_of(problem: Problem, table: pd.DataFrame) -> Floats:
    """Return the best launches of a table of :func:`best_launches`, shape (n, k)."""
    return np.asarray(table[_columns(problem, "action")], np.float64)


def rewards_of(problem: Problem, contexts: Contexts, launches: ArrayLike) -> Floats:
    """Return what launches of shape (n, k) earn in contexts in the mean of the draws that judge agents, shape (n,).

    Raises
    ------
    ValueError
        If the problem is one of rides, which :meth:`sledenv.benchmark.problem.Problem.judge` follows.
    gymnasium.error.InvalidAction
        If launches have another shape, are no numbers or lie outside [-1, 1].
    """
    problem.must_be("launch", "launches that are chosen; Problem.judge follows rides")
    chosen = checked_actions(problem.action_space, problem.task.action_names, launches, len(contexts))
    earned: Floats = problem.expect(problem.trials(contexts, "test"), chosen[:, np.newaxis])[:, 0]
    return earned


def _earned(problem: Problem, trials: Contexts, table: pd.DataFrame) -> Floats:
    """Simulate what a table of :func:`best_found` holds once more and return its rewards, shape (n,)."""
    if problem.environment == "launch":
        earned: Floats = problem.expect(trials, actions_of(problem, table)[:, np.newaxis])[:, 0]
        return earned
    plans = table.filter(like="action_").to_numpy(np.float64)
    return np.asarray(follow_plans(problem, trials[:, 0], plans).jam.reward)


def _searched(problem: Problem, contexts: Contexts, *, imagined: bool) -> tuple[Floats, Floats, Floats]:
    """Return the best launches, shape (n, k), and the interval of what the best there are earn, shapes (n,)."""
    if not imagined:
        problem = problem.seeing_all()
    found = np.concatenate([_search(problem, contexts, number) for number in range(SEARCHES)], axis=1)
    # Which is best is decided by other draws than those of the searches and those of the interval.
    earned = problem.expect(problem.scenes(contexts, JUDGED[1], (3,)), found)
    best = np.take_along_axis(found, earned.argmax(axis=1)[:, np.newaxis, np.newaxis], axis=1)
    each = earned.reshape(len(contexts), SEARCHES, -1).max(axis=2)
    apart = np.ptp(each, axis=1)
    samples, draws = JUDGED if problem.noise.any() or imagined else (2, 1)
    judged = np.stack(
        [problem.expect(problem.scenes(contexts, draws, (4, i)), best)[:, 0] for i in range(samples)], axis=-1
    )
    mean, error = judged.mean(axis=1), judged.std(axis=1, ddof=1) / math.sqrt(samples)
    missed = mean / math.prod(JUDGED)
    half = float(stats.t.ppf(0.975, samples - 1)) * error + missed
    return best[:, 0], np.maximum(mean - half, 0.0), np.minimum(mean + half + apart, 1.0)


def _search(problem: Problem, contexts: Contexts, number: int) -> Floats:
    """Return the launches that one of the searches finds best, shape (n, FINALISTS, k)."""
    maps = jam_map(problem, contexts, CELLS, number)
    axes = maps[0].launches
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    points = cells[np.array([_maxima(problem, one.rewards, STARTS) for one in maps])]
    noisy = problem.noise.any() or problem.task.hidden.any()
    earned = partial(problem.expect, problem.scenes(contexts, DRAWS if noisy else 1, (2, number)))
    points, values = _highest(points, earned(points), KEPT)
    step = np.array([axis[1] - axis[0] if len(axis) > 1 else 0.0 for axis in axes])
    count = NEIGHBOURS if noisy else NEIGHBOURS * DRAWS // LEVELS[1]
    # In pairs that mirror each other, so that a mirror image has a mirror-image optimum.
    half = qmc.Sobol(len(axes), rng=np.random.default_rng(number)).random_base2(9)[: count // 2]
    cloud = np.concatenate([2.0 * half - 1.0, 1.0 - 2.0 * half])
    for level in range(LEVELS[0 if noisy else 1]):
        tried = problem.inside(points[:, :, np.newaxis] + 0.5**level * step * cloud)
        found = earned(tried.reshape(len(points), -1, len(axes))).reshape(*values.shape, -1)
        best = found.argmax(axis=2)[..., np.newaxis]
        better = np.take_along_axis(found, best, 2)[..., 0]
        nearby = np.take_along_axis(tried, best[..., np.newaxis], 2)[:, :, 0]
        points = np.where((better > values)[..., np.newaxis], nearby, points)
        values = np.maximum(values, better)
    return _highest(points, values, FINALISTS)[0]


def _axes(problem: Problem, cells: int, number: int) -> list[_Axis]:
    """Return the axes of a map of so many cells, with steps that suit the launch noise, if there are cells enough."""
    names = problem.task.controlled
    sigma = []
    for name in names:
        half = 0.5 * float(np.ptp(problem.task.bounds[name]))
        sigma.append(float(problem.noise[NOISY.index(name)]) / half if name in NOISY and half > 0.0 else 0.0)
    wanted = [2.0 / (STEP * one) if one else COARSE for one in sigma]
    share = cells / math.prod(wanted)
    noisy = sum(one > 0.0 for one in sigma)
    if share < 1.0 or not noisy:  # too many, or all alike
        fewer = share ** (1.0 / (noisy or len(names)))
        wanted = [count * fewer if one or not noisy else count for count, one in zip(wanted, sigma, strict=True)]
    axes = []
    for count, one, turning in zip(wanted, sigma, problem.turns, strict=True):
        steps = max(math.ceil(count), 2) + number  # another grid for another search
        step = 2.0 / steps
        beyond = 0 if turning else math.ceil(REACH * one / step)
        last = steps if turning else steps + 1  # the bounds of a full turn are the same launch
        values: Floats = np.asarray(-1.0 + 2.0 * (np.arange(-beyond, last + beyond) / steps), np.float64)  # 1 exactly
        axes.append(_Axis(values, step, one, beyond))
    return axes


def _mean_rewards(problem: Problem, scenes: Contexts, points: Floats) -> Floats:
    """Mean rewards over scenes (n, t, 14) of launches (n, m, k) that may lie outside the bounds, shape (n, m)."""
    total: Floats = np.zeros(points.shape[:2])
    for i in range(scenes.shape[1]):
        total += problem.expect(scenes[:, i : i + 1], points) / scenes.shape[1]
    return total


def _highest(points: Floats, values: Floats, count: int) -> tuple[Floats, Floats]:
    """Keep the points of the highest values, the best first."""
    kept = np.argsort(-values, axis=1, kind="stable")[:, :count]
    return np.take_along_axis(points, kept[..., np.newaxis], 1), np.take_along_axis(values, kept, 1)


def _maxima(problem: Problem, rewards: Floats, count: int) -> NDArray[np.intp]:
    """Return the flat indices of the highest cells of a grid, shape (count,); neighbours if there are no others."""
    left, every = rewards.copy(), rewards.copy()
    chosen = []
    for _ in range(count):
        best = np.unravel_index((left if left.max() >= 0.0 else every).argmax(), left.shape)
        chosen.append(np.ravel_multi_index(best, left.shape))
        near = []
        for i, index in enumerate(best):
            cells = index + np.arange(-1, 2)
            near.append(cells % left.shape[i] if problem.turns[i] else np.clip(cells, 0, left.shape[i] - 1))
        every[best] = -1.0
        left[np.ix_(*near)] = -1.0
    return np.array(chosen)


def _columns(problem: Problem, word: str) -> list[str]:
    return [f"{word}_{i}" for i in range(len(problem.task.controlled))]


def _key(problem: Problem, trials: Contexts) -> str:
    task = problem.task
    settings = [problem.scenario.hash, problem.control, task.solver, *problem.noise.tolist(), *task.observed]
    if problem.environment == "launch":
        settings += [CELLS, SHOWN, STEP, COARSE, REACH, *NODES, STARTS, KEPT, NEIGHBOURS, DRAWS, *LEVELS]
        settings += [FINALISTS, *JUDGED, SEARCHES, NEAR]
    else:
        settings += SEARCH
    digest = hashlib.sha256(json.dumps(settings).encode())
    digest.update(np.ascontiguousarray(trials).tobytes())
    return digest.hexdigest()[:16]
