"""Keep trained runs whose scenario is simulated otherwise than when they were trained, and judge them again."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sledenv.agents.evaluate import CONTEXTS, table
from sledenv.benchmark.evaluation import evaluation_of
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import adopt, agent_name, load_run
from sledenv.command.arguments import number
from sledenv.command.running import app, run
from sledenv.scenarios.scenario import load_scenario

command = app("python -m sledenv.agents.adopt", "Keep trained runs for scenarios that have changed, judged again.")


@command.default
def _adopt(
    runs: Annotated[list[Path], Parameter(name="RUN", required=True)],
    /,
    *,
    contexts: Annotated[int, number(int, "an integer >= 2", lambda value: value >= 2)] = CONTEXTS,
) -> None:
    """Write today's scenario into runs that were trained on what it was, and judge each in it.

    For a change that leaves the question as it is, such as a tolerance. Where scores fall, train anew.

    Parameters
    ----------
    runs
        Folders written by sledenv.agents.train.
    contexts
        Number of held-out contexts.
    """
    for folder in runs:
        before, agent, config = load_run(folder)
        scenario = load_scenario(before.scenario.id)
        problem = Problem(
            scenario,
            before.environment,
            before.control,
            observe=config["observe"],
            launch_noise=config["launch_noise"],
        )
        scores = [evaluation_of(before, agent, contexts, "before")]
        adopt(folder, problem)
        now, agent, config = load_run(folder)
        scores.append(evaluation_of(now, agent, contexts, agent_name(config["agent"])))
        print(f"{folder.name}: {before.scenario.hash} is now {scenario.hash}\n{table(scores)}\n")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    return run(command, arguments)


if __name__ == "__main__":
    sys.exit(main())
