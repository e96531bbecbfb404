"""Info of environments: what they tell of episodes besides what an agent sees."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from sledenv.envs.inputs import FIELDS, Contexts
from sledenv.scenarios.scenario import Context
from sledenv.simulation.outcomes import DescentBatch
from sledenv.simulation.records import FINISH, LEDGER_FIELDS, REBOUND
from sledenv.simulation.rules import checked_names
from sledenv.simulation.scene import State
from sledenv.simulation.scenes import Scenes

INFO_KEYS: Final = ("context", "launch", "rebounds", "jam", "is_success", "descent")

# What is told of a launch [rad], [rad/s], [m/s], and its column.
_LAUNCHED: Final = {
    name: State._fields.index(field) for name, field in (("orientation", "phi"), ("spin", "omega"), ("speed", "u"))
}


def checked_info(info: Sequence[str]) -> tuple[str, ...]:
    """Return which entries of info are to be given, or raise ValueError."""
    return checked_names("info", info, INFO_KEYS)


def only_lane(columns: dict[str, Any]) -> dict[str, Any]:
    """Return plain values in place of arrays of one lane, in a dict of dicts and arrays."""
    return {key: only_lane(value) if isinstance(value, dict) else value.item() for key, value in columns.items()}


def _lists(batch: DescentBatch) -> dict[str, np.ndarray]:
    """Fields of the rebounds of many descents: arrays of lists, because logs differ in length."""
    counts = batch.outcomes["rebounds"]
    rows = batch.rebounds[np.arange(batch.rebounds.shape[1]) < counts[:, np.newaxis]]
    ends = np.cumsum(counts).tolist()
    return {name: _split(rows[name].tolist(), ends) for name in REBOUND.names or ()}


def _split(values: list[float], ends: list[int]) -> np.ndarray:
    """Return an array of lists, each of which ends where ``ends`` says."""
    lists = np.empty(len(ends), dtype=object)
    start = 0
    for i, end in enumerate(ends):
        lists[i] = values[start:end]
        start = end
    return lists


def episode_info(scenes: Scenes, batch: DescentBatch, keys: Iterable[str] = INFO_KEYS) -> dict[str, Any]:
    """Everything about descents that an agent may not see but its user wants to.

    Parameters
    ----------
    scenes : Scenes
        Of n lanes, launched as they were, launch noise included.
    batch : DescentBatch
        Of n descents; with their logs, if "rebounds" is among the keys.
    keys : iterable of str
        Which of ``INFO_KEYS`` to give.

    Returns
    -------
    dict
        Arrays of shape (n,), in dicts. The status is a code, an index of
        ``sledenv.simulation.STATUS_OF_CODE``. Columns of rebounds are arrays of lists, because logs differ in length.
    """
    outcomes, jam = batch.outcomes, batch.jam
    info: dict[str, Any] = {}
    for key in keys:
        match key:
            case "context":
                info[key] = context_info(scenes.drawn)
            case "launch":
                info[key] = launch_info(scenes.launches)
            case "rebounds":
                info[key] = _lists(batch)
            case "jam":
                info[key] = jam._asdict() | {"jam_index": jam.jam_index}
                del info[key]["reward"]  # which the step returns
            case "is_success":
                info[key] = outcomes["status"] == FINISH
            case "descent":
                energy = {name: outcomes[name].copy() for name in LEDGER_FIELDS}
                info[key] = {
                    "status": outcomes["status"].astype(np.int64),
                    "time": outcomes["t"].copy(),
                    "energy": energy,
                }
    return info


def launch_info(launches: NDArray[np.float64]) -> dict[str, Any]:
    """Return what is told of launches of shape (n, 6), arrays of shape (n,)."""
    return {name: launches[:, i].copy() for name, i in _LAUNCHED.items()}


def context_info(contexts: Contexts) -> dict[str, Any]:
    """Return the fields of contexts, arrays of shape (n,)."""
    return dict(zip(Context._fields, contexts[:, :FIELDS].T.copy(), strict=True))
