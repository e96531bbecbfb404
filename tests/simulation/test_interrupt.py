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

from sledenv import Body, ContactLaw, Ride, Settings, Slope, State, circular_segment, simulate, simulate_batch
from sledenv.kernel.records import Feature
from sledenv.simulation import ride as ride_module
from sledenv.simulation import settings as settings_module
from sledenv.simulation import simulate as simulate_module
from sledenv.simulation.outcomes import Descent
from tests.bodies import same_bits

DISC = Body(1.0, 0.1, 0.05, 7.5e-3)
SEGMENT = circular_segment(100.0, 0.5, math.radians(100.0))
LAW = ContactLaw(1e6, 0.5, 0.1, 1e-3)
INCLINE = Slope(math.radians(10.0), 8.0)
LAUNCH = State(0.0, 0.2, 0.4, 1.0, -1.0, 3.0)
SPINNING = circular_segment(1.0, 0.1, math.radians(60.0))

# Bounces and rolling; both corners, bouncing and sliding; a search for the touchdown of thousands of steps: the body
# spins in reach of the slope, and sinks to it slowly.
CASES: dict[str, tuple[Any, ...]] = {
    "bounces": (DISC, LAW, INCLINE, LAUNCH),
    "chord": (SEGMENT, ContactLaw(1e7, 0.3, 0.05, 1e-3), Slope(0.05, 5.0), State(0, 0.8, math.pi - 0.05, 1, -1, 0.1)),
    "search": (SPINNING, LAW, Slope(0.0, 1.0, 0.0), State(0.0, 0.09, 0.0, 0.2, -5e-4, 500.0)),
}
OPTIONS: dict[str, dict[str, Any]] = {
    "compliant": {"solver": "compliant"},
    "rigid": {"solver": "rigid"},
    "euler": {"solver": "euler", "step": 2e-5, "max_time": 0.5},
}


def same(one: Descent, other: Descent) -> None:
    for rows in ("outcome", "rebounds", "trajectory"):
        same_bits(getattr(one, rows), getattr(other, rows))


def set_work(monkeypatch: pytest.MonkeyPatch, work: float) -> None:
    """Set what one call of the kernel does."""
    monkeypatch.setattr(settings_module, "WORK", work)
    monkeypatch.setattr(settings_module, "EULER_WORK", work)


def counted(monkeypatch: pytest.MonkeyPatch, loop: str) -> list[tuple[int, int]]:
    """Note steps and rows that a descent has come to after each call of the kernel."""
    calls: list[tuple[int, int]] = []
    simulated: Callable[..., Any] = getattr(simulate_module, loop)

    def noted(run: Callable[..., None]) -> Callable[..., None]:
        def note(*arguments: Any) -> None:
            run(*arguments)
            outcomes = arguments[8]
            calls.append((int(outcomes[0]["steps"]), int(outcomes[0]["samples"])))

        return note

    by_law = loop == "run_descent"
    monkeypatch.setattr(simulate_module, loop, (lambda law: noted(simulated(law))) if by_law else noted(simulated))
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
    """Oracle: the same descent in one call, bit for bit; no call does more than its share."""
    options = OPTIONS[solver] | record
    set_work(monkeypatch, 1e18)
    whole = simulate(*CASES[name], **options)
    calls = counted(monkeypatch, "run_euler" if solver == "euler" else "run_descent")
    for work in (1.0, 13.0, 100.0):
        set_work(monkeypatch, work)
        calls.clear()
        same(simulate(*CASES[name], **options), whole)
        steps, rows = np.diff(np.array([(0, 0), *calls]), axis=0).T
        assert steps.max() <= work
        # A row more where two forces meet or the descent ends.
        assert rows.max() <= work + 2
        assert len(calls) > 1


