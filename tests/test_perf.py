"""Measurements of speed measure what they claim: fair turns, peers that solve the same problem, right tables."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from perf import harness, limit, methods, reference, report, versus, workloads
from perf.contact_model import START
from sledenv.kernel.records import REBOUND


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
    """Regenerate with ``python -m perf.report``."""
    text = report.DOCUMENT.read_text()
    assert report.render(text) == text
    for name in report.NAMES:
        assert f"<!-- {name}: begin -->" in text


def test_results_name_machine_versions_commit_and_date() -> None:
    for path in sorted(harness.RESULTS.glob("*.json")):
        stamp = json.loads(path.read_text())["stamp"]
        assert stamp.keys() >= {"date", "commit", "processor", "cores", "load", "python", "versions"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["no-such-commit"], ["'no-such-commit'", "HEAD"]),
        (["HEAD", "--only", "descent", "glide"], ["'glide'", *workloads.WORKLOADS]),
    ],
)
def test_versus_refuses_what_it_does_not_know_in_one_line(arguments: list[str], words: list[str]) -> None:
    with pytest.raises(SystemExit) as refused:
        versus.main(arguments)
    message = str(refused.value.code)
    assert "\n" not in message
    assert all(word in message for word in words)


def test_versus_wants_a_round(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        versus.main(["HEAD", "--rounds", "0"])
    assert "'0' is no number of rounds" in capsys.readouterr().err


def test_versus_leaves_out_what_takes_long_unless_asked() -> None:
    assert "cold" not in versus.chosen(None, False)
    assert versus.chosen(None, True) == list(workloads.WORKLOADS)
    assert versus.chosen(["cold", "env"], False) == ["env", "cold"]


def test_versus_compares_whole_trees(tmp_path: Path) -> None:
    """Oracle: what is reached through the links of the checkout, in a commit and in the working tree."""
    versus.unpack(versus.commit_of("HEAD"), tmp_path / "old")
    versus.copy(tmp_path / "now")
    for tree in (tmp_path / "old", tmp_path / "now"):
        for folder in ("configs/scenarios", "agents/trained"):
            files = {path.name for path in (versus.ROOT / folder).iterdir()}
            assert {path.name for path in (tree / "src" / "sledenv" / folder).iterdir()} == files


def test_versus_takes_ratios_within_a_round() -> None:
    """A moment in which the whole machine is three times slower leaves them as they are."""
    found = versus.row("descent", (320.0, 320.0), [(2e-6, 1e-6), (6e-6, 3e-6), (2.2e-6, 1e-6)])
    assert found["times_faster"]["median"] == pytest.approx(2.0)
    assert found["least_times_faster"] == pytest.approx(2.0)
    assert found["old_s"]["median"] == pytest.approx(2.2e-6)


def test_versus_shows_units_and_says_what_went_wrong() -> None:
    rows = [
        versus.row("descent", (320.0, 320.0), [(2e-6, 1e-6)]),
        versus.row("env", (1024.0, 1000.0), [(2e-5, 2e-5)]),
        {"name": "ppo", "failed": "now: ImportError: gone"},
    ]
    lines = versus.report("0123456789", rows).splitlines()
    assert lines[0].startswith("| workload | 0123456 | now |")
    assert "| 2.00 µs a hop | 1.00 µs a hop | 2.000 |" in lines[2]
    assert "50,000 steps/s" in lines[3]
    assert lines[-2:] == [
        "env is not the same work: 1024 steps in 0123456, 1000 now",
        "ppo has failed: now: ImportError: gone",
    ]


def test_a_timing_is_that_of_a_unit_of_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock that every run puts forward by a second."""
    clock = [0.0]
    monkeypatch.setattr(workloads.time, "perf_counter", lambda: clock[0])

    def run() -> None:
        clock[0] += 1.0

    measure, units = workloads._timed(run, 4.0)
    assert (measure(), units) == (0.25, 4.0)


def test_descents_part_where_a_rebound_differs() -> None:
    rebounds = np.zeros((3, limit.REBOUNDS), REBOUND)
    rebounds["v_before"], rebounds["v_after"] = -2.0, 1.0
    other = rebounds.copy()
    other["v_after"][1, 5] += 1.01 * 2.0 * limit.APART
    other["v_after"][1, 3] += 0.99 * 2.0 * limit.APART
    other["feature"][2, 2] = 1
    assert limit.parted(other, rebounds, 0.5).tolist() == [limit.REBOUNDS, 5, 2]


@pytest.mark.jit_only
def test_stiff_springs_end_as_rigid_surfaces_do() -> None:
    """The figure of docs/physics.md, section 8.3, with few launches; its committed result has all stiffnesses."""
    points = limit.measure(count=200)["points"]
    *compliant, rigid = points
    assert abs(compliant[-1]["status"]["finish"] - rigid["status"]["finish"]) < 0.02
    assert abs(compliant[-1]["more"]["mean"]) < 1e-3
    assert compliant[0]["same"][3] < compliant[-1]["same"][3]
    assert [point["stiffness"] for point in harness.load("limit")["points"]] == [*limit.STIFFNESSES, "rigid"]
