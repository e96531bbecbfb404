"""Train one agent on one scenario: ``python -m agents.train --algo sac --scenario brake_mat --seed 0``."""

from __future__ import annotations

import argparse
import importlib.metadata
import platform
import shutil
import sys
from pathlib import Path
from typing import Any, Final, get_args

import yaml

from agents.best_fixed import BestFixed
from agents.problem import Agent, Problem
from agents.random_launch import RandomLaunch
from agents.sac import Sac
from agents.zero import Zero
from sledenv import ScenarioError
from sledenv.envs import LAUNCH_ID
from sledenv.envs.task import Control

ALGORITHMS: Final[dict[str, type[BestFixed] | type[RandomLaunch] | type[Sac] | type[Zero]]] = {
    "random": RandomLaunch,
    "zero": Zero,
    "best_fixed": BestFixed,
    "sac": Sac,
}
_CONFIGS = Path(__file__).parents[1] / "configs" / "agents"
_CONFIG = "config.yaml"
_PACKAGES = ("sledenv", "gymnasium", "numba", "numpy", "stable-baselines3", "torch")


def default_settings(algo: str) -> dict[str, Any]:
    """Read the hyperparameters of an algorithm from configs/agents; empty where it has none."""
    path = _CONFIGS / f"{algo}.yaml"
    return dict(yaml.safe_load(path.read_text())[LAUNCH_ID]) if path.is_file() else {}


def run_folder(runs: Path, algo: str, scenario: str, control: str, seed: int) -> Path:
    """Return the folder of a run below ``runs``."""
    return runs / f"{Path(scenario).stem}-{control}-{algo}-s{seed}"


def train(
    algo: str,
    scenario: str,
    *,
    control: Control = "both",
    seed: int = 0,
    runs: Path = Path("runs"),
    steps: int | None = None,
    overwrite: bool = False,
) -> Path:
    """Train an agent and keep it in a folder of its own.

    Parameters
    ----------
    algo : str
        A key of ``ALGORITHMS``.
    scenario, control
        As for the environment.
    seed : int
        Of everything random in the run.
    runs : Path
        Where the folder of the run is made.
    steps : int, optional
        Budget in descents in place of the configured one.
    overwrite : bool
        Replace a finished run; otherwise it is left as it is.

    Returns
    -------
    Path
        The folder: ``config.yaml`` (resolved) and the agent. It appears when the run is complete; an interrupted run
        leaves only a ``.part`` folder, which the next attempt replaces.

    Raises
    ------
    ScenarioError, ValueError
        For an unknown scenario, algorithm or control; nothing is written then.
    FileExistsError
        If the run exists and ``overwrite`` is false.
    """
    if algo not in ALGORITHMS:
        raise ValueError(f"algo = {algo!r}: must be one of {', '.join(ALGORITHMS)}")
    if steps is not None and steps < 1:
        raise ValueError(f"steps = {steps}: must be >= 1")
    problem = Problem(scenario, control)
    settings = default_settings(algo)
    if steps is not None and settings:
        settings["n_timesteps"] = steps
    folder = run_folder(runs, algo, scenario, control, seed)
    if folder.exists() and not overwrite:
        raise FileExistsError(f"{folder} exists: add --overwrite to replace it")
    part = folder.with_name(folder.name + ".part")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    config = {
        "algo": algo,
        "scenario": scenario,
        "scenario_hash": problem.task.scenario.hash,
        "control": control,
        "seed": seed,
        "settings": settings,
        "versions": {name: importlib.metadata.version(name) for name in _PACKAGES}
        | {"python": platform.python_version()},
    }
    (part / _CONFIG).write_text(yaml.safe_dump(config, sort_keys=False))
    ALGORITHMS[algo].train(problem, settings, seed, part)
    shutil.rmtree(folder, ignore_errors=True)
    part.rename(folder)
    return folder


def load_run(folder: Path) -> tuple[Problem, Agent, dict[str, Any]]:
    """Read a finished run: its problem, its agent and its resolved configuration.

    Raises
    ------
    FileNotFoundError
        If ``folder`` is no finished run.
    ValueError
        If the scenario has changed since the run.
    """
    path = folder / _CONFIG
    if not path.is_file():
        raise FileNotFoundError(f"{folder} is no finished run: it has no {_CONFIG}")
    config = yaml.safe_load(path.read_text())
    problem = Problem(config["scenario"], config["control"])
    if problem.task.scenario.hash != config["scenario_hash"]:
        raise ValueError(f"{folder}: scenario {config['scenario']} has changed since this run was trained")
    return problem, ALGORITHMS[config["algo"]].load(problem, folder), config


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m agents.train", description=__doc__)
    parser.add_argument("--algo", choices=ALGORITHMS, default="sac")
    parser.add_argument("--scenario", default="brake_mat", help="name of a shipped scenario or a .yaml file")
    parser.add_argument("--control", choices=get_args(Control), default="both")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, help="budget in descents (default: configs/agents/ALGO.yaml)")
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="where the folder of the run is made")
    parser.add_argument("--overwrite", action="store_true", help="replace a finished run")
    given = parser.parse_args(arguments)
    try:
        folder = train(
            given.algo,
            given.scenario,
            control=given.control,
            seed=given.seed,
            runs=given.runs,
            steps=given.steps,
            overwrite=given.overwrite,
        )
    except (ScenarioError, ValueError, FileExistsError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{folder}\njudge it:  python -m agents.evaluate {folder}\nwatch it:  tensorboard --logdir {folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
