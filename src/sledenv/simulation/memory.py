"""Logs and trajectories, refused where memory has no room for them."""

from __future__ import annotations

import contextlib
import math
import os
from pathlib import Path

import numpy as np

from sledenv.kernel.records import REBOUND, TRAJECTORY

_LITTLE = 1 << 26  # bytes that every machine has


def new_log(max_rebounds: int) -> np.ndarray:
    """Return a log without a rebound yet, shape (max_rebounds,), or raise MemoryError."""
    check_room(max_rebounds * REBOUND.itemsize, f"max_rebounds = {max_rebounds}: as many records", "lower it")
    return np.zeros(max_rebounds, REBOUND)


def new_logs(lanes: int, max_rebounds: int) -> np.ndarray:
    """Return as many logs as lanes, shape (lanes, max_rebounds), or raise MemoryError."""
    what = f"keep_rebounds = True: the logs of {lanes} launches, max_rebounds = {max_rebounds},"
    remedy = "lower max_rebounds or take them block by block, see simulate_blocks"
    check_room(lanes * max_rebounds * REBOUND.itemsize, what, remedy)
    return np.zeros((lanes, max_rebounds), REBOUND)


def new_trajectory(rows: int, sample_interval: float) -> np.ndarray:
    """Return room for so many rows of a trajectory, or raise MemoryError."""
    what = f"sample_interval = {sample_interval!r}: the {rows} rows of this trajectory"
    check_room(rows * TRAJECTORY.itemsize, what, "make it longer")
    return np.zeros(rows, TRAJECTORY)


def available() -> float:
    """Return how much memory [bytes] may be had without swapping; all there is, or inf, where the system is silent."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        return 1024.0 * float(Path("/proc/meminfo").read_text().partition("MemAvailable:")[2].split()[0])
    with contextlib.suppress(AttributeError, OSError, ValueError):
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    return math.inf


def check_room(size: int, what: str, remedy: str) -> None:
    """Raise MemoryError for more bytes than there are; what takes them and what helps become parts of the message."""
    if size > _LITTLE and size > (room := available()):  # looked up where it may matter: that takes a while
        raise MemoryError(f"{what} take {size / 1e9:.3g} GB, and there are {room / 1e9:.3g} GB; {remedy}")
