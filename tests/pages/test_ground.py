"""The ground in pages: set by vertices and bumps, its descents are those of Python; what is wrong with it is told."""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

import sledenv
from sledenv.pages.kernel import KERNEL, descent_input
from sledenv.pages.notebook import descent_view
from sledenv.pages.opening import opening_descent, opening_page
from sledenv.pages.replay import replay_page
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.records import Status
from sledenv.simulation.scene import Slope, State, checked_profile
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import resting_heights
from tests.browser import Browser, needs_chromium, patient, wait_until
from tests.pages.test_kernel import NODE, needs_node
from tests.pages.test_play import assert_same, put, run_lines, select, told_result, visit
from tests.profiles import random_case

RUNNER: Final = Path(__file__).with_name("resting.mjs")
TEMPLATES: Final = KERNEL.parent / "templates"


# The ride that the page opens with.


@pytest.mark.jit_only
def test_the_page_opens_on_a_ride_with_several_flights_that_finishes() -> None:
    """Oracle: ``simulate``, of the ride and of four launches beside it."""
    ride = opening_descent()
    assert ride.status is Status.FINISH
    begins, ends = np.append(0.0, ride.rebounds["t"]), np.append(ride.rebounds["t_touchdown"], ride.time)
    assert np.count_nonzero(ends - begins > 0.25) >= 3
    for faster in (-0.5, 0.5):
        for spin in (-0.3, 0.3):
            launch = ride.launch._replace(u=ride.launch.u + faster, omega=spin)
            assert simulate(ride.body, ride.law, ride.slope, launch, ride.settings).status is Status.FINISH


@pytest.mark.jit_only
def test_the_picture_is_in_the_page_before_a_script_runs() -> None:
    """Oracle: poses of the descent, each within the picture and above the ground."""
    page = opening_page()
    picture = page[page.index('<svg id="scene"') : page.index("</svg>")]
    assert picture.count('<use href="#drawn"') > 8
    assert picture.count("<polyline") == 3  # surface, finish and path
    assert "NaN" not in picture
    assert "nan" not in picture


# What a browser shows.


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("page") / "play.html"
    place.write_text(patient(opening_page()), encoding="utf-8")
    return place


@pytest.fixture
def page(chromium: Browser, file: Path) -> Iterator[Browser]:
    visit(chromium, file)
    yield chromium
    assert chromium.log() == []


def vertices(page: Browser) -> list[tuple[float, float]]:
    return [(x, y) for x, y, _ in page.run("return verticesOf()")]


def place_of(page: Browser, x: float, y: float) -> tuple[float, float]:
    """Where a place of the slope is in the window [px]."""
    column, row = page.run(
        "const box = $('scene').getBoundingClientRect(); const [column, row] = scene.pixel(...arguments);"
        "return [box.left + column * box.width / scene.W, box.top + row * box.height / scene.H]",
        x,
        y,
    )
    return column, row


def assert_simulated(page: Browser, ground: list[tuple[float, float]], rounding: Any = 0.0) -> None:
    """The page shows the descent of Python over this ground, to the last bit; so do its lines of Python."""
    ride = opening_descent()
    launch = [float(value) for value in page.run("return Object.values(shown.launch).map(String)")]
    length = float(page.run("return String(shown.scene.slope.length)"))
    slope = Slope(ride.slope.angle, length, profile=ground, rounding=rounding)
    assert_same(page, simulate(ride.body, ride.law, slope, State(*launch), ride.settings, record="trajectory"))
    assert run_lines(page) == told_result(page)


@needs_chromium
@pytest.mark.jit_only
def test_the_page_shows_the_ride(page: Browser) -> None:
    """Oracle: ``simulate``, bit for bit."""
    assert_same(page, opening_descent())
    assert run_lines(page) == told_result(page)
    assert not page.run("return $('problem').textContent")


