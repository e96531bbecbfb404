"""Measurements of speed measure what they claim: fair turns, peers that solve the same problem, right tables."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import sledenv
from perf import env, harness, learning, limit, methods, packs, reference, report, trims, versus, workloads
from perf.contact_model import START
from sledenv.agents.curve import validation
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import load_run
from sledenv.kernel.records import REBOUND, RUNNING


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
def test_all_ways_to_step_run_and_a_bare_simulator_is_compared_with_itself() -> None:
    """Oracle: a ratio of a time to itself."""
    rows = env.measure(rounds=1, sizes=(2,))["rows"]
    assert [row["env"] for row in rows] == [kind for kind in env.IDS for _ in range(6)]
    alone = [row for row in rows if row["name"] == row["bare"]]
    assert len(alone) == 4
    assert all(row["of_bare"]["median"] == 1.0 for row in alone)


@pytest.mark.jit_only
def test_foresight_of_no_trim_is_the_descent_alone_and_other_trims_are_felt() -> None:
    """Oracle: launches that are left alone, and rides that are trimmed by hand."""
    problem, alone = Problem("sled_mat", "descent"), Problem("sled_mat")
    trials = problem.trials(problem.contexts("test", 2), "test", 4)
    actions = np.zeros((2, alone.actions))
    earned = np.concatenate([trims.foreseen(problem, trials[[i]], actions[[i]]) for i in range(2)])
    flat = trials.reshape(8, -1)
    launches = problem.task.launches(flat, np.repeat(actions, 4, axis=0))
    assert np.array_equal(earned[:, 0], problem.task.descend_batch(flat, launches).jam.reward)
    rides = problem.task.rides(flat, launches)
    rides.hop(np.zeros(8))
    while (rides.outcomes()["status"] == RUNNING).any():
        rides.hop(problem.task.trims(np.ones(8)))
    assert np.array_equal(earned[:, 1], rides.descents().jam.reward)
    assert np.ptp(earned, axis=1).max() > 0.0


def test_seconds_to_a_goal_are_those_of_the_first_check_that_reaches_it() -> None:
    """Oracle: curves written by hand, of which the third never gets there."""
    curve = pd.DataFrame(
        [(0, 1.0, 0.5), (0, 2.0, 0.8), (0, 3.0, 0.7), (1, 5.0, 0.9), (2, 9.0, 0.79)],
        columns=["seed", "seconds", "mean_reward"],
    )
    seconds = learning.reached(curve, 0.8)
    assert seconds == [2.0, 5.0, None]
    rows = {"a": seconds, "b": seconds[:2], "c": [None]}
    told = [learning.median(agent, {"seconds": rows}) for agent in "abcd"]
    assert told == ["5, 2 of 3", "4", "0 of 1", ""]


@pytest.mark.jit_only
def test_the_best_of_runs_is_near_the_best_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the critic itself, and a search all over the box in the very trials of its curve."""
    monkeypatch.setattr(learning, "DRAWS", 8)
    monkeypatch.setattr(learning, "TRIED", 4)
    name = Path("sled_tilt-launch-spin-critic-s0")
    problem, critic, _ = load_run(name)
    trials = validation(problem)
    alone = problem.judge(critic, trials)[0].jam.reward.mean()
    everywhere = problem.expect(trials[:, np.newaxis], np.tile(np.linspace(-1.0, 1.0, 201)[:, np.newaxis], (128, 1, 1)))
    assert alone - 0.002 < learning.best_mean([name]) < everywhere.max(axis=1).mean() + 0.002


def test_crashes_and_somersaults_of_packs_are_told() -> None:
    """Oracle: the reward, of which a crash has its progress alone; a disc rolls over, a sled does not."""
    exact = Problem("sled_tilt", launch_noise=(0.0, 0.0))
    contexts = exact.contexts("test", 2)
    rewards, crashed = packs.everywhere(exact, contexts)
    assert crashed.any(axis=1).all()
    assert rewards[crashed].max() <= 0.5 < rewards[~crashed].max()
    points = packs.grid(packs.jam_map(exact, contexts[:1], packs.CELLS)[0].launches)
    best = points[rewards.argmax(axis=1)]
    for problem, actions, stays in ((exact, best, True), (Problem("disc"), np.zeros((2, 1)), False)):
        drawn = problem.contexts("test", 2)
        batch = problem.task.descend_batch(drawn, problem.task.launches(drawn, actions), keep_rebounds=True)
        assert packs.upright(batch).tolist() == [stays, stays]


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
