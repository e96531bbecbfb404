"""Judge trained agents on the same held-out contexts: ``python -m sledenv.agents.evaluate RUN [RUN ...]``."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from json import dumps
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from cyclopts import Parameter
from numpy.typing import NDArray

from sledenv.benchmark.evaluation import Evaluation, HeldOut, evaluation_of, mean_interval, told
from sledenv.benchmark.oracle import best_found
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import agent_name, load_run
from sledenv.benchmark.scores import lost
from sledenv.command.arguments import number
from sledenv.command.running import app, progress, run, taken
from sledenv.machine.files import replacing
from sledenv.machine.text_tables import aligned

CONTEXTS = 200
SEARCHED = 40  # of these, whose best launch or ride is searched: a minute or two of two cores


def regrets(score: Evaluation, best: pd.DataFrame) -> NDArray[np.float64]:
    """Share that is lost against the best launches or rides of the first contexts, shape (m,)."""
    return lost(score.rewards[: len(best)], best["reward"].to_numpy())


def best_of(problem: Problem, count: int, scores: list[Evaluation]) -> pd.DataFrame:
    """Search the best launch or ride of the first held-out contexts; where an agent rides better, that counts."""
    best = best_found(problem, problem.contexts("test", count), progress=True, workers=None)
    if problem.environment == "descent":
        best["reward"] = np.max([best["reward"], *(score.rewards[:count] for score in scores)], axis=0)
        best["low"], best["high"] = best["reward"], np.maximum(best["reward"], best["high"])
    return best


def table(scores: list[Evaluation], best: pd.DataFrame | None = None) -> str:
    """Return the scores as text, most reward first, with what the words in it mean.

    Parameters
    ----------
    scores : list of Evaluation
    best : DataFrame, optional
        The best of the first contexts, of :func:`best_of`.
    """
    first, *others = sorted(scores, key=lambda score: -score.mean)
    names = ["agent", "mean reward [95 %]", "mean loss [95 %]", "falls [95 %]", "finished"]
    rows = [[*names, *([f"behind {first.policy} [95 %]"] if others else [])]]
    for score in (first, *others):
        row = [score.policy, told(score.mean, score.interval, ".3f")]
        row.append("-" if best is None else _told_mean(regrets(score, best), ".1%"))
        row += [told(score.falls, score.falls_interval, ".1%"), f"{score.finished:.1%}"]
        if others:  # context by context
            row.append("-" if score is first else _told_mean(first.rewards - score.rewards, ".3f"))
        rows.append(row)
    header, *lines = aligned(rows, ["<12", "<"])
    words = [f"Reward: from 0 to 1, over {len(first.rewards)} contexts that no training has seen."]
    if best is not None:
        earned, low, high = (best[name].mean() for name in ("reward", "low", "high"))
        words += [
            f"Loss: share of the best reward found that an agent misses, over the first {len(best)} contexts.",
            f"  The best found by a search earns {earned:.3f} there; the best there is {low:.3f} to {high:.3f}.",
        ]
    words += ["Falls: share of the descents in which a part touches the ground that must not, such as the rider."]
    words += ["Brackets: 95 % intervals, of the mean over all such contexts."]
    return "\n".join([header, "-" * len(header), *lines, "", *words])


def track_table(scores: list[Evaluation]) -> str:
    """Return mean reward and share of falls on each track made by hand as text, the agent of most reward first."""
    ranked = sorted(scores, key=lambda score: -score.mean)
    places = np.array(scores[0].places)
    rows = [["track", "contexts", *(score.policy for score in ranked)]]
    for place in np.unique(places):
        on = places == place
        cells = (f"{score.rewards[on].mean():.3f}, {score.fallen[on].mean():.1%} fall" for score in ranked)
        rows.append([str(place), str(on.sum()), *cells])
    header, *lines = aligned(rows, ["<12", ">", "<"])
    return "\n".join([header, "-" * len(header), *lines, "", "On each track: mean reward and share of falls."])


def _told_mean(values: NDArray[np.float64], form: str) -> str:
    """Write the mean of values over contexts with its interval."""
    return told(float(values.mean()), mean_interval(values), form)


def as_json(scores: list[Evaluation], best: pd.DataFrame | None = None) -> list[dict[str, Any]]:
    """Return the scores as plain data."""
    found = []
    for one in scores:
        plain = {"agent": one.policy, "mean": one.mean, "interval": one.interval}
        if best is not None:
            lost_to = regrets(one, best)
            plain |= {"regret": float(lost_to.mean()), "regret_interval": mean_interval(lost_to)}
        plain |= {"falls": one.falls, "falls_interval": one.falls_interval}
        on = {} if one.places is None else {"tracks": one.places}
        found.append(plain | {"rewards": one.rewards.tolist()} | on)
    return found


command = app("python -m sledenv.agents.evaluate", "Judge trained agents on the same held-out contexts.")


@command.default
def _evaluate(
    runs: Annotated[list[Path], Parameter(name="RUN", required=True)],
    /,
    *,
    contexts: Annotated[int, number(int, "an integer >= 2", lambda value: value >= 2)] = CONTEXTS,
    searched: Annotated[int, number(int, "an integer >= 0", lambda value: value >= 0)] = SEARCHED,
    shifted: bool = False,
    tracks: bool = False,
    json: Path | None = None,
) -> None:
    """Judge trained agents.

    Judge only runs that you trust: the module that a run names is imported, and a model.zip may hold pickles.

    Parameters
    ----------
    runs
        Folders written by sledenv.agents.train, or names of runs that ship: sled_mat-launch-spin-critic-s0.
    contexts
        Number of held-out contexts.
    searched
        Of these, whose best launch or ride is searched, against which losses are; 0 leaves losses out.
    shifted
        Judge in contexts of a kind that no one trains on: launches a quarter faster, over bumps a quarter higher.
    tracks
        Judge rides on the tracks made by hand, on which no one trains, and tell how each goes; losses are left out.
    json
        Also write the numbers to this file.
    """
    loaded = [load_run(folder) for folder in runs]
    problems = {(problem.scenario.hash, problem.environment, problem.control) for problem, _, _ in loaded}
    if len(problems) > 1:
        raise ValueError("the runs have different scenarios or controls: judge them apart")
    if shifted and tracks:
        raise ValueError("--tracks and --shifted are contexts of two kinds: give one of them")
    held_out: HeldOut = "tracks" if tracks else "shifted" if shifted else "test"
    with ExitStack() as places:
        file = json and taken(places, "--json", replacing(json, ".json"))
        problem = loaded[0][0]
        named = [(agent, agent_name(config["agent"])) for _, agent, config in loaded]
        scores = [evaluation_of(problem, agent, contexts, name, held_out) for agent, name in named]
        problem = problem.shifted() if shifted else problem
        best = None
        count = 0 if tracks else min(searched, contexts)
        if count:
            progress("evaluate")(f"searching the best of {count} contexts (--searched 0 leaves it out)")
            best = best_of(problem.seeing_all(), count, scores)
        print(table(scores, best) + (f"\n\n{track_table(scores)}" if tracks else ""))
        if file:
            file.write_text(dumps(as_json(scores, best)), encoding="utf-8")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    return run(command, arguments)


if __name__ == "__main__":
    sys.exit(main())
