"""Frozen references: what a planner or the best launch earns in held-out contexts, so that no score needs a search."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from sledenv.benchmark.problem import HeldOut, Problem
from sledenv.machine.files import replacing

FOLDER: Final = Path(__file__).parent / "references"


def reference(problem: Problem, held_out: HeldOut = "test", folder: Path = FOLDER) -> pd.DataFrame | None:
    """Read what is known of the held-out contexts of a problem.

    Returns
    -------
    DataFrame or None
        Of each context that is known, by its number: ``lower``, the mean reward of one policy that sees no more than an
        agent does, of launches that of the best launch found; ``lower_falls``, its share of falls; ``clairvoyant``, of
        the best ride found by a search that knows the errors, an estimate, NaN where none was searched;
        ``attrs["policy"]`` has words for the policy. None if nothing is frozen for such a problem.
    """
    table = _frozen(folder / f"{problem.scenario.id}.parquet")
    if table is None or problem.task.hidden.any():  # an agent from whom something is hidden sees less
        return None
    rows = table[_fits(table, problem, held_out)].set_index("context").sort_index()
    if rows.empty:
        return None
    found = rows[["lower", "lower_falls", "clairvoyant"]].copy()
    found.attrs["policy"] = str(rows["policy"].iloc[0])
    return found


def freeze(problem: Problem, held_out: HeldOut, table: pd.DataFrame, policy: str, folder: Path = FOLDER) -> Path:
    """Write what is known of held-out contexts, in place of what was known of them.

    Parameters
    ----------
    problem : Problem
    held_out : {"test", "shifted", "tracks"}
    table : DataFrame
        As :func:`reference` returns it.
    policy : str
        Words for the policy of ``lower``.
    """
    path = folder / f"{problem.scenario.id}.parquet"
    rows, known = table.reset_index(names="context").assign(**_keys(problem, held_out), policy=policy), _frozen(path)
    if known is not None:
        rows = pd.concat([known[~_fits(known, problem, held_out)], rows], ignore_index=True)
    folder.mkdir(parents=True, exist_ok=True)
    with replacing(path, ".parquet") as part:
        rows.to_parquet(part, index=False)
    _frozen.cache_clear()
    return path


def _fits(table: pd.DataFrame, problem: Problem, held_out: HeldOut) -> Any:
    """Return which rows are of a set of a problem, a mask."""
    return np.logical_and.reduce([table[name] == value for name, value in _keys(problem, held_out).items()])


def _keys(problem: Problem, held_out: HeldOut) -> dict[str, str]:
    """Return all that decides what is earned in a context but its number, as text.

    Errors of riders and launches are drawn by the number of a context and by the split.
    """
    parts = [one.scenario.hash for one in problem.held_out(held_out).values()]
    digest = parts[0] if len(parts) == 1 else hashlib.sha256(" ".join(parts).encode()).hexdigest()[:16]
    keys = {"held_out": held_out, "scenario_hash": digest, "control": problem.control}
    return keys | {"solver": problem.task.solver, "launch_noise": str(problem.noise.tolist())}


@cache
def _frozen(path: Path) -> pd.DataFrame | None:
    return pd.read_parquet(path) if path.is_file() else None
