"""The replay page: what it holds, how it is written, and what a browser shows when its slider is moved."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sledenv.machine.files import replacing
from sledenv.pages import html
from sledenv.pages.replay import Ghost, replay_page, write_replay
from sledenv.pages.words import mode_name
from sledenv.plot.riders import pieces
from sledenv.plot.shapes import film_times, pace, push_at, states_at
from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height
from tests.bodies import rod
from tests.browser import Browser, at_speed, browser, data_of, needs_chromium, wait_until
from tests.plot.outlined import RIDDEN, descent_of

SLED = circular_segment(100.0, 0.5, math.radians(110.0))
ICE = ContactLaw.from_restitution(0.5, stiffness=1e6, friction=0.05, rolling_arm=0.005)
HILL = Slope(0.15, 10.0)
ZONED = Slope(0.15, 10.0, zones=(Zone(1.0, 3.0, 0.3, 0.02), Zone(6.0, math.inf, 0.01, 0.0)))
TEMPLATES = Path(html.__file__).parent / "templates"


def dropped(body: Body = SLED, slope: Slope = HILL, **options: Any) -> Descent:
    launch = State(0.0, 0.5 + support_height(body, 0.2), 0.2, 3.0, 0.0, 0.5)
    return simulate(body, ICE, slope, launch, record="trajectory", **options)


@pytest.fixture(scope="module")
def descent() -> Descent:
    return dropped()


def test_a_page_refers_to_nothing_outside(descent: Descent) -> None:
    page = replay_page(descent, "a descent")
    assert not re.search(r"https?:|//[a-z]+\.|@import|<link|\bsrc=|url\(", page)
    assert "default-src 'none'" in page


def test_scripts_and_styles_are_no_templates() -> None:
    """Linters read them as they are, and so must jinja, which includes them in its pages."""
    files = [*TEMPLATES.glob("*.js"), *TEMPLATES.glob("*.css")]
    assert len(files) > 5
    assert [file.name for file in files if re.search("{[{%#]", file.read_text(encoding="utf-8"))] == []


def test_a_page_holds_the_descent(descent: Descent) -> None:
    data = data_of(replay_page(descent, "a descent"))
    for name in ("t", "x", "phi", "omega", "normal", "tangential"):
        assert data["rows"][name] == pytest.approx(descent.trajectory[name], rel=1e-8, abs=1e-12)
    assert len(data["contacts"]) == len(data["table"]["rows"]) == len(descent.rebounds) > 2
    assert [contact["mode"] for contact in data["contacts"]] == [mode_name(mode) for mode in descent.rebounds["mode"]]
    assert data["film"]["film"][-1] == pytest.approx(pace(descent)[-1, 0])
    sums = np.sum(list(data["energy"].values()), axis=0)
    assert sums == pytest.approx(sums[0], rel=0.02)


def test_a_title_cannot_break_out_of_its_page(descent: Descent) -> None:
    title = "</script><script>alert(1)</script> <b>&amp; /*DATA*/"
    page = replay_page(descent, title)
    assert page.count("</script>") == replay_page(descent, "").count("</script>")
    assert data_of(page)["title"] == title


UGLY = {
    "no rebounds": lambda: dropped(max_time=1e-3),
    "no time": lambda: dropped(max_time=1e-12),
    "rigid": lambda: dropped(solver="rigid"),
    "without end": lambda: dropped(slope=Slope(0.2), max_time=2.0),
    "long": lambda: dropped(slope=Slope(0.15, 3000.0), max_time=4.0),
    "rod": lambda: dropped(rod(2.0, 0.5, 0.17), max_time=1.0),
    "point": lambda: dropped(segment(1.0, 0.0, 0.0, 1.0), max_time=1.0),
    "boulder": lambda: descent_of("boulder", "compliant"),
    "rider": lambda: descent_of("rider", "compliant"),
    "ridden": lambda: descent_of("ridden", "rigid"),
    "zones": lambda: dropped(slope=Slope(0.2, zones=ZONED.zones), max_time=2.0),
    "long zones": lambda: dropped(slope=Slope(0.15, 3000.0, zones=ZONED.zones), max_time=4.0),
    "line": lambda: descent_of("line", "rigid"),
    "overflow": lambda: broken(dropped()),
}


def broken(descent: Descent) -> Descent:
    trajectory, rebounds = descent.trajectory.copy(), descent.rebounds.copy()
    trajectory["x"][40:], trajectory["omega"][60:], rebounds["u_after"][-1] = math.nan, math.inf, math.nan
    return replace(descent, trajectory=trajectory, rebounds=rebounds, state=State.found([math.nan] * 6))


@pytest.mark.parametrize("name", UGLY)
def test_ugly_descents_have_a_page(name: str) -> None:
    data = data_of(replay_page(UGLY[name](), name))
    assert len(data["rows"]["t"]) > 0
    assert np.isfinite(data["rows"]["x"]).all()


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
@pytest.mark.parametrize("name", ["boulder", "rider"])
def test_a_page_shows_any_body_and_names_its_parts(name: str, solver: str) -> None:
    """Oracle: the log of the descent, with the place where each contact began; the support height of the body."""
    descent = descent_of(name, solver)
    body, data = descent.body, data_of(replay_page(descent, name))
    expected = [body.parts[code - 1] for code in descent.rebounds["feature"].tolist()]
    assert [contact["feature"] for contact in data["contacts"]] == expected
    assert [row[3] for row in data["table"]["rows"]] == expected
    assert all(part in data["setting"] for part in body.parts)
    assert [contact["from"] for contact in data["contacts"]] == pytest.approx(descent.rebounds["x_contact"], abs=1e-6)
    rows, begun = data["rows"], descent.rebounds["t_touchdown"][0]
    first = next(i for i, t in enumerate(rows["t"]) if t >= begun - 1e-9)
    assert rows["place"][first] == pytest.approx(descent.rebounds["x_contact"][0], abs=1e-6)
    outline, heavy = np.array(data["body"]["outline"]), np.array(data["body"]["heavy"])
    assert data["size"] == pytest.approx(body.size)
    for phi in np.linspace(0.0, 6.0, 25).tolist():
        lowest = (outline @ (math.sin(phi), math.cos(phi))).min()
        assert -lowest == pytest.approx(support_height(body, phi), abs=2e-3 * body.size)
    assert heavy[:, 1].max() == pytest.approx(0.0, abs=1e-9)


def test_a_page_holds_the_zones_and_the_friction_of_each_place() -> None:
    """Oracle: the slope of the descent."""
    data = data_of(replay_page(dropped(slope=ZONED), "zones"))
    assert [(zone["begin"], zone["end"]) for zone in data["slope"]["zones"]] == [(1.0, 3.0), (6.0, None)]
    expected = {True: 0.3, False: ICE.friction}
    for place, friction in zip(data["rows"]["place"], data["rows"]["friction"], strict=True):
        assert friction == (0.01 if place >= 6.0 else expected[1.0 <= place < 3.0])
    for contact in data["contacts"]:
        assert contact["friction"] == (0.01 if contact["place"] >= 6.0 else expected[1.0 <= contact["place"] < 3.0])
    plain = data_of(replay_page(dropped(), "none"))
    assert plain["slope"]["zones"] == []
    assert "pieces" not in plain["body"]


def test_a_page_holds_the_rider() -> None:
    """Oracle: the pieces that figures show."""
    drawn = data_of(replay_page(descent_of("ridden", "compliant"), "rider"))["body"]
    assert [piece["part"] for piece in drawn["pieces"]] == [piece.part for piece in pieces(RIDDEN)]
    assert drawn["pieces"][0]["points"] == pytest.approx(pieces(RIDDEN)[0].points, abs=1e-8)


def test_a_descent_without_trajectory_is_refused_and_nothing_is_written(descent: Descent, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text("older")
    with pytest.raises(ValueError, match='record="trajectory"'):
        write_replay(replace(descent, trajectory=descent.trajectory[:0]), page, "none")
    assert [file.name for file in tmp_path.iterdir()] == ["page.html"]
    assert page.read_text() == "older"
    write_replay(descent, page, "new")
    assert [file.name for file in tmp_path.iterdir()] == ["page.html"]
    assert data_of(page.read_text(encoding="utf-8"))["title"] == "new"


def test_an_interrupt_leaves_the_older_page(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text("older")
    with pytest.raises(KeyboardInterrupt), replacing(page, ".html") as scratch:  # noqa: PT012
        scratch.write_text("half")
        raise KeyboardInterrupt
    assert [file.read_text() for file in tmp_path.iterdir()] == ["older"]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("page.png", "page.png: must end in .html"),
        ("missing/page.html", "there is no folder"),
        ("folder.html", "folder.html is a folder"),
    ],
)
def test_a_wrong_place_is_named(name: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "folder.html").mkdir()
    with pytest.raises(OSError, match=message), replacing(tmp_path / name, ".html"):
        raise AssertionError("not reached")


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture
def page(chromium: Browser, descent: Descent, tmp_path: Path) -> Iterator[Browser]:
    file = tmp_path / "replay.html"
    write_replay(descent, file, "a <descent>")
    chromium.log()
    chromium.open(file)
    yield chromium
    assert chromium.log() == []  # no error, and no request that the page's policy refused


def shown_time(page: Browser) -> float:
    return float(page.text("#time").removesuffix(" s"))


def sled_columns(page: Browser) -> tuple[float, float]:
    """Where the sled begins and ends on the screen [px]."""
    left, right = page.run(
        "const box = document.querySelector('#sled').getBoundingClientRect(); return [box.left, box.right]"
    )
    return left, right


@needs_chromium
def test_the_page_opens_at_the_launch(page: Browser, descent: Descent) -> None:
    assert page.text("#title") == "a <descent>"
    assert str(descent.status) in page.text("#outcome")
    assert shown_time(page) == 0.0
    assert page.text("#contact") == "in flight"
    assert page.run("return document.querySelectorAll('.pose').length") > 5
    assert page.run("return document.querySelectorAll('#rebounds tbody tr').length") == len(descent.rebounds)
    assert page.run("return document.querySelectorAll('#series svg').length") == 4
    assert page.run("return performance.getEntriesByType('resource').length") == 0


@needs_chromium
def test_a_recorded_motion_lies_on_the_simulated_one(chromium: Browser, descent: Descent, tmp_path: Path) -> None:
    """Oracle: poses of the simulated descent itself, .1 m farther along the slope."""
    times = np.linspace(0.0, descent.time, 40)
    shift = np.array([0.1, 0.0, 0.0])
    poses = states_at(descent.trajectory, times)[:, :3] + shift
    file = tmp_path / "recorded.html"
    ghost = Ghost(times, poses, np.tile(shift, (len(times), 1)), used=30)
    file.write_text(replay_page(descent, "recorded", ghost), encoding="utf-8")
    chromium.open(file)
    assert chromium.log() == []
    places = "['#sled', '#ghost'].map(name => document.querySelector(name).getBoundingClientRect().left)"
    sled, recorded = chromium.run(f"return {places}")
    width = chromium.run(
        "return document.querySelector('#scene').getBoundingClientRect().width / scene.W * scene.scale"
    )
    assert recorded - sled == pytest.approx(0.1 * math.cos(HILL.angle) * width, abs=2.0)
    assert chromium.run("return document.querySelectorAll('#series svg').length") == 6
    chromium.run(f"goTo({descent.time})")
    colours = chromium.run("return document.querySelector('#ghost').getAttribute('stroke')")
    assert colours == "#8d98a3"  # beyond what was used


@needs_chromium
def test_the_slider_scrubs_through_the_film(page: Browser, descent: Descent) -> None:
    """Oracle: the film of the renderer; one step of the slider is a sixtieth of a second of it."""
    times = film_times(descent, 60.0)
    start, _ = sled_columns(page)
    page.press("#slider", "\ue014" * 5)  # the right arrow key
    assert shown_time(page) == pytest.approx(times[5], abs=1e-4)
    last = int(page.run("return document.querySelector('#slider').max"))
    seen = []
    for step in (10, last // 3, last // 2, last):
        page.run(
            "const slider = document.querySelector('#slider'); slider.value = arguments[0];"
            "slider.dispatchEvent(new Event('input'))",
            step,
        )
        time = shown_time(page)
        assert time == pytest.approx(times[min(step, len(times) - 1)], abs=1e-4)
        x = float(states_at(descent.trajectory, [time])[0, 0])
        told = page.text("#now dd").removesuffix(" m")
        assert float(told) == pytest.approx(x, abs=2e-3)
        seen.append(sled_columns(page)[0])
    assert start < seen[0] < seen[1] < seen[2] < seen[3]
    assert page.text("#contact").startswith(("the end: finish", "contact"))


@needs_chromium
def test_a_row_of_the_table_shows_its_contact(page: Browser, descent: Descent) -> None:
    """Oracle: force, grip and mode that the descent recorded."""
    page.click("#rebounds tbody tr:nth-child(2)")
    rebound = descent.rebounds[1]
    time = shown_time(page)
    assert rebound["t"] - rebound["duration"] <= time <= rebound["t"]
    lines = page.text("#contact").splitlines()
    assert lines[0] == f"contact 2, arc: {mode_name(rebound['mode'])}"
    found = re.search(r"force ([\d.]+) kN, grip ([\d.]+)", lines[1])
    push = push_at(descent, time)
    assert found is not None
    assert push is not None
    assert 1e3 * float(found[1]) == pytest.approx(push.normal, rel=0.02)
    assert float(found[2]) == pytest.approx(abs(push.tangential) / (ICE.friction * push.normal), abs=0.02)
    assert page.run("return document.querySelectorAll('#cone, #force').length") == 2
    assert page.run("return document.querySelectorAll('#closeup svg').length") == 2
    assert page.run("return document.querySelector('tr.current').cells[0].textContent") == "2"
    page.click("#next")
    assert page.text("#contact").startswith("contact 3, ")
    page.click("#previous")
    page.click("#previous")
    assert page.text("#contact").startswith("contact 1, ")
    page.click("#previous")
    assert shown_time(page) == 0.0
    assert page.run("return document.querySelectorAll('#cone, #force').length") == 0


@needs_chromium
def test_zones_are_drawn_below_the_surface(chromium: Browser, tmp_path: Path) -> None:
    """Oracle: the places of the zones, which the scene projects; their words are in the picture."""
    file = tmp_path / "zones.html"
    write_replay(dropped(slope=ZONED), file, "zones")
    chromium.open(file)
    assert chromium.log() == []
    corners = chromium.run(
        "return [...document.querySelectorAll('.zone')].map(one => [...one.points].map(p => [p.x, p.y]))"
    )
    assert len(corners) == 2
    for (begin, end, *below), place in zip(corners, (1.0, 6.0), strict=True):
        assert begin == pytest.approx(chromium.run("return scene.pixel(arguments[0], 0)", place), abs=0.02)
        assert end[0] > begin[0]
        assert min(row for _, row in below) > begin[1]
    assert corners[0][1] == pytest.approx(chromium.run("return scene.pixel(3, 0)"), abs=0.02)
    said = chromium.run(
        "return [...document.querySelectorAll('#world text')].filter(one => one.textContent.startsWith('friction '))"
        ".map(one => [one.textContent, one.getBoundingClientRect().bottom])"
    )
    bottom = chromium.run("return $('scene').getBoundingClientRect().bottom")
    assert [text for text, _ in said] == ["friction 0.3", "friction 0.01"]
    assert max(place for _, place in said) < bottom


@needs_chromium
def test_the_part_that_touches_is_marked(chromium: Browser, tmp_path: Path) -> None:
    """Oracle: the trajectory at each touchdown; a body that lies on two parts may be told to touch with either."""
    descent = descent_of("ridden", "compliant")
    file = tmp_path / "rider.html"
    write_replay(descent, file, "rider")
    chromium.open(file)
    marked = (
        "return [...new Set([...document.querySelectorAll('#sled polygon')]"
        ".filter(one => one.getAttribute('fill') === D.body.touched).map(one => one.dataset.part))]"
    )
    assert chromium.run(marked) == []
    for i, rebound in enumerate(descent.rebounds):
        chromium.run("show(film[2 * arguments[0] + 1] + 1e-6)", i)
        push = push_at(descent, float(rebound["t_touchdown"]))
        assert push is not None
        part = RIDDEN.parts[push.feature - 1]
        assert chromium.run(marked) == [part]
        assert chromium.text("#contact").startswith(f"contact {i + 1}, {part}: ")
    assert chromium.run("return document.querySelectorAll('.pose').length") > 2
    assert chromium.log() == []


@needs_chromium
def test_a_click_on_a_plot_goes_there(page: Browser, descent: Descent) -> None:
    page.click("#series svg")  # its middle
    width, left, right = float(page.run("return plotted")), 58.0, 10.0
    assert shown_time(page) == pytest.approx(
        descent.time * (0.5 * width - left) / (width - left - right), abs=0.01 * descent.time
    )


@needs_chromium
@pytest.mark.parametrize("width", [390, 1280])
def test_letters_are_large_enough_to_read(chromium: Browser, descent: Descent, tmp_path: Path, width: int) -> None:
    file = tmp_path / "replay.html"
    write_replay(descent, file, "a descent")
    chromium.screen(width, 900)
    chromium.open(file)
    heights = "return [...document.querySelectorAll('svg text')].map(one => one.getBoundingClientRect().height)"
    assert min(chromium.run(heights)) > 10.0
    assert chromium.run("return document.documentElement.scrollWidth") <= width
    chromium.screen(1280, 1400)


@needs_chromium
def test_play_runs_to_the_end_and_pause_stops(page: Browser, descent: Descent) -> None:
    at_speed(page, 0.001)  # the film does not end while a busy machine is late to look
    page.click("#play")
    assert page.text("#play") == "Pause"
    wait_until(page, "document.querySelector('#time').textContent !== '0.0000 s'")
    page.click("#play")
    paused = shown_time(page)
    assert 0.0 < paused < descent.time
    page.run("return new Promise(done => setTimeout(done, 200))")
    assert shown_time(page) == paused
    at_speed(page, 1000)
    page.click("#play")
    wait_until(page, "document.querySelector('#play').textContent === 'Play'")
    assert shown_time(page) == pytest.approx(descent.time, abs=1e-4)
    assert page.text("#play") == "Play"


@needs_chromium
@pytest.mark.parametrize("name", UGLY)
def test_ugly_pages_are_shown_without_an_error(name: str, chromium: Browser, tmp_path: Path) -> None:
    file = tmp_path / "ugly.html"
    write_replay(UGLY[name](), file, name)
    chromium.log()
    chromium.open(file)
    for share in (0.0, 0.3, 0.6, 1.0):
        chromium.run("show(arguments[0] * length)", share)
        assert "NaN" not in chromium.run("return document.documentElement.outerHTML.split('<script')[0]")
    chromium.click("#next")
    assert chromium.log() == []
