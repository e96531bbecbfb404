"""Train one agent on one scenario: ``python -m sledenv.agents.train --algo sac --scenario sled_snow --seed 0``."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, Final

from cyclopts import Parameter

from sledenv.benchmark import runs
from sledenv.benchmark.problem import Environment
from sledenv.benchmark.runs import SETTINGS
from sledenv.command.arguments import Count, Seed
from sledenv.command.running import app, run
from sledenv.scenarios.scenario import Scenario, load_scenario

ALGORITHMS: Final = (
    *("best_fixed", "critic", "land_flat", "land_parallel", "ppo", "random_launch", "replan", "sac", "tqc", "zero"),
)


def train(
    algo: str,
    scenario: str | os.PathLike[str] | Scenario,
    environment: Environment | None = None,
    control: str | None = None,
    *,
    seed: int = 0,
    folder: Path = Path("runs"),
    steps: int | None = None,
    settings: Path = SETTINGS,
    overwrite: bool | None = False,
) -> Path:
    """Train an agent and keep it in a folder of its own.

    Parameters
    ----------
    algo : str
        One of ``ALGORITHMS``.
    scenario, environment, control
        As for :class:`sledenv.benchmark.problem.Problem`; by default "descent" where a rider meets a track.
    seed : int
        Of everything random in the run.
    folder : Path
        Where the folder of the run is made: ``SCENARIO-ENVIRONMENT-CONTROL-ALGO-sSEED``.
    steps : int, optional
        Budget in environment steps in place of the configured one.
    settings : Path
        Folder of the hyperparameters.
    overwrite : bool, optional
        Replace a finished run; with None one of exactly this stays, and another one is replaced.

    Returns
    -------
    Path
        The folder, see :func:`sledenv.benchmark.runs.train`.

    Raises
    ------
    ValueError
        For an unknown algorithm, or one that has no settings for the environment; nothing is written then.
    FileExistsError
        If the run exists and ``overwrite`` is false.
    """
    if algo not in ALGORITHMS:
        raise ValueError(f"algo = {algo!r}: must be one of {', '.join(ALGORITHMS)}")
    if steps is not None and steps < 1:
        raise ValueError(f"steps = {steps}: must be >= 1")
    asked, module = scenario if isinstance(scenario, Scenario) else load_scenario(scenario), f"sledenv.agents.{algo}"
    kind: Environment = environment or ("descent" if asked.is_ride else "launch")
    chosen = runs.budgeted(runs.read_settings(settings, module, kind), steps)
    problem = runs.problem_of(asked, kind, chosen, control)
    place = folder / f"{problem.scenario.id}-{kind}-{problem.control}-{algo}-s{seed}"
    if overwrite is None and runs.is_trained(module, problem, chosen, seed, place):
        return place
    if place.exists() and overwrite is False:
        raise FileExistsError(f"{place} exists: add --overwrite to replace it")
    return runs.train(module, problem, chosen, seed, place)


command = app("python -m sledenv.agents.train", "Train one agent on one scenario.")


@command.default
def _train(
    *,
    algo: Annotated[str, Parameter(choices=ALGORITHMS)] = "sac",
    scenario: str = "sled_snow",
    environment: Environment | None = None,
    control: str | None = None,
    seed: Seed = 0,
    steps: Count | None = None,
    settings: Path = SETTINGS,
    folder: Annotated[Path, Parameter(name="--runs")] = Path("runs"),
    overwrite: bool = False,
) -> None:
    """Train one agent.

    Parameters
    ----------
    scenario
        Name of a shipped scenario or a .yaml file.
    environment
        Default: descent where a rider meets a track, launch elsewhere.
    control
        Such as orientation+spin; default: what the scenario says.
    steps
        Budget in environment steps; default: configs/agents/ALGO.yaml.
    settings
        Folder of the hyperparameters.
    folder
        Where the folder of the run is made.
    overwrite
        Replace a finished run.
    """
    made = train(
        algo,
        scenario,
        environment,
        control,
        seed=seed,
        folder=folder,
        steps=steps,
        settings=settings,
        overwrite=overwrite,
    )
    print(f"{made}\njudge it:  python -m sledenv.agents.evaluate {made}\nwatch it:  tensorboard --logdir {made}")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    return run(command, arguments)


if __name__ == "__main__":
    sys.exit(main())
