"""The whole story in one command: train on sled_snow, judge four agents, draw a launch before and after learning."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import numpy as np

from sledenv.benchmark.oracle import best_launches
from sledenv.benchmark.problem import Agent, Problem
from sledenv.benchmark.runs import load_run
from sledenv.command.arguments import Count, Seed
from sledenv.command.running import app, run
from sledenv.envs.inputs import Contexts
from sledenv.machine.extras import needs
from sledenv.plot import plot_strobe
from sledenv.simulation.outcomes import Descent

from .evaluate import CONTEXTS, SEARCHED, Score, as_json, evaluate, table
from .sac import Agent as Sac
from .train import run_folder, train, trained

with needs("agents", "sledenv.agents.demo"):
    import matplotlib  # noqa: F401, what draws the picture at the end

SCENARIO = "sled_snow"
ALGORITHMS = ("zero", "random_launch", "best_fixed", "sac")


def strobe(problem: Problem, before: Agent, after: Agent, context: Contexts, path: Path) -> None:
    """Draw the descents that two agents choose for the same context, shape (1, 11), one above the other."""
    task = problem.task

    def descend(agent: Agent) -> Descent:
        launch = task.launch(context, np.asarray(agent.act(task.observe(context)), np.float64))
        return task.descend(context, launch, record="trajectory")

    figure = plot_strobe([descend(before), descend(after)], labels=["before learning", "after learning"])
    figure.savefig(path, dpi=130)


def telling_context(problem: Problem, before: Score, after: Score) -> Contexts:
    """Return the held-out context, shape (1, 11), of median gain among those that did not finish before."""
    gain = after.rewards - before.rewards
    failed = np.flatnonzero((before.status != "finish").mean(axis=1) > 0.5)
    candidates = failed if failed.size else np.arange(gain.size)
    middle = candidates[np.argsort(gain[candidates])[candidates.size // 2]]
    return problem.contexts("test", gain.size)[[middle]]


command = app(
    "python -m sledenv.agents.demo",
    "Train agents on sled_snow, judge them, and draw a launch before and after learning.",
)


@command.default
def _demo(*, seed: Seed = 0, out: Path = Path("runs/demo"), steps: Count | None = None) -> None:
    """Run the demo; runs that exist already are judged as they are.

    Parameters
    ----------
    steps
        Budget of each agent in descents; default: as configured.
    """
    start = time.perf_counter()
    out.mkdir(parents=True, exist_ok=True)
    problem = Problem(SCENARIO)
    for algo in ALGORITHMS:
        if trained(algo, problem, seed=seed, folder=out, steps=steps):
            print(f"[{algo}] already trained", flush=True)
            continue
        print(f"[{algo}] training on {SCENARIO}", flush=True)
        train(algo, problem, seed=seed, folder=out, steps=steps, overwrite=True)

    print(f"\nJudging on {CONTEXTS} contexts of {SCENARIO} that no training has seen, and searching the best launches")
    print(f"of {SEARCHED} of them, a minute or two\n", flush=True)
    scores = []
    for algo in ALGORITHMS:
        _, agent, _ = load_run(run_folder(out, algo, problem, seed))
        scores.append(evaluate(problem, agent, algo, CONTEXTS))
    best = best_launches(problem, problem.contexts("test", SEARCHED))
    text = table(scores, best)
    print(text)
    (out / "table.txt").write_text(text + "\n", encoding="utf-8")
    (out / "scores.json").write_text(json.dumps(as_json(scores, best)), encoding="utf-8")

    untrained = Sac.load_untrained(problem, run_folder(out, "sac", problem, seed))
    before = evaluate(problem, untrained, "untrained", CONTEXTS)
    picture = out / "before_after.png"
    strobe(problem, untrained, agent, telling_context(problem, before, scores[-1]), picture)
    print(f"\nsac learned: before any training it earned {before.mean:.3f} in the mean, now {scores[-1].mean:.3f}.")
    print(f"{picture} shows one of its launches before and after.")
    print(f"{out}/table.txt and scores.json hold this table. Done in {time.perf_counter() - start:.0f} s.")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    return run(command, arguments)


if __name__ == "__main__":
    sys.exit(main())
