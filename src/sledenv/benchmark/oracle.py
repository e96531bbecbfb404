"""The best launch that a search finds in each context, and maps of what launches earn."""

from __future__ import annotations

import math
from functools import partial
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy import stats
from scipy.ndimage import gaussian_filter1d
from scipy.stats import qmc

from sledenv.benchmark.problem import Problem, checked_contexts
from sledenv.envs.inputs import Contexts, checked_actions
from sledenv.scenarios.scenario import NOISY, Context
from sledenv.simulation.rules import checked_kind

Floats = NDArray[np.float64]

CELLS: Final = 12_000  # descents of a map of a context, at most
SHOWN: Final = 3_000  # of one that tells what a random launch earns
STEP: Final = 0.75  # of a map, in standard deviations of the launch noise
COARSE: Final = 16  # steps of a map along what is exact
REACH: Final = 3.0  # standard deviations to which the launch noise is followed
NODES: Final = 8  # scenes at each cell, for what is noisy and not chosen
STARTS: Final = 24  # maxima of a map that are tried
KEPT: Final = 6  # of these, to be refined
NEIGHBOURS: Final = 8  # launches tried around each at each level, times draws
DRAWS: Final = 64  # of the launch noise, with which launches are compared
LEVELS: Final = (3, 10)  # of refinement, each with half the width; without launch noise
FINALISTS: Final = 2  # of each search
JUDGED: Final = (8, 256)  # samples and draws of each that judge the best launch, independent of the search
SEARCHES: Final = 2
NEAR: Final = 0.01  # what counts as near the optimum, relative to its reward


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
    normal distribution. What is noisy but not chosen differs from scene to scene, and every cell is the mean of some.
    Hidden fields are known. Where a grid of ``cells`` descents is coarser than the launch noise, the map is, too.

    Parameters
    ----------
    problem : Problem
    contexts : ndarray, shape (n, 12)
    cells : int
        Descents per context, about.
    number : int
        Which of the searches it is: each has a grid and scenes of its own.

    Raises
    ------
    TypeError, ValueError
        If it is no problem, or for wrong contexts.
    """
    problem, contexts = checked_kind("problem", problem, Problem).seeing_all(), checked_contexts(contexts)
    free = [name not in problem.task.controlled for name in NOISY]
    nodes = NODES if problem.noise[free].any() else 1
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
    """Search the best launch of each context of an array of shape (n, 12), hidden fields known.

    Returns
    -------
    DataFrame
        One row per context: its fields; ``action_0``, ... of the best launch found, in [-1, 1]; its ``reward``,
        expected over the draws with which agents are judged; ``low`` and ``high``, a 95 % interval for its expected
        reward; ``apart``, by how much what two searches find differs; ``uniform``, the expected reward of a random
        launch; ``width``, the share of launches whose expected reward is within 1 % of the highest.

    Notes
    -----
    Two searches begin at the highest cells of a :func:`jam_map` of their own, compare launches by the same draws of the
    noise and refine the best of them. The better of what both find is judged anew by 8 samples of 256 draws, so that
    the interval owes nothing to luck: their mean, 2.4 of its standard errors (7 degrees of freedom) and a loss that
    2,048 draws may have missed. Another launch may earn more.

    Raises
    ------
    TypeError, ValueError
        If it is no problem or one of rides, or for wrong contexts.
    """
    checked_kind("problem", problem, Problem).must_be("launch", "the best launches; rides have no search here")
    problem, contexts = problem.seeing_all(), checked_contexts(contexts)
    found = np.concatenate([_search(problem, contexts, number) for number in range(SEARCHES)], axis=1)
    # Which is best is decided by other draws than those of the searches and those of the interval.
    earned = problem.expect(problem.scenes(contexts, JUDGED[1], (3,)), found)
    best = np.take_along_axis(found, earned.argmax(axis=1)[:, np.newaxis, np.newaxis], axis=1)
    samples, draws = JUDGED if problem.noise.any() else (2, 1)
    anew = np.hstack([problem.expect(problem.scenes(contexts, draws, (4, i)), best) for i in range(samples)])
    mean, error = anew.mean(axis=1), anew.std(axis=1, ddof=1) / math.sqrt(samples)
    half = float(stats.t.ppf(0.975, samples - 1)) * error + mean / math.prod(JUDGED)
    maps = np.array([one.rewards.ravel() for one in jam_map(problem, contexts, SHOWN)])
    table = pd.DataFrame(contexts, columns=list(Context._fields))
    table[_columns(problem)] = best[:, 0]
    return table.assign(
        reward=rewards_of(problem, contexts, best[:, 0]),
        low=np.maximum(mean - half, 0.0),
        high=np.minimum(mean + half, 1.0),
        apart=np.ptp(earned.reshape(len(contexts), SEARCHES, -1).max(axis=2), axis=1),
        uniform=maps.mean(axis=1),
        width=(maps >= (1.0 - NEAR) * maps.max(axis=1, keepdims=True)).mean(axis=1),
    )


def rewards_of(problem: Problem, contexts: Contexts, launches: ArrayLike) -> Floats:
    """Return what launches of shape (n, k) earn in contexts in the mean of the draws that judge agents, shape (n,).

    Raises
    ------
    TypeError, ValueError
        If it is no problem or one of rides, which :meth:`sledenv.benchmark.problem.Problem.judge` follows, or for wrong
        contexts.
    gymnasium.error.InvalidAction
        If launches have another shape, are no numbers or lie outside [-1, 1].
    """
    checked_kind("problem", problem, Problem).must_be("launch", "launches that are chosen; Problem.judge follows rides")
    contexts = checked_contexts(contexts)
    chosen = checked_actions(problem.action_space, problem.task.action_names, launches, len(contexts))
    earned: Floats = problem.expect(problem.trials(contexts, "test"), chosen[:, np.newaxis])[:, 0]
    return earned


def _search(problem: Problem, contexts: Contexts, number: int) -> Floats:
    """Return the launches that one of the searches finds best, shape (n, FINALISTS, k)."""
    maps = jam_map(problem, contexts, CELLS, number)
    axes = maps[0].launches
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    points = cells[np.array([_maxima(problem, one.rewards, STARTS) for one in maps])]
    noisy = problem.noise.any()
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
    """Return mean rewards over scenes (n, t, 14) of launches (n, m, k), also outside the bounds, shape (n, m)."""
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


def _columns(problem: Problem) -> list[str]:
    return [f"action_{i}" for i in range(problem.actions)]
