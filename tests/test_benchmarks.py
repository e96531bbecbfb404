"""The benchmarks measure what they claim: fair turns, peers that solve the same problem, tables from the results."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks import harness, methods, reference, report
from benchmarks.contact_model import START


def test_every_competitor_has_one_turn_a_round_and_the_order_rotates(monkeypatch: pytest.MonkeyPatch) -> None:
    turns: list[str] = []
    clock = iter(np.arange(1e4))
    monkeypatch.setattr(harness.time, "perf_counter", lambda: float(next(clock)))
    competitors = [harness.Competitor(name, lambda name=name: turns.append(name), 2.0) for name in "abc"]
    times = harness.interleave(competitors, rounds=3)
    assert "".join(turns[6:]) == "abc" + "bca" + "cab"  # each has run twice before, to compile and to choose repeats
    assert {name: seconds.tolist() for name, seconds in times.items()} == {name: [0.5] * 3 for name in "abc"}


def test_an_interrupted_save_leaves_the_old_result(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    monkeypatch.setattr(harness, "RESULTS", tmp_path)
    harness.save("case", {"rows": [1]})
    with pytest.raises(TypeError):
        harness.save("case", {"rows": object()})
    assert harness.load("case")["rows"] == [1]
    assert harness.load("case")["stamp"]["versions"]["numba"] != "missing"


def test_the_error_of_the_exact_velocities_is_zero_and_a_missing_rebound_counts() -> None:
    assert reference.worst(reference.EXACT, 20) == 0.0
    assert reference.worst(reference.EXACT[:4], 5) == 1.0
    off = reference.EXACT[:5] * (1.0 + 1e-3)
    assert reference.worst(off, 5) == pytest.approx(1e-3)


@pytest.mark.jit_only
def test_an_independent_hybrid_integration_reaches_the_twentieth_rebound() -> None:
    """Oracle: extended precision. DOP853 with events and its own mode choice, settled rolling included."""
    assert reference.worst(methods.dop853(20, 1e-12), 20) < 1e-6


@pytest.mark.jit_only
@pytest.mark.parametrize("method", [methods.rk4, methods.euler])
def test_methods_without_events_converge_to_the_reference(method) -> None:
    """Oracle: extended precision; an error that falls with the step."""
    coarse, fine = (reference.worst(method(START, 5, dt), 5) for dt in (1e-4, 2e-6))
    assert fine < 0.2
    assert fine < 0.2 * coarse


def test_the_performance_page_shows_the_committed_results() -> None:
    """Regenerate with ``python -m benchmarks.report``."""
    text = report.DOCUMENT.read_text()
    assert report.render(text) == text
    for name in report.NAMES:
        assert f"<!-- {name}: begin -->" in text


def test_results_name_machine_versions_commit_and_date() -> None:
    for path in sorted(harness.RESULTS.glob("*.json")):
        stamp = json.loads(path.read_text())["stamp"]
        assert stamp.keys() >= {"date", "commit", "processor", "cores", "load", "python", "versions"}
