"""The jam map of contexts as one HTML page in which every launch can be played: ``sledenv map --html``."""

from __future__ import annotations

import importlib.util
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, NoReturn

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.colors import to_hex
from numpy.typing import NDArray
from tqdm import tqdm

from sledenv.benchmark.figures import label, look
from sledenv.benchmark.landscape import load_choosers, marked, physical, plain_marks, words
from sledenv.benchmark.oracle import expected_at, jam_map
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import TRAINED, read_config
from sledenv.envs.inputs import Contexts
from sledenv.kernel.records import STATUS_OF_CODE
from sledenv.pages.html import filled
from sledenv.pages.keyframes import TOLERANCE, Steps, encoded, keyframes, packed, steps_for
from sledenv.pages.scenes import drawn_body, drawn_slope
from sledenv.plot.shapes import reach
from sledenv.scenarios.scenario import Context, Scenario, ScenarioError
from sledenv.scenarios.sections import CONTROLS
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import State

MOST_SEEDS: Final = 24  # contexts of a page
DESCENTS: Final = 36_000  # that a page holds: the grid is coarser where contexts are many
BYTES: Final = 9_000_000  # of them, in a page: sleds that rock for a minute take more
_SAMPLE: Final = 256  # launches that tell how many that is
_ALONE: Final = 4  # times as many values of a control that is chosen alone as along an axis of a map
_COLOURS: Final = 33  # of the map, between which a page interpolates
_COUNTS: Final = ("status", "rebounds")  # of each descent
_NUMBERS: Final = ("reward", "progress", "retention", "end_time", "end_x", "end_u")


class MapPage(NamedTuple):
    """A page, and what it marks in words."""

    html: str
    words: str
    marks: list[dict[str, Any]]  # of plain_marks, one a context


def map_page(
    scenario: str | os.PathLike[str] | Scenario, seeds: Sequence[int], runs: Sequence[Path] | None = None
) -> MapPage:
    """Return a page with the launches of contexts, each of which it can play.

    The map is over the first two things that are chosen; others stay in the middle of their bounds.

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    seeds : sequence of int
        Which contexts are drawn, as in ``sledenv simulate``: from 1 to ``MOST_SEEDS``, all different, of one body.
    runs : sequence of Path, optional
        Folders of trained agents, whose choices are marked; the shipped ones by default, if torch is installed.

    Raises
    ------
    FileNotFoundError, ValueError
        If the seeds are wrong or a folder is no finished run.
    ScenarioError
        If a run is of another scenario, or of agents that choose something else or trim.
    """
    if not 1 <= len(seeds) <= MOST_SEEDS or len(set(seeds)) < len(seeds):
        raise ValueError(f"seeds = {list(seeds)}: must be 1 to {MOST_SEEDS} integers, all different")
    problem = Problem(scenario)
    choosers = load_choosers(problem, _shipped_runs(problem) if runs is None else runs)
    for chooser in choosers:
        if chooser.problem.environment != "launch":
            raise ScenarioError(f"agent {chooser.name}: trims every hop, but a map plays launches that are left alone")
    drawn = np.array([problem.scenario.sample(np.random.default_rng(seed)) for seed in seeds])
    numbers = problem.scenario.shapes(drawn).tolist()
    if len(set(numbers)) > 1:
        raise ValueError(f"seeds = {list(seeds)}: must be contexts of one body, but theirs have the numbers {numbers}")
    axes = _axes(problem, drawn)
    told, marks, contexts = [], [], []
    launches = len(seeds) * (math.prod(map(len, axes)) + 1 + len(choosers))
    with tqdm(total=launches, unit="launch", leave=False, disable=None) as bar:  # where there is a terminal
        for seed, context in zip(seeds, drawn[:, np.newaxis], strict=True):
            bar.set_description(f"seed {seed}, best launch")
            best, results = marked(problem, context, choosers)
            bar.set_description(f"seed {seed}, all launches")
            contexts.append(_context(problem, context, axes, best, results, seed, bar))
            marks.append(plain_marks(problem, seed, best, results))
            told.append((f"context of seed {seed}\n" if len(seeds) > 1 else "") + words(problem, best, results))
    content = _content(problem, problem.task.body(drawn), axes, contexts)
    return MapPage(filled("map.html", data=content), "\n\n".join(told), marks)


