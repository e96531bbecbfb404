"""The command: what it prints and writes, how it refuses, and what an interrupt leaves behind."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sledenv.command.cli import main
from sledenv.command.simulation import PICTURES
from sledenv.scenarios import load_track, track_names
from sledenv.scenarios.scenario import load_scenario, scenario_names
from sledenv.simulation.sensitivity import sensitivity
from sledenv.simulation.settings import Settings
from sledenv.simulation.simulate import simulate
from sledenv.simulation.words import rounded
from tests.browser import data_of
from tests.own_scenarios import own_scenario


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Message of a command that must end with status 2 and print nothing but this line."""
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    return err


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Standard output of a command that succeeds."""
    assert main(arguments) == 0
    return capsys.readouterr().out


def told(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    """JSON of a command that succeeds: one document, without NaN and Infinity."""
    return json.loads(printed(capsys, *arguments, "--json"), parse_constant=pytest.fail)


BOWL, DROP = own_scenario("bowl_snow"), own_scenario("ice_drop")


def test_simulate_prints_the_descent(capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the worked example, docs/physics.md, section 2.2."""
    out = printed(capsys, "simulate", "paper_impact")
    assert "paper_impact, seed 0, solver compliant" in out
    assert "0.00 ->  1.49 -10.00 ->  4.93    0.00 -> -38.41  1.00" in out
    assert "status     timeout after 0.04000 s" in out
    ledger = dict(line.split() for line in out.splitlines() if line.startswith("  ") and len(line.split()) == 2)
    assert ledger["kinetic"] == "18.81"
    assert ledger["hysteresis"] == "29.86"
    assert abs(float(ledger["residual"])) < 1e-12
    assert max(map(len, out.splitlines())) <= 120
    assert "at the finish" not in out


