"""Many descents at once: room for their logs, and blocks of lanes, which threads take one after the other."""

from __future__ import annotations

import contextlib
import functools
import math
import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, wait
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

import numpy as np

from sledenv.kernel.contacts import SPACE
from sledenv.kernel.entries import run_lanes
from sledenv.kernel.params import Limits
from sledenv.kernel.records import REBOUND, TRAJECTORY
from sledenv.simulation.rules import checked_count
from sledenv.simulation.scenes import Scenes

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

ALL_HOPS = np.empty((0, 2))  # trims of descents that are followed to their ends
NO_LOGS = np.zeros((0, 0), REBOUND)
_FEWEST, _MOST = 16, 128  # lanes of a block: enough to be worth a call, few enough to heed an interrupt
_BLOCKS = 8  # a thread, at least: the last ones are not left waiting for one
_WORTH_A_THREAD = 64  # lanes that take longer than to wake it
NO_ROWS = np.zeros(0, TRAJECTORY)
_LITTLE = 1 << 26  # bytes that every machine has


def blank(dtype: np.dtype) -> np.ndarray:
    """Return a record of zeros, shape (1,); np.zeros would look at its fields one by one."""
    return np.ndarray(1, dtype, bytearray(dtype.itemsize))


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
        return 1024.0 * float(
            Path("/proc/meminfo").read_text(encoding="utf-8").partition("MemAvailable:")[2].split()[0]
        )
    with contextlib.suppress(AttributeError, OSError, ValueError):
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    return math.inf


def check_room(size: int, what: str, remedy: str) -> None:
    """Raise MemoryError for more bytes than there are; what takes them and what helps become parts of the message."""
    if size > _LITTLE and size > (room := available()):  # looked up where it may matter: that takes a while
        raise MemoryError(f"{what} take {size / 1e9:.3g} GB, and there are {room / 1e9:.3g} GB; {remedy}")


def num_threads() -> int:
    """Threads that a batch may use: ``NUMBA_NUM_THREADS``, which joblib sets for its workers, or else all cores.

    Raises
    ------
    ValueError
        If that variable is not a whole number from 1 on.
    """
    given = os.environ.get("NUMBA_NUM_THREADS")
    if given:
        return checked_count("NUMBA_NUM_THREADS", int(given) if given.isdecimal() else given)  # type: ignore[arg-type]
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def follower(
    rigid: bool,
    limits: Limits,
    scenes: Scenes,
    trims: np.ndarray,
    flights: np.ndarray,
    rebounds: np.ndarray,
    trajectory: np.ndarray = NO_ROWS,
    ended: Event | None = None,
) -> Callable[[int, int], None]:
    """Return what follows the lanes from a first one to a last one, or a hop of each, until ``ended``; for one thread.

    Arguments are those of :func:`sledenv.kernel.batch.descend_lanes`; ``rebounds`` of shape (0, 0) keeps none.
    """
    logs = rebounds if len(rebounds) else np.empty((1, 1), REBOUND)
    space = blank(SPACE)
    run = run_lanes.prepared(int(rigid), limits, *scenes.given, trims, flights, logs, trajectory, space)
    lane = space["lane"]

    def follow(first: int, last: int) -> None:
        lane[0] = first
        while lane[0] < last and not (ended and ended.is_set()):  # an interrupt takes effect between two calls
            run(last)

    return follow


def follow_all(
    rigid: bool,
    limits: Limits,
    scenes: Scenes,
    trims: np.ndarray,
    flights: np.ndarray,
    rebounds: np.ndarray,
    trajectory: np.ndarray = NO_ROWS,
) -> None:
    """Follow all lanes, or a hop of each, in blocks that threads take one after the other: see :func:`follower`.

    A trajectory is that of a single lane.
    """
    lanes = len(flights)
    if lanes <= _FEWEST:
        follower(rigid, limits, scenes, trims, flights, rebounds, trajectory)(0, lanes)
        return
    threads = min(num_threads(), max(1, lanes // _WORTH_A_THREAD))
    size = min(max(lanes // (_BLOCKS * threads), _FEWEST), _MOST)
    starts, ended = deque(range(0, lanes, size)), Event()

    def work() -> None:
        follow = follower(rigid, limits, scenes, trims, flights, rebounds, ended=ended)
        while True:
            try:
                start = starts.popleft()
            except IndexError:  # another thread has taken the last one
                return
            follow(start, min(start + size, lanes))

    _share(work, threads, starts, ended)


def _share(work: Callable[[], None], threads: int, left: deque[Any], ended: Event) -> None:
    """Do some work in this thread and in others, until nothing is left; an error or an interrupt ends it for all."""
    others: list[Future[None]] = []
    try:
        with contextlib.suppress(RuntimeError):  # none is started as Python ends: this thread does all the work then
            others.extend(_pool(os.getpid(), threads - 1).submit(work) for _ in range(threads - 1))
        work()
    except BaseException:
        ended.set()
        raise
    finally:
        left.clear()
        wait(others)
    for other in others:
        other.result()


@functools.cache
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Threads of a process: one that has been forked has none of its parent's."""
    from concurrent.futures import ThreadPoolExecutor  # which cannot be imported as Python ends

    return ThreadPoolExecutor(threads, f"sledenv-{threads}")
