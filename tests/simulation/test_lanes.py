"""Batches are shared between threads: whoever calls, however many there are, the bits and the errors are the same."""

from __future__ import annotations

import multiprocessing
import sys
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

from sledenv import ContactLaw, Settings, Slope, segment, simulate_batch
from sledenv.kernel.records import OUTCOME
from sledenv.machine.workers import runner
from sledenv.simulation import lanes
from sledenv.simulation.scene import laid
from tests.bodies import same_bits

LANES = 300
BODY = segment(1.0, 0.1, 0.05, 7.5e-3)
LAW = ContactLaw(1e6, 0.5, 0.1, 1e-3)


def descended(*_: int) -> np.ndarray:
    """Outcomes of a batch whose lanes end at different times."""
    launches = np.tile([0.0, 0.2, 0.4, 1.0, -1.0, 3.0], (LANES, 1))
    launches[:, 5] += np.linspace(-2.0, 2.0, LANES)
    return simulate_batch(BODY, LAW, Slope(0.2, 8.0), launches, Settings("rigid")).outcomes


@pytest.fixture(params=["1", "2"])
def threads(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """Threads that every batch of a test uses, in processes that it starts too."""
    monkeypatch.setenv("NUMBA_NUM_THREADS", request.param)
    return int(request.param)


@pytest.fixture(scope="module")
def alone() -> np.ndarray:
    """Outcomes on one thread."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NUMBA_NUM_THREADS", "1")
        return descended()


def in_threads() -> list[np.ndarray]:
    with ThreadPoolExecutor(3) as pool:
        return list(pool.map(descended, range(6)))


def in_processes(start: str) -> Callable[[], list[np.ndarray]]:
    def run() -> list[np.ndarray]:
        with ProcessPoolExecutor(2, multiprocessing.get_context(start)) as pool:
            return list(pool.map(descended, range(3)))

    return run


def by_joblib() -> list[np.ndarray]:
    return list(runner(2)([(descended, (i,)) for i in range(3)]))


CALLERS: dict[str, Callable[[], list[np.ndarray]]] = {
    "threads": in_threads,
    "spawned": in_processes("spawn"),
    "joblib": by_joblib,
}
if sys.platform == "linux":
    CALLERS["forked"] = in_processes("fork")


@pytest.mark.filterwarnings("ignore:.*use of fork:DeprecationWarning")  # Python's own, of any process with threads
@pytest.mark.parametrize("caller", CALLERS)
def test_whoever_calls_gets_the_same_bits(caller: str, threads: int, alone: np.ndarray) -> None:
    """Oracle: a batch on one thread of this process; its threads have run before a process is forked."""
    same_bits(descended(), alone)
    for found in CALLERS[caller]():
        same_bits(found, alone)


def follow_each(patch: pytest.MonkeyPatch, run: Callable[[int, int], None]) -> None:
    """Do something else with each block of lanes than to follow it."""
    patch.setattr(lanes, "follower", lambda *given, **named: run)


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt])
def test_what_ends_a_thread_reaches_the_caller_and_leaves_the_rest(
    error: type[BaseException], threads: int, monkeypatch: pytest.MonkeyPatch, alone: np.ndarray
) -> None:
    """Oracle: the error, after as many blocks as there are threads; the next batch is a whole one."""
    blocks: list[int] = []

    def fail(start: int, end: int) -> None:
        blocks.append(start)
        raise error

    with monkeypatch.context() as patch:
        follow_each(patch, fail)
        with pytest.raises(error):
            descended()
    assert 1 <= len(blocks) <= threads
    same_bits(descended(), alone)


def test_an_error_of_another_thread_alone_reaches_the_caller() -> None:
    """Oracle: the error; this thread itself has ended its share."""
    here = threading.get_ident()
    failed = threading.Event()

    def work() -> None:
        if threading.get_ident() == here:
            failed.wait()
            return
        failed.set()
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        lanes._share(work, 2, deque(), threading.Event())


def test_an_interrupt_of_this_thread_ends_the_others_in_the_middle_of_a_block() -> None:
    """Oracle: the other thread, which works until it is told to end."""
    here, ended = threading.get_ident(), threading.Event()
    working = threading.Event()

    def work() -> None:
        if threading.get_ident() == here:
            working.wait()
            raise KeyboardInterrupt
        working.set()
        ended.wait()

    with pytest.raises(KeyboardInterrupt):
        lanes._share(work, 2, deque(), ended)
    flights = np.zeros(4, OUTCOME)
    tables = lanes.Tables(0, Settings().limits, BODY.record, *np.zeros((3, 1, 6)), laid(np.empty((0, 2))))
    lanes.follower(tables, lanes.ALL_HOPS, flights, lanes.NO_LOGS, ended=ended)(0, 4)
    assert not flights["status"].any()  # all still running


@pytest.mark.parametrize("count", [1, 16, 17, 127, 128, 129, 5000])
def test_every_lane_is_followed_once(count: int, threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the lanes in order, for numbers of them around the limits of a block and of a thread."""
    taken: list[int] = []
    follow_each(monkeypatch, lambda start, end: taken.extend(range(start, end)))
    tables = lanes.Tables(0, Settings().limits, BODY.record, *np.zeros((3, 1, 6)), laid(np.empty((0, 2))))
    lanes.follow_all(tables, lanes.ALL_HOPS, np.zeros(count, OUTCOME), lanes.NO_LOGS)
    assert sorted(taken) == list(range(count))


def test_the_number_of_threads_is_a_whole_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the message; without the variable there is a thread a core at most."""
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    assert lanes.num_threads() >= 1
    monkeypatch.setenv("NUMBA_NUM_THREADS", "3")
    assert lanes.num_threads() == 3
    for wrong in ("0", "-1", "two", "1.5"):
        monkeypatch.setenv("NUMBA_NUM_THREADS", wrong)
        with pytest.raises((ValueError, TypeError), match="NUMBA_NUM_THREADS"):
            lanes.num_threads()
