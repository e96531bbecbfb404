"""Train one agent on one scenario: ``python -m sledenv.agents.train --algo sac --scenario sled_snow --seed 0``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any, Final

from cyclopts import Parameter

from sledenv.benchmark import runs
from sledenv.benchmark.problem import Environment, Problem
from sledenv.benchmark.runs import SETTINGS
from sledenv.command.arguments import Count, Seed
from sledenv.command.running import app, run
from sledenv.scenarios.scenario import load_scenario

ALGORITHMS: Final = (
    *("best_fixed", "critic", "land_flat", "land_parallel", "ppo", "random_launch"),
    *("replan", "replan_critic", "ride_critic", "sac", "tqc", "zero"),
)


def default_settings(algo: str, problem: Problem, settings: Path = SETTINGS) -> dict[str, Any]:
    """Read the hyperparameters of an algorithm from a folder; empty where it has none."""
    return runs.read_settings(settings, _module(algo), problem)


def chosen_settings(algo: str, problem: Problem, steps: int | None = None, settings: Path = SETTINGS) -> dict[str, Any]:
    """Return the hyperparameters of a run; ``steps`` stands in for the configured budget.

    Raises
    ------
    ValueError
        For an unknown algorithm, or one that has no settings for the environment.
    """
    if algo not in ALGORITHMS:
        raise ValueError(f"algo = {algo!r}: must be one of {', '.join(ALGORITHMS)}")
    if steps is not None and steps < 1:
        raise ValueError(f"steps = {steps}: must be >= 1")
    return runs.budgeted(default_settings(algo, problem, settings), steps)


def run_folder(folder: Path, algo: str, problem: Problem, seed: int) -> Path:
    """Return the folder of a run below ``folder``."""
    return folder / f"{problem.scenario.id}-{problem.environment}-{problem.control}-{algo}-s{seed}"


def train(
    algo: str,
    problem: Problem,
    *,
    seed: int = 0,
    folder: Path = Path("runs"),
    steps: int | None = None,
    settings: Path = SETTINGS,
    overwrite: bool = False,
) -> Path:
    """Train an agent and keep it in a folder of its own.

    Parameters
    ----------
    algo : str
        One of ``ALGORITHMS``.
    problem : Problem
    seed : int
        Of everything random in the run.
    folder : Path
        Where the folder of the run is made.
    steps : int, optional
        Budget in environment steps in place of the configured one.
    settings : Path
        Folder of the hyperparameters.
    overwrite : bool
        Replace a finished run; otherwise it is left as it is.

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
    chosen = chosen_settings(algo, problem, steps, settings)
    place = run_folder(folder, algo, problem, seed)
    if place.exists() and not overwrite:
        raise FileExistsError(f"{place} exists: add --overwrite to replace it")
    return runs.train(_module(algo), problem, chosen, seed, place)


def trained(
    algo: str, problem: Problem, *, seed: int = 0, folder: Path = Path("runs"), steps: int | None = None
) -> bool:
    """Whether :func:`train` with these arguments has been run already."""
    settings = chosen_settings(algo, problem, steps)
    return runs.is_trained(_module(algo), problem, settings, seed, run_folder(folder, algo, problem, seed))


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
    runs: Path = Path("runs"),
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
    runs
        Where the folder of the run is made.
    overwrite
        Replace a finished run.
    """
    asked = load_scenario(scenario)
    problem = Problem(asked, environment or ("descent" if asked.is_ride else "launch"), control)
    folder = train(algo, problem, seed=seed, folder=runs, steps=steps, settings=settings, overwrite=overwrite)
    print(f"{folder}\njudge it:  python -m sledenv.agents.evaluate {folder}\nwatch it:  tensorboard --logdir {folder}")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    return run(command, arguments)


def _module(algo: str) -> str:
    return f"sledenv.agents.{algo}"


if __name__ == "__main__":
    sys.exit(main())
