"""The page that simulates: its numbers are those of Python, and what it is asked for in vain it says."""

from __future__ import annotations

import base64
import json
import math
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

import sledenv
from sledenv import Body
from sledenv.bodies import Arc
from sledenv.pages.kernel import KERNEL
from sledenv.pages.play import Mark, Played, play_page
from sledenv.scenarios.scenario import Context, Scenario, load_scenario, scenario_names
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.simulate import simulate, simulate_batch
from sledenv.simulation.sleds import sled
from sledenv.simulation.support import support_height
from tests.browser import Browser, assert_needs_nothing, data_of, wait_until
from tests.own_scenarios import own_scenario
from tests.pages.shown import assert_same, numbers, problem, put, run_lines, told_launch, visit, written

DEGREE: Final = math.pi / 180.0


def drawn(name: str, seed: int = 3) -> tuple[Scenario, Context]:
    scenario = load_scenario(name)
    return scenario, scenario.sample(np.random.default_rng(seed))


def page_of(name: str, solver: Any = "compliant") -> str:
    scenario, context = drawn(name)
    return play_page(scenario, [Played("drawn", context)], solver)


def in_python(scenario: Scenario, context: Context, solver: Any = "compliant") -> Descent:
    return simulate(*scenario.given(context), scenario.settings(solver), record="trajectory")


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_has_a_page_that_refers_to_nothing_outside(name: str) -> None:
    assert_needs_nothing(page_of(name))


@pytest.mark.parametrize("name", ["boulders", "measured"])
def test_a_page_holds_the_kernel_and_what_its_bodies_are_made_of(name: str) -> None:
    """Oracle: the file of the kernel; the bodies that the lines of Python make."""
    data = data_of(page_of(own_scenario(name)))
    assert zlib.decompress(base64.b64decode(data["kernel"])) == KERNEL.read_bytes()
    bodies = json.loads(data["exact"])["bodies"]
    assert len(bodies) > len(load_scenario(own_scenario(name)).all_bodies()) > 1
    for body in bodies:
        made = eval(body["python"], {"sledenv": sledenv, "Arc": Arc, "Body": Body})
        assert [body["given"]["mass"], body["given"]["inertia"]] == [made.mass, made.inertia]
        for k, arc in enumerate(body["given"]["arcs"]):
            assert all(value == made.record[name][0, k] for name, value in arc.items())
        assert body["parts"] == list(made.parts)


def test_a_page_needs_a_context() -> None:
    with pytest.raises(ValueError, match="contexts is empty"):
        play_page(load_scenario("sled_mat"), [])


# What a browser shows.


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("page"), page_of("sled_snow"))


@pytest.fixture
def page(chromium: Browser, file: Path) -> Iterator[Browser]:
    visit(chromium, file)
    yield chromium
    assert chromium.log() == []  # no error, and no request that the page's policy refused


def test_what_is_typed_is_simulated_and_a_link_keeps_it(page: Browser, file: Path) -> None:
    """Oracle: ``simulate`` with a body, a law, a slope and a launch of these numbers."""
    put(page, "body", "1")
    typed = {
        **{"orientation": 12.5, "spin": -1.25, "speed": 9.0, "fall": 0.5, "drop": 0.4, "angle": 9.0, "length": 15.0},
        **{"friction": 0.07, "restitution": 0.3, "stiffness": 2e4, "rolling_arm": 2.0, "corner_rolling_arm": 0.5},
        **{"mass": 110.0, "gyration": 0.45, "error_orientation": 3.0},
    }
    for name, value in typed.items():
        put(page, name, value)
    page.press("[data-slider=drop]", "\ue012\ue014")  # an arrow key to the left and one to the right
    wait_until(page, "!asking && chosen.changed.drop === 0.4")
    body = sled().replace(mass=110.0, inertia=110.0 * 0.45 * 0.45)
    law = ContactLaw.from_restitution(
        0.3, stiffness=2e7, friction=0.07, rolling_arm=2.0 * 1e-3, corner_rolling_arm=0.5 * 1e-3
    )
    phi = 12.5 * DEGREE
    launch = State(0.0, 0.4 + support_height(body, phi), phi, 9.0, -0.5, -1.25)
    settings = load_scenario("sled_snow").settings()
    zones = in_python(*drawn("sled_snow")).slope.zones
    descent = simulate(body, law, Slope(9.0 * DEGREE, 15.0, zones=zones), launch, settings, record="trajectory")
    assert_same(page, descent)
    address, chosen = page.run("return [address(), JSON.stringify(chosen)]")
    wait_until(page, "location.hash === '#' + address()")
    visit(page, file, address)
    assert page.run("return JSON.stringify(chosen)") == chosen
    assert_same(page, descent)
    put(page, "friction", -1.0)
    assert "friction = -1: must be a number from 0 to 1.5" in problem(page)
    assert numbers(page, "shown.jam") == descent.jam._asdict()
    page.click("#reset")
    wait_until(page, "!asking && !isChanged('friction')")
    assert_same(page, in_python(*drawn("sled_snow")))


