"""Measurements of speed measure what they claim: fair turns, peers that solve the same problem, right tables."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import sledenv
from perf import env, harness, reference, report, versus, workloads


def test_every_measurement_has_one_turn_a_round_and_the_order_rotates() -> None:
    turns: list[str] = []

    def measure(name: str, values: list[float]) -> float:
        turns.append(name)
        return values.pop(0)

    values = {"a": [1.0, 2.0, 3.0], "b": [4.0, 5.0, 6.0], "c": [7.0, 8.0, 9.0]}
    measures = {name: lambda name=name, left=list(left): measure(name, left) for name, left in values.items()}
    found = harness.take_turns(measures, rounds=3)
    assert "".join(turns) == "abc" + "bca" + "cab"
    assert {name: times.tolist() for name, times in found.items()} == values


def test_a_timing_is_the_least_of_parts_for_a_unit_of_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock that runs put forward by 1 s, or by more: the first run, which compiles, and another one."""
    durations = iter([9.0, 1.0, 1.0, 1.0, 3.0, 1.0, 1.0, 1.0])
    clock = [0.0]
    monkeypatch.setattr(harness.time, "perf_counter", lambda: clock[0])

    def run() -> None:
        clock[0] += next(durations)

    measure = harness.timed(run, units=4.0, part=2.0, total=7.0)  # two runs a part
    assert measure() == 0.25
    assert list(durations) == []


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
        (["HEAD", "--rounds", "0"], ["0 is no number of rounds"]),
    ],
)
def test_versus_refuses_what_it_does_not_know(
    arguments: list[str], words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        versus.main(arguments)
    message = capsys.readouterr().err.splitlines()[-1]
    assert all(word in message for word in words)


def test_versus_leaves_out_what_takes_long_unless_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(versus, "measure", lambda commit, names, rounds: asked.append(list(names)) or [])
    for arguments in (["HEAD"], ["HEAD", "--all"], ["HEAD", "--only", "cold", "env"]):
        versus.main(arguments)
    usual, everything, only = asked
    assert everything == list(workloads.WORKLOADS) == [*usual, "cold"]
    assert only == ["cold", "env"]


@pytest.mark.slow
def test_versus_installs_whole_trees(tmp_path: Path) -> None:
    """Oracle: what the checkout has, in a commit and in the working tree."""
    versus.unpack(versus.commit_of("HEAD"), tmp_path / "old")
    versus.copy(tmp_path / "now")
    for tree in (tmp_path / "old", tmp_path / "now"):
        versus.install(tree)
        package = tmp_path / f"{tree.name}-site" / "sledenv"
        for folder in ("configs/scenarios", "agents/trained"):
            assert {path.name for path in (package / folder).iterdir()} == {
                path.name for path in (harness.ROOT / folder).iterdir()
            }


def test_a_worker_answers_by_units_and_seconds_or_says_what_is_wrong(tmp_path: Path) -> None:
    """In a folder without a loop of its own, as an incomplete tree has it."""
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(Path(sledenv.__file__).parents[1]), str(harness.ROOT)]),
    }
    orders = "prepare simulate\ntime simulate\nprepare descent\ntime descent\n"
    command = [sys.executable, "-P", "-m", "perf.workloads"]
    done = subprocess.run(
        command, input=orders, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    units, seconds, *wrong = map(json.loads, done.stdout.splitlines())
    assert units == reference.FEW
    assert seconds > 0.0
    assert [text.partition(":")[0] for text in wrong] == ["ModuleNotFoundError", "KeyError"]


def test_versus_takes_ratios_within_a_round() -> None:
    """A moment in which the whole machine is three times slower leaves them as they are."""
    rows = [{"name": "descent", "units": [320.0, 320.0], "rounds_s": [[2e-6, 1e-6], [6e-6, 3e-6], [2.2e-6, 1e-6]]}]
    line = versus.report("0123456789", rows).splitlines()[2]
    assert line == "| descent | 2.20 µs a hop | 1.00 µs a hop | 2.000 | 2.000 to 2.100 | 2.000 |"


def test_versus_says_what_went_wrong() -> None:
    rows = [
        {"name": "env", "units": [1024.0, 1000.0], "rounds_s": [[2e-5, 2e-5]]},
        {"name": "ppo", "rounds_s": [], "failed": "now: ImportError: gone"},
    ]
    lines = versus.report("0123456789", rows).splitlines()
    assert lines[0].startswith("| workload | 0123456 | now |")
    assert lines[-2:] == [
        "env is not the same work: 1024 units in 0123456, 1000 now",
        "ppo has failed: now: ImportError: gone",
    ]


@pytest.mark.jit_only
def test_the_descents_of_steps_are_those_of_the_environment() -> None:
    """Oracle: the rewards of the steps."""
    given, fields = workloads.descents_of_episodes()
    batch = sledenv.simulate_batch(*given, **reference.settings(**fields))
    assert batch.jam.reward.tolist() == workloads.episodes()()


@pytest.mark.jit_only
def test_all_ways_to_step_run_and_others_beside_them_where_they_are_installed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: a ratio of a time to itself."""
    monkeypatch.setattr(env, "_PART", 0.01)
    monkeypatch.setattr(env, "PEERS", {"Absent-v0": ("no_such_module", 1, None)})
    rows = env.measure(rounds=1, sizes=(2,), peers=["Absent-v0"])["rows"]
    assert "Absent-v0 is skipped: there is no no_such_module" in capsys.readouterr().out
    assert [row["env"] for row in rows] == ["SledLaunch"] * 8 + ["SledDescent"] * 10
    assert [row["times_make"]["median"] for row in rows if row["name"] == env.MAKE] == [1.0, 1.0]
    assert len([row for row in rows if "motion" in row]) == 3 + 4
    for row in rows:
        if "beyond_us" in row:
            beyond, first = row["beyond_us"]["median"], row["first_us"]["median"]
            assert (first > 0.0) == (row["env"] == "SledDescent")
            assert beyond == pytest.approx(first) if row["name"].startswith(env.BARE) else beyond > first
