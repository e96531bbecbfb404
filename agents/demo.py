"""The whole story in one command: train a rider on sled_rollers, judge it beside others, draw a ride of each."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any, Final

import numpy as np

from sledenv.benchmark.evaluation import Evaluation, evaluation_of
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import TRAINED, load_run
from sledenv.command.arguments import Count, Seed
from sledenv.command.running import app, run
from sledenv.machine.extras import needs
from sledenv.plot import plot_strobe

from .evaluate import as_json, table
from .train import train

with needs("agents", "sledenv.agents.demo"):
    import matplotlib  # noqa: F401, what draws the picture at the end
    import torch  # noqa: F401, with which the rider learns

SCENARIO: Final = "sled_rollers"
FLIGHTS: Final = 60_000  # that the small agent learns from; the one that ships has many more
CONTEXTS: Final = 200
SHIPPED: Final = TRAINED / f"{SCENARIO}-descent-trim-critic-s0"
DRAWN: Final = {"no trims": "no agent", "rule": "rule", "shipped": "trained agent"}  # and what they are called
_BEFORE, _BEHIND = 14.0, 8.0  # [m] of the ground around the fall that is drawn
_POSES: Final = 30

Rider = tuple[Problem, Any]


def strobe(riders: dict[str, Rider], scores: dict[str, Evaluation], path: Path) -> None:
    """Draw three rides in one held-out context, one above the other: two that fall, and that of the trained agent.

    Of the contexts in which the others fall and the agent finishes it is the one in which its reward is the median.
    """
    nobody, rule, trained = (scores[name] for name in DRAWN)
    shown = (nobody.fallen > 0.0) & (rule.fallen > 0.0) & (trained.status[:, 0] == "finish")
    candidates = np.flatnonzero(shown) if shown.any() else np.arange(shown.size)
    chosen = candidates[np.argsort(trained.rewards[candidates])[candidates.size // 2]]
    descents = []
    for name in DRAWN:
        problem, agent = riders[name]
        scene = problem.trials(problem.contexts("test", shown.size), "test")[chosen]
        _, trims = problem.ride(agent, scene)
        descents.append(
            problem.task.ridden(problem.task.scenes(scene), trims[0][~np.isnan(trims[0])].tolist(), record="trajectory")
        )
    end = descents[0].state.x
    between = max(end - _BEFORE, 0.0), end + _BEHIND
    figure = plot_strobe(descents, labels=list(DRAWN.values()), frames=_POSES, between=between)
    figure.savefig(path, dpi=130)


command = app(
    "python -m sledenv.agents.demo",
    f"Train a rider on {SCENARIO}, judge it beside others, and draw a ride of each.",
)


@command.default
def _demo(*, seed: Seed = 0, out: Path = Path("runs/demo"), steps: Count = FLIGHTS) -> None:
    """Run the demo; a run that exists already is judged as it is.

    Parameters
    ----------
    steps
        Flights from which the small agent learns.
    """
    start = time.perf_counter()
    print(f"[critic] training on {steps:,} flights of {SCENARIO}: half a minute", flush=True)
    places = {
        "no trims": train("zero", SCENARIO, seed=seed, folder=out, overwrite=None),
        "rule": train("land_parallel", SCENARIO, seed=seed, folder=out, overwrite=None),
        "small": train("critic", SCENARIO, seed=seed, folder=out, steps=steps, overwrite=None),
        "shipped": SHIPPED,
    }
    print(f"Judging on {CONTEXTS} contexts of {SCENARIO} that no training has seen\n", flush=True)
    riders = {name: load_run(place)[:2] for name, place in places.items()}
    scores = {name: evaluation_of(problem, agent, CONTEXTS, name) for name, (problem, agent) in riders.items()}
    text = table(list(scores.values()))
    print(text)
    (out / "table.txt").write_text(text + "\n", encoding="utf-8")
    (out / "scores.json").write_text(json.dumps(as_json(list(scores.values()))), encoding="utf-8")
    picture = out / "before_after.png"
    strobe(riders, scores, picture)
    print("\nno trims: nobody rides. rule: land parallel to the ground (agents/land_parallel.py).")
    print(f"small: the critic after {steps:,} flights, trained just now; shipped: the same after many more.")
    print(f"{picture} shows a ride; {out}/table.txt and scores.json hold this table.")
    print(f"Done in {time.perf_counter() - start:.0f} s.")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    return run(command, arguments)


if __name__ == "__main__":
    sys.exit(main())
