"""Choices of agents, as marks of the page with maps of contexts, and that a browser shows the marked launches."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from sledenv.benchmark import landscape as module
from sledenv.benchmark import oracle
from sledenv.benchmark.landscape import Choices, choices
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import train
from sledenv.command.cli import main
from sledenv.pages.play import map_page
from sledenv.scenarios.scenario import ScenarioError, load_scenario
from sledenv.simulation.simulate import simulate
from tests.browser import Browser, browser, data_of, needs_chromium, patient, wait_until
from tests.own_scenarios import own_scenario

SCENARIO, SEEDS = "sled_snow", (3, 4)
SHIPPED = Path("sled_snow-launch-orientation-critic-s0")
DEGREE = math.pi / 180.0


@pytest.fixture(scope="module")
def made() -> dict[int, Choices]:
    return choices(load_scenario(SCENARIO), SEEDS, [SHIPPED])


@pytest.fixture(scope="module")
def page(made: dict[int, Choices]) -> str:
    return map_page(load_scenario(SCENARIO), SEEDS, {seed: one.marks for seed, one in made.items()})


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


def test_a_page_marks_what_the_words_tell(made: dict[int, Choices], page: str) -> None:
    """Oracle: the marked launches earn their rewards in the mean over the draws that judge launches."""
    problem, data = Problem(SCENARIO), data_of(page)
    low, high = np.array([problem.scenario.control_bounds[name] for name in problem.task.controlled]).T
    contexts = json.loads(data["exact"])["contexts"]
    assert [context["name"] for context in contexts] == [f"seed {seed}" for seed in SEEDS]
    assert data["axes"] == ["orientation", "spin"]
    assert data["free"] == ["orientation"] == list(problem.task.controlled)
    for seed, context in zip(SEEDS, contexts, strict=True):
        (mark,) = context["marks"]
        assert mark["name"] == "critic"
        given = np.array([problem.scenario.sample(np.random.default_rng(seed))])
        values = np.array([mark["launch"]["orientation"] / DEGREE])
        action = 2.0 * (values - low) / (high - low) - 1.0
        reward = problem.expect(problem.trials(given, "test"), action[np.newaxis, np.newaxis])[0, 0]
        assert mark["expected"] == pytest.approx(reward, abs=1e-6)
        assert f"reward {mark['expected']:.4f}" in made[seed].words
        assert made[seed].plain[0]["reward"] == mark["expected"]


@needs_chromium
@pytest.mark.jit_only
def test_marks_play_their_own_launches(page: str, chromium: Browser, tmp_path: Path) -> None:
    """Oracle: the descent of the marked launch in Python, without errors."""
    problem, file = Problem(SCENARIO), tmp_path / "map.html"
    file.write_text(patient(page), encoding="utf-8")
    chromium.log()
    chromium.open(file, "context=seed+4")
    wait_until(chromium, "map?.best?.refined && !asking && !drawing")
    context = problem.scenario.sample(np.random.default_rng(SEEDS[1]))
    marks = chromium.run("return here().marks")
    assert chromium.run("return document.querySelectorAll('#map .best').length") == 1
    assert chromium.run("return document.querySelectorAll('#map .agent').length") == 1
    for i, mark in enumerate(marks):
        chromium.click(f"[data-mark='{i}']")
        orientation = mark["launch"]["orientation"]
        wait_until(chromium, f"!asking && Math.abs(launchOf().orientation - {orientation!r}) < 1e-9")
        given = problem.scenario.given(context, orientation)
        descent = simulate(*given, problem.scenario.settings())
        status, reward = chromium.run("return [shown.status, shown.jam.reward]")
        assert status == str(descent.status)
        assert reward == pytest.approx(float(descent.jam.reward), abs=1e-6)
    assert chromium.log() == []


def test_wrong_runs_are_refused_before_anything_is_simulated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_chosen", None)
    scenario = load_scenario(SCENARIO)
    with pytest.raises(FileNotFoundError, match="no finished run"):
        choices(scenario, [0], [tmp_path])
    other = train("sledenv.agents.zero", Problem("sled_mat"), {}, 0, tmp_path / "other")
    with pytest.raises(ScenarioError, match="another scenario"):
        choices(scenario, [0], [other])
    trims = train("sledenv.agents.zero", Problem(SCENARIO, "descent"), {}, 0, tmp_path / "trims")
    with pytest.raises(ScenarioError, match="trims every flight of a ride"):
        choices(scenario, [0], [trims])


def test_the_command_writes_a_page_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It searches nothing then."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(oracle, "best_launches", None)
    assert main(["map", "sled_mat", "--html", "page.html", "--seeds", "3", "1"]) == 0
    assert capsys.readouterr().out == "map: wrote page.html\n"
    assert [file.name for file in tmp_path.iterdir()] == ["page.html"]
    contexts = json.loads(data_of((tmp_path / "page.html").read_text(encoding="utf-8"))["exact"])["contexts"]
    assert [context["name"] for context in contexts] == ["seed 3", "seed 1"]
    shipped = "sled_mat-launch-spin-critic-s0"
    assert main(["map", "sled_mat", "--html", "page.html", "--seed", "3", "--run", shipped, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [(one["seed"], [agent["agent"] for agent in one["agents"]]) for one in told["contexts"]] == [(3, ["critic"])]
    (context,) = json.loads(data_of((tmp_path / "page.html").read_text(encoding="utf-8"))["exact"])["contexts"]
    assert [mark["name"] for mark in context["marks"]] == ["critic"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--seeds", "1", "2"], "--seeds = [1, 2]: only a page has several contexts"),
        (["--html", "page.png"], "--html: page.png: must end in .html"),
    ],
)
def test_wrong_arguments_are_explained(arguments, message, tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        status = main(["map", own_scenario("ice_drop"), *arguments])
    except SystemExit as stop:
        status = stop.code
    assert status == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
