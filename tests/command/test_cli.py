"""The command: what it prints and writes, how it refuses, and what an interrupt leaves behind."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from sledenv.command.cli import main
from sledenv.command.simulation import PICTURES
from sledenv.scenarios import load_track, track_names
from sledenv.scenarios.scenario import load_scenario, scenario_names
from sledenv.simulation.sensitivity import sensitivity
from sledenv.simulation.settings import Settings
from sledenv.simulation.simulate import simulate
from tests.browser import data_of
from tests.own_scenarios import own_scenario


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Message of a command that must end with status 2 and print nothing but this line."""
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    return err


def test_simulate_prints_the_descent(capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the worked example, docs/physics.md, section 2.2."""
    assert main(["simulate", "paper_impact"]) == 0
    out = capsys.readouterr().out
    assert "paper_impact, seed 0, solver compliant" in out
    assert "0.00 ->  1.49 -10.00 ->  4.93    0.00 -> -38.41  1.00" in out
    assert "status     timeout after 0.0400 s" in out
    assert "jam index" in out
    ledger = dict(line.split() for line in out.splitlines() if line.startswith("  ") and len(line.split()) == 2)
    assert ledger["kinetic"] == "18.806301"
    assert ledger["hysteresis"] == "29.862748"
    assert abs(float(ledger["residual"])) < 1e-12
    assert max(map(len, out.splitlines())) <= 120


def test_simulate_says_that_its_metrics_are_those_at_the_line(capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: a descent that goes on behind the line, where it was fast, and one that does not come as far."""
    assert main(["simulate", "sled_snow", "--seed", "3"]) == 0
    scenario = load_scenario("sled_snow")
    (jam,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("jam "))
    context = scenario.sample(np.random.default_rng(3))
    descent = simulate(*scenario.given(context), scenario.settings())
    assert descent.at_line is not None
    assert jam.endswith(f", all at the finish, after {descent.at_line[0]:.4f} s")
    assert descent.at_line[0] < descent.time
    assert main(["simulate", "paper_impact"]) == 0
    assert "at the line" not in capsys.readouterr().out


def test_simulate_tells_the_descent_to_a_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the same descent, simulated here; words for its codes, no number that JSON does not have."""
    file = tmp_path / "ride.csv"
    assert (
        main(["simulate", own_scenario("bowl_snow"), "--seed", "3", "--spin", "-0.5", "--csv", str(file), "--json"])
        == 0
    )
    found = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    scenario = load_scenario(own_scenario("bowl_snow"))
    context = scenario.sample(np.random.default_rng(3))
    given = scenario.given(context, spin=-0.5)
    descent = simulate(*given, end_on_chord=True, max_time=scenario.limits.max_time_s)
    assert (found["scenario"], found["seed"], found["solver"]) == ("bowl_snow", 3, "compliant")
    assert found["launch"] == given.launch._asdict()
    assert found["law"]["restitution"] == given.law.restitution
    assert (found["status"], found["time"], found["state"]) == (descent.status, descent.time, descent.state._asdict())
    assert found["jam"]["reward"] == descent.jam.reward
    assert found["energy"]["residual"] == descent.energy.residual
    assert [row["u_after"] for row in found["rebounds"]] == descent.rebounds["u_after"].tolist()
    assert [row["grip"] for row in found["rebounds"]] == descent.rebound_jam.grip.tolist()
    assert {row["feature"] for row in found["rebounds"]} <= {"arc", "nose", "tail"}
    assert found["written"] == [str(file)]


def test_simulate_prints_all_that_it_simulates(capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: configs/scenarios/brake_mat.yaml, and h = 2 r sin^3(alpha)/(3 D) of its segment."""
    assert main(["simulate", own_scenario("brake_mat")]) == 0
    out = capsys.readouterr().out
    assert "mass 100 kg, radius 0.5 m, eccentricity 0.1234 m, inertia 9.922 kg m^2, half-angle 110 deg" in out
    assert "stiffness 10 MN/m, restitution 0.500" in out
    assert "rolling arm 0.005 m (0 m at a corner)" in out
    assert "length 10 m, gravity 9.81 m/s^2" in out


def test_simulate_writes_the_trajectory(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the worked example, 1 kg at 10 m/s; the column of the normal force sums to the change of momentum."""
    file = tmp_path / "fall.csv"
    assert main(["simulate", "paper_impact", "--csv", str(file)]) == 0
    out = capsys.readouterr().out
    with file.open(encoding="utf-8", newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert f"wrote {len(rows)} rows into {file}" in out
    assert f"columns {', '.join(rows[0])}" in out
    assert [float(rows[0][name]) for name in ("t_s", "y_m", "v_m_s", "normal_n")] == pytest.approx([0, 0.07, -10, 0])
    assert {row["feature"] for row in rows} == {"none", "arc"}
    t, normal = ([float(row[name]) for row in rows] for name in ("t_s", "normal_n"))
    assert np.trapezoid(normal, t) == pytest.approx(10.0 + float(rows[-1]["v_m_s"]), rel=0.01)


def test_sensitivity_prints_derivatives_and_draws_growth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: sensitivity of the same descent, which finishes where the slope is long."""
    file = tmp_path / "growth.png"
    arguments = ["sensitivity", own_scenario("bowl_snow"), "--seed", "3", "--rebounds", "2", "--out", str(file)]
    assert main(arguments) == 0
    out = capsys.readouterr().out
    assert "bowl_snow, seed 3, solver compliant" in out
    assert file.read_bytes().startswith(b"\x89PNG")
    rows = {line.split()[0]: line.split() for line in out.splitlines() if line}
    scenario = load_scenario(own_scenario("bowl_snow"))
    context = scenario.sample(np.random.default_rng(3))
    given = scenario.given(context)
    found = sensitivity(*given, Settings(end_on_chord=True), rebounds=2)
    assert rows["length"][4] == "1"  # x at the end
    assert rows["friction"][6] == f"{found.of_end('reward', 'friction'):.4g}"
    assert rows["corner_rolling_arm"][2] == ">"
    assert rows["2"][3] == f"{found.growth[1, 0]:.4g}"
    assert max(map(len, out.splitlines())) <= 120
    assert main([*arguments, "--json"]) == 0
    told = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert told["parameters"]["friction"]["derivatives"]["reward"] == found.of_end("reward", "friction")
    assert told["parameters"]["corner_rolling_arm"]["side"] == 1
    assert told["growth"] == found.growth[:, 0].tolist()
    assert told["written"] == [str(file)]


def test_scenarios_are_listed_with_what_they_ask(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenarios"]) == 0
    header, *lines = capsys.readouterr().out.splitlines()
    assert header.split() == ["name", "agent", "chooses", "solver", "what", "is", "asked"]
    assert [line.split()[0] for line in lines] == list(scenario_names())
    assert all(len(line) <= 120 and len(line) > header.index("what") for line in lines)
    assert next(line for line in lines if line.startswith("sled_mat")).split()[1:3] == ["spin", "compliant"]
    assert main(["scenarios", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in rows] == list(scenario_names())
    chosen = {row["name"]: row["agent_chooses"] for row in rows}
    assert chosen["sled_mat"] == ["spin"]
    assert chosen["sled_rollers"] == chosen["boulder_benches"] == ["trim"]  # of a ride nobody chooses the launch


def test_the_launch_can_be_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    chosen = "--seed 3 --orientation-deg -20 --spin 1.5 --solver rigid"
    assert main(["simulate", own_scenario("ice_drop"), *chosen.split()]) == 0
    out = capsys.readouterr().out
    assert "ice_drop, seed 3, solver rigid" in out
    assert "orientation -20.00 deg, spin 1.500 rad/s" in out
    main(["simulate", own_scenario("ice_drop"), "--seed", "4"])
    assert capsys.readouterr().out != out


def test_simulate_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "deep" / "out"
    for _ in range(2):  # the second time it is replaced
        assert main(["simulate", own_scenario("brake_mat"), "--out", str(folder)]) == 0
        assert sorted(path.name for path in folder.iterdir()) == sorted(PICTURES)
        assert all((folder / name).read_bytes().startswith(b"\x89PNG") for name in PICTURES)
        assert "wrote strobe.png and series.png" in capsys.readouterr().out


def test_replay_writes_one_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.html"
    for spin in ("1.5", "2.5"):  # the second time it is replaced
        assert main(["replay", own_scenario("ice_drop"), "--seed", "3", "--spin", spin, "--out", str(page)]) == 0
        assert capsys.readouterr().out == f"replay: wrote {page}\n"
        assert [file.name for file in tmp_path.iterdir()] == ["page.html"]
        text = page.read_text(encoding="utf-8")
        title = load_scenario(own_scenario("ice_drop")).title
        assert f'"title":"{title}, draw 3, compliant surfaces"' in text
        assert f"spin {spin}00 rad/s" in text
    assert main(["replay", own_scenario("ice_drop"), "--out", str(page), "--json"]) == 0
    written = {"scenario": "ice_drop", "seed": 0, "solver": "compliant", "written": [str(page)]}
    assert json.loads(capsys.readouterr().out) == written


def test_a_wrong_replay_is_refused_and_nothing_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.html"
    assert "did you mean 'sled_snow'?" in refused(capsys, "replay", "sled_snw", "--out", str(page))
    for place, message in (
        (tmp_path / "page.yaml", "must end in .html"),
        (tmp_path, "must end in .html"),
        (tmp_path / "a" / "b.html", "there is no folder"),
    ):
        assert message in refused(capsys, "replay", own_scenario("ice_drop"), "--out", str(place))
    assert list(tmp_path.iterdir()) == []


def test_play_writes_one_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the launch that ``sledenv simulate`` prints for the same options."""
    page, which = tmp_path / "page.html", (own_scenario("ice_drop"), "--seed", "3", "--speed", "2.5", "--spin", "-1.5")
    assert main(["play", *which, "--solver", "rigid", "--html", str(page), "--json"]) == 0
    written = {"scenario": "ice_drop", "seed": 3, "solver": "rigid", "written": [str(page)]}
    assert json.loads(capsys.readouterr().out) == written
    assert [file.name for file in tmp_path.iterdir()] == ["page.html"]
    data = data_of(page.read_text(encoding="utf-8"))
    values = json.loads(data["exact"])["contexts"][0]["values"]
    assert data["solver"] == "rigid"
    assert main(["simulate", *which, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [values[name] for name in ("speed", "spin", "orientation")] == [2.5, -1.5, told["launch"]["phi"]]
    assert [values["angle"], values["friction"]] == [told["slope"]["angle"], told["law"]["friction"]]
    assert main(["play", "--html", str(page), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"written": [str(page)]}
    assert data_of(page.read_text(encoding="utf-8"))["title"] == "A sled over bumps"
    assert "are asked for, of no scenario: name one" in refused(capsys, "play", "--seed", "3", "--html", str(page))
    assert "must end in .html" in refused(capsys, "play", "--html", str(tmp_path / "page.yaml"))
    assert "did you mean 'sled_snow'?" in refused(capsys, "play", "sled_snw", "--html", str(page))


def test_play_of_a_ride_writes_a_page_to_ride(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the launch that ``sledenv simulate`` prints for the same options."""
    page, which = tmp_path / "page.html", ("sled_kickers", "--seed", "4", "--speed", "9")
    assert main(["play", *which, "--html", str(page), "--json"]) == 0
    written = {"scenario": "sled_kickers", "seed": 4, "solver": "compliant", "written": [str(page)]}
    assert json.loads(capsys.readouterr().out) == written
    hills = json.loads(data_of(page.read_text(encoding="utf-8"))["exact"])["hills"]
    assert [hill["name"] for hill in hills] == ["draw 4", "draw 5", "draw 6"]
    assert all(len(hill["rides"]) > 1 and all(ride["trims"] for ride in hill["rides"]) for hill in hills)
    assert main(["simulate", *which, "--json"]) == 0
    assert hills[0]["scene"]["launch"] == json.loads(capsys.readouterr().out)["launch"]
    assert "must be compliant" in refused(capsys, "play", *which, "--solver", "rigid", "--html", str(page))
    run = ("--run", "sled_mat-launch-spin-critic-s0", "--html", str(page))
    assert "chooses a launch" in refused(capsys, "play", *which, *run)
    assert "scenario ice_drop has no rider over bumps" in refused(capsys, "play", own_scenario("ice_drop"), *run)
    assert "are asked for, of no scenario: name one" in refused(capsys, "play", *run)


def test_play_on_tracks_writes_a_page_of_twelve(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: titles and vertices of the tracks; the launch that ``sledenv simulate`` prints."""
    page, which = tmp_path / "page.html", ("sled_kickers", "--seed", "4")
    assert main(["play", *which, "--tracks", "--html", str(page), "--json"]) == 0
    capsys.readouterr()
    data = data_of(page.read_text(encoding="utf-8"))
    assert data["title"] == "Tracks made by hand"
    hills = json.loads(data["exact"])["hills"]
    tracks = [load_track(name) for name in track_names()]
    assert [hill["name"] for hill in hills] == [track.title for track in tracks]
    assert [hill["question"] for hill in hills] == [track.description for track in tracks]
    assert data["question"] == tracks[0].description
    profiles = [[vertex[:2] for vertex in hill["scene"]["slope"]["profile"]] for hill in hills]
    assert profiles == [[list(vertex) for vertex in track.profile_m] for track in tracks]
    assert all(len(hill["rides"]) > 1 for hill in hills)
    assert main(["simulate", *which, "--json"]) == 0
    launch = json.loads(capsys.readouterr().out)["launch"]
    assert all(hill["scene"]["launch"] == launch for hill in hills)
    told = refused(capsys, "play", "sled_mat", "--tracks", "--html", str(page))
    assert "--tracks: scenario sled_mat has no rider over bumps" in told
    assert "are asked for, of no scenario: name one" in refused(capsys, "play", "--tracks", "--html", str(page))


def test_wrong_arguments_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "did you mean 'sled_snow'?" in refused(capsys, "simulate", "sled_snw")
    assert "error: --seed: must be an integer >= 0: '-1'" in refused(
        capsys, "simulate", own_scenario("ice_drop"), "--seed", "-1"
    )
    assert "--spin: must be a finite number in [-1e+06, 1e+06] rad/s: 'inf'" in refused(
        capsys, "simulate", own_scenario("ice_drop"), "--spin", "inf"
    )
    bad = "--orientation-deg: must be a finite number in [-360, 360] deg: "
    for value in ("up", "-360.1"):
        assert f"{bad}{value!r}" in refused(capsys, "simulate", own_scenario("ice_drop"), f"--orientation-deg={value}")
    assert "must end in .png" in refused(capsys, "sensitivity", "paper_impact", "--out", str(tmp_path / "growth.pdf"))
    for command in ("simulate", "sensitivity", "replay", "play"):
        assert 'Invalid value "euler" for --solver. Choose from: "compliant", "rigid".' in refused(
            capsys, command, own_scenario("ice_drop"), "--solver", "euler"
        )
    assert refused(capsys, "simulate") == "sledenv simulate: error: SCENARIO is required\n"
    unknown = refused(capsys, "identify", "x.csv", "--gyraton-radius", "3")
    assert unknown.endswith("Unknown option: --gyraton-radius. Did you mean --gyration-radius?\n")
    assert refused(capsys, "simulate", "sled_snow", "--seed") == "sledenv simulate: error: --seed needs a value\n"
    assert "sledenv: error: a command is needed" in refused(capsys)
    assert 'sledenv: error: Unknown command "solve"' in refused(capsys, "solve")
    assert "Unused Tokens: ['snow']" in refused(capsys, "simulate", own_scenario("ice_drop"), "snow")
    assert "Unknown option: --ori. Did you mean" in refused(capsys, "simulate", own_scenario("ice_drop"), "--ori", "3")
    (tmp_path / "broken.yaml").write_text("id: [")
    assert "broken.yaml: cannot be read" in refused(capsys, "simulate", str(tmp_path / "broken.yaml"))


def test_places_that_are_taken_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    assert "sledenv reproduce: error: " in refused(capsys, "reproduce", "--out", str(tmp_path))
    assert "thesis.tex is a file" in refused(capsys, "reproduce", "--out", str(tmp_path / "thesis.tex"))
    assert "holds 'thesis.tex'" in refused(capsys, "simulate", "paper_impact", "--out", str(tmp_path))
    assert "--csv: " in refused(capsys, "simulate", "paper_impact", "--csv", str(tmp_path / "thesis.tex"))
    assert "must end in .csv" in refused(capsys, "simulate", "paper_impact", "--csv", str(tmp_path / "thesis.tex"))
    assert "there is no folder" in refused(capsys, "simulate", "paper_impact", "--csv", str(tmp_path / "a" / "b.csv"))
    both = "--out", str(tmp_path / "out"), "--csv", str(tmp_path / "out" / "fall.csv")
    assert "must lie outside" in refused(capsys, "simulate", "paper_impact", *both)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.skipif(os.name != "posix" or not Path("/proc").is_dir(), reason="needs a folder that nobody can write to")
def test_a_place_that_cannot_be_written_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert "/proc/out cannot be written" in refused(capsys, "reproduce", "--out", "/proc/out")


@pytest.mark.slow
@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_killed_run_leaves_nothing(
    tmp_path: Path, request: pytest.FixtureRequest, number: signal.Signals, status: int
) -> None:
    request.addfinalizer(partial(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT)))
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background may ignore it
    command = [sys.executable, "-m", "sledenv", "reproduce", "--out", str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert "figures 2 and 4" in process.stderr.readline()
        assert "7-10" in process.stderr.readline()
        assert list(tmp_path.iterdir()) != []
        process.send_signal(number)
        assert process.wait(30) == status
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_reproduce_tells_where_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", "--json", "--out", str(tmp_path / "out")]) == 0
    out, err = capsys.readouterr()
    lines, found = err.splitlines(), json.loads(out)
    steps = "Equation", "Figures 7", "Figures 11", "Table 1", "Modes", "Convergence", "Jamming", "A sled", "Table of"
    assert len(lines) == len(steps)
    assert all(line.startswith(f"reproduce: {step}") for line, step in zip(lines, steps, strict=True))
    assert found["written"] == [str(tmp_path / "out" / "index.md")]
    table = list(csv.DictReader((tmp_path / "out" / "table.csv").read_text(encoding="utf-8").splitlines()))
    assert found["numbers"] == table
    assert len(table) > 20


# --- map and benchmark ------------------------------------------------------------------------------------------------


def test_a_map_of_three_choices_tells_a_launch_that_can_be_simulated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the launch that is told earns its reward when it is simulated."""
    content = load_scenario(own_scenario("boulders")).model_dump(mode="json", by_alias=True)
    content["control"] |= {"speed_m_s": [2, 8], "chosen": "all", "noise_orientation_deg": 0, "noise_spin_rad_s": 0}
    file, picture = tmp_path / "pushed.yaml", tmp_path / "map.png"
    file.write_text(json.dumps(content))  # JSON is YAML
    assert main(["map", str(file), "--out", str(picture), "--json"]) == 0
    assert picture.read_bytes()[:4] == b"\x89PNG"
    out, err = capsys.readouterr()
    where = "map: boulders, context of seed 0"
    assert err.splitlines() == [f"{where}: searching the best launch", f"{where}: drawing the map of all launches"]
    found = json.loads(out, parse_constant=pytest.fail)
    (context,) = found["contexts"]
    assert (context["seed"], context["agents"], found["written"]) == (0, [], [str(picture)])
    values = context["best"]["launch"]
    assert list(values) == ["orientation [deg]", "spin [rad/s]", "speed [m/s]"]
    options = "--orientation-deg", "--spin", "--speed"
    launch = [f"{option}={value}" for option, value in zip(options, values.values(), strict=True)]
    assert main(["simulate", str(file), *launch]) == 0
    told = capsys.readouterr().out.partition("reward ")[2].split(",")[0]
    assert float(told) == pytest.approx(context["best"]["reward"], abs=1e-4)


def test_a_map_that_cannot_be_made_is_explained(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "no finished run" in refused(
        capsys, "map", own_scenario("ice_drop"), "--run", str(tmp_path), "--out", "map.png"
    )
    assert "must end in .png" in refused(capsys, "map", own_scenario("ice_drop"), "--out", str(tmp_path / "map.pdf"))


def call_of_a_suite(folder: Path) -> list[str]:
    agents = "{launch: {sledenv.agents.zero: 1, sledenv.agents.random_launch: 1, sledenv.agents.best_fixed: 1}}"
    suite = folder / "two.yaml"
    suite.write_text(f"{{id: two, title: Two, contexts: 3, settings: ., scenarios: [sled_mat], agents: {agents}}}")
    (folder / "best_fixed.yaml").write_text("sledenv/SledLaunch-v0: {n_timesteps: 60, contexts: 3}")
    return ["benchmark", "--suite", str(suite), "--out", str(folder / "out"), "--workers", "1"]


def test_benchmark_tells_what_it_is_about_to_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*given: object, **named: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("sledenv.benchmark.runner.run_suite", interrupted)
    assert main(call_of_a_suite(tmp_path)) == 130
    assert capsys.readouterr() == (
        "",
        "benchmark: suite two, Two: 3 jobs (3 agents with their seeds, scenarios: 1), each judged in 3 contexts; "
        f"results go to {tmp_path / 'out'}\n"
        "sledenv benchmark: interrupted; the same command goes on where it was\n",
    )


@pytest.mark.slow
def test_benchmark_runs_a_suite_and_writes_its_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the page names the agents; a second call finds everything done."""
    call = call_of_a_suite(tmp_path)
    assert main(call) == 0
    page = tmp_path / "out" / "report" / "index.html"
    assert "best fixed" in page.read_text()
    *shown, last = capsys.readouterr().out.splitlines()
    assert last == f"benchmark: wrote {page}"
    assert sorted(row.split("  ")[1].strip() for row in shown[1:]) == ["best fixed", "random launch", "zero"]
    first = page.read_bytes()
    assert main([*call, "--json"]) == 0
    assert page.read_bytes() == first
    found = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert (found["suite"], found["written"]) == ("two", [str(page)])
    assert {row["agent"] for row in found["scores"]} == {"zero", "random_launch", "best_fixed"}
    assert all(0.0 <= row["reward"] <= 1.0 for row in found["scores"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--suite", "smoek"], "unknown suite 'smoek' (did you mean 'smoke'?)"),
        (["--workers", "0"], "must be an integer >= 1: '0'"),
    ],
)
def test_a_benchmark_that_cannot_be_run_is_explained(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert message in refused(capsys, "benchmark", *arguments)