@needs_chromium
@pytest.mark.jit_only
@pytest.mark.parametrize("kind", ["mouse", "touch"])
def test_a_vertex_is_dragged_and_the_descent_follows(page: Browser, file: Path, kind: str) -> None:
    """Oracle: ``simulate`` over the ground of these vertices, bit for bit."""
    before, result = vertices(page), told_result(page)
    x, y = place_of(page, *before[5])
    page.drag((x, y), (x + 6.0, y - 5.0), (x + 11.0, y - 8.0), kind=kind)
    wait_until(page, "!asking && !grabbed")
    after = vertices(page)
    assert after[:5] + after[6:] == before[:5] + before[6:]
    assert after[5][0] > before[5][0] + 0.1
    assert after[5][1] > before[5][1] + 0.1
    assert told_result(page) != result
    assert_simulated(page, after)
    address = page.run("return address()")
    visit(page, file, f"#{address}")
    assert vertices(page) == after
    assert_simulated(page, after)


@needs_chromium
@pytest.mark.jit_only
def test_the_ground_follows_the_hand(page: Browser) -> None:
    """The land is drawn while a vertex is dragged, where it is wrong too, and the page says what helps."""
    before = page.run("return document.querySelector('.surface').getAttribute('points')")
    page.run(
        "const box = $('scene').getBoundingClientRect(); const corner = verticesOf()[1];"
        "grabbed = { what: 'vertex', box, from: corner, vertex: 1, corner };"
        "const [column, row] = scene.pixel(corner[0] + 1, corner[1]);"
        "drag({ clientX: box.left + column * box.width / scene.W, clientY: box.top + row * box.height / scene.H })"
    )
    wait_until(page, "!asking")
    assert page.run("return document.querySelector('.surface').getAttribute('points')") != before
    assert "vertex 3 of the ground is at 5 m: must lie behind the one before" in page.text("#problem")
    assert page.run("return $('land').classList.contains('wrong')")
    page.click("#reset")
    page.run("grabbed = null; changed()")
    wait_until(page, "!asking")
    assert not page.run("return $('problem').textContent")
    assert_same(page, opening_descent())


@needs_chromium
@pytest.mark.jit_only
def test_vertices_are_added_and_removed_in_the_picture(page: Browser) -> None:
    """A vertex without a turn changes nothing until it is moved."""
    before, result = vertices(page), told_result(page)
    x, y = place_of(page, 8.0, 0.075)
    page.drag((x, y), kind="mouse")
    wait_until(page, "!asking && verticesOf().length === 13")
    assert told_result(page) == result
    (new,) = set(vertices(page)) - set(before)
    x, y = place_of(page, *new)
    page.drag((x, y), (x, y - 6.0))
    wait_until(page, "!asking && !grabbed")
    assert told_result(page) != result
    assert_simulated(page, vertices(page))
    (moved,) = set(vertices(page)) - set(before)
    x, y = place_of(page, *moved)
    page.double_click((x, y))
    wait_until(page, "!asking && verticesOf().length === 12")
    assert vertices(page) == before
    assert told_result(page) == result


@needs_chromium
@pytest.mark.jit_only
def test_vertices_are_typed_added_and_removed_in_the_panel(page: Browser) -> None:
    """Oracle: ``simulate`` over the ground of these vertices, bit for bit."""
    page.run(
        'const field = document.querySelector(\'[data-vertex="6"][data-axis="1"]\'); field.value = 0.45;'
        "field.dispatchEvent(new Event('input', { bubbles: true }))"
    )
    wait_until(page, "!asking")
    assert vertices(page)[6] == (11.5, 0.45)
    assert_simulated(page, vertices(page))
    page.click("#vertex")
    wait_until(page, "!asking && verticesOf().length === 13")
    assert_simulated(page, vertices(page))
    page.run("document.querySelector('[data-drop=\"2\"]').click()")
    wait_until(page, "!asking && verticesOf().length === 12")
    assert_simulated(page, vertices(page))
    page.click("#flat")
    wait_until(page, "!asking && verticesOf().length === 0")
    assert_simulated(page, [])


