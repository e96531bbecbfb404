"""Films of the shipped agents, and one picture of what they are worth, for the documentation.

``python examples/films.py`` writes docs/images/NAME.webp for each scenario with a shipped agent, and before_after.png;
``python examples/films.py sled_rollers --out films`` writes one film. A film shows the test context in which the reward
of the agent is the median of the first 41, neither its best nor its worst; launches are three times slower. The slope
of the picture is picked, so that one sees falls; its caption, with the mean rewards over all test contexts, is told.
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

import numpy as np
from PIL import Image

from sledenv.agents import land_parallel, zero
from sledenv.benchmark.problem import Agent, Planner, Policy, Problem
from sledenv.benchmark.runs import TRAINED, load_run
from sledenv.envs.film import write_film
from sledenv.envs.render import draw_film
from sledenv.plot import plot_strobe
from sledenv.simulation import Descent

FPS, SIZE = 15, (600, 300)  # [1/s], [px]
SLOWER = 3  # times, of launches, which take little more than a second
FEW, ALL, PICKED = 41, 1000, 173  # test contexts, and the one of the picture
AROUND = 12.0, 10.0  # [m] that are drawn of the picked slope, before and behind the fall
IMAGES = Path(__file__).parents[1] / "docs" / "images"
RUNS = {run.name.partition("-")[0]: run for run in sorted(TRAINED.glob("*-critic-s0"))}


def ridden(
    problem: Problem, agent: Policy | Planner | Agent, trials: np.ndarray, shown: int | None = None
) -> tuple[Descent, np.ndarray]:
    """Return one of the rides of an agent, that of the median reward by default, and the rewards of all."""
    batch, trims = problem.ride(agent, trials)
    i = np.argsort(batch.jam.reward)[len(trials) // 2] if shown is None else shown
    made = trims[i][~np.isnan(trims[i])].tolist()
    return problem.task.ridden(problem.task.scenes(trials[[i]]), made, record="trajectory"), batch.jam.reward


def median_descent(scenario: str) -> Descent:
    """Return the descent of the shipped agent that its film shows."""
    problem, agent, _ = load_run(RUNS[scenario])
    trials = problem.trials(problem.contexts("test", FEW), "test")[:, 0]
    if problem.environment == "descent":
        return ridden(problem, agent, trials)[0]
    batch, launches = problem.judge(agent, trials)
    i = np.argsort(batch.jam.reward)[FEW // 2]
    aimed = problem.task.aimed(problem.task.scenes(trials[[i]]), launches[[i]].astype(float))
    return problem.task.descent(aimed, record="trajectory")


def compare(file: Path) -> None:
    """Draw how a ride without an agent, a rule and the shipped agent end on one slope of sled_kickers."""
    problem, agent, _ = load_run(RUNS["sled_kickers"])
    riders = {"no agent": zero.Agent(problem), "rule": land_parallel.Agent(problem), "trained agent": agent}
    trials = problem.trials(problem.contexts("test", ALL), "test")[:, 0]
    descents, means = [], []
    for name, rider in riders.items():
        descent, rewards = ridden(problem, rider, trials, PICKED)
        descents.append(descent)
        means.append(f"{name} {rewards.mean():.3f}")
    fall = max(descent.state.x for descent in descents[:2])
    between = fall - AROUND[0], fall + AROUND[1]
    plot_strobe(descents, labels=list(riders), frames=36, between=between).savefig(file, dpi=130)
    with Image.open(file) as drawn:  # a palette makes it a third as large
        small = drawn.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, 1, dither=Image.Dither.NONE)
    small.save(file, optimize=True)
    logging.info("%s: a picked slope; mean rewards over %d test contexts: %s", file, ALL, ", ".join(means))


def main() -> None:
    """Write what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenarios", nargs="*", metavar="SCENARIO", help="films of these alone, and no picture")
    parser.add_argument("--out", type=Path, default=IMAGES, help="folder of what is written")
    given = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    for scenario in given.scenarios or RUNS:
        descent, file = median_descent(scenario), given.out / f"{scenario}.webp"
        slower = SLOWER if "-launch-" in RUNS[scenario].name else 1
        write_film(draw_film(descent, fps=slower * FPS, size=SIZE), file, FPS)
        logging.info("%s: %s, %.0f kB", file, descent, file.stat().st_size / 1000.0)
    if not given.scenarios:
        compare(given.out / "before_after.png")


if __name__ == "__main__":
    main()