def test_the_cases_do_what_they_are_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: rebounds, both corners, and calls without a step of a contact."""
    descents = {name: simulate(*case) for name, case in CASES.items()}
    assert len(descents["bounces"].rebounds) > 5
    assert (descents["chord"].rebounds["feature"] == Feature.CHORD).any()
    set_work(monkeypatch, 100.0)
    calls = counted(monkeypatch, "run_descent")
    simulate(*CASES["search"])
    assert sum(steps == 0 for steps, _ in calls) > 10


def test_a_flight_and_a_step_of_many_rows_are_written_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: rows in each call, while the descent makes no step; a body that slides at rest takes long steps."""
    set_work(monkeypatch, 1000.0)
    calls = counted(monkeypatch, "run_descent")
    sliding = SEGMENT, ContactLaw(1e7, 0.3, 0.01, 0.0), Slope(0.3, 5.0), State(0.0, SEGMENT.radius, 0.0, 0.0, 0.0)
    flying = DISC, LAW, Slope(0.0, 1.0, 0.0), State(0.0, 1.0, 0.0, 1.0)
    for given in (flying, sliding):
        calls.clear()
        rows = len(simulate(*given, record="trajectory", sample_interval=2e-5).trajectory)
        steps, written = np.diff(np.array(calls), axis=0).T
        assert rows > 10_000
        assert ((steps == 0) & (written == 1000)).sum() > 5


def test_rows_without_room_are_counted_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: a descent of 1e12 rows is counted in as many calls as one of a few; their number is out of all reach."""
    calls = counted(monkeypatch, "run_descent")
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
    descend, calls = ride_module.run_descent, 0

    def interrupted(law: Any) -> Callable[..., None]:
        def run(*arguments: Any) -> None:
            nonlocal calls
            calls += 1
            if calls == 3:
                raise KeyboardInterrupt
            descend(law)(*arguments)

        return run

    with monkeypatch.context() as patch:
        patch.setattr(ride_module, "run_descent", interrupted)
        with pytest.raises(KeyboardInterrupt):
            ride.hop()
    same(ride.descent(), before)
    same(ride.run(), whole)


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
def test_a_batch_in_many_calls_is_that_in_one(solver: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the batch in one call, bit for bit, with its logs; a call does not end it."""
    launches = np.tile(LAUNCH, (200, 1))
    launches[:, 5] += np.linspace(-1.0, 1.0, 200)
    settings = Settings(solver, max_rebounds=12)
    set_work(monkeypatch, 1e18)
    whole = simulate_batch(DISC, LAW, INCLINE, launches, settings, keep_rebounds=True)
    simulated, calls = simulate_module.follow, 0

    def count(*arguments: Any) -> None:
        nonlocal calls
        calls += 1
        simulated(*arguments)

    monkeypatch.setattr(simulate_module, "follow", count)
    for work in (1.0, 7.0, 100.0):  # of a block of lanes
        set_work(monkeypatch, work)
        calls = 0
        batch = simulate_batch(DISC, LAW, INCLINE, launches, settings, keep_rebounds=True)
        same_bits(batch.outcomes, whole.outcomes)
        same_bits(batch.rebounds, whole.rebounds)
        assert calls > 1


ENDLESS = {
    "euler": "solver='euler', step=1e-12",
    "rigid": "solver='rigid', max_rebounds=10**5, max_time=1e9",
}


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGINT for one process")
@pytest.mark.parametrize("name", ENDLESS)
def test_ctrl_c_ends_a_simulation_that_would_take_hours(name: str) -> None:
    """Oracle: KeyboardInterrupt, in a process that gets SIGINT while it simulates."""
    program = f"""
    import signal, sledenv
    from sledenv.simulation import settings, simulate as descent

    calls = []

    def told(loop):
        def run(*arguments):
            calls.append(None)
            if len(calls) == 3:
                print("simulating", flush=True)
            if len(calls) > 10_000:
                raise SystemExit("nobody has interrupted this")
            return loop(*arguments)
        return run

    signal.signal(signal.SIGINT, signal.default_int_handler)
    settings.WORK, settings.EULER_WORK = 1e4, 1e5
    by_law, descent.run_euler = descent.run_descent, told(descent.run_euler)
    descent.run_descent = lambda law: told(by_law(law))
    body, law = sledenv.Body(1.0, 0.1, 0.0, 5e-3), sledenv.ContactLaw(1e6, 0.0, 0.0, 0.0)
    try:
        while True:
            sledenv.simulate(body, law, sledenv.Slope(0.0), sledenv.State(0.0, 0.2, 0.0), {ENDLESS[name]})
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
