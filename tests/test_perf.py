"""Measurements of speed measure what they claim: fair turns, the error of an answer, ratios within a turn."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import sledenv
from perf import env, harness, reference, versus


def test_every_measurement_has_one_turn_per_round_and_the_order_rotates() -> None:
    turns: list[str] = []

    def measure(name: str, values: list[float]) -> float:
        turns.append(name)
        return values.pop(0)

    values = {"a": [1.0, 2.0, 3.0], "b": [4.0, 5.0, 6.0], "c": [7.0, 8.0, 9.0]}
    measures = {name: lambda name=name, left=list(left): measure(name, left) for name, left in values.items()}
    found = harness.take_turns(measures, rounds=3)
    assert "".join(turns) == "abc" + "bca" + "cab"
    assert {name: times.tolist() for name, times in found.items()} == values


def test_a_timing_is_cpu_time_per_unit_of_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: a clock that each run puts forward by 1 s."""
    clock = [0.0]
    monkeypatch.setattr(harness.time, "process_time", lambda: clock[0])

    def run() -> None:
        clock[0] += 1.0

    assert harness.timed(run, units=4.0)() == 0.25


def test_the_error_of_the_exact_velocities_is_zero_and_a_missing_rebound_counts() -> None:
    assert reference.worst(reference.EXACT, 20) == 0.0
    assert reference.worst(reference.EXACT[:4], 5) == 1.0
    assert reference.worst(reference.EXACT[:5] * (1.0 + 1e-3), 5) == pytest.approx(1e-3)


def test_the_performance_page_shows_the_committed_results() -> None:
    """Oracle: the page, rendered anew from perf/results."""
    text = harness.DOCUMENT.read_text()
    assert harness.render(text) == text
    assert all(f"<!-- {file.stem}: begin -->" in text for file in harness.RESULTS.glob("*.json"))


def test_a_worker_answers_by_units_and_seconds_or_says_what_is_wrong() -> None:
    path = os.pathsep.join([str(Path(sledenv.__file__).parents[1]), str(harness.ROOT)])
    done = subprocess.run(
        [sys.executable, "-P", "-m", "perf.workloads"],
        input="simulate\n\nglide\n\n",
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    units, seconds, *wrong = map(json.loads, done.stdout.splitlines())
    assert units == reference.FEW
    assert seconds > 0.0
    assert wrong == ["KeyError: 'glide'", "nothing is prepared"]


def test_versus_takes_ratios_within_a_round() -> None:
    """A moment in which the whole machine is three times slower leaves them as they are."""
    times = {"random": np.array([[2e-6, 1e-6], [6e-6, 3e-6], [2.2e-6, 1e-6]])}
    line = versus.report("0123456", times).splitlines()[2]
    assert line == "| random | 2.20 µs per rebound | 1.00 µs per rebound | 2.000 | 2.000 to 2.100 | 2.000 |"


@pytest.mark.jit_only
@pytest.mark.parametrize("kind", env.IDS)
def test_all_ways_to_step_are_compared_with_gym_make(kind: str) -> None:
    """Oracle: the ratio of a time to itself."""
    rows = env.rows({(kind, how): way for how, way in env.ways(kind, sizes=(2,)).items()}, rounds=1)
    assert len(rows) == 8
    assert {row["how"]: row["times gym.make"]["median"] for row in rows}[env.MAKE] == 1.0
    assert all(row["µs per step"]["median"] > 0.0 for row in rows)
