"""Runs a suite: trains and judges its agents on all cores or on a cluster, and goes on where it was stopped."""

from __future__ import annotations

import hashlib
import json
import logging
import subprocess
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from tqdm import tqdm

from sledenv.benchmark.oracle import BLOCK, map_table, oracle, search_block
from sledenv.benchmark.problem import TRIALS, Agent, Environment, Problem
from sledenv.benchmark.runs import agent_class, is_trained, load_run, meant, read_record, train, versions
from sledenv.benchmark.scores import STATUSES
from sledenv.benchmark.suite import Job, Suite
from sledenv.envs.inputs import Contexts
from sledenv.machine.blame import GivenCodeError, blaming
from sledenv.machine.files import alone, replacing
from sledenv.machine.sealed import read_sealed, write_sealed
from sledenv.machine.workers import Call, runner
from sledenv.scenarios.sections import CONTROLS
from sledenv.simulation.jam import DescentJam
from sledenv.simulation.records import LIBRARY, LOSSES
from sledenv.simulation.rules import checked_count

TABLES: Final = ("results", "curves", "runs", "oracle", "maps")
_CURVE = "learning_curve.csv"  # that an agent may leave in its folder
_log = logging.getLogger("sledenv")
_ON_BOUND = 1e-3  # how near to a bound of the box an action lies on it


def run_suite(suite: Suite, folder: Path, *, workers: int | None = None, ray: str | None = None) -> Path:
    """Train and judge everything of a suite that has not been yet, and gather the tables.

    Every job writes its result in one move, so a run that is killed goes on without loss or repetition. The numbers do
    not depend on the number of workers.

    Parameters
    ----------
    suite : Suite
    folder : Path
        Of the results. ``trained/`` holds the agents, ``judged/`` one Parquet file a job, ``searched/`` the best
        launches and rides; the tables ``results``, ``curves``, ``runs``, ``oracle`` and ``maps`` gather them.
    workers : int, optional
        Processes, all cores by default; of a cluster all that it has.
    ray : str, optional
        Address of a Ray cluster whose nodes share the folder, "local" to start one here.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    SuiteError
        If an agent cannot be imported or lacks settings; nothing is written then.
    ImportError
        If Ray is asked for and missing.
    BlockingIOError
        If another process is writing the folder.
    """
    folder = folder.resolve()  # a worker of a cluster may work elsewhere
    jobs = list(suite.jobs())
    run = runner(None if workers is None else checked_count("workers", workers), ray)
    for part in ("trained", "judged", "searched"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    with alone(folder / ".lock", wait=False):
        LIBRARY.ready()  # made once, if it must be, and not by every worker
        stamp = {"suite": suite.id, "commit": _commit(), "versions": json.dumps(versions())}
        missing = [job for job in jobs if _found(suite, job, folder) is None]
        starts = range(0, suite.contexts, BLOCK)
        # The mistakes of an agent are found before long searches.
        calls: list[Call] = [(_train_and_judge, (suite, job, folder, stamp)) for job in missing]
        calls += [(_search, (suite, *one, folder, start)) for one in suite.questions() for start in starts]
        done = len(jobs) - len(missing)
        with tqdm(total=len(calls) + done, initial=done, desc=suite.id, unit="job", smoothing=0.0) as bar:
            for name in run(calls):
                bar.set_postfix_str(name, refresh=False)
                bar.update()
        _gather(suite, jobs, folder)
    return folder


def _key(suite: Suite, job: Job, problem: Problem) -> str:
    """Digest of all that the numbers of a job depend on."""
    content = [meant(job.module, problem, job.settings, job.seed), suite.contexts, TRIALS]
    content += [DescentJam._fields, LIBRARY.fingerprint]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:12]


def _judged(suite: Suite, job: Job, folder: Path) -> Path:
    return folder / "judged" / f"{job.name}-{_key(suite, job, job.problem())}.parquet"


def _found(suite: Suite, job: Job, folder: Path) -> pd.DataFrame | None:
    """Return what was found when a job was judged, None if it has not been or is not as it was left."""
    return read_sealed(_judged(suite, job, folder), "judging")


def _search(suite: Suite, scenario: str, environment: Environment, folder: Path, start: int) -> str:
    """Search the best launches or rides of a block of the held-out contexts of a scenario."""
    problem = suite.problem(scenario, environment)
    search_block(problem, problem.contexts("test", suite.contexts), folder / "searched", start)
    return f"oracle of {problem.scenario.id}"


