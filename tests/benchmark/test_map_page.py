"""The page with maps of contexts: what it marks, what it refuses, and that a browser shows the marked launches."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sledenv.benchmark import map_page as module
from sledenv.benchmark import oracle
from sledenv.benchmark.map_page import MOST_SEEDS, MapPage, map_page
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import train
from sledenv.command.cli import main
from sledenv.scenarios.scenario import Scenario, ScenarioError
from tests.browser import Browser, browser, data_of, needs_chromium, patient, wait_until
from tests.packs import own_pack

PACK, SEEDS = "sled_patch", (3, 4)
DEGREE = math.pi / 180.0


@pytest.fixture(scope="module", autouse=True)
def in_haste() -> Iterator[None]:
    """An oracle that does not search long: the page shows what it finds."""
    with pytest.MonkeyPatch.context() as patch:
        hasty = {"CELLS": 600, "SHOWN": 300, "STARTS": 6, "NEIGHBOURS": 4, "DRAWS": 16, "JUDGED": (2, 16)}
        for name, value in hasty.items():
            patch.setattr(oracle, name, value)
        yield


@pytest.fixture(scope="module")
def made() -> MapPage:
    return map_page(PACK, SEEDS)


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


def test_a_page_marks_what_the_words_tell(made: MapPage) -> None:
    """Oracle: the marked launches earn their rewards in the mean over the draws that judge launches."""
    problem, data = Problem(PACK), data_of(made.html)
    low, high = np.array([problem.scenario.control_bounds[name] for name in problem.task.controlled]).T
    contexts = json.loads(data["exact"])["contexts"]
    assert [context["name"] for context in contexts] == [f"seed {seed}" for seed in SEEDS]
    assert data["axes"] == ["orientation", "speed"] == list(problem.task.controlled)
    for seed, context in zip(SEEDS, contexts, strict=True):
        assert [mark["name"] for mark in context["marks"]] == ["best launch", "critic"]
        for mark in context["marks"]:
            given = np.array([problem.scenario.sample(np.random.default_rng(seed))])
            values = np.array([mark["launch"]["orientation"] / DEGREE, mark["launch"]["speed"]])
            chosen = 2.0 * (values - low) / (high - low) - 1.0
            reward = problem.expect(problem.trials(given, "test"), chosen[np.newaxis, np.newaxis])[0, 0]
            assert mark["expected"] == pytest.approx(reward, abs=1e-6)
            assert f"reward {mark['expected']:.4f}" in made.words
    assert made.words.count("context of seed") == len(SEEDS)


def test_one_control_has_a_map_over_orientation_and_spin() -> None:
    data = data_of(map_page("sled_snow", [2], []).html)
    (context,) = json.loads(data["exact"])["contexts"]
    assert data["axes"] == ["orientation", "spin"]
    assert [list(mark["launch"]) for mark in context["marks"]] == [["orientation"]]


def test_contexts_of_several_bodies_have_theirs() -> None:
    """Oracle: the contexts."""
    scenario = Problem("sled_any").scenario
    shapes = [int(scenario.sample(np.random.default_rng(seed)).shape) for seed in range(3)]
    contexts = json.loads(data_of(map_page("sled_any", range(3), []).html)["exact"])["contexts"]
    assert [context["body"] for context in contexts] == shapes
    assert len(set(shapes)) > 1


def test_the_shipped_agent_is_that_of_this_very_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # wherever one works
    problem = Problem("sled_tilt")
    assert [folder.name for folder in module._shipped_runs(problem)] == ["sled_tilt-launch-spin-critic-s0"]
    content = problem.scenario.model_dump(mode="json", by_alias=True)
    content["slope"] |= {"length_m": 11.0}
    assert module._shipped_runs(Problem(Scenario.model_validate(content))) == []


@needs_chromium
@pytest.mark.jit_only
def test_marks_play_their_own_launches(made: MapPage, chromium: Browser, tmp_path: Path) -> None:
    """Oracle: the descent of the marked launch in Python, without errors."""
    problem, file = Problem(PACK), tmp_path / "map.html"
    file.write_text(patient(made.html), encoding="utf-8")
    chromium.log()
    chromium.open(file, "context=seed+4")
    wait_until(chromium, "map?.complete && !asking && !drawing")
    context = problem.scenario.sample(np.random.default_rng(SEEDS[1]))
    marks = chromium.run("return here().marks")
    assert chromium.run("return document.querySelectorAll('#map .best').length") == 2  # the best launch, and the map's
    assert chromium.run("return document.querySelectorAll('#map .agent').length") == 1
    for i, mark in enumerate(marks):
        chromium.click(f"[data-mark='{i}']")
        wait_until(chromium, f"!asking && Math.abs(launchOf().speed - {mark['launch']['speed']!r}) < 1e-9")
        state = problem.scenario.launch(context, mark["launch"]["orientation"], speed=mark["launch"]["speed"])
        descent = problem.task.descend(np.array([context]), state, "trajectory")
        status, reward = chromium.run("return [shown.status, shown.jam.reward]")
        assert status == str(descent.status)
        assert reward == pytest.approx(float(descent.jam.reward), abs=1e-6)
    assert chromium.log() == []


@pytest.mark.parametrize("seeds", [[], [1, 1], list(range(MOST_SEEDS + 1))])
def test_wrong_seeds_are_named(seeds: list[int]) -> None:
    with pytest.raises(ValueError, match=r"seeds = .*must be 1 to"):
        map_page(PACK, seeds)


def test_wrong_runs_are_refused_before_anything_is_simulated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "marked", None)
    with pytest.raises(FileNotFoundError, match="no finished run"):
        map_page(PACK, [0], [tmp_path])
    other = train("sledenv.agents.zero", Problem("talus"), {}, 0, tmp_path / "other")
    with pytest.raises(ScenarioError, match="another scenario"):
        map_page(PACK, [0], [other])
    trims = train("sledenv.agents.zero", Problem(PACK, "descent"), {}, 0, tmp_path / "trims")
    with pytest.raises(ScenarioError, match="trims every hop"):
        map_page(PACK, [0], [trims])


def test_the_command_writes_a_page_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["map", "sled_tilt", "--html", "page.html", "--seeds", "3", "1"]) == 0
    out = capsys.readouterr().out
    assert "context of seed 3\nbest launch" in out
    assert out.endswith("map: wrote page.html\n")
    assert [file.name for file in tmp_path.iterdir()] == ["page.html"]
    data = data_of((tmp_path / "page.html").read_text(encoding="utf-8"))
    marks = json.loads(data["exact"])["contexts"][1]["marks"]
    assert [mark["name"] for mark in marks] == ["best launch", "critic"]  # that ships


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--seeds", "1", "2"], "--seeds = [1, 2]: only a page has several contexts"),
        (["--html", "page.png"], "--html: page.png: must end in .html"),
    ],
)
def test_wrong_arguments_are_explained(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        status: Any = main(["map", own_pack("ice_drop"), *arguments])
    except SystemExit as stop:
        status = stop.code
    assert status == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
