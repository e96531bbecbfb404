"""What memory cannot hold is refused before it is simulated, and named."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sledenv import (
    ContactLaw,
    Ride,
    RideBatch,
    Settings,
    Slope,
    State,
    segment,
    simulate,
    simulate_batch,
    simulate_blocks,
)
from sledenv.kernel.records import REBOUND, TRAJECTORY
from sledenv.simulation import lanes as memory

GIVEN = segment(1.0, 0.1, 0.05, 7.5e-3), ContactLaw(1e6, 0.5, 0.1, 1e-3), Slope(0.2, 8.0)
LAUNCH = State(0.0, 0.2, 0.4, 1.0, -1.0, 3.0)
HIGH = State(0.0, 1.0, 0.0)


@pytest.fixture
def little_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let there be 100 MB."""
    monkeypatch.setattr(memory, "available", lambda: 1e8)


@pytest.mark.usefixtures("little_room")
def test_what_does_not_fit_is_named() -> None:
    """Oracle: the message: argument, value, what as many records take, and what there is."""
    log = f"{1e-3 * REBOUND.itemsize:.3g} GB, and there are 0.1 GB; "  # of a million rebounds
    lanes = np.tile(LAUNCH, (1000, 1))
    for run in (simulate, Ride):
        with pytest.raises(MemoryError) as caught:
            run(*GIVEN, LAUNCH, Settings(max_rebounds=10**6))
        assert str(caught.value) == f"max_rebounds = 1000000: as many records take {log}lower it"
    for batch in (simulate_batch, simulate_blocks, RideBatch):
        with pytest.raises(MemoryError) as caught:
            batch(*GIVEN, lanes, keep_rebounds=True)  # type: ignore[operator]
        assert str(caught.value) == (
            f"keep_rebounds = True: the logs of 1000 launches, max_rebounds = 1000, take {log}lower max_rebounds or "
            "take them block by block, see simulate_blocks"
        )


@pytest.mark.usefixtures("little_room")
def test_a_trajectory_that_does_not_fit_is_named() -> None:
    """Oracle: the message, with the number of rows that the flight alone takes: 1.1 times what fits."""
    longest = 0.19  # [s] before the first touch
    interval = longest * TRAJECTORY.itemsize / 1e8 / 1.1
    fits, does_not = (Settings(max_time=longest, sample_interval=step) for step in (1.2 * interval, interval))
    assert len(simulate(*GIVEN, HIGH, fits, record="trajectory").trajectory) > 9e7 / TRAJECTORY.itemsize
    for run in (simulate, lambda *given, **options: Ride(*given, **options).run()):
        with pytest.raises(MemoryError) as caught:
            run(*GIVEN, HIGH, does_not, record="trajectory")
        told = re.fullmatch(
            r"sample_interval = (.*): the (.*) rows of this trajectory take (.*) GB, and there are 0.1 GB; make it .*",
            str(caught.value),
        )
        assert told is not None
        assert float(told[1]) == interval
        assert int(told[2]) * TRAJECTORY.itemsize == pytest.approx(1e9 * float(told[3]), rel=5e-3)
        assert int(told[2]) == pytest.approx(1.1e8 / TRAJECTORY.itemsize, rel=1e-3 if run is simulate else 1.1)


@pytest.mark.usefixtures("little_room")
def test_what_fits_is_simulated() -> None:
    """Oracle: no error, in 100 MB; a log that nobody keeps takes no memory."""
    lanes = np.tile(LAUNCH, (1000, 1))
    assert simulate(*GIVEN, LAUNCH, max_rebounds=int(0.99e8 / REBOUND.itemsize)).status == "finish"
    assert simulate(*GIVEN, LAUNCH, max_time=1e300, record="trajectory").status == "finish"
    assert (simulate_batch(*GIVEN, lanes, Settings(max_rebounds=10**6)).status == "finish").all()
    assert len(list(simulate_blocks(*GIVEN, lanes, block=500))) == 2


def test_nobody_asks_about_little(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the system is not asked, which takes as long as many a descent, for what an ordinary descent needs."""
    monkeypatch.setattr(memory, "available", None)
    assert simulate(*GIVEN, LAUNCH, record="trajectory", max_rebounds=10**5).status == "finish"
    with pytest.raises(TypeError, match="not callable"):
        simulate(*GIVEN, LAUNCH, max_rebounds=10**6)


@pytest.mark.skipif(not hasattr(os, "sysconf"), reason="the system does not tell")
def test_available_memory_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: some of what the machine has; all of it without /proc, and inf where nothing is told."""
    everything = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert 0.0 < memory.available() <= everything
    if sys.platform == "linux":
        assert memory.available() != everything

    def unknown(*_: Any) -> Any:
        raise OSError

    for unreadable in (unknown, lambda _: "", lambda _: "MemAvailable: many kB"):
        monkeypatch.setattr(Path, "read_text", unreadable)
        assert memory.available() == everything
    monkeypatch.setattr(os, "sysconf", unknown)
    assert memory.available() == np.inf
