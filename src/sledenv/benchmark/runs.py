"""Agents trained into folders that appear only when they are complete, and loaded from them."""

from __future__ import annotations

import copy
import hashlib
import importlib
import importlib.metadata
import inspect
import json
import os
import platform
import shutil
import sys
import time
from pathlib import Path
from typing import Any, Final, cast

import yaml

from sledenv.benchmark.problem import Agent, Problem
from sledenv.machine.extras import folder_of
from sledenv.scenarios.configuration import read_yaml
from sledenv.scenarios.scenario import Scenario

TRAINED: Final = folder_of("agents") / "trained"  # what ships: a critic for every scenario
_CONFIG: Final = "config.yaml"
_RECORD: Final = "record.yaml"
_PACKAGES: Final = ("sledenv", "cma", "gymnasium", "numba", "numpy", "scipy", "stable-baselines3", "torch")


def agent_class(module: str) -> type[Agent]:
    """Import an agent: the class ``Agent`` of a module such as "sledenv.agents.sac", also of the working folder.

    Raises
    ------
    ValueError
        If there is no such module or it has no such class.
    """
    here = os.getcwd()
    if here not in sys.path:  # a console script does not look there by itself
        sys.path.append(here)
    try:
        found = importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or not module.startswith(error.name):
            raise  # something that the agent needs
        raise ValueError(
            f"agent {module!r}: there is no such module, neither installed nor in the working folder; those that ship "
            "are modules of sledenv.agents"
        ) from error
    if getattr(found, "Agent", Agent) is Agent:  # none, or the protocol that it imports
        raise ValueError(f"agent {module!r}: the module has no class Agent, see docs/benchmark.md")
    return cast("type[Agent]", found.Agent)


def agent_name(module: str) -> str:
    """Return the short name of an agent: the last part of its module."""
    return module.rpartition(".")[2]


def read_settings(folder: Path, module: str, problem: Problem) -> dict[str, Any]:
    """Read the hyperparameters of an agent from a folder such as configs/agents; empty where it has none.

    Raises
    ------
    ValueError
        If the file says nothing about the environment of the problem.
    """
    path = folder / f"{agent_name(module)}.yaml"
    if not path.is_file():
        return {}
    content = read_yaml(path)
    if problem.id not in content:
        raise ValueError(f"{path} has no settings for {problem.id}, only for {', '.join(content)}")
    return dict(content[problem.id])


def train(module: str, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Path:
    """Train an agent and keep it in a folder of its own, in place of what is there.

    Parameters
    ----------
    module : str
        As for :func:`agent_class`.
    problem : Problem
    settings : dict
        As for :meth:`Agent.train`.
    seed : int
        Of everything random in the run.
    folder : Path
        It appears when the run is complete, with ``config.yaml`` (all that is needed to repeat it) and the agent; an
        interrupted run leaves only a ``.part`` folder, which the next attempt replaces.

    Raises
    ------
    ValueError
        As :func:`agent_class`; nothing is written then.
    """
    agent = agent_class(module)
    part = folder.with_name(folder.name + ".part")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    config = meant(module, problem, settings, seed)
    config |= {"scenario": problem.scenario.model_dump(mode="json", by_alias=True), "versions": versions()}
    (part / _CONFIG).write_text(yaml.safe_dump(config, sort_keys=False))
    started = time.perf_counter(), time.process_time()
    agent.train(problem, copy.deepcopy(settings), seed, part)  # stable-baselines3 writes into nested settings
    record = {"train_seconds": time.perf_counter() - started[0], "train_cpu_seconds": time.process_time() - started[1]}
    (part / _RECORD).write_text(yaml.safe_dump(record))
    shutil.rmtree(folder, ignore_errors=True)
    part.rename(folder)
    return folder


def is_trained(module: str, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> bool:
    """Whether a folder holds a finished run of exactly this; whatever the versions of the packages."""
    try:
        config = read_config(folder)
    except FileNotFoundError:
        return False
    wanted = meant(module, problem, settings, seed)
    return {key: config.get(key) for key in wanted} == wanted


def meant(module: str, problem: Problem, settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Return what tells one run from another, as plain data."""
    return {
        "agent": module,
        "code": _code(module),
        "scenario_hash": problem.scenario.hash,
        "environment": problem.environment,
        "control": problem.control,
        "observe": list(problem.task.observed),
        "launch_noise": problem.noise.tolist(),
        "seed": seed,
        "settings": settings,
    }


def _code(module: str) -> str:
    """Digest of the source of an agent and of all that it inherits from."""
    names = {kind.__module__ for kind in agent_class(module).__mro__} - sys.stdlib_module_names
    sources = [inspect.getsource(sys.modules[name]) for name in sorted(names)]
    return hashlib.sha256(json.dumps(sources).encode()).hexdigest()[:12]


def read_config(folder: Path) -> dict[str, Any]:
    """Read what a finished run was trained with.

    Raises
    ------
    FileNotFoundError
        If ``folder`` is no finished run.
    """
    path = folder / _CONFIG
    if not path.is_file():
        raise FileNotFoundError(f"{folder} is no finished run: it has no {_CONFIG}")
    return cast("dict[str, Any]", yaml.safe_load(path.read_text()))


def read_record(folder: Path) -> dict[str, float]:
    """Read what the training of a finished run took: ``train_seconds`` and ``train_cpu_seconds``."""
    return cast("dict[str, float]", yaml.safe_load((folder / _RECORD).read_text()))


def load_run(folder: Path) -> tuple[Problem, Agent, dict[str, Any]]:
    """Read a finished run: its problem, its agent and its configuration.

    Read only what you trust: the module that it names is imported, and an agent may keep pickles.

    Parameters
    ----------
    folder : Path
        Where there is none, the run of that name that ships, such as "sled_snow-launch-orientation-critic-s0".

    Raises
    ------
    FileNotFoundError, ValueError
        If there is neither; as :func:`read_config` and :func:`agent_class`.
    """
    if not folder.exists():
        if not (TRAINED / folder).is_dir():
            raise FileNotFoundError(f"{folder}: there is no such run, neither here nor among those that ship")
        folder = TRAINED / folder
    config = read_config(folder)
    scenario = Scenario.model_validate(config["scenario"])
    given = {"observe": config["observe"], "launch_noise": config["launch_noise"]}
    problem = Problem(scenario, config["environment"], config["control"], **given)
    return problem, agent_class(config["agent"]).load(problem, folder), config


def versions() -> dict[str, str]:
    """Versions of the packages on which results depend; those that are not installed are left out."""
    known = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            known[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return known
