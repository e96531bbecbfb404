"""Long simulations can be interrupted: a call of the kernel does a bounded amount of work, and the next goes on."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sledenv import ContactLaw, Ride, Settings, Slope, State, circular_segment, segment, simulate, simulate_batch
from sledenv.simulation import lanes as lanes_module
from sledenv.simulation import settings as settings_module
from sledenv.simulation.outcomes import Descent
from tests.bodies import same_bits

DISC = segment(1.0, 0.1, 0.05, 7.5e-3)
SEGMENT = circular_segment(100.0, 0.5, math.radians(100.0))
LAW = ContactLaw(1e6, 0.5, 0.1, 1e-3)
INCLINE = Slope(math.radians(10.0), 8.0)
LAUNCH = State(0.0, 0.2, 0.4, 1.0, -1.0, 3.0)
SPINNING = segment(1.0, 1e5, 1e5, 3e-3, 1e-6)  # nearly a line of 0.2 m

# Bounces and rolling; both corners, bouncing and sliding; searches for the touchdown of thousands of steps: the body
# spins in reach of the slope, and the curvature of its gap is bounded by the far centre of its arc.
CASES: dict[str, tuple[Any, ...]] = {
    "bounces": (DISC, LAW, INCLINE, LAUNCH),
    "chord": (SEGMENT, ContactLaw(1e7, 0.3, 0.05, 1e-3), Slope(0.05, 5.0), State(0, 0.8, math.pi - 0.05, 1, -1, 0.1)),
    "search": (SPINNING, LAW, Slope(0.0, 1.0, 0.0), State(0.0, 0.0999, 0.0, 2.0, -5e-4, 500.0)),
}
SOLVERS = ("compliant", "rigid")


def same(one: Descent, other: Descent) -> None:
    for rows in ("outcome", "rebounds", "trajectory"):
        same_bits(getattr(one, rows), getattr(other, rows))


def set_work(monkeypatch: pytest.MonkeyPatch, work: float) -> None:
    """Set what one call of the kernel does."""
    monkeypatch.setattr(settings_module, "WORK", work)


class Noted:
    """An entry of the kernel that notes its calls: steps and rows of the first lane after each."""

    def __init__(self, entry: Any, flights: int, calls: list[tuple[int, int]], most: float) -> None:
        self.entry, self.flights, self.calls, self.most = entry, flights, calls, most

    def prepared(self, *arguments: Any) -> Callable[..., None]:
        run, flight = self.entry.prepared(*arguments), arguments[self.flights]

        def noted(*numbers: int) -> None:
            run(*numbers)
            self.calls.append((int(flight[0]["steps"]), int(flight[0]["samples"])))
            if len(self.calls) == self.most:
                raise KeyboardInterrupt

        return noted


def counted(monkeypatch: pytest.MonkeyPatch, most: float = math.inf) -> list[tuple[int, int]]:
    """Note steps and rows that a descent has come to after each call of the kernel; interrupt so many calls."""
    calls: list[tuple[int, int]] = []
    monkeypatch.setattr(lanes_module, "run_lanes", Noted(lanes_module.run_lanes, 7, calls, most))
    return calls


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", CASES)
def test_a_descent_in_many_calls_is_that_in_one(solver: Any, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the same descent in one call, bit for bit; a call ends with the hop in which it has done its share."""
    settings = Settings(solver, sample_interval=2e-3)
    set_work(monkeypatch, 1e18)
    whole = simulate(*CASES[name], settings, record="trajectory")
    calls = counted(monkeypatch)
    for work in (1.0, 30.0):
        set_work(monkeypatch, work)
        calls.clear()
        same(simulate(*CASES[name], settings, record="trajectory"), whole)
        assert len(calls) > 1 or work > 1.0


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
def test_a_ride_in_many_calls_is_that_in_one(solver: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: simulate; a ride that is interrupted in a hop stands where that began, and goes on as if nothing were."""
    settings = Settings(solver, sample_interval=2e-4)
    whole = simulate(*CASES["chord"], settings, record="trajectory")
    set_work(monkeypatch, 5.0)
    ride = Ride(*CASES["chord"], settings, record="trajectory")
    ride.hop()
    before = ride.descent()
    with monkeypatch.context() as patch:
        counted(patch, most=1)
        with pytest.raises(KeyboardInterrupt):
            ride.hop()
    same(ride.descent(), before)
    same(ride.run(), whole)


def test_a_batch_in_many_calls_is_that_in_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the batch in one call, bit for bit, with its logs; a call does not end it."""
    launches = np.tile(LAUNCH, (40, 1))
    launches[:, 5] += np.linspace(-1.0, 1.0, 40)
    set_work(monkeypatch, 1e18)
    whole = simulate_batch(DISC, LAW, INCLINE, launches, max_rebounds=12, keep_rebounds=True)
    calls = counted(monkeypatch)
    for work in (1.0, 100.0):  # of a block of lanes
        set_work(monkeypatch, work)
        calls.clear()
        batch = simulate_batch(DISC, LAW, INCLINE, launches, max_rebounds=12, keep_rebounds=True)
        same_bits(batch.outcomes, whole.outcomes)
        same_bits(batch.rebounds, whole.rebounds)
        assert len(calls) > 4


PROGRAM = """
import signal, sledenv
from sledenv.simulation import lanes, settings

class Counted:
    calls, entry = 0, lanes.run_lanes

    def prepared(self, *arguments):
        run = self.entry.prepared(*arguments)

        def counted(*numbers):
            Counted.calls += 1
            if Counted.calls == 3:
                print("simulating", flush=True)
            if Counted.calls > 10_000:
                raise SystemExit("nobody has interrupted this")
            run(*numbers)
        return counted

signal.signal(signal.SIGINT, signal.default_int_handler)
settings.WORK, lanes.run_lanes = 1e4, Counted()
body, law = sledenv.segment(1.0, 0.1, 0.0, 5e-3), sledenv.ContactLaw(1e6, 0.0, 0.0, 0.0)
try:
    while True:
        given = body, law, sledenv.Slope(0.0), sledenv.State(0.0, 0.2, 0.0)
        sledenv.simulate(*given, solver="rigid", max_rebounds=10**5, max_time=1e9)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGINT for one process")
def test_ctrl_c_ends_a_simulation_that_would_take_hours() -> None:
    """Oracle: KeyboardInterrupt, in a process that gets SIGINT while it simulates."""
    with subprocess.Popen([sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            assert process.stdout.readline() == "simulating\n"
            process.send_signal(signal.SIGINT)
            told, _ = process.communicate(timeout=600.0)
        finally:
            process.kill()
    assert (told, process.returncode) == ("interrupted\n", 0)
