"""The ground in pages: set by vertices and bumps, its descents are those of Python; what is wrong with it is told."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sledenv.pages.kernel import descent_input
from sledenv.pages.opening import opening_descent, opening_page
from sledenv.pages.replay import replay_page
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.scene import Slope, State, checked_profile
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import resting_heights
from tests.browser import Browser, wait_until
from tests.pages.shown import assert_same, place_of, problem, put, vertices, visit, written
from tests.pages.test_kernel import in_node
from tests.profiles import random_case


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("page"), opening_page())


@pytest.fixture
def page(chromium: Browser, file: Path) -> Iterator[Browser]:
    visit(chromium, file)
    yield chromium
    assert chromium.log() == []


def assert_simulated(page: Browser, ground: list[tuple[float, float]], rounding: Any = 0.0) -> None:
    """The page shows the descent of Python over this ground, to the last bit."""
    ride = opening_descent()
    launch = [float(value) for value in page.run("return Object.values(shown.launch).map(String)")]
    length = float(page.run("return String(shown.scene.slope.length)"))
    slope = Slope(ride.slope.angle, length, profile=ground, rounding=rounding)
    assert_same(page, simulate(ride.body, ride.law, slope, State(*launch), ride.settings, record="trajectory"))


@pytest.mark.parametrize("kind", ["mouse", "touch"])
def test_a_vertex_is_dragged_and_a_link_keeps_the_ground(page: Browser, file: Path, kind: str) -> None:
    """Oracle: ``simulate`` over the ground of these vertices, bit for bit."""
    assert_same(page, opening_descent())
    before = vertices(page)
    x, y = place_of(page, *before[5])
    page.drag((x, y), (x + 6.0, y - 5.0), (x + 11.0, y - 8.0), kind=kind)
    wait_until(page, "!asking && !grabbed")
    after = vertices(page)
    assert after[:5] + after[6:] == before[:5] + before[6:]
    assert (after[5][0] > before[5][0] + 0.1, after[5][1] > before[5][1] + 0.1) == (True, True)
    assert_simulated(page, after)
    visit(page, file, page.run("return address()"))
    assert vertices(page) == after
    assert_simulated(page, after)


def test_vertices_are_added_and_removed_in_the_picture(page: Browser) -> None:
    """A vertex without a turn changes nothing until it is moved."""
    before = vertices(page)
    page.drag(place_of(page, 8.0, 0.075), kind="mouse")
    wait_until(page, "!asking && verticesOf().length === 13")
    assert_same(page, opening_descent())
    (new,) = set(vertices(page)) - set(before)
    x, y = place_of(page, *new)
    page.drag((x, y), (x, y - 6.0))
    wait_until(page, "!asking && !grabbed")
    assert_simulated(page, vertices(page))
    (moved,) = set(vertices(page)) - set(before)
    assert moved[1] > new[1]
    page.double_click(place_of(page, *moved))
    wait_until(page, "!asking && verticesOf().length === 12")
    assert_same(page, opening_descent())
    page.click("#flat")
    wait_until(page, "!asking && verticesOf().length === 0")
    assert_simulated(page, [])


def test_bends_are_set_and_a_link_keeps_them(page: Browser, file: Path) -> None:
    """Oracle: ``simulate`` over the round ground, bit for bit: one radius for all, and of each vertex its own."""
    ground = vertices(page)
    put(page, "rounding", 25.0)  # too large for the pieces
    assert_simulated(page, ground, 25.0)
    visit(page, file, page.run("return address()"))
    assert_simulated(page, ground, 25.0)
    visit(page, file, "profile=3,0,1.5;5,-0.4,0.5;7.5,0.2;9,0,2&speed=5")
    radii = [1.5, 0.5, 0.0, 2.0]
    assert page.run("return [shownOf('rounding'), verticesOf().map(one => one[2])]") == [0, radii]
    x, y = place_of(page, *vertices(page)[1])
    page.drag((x, y), (x + 8.0, y + 5.0))
    wait_until(page, "!asking && !grabbed")
    assert vertices(page)[1] != (5.0, -0.4)
    visit(page, file, page.run("return address()"))
    assert_simulated(page, vertices(page), radii)
    put(page, "rounding", 0.0)
    assert_simulated(page, vertices(page))


def test_the_ground_that_is_drawn_is_that_of_python(page: Browser, file: Path) -> None:
    """Oracle: ``Slope.height_at``; chords of bends are a thousandth of the size of the body off, or less."""
    visit(page, file, "profile=3,0,6;6,1,4;9,0.4,0.3;11,0.6;12,0,2&length=10")
    profile, radii = [(3.0, 0.0), (6.0, 1.0), (9.0, 0.4), (11.0, 0.6), (12.0, 0.0)], [6.0, 4.0, 0.3, 0.0, 2.0]
    ride = opening_descent()
    slope = Slope(ride.slope.angle, 10.0, profile=profile, rounding=radii)
    x = np.linspace(-2.0, 15.0, 4001)
    off = np.array(page.run("return arguments[0].map(x => scene.height(x))", x.tolist())) - slope.height_at(x)
    assert 0.0 < np.abs(off).max() < 1.1e-3 * ride.body.size  # along the normal of the plane, not of the bend
    drawn = page.run("return document.querySelector('.surface').getAttribute('points')")
    pixels = [[float(number) for number in point.split(",")] for point in drawn.split()][1:-1]
    there = np.array(page.run("return arguments[0].map(([column, row]) => scene.place(column, row))", pixels))
    assert len(there) > 30
    assert there[:, 1] == pytest.approx(slope.height_at(there[:, 0]), abs=0.02 / page.run("return scene.scale"))
    assert_simulated(page, profile, radii)  # the finish is on a face of a bump


def test_a_wrong_ground_is_told_with_what_helps(page: Browser) -> None:
    """Oracle: the message; the ride of the page, which stays."""
    for asked, words in (
        ("profile=3,0;2,1", "vertex 2 of the ground is at 2 m: must lie behind the one before, at 3 m; move it on"),
        ("profile=3,0;3.1,1", "the ground before vertex 2 is 84° steep to the plane: must be at most 80°"),
        ("profile=3,0", "the ground has 1 vertices: must have none, or 2 to 16384"),
        ("profile=3,0;here", "vertex 2 of the ground: must have a place and a height"),
        ("profile=3,0;5,1,-2;7,0", "vertex 2 of the ground has the radius -2 m: must be in [0, ∞) m"),
        ("rounding=-1", "rounding of all vertices = -1: must be a number from 0 to ∞ m"),
    ):
        page.run("location.hash = arguments[0]", asked)
        wait_until(page, f"$('problem').textContent.includes({json.dumps(words)}) && !asking")
    assert_same(page, opening_descent())


def test_a_body_with_sharp_corners_needs_round_tops_and_rigid_surfaces_a_plane(
    chromium: Browser, tmp_path: Path
) -> None:
    body, launch = circular_segment(60.0, 0.5, 1.9), State(0.0, 0.8, 0.0, 3.0)
    law, plane, bumpy = opening_descent().law, Slope(0.1, 12.0), "profile=4,0;5,0.3;6,0"
    page = replay_page(simulate(body, law, plane, launch, record="trajectory"), "a segment")
    visit(chromium, written(tmp_path, page), bumpy)
    assert "body as given has sharp corners: must have round ones over sharp tops" in problem(chromium)
    visit(chromium, written(tmp_path, page), f"{bumpy}&rounding=0.3")
    assert problem(chromium) == ""
    page = replay_page(simulate(body, law, plane, launch, record="trajectory", solver="rigid"), "rigid")
    visit(chromium, written(tmp_path, page))
    assert not chromium.run("return document.querySelector('[data-grab=ground], #flat, #number-rounding')")
    visit(chromium, written(tmp_path, page), bumpy)
    assert "surfaces are rigid: must be compliant over bumps" in problem(chromium)


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


def test_a_body_rests_on_the_ground_as_in_python(tmp_path: Path) -> None:
    """Oracle: ``resting_heights``, of bodies at random places of random profiles, bit for bit.

    A third of the grounds has sharp vertices alone, a third radii of all sizes, a third sharp and round ones.
    """
    cases: list[dict[str, Any]] = []
    expected = []
    for number in range(60):
        case, rng = random_case((5, number), planes=False), np.random.default_rng(number)
        x, angles = rng.uniform(-1.0, 30.0), rng.uniform(-math.pi, math.pi, 5)
        radii = 10.0 ** rng.uniform(-2.0, 1.5, len(case.slope.profile))
        radii *= rng.random(len(radii)) < (1.0, 0.0, 0.6)[number % 3]
        slope = Slope(0.1, 55.0, profile=case.slope.profile, rounding=radii)
        given = descent_input(case.body, case.law, slope, State(0.0, 10.0, 0.0))
        cases.append(given | {"x": x, "angles": angles.tolist()})
        expected.append(resting_heights(case.body.record, np.full(5, x), angles, Grounds.of((slope.vertices,))))
    file = tmp_path / "cases.json"
    file.write_text(json.dumps(cases))
    np.testing.assert_array_equal(json.loads(in_node("resting.mjs", file)), expected)