def test_simulate_says_that_its_metrics_are_those_at_the_finish(capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: a descent that goes on behind the finish, where it was fast."""
    out = printed(capsys, "simulate", "sled_snow", "--seed", "3")
    scenario = load_scenario("sled_snow")
    descent = simulate(*scenario.given(scenario.sample(np.random.default_rng(3))), scenario.settings())
    assert descent.at_line is not None
    assert f", all at the finish, after {rounded(descent.at_line[0])} s\n" in out
    assert descent.at_line[0] < descent.time


def test_simulate_tells_the_descent_to_a_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the same descent, simulated here; words for its codes."""
    file = tmp_path / "ride.csv"
    found = told(capsys, "simulate", BOWL, "--seed", "3", "--spin", "-0.5", "--csv", str(file))
    scenario = load_scenario(BOWL)
    given = scenario.given(scenario.sample(np.random.default_rng(3)), spin=-0.5)
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


def test_simulate_writes_the_trajectory(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the worked example, 1 kg at 10 m/s; the column of the normal force sums to the change of momentum."""
    file = tmp_path / "fall.csv"
    out = printed(capsys, "simulate", "paper_impact", "--csv", str(file))
    rows = list(csv.DictReader(file.read_text(encoding="utf-8").splitlines()))
    assert f"wrote {len(rows)} rows into {file}" in out
    assert f"columns {', '.join(rows[0])}" in out
    assert [float(rows[0][name]) for name in ("t_s", "y_m", "v_m_s", "normal_n")] == pytest.approx([0, 0.07, -10, 0])
    assert {row["feature"] for row in rows} == {"none", "arc"}
    t, normal = ([float(row[name]) for row in rows] for name in ("t_s", "normal_n"))
    assert np.trapezoid(normal, t) == pytest.approx(10.0 + float(rows[-1]["v_m_s"]), rel=0.01)


def test_simulate_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "deep" / "out"
    for _ in range(2):  # the second time it is replaced
        out = printed(capsys, "simulate", own_scenario("brake_mat"), "--out", str(folder))
        assert sorted(path.name for path in folder.iterdir()) == sorted(PICTURES)
        assert all((folder / name).read_bytes().startswith(b"\x89PNG") for name in PICTURES)
        assert "wrote strobe.png and series.png" in out


def test_sensitivity_prints_derivatives_and_draws_growth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: sensitivity of the same descent, which finishes where the slope is long."""
    file = tmp_path / "growth.png"
    words = "sensitivity", BOWL, "--seed", "3", "--rebounds", "2"
    out = printed(capsys, *words)
    assert "bowl_snow, seed 3, solver compliant" in out
    rows = {line.split()[0]: line.split() for line in out.splitlines() if line}
    scenario = load_scenario(BOWL)
    given = scenario.given(scenario.sample(np.random.default_rng(3)))
    found = sensitivity(*given, Settings(end_on_chord=True), rebounds=2)
    assert rows["length"][4] == "1"  # x at the end
    assert rows["friction"][6] == f"{found.of_end('reward', 'friction'):.4g}"
    assert rows["corner_rolling_arm"][2] == ">"
    assert rows["2"][3] == f"{found.growth[1, 0]:.4g}"
    assert max(map(len, out.splitlines())) <= 120
    data = told(capsys, *words, "--out", str(file))
    assert data["parameters"]["friction"]["derivatives"]["reward"] == found.of_end("reward", "friction")
    assert data["parameters"]["corner_rolling_arm"]["side"] == 1
    assert data["growth"] == found.growth[:, 0].tolist()
    assert data["written"] == [str(file)]
    assert file.read_bytes().startswith(b"\x89PNG")


def test_scenarios_are_listed_with_what_they_ask(capsys: pytest.CaptureFixture[str]) -> None:
    header, *lines = printed(capsys, "scenarios").splitlines()
    assert header.split() == ["name", "agent", "chooses", "what", "is", "asked"]
    assert [line.split()[0] for line in lines] == list(scenario_names())
    assert all(len(line) <= 120 and len(line) > header.index("what") for line in lines)
    rows = told(capsys, "scenarios")
    assert [row["name"] for row in rows] == list(scenario_names())
    chosen = {row["name"]: row["agent_chooses"] for row in rows}
    assert chosen["sled_mat"] == ["spin"]
    assert chosen["sled_rollers"] == chosen["boulder_benches"] == ["trim"]  # of a ride nobody chooses the launch


def test_replay_writes_one_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.html"
    for spin in ("1.5", "2.5"):  # the second time it is replaced
        out = printed(capsys, "replay", DROP, "--seed", "3", "--spin", spin, "--out", str(page))
        assert out == f"replay: wrote {page}\n"
        assert [file.name for file in tmp_path.iterdir()] == ["page.html"]
        text = page.read_text(encoding="utf-8")
        assert f'"title":"{load_scenario(DROP).title}, draw 3, compliant surfaces"' in text
        assert f"spin {spin}00 rad/s" in text
    written = {"scenario": "ice_drop", "seed": 0, "solver": "compliant", "written": [str(page)]}
    assert told(capsys, "replay", DROP, "--out", str(page)) == written


def test_play_writes_one_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the launch that ``sledenv simulate`` prints for the same options."""
    page, which = tmp_path / "page.html", (DROP, "--seed", "3", "--speed", "2.5", "--spin", "-1.5")
    written = {"scenario": "ice_drop", "seed": 3, "solver": "rigid", "written": [str(page)]}
    assert told(capsys, "play", *which, "--solver", "rigid", "--html", str(page)) == written
    assert [file.name for file in tmp_path.iterdir()] == ["page.html"]
    data = data_of(page.read_text(encoding="utf-8"))
    values = json.loads(data["exact"])["contexts"][0]["values"]
    assert data["solver"] == "rigid"
    found = told(capsys, "simulate", *which)
    assert [values[name] for name in ("speed", "spin", "orientation")] == [2.5, -1.5, found["launch"]["phi"]]
    assert [values["angle"], values["friction"]] == [found["slope"]["angle"], found["law"]["friction"]]
    assert told(capsys, "play", "--html", str(page)) == {"written": [str(page)]}
    assert data_of(page.read_text(encoding="utf-8"))["title"] == "A sled over bumps"


def test_play_on_tracks_writes_a_page_of_twelve(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: titles and vertices of the tracks; the launch that ``sledenv simulate`` prints."""
    page, which = tmp_path / "page.html", ("sled_kickers", "--seed", "4")
    told(capsys, "play", *which, "--tracks", "--html", str(page))
    data = data_of(page.read_text(encoding="utf-8"))
    hills = json.loads(data["exact"])["hills"]
    tracks = [load_track(name) for name in track_names()]
    assert [(hill["name"], hill["question"]) for hill in hills] == [(one.title, one.description) for one in tracks]
    profiles = [[vertex[:2] for vertex in hill["scene"]["slope"]["profile"]] for hill in hills]
    assert profiles == [[list(vertex) for vertex in track.profile_m] for track in tracks]
    assert all(len(hill["rides"]) > 1 for hill in hills)
    launch = told(capsys, "simulate", *which)["launch"]
    assert all(hill["scene"]["launch"] == launch for hill in hills)


def test_the_command_alone_prints_its_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert printed(capsys) == printed(capsys, "--help")


REFUSED = [
    ("simulate", "SCENARIO is required"),
    ("simulate sled_snw", "unknown scenario 'sled_snw' (did you mean 'sled_snow'?)"),
    ("study pushoff", "unknown study 'pushoff' (did you mean 'push_off'?)"),
    ("benchmark --suite smoek", "unknown suite 'smoek' (did you mean 'smoke'?)"),
    ("simulate none.yaml", "none.yaml: cannot be read: there is no such file"),
    ("simulate pipe.yaml", "pipe.yaml: cannot be read: must be a regular file, no folder, device or pipe"),
    ("simulate broken.yaml", "broken.yaml: cannot be read"),
    ("identify none.csv", "none.csv: cannot be read: there is no such file"),
    ("identify thesis.tex --gyraton-radius 3", "Unknown option: --gyraton-radius. Did you mean --gyration-radius?"),
    ("simulate sled_snow --seed", "--seed needs a value"),
    ("simulate sled_snow --seed -1", "--seed: must be an integer >= 0: '-1'"),
    ("simulate sled_snow --spin inf", 'Invalid value "inf" for --spin. Must be <= 1000000.0.'),
    ("simulate sled_snow --orientation-deg -360.1", 'Invalid value "-360.1" for --orientation-deg. Must be >= -360.0.'),
    ("simulate sled_snow --orientation-deg up", "--orientation-deg"),
    ("replay sled_snow --solver euler", 'Invalid value "euler" for --solver. Choose from: "compliant", "rigid".'),
    ("simulate sled_snow snow", "Unused Tokens: ['snow']"),
    ("simulate sled_snow --ori 3", "Unknown option: --ori. Did you mean"),
    ("benchmark --workers 0", "--workers: must be an integer >= 1: '0'"),
    ("solve", 'Unknown command "solve"'),
    ("play --seed 3", "are asked for, of no scenario: name one"),
    ("play --tracks", "are asked for, of no scenario: name one"),
    ("play sled_mat --tracks", "--tracks: scenario sled_mat has no rider over bumps"),
    ("play sled_mat --run x", "scenario sled_mat has no rider over bumps"),
    ("play sled_kickers --solver rigid", "must be compliant"),
    ("play sled_kickers --run sled_mat-launch-spin-critic-s0", "chooses a launch"),
    ("map sled_mat --run .", "no finished run"),
    ("map sled_mat --seeds 1", "--seeds = [1]: only a page has several contexts"),
    ("map sled_mat --out map.pdf", "must end in .png"),
    ("sensitivity sled_mat --out growth.pdf", "must end in .png"),
    ("replay sled_mat --out page.yaml", "must end in .html"),
    ("replay sled_mat --out .", "must end in .html"),
    ("replay sled_mat --out a/b.html", "there is no folder"),
    ("play --html page.yaml", "must end in .html"),
    ("reproduce --out .", "is the current folder"),
    ("reproduce --out thesis.tex", "thesis.tex is a file"),
    ("reproduce --out /proc/out", "/proc/out cannot be written"),
    ("simulate sled_mat --out work", "holds 'thesis.tex'"),
    ("simulate sled_mat --csv thesis.tex", "must end in .csv"),
    ("simulate sled_mat --csv a/b.csv", "there is no folder"),
    ("simulate sled_mat --csv /proc/b.csv", "/proc/b.csv cannot be written"),
    ("simulate sled_mat --out out --csv out/fall.csv", "must lie outside"),
    *(
        (f"{command} --out thesis.tex/below{suffix}", "thesis.tex")
        for command, suffix in (("study push_off", ""), ("benchmark", ""), ("replay sled_mat", ".html"))
    ),
]


@pytest.mark.skipif(not Path("/proc/version").exists(), reason="needs a folder that nobody can write to")
@pytest.mark.parametrize(("words", "message"), REFUSED, ids=lambda value: value)
def test_what_is_wrong_is_told_in_one_line_and_nothing_is_written(
    words: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("work").mkdir()
    os.mkfifo("pipe.yaml")
    for name in ("thesis.tex", "work/thesis.tex", "broken.yaml"):
        Path(name).write_text("id: [")
    before = sorted(tmp_path.rglob("*"))
    line = refused(capsys, *words.split())
    assert line.startswith("sledenv")
    assert message in line
    assert sorted(tmp_path.rglob("*")) == before


def test_reproduce_tells_its_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: a table that is written in place of the paper's."""

    def write(folder: Path, progress: Callable[[str], None]) -> Path:
        progress("Table 1 as a map")
        (folder / "table.csv").write_text("id,ours\nt0,50.0\n")
        return folder

    monkeypatch.setattr("sledenv.reproduce.reproduce", write)
    assert main(["reproduce", "--json", "--out", str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == {"numbers": [{"id": "t0", "ours": "50.0"}], "written": [str(tmp_path / "index.md")]}
    assert err == "reproduce: Table 1 as a map\n"


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
    reward = told(capsys, "simulate", str(file), *launch)["jam"]["reward"]
    assert reward == pytest.approx(context["best"]["reward"], abs=1e-4)


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
