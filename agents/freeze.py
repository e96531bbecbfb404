"""Freeze the references of a scenario: ``python -m sledenv.agents.freeze SCENARIO``; what was frozen stays."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated, Any, Final, get_args

import numpy as np
import pandas as pd
from cyclopts import Parameter

from sledenv.benchmark.evaluation import evaluation_of
from sledenv.benchmark.oracle import best_launches
from sledenv.benchmark.problem import HeldOut, Problem
from sledenv.benchmark.references import FOLDER, freeze, reference
from sledenv.command.arguments import ScenarioName, integer
from sledenv.command.running import app, progress, run
from sledenv.machine.workers import runner
from sledenv.scenarios.scenario import load_scenario

from .clairvoyant import best_rides
from .replan import Agent

# Of these planners the first is ridden, unless another one earns more in the contexts of validation.
CRITIC: Final = "{scenario}-descent-trim-critic-s0"
PLANNERS: Final[dict[str, dict[str, Any]]] = {
    "replan, 33 and 5 spins": {"spins": [33, 5]},
    "replan, 129 spins and a critic": {"spins": [129], "critic": CRITIC},
    "replan, 33 and 5 spins and a critic": {"spins": [33, 5], "critic": CRITIC},
}
CONTEXTS: Final = 1000  # of the test set
OTHERS: Final = 240  # of the other two
KNOWING: Final = 200  # the first ones of the test set, searched by one who knows the errors
LAUNCHES: Final = 200  # contexts whose best launch is searched
_MORE: Final = 0.002  # what counts as more
_VALIDATED: Final = 128  # contexts in which planners are compared
_BLOCK: Final = 10  # contexts that are searched at a time

_Count = Annotated[int, integer(0)]


def chosen(problem: Problem, told: Any) -> str:
    """Return the name of the planner that earns most in the contexts of validation, of those whose critic there is."""
    contexts, earned = problem.drawn(problem.contexts("validation", _VALIDATED), "validation"), {}
    for name, settings in PLANNERS.items():
        try:
            planner = Agent(problem, **settings)
        except (FileNotFoundError, ValueError) as error:
            told(f"{problem.scenario.id}, {name}: left out, {error}")
            continue
        begun = time.process_time()
        earned[name] = float(problem.judge(planner, contexts)[0].jam.reward.mean())
        took = f"in {time.process_time() - begun:.0f} CPU s"
        told(f"{problem.scenario.id}, {len(contexts)} validation contexts, {name}: {earned[name]:.4f} {took}")
    first, best = next(iter(earned)), max(earned, key=earned.__getitem__)
    return best if earned[best] > earned[first] + _MORE else first


def suited(problem: Problem, held_out: HeldOut, planner: str) -> str:
    """Return the name of a planner, or of the first one where tracks have another length than a critic knows."""
    length = problem.scenario.slope_section.length_m
    same = all(one.scenario.slope_section.length_m == length for one in problem.held_out(held_out).values())
    return planner if same or "critic" not in PLANNERS[planner] else next(iter(PLANNERS))


def ridden(problem: Problem, planner: str, held_out: HeldOut, contexts: int) -> pd.DataFrame:
    """Ride a planner in the contexts of a set."""
    found = evaluation_of(problem, Agent(problem, **PLANNERS[planner]), contexts, "lower", held_out)
    return pd.DataFrame({"lower": found.rewards, "lower_falls": found.fallen, "clairvoyant": np.nan})


def known(problem: Problem, contexts: int) -> np.ndarray:
    """Return what the best rides found earn in the first test contexts, by one who knows the errors."""
    trials = problem.trials(problem.contexts("test", contexts), "test")[:, 0]
    parts = [trials[begin : begin + _BLOCK] for begin in range(0, contexts, _BLOCK)]
    earned = dict(runner(None)([(_best, (problem, part, i)) for i, part in enumerate(parts)]))
    return np.concatenate([earned[i] for i in range(len(parts))] or [np.empty(0)])


def launched(problem: Problem, contexts: int) -> pd.DataFrame:
    """Search the best launches of the first test contexts."""
    drawn = problem.contexts("test", contexts)
    table = best_launches(problem, drawn)
    trials = problem.trials(drawn, "test")
    rows = trials.reshape(-1, trials.shape[-1])
    batch = problem.descend(rows, np.repeat(table.filter(like="action_").to_numpy(), trials.shape[1], axis=0))
    falls = (batch.status == "tumbled").reshape(trials.shape[:2]).mean(axis=1)
    return pd.DataFrame({"lower": table["reward"], "lower_falls": falls, "clairvoyant": np.nan})


def _best(problem: Problem, scenes: np.ndarray, number: int) -> tuple[int, np.ndarray]:
    return number, best_rides(problem, scenes)["reward"].to_numpy()


command = app("python -m sledenv.agents.freeze", "Freeze what can be expected in the held-out contexts of a scenario.")


@command.default
def _freeze(
    scenario: Annotated[ScenarioName, Parameter(required=True)],
    /,
    *,
    contexts: _Count = CONTEXTS,
    knowing: _Count = KNOWING,
    launches: _Count = LAUNCHES,
    out: Path = FOLDER,
) -> None:
    """Ride the best planner, or search the best launches, in the held-out contexts; a set that is known is left.

    Parameters
    ----------
    contexts
        Of the test set of rides; the others have 240 at most.
    knowing
        Of the test set, searched by one who knows the errors.
    launches
        Contexts of the test set whose best launch is searched.
    out
        Folder of the files.
    """
    loaded = load_scenario(scenario)
    problem, told = Problem(loaded, "descent" if loaded.is_ride else "launch"), progress("freeze")
    sets = get_args(HeldOut) if loaded.is_ride else ("test",)
    left = [one for one in sets if reference(problem, one, out) is None]
    if left and not loaded.is_ride:
        path = freeze(problem, "test", launched(problem, launches), "best launch found", out)
        told(f"wrote {path}")
    elif left:
        best = chosen(problem, told)
        for one in left:
            name = suited(problem, one, best)
            table = ridden(problem, name, one, contexts if one == "test" else min(contexts, OTHERS))
            if one == "test":
                table.loc[: knowing - 1, "clairvoyant"] = known(problem, min(knowing, contexts))
            path = freeze(problem, one, table, name, out)
            told(f"{problem.scenario.id}, {one}: {table['lower'].mean():.4f} by {name}; wrote {path}")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    return run(command, arguments)


if __name__ == "__main__":
    sys.exit(main())