def _shipped_runs(problem: Problem) -> list[Path]:
    """Folders of the shipped agents of a problem, none where they cannot be loaded."""
    if importlib.util.find_spec("torch") is None:
        return []
    folders = sorted(TRAINED.glob(f"{problem.scenario.id}-{problem.environment}-{problem.control}-*"))
    return [folder for folder in folders if read_config(folder)["scenario_hash"] == problem.scenario.hash]


def _axes(problem: Problem, contexts: Contexts) -> tuple[NDArray[np.float64], ...]:
    """Return the values in [-1, 1] that are tried of each control."""
    names, others = problem.task.controlled[:2], problem.task.controlled[2:]
    full = {name: CONTROLS[name].drawn * (_ALONE if len(names) == 1 else 1) for name in names}
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (-(-_SAMPLE // len(contexts)), problem.actions))
    frames = [_recorded(problem, context, actions)[0] for context in contexts[:, np.newaxis]]
    taken = sum(len(_text(problem, context, some)) for context, some in zip(contexts, frames, strict=True))
    most = min(DESCENTS, BYTES * len(actions) * len(contexts) / taken)
    share = min(1.0, most / len(contexts) / math.prod(full.values())) ** (1.0 / len(names))
    counts = {name: max(int(share * count), 2) for name, count in full.items()}
    turning = dict(zip(names, problem.turns, strict=False))
    axes = [np.linspace(-1.0, 1.0, counts[name], endpoint=not turning[name]) for name in names]
    return (*axes, *(np.zeros(1) for _ in others))


def _content(
    problem: Problem, body: Body, axes: tuple[NDArray[np.float64], ...], contexts: list[dict[str, Any]]
) -> dict[str, Any]:
    """What the script of the page draws."""
    scenario, controls = problem.scenario, []
    for name, values, turning in zip(problem.task.controlled, axes, problem.turns, strict=True):
        digits = int(CONTROLS[name].printed.rstrip("f").partition(".")[2])
        unit = CONTROLS[name].unit.replace("deg", "°")
        tried = physical(problem, name, values)
        controls.append({"name": name, "unit": unit, "digits": digits, "values": tried, "turns": turning})
    return {
        "title": scenario.title,
        "id": scenario.id,
        "question": scenario.question,
        "controls": controls,
        "tremble": bool(problem.noise.any()),
        "colours": [to_hex(colour) for colour in matplotlib.colormaps["viridis"](np.linspace(0.0, 1.0, _COLOURS))],
        "body": drawn_body(body),
        "size": max(reach(body), 1e-6),  # a point mass has none
        "steps": _exactly(_steps(problem, body)),
        "counts": _COUNTS,
        "numbers": ["expected", *_NUMBERS],
        "tolerance": f"{2e3 * TOLERANCE * reach(body):.1f} mm and {math.degrees(2.0 * TOLERANCE):.1f}°",
        "statuses": [str(status) for status in STATUS_OF_CODE],
        "contexts": contexts,
    }


def _context(
    problem: Problem,
    context: Contexts,
    axes: tuple[NDArray[np.float64], ...],
    best: pd.Series,
    results: pd.DataFrame,
    seed: int,
    bar: tqdm[NoReturn],
) -> dict[str, Any]:
    """Return what the page holds of one context: launches of the grid, the best one and those that agents choose."""
    given = problem.task.context(context)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    names = [f"action_{i}" for i in range(len(axes))]
    marks = pd.concat([best.to_frame().T[[*names, "reward"]], results[[*names, "reward"]]]).to_numpy(np.float64)
    actions = np.concatenate([grid, marks[:, :-1]])
    frames, outcomes = _recorded(problem, context, actions, bar)
    expected = outcomes["reward"].to_numpy(np.float64)
    if problem.noise.any():
        expected = np.append(expected_at(problem, jam_map(problem, context)[0], grid), marks[:, -1])
    numbers = [outcomes[name].to_numpy(np.float64) for name in _NUMBERS]
    columns = [*(outcomes[name].to_numpy(np.int32) for name in _COUNTS), expected, *numbers]
    kinds = [("best launch", "★", "#ffffff")]
    for agent, trained in zip(results["agent"], results["seed"], strict=True):
        name = label(agent)
        several = (results["agent"] == agent).sum() > 1
        kinds.append((f"{name}, seed {trained}" if several else name, name[0].upper(), look(agent, results)[0]))
    return {
        "seed": seed,
        "setting": _setting(problem, given),
        "slope": drawn_slope(problem.scenario.slope(given), given.friction),
        "gravity": _exactly(_gravity(problem, given)),
        "launches": _text(problem, context[0], frames, columns),
        "marks": [
            {
                "name": name,
                "sign": sign,
                "colour": colour,
                "values": [physical(problem, *chosen) for chosen in zip(problem.task.controlled, mark, strict=False)],
                "expected": mark[-1],
            }
            for (name, sign, colour), mark in zip(kinds, marks, strict=True)
        ],
    }


def _recorded(
    problem: Problem, context: Contexts, actions: NDArray[np.float64], bar: tqdm[NoReturn] | None = None
) -> tuple[list[tuple[np.ndarray, np.ndarray]], pd.DataFrame]:
    """Simulate launches of shape (n, k), without noise; return their keyframes and a row of each outcome."""
    launches = problem.task.launches(np.repeat(context, len(actions), axis=0), actions)
    frames, rows = [], []
    for i in range(len(launches)):
        descent = problem.task.descend(context, State(*launches[i].tolist()), "trajectory")
        frames.append(keyframes(descent))
        end, jam = descent.outcome, descent.jam
        counts = int(end["status"]), len(descent.rebounds)
        rows.append((*counts, *map(float, (jam.reward, jam.progress, jam.retention, end["t"], end["x"], end["u"]))))
        if bar is not None:
            bar.update()
    return frames, pd.DataFrame(rows, columns=[*_COUNTS, *_NUMBERS])


def _text(
    problem: Problem,
    context: NDArray[np.float64],
    frames: Sequence[tuple[np.ndarray, np.ndarray]],
    columns: Sequence[np.ndarray] = (),
) -> str:
    """Return columns of descents, and their keyframes, as text."""
    steps = _steps(problem, problem.task.body(context[np.newaxis]))
    return encoded([*columns, *packed(frames, _gravity(problem, Context(*context)), steps)])


def _steps(problem: Problem, body: Body) -> Steps:
    scenario = problem.scenario
    return steps_for(body, scenario.slope_section.length_m, scenario.limits.max_time_s)


def _gravity(problem: Problem, context: Context) -> tuple[float, float]:
    """Return gravity along the slope and normal to it [m/s^2]."""
    slope = problem.scenario.slope(context)
    return slope.gravity * math.sin(slope.angle), -slope.gravity * math.cos(slope.angle)


def _setting(problem: Problem, context: Context) -> str:
    """Return a context in words, without what is chosen."""
    parts = [
        f"slope {math.degrees(context.angle):.2f}°",
        f"friction {context.friction:.3f}",
        f"restitution {context.restitution:.3f}",
        f"let go {context.drop:.2f} m above the slope",
    ]
    left = {"speed": f"speed {context.speed:.2f} m/s", "spin": f"spin {context.spin:.2f} rad/s"}
    left["orientation"] = f"orientation {math.degrees(context.orientation):.1f}°"
    parts += [said for name, said in left.items() if name not in problem.task.controlled]
    if context.fall:
        parts.append(f"fall {context.fall:.2f} m/s")
    return ", ".join(parts)


def _exactly(numbers: Iterable[float]) -> list[str]:
    """Return numbers as text: rounded, as others are in a page, they would decode into other keyframes."""
    return [repr(float(number)) for number in numbers]
