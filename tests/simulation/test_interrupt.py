"""Long simulations can be interrupted: a call of the kernel does a bounded amount of work, and the next goes on."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sledenv import ContactLaw, Ride, Settings, Slope, State, circular_segment, segment, simulate, simulate_batch
from sledenv.kernel.records import Feature
from sledenv.simulation import lanes as lanes_module
from sledenv.simulation import settings as settings_module
from sledenv.simulation.outcomes import Descent
from tests.bodies import same_bits

DISC = segment(1.0, 0.1, 0.05, 7.5e-3)
SEGMENT = circular_segment(100.0, 0.5, math.radians(100.0))
LAW = ContactLaw(1e6, 0.5, 0.1, 1e-3)
INCLINE = Slope(math.radians(10.0), 8.0)
LAUNCH = State(0.0, 0.2, 0.4, 1.0, -1.0, 3.0)
SPINNING = segment(1.0, 1e5, 1e5, 3e-3, 1e-6)  # nearly a line of .2 m

# Bounces and rolling; both corners, bouncing and sliding; searches for the touchdown of thousands of steps: the body
# spins in reach of the slope, and the curvature of its gap is bounded by the far centre of its arc.
CASES: dict[str, tuple[Any, ...]] = {
    "bounces": (DISC, LAW, INCLINE, LAUNCH),
    "chord": (SEGMENT, ContactLaw(1e7, 0.3, 0.05, 1e-3), Slope(0.05, 5.0), State(0, 0.8, math.pi - 0.05, 1, -1, 0.1)),
    "search": (SPINNING, LAW, Slope(0.0, 1.0, 0.0), State(0.0, 0.0999, 0.0, 2.0, -5e-4, 500.0)),
}
OPTIONS: dict[str, dict[str, Any]] = {
    "compliant": {"solver": "compliant"},
    "rigid": {"solver": "rigid"},
}


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


# Each solver with each case, and with rows of a trajectory in every other pair.
@pytest.mark.parametrize(
    ("solver", "name", "record"),
    [
        (solver, name, {"record": "trajectory", "sample_interval": 2e-3} if (i + k) % 2 else {})
        for i, solver in enumerate(OPTIONS)
        for k, name in enumerate(CASES)
    ],
)
def test_a_descent_in_many_calls_is_that_in_one(
    solver: str, name: str, record: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the same descent in one call, bit for bit; a call ends with the hop in which it has done its share."""
    options = OPTIONS[solver] | record
    set_work(monkeypatch, 1e18)
    whole = simulate(*CASES[name], **options)
    calls = counted(monkeypatch)
    for work in (1.0, 30.0):
        set_work(monkeypatch, work)
        calls.clear()
        same(simulate(*CASES[name], **options), whole)
        assert len(calls) > 1 or work > 1.0


def test_the_cases_do_what_they_are_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: rebounds, both corners, and calls without a step of a contact."""
    descents = {name: simulate(*case) for name, case in CASES.items()}
    assert len(descents["bounces"].rebounds) > 5
    assert (descents["chord"].rebounds["feature"] == Feature.CHORD).any()
    set_work(monkeypatch, 1.0)
    calls = counted(monkeypatch)
    simulate(*CASES["search"])
    assert sum(steps == 0 for steps, _ in calls) > 2


def test_rows_without_room_are_counted_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: a descent of 1e12 rows is counted in as many calls as one of a few; their number is out of all reach."""
    calls = counted(monkeypatch)
    for interval in (1e-9, 1e-12):
        calls.clear()
        with pytest.raises(MemoryError, match=rf"sample_interval = {interval}: the \d+ rows of this trajectory take"):
            simulate(DISC, LAW, INCLINE, LAUNCH, record="trajectory", sample_interval=interval)
        assert len(calls) <= 2


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


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
def test_a_batch_in_many_calls_is_that_in_one(solver: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the batch in one call, bit for bit, with its logs; a call does not end it."""
    launches = np.tile(LAUNCH, (40, 1))
    launches[:, 5] += np.linspace(-1.0, 1.0, 40)
    settings = Settings(solver, max_rebounds=12)
    set_work(monkeypatch, 1e18)
    whole = simulate_batch(DISC, LAW, INCLINE, launches, settings, keep_rebounds=True)
    calls = counted(monkeypatch)
    for work in (1.0, 100.0):  # of a block of lanes
        set_work(monkeypatch, work)
        calls.clear()
        batch = simulate_batch(DISC, LAW, INCLINE, launches, settings, keep_rebounds=True)
        same_bits(batch.outcomes, whole.outcomes)
        same_bits(batch.rebounds, whole.rebounds)
        assert len(calls) > 4


ENDLESS = {
    "euler": "sledenv.reproduce.euler_descent(*given, step=1e-12)",
    "rigid": "sledenv.simulate(*given, solver='rigid', max_rebounds=10**5, max_time=1e9)",
}


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGINT for one process")
@pytest.mark.parametrize("name", ENDLESS)
def test_ctrl_c_ends_a_simulation_that_would_take_hours(name: str) -> None:
    """Oracle: KeyboardInterrupt, in a process that gets SIGINT while it simulates."""
    program = f"""
    import signal, sledenv.reproduce
    from sledenv.reproduce import euler
    from sledenv.simulation import lanes, settings

    calls = []

    def count():
        calls.append(None)
        if len(calls) == 3:
            print("simulating", flush=True)
        if len(calls) > 10_000:
            raise SystemExit("nobody has interrupted this")

    class Counted:
        def __init__(self, entry):
            self.entry = entry

        def prepared(self, *arguments):
            run = self.entry.prepared(*arguments)

            def counted(*numbers):
                count()
                run(*numbers)
            return counted

    def counted_steps(*arguments, follow=euler._follow):
        count()
        follow(*arguments)

    signal.signal(signal.SIGINT, signal.default_int_handler)
    settings.WORK, euler._STEPS, euler._follow = 1e4, 10**5, counted_steps
    lanes.run_lanes = Counted(lanes.run_lanes)
    body, law = sledenv.segment(1.0, 0.1, 0.0, 5e-3), sledenv.ContactLaw(1e6, 0.0, 0.0, 0.0)
    given = body, law, sledenv.Slope(0.0), sledenv.State(0.0, 0.2, 0.0)
    try:
        while True:
            {ENDLESS[name]}
    except KeyboardInterrupt:
        print("interrupted", flush=True)
    """
    command = [sys.executable, "-c", textwrap.dedent(program)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            assert process.stdout.readline() == "simulating\n"
            process.send_signal(signal.SIGINT)
            told, _ = process.communicate(timeout=600.0)
        finally:
            process.kill()
    assert told == "interrupted\n"
    assert process.returncode == 0
