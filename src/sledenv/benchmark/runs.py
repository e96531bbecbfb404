"""Agents trained into folders that appear only when they are complete, and loaded from them."""

from __future__ import annotations

import copy
import glob
import hashlib
import importlib
import importlib.metadata
import inspect
import json
import logging
import os
import platform
import reprlib
import shutil
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Final, cast

from pydantic import ConfigDict, ValidationError

from sledenv.benchmark.problem import ENVIRONMENTS, Agent, Environment, Problem
from sledenv.machine.blame import attribute_errors_to
from sledenv.machine.extras import folder_of
from sledenv.machine.files import alone, check_folder, put
from sledenv.machine.shipped import CONFIGS
from sledenv.scenarios.configuration import Quantity, Section, Whole, read_yaml, write_yaml
from sledenv.scenarios.scenario import Scenario

TRAINED: Final = folder_of("agents") / "trained"  # what ships
SETTINGS: Final = CONFIGS / "agents"  # those that ship
_SHIPPED: Final = "sledenv.agents."
_CONFIG: Final = "config.yaml"
_RECORD: Final = "record.yaml"
_PART: Final = ".part"  # how the name of a run ends that is not complete
_LOCK: Final = ".lock"  # in it, held while it is trained
_log = logging.getLogger("sledenv")
_PACKAGES: Final = ("sledenv", "gymnasium", "numba", "numpy", "scipy", "stable-baselines3", "torch")


def agent_class(module: str) -> type[Agent]:
    """Import an agent: the class ``Agent`` of a module such as "sledenv.agents.sac", also of the working folder.

    Raises
    ------
    ValueError
        If there is no such module or it has no such class.
    GivenCodeError
        If importing it raises an error.
    """
    if not all(part.isidentifier() for part in module.split(".")):
        raise ValueError(f"agent {module!r}: must be the name of a module, such as sledenv.agents.zero")
    here = os.getcwd()
    if here not in sys.path:  # a console script does not look there by itself
        sys.path.append(here)
    with attribute_errors_to(f"agent {module!r}", "importing it"):
        try:
            found = importlib.import_module(module)
        except ModuleNotFoundError as error:
            if error.name is None or not f"{module}.".startswith(f"{error.name}."):
                raise  # something that the module needs
            found = None
    if found is None:
        raise ValueError(
            f"agent {module!r}: there is no such module, neither installed nor in the working folder; those that ship "
            "are modules of sledenv.agents"
        )
    kind = getattr(found, "Agent", None)
    if not isinstance(kind, type) or kind is Agent:  # the protocol that it imports
        raise ValueError(f"agent {module!r}: the module has no class Agent, see docs/benchmark.md")
    return cast("type[Agent]", kind)


def agent_name(module: str) -> str:
    """Return the short name of an agent: the last part of its module."""
    return module.rpartition(".")[2]


def budgeted(settings: dict[str, Any], steps: int | None) -> dict[str, Any]:
    """Return hyperparameters with another budget, if one is given and the agent has any."""
    return settings if steps is None or "n_timesteps" not in settings else settings | {"n_timesteps": steps}


def read_settings(folder: Path, module: str, environment: Environment) -> dict[str, Any]:
    """Read the hyperparameters of an agent from a folder such as configs/agents; empty where it has none.

    Raises
    ------
    ValueError
        If the file is missing, though the agent ships with one, cannot be read, or says nothing about the environment.
    """
    path, wanted = folder / f"{agent_name(module)}.yaml", ENVIRONMENTS[environment]
    if not path.is_file():
        if module.startswith(_SHIPPED) and (SETTINGS / path.name).is_file():
            raise ValueError(f"{path}: missing, but agent {module} needs settings: copy {SETTINGS / path.name}")
        return {}
    try:
        content = read_yaml(path)
    except ValueError as error:
        raise ValueError(f"{path}: cannot be read: {' '.join(str(error).split())}") from error
    known = content if isinstance(content, dict) else {}
    if wanted not in known:
        raise ValueError(f"{path} has no settings for {wanted}, only for {', '.join(map(str, known)) or 'nothing'}")
    settings = known[wanted]
    if not isinstance(settings, dict):
        raise ValueError(f"{path}: {wanted} = {reprlib.repr(settings)}: must be a mapping of keys to values")
    return dict(settings)


