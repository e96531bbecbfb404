"""The Python code of the documentation runs as it stands."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import torch
from PIL import Image

import sledenv
from docs import draw
from docs.draw import run
from sledenv import load_scenario
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.suite import Suite
from sledenv.scenarios import Scenario, bodies, sections
from sledenv.scenarios.configuration import Section
from sledenv.uncertainty import load_study

ROOT = Path(__file__).parents[1]


def blocks(page: str, language: str = "python") -> list[str]:
    """Code of a page, in order."""
    return draw.blocks(ROOT / page, language)


def test_the_page_on_simulation_runs_from_top_to_bottom(tmp_path, monkeypatch, capsys):
    """Its figures and its table are written."""
    monkeypatch.chdir(tmp_path)
    names = run(blocks("docs/simulation.md"))
    figures = ["strobe", "descent", "impact"]
    assert {file.name for file in tmp_path.iterdir()} == {"rebounds.csv", *(f"{name}.png" for name in figures)}
    assert names["descent"].status == "finish"
    assert len((tmp_path / "rebounds.csv").read_text().splitlines()) == 1 + len(names["descent"].rebounds)
    assert names["static_jam"](names["body"], names["sticky"], names["slope"], 0.0).shape == ()
    assert "finish" in names["batch"].status
    assert "SLIDE" in capsys.readouterr().out


def test_the_sensitivity_of_the_page_on_uncertainty_runs(tmp_path, monkeypatch, capsys):
    """Its figure is written, and the descent is the one that the page tells of."""
    monkeypatch.chdir(tmp_path)
    names = run(blocks("docs/uncertainty.md")[:1])
    assert [file.name for file in tmp_path.iterdir()] == ["growth.png"]
    assert names["found"].descent.status == "finish"
    assert len(names["found"].rebounds) == len(names["found"].descent.rebounds) == 9
    assert "nearest change" in capsys.readouterr().out


def check_pictures(page, prefix, folder):
    """A page has drawn in a folder what it shows under names with a prefix."""
    drawn = {file.name for file in folder.glob("*.png")}
    shown = set(re.findall(r"images/(\w+\.png)", (ROOT / f"docs/{page}.md").read_text(encoding="utf-8")))
    assert drawn
    assert {name for name in shown if name.startswith(prefix)} == drawn


def test_the_gallery_draws_what_it_shows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run(blocks("docs/gallery.md"))
    check_pictures("gallery", "gallery", tmp_path)
    assert "jammed" in capsys.readouterr().out


def test_the_page_on_hillsides_draws_its_picture(tmp_path, monkeypatch, capsys):
    """Of two groups of launches instead of 512."""
    monkeypatch.chdir(tmp_path)
    (code,) = blocks("docs/hillside.md")
    names = run([code.replace('"runs/hillside"', '"runs/hillside", launches=40, workers=1, progress=False')])
    assert (tmp_path / "hillside.png").is_file()
    assert names["rocks"].launches == 44
    assert "body.width_ratio" in capsys.readouterr().out


def test_the_lines_of_the_first_page_judge_a_policy(capsys):
    """On two contexts instead of 1,000. Oracle: what is printed is what the policy earns there."""
    judged, steps = blocks("docs/index.md")
    names = run([judged.replace('"sled_mat")', '"sled_mat", contexts=2)')])
    assert capsys.readouterr().out == f"{sledenv.evaluate(names['against'], 'sled_mat', contexts=2)}\n"
    assert 0.0 <= run([steps])["reward"] <= 1.0


def test_the_page_on_scenarios_writes_valid_ones_and_a_body_and_draws_its_pictures(tmp_path, monkeypatch, capsys):
    """Oracle: names and height of the body on the page; the scenario takes it as it stands."""
    monkeypatch.chdir(tmp_path)
    scenario, body, bumps, *_ = blocks("docs/scenarios.md", "yaml")
    (tmp_path / "my_mat.yaml").write_text(scenario)
    (tmp_path / "my_bumps.yaml").write_text(bumps)
    names = run(blocks("docs/scenarios.md"))
    assert names["env"].unwrapped.action_space.shape == (1,)
    assert "friction" in capsys.readouterr().out
    own = re.sub("^body: .*$", "", scenario.replace("touching: rider", "touching: head"), flags=re.MULTILINE)
    (tmp_path / "own.yaml").write_text(own + body)
    (measured,) = load_scenario(tmp_path / "own.yaml").all_bodies()
    assert {"heel", "runner", "toe", "frame", "head", "back", "legs", "feet"} <= set(measured.parts)
    assert 0.13 < measured.lowest_support < 0.14  # it was measured 0.14 m over the tape
    scenario = load_scenario(tmp_path / "my_bumps.yaml")
    assert scenario.given(scenario.sample(np.random.default_rng(0))).slope.profile
    check_pictures("scenarios", "track", tmp_path)


def test_the_page_on_scenarios_names_every_key():
    """Oracle: the fields of the sections."""
    page = (ROOT / "docs/scenarios.md").read_text(encoding="utf-8")
    named = [*vars(sections).values(), *vars(bodies).values()]
    kinds = [kind for kind in named if isinstance(kind, type) and issubclass(kind, Section)]
    keys = {field.alias or name for kind in [Scenario, *kinds] for name, field in kind.model_fields.items()}
    assert {"friction", "kind", "slope"} <= keys
    assert [key for key in sorted(keys) if f"`{key}`" not in page] == []


def test_the_page_for_engineers_tells_what_comes_out(tmp_path, monkeypatch):
    """Oracle: the numbers on the page, of its own files."""
    monkeypatch.chdir(tmp_path)
    (survey,) = blocks("docs/engineer.md")
    run([survey])
    scenario, study = blocks("docs/engineer.md", "yaml")
    Path("sled.yaml").write_text(scenario, encoding="utf-8")
    measured = load_scenario("sled.yaml")
    descent = sledenv.simulate(*measured.given(measured.sample(np.random.default_rng(0))), measured.settings())
    page = (ROOT / "docs/engineer.md").read_text(encoding="utf-8")
    assert f"finish after {descent.time:.4g} s" in page
    assert re.search(rf"drag +{descent.energy.drag:.4g}\n", page)
    Path("study.yaml").write_text(study, encoding="utf-8")
    assert load_study("study.yaml").base.slope_section.length_m == 400.0


def test_the_pages_on_environments_run(tmp_path, monkeypatch, capsys):
    """Their film moves and has the size of the pictures."""
    monkeypatch.chdir(tmp_path)
    assert run(blocks("docs/environments/descent.md"))["ended"]
    pushed = run(blocks("docs/environments/launch.md"))["pushed"]
    names = run(blocks("docs/environments.md"))
    assert len(names["rule"].rewards) == 200
    assert pushed.control_bounds["speed"] == (2.0, 6.0)
    assert names["rewards"].shape == (4096,)
    with Image.open("film.webp") as film:
        assert (film.size, film.n_frames > 10) == ((960, 540), True)


def test_the_agent_and_the_suite_of_the_page_on_the_benchmark_are_valid(tmp_path, monkeypatch):
    (agent,) = blocks("docs/benchmark.md")
    names = run([agent])
    assert names["Agent"].train(Problem("sled_rollers", "descent"), {}, 0, tmp_path)

    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_scenario.yaml").write_text(blocks("docs/scenarios.md", "yaml")[0])
    (tmp_path / "my_agents").mkdir()
    (tmp_path / "my_agents" / "clever.py").write_text(agent)
    (tmp_path / "mine.yaml").write_text(blocks("docs/benchmark.md", "yaml")[0])
    assert Suite.load(tmp_path / "mine.yaml").contexts == 100


def test_the_page_on_agents_judges_a_trained_one(capsys):
    run(blocks("agents/README.md"))
    assert capsys.readouterr().out.startswith("critic, 4 test contexts of sled_mat")


def test_the_code_of_the_page_for_contributors_is_valid():
    """Oracle: the name of the control; the code is a key of a section."""
    (control,) = blocks("CONTRIBUTING.md")
    annotated = run([control], vars(sections) | {"__annotations__": {}})["__annotations__"]["drop_m"]
    assert get_args(annotated)[1].name == "drop"


def test_the_page_on_recordings_runs_from_top_to_bottom(tmp_path, monkeypatch, capsys):
    """Oracle: the laws that made its recording and its film."""
    monkeypatch.chdir(tmp_path)
    names = run(blocks("docs/recordings.md"))
    laws = {"found": (0.6, 0.12, 0.002), "fitted": (0.7, 0.1, 0.002)}
    for fit, truths in laws.items():
        for name, truth in zip(("restitution", "friction", "rolling_arm"), truths, strict=True):
            assert names[fit].intervals[name].low < truth < names[fit].intervals[name].high
    assert capsys.readouterr().out.count("95 % interval") == len(laws)


def test_the_step_and_the_simulation_of_the_readme_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = run(blocks("README.md")[:2])
    assert 0.0 <= names["reward"] <= 1.0
    assert (tmp_path / "descent.png").is_file()


@pytest.mark.slow
def test_the_training_of_the_readme_runs(capsys):
    """Oracle: the 0.580 of no trims in the same contexts."""
    torch.set_num_threads(1)  # more wait for each other on a busy machine
    run([blocks("README.md")[2].replace("progress_bar=True", "progress_bar=False")])
    told = capsys.readouterr().out
    assert told.startswith("PPO, 1000 test contexts of sled_rollers")
    assert float(re.findall(r"mean reward  (\S+)", told)[0]) > 0.61


def test_the_study_of_the_page_on_uncertainty_runs(tmp_path, monkeypatch, capsys):
    """Its study of few launches finds what the page says of many: jams come of friction."""
    monkeypatch.chdir(tmp_path)
    names = run(blocks("docs/uncertainty.md")[1:])
    friction = names["launches"].groupby("status", observed=True)["contact.friction"].mean()
    assert friction["jammed"] > friction["finish"]
    assert "contact.friction" in capsys.readouterr().out


def test_the_study_file_of_the_page_is_valid(tmp_path):
    (tmp_path / "mine.yaml").write_text(blocks("docs/uncertainty.md", "yaml")[0])
    assert load_study(tmp_path / "mine.yaml").stations.tolist() == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]


def notebook(name: str) -> dict[str, Any]:
    """Run the cells of a notebook."""
    return run(blocks(f"docs/notebooks/{name}.md", "{code-cell} ipython3"))


def test_the_notebook_from_an_impact_to_a_descent_says_what_it_computes(capsys):
    """Each sentence about a number, by the numbers."""
    names = notebook("impact_to_descent")
    wheels = names["wheels"]
    rolls = wheels.scenario == "stop-roll"
    assert not rolls[0]
    assert rolls[-1]
    np.testing.assert_allclose(wheels.u[rolls], -names["radius"] * wheels.omega[rolls])  # equal speeds
    assert np.ptp(wheels.u[rolls]) < 1e-12  # more friction changes nothing
    assert np.ptp(names["moving"]) > 0.1
    assert names["duration"] < 1e-3
    assert names["error"] < 1e-4
    assert abs(names["descent"].energy.residual) < 1e-9
    assert names["descent"].status == "finish"
    assert 0.45 < names["shares"][0.2] < names["shares"][0.01] < 0.55
    assert set(names["batch"].status) == {"finish", "tumbled"}
    lost = {name: np.where(arrived, index, np.inf).min() for name, (index, arrived) in names["panels"].items()}
    assert lost["friction 0.01"] < 0.05 < lost["friction 0.2"]


@pytest.mark.slow
def test_the_notebook_from_the_environment_to_a_regret_says_what_it_computes(capsys):
    names = notebook("train_and_judge")
    regret = names["scores"]["mean regret"]
    assert regret["before learning"] > 0.1
    assert names["scores"]["worst regret"]["PPO"] < 0.05  # near the best in all four contexts
    assert 0.19 < regret["land flat"] < 0.22
    assert np.ptp([rewards[20] for rewards in names["missed"].values()]) < 0.03  # hit exactly
    missed = {name: rewards.mean() for name, rewards in names["missed"].items()}
    assert missed["land flat"] < 0.7 < 0.9 < missed["PPO"]
    assert (names["missed"]["land flat"][20:25] > 0.5).tolist() == [True, True, True, False, False]  # 0 to 2 degrees
    assert [descent.status for descent in names["descents"]] == ["tumbled", "finish"]


def test_the_notebook_from_recordings_to_a_law_says_what_it_computes(capsys):
    """Oracle: the law that made them, and gravity during a contact, which the fitted law does not know."""
    names = notebook("identify_a_law")
    assert names["first"].rebounds.balance()["share"]["b"] < -0.9
    assert names["found"].rebounds.balance()["share"]["b"] > 0.9
    assert any("spins do not balance" in warning for warning in names["first"].warnings)
    for name in ("friction", "rolling_arm"):
        assert names["found"].intervals[name].low < names["truth"][name] < names["found"].intervals[name].high
    assert names["comparison"].differences()["clear"].all()
    assert names["found"].intervals["restitution"].high < names["truth"]["restitution"]
    assert names["again"].intervals["restitution"].low < 0.6 < names["again"].intervals["restitution"].high