@needs_chromium
@pytest.mark.jit_only
def test_bumps_are_set(page: Browser) -> None:
    """Oracle: ``simulate`` over bumps of this shape, as many as end before the finish."""
    put(page, "bump_height", 0.2)
    put(page, "bump_face", 2.0)
    put(page, "bump_top", 0.0)
    put(page, "bump_gap", 2.5)
    ground = [(x, y) for k in range(3) for x, y in ((2.5, 0.0), (4.5, 0.2), (6.5, 0.0))]
    ground = [(x + 6.5 * (k // 3), y) for k, (x, y) in enumerate(ground)]
    assert vertices(page) == ground
    assert_simulated(page, ground)
    put(page, "bump_gap", -8.0)
    assert "from one to the next = -8: must be a number from 0.5 to 20 m" in page.text("#problem")
    put(page, "bump_height", 0.0)
    put(page, "bump_gap", 1.0)
    assert vertices(page) == []
    assert_simulated(page, [])


@needs_chromium
@pytest.mark.jit_only
def test_bends_are_set_and_a_link_keeps_them(page: Browser, file: Path) -> None:
    """Oracle: ``simulate`` over the round ground, bit for bit: one radius for all, and of each vertex its own."""
    ground, sharp = vertices(page), told_result(page)
    for radius in (0.4, 25.0):  # the second one is too large for the pieces
        put(page, "rounding", radius)
        assert told_result(page) != sharp
        assert_simulated(page, ground, radius)
    visit(page, file, f"#{page.run('return address()')}")
    assert_simulated(page, ground, 25.0)
    put(page, "bump_height", 0.25)
    assert_simulated(page, vertices(page), 25.0)
    visit(page, file, "#profile=3,0,1.5;5,-0.4,0.5;7.5,0.2;9,0,2&speed=5")
    radii = [1.5, 0.5, 0.0, 2.0]
    assert page.run("return [shownOf('rounding'), verticesOf().map(one => one[2])]") == [0, radii]
    assert_simulated(page, vertices(page), radii)
    x, y = place_of(page, *vertices(page)[1])
    page.drag((x, y), (x + 8.0, y + 5.0))
    wait_until(page, "!asking && !grabbed")
    assert vertices(page)[1] != (5.0, -0.4)
    assert_simulated(page, vertices(page), radii)
    visit(page, file, f"#{page.run('return address()')}")
    assert_simulated(page, vertices(page), radii)
    put(page, "rounding", -1.0)
    assert "rounding of all vertices = -1: must be a number from 0 to ∞ m" in page.text("#problem")
    put(page, "rounding", 0.0)
    assert_simulated(page, vertices(page))


@needs_chromium
@pytest.mark.jit_only
def test_the_ground_that_is_drawn_is_that_of_python(page: Browser) -> None:
    """Oracle: ``Slope.height_at``; chords of bends are a thousandth of the size of the body off, or less."""
    page.run("location.hash = 'profile=3,0,6;6,1,4;9,0.4,0.3;11,0.6;12,0,2&length=10'")
    wait_until(page, "!asking && shown.scene.slope.length === 10")
    profile, radii = [(3.0, 0.0), (6.0, 1.0), (9.0, 0.4), (11.0, 0.6), (12.0, 0.0)], [6.0, 4.0, 0.3, 0.0, 2.0]
    ride = opening_descent()
    slope = Slope(ride.slope.angle, 10.0, profile=profile, rounding=radii)
    line = np.array(page.run("return scene.slope.line.x.map((x, i) => [x, scene.slope.line.y[i]])"))
    assert line[:, 1] == pytest.approx(slope.height_at(line[:, 0]), abs=1e-12)
    x = np.linspace(-2.0, 15.0, 4001)
    off = np.array(page.run("return arguments[0].map(x => scene.height(x))", x.tolist())) - slope.height_at(x)
    assert 0.0 < np.abs(off).max() < 1.1e-3 * ride.body.size  # along the normal of the plane, not of the bend
    drawn = page.run("return document.querySelector('.surface').getAttribute('points')")
    pixels = [[float(number) for number in point.split(",")] for point in drawn.split()][1:-1]
    there = np.array(page.run("return arguments[0].map(([column, row]) => scene.place(column, row))", pixels))
    assert len(there) > 30
    assert there[:, 1] == pytest.approx(slope.height_at(there[:, 0]), abs=0.02 / page.run("return scene.scale"))
    assert_simulated(page, profile, radii)  # the finish is on a face of a bump


@needs_chromium
@pytest.mark.jit_only
def test_a_bend_that_is_touched_is_named(page: Browser) -> None:
    """Oracle: the codes of the contacts."""
    put(page, "rounding", 2.0)
    codes = page.run("return [...new Set(shown.contacts.ground)]")
    assert any(code % 2 for code in codes)
    names = page.run(
        "return shown.rebounds.t.keys().flatMap(i => { showRebound(i);"
        "return [...document.querySelectorAll('#forces .legend span')].map(one => one.textContent) }).toArray()"
    )
    assert any(" on bend " in name for name in names)
    assert not any(" on vertex " in name for name in names)
    assert "bend" not in page.run("return csvOf(shown)")  # tables number vertices


@needs_chromium
@pytest.mark.jit_only
def test_a_wrong_ground_is_told_with_what_helps(page: Browser) -> None:
    """Oracle: the message; the ride of the page, which stays."""
    for asked, words in (
        ("profile=3,0;2,1", "vertex 2 of the ground is at 2 m: must lie behind the one before, at 3 m; move it on"),
        ("profile=3,0;3.1,1", "the ground before vertex 2 is 84° steep to the plane: must be at most 80°"),
        ("profile=3,0", "the ground has 1 vertices: must have none, or 2 to 16384"),
        ("profile=3,0;here", "vertex 2 of the ground: must have a place and a height"),
        ("profile=3,0;5,1,-2;7,0", "vertex 2 of the ground has the radius -2 m: must be in [0, ∞) m"),
        ("body=segment&rounding=0", "segment has sharp corners: must have round ones over sharp tops"),
        ("solver=rigid", "surfaces are rigid: must be compliant over bumps"),
    ):
        page.run("location.hash = arguments[0]", asked)
        wait_until(page, f"$('problem').textContent.includes({json.dumps(words)})")
        wait_until(page, "!asking")
        assert_same(page, opening_descent())


@needs_chromium
@pytest.mark.jit_only
def test_what_bumps_do_not_allow_is_told(page: Browser) -> None:
    select(page, "solver", "rigid")
    wait_until(page, "!asking")
    assert "surfaces are rigid: must be compliant over bumps" in page.text("#problem")
    select(page, "solver", "compliant")
    wait_until(page, "!asking")
    segment = page.run("return String(E.bodies.findIndex(one => one.sharp))")
    select(page, "body", segment)
    wait_until(page, "!asking")
    assert "has sharp corners: must have round ones over sharp tops; round these" in page.text("#problem")
    put(page, "rounding", 0.25)
    assert not page.run("return $('problem').textContent")
    assert run_lines(page) == told_result(page)
    put(page, "rounding", 0.0)
    page.click("#flat")
    wait_until(page, "!asking")
    assert not page.run("return $('problem').textContent")
    assert run_lines(page) == told_result(page)


@needs_chromium
@pytest.mark.jit_only
def test_vertices_without_a_turn_are_left_out_as_in_python(page: Browser) -> None:
    """Oracle: ``Slope.profile`` and its rounding, of straight pieces cut at random places."""
    rng = np.random.default_rng(4)
    for number in range(60):
        corners = np.stack([np.cumsum(rng.uniform(0.5, 3.0, 6)), rng.choice([0.0, 0.3, 0.5], 6)], axis=-1)
        x = np.sort(np.r_[corners[:, 0], rng.uniform(corners[0, 0] - 1.0, corners[-1, 0] + 1.0, 8)])
        given = np.stack([x, np.interp(x, *corners.T)], axis=-1) if number else np.array([(0.0, 0.0), (2.0, 0.0)])
        radii = rng.uniform(0.0, 2.0, len(given))
        found = page.run("return turning(arguments[0])", np.column_stack([given, radii]).tolist())
        assert tuple(map(tuple, found)) == checked_profile(given, radii)


@needs_chromium
@pytest.mark.jit_only
def test_forces_stand_on_the_piece_that_is_touched(page: Browser) -> None:
    """Oracle: the normals of the pieces of the ground; the contact lies on the surface that is drawn."""
    ride = opening_descent()
    steep = np.flatnonzero(np.abs(ride.contacts["normal_x"]) > 0.15)
    row = ride.contacts[steep[len(steep) // 2]]
    page.run("goTo(arguments[0])", float(row["t"]))
    cone = page.run("return document.querySelector('.cone').getAttribute('points')")
    foot, left, right = (np.array(one.split(","), float) for one in cone.split())
    axis = 0.5 * (left + right) - foot
    cosine, sine = math.cos(ride.slope.angle), math.sin(ride.slope.angle)
    normal = row["normal_x"] * cosine + row["normal_y"] * sine, row["normal_y"] * cosine - row["normal_x"] * sine
    assert axis / np.hypot(*axis) == pytest.approx([normal[0], -normal[1]], abs=0.02)
    surface = page.run("return scene.pixel(arguments[0], scene.height(arguments[0]))", float(row["x"]))
    assert foot == pytest.approx(surface, abs=0.3)


@needs_chromium
@pytest.mark.jit_only
def test_a_page_over_bumps_is_not_too_wide_or_too_small(chromium: Browser, file: Path) -> None:
    chromium.screen(390, 900)
    visit(chromium, file)
    chromium.must_be_readable(390)


# Pages of one descent.


def _long_ride() -> Descent:
    """A sled over many bumps, far more than a picture holds."""
    ride = opening_descent()
    profile = [(x + 6.5 * k, y) for k in range(30) for x, y in ride.slope.profile[:4]]
    slope = Slope(ride.slope.angle, 220.0, profile=profile)
    return simulate(ride.body, ride.law, slope, ride.launch, ride.settings, record="trajectory")


@needs_chromium
@pytest.mark.jit_only
def test_a_replay_over_a_profile_follows_the_sled(chromium: Browser, tmp_path: Path) -> None:
    """Oracle: the descent itself, bit for bit; the sled stays in the picture."""
    descent = _long_ride()
    place = tmp_path / "replay.html"
    place.write_text(patient(replay_page(descent, "a long ride")), encoding="utf-8")
    visit(chromium, place)
    assert_same(chromium, descent)
    assert chromium.run("return scene.follow")
    for share in (0.3, 0.6, 1.0):
        chromium.run("goTo(arguments[0])", share * descent.time)
        inside = chromium.run(
            "const one = $('sled').getBoundingClientRect(); const box = $('scene').getBoundingClientRect();"
            "return one.left >= box.left && one.right <= box.right && one.top >= box.top && one.bottom <= box.bottom"
        )
        assert inside
    assert chromium.log() == []


def test_a_notebook_shows_a_descent_over_a_profile() -> None:
    view = descent_view(opening_descent())
    assert "<iframe" in view
    assert "href=&quot;#drawn&quot;" in view or "href=&#34;#drawn" in view


# The launch.


@needs_node
@pytest.mark.jit_only
def test_a_body_rests_on_the_ground_as_in_python(tmp_path: Path) -> None:
    """Oracle: ``resting_heights``, of bodies at random places of random profiles, bit for bit.

    A third of the grounds has sharp vertices alone, a third radii of all sizes, a third sharp and round ones.
    """
    cases: list[dict[str, Any]] = []
    expected = []
    for number in range(150):
        case, rng = random_case((5, number), planes=False), np.random.default_rng(number)
        x, angles = rng.uniform(-1.0, 30.0), rng.uniform(-math.pi, math.pi, 5)
        radii = 10.0 ** rng.uniform(-2.0, 1.5, len(case.slope.profile))
        radii *= rng.random(len(radii)) < (1.0, 0.0, 0.6)[number % 3]
        slope = Slope(0.1, 55.0, profile=case.slope.profile, rounding=radii)
        given = descent_input(case.body, case.law, slope, State(0.0, 10.0, 0.0))
        given |= {"x": x, "angles": angles.tolist()}
        cases.append(given)
        expected.append(resting_heights(case.body.record, np.full(5, x), angles, Grounds.of((slope.vertices,))))
    file = tmp_path / "cases.json"
    file.write_text(json.dumps(cases))
    assert NODE is not None
    command = [NODE, RUNNER, TEMPLATES / "kernel.js", KERNEL, file]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    np.testing.assert_array_equal(json.loads(done.stdout), expected)


def test_the_sled_of_the_ride_is_that_of_python() -> None:
    assert opening_descent().body == sledenv.sled()