WRONG: Final = [
    {
        "speed=99": "speed along the slope = 99: must be a number from 0 to 20 m/s",
        "friction=snow": "friction = snow: must be a number from 0 to 1.5",
        "colour=red": "colour: there is no such parameter",
        "%zz=%3Cb%3E": "%zz: there is no such parameter",
        "body=banana": "body = banana: must be one of body of sled_snow",
        "context=none": "context = none: must be one of drawn",
        "length=2": "length = 2: must be above 4.",
    },
    {"speed=": "speed along the slope = : must be a number from 0 to 20 m/s"},
]


@pytest.mark.parametrize("wrong", WRONG)
def test_all_that_is_wrong_with_an_address_is_told_and_the_rest_is_simulated(
    page: Browser, file: Path, wrong: dict[str, str]
) -> None:
    visit(page, file, "&".join(wrong))
    told = page.text("#problem")
    assert [words for words in wrong.values() if words not in told] == []
    assert_same(page, in_python(*drawn("sled_snow")))


@pytest.mark.parametrize(
    ("what", "kind", "changed"),
    [
        ("drop", "touch", {"drop": 1}),
        ("orientation", "mouse", {"orientation": -1}),
        ("velocity", "touch", {"speed": 1, "fall": -1}),
    ],
)
def test_the_launch_is_dragged_and_the_picture_keeps_its_size(
    page: Browser, what: str, kind: str, changed: dict[str, int]
) -> None:
    """To the upper right: higher, turned clockwise, faster and less towards the slope."""
    box = "document.querySelector(`[data-grab=${arguments[0]}]`).getBoundingClientRect()"
    x, y = page.run(f"const grip = {box}; return [grip.left + grip.width / 2, grip.top + grip.height / 2]", what)
    size = "const { width, height } = $('scene').getBoundingClientRect(); return [width, height]"
    before, earlier = page.run(size), told_launch(page)
    page.drag((x, y), (x + 12.0, y - 20.0), (x + 22.0, y - 32.0), kind=kind)
    wait_until(page, "!asking && !grabbed")
    launch = told_launch(page)
    signs = {name: math.copysign(1, launch[name] - earlier[name]) for name in launch if launch[name] != earlier[name]}
    assert signs == changed
    assert page.run(size) == before
    assert float(run_lines(page)[1]) == numbers(page, "shown.jam")["reward"]


# The map.


def wait_for_map(page: Browser) -> None:
    page.run("$('maps').open = true")
    wait_until(page, "map?.best?.refined && !asking && !drawing")


def assert_map(page: Browser, scenario: Scenario, context: Context) -> None:
    """Oracle: ``simulate_batch``, bit for bit, and a filter of scipy; the axes reach as far as the launch noise."""
    axes = [np.array(values) for values in page.run("return map.axes.map(axis => axis.values)")]
    low, high = scenario.control_bounds["spin"]
    errors = scenario.control.noise_orientation_deg, scenario.control.noise_spin_rad_s
    assert axes[1][[0, -1]] == pytest.approx([low - 3.0 * errors[1], high + 3.0 * errors[1]])
    orientation, spin = np.meshgrid(axes[0] * DEGREE, axes[1], indexing="ij")
    contexts = np.tile(np.array(context), (orientation.size, 1))
    contexts[:, Context._fields.index("orientation")] = orientation.ravel()
    contexts[:, Context._fields.index("spin")] = spin.ravel()
    batch = simulate_batch(*scenario.given(context)[:3], scenario.scenes(contexts).launches, scenario.settings())
    rewards, expected = (page.run(f"return Array.from(map.{name}, String)") for name in ("rewards", "expected"))
    np.testing.assert_array_equal(np.array(rewards, float), batch.jam.reward)
    smooth = batch.jam.reward.reshape(50, 50)
    for k in range(2):
        smooth = gaussian_filter1d(smooth, errors[k] / (axes[k][1] - axes[k][0]), axis=k, mode="nearest")
    assert np.array(expected, float) == pytest.approx(smooth.ravel(), abs=1e-3)


