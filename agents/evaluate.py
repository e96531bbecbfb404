"""Judge trained agents on the same held-out contexts: ``python -m sledenv.agents.evaluate RUN [RUN ...]``."""

from __future__ import annotations

import sys
from json import dumps
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray
from scipy.stats import bootstrap

from sledenv.benchmark.problem import Agent, Problem
from sledenv.benchmark.runs import agent_name, load_run
from sledenv.command.arguments import number
from sledenv.command.running import app, run

CONTEXTS = 200


class Score(NamedTuple):
    """How an agent did on the held-out contexts."""

    name: str
    rewards: NDArray[np.float64]  # (n,), means over the trials
    status: NDArray[np.str_]  # (n, t), of every trial

    @property
    def mean(self) -> float:
        """Mean reward."""
        return float(self.rewards.mean())


def interval(values: NDArray[np.float64]) -> tuple[float, float]:
    """95 % bootstrap interval (BCa) of the mean over contexts."""
    if np.ptp(values) <= 1e-12:  # nothing to resample
        return float(values.mean()), float(values.mean())
    result = bootstrap((values,), np.mean, n_resamples=2000, rng=np.random.default_rng(0))
    return float(result.confidence_interval.low), float(result.confidence_interval.high)


def evaluate(problem: Problem, agent: Agent, name: str, count: int = CONTEXTS) -> Score:
    """Simulate the agent's launches on ``count`` held-out contexts, the same for every agent."""
    trials = problem.trials(problem.contexts("test", count), "test")
    batch, _ = problem.judge(agent, trials)
    return Score(name, batch.jam.reward.reshape(trials.shape[:2]).mean(axis=1), batch.status.reshape(trials.shape[:2]))


def table(scores: list[Score]) -> str:
    """Return the scores as text; the last column compares each with the last score, context by context."""
    best = scores[-1]
    wide = max(12, *(len(score.name) for score in scores))
    header = f"{'agent':<{wide}} {'mean reward':>11}  {'95 % interval':>16}  {'finish':>6} {'jam':>5} {'tumble':>6}"
    lines = [f"{header}   {best.name} minus agent (95 %)", "-" * (wide + 86)]
    for score in scores:
        low, high = interval(score.rewards)
        share = {status: float(np.mean(score.status == status)) for status in ("finish", "jammed", "tumbled")}
        line = f"{score.name:<{wide}} {score.mean:>11.4f}  [{low:.4f}, {high:.4f}]"
        line += f"  {share['finish']:>6.0%} {share['jammed']:>5.0%} {share['tumbled']:>6.0%}"
        if score is not best:
            difference = best.rewards - score.rewards
            low, high = interval(difference)
            line += f"   {difference.mean():+.4f} [{low:+.4f}, {high:+.4f}]"
        lines.append(line)
    return "\n".join(lines)


def as_json(scores: list[Score]) -> list[dict[str, Any]]:
    """Return the scores as plain data."""
    return [
        {"agent": s.name, "mean": s.mean, "interval": interval(s.rewards), "rewards": s.rewards.tolist()}
        for s in scores
    ]


command = app("python -m sledenv.agents.evaluate", __doc__.partition(":")[0] + ".")


@command.default
def _evaluate(
    runs: Annotated[list[Path], Parameter(name="RUN", required=True)],
    /,
    *,
    contexts: Annotated[int, number(int, "an integer >= 2", lambda value: value >= 2)] = CONTEXTS,
    json: Path | None = None,
) -> None:
    """Judge trained agents.

    Parameters
    ----------
    runs
        Folders written by sledenv.agents.train, or names of runs that ship: sled_snow-launch-orientation-critic-s0.
    contexts
        Number of held-out contexts.
    json
        Also write the rewards to this file.
    """
    loaded = [load_run(folder) for folder in runs]
    problems = {(problem.scenario.hash, problem.control) for problem, _, _ in loaded}
    if len(problems) > 1:
        raise ValueError("the runs have different scenarios or controls: judge them apart")
    scores = [evaluate(problem, agent, agent_name(config["agent"]), contexts) for problem, agent, config in loaded]
    print(table(scores))
    if json:
        json.write_text(dumps(as_json(scores)))


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    return run(command, arguments)


if __name__ == "__main__":
    sys.exit(main())
