"""Runs a suite: trains and judges its agents on all cores or on a cluster, and goes on where it was stopped."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from tqdm import tqdm

from sledenv.benchmark.problem import Agent, Problem
from sledenv.benchmark.results import STATUSES, key_of, opened
from sledenv.benchmark.runs import agent_class, is_trained, load_run, read_record, train, versions
from sledenv.benchmark.suite import Job, Suite
from sledenv.envs.inputs import Contexts
from sledenv.machine.blame import attribute_errors_to
from sledenv.machine.files import alone
from sledenv.machine.workers import Call, runner
from sledenv.scenarios.sections import CONTROLS
from sledenv.simulation.records import LIBRARY, LOSSES
from sledenv.simulation.rules import checked_count

_CURVE: Final = "learning_curve.csv"  # that an agent may leave in its folder
_ON_BOUND: Final = 1e-3  # how near to a bound of the box an action lies on it


def run_suite(suite: Suite, folder: Path, *, workers: int | None = None, ray: str | None = None) -> Path:
    """Train and judge everything of a suite that has not been yet.

    What a job has found is written in one transaction, so a run that is killed goes on without loss or repetition. The
    numbers do not depend on the number of workers.

    Parameters
    ----------
    suite : Suite
    folder : Path
        Of the results: ``trained/`` holds the agents, ``results.sqlite`` what they did, which
        :func:`sledenv.benchmark.results.read_results` reads.
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
    jobs = {key_of(suite, job): job for job in suite.jobs()}
    run = runner(None if workers is None else checked_count("workers", workers), ray)
    (folder / "trained").mkdir(parents=True, exist_ok=True)
    with alone(folder / ".lock", wait=False), opened(folder) as store:
        LIBRARY.ready()  # made once, if it must be, and not by every worker
        stamp = {"suite": suite.id, "commit": _commit(), "versions": json.dumps(versions())}
        done = store.done().intersection(jobs)
        calls: list[Call] = [
            (_train_and_judge, (job, suite.contexts, folder / "trained" / job.name, stamp | {"key": key}))
            for key, job in jobs.items()
            if key not in done
        ]
        with tqdm(total=len(jobs), initial=len(done), desc=suite.id, unit="job", smoothing=0.0) as bar:
            for name, tables in run(calls):
                store.add(tables)
                bar.set_postfix_str(name, refresh=False)
                bar.update()
    return folder


def _train_and_judge(
    job: Job, contexts: int, place: Path, stamp: dict[str, str]
) -> tuple[str, dict[str, pd.DataFrame]]:
    """Train an agent, unless it has been, and return the name of the job and the rows of its tables."""
    problem = job.problem()
    if not is_trained(job.module, problem, job.settings, job.seed, place):
        train(job.module, problem, job.settings, job.seed, place)
    trials = problem.trials(problem.contexts("test", contexts), "test")
    named = {"environment": job.environment, "scenario": problem.scenario.id, "agent": job.agent, "seed": job.seed}
    parts = [_rows(problem, agent, trials).assign(stage=stage) for stage, agent in _agents(job, problem, place)]
    curve = _curve(place)
    used = curve["descents"].iloc[-1] if len(curve) else job.settings.get("n_timesteps", 0)
    tables = {
        "judged": pd.concat(parts).assign(scenario_hash=problem.scenario.hash),
        "curves": curve,
        "runs": pd.DataFrame([{"descents": int(used)} | read_record(place) | stamp]),
    }
    return job.name, {name: table.assign(key=stamp["key"], **named) for name, table in tables.items()}


def _agents(job: Job, problem: Problem, place: Path) -> Iterator[tuple[str, Agent]]:
    """Load the agent of a run, and what it was before it was trained if it keeps that; yield each with its stage."""
    yield "trained", load_run(place)[1]
    before = getattr(agent_class(job.module), "load_untrained", None)
    if before is not None:
        with attribute_errors_to(f"agent {job.module}, scenario {problem.scenario.id}", "load_untrained"):
            untrained = before(problem, place)
        yield "untrained", untrained


def _rows(problem: Problem, agent: Agent, trials: Contexts) -> pd.DataFrame:
    """Return one row per context, means over its trials, for contexts of shape (n, t, 12) or (n, t, 14)."""
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


def _curve(folder: Path) -> pd.DataFrame:
    """Return descents, seconds and mean validation reward of a learning curve, no rows if the agent left none."""
    path, columns = folder / _CURVE, ["descents", "seconds", "mean_reward"]
    if not path.is_file():
        return pd.DataFrame(columns=columns, dtype=float)
    try:
        return pd.read_csv(path).reindex(columns=columns).astype(float)
    except ValueError as error:  # among them those of pandas
        raise ValueError(f"{path} is no table of numbers: {' '.join(str(error).split())}") from error


def _commit() -> str:
    """Return the commit of the checkout, with a mark if it has been changed; an empty string outside one."""
    git = ["git", "-C", str(Path(__file__).parent)]
    try:  # an installation may lie in a repository that does not hold it
        subprocess.run([*git, "ls-files", "--error-unmatch", __file__], capture_output=True, check=True)
        command = [*git, "describe", "--always", "--dirty", "--abbrev=12"]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