def _train_and_judge(suite: Suite, job: Job, folder: Path, stamp: dict[str, str]) -> str:
    """Train an agent, unless it has been, and keep what it does on the held-out contexts."""
    problem = job.problem()
    place = folder / "trained" / job.name
    agents = {}
    if is_trained(job.module, problem, job.settings, job.seed, place):
        try:
            agents = _agents(job, problem, place)
        except GivenCodeError as error:  # a file of it has been deleted or cut
            _log.warning("sledenv: training again: %s", error)
    if not agents:
        train(job.module, problem, job.settings, job.seed, place)
        agents = _agents(job, problem, place)
    trials = problem.trials(problem.contexts("test", suite.contexts), "test")
    parts = [_rows(problem, agent, trials).assign(stage=stage) for stage, agent in agents.items()]
    table = pd.concat(parts, ignore_index=True)
    table.attrs = stamp | read_record(place) | {"curve": _curve(place)}
    write_sealed(table, _judged(suite, job, folder))
    return job.name


def _agents(job: Job, problem: Problem, place: Path) -> dict[str, Agent]:
    """Load the agent of a run, and what it was before it was trained if it keeps that."""
    found = {"trained": load_run(place)[1]}
    before = getattr(agent_class(job.module), "load_untrained", None)
    if before is not None:
        with blaming(f"agent {job.module}, scenario {problem.scenario.id}", "load_untrained"):
            found["untrained"] = before(problem, place)
    return found


def _rows(problem: Problem, agent: Agent, trials: Contexts) -> pd.DataFrame:
    """Return one row a context, means over its trials, for contexts of shape (n, t, 12) or (n, t, 14)."""
    batch, actions = problem.judge(agent, trials)
    outcomes, status = batch.outcomes, batch.status
    columns: dict[str, Any] = batch.jam._asdict()
    columns |= {name: status == name for name in STATUSES}
    columns |= {f"loss_{name}": outcomes[name] for name in LOSSES}
    columns |= {"supplied": outcomes["supplied"], "rebounds": outcomes["rebounds"], "time": outcomes["t"]}
    means = {name: np.reshape(column, trials.shape[:2]).mean(axis=1) for name, column in columns.items()}
    for i in range(len(CONTROLS)):
        means[f"action_{i}"] = actions[:, i] if i < actions.shape[1] else np.full(len(actions), np.nan)
    means["on_bound"] = np.abs(actions).max(axis=1) >= 1.0 - _ON_BOUND
    return pd.DataFrame({"context": np.arange(len(trials)), **means})


def _curve(folder: Path) -> list[list[float]]:
    """Return descents, seconds and mean validation reward of a learning curve, empty if the agent left none."""
    path = folder / _CURVE
    if not path.is_file():
        return []
    try:
        curve = pd.read_csv(path).reindex(columns=["descents", "seconds", "mean_reward"]).astype(float)
    except ValueError as error:  # among them those of pandas
        raise ValueError(f"{path} is no table of numbers: {' '.join(str(error).split())}") from error
    rows: list[list[float]] = curve.to_numpy().tolist()
    return rows


def _gather(suite: Suite, jobs: list[Job], folder: Path) -> None:
    """Put the results of all jobs into the tables."""
    results, curves, runs = [], [], []
    for job in jobs:
        problem = job.problem()
        table = _found(suite, job, folder)
        if table is None:
            raise OSError(f"{_judged(suite, job, folder)} has been changed meanwhile: the same command judges it again")
        curve = pd.DataFrame(table.attrs["curve"], columns=["descents", "seconds", "mean_reward"], dtype=float)
        named = {"environment": job.environment, "scenario": problem.scenario.id, "agent": job.agent, "seed": job.seed}
        used = curve["descents"].iloc[-1] if len(curve) else job.settings.get("n_timesteps", 0)
        attributes = {key: value for key, value in table.attrs.items() if key != "curve"}
        runs.append(pd.DataFrame([named | {"descents": int(used)} | attributes]))
        curves.append(curve.assign(**named))
        table.attrs = {}
        results.append(table.assign(scenario_hash=problem.scenario.hash, **named))
    searched, maps = [], []
    for scenario, environment in suite.questions():
        problem = suite.problem(scenario, environment)
        named = {"environment": environment, "scenario": problem.scenario.id}
        contexts = problem.contexts("test", suite.contexts)
        best = oracle(problem, contexts, folder / "searched")
        searched.append(best.assign(**named, context=np.arange(len(best))))
        if environment == "launch":
            maps.append(map_table(problem, contexts[: suite.maps]).assign(scenario=problem.scenario.id))
    for name, tables in zip(TABLES, (results, curves, runs, searched, maps), strict=True):
        if not tables:  # rides have no maps
            continue
        with replacing(folder / f"{name}.parquet", ".parquet") as part:
            pd.concat(tables, ignore_index=True).to_parquet(part, index=False)


def _commit() -> str:
    """Commit of the checkout, with a mark if it has been changed; empty outside one."""
    git = ["git", "-C", str(Path(__file__).parent)]
    try:  # an installation may lie in a repository that does not hold it
        subprocess.run([*git, "ls-files", "--error-unmatch", __file__], capture_output=True, check=True)
        command = [*git, "describe", "--always", "--dirty", "--abbrev=12"]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
