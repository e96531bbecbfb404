"""The results of a suite in one SQLite file: a transaction for each finished job, read back as tables."""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final, NamedTuple

import pandas as pd

from sledenv.benchmark.problem import TRIALS
from sledenv.benchmark.references import reference
from sledenv.benchmark.runs import meant
from sledenv.benchmark.suite import Job, Suite
from sledenv.scenarios.sections import CONTROLS
from sledenv.simulation.jam import DescentJam
from sledenv.simulation.records import LIBRARY, LOSSES

FILE: Final = "results.sqlite"
PROBLEM: Final = ["environment", "scenario"]
AGENT: Final = [*PROBLEM, "agent"]
STATUSES: Final = ("finish", "jammed", "tumbled")
REFERENCE: Final = ["lower", "lower_falls", "clairvoyant"]
_JOB: Final = ["key", *AGENT, "seed"]
_ACTIONS: Final = [f"action_{i}" for i in range(len(CONTROLS))]
_LOST: Final = [f"loss_{name}" for name in LOSSES]
COLUMNS: Final = {
    "judged": [
        *(*_JOB, "scenario_hash", "stage", "context", *DescentJam._fields, *STATUSES),
        *("supplied", *_LOST, "rebounds", "time", *_ACTIONS, "on_bound"),
    ],
    "curves": [*_JOB, "descents", "seconds", "mean_reward"],
    "runs": [*_JOB, "descents", "train_seconds", "train_cpu_seconds", "suite", "commit", "versions"],
}
_MAY_BE_EMPTY: Final[dict[str, list[str]]] = {"judged": _ACTIONS, "curves": ["seconds"], "runs": []}


class Results(NamedTuple):
    """Tables of a suite; docs/benchmark.md lists the columns."""

    judged: pd.DataFrame  # a row for each context in which an agent was judged: means over its trials, REFERENCE
    curves: pd.DataFrame  # a row for each validation during training
    runs: pd.DataFrame  # a row for each trained agent


class Store:
    """The file of a suite, which one process writes."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def done(self) -> set[str]:
        """Return the keys of the jobs that are done."""
        with self._connection as transaction:
            for name, columns in COLUMNS.items():
                named = ", ".join(f'"{column}"' for column in columns)
                transaction.execute(f"CREATE TABLE IF NOT EXISTS {name} ({named})")
            return {key for (key,) in transaction.execute("SELECT key FROM runs")}

    def add(self, tables: Mapping[str, pd.DataFrame]) -> None:
        """Write all that a finished job has found in place of what the same job had found, or nothing of it.

        The rows are not written by ``DataFrame.to_sql``, which ends the transaction with every table.
        """
        job = tables["runs"][[*AGENT, "seed"]].iloc[0].tolist()
        same = " AND ".join(f"{column} = ?" for column in (*AGENT, "seed"))
        with self._connection as transaction:
            for name, table in tables.items():
                transaction.execute(f"DELETE FROM {name} WHERE {same}", job)
                places = ", ".join("?" * len(COLUMNS[name]))
                rows = table[COLUMNS[name]].itertuples(index=False, name=None)
                transaction.executemany(f"INSERT INTO {name} VALUES ({places})", rows)


def key_of(suite: Suite, job: Job) -> str:
    """Return a digest of the name of a job and of all that its numbers depend on."""
    content = [job.name, meant(job.module, job.problem(), job.settings, job.seed), suite.contexts, TRIALS]
    content += [DescentJam._fields, LIBRARY.fingerprint]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


@contextmanager
def opened(folder: Path) -> Iterator[Store]:
    """Open the file of results in a folder, which is made if it is not there.

    Raises
    ------
    OSError
        If it is no such file, or cannot be read or written.
    """
    with _connected(folder / FILE) as connection:
        yield Store(connection)


def read_results(suite: Suite, folder: Path) -> Results:
    """Read what a suite has found so far, with the references of its scenarios beside it.

    Parameters
    ----------
    suite : Suite
    folder : Path
        That :func:`sledenv.benchmark.runner.run_suite` has written.

    Returns
    -------
    Results
        In an order that does not depend on which job ended first. ``judged`` has the columns ``REFERENCE``, NaN where
        there is no reference for the scenario as it was judged.

    Raises
    ------
    FileNotFoundError
        If the folder holds no results.
    OSError
        If they cannot be read.
    """
    file = folder / FILE
    if not file.is_file():
        raise FileNotFoundError(f"{folder} holds no results of a benchmark: it has no {FILE}")
    keys = {key_of(suite, job) for job in suite.jobs()}
    with _connected(file) as connection:
        tables = [
            pd.read_sql(f"SELECT * FROM {name}", connection, dtype=dict.fromkeys(empty, float))
            for name, empty in _MAY_BE_EMPTY.items()
        ]
    judged, curves, runs = (
        table[table["key"].isin(keys)]
        .sort_values([*AGENT, "seed"], kind="stable", ignore_index=True)
        .drop(columns="key")
        for table in tables
    )
    if judged.empty:
        raise FileNotFoundError(f"{file} holds no results yet: no job of the suite has ended")
    return Results(beside_references(judged, suite), curves, runs)


def beside_references(judged: pd.DataFrame, suite: Suite) -> pd.DataFrame:
    """Return judged contexts with the columns ``REFERENCE``, NaN where there is none."""
    found = [pd.DataFrame(columns=["environment", "scenario_hash", "context", *REFERENCE])]
    for scenario, environment in suite.questions():
        problem = suite.problem(scenario, environment)
        if (table := reference(problem)) is not None:
            named = {"environment": environment, "scenario_hash": problem.scenario.hash, "context": table.index}
            found.append(table.reset_index(drop=True)[REFERENCE].assign(**named))
    references = pd.concat(found[1:] or found).astype({"context": int} | dict.fromkeys(REFERENCE, float))
    return judged.merge(references, "left", ["environment", "scenario_hash", "context"], validate="many_to_one")


@contextmanager
def _connected(file: Path) -> Iterator[sqlite3.Connection]:
    try:
        with closing(sqlite3.connect(file)) as connection:
            yield connection
    except (sqlite3.Error, pd.errors.DatabaseError) as error:
        raise OSError(f"{file}: {error}; without this file the suite judges everything again") from error