def test_a_map_has_the_rewards_of_python_and_launches_are_chosen_on_it(page: Browser) -> None:
    scenario, context = drawn("sled_snow")
    wait_for_map(page)
    assert_map(page, scenario, context)
    best = page.run("return map.best.launch")
    bounds = [scenario.control_bounds[name] for name in ("orientation", "spin")]
    assert all(low <= value <= high for value, (low, high) in zip(best, bounds, strict=True))
    chosen = "return AXES.map(shownOf)"
    page.run("document.querySelector('#map').scrollIntoView({ block: 'center' })")
    page.click("#map")  # its middle
    wait_until(page, "!asking")
    found = page.run(
        "const { width, height, left, top, w, h } = chartOf($('map'), map.axes); const [x, y] = map.axes;"
        "return [x.low + (width / 2 - left) / w * (x.high - x.low), y.high - (height / 2 - top) / h * (y.high - y.low)]"
    )
    assert page.run(chosen) == pytest.approx(found, abs=0.3)
    page.click("#best")
    wait_until(page, "!asking")
    assert page.run(chosen) == best
    assert page.run("return map.complete")  # the launch changes nothing in it
    draws = np.array(page.run("return NORMAL"))
    assert draws.mean(axis=0) == pytest.approx([0.0, 0.0], abs=0.06)
    assert np.cov(draws.T) == pytest.approx(np.eye(2), abs=0.12)


def test_contexts_and_their_marks_can_be_chosen(chromium: Browser, tmp_path: Path) -> None:
    """Oracle: ``simulate`` of the context and of the marked launch; the axes are what the scenario chooses."""
    scenario, context = drawn("sled_snow")
    _, other = drawn("sled_snow", 8)
    marks = (
        Mark("another", "B", "#ffffff", {"orientation": -0.05, "speed": 8.5}, 0.9),
        Mark("an agent", "A", "#0072b2", {"orientation": 0.1, "speed": 9.25}, 0.875),
    )
    contexts = [Played("one", context), Played("another", other, marks)]
    visit(chromium, written(tmp_path, play_page(scenario, contexts, axes=("orientation", "speed"))))
    chromium.run("$('maps').open = true")
    put(chromium, "context", "1")
    assert_same(chromium, in_python(scenario, other))
    wait_until(chromium, "document.querySelectorAll('#marks button').length === 2 && !asking")
    assert "speed at launch [m/s]" in chromium.text("#map")
    told = chromium.run("return [...document.querySelectorAll('#marks button')].map(one => one.textContent)")
    assert told == ["Banother 0.900", "Aan agent 0.875"]
    chromium.click("[data-mark='1']")
    wait_until(chromium, "!asking && isChanged('speed')")
    marked = other._replace(orientation=0.1 / DEGREE * DEGREE, speed=9.25)
    assert_same(chromium, in_python(scenario, marked))
    put(chromium, "friction", 0.1)
    wait_until(chromium, "!document.querySelector('#marks button')")  # they are of another surface
    assert chromium.log() == []


# What cannot be simulated.


def test_a_page_that_cannot_simulate_says_why(chromium: Browser, file: Path, tmp_path: Path) -> None:
    """The worker never answers in the last case, as if a descent had no end."""
    text, spoilt = file.read_text(encoding="utf-8"), tmp_path / "spoilt.html"
    for share in (0.5, 0.8, 0.999):
        cut = tmp_path / "cut.html"
        cut.write_text(text[: int(share * len(text))], encoding="utf-8")
        chromium.open(cut)
        assert "the file is cut" in chromium.text("#problem")
    kernel = data_of(text)["kernel"]
    data, endless = '<script type="application/json"', "const state = given ?? states(scene, [launch])[0];"
    hasty = text.replace("const PATIENCE = 200;", "const PATIENCE = 2;")
    for source, old, new, words in (
        (text, kernel[1000:1010], "AAAAAAAAAA", "This file is damaged"),
        (text, kernel, base64.b64encode(zlib.compress(b"no kernel")).decode(), "The kernel does not start"),
        (text, data, f"<script>delete globalThis.WebAssembly</script>{data}", "has no WebAssembly"),
        (hasty, endless, f"for (;;);{endless}", "given up: stopped after 2 s"),
    ):
        assert old in source
        spoilt.write_text(source.replace(old, new), encoding="utf-8")
        chromium.open(spoilt)
        wait_until(chromium, f"$('problem').textContent.includes('{words}')")
    chromium.log()


@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_is_too_wide_or_too_small(chromium: Browser, file: Path, width: int) -> None:
    chromium.screen(width, 900)
    visit(chromium, file)
    chromium.must_be_readable(width)