def problem_of(
    scenario: str | os.PathLike[str] | Scenario,
    environment: Environment,
    settings: dict[str, Any],
    control: str | None = None,
    **given: Any,
) -> Problem:
    """Return the problem of an agent with such settings.

    Parameters
    ----------
    scenario, environment, control
        As for :class:`sledenv.benchmark.problem.Problem`.
    settings : dict
        Of :func:`read_settings`. ``env_kwargs``, as rl-baselines3-zoo has them, are keywords of the problem: what the
        agent sees.
    given
        Other keywords of the problem.
    """
    return Problem(scenario, environment, control, **given, **settings.get("env_kwargs", {}))


def train(module: str, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Path:
    """Train an agent and keep it in a folder of its own, in place of what is there.

    Parameters
    ----------
    module : str
        As for :func:`agent_class`.
    problem : Problem
    settings : dict
        As for :meth:`Agent.train`, and ``env_kwargs`` of the problem.
    seed : int
        Of everything random in the run.
    folder : Path
        It appears when the run is complete, with ``config.yaml`` (all that is needed to repeat it) and the agent. An
        interrupted run leaves nothing, and of two into one folder, each whole, the one that ends last stays.

    Raises
    ------
    ValueError
        As :func:`agent_class`; nothing is written then.
    GivenCodeError
        If importing or training it raises an error.
    """
    agent = agent_class(module)
    config = meant(module, problem, settings, seed)
    config |= {"scenario": problem.scenario.model_dump(mode="json", by_alias=True), "versions": versions()}
    check_folder(folder.parent)
    folder.parent.mkdir(parents=True, exist_ok=True)
    _remove_killed(folder)
    scratch = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", suffix=_PART, dir=folder.parent))
    try:
        part = scratch / folder.name
        part.mkdir()  # with the permissions of any other folder
        write_yaml(part / _CONFIG, config)
        with alone(scratch / _LOCK), attribute_errors_to(f"agent {module}, scenario {problem.scenario.id}", "train"):
            wall, cpu = time.perf_counter(), time.process_time()
            own = copy.deepcopy(settings)  # stable-baselines3 writes into nested ones
            own.pop("env_kwargs", None)  # which the problem has
            agent.train(problem, own, seed, part)
            record = {"train_seconds": time.perf_counter() - wall, "train_cpu_seconds": time.process_time() - cpu}
        write_yaml(part / _RECORD, record)
        put(part, folder, scratch / "before")
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return folder


def _remove_killed(folder: Path) -> None:
    """Remove what runs into a folder have left that were killed: nobody holds its lock."""
    for left in folder.parent.glob(f".{glob.escape(folder.name)}-*{_PART}/{_LOCK}"):
        with suppress(OSError), alone(left, wait=False):  # it is held, or another one has just removed it
            shutil.rmtree(left.parent, ignore_errors=True)


def is_trained(module: str, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> bool:
    """Whether a folder holds a finished run of exactly this; whatever the versions of the packages.

    One whose files cannot be read is not, and a warning says so.
    """
    try:
        config = read_config(folder)
        read_record(folder)
    except FileNotFoundError:
        return False
    except ValueError as error:
        _log.warning("sledenv: training again: %s", error)
        return False
    wanted = meant(module, problem, settings, seed)
    return {key: config.get(key) for key in wanted} == wanted


def meant(module: str, problem: Problem, settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Return all that tells one run from another, as plain data."""
    return {
        "agent": module,
        "code": _code(module),
        "scenario_hash": problem.scenario.hash,
        "environment": problem.environment,
        "control": problem.control,
        "observe": list(problem.task.observed),
        "columns": list(problem.task.groups),
        "launch_noise": problem.noise.tolist(),
        "seed": seed,
        "settings": settings,
    }


def _code(module: str) -> str:
    """Digest of the source of an agent, of all that it inherits from, and of what these have from the same package."""
    names = {kind.__module__ for kind in agent_class(module).__mro__} - sys.stdlib_module_names
    package = module.rpartition(".")[0]
    for name in sorted(names):
        had = {str(getattr(value, "__module__", "")) for value in vars(sys.modules[name]).values()}
        names |= {one for one in had if package and one.startswith(f"{package}.")}
    sources = [inspect.getsource(sys.modules[name]) for name in sorted(names)]
    return hashlib.sha256(json.dumps(sources).encode()).hexdigest()[:12]


Deviation = Annotated[float, Quantity("[0, inf)")]


class _Config(Section):
    """The part of the configuration of a run that says how to load it; the rest says how it came about."""

    model_config = ConfigDict(extra="ignore")

    agent: str  # its module
    scenario_hash: str
    environment: Environment
    control: str
    observe: tuple[str, ...]
    columns: tuple[str, ...]
    launch_noise: tuple[Deviation, Deviation]
    seed: Annotated[int, Whole("[0, inf)")]
    scenario: dict[str, Any]


class _Record(Section):
    """Times that the training of a run took."""

    train_seconds: Annotated[float, Quantity("[0, inf) s")]
    train_cpu_seconds: Annotated[float, Quantity("[0, inf) s")]


def read_config(folder: Path) -> dict[str, Any]:
    """Read what a finished run was trained with.

    Raises
    ------
    FileNotFoundError
        If ``folder`` is no finished run.
    ValueError
        If its configuration cannot be read, naming every wrong key.
    """
    return _read(folder / _CONFIG, _Config)


def read_record(folder: Path) -> dict[str, float]:
    """Read what the training of a finished run took: ``train_seconds`` and ``train_cpu_seconds``.

    Raises
    ------
    FileNotFoundError, ValueError
        As :func:`read_config`.
    """
    return _read(folder / _RECORD, _Record)


def _read(path: Path, kind: type[Section]) -> dict[str, Any]:
    """Read a file of a run that has the keys of a section."""
    if not path.is_file():
        raise FileNotFoundError(f"{path.parent} is no finished run: it has no {path.name}")
    try:
        content = read_yaml(path)
    except ValueError as error:
        raise ValueError(f"{path}: cannot be read: {' '.join(str(error).split())}") from error
    try:
        kind.model_validate(content)
    except ValidationError as error:
        raise ValueError("; ".join(f"{path}: {line}" for line in kind.problems(error))) from error
    return cast("dict[str, Any]", content)


def load_run(folder: Path) -> tuple[Problem, Agent, dict[str, Any]]:
    """Read a finished run: its problem, its agent and its configuration.

    Read only what you trust: the module that it names is imported, and an agent may keep pickles.

    Parameters
    ----------
    folder : Path
        Where there is none, the run of that name that ships, such as "sled_mat-launch-spin-critic-s0".

    Raises
    ------
    FileNotFoundError, ValueError
        If there is neither; as :func:`read_config` and :func:`agent_class`.
    GivenCodeError
        If loading the agent raises an error.
    """
    if not folder.exists():
        if not (TRAINED / folder).is_dir():
            raise FileNotFoundError(f"{folder}: there is no such run, neither here nor among those that ship")
        folder = TRAINED / folder
    config = read_config(folder)
    read_record(folder)  # which a run that was killed has not
    scenario = Scenario.model_validate(config["scenario"])
    given = {key: config[key] for key in ("observe", "columns", "launch_noise")}
    problem = Problem(scenario, config["environment"], config["control"], **given)
    kind = agent_class(config["agent"])
    with attribute_errors_to(f"agent {config['agent']}, {folder}", "load"):
        return problem, kind.load(problem, folder), config


def versions() -> dict[str, str]:
    """Versions of the packages on which results depend; those that are not installed are left out."""
    known = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            known[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return known
