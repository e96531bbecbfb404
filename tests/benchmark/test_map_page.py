"""The page that plays every launch of a map: what it holds, and what a browser shows at two widths."""

from __future__ import annotations

import re
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
from sledenv.pages.keyframes import TOLERANCE
from sledenv.plot.shapes import reach, states_at
from sledenv.scenarios.scenario import Scenario, ScenarioError, load_scenario
from sledenv.scenarios.sections import CONTROLS
from sledenv.simulation.outcomes import Descent
from tests.browser import Browser, at_speed, browser, data_of, needs_chromium, wait_until
from tests.packs import own_pack

PACK, SEEDS = "sled_patch", (3, 4)
MINUS = "\N{MINUS SIGN}"
ARROWS = {"left": "\ue012", "up": "\ue013", "right": "\ue014", "down": "\ue015"}
WIDTHS = pytest.mark.parametrize("width", [390, 1280])


@pytest.fixture(scope="module", autouse=True)
def in_haste() -> Iterator[None]:
    """Few launches, and an oracle that does not search long: the page shows what it finds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "DESCENTS", 320)
        patch.setattr(module, "_SAMPLE", 64)
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


def shown(chromium: Browser, html: str, folder: Path, width: int = 1280) -> Browser:
    file = folder / "map.html"
    file.write_text(html, encoding="utf-8")
    chromium.screen(width, 900)
    chromium.log()
    chromium.open(file)
    wait_until(chromium, "L !== null")
    at_speed(chromium, 0.001)  # no descent ends while a busy machine is late to look
    return chromium


def descended(problem: Problem, seed: int, chosen: dict[str, float]) -> Descent:
    """Simulate a launch, told in the units of the scenario, without the page and what made it."""
    context = problem.scenario.sample(np.random.default_rng(seed))
    in_radians = {name: np.radians(value) if CONTROLS[name].unit == "deg" else value for name, value in chosen.items()}
    launch = problem.scenario.launch(context, **in_radians)
    return problem.task.descend(np.array([context]), launch, "trajectory")


def launch_of(page: Browser, index: int) -> dict[str, float]:
    names = page.run("return D.controls.map(control => control.name)")
    return dict(zip(names, page.run("return valuesOf(arguments[0])", index), strict=True))


def numbers(page: Browser) -> dict[str, str]:
    pairs = page.run(
        "return [...document.querySelectorAll('#outcome div')].map(one => [...one.children].map(x => x.textContent))"
    )
    return dict(pairs)


def assert_told(page: Browser, descent: Descent) -> None:
    """The numbers shown and the story are those of the simulator, to the digits shown."""
    told, jam = numbers(page), descent.jam
    assert told["reward"] == f"{float(jam.reward):.3f}"
    assert told["jam index"] == f"{1.0 - float(jam.reward):.3f}"
    assert told["progress"] == f"{100.0 * float(jam.progress):.1f} %"
    assert told["retention"] == f"{100.0 * float(jam.retention):.1f} %"
    assert told["time"] == f"{descent.time:.2f} s"
    assert told["contacts"] == str(len(descent.rebounds))
    words = {"finish": "Finished", "tumbled": "Tumbled", "jammed": "Jammed", "timeout": "Out of time"}
    story = page.text("#story")
    assert story.startswith(words[str(descent.status)])
    assert f"after {descent.time:.2f} s" in story
    assert f"{descent.state.x:.2f} m down" in story or descent.status == "finish"


def place_of(page: Browser, index: int) -> tuple[float, float]:
    """Where a launch lies on the screen [px]."""
    page.run("document.querySelector('#map').scrollIntoView({block: 'center'})")
    x, y = page.run(
        "const box = document.querySelector('#map').getBoundingClientRect(), [x, y] = placeOf(arguments[0]);"
        "return [box.left + x * box.width / chart.width, box.top + y * box.height / chart.height]",
        index,
    )
    return x, y


def test_a_page_refers_to_nothing_outside(made: MapPage) -> None:
    assert not re.search(r"https?:|[^:]//[a-z]+\.[a-z]|@import|<link|\bsrc=|url\((?!#)", made.html)
    assert "default-src 'none'" in made.html


def test_a_page_marks_what_the_words_tell(made: MapPage) -> None:
    """Oracle: the marked launches earn their rewards in the mean over the draws that judge launches."""
    problem, data = Problem(PACK), data_of(made.html)
    low, high = np.array([problem.scenario.control_bounds[name] for name in problem.task.controlled]).T
    assert [context["seed"] for context in data["contexts"]] == list(SEEDS)
    for context in data["contexts"]:
        assert [mark["name"] for mark in context["marks"]] == ["best launch", "critic"]
        for mark in context["marks"]:
            given = np.array([problem.scenario.sample(np.random.default_rng(context["seed"]))])
            chosen = 2.0 * (np.array([[mark["values"]]], float) - low) / (high - low) - 1.0
            reward = problem.expect(problem.trials(given, "test"), chosen)[0, 0]
            assert mark["expected"] == pytest.approx(reward, abs=1e-3)  # values are rounded to nine digits
            assert f"reward {mark['expected']:.4f}" in made.words
    assert made.words.count("context of seed") == len(SEEDS)


def test_the_shipped_agent_is_that_of_this_very_scenario(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # wherever one works
    problem = Problem("sled_tilt")
    assert [folder.name for folder in module._shipped_runs(problem)] == ["sled_tilt-launch-spin-critic-s0"]
    content = problem.scenario.model_dump(mode="json", by_alias=True)
    content["slope"] |= {"length_m": 11.0}
    assert module._shipped_runs(Problem(Scenario.model_validate(content))) == []


def test_a_page_is_as_large_as_it_may_be(made: MapPage, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the page without its launches is 60 kB at most."""

    def held(page: MapPage) -> tuple[int, int]:
        data = data_of(page.html)
        size = sum(len(context["launches"]) for context in data["contexts"])
        assert len(page.html) - size < 60_000
        return size, len(SEEDS) * np.prod([len(control["values"]) for control in data["controls"]])

    size, launches = held(made)
    assert 240 < launches <= 320
    monkeypatch.setattr(module, "BYTES", size // 2)
    small, fewer = held(map_page(PACK, SEEDS, []))
    assert 0.35 * size < small < 0.6 * size
    assert 0.35 * launches < fewer < 0.6 * launches


@needs_chromium
@WIDTHS
def test_a_click_plays_the_descent_of_its_cell(made: MapPage, chromium: Browser, tmp_path: Path, width: int) -> None:
    """Oracle: the simulator, given the launch that is told."""
    page, problem = shown(chromium, made.html, tmp_path, width), Problem(PACK)
    cells = page.run("return cells")
    endings = set()
    for index in np.random.default_rng(1).choice(cells, 7, replace=False).tolist():
        kind = "touch" if width == 390 else "mouse"
        page.drag(place_of(page, index), kind=kind)
        if page.run("return index") >= cells:  # a mark lies on it
            continue
        assert page.run("return [index, playing]") == [index, True]
        wait_until(page, "t > 0")
        chosen = launch_of(page, index)
        words = page.text("#launch").replace(MINUS, "-")
        assert words == f"orientation {chosen['orientation']:.2f}°, speed {chosen['speed']:.3f} m/s"
        descent = descended(problem, SEEDS[0], chosen)
        assert_told(page, descent)
        endings.add(str(descent.status))
        page.run("pause(); show(0.6 * end())")
        state = states_at(descent.trajectory, [0.6 * descent.time])[0]
        told = re.match(r"(\S+) m down the slope, along it (\S+) m/s", page.text("#now").replace(MINUS, "-"))
        assert told is not None
        assert float(told[1]) == pytest.approx(state[0], abs=0.02)
    assert len(endings) > 1
    assert page.run("return document.documentElement.scrollWidth") <= width
    assert f"shown to {2e3 * TOLERANCE * reach(problem.task.bodies[0]):.1f} mm and 0.2°" in page.text("#about")
    assert page.run("return performance.getEntriesByType('resource').length") == 0
    assert page.log() == []


@needs_chromium
def test_positions_in_the_page_are_those_of_the_simulator(made: MapPage, chromium: Browser, tmp_path: Path) -> None:
    """Oracle: the trajectories; the thinning and the rounding are allowed ``TOLERANCE`` each."""
    page, problem = shown(chromium, made.html, tmp_path), Problem(PACK)
    allowed = 2.0 * TOLERANCE * np.array([reach(problem.task.bodies[0]), reach(problem.task.bodies[0]), 1.0])
    for index in np.linspace(0, page.run("return L.n - 1"), 40).astype(int).tolist():
        descent = descended(problem, SEEDS[0], launch_of(page, index))
        times = np.linspace(0.0, descent.time, 50)
        poses = page.run(
            "const rows = descentOf(L, arguments[0]);"
            "return arguments[1].map(t => stateAt(rows, t)).map(s => [s.x, s.y, s.phi])",
            index,
            times.tolist(),
        )
        assert (np.abs(np.array(poses) - states_at(descent.trajectory, times)[:, :3]) <= allowed).all()


@needs_chromium
@WIDTHS
def test_marks_play_their_own_launches(made: MapPage, chromium: Browser, tmp_path: Path, width: int) -> None:
    page, problem = shown(chromium, made.html, tmp_path, width), Problem(PACK)
    cells = page.run("return cells")
    assert page.run("return index") == cells  # the best launch, at first
    assert page.text("#launch").startswith("Best launch: ")
    assert numbers(page)["regret"] == "0.0 %"
    page.drag(place_of(page, 0))
    page.click("#marks button:nth-child(2)")
    assert page.text("#launch").startswith("Critic: ")
    assert_told(page, descended(problem, SEEDS[0], launch_of(page, cells + 1)))
    page.drag(place_of(page, 0))
    assert page.run("return document.querySelectorAll('#cursor > .mark').length") == 0
    page.drag(place_of(page, cells))
    assert page.run("return index") == cells
    assert page.run("return document.querySelectorAll('#map > .mark').length") == 2
    assert page.run("return document.querySelectorAll('#cursor > .mark').length") == 1  # and again, above the other


@needs_chromium
def test_dragging_and_arrows_move_the_launch(made: MapPage, chromium: Browser, tmp_path: Path) -> None:
    page = shown(chromium, made.html, tmp_path)
    upright = page.run("return upright")
    page.drag(*(place_of(page, i * upright + 1) for i in (2, 3, 5)), kind="touch")
    assert page.run("return index") == 5 * upright + 1
    for keys, index in (
        ("right", 6 * upright + 1),
        ("up", 6 * upright + 2),
        ("down", 6 * upright + 1),
        ("down", 6 * upright),
        ("down", 6 * upright),  # the speed ends at its bound
        *(("left", i * upright) for i in (5, 4, 3, 2, 1, 0)),
        ("left", 0),  # so does the orientation
    ):
        page.press("#map", ARROWS[keys])
        assert page.run("return index") == index
    page.press("#map", " ")
    assert page.run("return playing") is False
    page.press("#map", " ")
    assert page.run("return playing") is True
    at_speed(page, 1000)
    wait_until(page, "!playing")
    assert page.run("return t") == page.run("return end()")
    assert page.run(
        "return [...document.querySelectorAll('#trail .contact')].every(one => one.getAttribute('opacity') == 1)"
    )


@needs_chromium
def test_contexts_are_paged_through(made: MapPage, chromium: Browser, tmp_path: Path) -> None:
    page, problem = shown(chromium, made.html, tmp_path), Problem(PACK)
    first = page.text("#setting")
    page.click("#next")
    wait_until(page, "number === 1")
    assert page.text("#setting") != first
    page.drag(place_of(page, 40))
    assert_told(page, descended(problem, SEEDS[1], launch_of(page, page.run("return index"))))
    page.click("#next")  # around
    wait_until(page, "number === 0")
    assert page.text("#setting") == first


@pytest.fixture(scope="module")
def curve() -> MapPage:
    return map_page(own_pack("spinning_entry"), [2], [])


@needs_chromium
@WIDTHS
def test_one_control_is_a_curve(curve: MapPage, chromium: Browser, tmp_path: Path, width: int) -> None:
    page = shown(chromium, curve.html, tmp_path, width)
    assert page.run("return [flat, upright, document.querySelectorAll('#map image').length]") == [True, 1, 0]
    index = page.run("return Math.floor(cells / 3)")
    page.drag(place_of(page, index))
    assert_told(page, descended(Problem(own_pack("spinning_entry")), 2, launch_of(page, page.run("return index"))))
    found = page.run("return index")
    page.press("#map", ARROWS["right"] + ARROWS["up"])  # there is nothing above
    assert page.run("return index") == found + 1
    assert page.run("return document.querySelector('#pager').hidden") is True
    assert page.run("return document.documentElement.scrollWidth") <= width
    apart = float(np.ptp(page.run("return X.values"))) / (page.run("return across") - 1)
    assert f"launches, {apart:.2g}° apart" in page.text("#about")
    assert page.log() == []


@pytest.mark.slow
@needs_chromium
def test_of_three_controls_the_third_stays_in_the_middle(chromium: Browser, tmp_path: Path) -> None:
    content = load_scenario("talus").model_dump(mode="json", by_alias=True)
    content["control"] |= {"speed_m_s": [2, 8], "chosen": "all"}
    problem = Problem(Scenario.model_validate(content))
    page = shown(chromium, map_page(problem.scenario, [1]).html, tmp_path)
    assert "All cells have the speed 5.000 m/s" in page.text("#about")
    page.drag(place_of(page, 100))
    chosen = launch_of(page, page.run("return index"))
    assert chosen["speed"] == 5.0
    assert_told(page, descended(problem, 1, chosen))
    page.click("#marks button")
    assert page.run("return valuesOf(index)[2]") != 5.0


@pytest.mark.slow
@needs_chromium
def test_under_noise_the_map_is_a_mean_and_a_descent_is_as_aimed(chromium: Browser, tmp_path: Path) -> None:
    """Oracle: Problem.expect and the simulator."""
    problem = Problem(own_pack("noisy_start"))
    page = shown(chromium, map_page(problem.scenario, [0], []).html, tmp_path)
    assert "mean reward of 8 launches" in page.text("#about")
    page.drag(place_of(page, 70))
    index = page.run("return index")
    assert_told(page, descended(problem, 0, launch_of(page, index)))
    bounds = problem.scenario.control_bounds
    action = [2.0 * (v - bounds[n][0]) / np.ptp(bounds[n]) - 1.0 for n, v in launch_of(page, index).items()]
    context = np.array([problem.scenario.sample(np.random.default_rng(0))])
    mean = float(problem.expect(context, np.array([[action]]), "test")[0, 0])
    assert float(numbers(page)["mean reward"]) == pytest.approx(mean, abs=2e-3)


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
    marks = data_of((tmp_path / "page.html").read_text(encoding="utf-8"))["contexts"][1]["marks"]
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
