"""Room for logs is asked for first. Batches are shared between threads: whoever calls has the same bits and errors."""

from __future__ import annotations

import multiprocessing
import os
import re
import sys
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest

from sledenv import ContactLaw, Ride, Settings, Slope, State, segment, simulate, simulate_batch
from sledenv.kernel.params import SCENE
from sledenv.kernel.records import OUTCOME, REBOUND, TRAJECTORY
from sledenv.machine.workers import runner
from sledenv.simulation import RideBatch, lanes, simulate_blocks
from sledenv.simulation.grounds import plane
from sledenv.simulation.scenes import NO_ZONES, Scenes
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


def pooled(pool: Executor) -> list[np.ndarray]:
    """Outcomes of several batches that a pool simulates."""
    with pool:
        return list(pool.map(descended, range(4)))


CALLERS: dict[str, Callable[[], list[np.ndarray]]] = {
    "threads": lambda: pooled(ThreadPoolExecutor(3)),
    "spawned": lambda: pooled(ProcessPoolExecutor(2, multiprocessing.get_context("spawn"))),
    "joblib": lambda: list(runner(2)([(descended, (i,)) for i in range(3)])),
}
if sys.platform == "linux":
    CALLERS["forked"] = lambda: pooled(ProcessPoolExecutor(2, multiprocessing.get_context("fork")))


@pytest.mark.filterwarnings("ignore:.*use of fork:DeprecationWarning")  # Python's own, of any process with threads
@pytest.mark.parametrize("threads", ["2"], indirect=True)
@pytest.mark.parametrize("caller", CALLERS)
def test_whoever_calls_gets_the_same_bits(caller: str, threads: int, alone: np.ndarray) -> None:
    """Oracle: a batch on one thread of this process; its threads have run before a process is forked."""
    same_bits(descended(), alone)
    for found in CALLERS[caller]():
        same_bits(found, alone)


def blank_scenes(count: int) -> Scenes:
    """Scenes that nobody follows."""
    return Scenes(np.zeros(count, SCENE), BODY.record, plane(), NO_ZONES)


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


def test_an_interrupt_of_this_thread_ends_the_others_in_the_middle_of_a_block() -> None:
    """Oracle: the other thread, which works until it is told to end."""
    here, ended, working = threading.get_ident(), threading.Event(), threading.Event()

    def work() -> None:
        if threading.get_ident() == here:
            working.wait()
            raise KeyboardInterrupt
        working.set()
        ended.wait()

    with pytest.raises(KeyboardInterrupt):
        lanes._share(work, 2, deque(), ended)
    flights, given = np.zeros(4, OUTCOME), (False, Settings().limits, blank_scenes(4))
    lanes.follower(*given, lanes.ALL_HOPS, flights, lanes.NO_LOGS, ended=ended)(0, 4)
    assert not flights["status"].any()  # all still running


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


# Room.

GIVEN = segment(1.0, 0.1, 0.05, 7.5e-3), ContactLaw(1e6, 0.5, 0.1, 1e-3), Slope(0.2, 8.0)
LAUNCH = State(0.0, 0.2, 0.4, 1.0, -1.0, 3.0)
HIGH = State(0.0, 1.0, 0.0)


@pytest.fixture
def little_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let there be 100 MB."""
    monkeypatch.setattr(lanes, "available", lambda: 1e8)


@pytest.mark.usefixtures("little_room")
def test_what_does_not_fit_is_named() -> None:
    """Oracle: the message: argument, value, what as many records take, and what there is."""
    many, billion = np.tile(LAUNCH, (1000, 1)), np.broadcast_to(LAUNCH, (10**9, 6))
    room = f"{1e-3 * REBOUND.itemsize:.3g} GB, and there are 0.1 GB; lower "  # of a million rebounds
    logs = f"keep_rebounds = True: the logs of 1000 launches, max_rebounds = 1000, take {room}max_rebounds or take them"
    for run, words in (
        *((partial(kind, *GIVEN, LAUNCH, Settings(max_rebounds=10**6)), f"take {room}it") for kind in (simulate, Ride)),
        *(
            (partial(kind, *GIVEN, many, keep_rebounds=True), logs)
            for kind in (simulate_batch, simulate_blocks, RideBatch)
        ),
        (partial(simulate_batch, *GIVEN, billion), "launches: their 6000000000 numbers take 48 GB, and there are 0.1"),
        (partial(simulate_batch, *GIVEN, billion[: 10**6]), "launches: the outcomes of 1000000 take "),
    ):
        with pytest.raises(MemoryError, match=re.escape(words)):
            run()


@pytest.mark.usefixtures("little_room")
def test_a_trajectory_that_does_not_fit_is_named() -> None:
    """Oracle: the message, with the number of rows that the flight alone takes: 1.1 times what fits."""
    longest = 0.19  # [s] before the first touch
    interval = longest * TRAJECTORY.itemsize / 1e8 / 1.1
    fits, does_not = (Settings(max_time=longest, sample_interval=step) for step in (1.2 * interval, interval))
    assert len(simulate(*GIVEN, HIGH, fits, record="trajectory").trajectory) > 9e7 / TRAJECTORY.itemsize
    for run in (simulate, lambda *given, **options: Ride(*given, **options).run()):
        with pytest.raises(MemoryError, match=rf"sample_interval = {interval}: the \d+ rows of .*; make it") as caught:
            run(*GIVEN, HIGH, does_not, record="trajectory")
        rows = int(str(caught.value).split()[4])
        assert rows == pytest.approx(1.1e8 / TRAJECTORY.itemsize, rel=1e-3 if run is simulate else 1.1)


def test_available_memory_is_some_of_what_the_machine_has() -> None:
    """Oracle: all that it has; a hundredth of that is free where tests run."""
    everything = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert 0.01 * everything < lanes.available() <= everything
