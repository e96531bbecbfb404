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
from sledenv.benchmark.scores import iqm
from sledenv.command.arguments import Count, Seed
from sledenv.command.running import app, run
from sledenv.envs.inputs import Contexts
from sledenv.machine.extras import needs
from sledenv.plot import plot_strobe
from sledenv.simulation.outcomes import Descent

from .evaluate import CONTEXTS, Score, as_json, evaluate, table
from .sac import Agent as Sac
from .train import run_folder, train, trained

with needs("agents", "sledenv.agents.demo"):
    import matplotlib  # noqa: F401, what draws the picture at the end

SCENARIO = "sled_snow"
ALGORITHMS = ("zero", "random_launch", "best_fixed", "sac")
SEARCHED = 40  # contexts whose best launch is searched: half a minute of two cores


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


def against_best(problem: Problem, scores: list[Score]) -> str:
    """Say how near the agents come to the best launches of some of the contexts."""
    best = best_launches(problem, problem.contexts("test", SEARCHED))
    mean, low, high = (float(best[name].mean()) for name in ("reward", "low", "high"))
    lines = [
        f"The best launches of the first {SEARCHED} of these contexts, by a dense search, earn {mean:.4f};",
        f"the best there are earn {low:.4f} to {high:.4f}. What agents lose there, interquartile mean:",
    ]
    lost = [(score.name, iqm(1.0 - score.rewards[:SEARCHED] / best["reward"].to_numpy())) for score in scores]
    lines += [f"  {name:<14} {share:>7.2%}" for name, share in lost]
    return "\n".join(lines)


command = app("python -m sledenv.agents.demo", __doc__)


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

    print(f"\nJudging on {CONTEXTS} held-out contexts of {SCENARIO}, the same for all\n", flush=True)
    scores = []
    for algo in ALGORITHMS:
        _, agent, _ = load_run(run_folder(out, algo, problem, seed))
        scores.append(evaluate(problem, agent, algo, CONTEXTS))
    text = f"{table(scores)}\n\n{against_best(problem, scores)}"
    print(text)
    (out / "table.txt").write_text(text + "\n")
    (out / "scores.json").write_text(json.dumps(as_json(scores)))

    sac_run = run_folder(out, "sac", problem, seed)
    untrained = Sac.load_untrained(problem, sac_run)
    before = evaluate(problem, untrained, "untrained", CONTEXTS)
    picture = out / "before_after.png"
    strobe(problem, untrained, agent, telling_context(problem, before, scores[-1]), picture)
    print(f"\nSAC before any learning: {before.mean:.4f}")
    print(f"Table, scores and picture: {out}/table.txt, scores.json, {picture.name}")
    print(f"Done in {time.perf_counter() - start:.0f} s")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    return run(command, arguments)


if __name__ == "__main__":
    sys.exit(main())
