"""The page that simulates: its numbers are those of Python, and what it is asked for in vain it says."""

from __future__ import annotations

import base64
import contextlib
import csv
import io
import json
import math
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

import sledenv
from sledenv import Arc, Body
from sledenv.pages.columns import rebound_columns
from sledenv.pages.kernel import KERNEL
from sledenv.pages.play import Mark, Played, play_page
from sledenv.plot.shapes import pace
from sledenv.scenarios.configuration import CONFIGS
from sledenv.scenarios.scenario import Context, Scenario, load_scenario, scenario_names
from sledenv.simulation.interpolation import drawable_rows
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.simulate import simulate, simulate_batch
from sledenv.simulation.sleds import sled
from sledenv.simulation.support import support_height
from tests.browser import Browser, at_speed, data_of, needs_chromium, patient, wait_until
from tests.own_scenarios import own_scenario

SEED: Final = 3
MOST_BYTES: Final = 700_000


def drawn(name: str, seed: int = SEED) -> tuple[Scenario, Context]:
    scenario = load_scenario(name)
    return scenario, scenario.sample(np.random.default_rng(seed))


def page_of(name: str, solver: Any = "compliant") -> str:
    scenario, context = drawn(name)
    return play_page(scenario, [Played("drawn", context)], solver)


def written(folder: Path, page: str) -> Path:
    """A file of a page whose maps are closed: they simulate 2,500 launches whenever something is changed."""
    assert '"maps":true' in page
    place = folder / "play.html"
    place.write_text(patient(page).replace('"maps":true', '"maps":false'), encoding="utf-8")
    return place


def in_python(scenario: Scenario, context: Context, solver: Any = "compliant") -> Descent:
    given = scenario.given(context)
    return simulate(*given, scenario.settings(solver), record="trajectory")


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_has_a_page_that_refers_to_nothing_outside(name: str) -> None:
    page = page_of(name)
    assert len(page.encode()) < MOST_BYTES
    assert not re.search(r"https?:|//[a-z]+\.|@import|<link|\bsrc=|url\(", page)
    assert "default-src 'none'" in page


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


def test_ranges_hold_what_the_page_begins_with() -> None:
    scenario, context = drawn("sled_snow")
    context = context._replace(speed=55.0, drop=7.0)
    data = data_of(play_page(scenario, [Played("drawn", context)]))
    exact = json.loads(data["exact"])
    values = exact["contexts"][0]["values"]
    assert values["speed"] == 55.0
    for one in exact["parameters"]:
        if one["name"] in values:
            assert one["low"] <= values[one["name"]] / one["factor"]
            assert float(one["high"]) >= values[one["name"]] / one["factor"]  # "Infinity"


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


def visit(page: Browser, file: Path, address: str = "") -> None:
    """Open a page anew at an address, and wait for its descent."""
    page.open(file, address.removeprefix("#"))
    wait_until(page, "shown !== null && !asking")


def wait_for_map(page: Browser) -> None:
    """Open the maps, and wait until nothing below them moves any more, and nothing in them."""
    page.run("$('maps').open = true")
    wait_until(page, "map?.best?.refined && !asking && !drawing")


def put(page: Browser, name: str, value: float) -> None:
    """Type a number, and wait for the descent that follows."""
    page.run(
        "const field = $('number-' + arguments[0]); field.value = arguments[1];"
        "field.dispatchEvent(new Event('input', { bubbles: true }))",
        name,
        value,
    )
    wait_until(page, "!asking")


def select(page: Browser, what: str, value: str) -> None:
    """Choose a context, a body or a solver."""
    page.run(
        "const list = $('chosen-' + arguments[0]); list.value = arguments[1];"
        "list.dispatchEvent(new Event('input', { bubbles: true }))",
        what,
        value,
    )


def numbers(page: Browser, table: str) -> dict[str, list[float]]:
    """All digits of a table of what is shown."""
    told = page.run(f"return Object.entries(shown.{table}).map(([name, column]) => [name, Array.from(column, String)])")
    return {name: [float(value) for value in column] for name, column in told}


def assert_same(page: Browser, descent: Descent) -> None:
    """The descent that is shown has every number of one of Python."""
    for table in ("rebounds", "trajectory", "contacts"):
        found, rows = numbers(page, table), getattr(descent, table)
        for name in set(rows.dtype.names) - {"contacts"}:
            np.testing.assert_array_equal(found[name], rows[name], err_msg=f"{table}.{name}")
    outcome = dict(page.run("return Object.entries(shown.outcome).map(([name, value]) => [name, String(value)])"))
    for name in descent.outcome.dtype.names:
        assert float(outcome[name]) == descent.outcome[name], name
    jam = dict(page.run("return Object.entries(shown.jam).map(([name, value]) => [name, String(value)])"))
    assert {name: float(value) for name, value in jam.items()} == descent.jam._asdict()


def run_lines(page: Browser) -> list[str]:
    """What the lines of Python print."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(page.run("return $('python').textContent"), {})
    return out.getvalue().split()


def told_result(page: Browser) -> list[str]:
    status, reward = page.run("return [shown.status, String(shown.jam.reward)]")
    return [status, repr(float(reward))]


@needs_chromium
@pytest.mark.jit_only
@pytest.mark.parametrize("solver", ["compliant", "rigid"])
@pytest.mark.parametrize(
    "name", ["sled_snow", "paper_impact", *map(own_scenario, ("boulders", "brake_mat", "ice_drop", "measured"))]
)
def test_a_page_opens_with_the_descent_of_python(chromium: Browser, tmp_path: Path, name: str, solver: Any) -> None:
    """Oracle: ``simulate``, bit for bit; what its lines of Python print."""
    scenario, context = drawn(name)
    visit(chromium, written(tmp_path, page_of(name, solver)))
    assert_same(chromium, in_python(scenario, context, solver))
    assert run_lines(chromium) == told_result(chromium)
    assert not chromium.run("return $('problem').textContent")
    assert (
        chromium.run("return performance.getEntriesByType('resource').filter(one => !one.name.startsWith('blob:'))")
        == []
    )
    assert chromium.log() == []


@needs_chromium
@pytest.mark.jit_only
def test_lines_of_python_spell_a_body_that_has_no_name(chromium: Browser, tmp_path: Path) -> None:
    """Oracle: the page itself; the sled is that of a file which the reader of the lines need not have."""
    own = tmp_path / "my_sled.yaml"
    shipped = (CONFIGS / "scenarios/sled_snow.yaml").read_text(encoding="utf-8")
    own.write_text(shipped.replace("id: sled_snow", "id: my_sled"), encoding="utf-8")
    visit(chromium, written(tmp_path, page_of(str(own))))
    put(chromium, "mass", 100.0)
    assert "my_sled" not in chromium.run("return $('python').textContent")
    assert run_lines(chromium) == told_result(chromium)


@needs_chromium
@pytest.mark.jit_only
def test_what_is_typed_is_simulated(page: Browser) -> None:
    """Oracle: ``simulate`` with a body, a law, a slope and a launch of these numbers."""
    page.click("[data-remove]")  # the zone of the scenario
    select(page, "body", "1")
    typed = {
        **{"orientation": 12.5, "spin": -1.25, "speed": 9.0, "fall": 0.5, "drop": 0.4, "angle": 9.0, "length": 15.0},
        **{"friction": 0.07, "restitution": 0.3, "stiffness": 2e4, "rolling_arm": 2.0, "corner_rolling_arm": 0.5},
        **{"mass": 110.0, "gyration": 0.45},
    }
    for name, value in typed.items():
        put(page, name, value)
    degree = math.pi / 180.0
    body = sled().replace(mass=110.0, inertia=110.0 * 0.45 * 0.45)
    law = ContactLaw.from_restitution(
        0.3, stiffness=2e7, friction=0.07, rolling_arm=2.0 * 1e-3, corner_rolling_arm=0.5 * 1e-3
    )
    phi = 12.5 * degree
    launch = State(0.0, 0.4 + support_height(body, phi), phi, 9.0, -0.5, -1.25)
    settings = load_scenario("sled_snow").settings()
    descent = simulate(body, law, Slope(9.0 * degree, 15.0), launch, settings, record="trajectory")
    assert_same(page, descent)
    assert run_lines(page) == told_result(page) == [str(descent.status), repr(float(descent.jam.reward))]


@needs_chromium
@pytest.mark.jit_only
def test_zones_are_simulated_and_wrong_ones_named(page: Browser) -> None:
    """Oracle: ``simulate`` with the same zones."""
    scenario, context = drawn("sled_snow")
    body, law, slope, launch = scenario.given(context)
    (own,) = slope.zones
    page.click("[data-remove]")
    wait_until(page, "!asking && shown.scene.slope.zones.length === 0")
    page.click("#add")
    wait_until(page, "!asking && shown.scene.slope.zones.length === 1")
    (given,) = page.run("return shown.scene.slope.zones.map(zone => ZONE.map(name => String(zone[name])))")
    zone = Zone(*map(float, given))
    assert zone.friction > law.friction
    assert zone.end == math.inf
    zoned = Slope(slope.angle, slope.length, slope.gravity, [zone])
    assert_same(page, simulate(body, law, zoned, launch, scenario.settings(), record="trajectory"))
    assert run_lines(page) == told_result(page)
    page.run(
        "const [end] = document.querySelectorAll('[data-field=end]'); end.value = 1;"
        "end.dispatchEvent(new Event('input', { bubbles: true }))"
    )
    wait_until(page, "!asking")
    assert "must end behind its begin" in page.text("#problem")
    page.click("#reset")
    wait_until(page, f"!asking && shown.scene.slope.zones[0].begin === {own.begin!r}")
    assert_same(page, in_python(scenario, context))


@needs_chromium
@pytest.mark.jit_only
def test_a_slider_changes_the_descent_and_the_address_restores_it(page: Browser, file: Path) -> None:
    before = numbers(page, "rebounds")["u_after"]
    page.press("[data-slider=friction]", "\ue014" * 3)  # the right arrow key
    wait_until(page, "!asking && isChanged('friction')")
    shown = numbers(page, "rebounds")
    assert shown["u_after"] != before
    wait_until(page, "location.hash.includes('friction')")
    address = page.run("return location.hash")
    visit(page, file, address)
    assert numbers(page, "rebounds") == shown
    page.click("#reset")
    wait_until(page, "!asking && !isChanged('friction')")
    assert numbers(page, "rebounds")["u_after"] == before


@needs_chromium
@pytest.mark.jit_only
@pytest.mark.parametrize("solver", ["compliant", "rigid"])
def test_an_address_holds_all_that_can_be_set(page: Browser, file: Path, solver: str) -> None:
    page.click("#add")
    select(page, "body", "3")
    select(page, "solver", solver)
    for one in page.run("return E.parameters.map(one => one.name)"):
        if solver == "rigid" and one.startswith("bump_"):  # which rigid surfaces do not have
            continue
        last = "const { low, high } = PARAMETERS[arguments[0]]; const last = high < Infinity ? high : low + 9;"
        put(page, one, page.run(f"{last} return low + (last - low) / 3", one))
    wait_until(page, "!asking")
    address, chosen = page.run("return [address(), JSON.stringify(chosen)]")
    result = told_result(page)
    visit(page, file, f"#{address}")
    assert page.run("return JSON.stringify(chosen)") == chosen
    assert told_result(page) == result == run_lines(page)


WRONG: Final = [
    {
        "speed=99": "speed along the slope = 99: must be a number from 0 to 20 m/s",
        "friction=snow": "friction = snow: must be a number from 0 to 1.5",
        "colour=red": "colour: there is no such parameter",
        "%zz=%3Cb%3E": "%zz: there is no such parameter",
        "body=banana": "body = banana: must be one of body of sled_snow",
        "solver=euler": "solver = euler: must be compliant or rigid",
        "zones=5,2,.1,0,0": "zone 1 ends at 2 m: must end behind its begin, 5 m",
        "kept=1,2": "kept = 1,2: must be 5 numbers",
    },
    {
        "speed=": "speed along the slope = : must be a number from 0 to 20 m/s",
        "zones=what": "zone 1: must have a begin and a friction",
        "kept=0,0,99,0,0": "kept, speed along the slope = 99: must be a number from 0 to 20 m/s",
    },
]


@needs_chromium
@pytest.mark.jit_only
@pytest.mark.parametrize("wrong", WRONG)
def test_all_that_is_wrong_with_an_address_is_told_and_the_rest_is_simulated(
    page: Browser, file: Path, wrong: dict[str, str]
) -> None:
    visit(page, file, "#" + "&".join(wrong))
    told = page.text("#problem")
    assert [words for words in wrong.values() if words not in told] == []
    assert_same(page, in_python(*drawn("sled_snow")))


@needs_chromium
@pytest.mark.jit_only
def test_a_number_outside_its_range_is_not_simulated(page: Browser) -> None:
    before = told_result(page)
    put(page, "friction", -1.0)
    assert "friction = -1: must be a number from 0 to 1.5" in page.text("#problem")
    assert told_result(page) == before
    put(page, "friction", 0.1)
    assert not page.run("return $('problem').textContent")


@needs_chromium
@pytest.mark.jit_only
def test_the_table_can_be_saved(page: Browser) -> None:
    """Oracle: the table that ``sledenv simulate --rebounds-csv`` writes."""
    rows = list(csv.DictReader(io.StringIO(page.run("return csvOf(shown)"))))
    expected = rebound_columns(in_python(*drawn("sled_snow")))
    assert list(rows[0]) == list(expected)
    assert len(rows) == len(expected["t_end_s"])
    for name, cells in expected.items():
        found = [row[name] for row in rows]
        assert (found if isinstance(cells[0], str) else list(map(float, found))) == cells, name
    page.click("#csv")


@needs_chromium
@pytest.mark.jit_only
def test_the_film_holds_impacts_as_that_of_the_replay_does(page: Browser) -> None:
    """Oracle: ``pace``; the rows that figures draw."""
    descent = in_python(*drawn("sled_snow"))
    film, time = page.run("return [shown.film.film, shown.film.time]")
    assert np.stack([film, time], axis=-1) == pytest.approx(pace(descent), abs=1e-12)
    assert page.run("return shown.rows.t.length") == len(drawable_rows(descent))
    at_speed(page, 1000)
    page.click("#play")
    wait_until(page, "$('play').textContent === 'Play' && position > 0")
    assert float(page.text("#time").removesuffix(" s")) == pytest.approx(descent.time, abs=1e-4)
    page.click("#rebounds tbody tr")
    assert page.run("return document.querySelectorAll('.cone, .force').length") == 2


@needs_chromium
@pytest.mark.jit_only
@pytest.mark.parametrize(("what", "kind"), [("drop", "touch"), ("orientation", "mouse"), ("velocity", "touch")])
def test_the_launch_can_be_dragged(page: Browser, what: str, kind: str) -> None:
    page.run("grip = document.querySelector(`[data-grab=${arguments[0]}]`).getBoundingClientRect()", what)
    x, y = page.run("return [grip.left + grip.width / 2, grip.top + grip.height / 2]")
    before = page.run("return JSON.stringify(launchOf())")
    page.drag((x, y), (x + 12.0, y - 20.0), (x + 22.0, y - 32.0), kind=kind)
    wait_until(page, "!asking && !grabbed")
    launch, earlier = (json.loads(text) for text in (page.run("return JSON.stringify(launchOf())"), before))
    moved = {name for name in launch if launch[name] != earlier[name]}
    assert moved == {"drop": {"drop"}, "orientation": {"orientation"}, "velocity": {"speed", "fall"}}[what]
    if what == "drop":
        assert launch["drop"] > earlier["drop"]
    if what == "velocity":
        assert launch["speed"] > earlier["speed"]
        assert launch["fall"] < earlier["fall"]
    assert run_lines(page) == told_result(page)


@needs_chromium
@pytest.mark.jit_only
def test_only_what_is_looked_at_is_drawn_while_something_is_dragged(page: Browser) -> None:
    """Land, table, plots and ledger stay the very nodes that they were; the path and the outcome follow the hand."""
    kept = "['#land polygon', '#rebounds tr', '#series svg', '#ledger dl', '#outcome dd'].map(one => $$(one))"
    page.run(f"$$ = (one) => document.querySelector(one); oldNodes = {kept}; oldTrace = $$('#trace').innerHTML")
    reward = page.text("#outcome")
    page.run(
        "const box = $('scene').getBoundingClientRect(); const { x, y } = shown.launch;"
        "grabbed = { what: 'orientation', box, from: [x, y], drop: 0, launch: shown.launch };"
        "const [column, row] = scene.pixel(x - 1, y + 0.3);"
        "drag({ clientX: box.left + column, clientY: box.top + row })"
    )
    wait_until(page, "!asking && isChanged('orientation')")
    assert page.run(f"return {kept}.map((one, i) => one === oldNodes[i])") == [True] * 5
    assert page.text("#outcome") != reward
    assert page.run("return $$('#trace').innerHTML !== oldTrace")
    assert page.run("return document.querySelectorAll('#trace .pose').length") == 0
    page.run("document.querySelector('#scene').dispatchEvent(new Event('pointerup'))")
    assert page.run(f"return {kept}.map((one, i) => one === oldNodes[i])") == [False] * 4 + [True]
    assert page.run("return document.querySelectorAll('#trace .pose').length") > 2
    assert run_lines(page) == told_result(page)


@needs_chromium
@pytest.mark.jit_only
def test_the_cone_of_a_rebound_and_the_ledger_are_those_of_the_descent(page: Browser) -> None:
    """Oracle: the records and the ledger of ``simulate``."""
    descent = in_python(*drawn("sled_snow"))
    for i, rebound in enumerate(descent.rebounds):
        page.click(f"[data-rebound='{i}']")
        assert page.text("#cone-title") == f"Rebound {i + 1} in its friction cone"
        told = page.text("#closeup").replace("\N{MINUS SIGN}", "-")
        assert f"{rebound['normal_impulse']:.2f} N s" in told
        assert f"{rebound['tangential_impulse']:.2f} N s" in told
        assert f"{descent.rebound_jam.grip[i]:.3f}" in told
    ledger, energy = page.text("#ledger").replace("\N{MINUS SIGN}", "-"), descent.energy
    for value in (energy.kinetic, energy.stored, energy.hysteresis, energy.sliding, energy.initial - energy.potential):
        assert f"{value:.2f} J" in ledger
    widths = page.run("return [...document.querySelectorAll('.bar i')].map(one => parseFloat(one.style.width))")
    assert sum(widths) == pytest.approx(100.0, abs=0.1)
    assert f"{energy.residual:.1e}".partition("e")[0] in ledger


@needs_chromium
@pytest.mark.jit_only
def test_a_launch_is_kept_to_compare(page: Browser, file: Path) -> None:
    """Oracle: the page itself, before another launch is chosen."""
    first, result = page.text("#outcome"), told_result(page)
    page.click("#keep")
    wait_until(page, "!asking && shown.kept")
    put(page, "speed", 7.0)
    assert page.text("#outcome-kept") == first != page.text("#outcome")
    assert page.run("return [shown.kept.status, String(shown.kept.jam.reward)]") == [result[0], result[1]]
    assert page.run("return document.querySelectorAll('#other').length") == 1
    address, both = page.run("return address()"), (page.text("#outcome"), first)
    visit(page, file, f"#{address}")
    assert (page.text("#outcome"), page.text("#outcome-kept")) == both
    page.click("#keep")
    wait_until(page, "!asking && !shown.kept")
    assert page.run("return $('kept').hidden")


# Maps and clouds.


def rewards_of(page: Browser) -> np.ndarray:
    return np.array([float(value) for value in page.run("return Array.from(map.rewards, String)")]).reshape(50, 50)


@needs_chromium
@pytest.mark.jit_only
@pytest.mark.parametrize("name", ["sled_snow", own_scenario("boulders")])
def test_a_map_has_the_rewards_of_python(chromium: Browser, tmp_path: Path, name: str) -> None:
    """Oracle: ``simulate_batch``, bit for bit; the axes end as far as the launch noise reaches."""
    scenario, context = drawn(name)
    visit(chromium, written(tmp_path, page_of(name)))
    wait_for_map(chromium)
    axes = [np.array(values) for values in chromium.run("return map.axes.map(axis => axis.values)")]
    low, high = scenario.control_bounds["spin"]
    error = scenario.control.noise_spin_rad_s
    assert axes[1][[0, -1]] == pytest.approx([low - 3.0 * error, high + 3.0 * error])
    if name != "sled_snow":  # goes all around
        assert np.append(axes[0], axes[0][0] + 360.0) == pytest.approx(np.linspace(-180.0, 180.0, 51))
    orientation, spin = np.meshgrid(axes[0] * (math.pi / 180.0), axes[1], indexing="ij")
    contexts = np.tile(np.array(context), (orientation.size, 1))
    contexts[:, Context._fields.index("orientation")] = orientation.ravel()
    contexts[:, Context._fields.index("spin")] = spin.ravel()
    given = scenario.given(context)[:3]
    batch = simulate_batch(*given, scenario.scenes(contexts).launches, scenario.settings())
    np.testing.assert_array_equal(rewards_of(chromium).ravel(), batch.jam.reward)
    best = chromium.run("return map.best.launch")
    assert all(low <= value <= high for value, (low, high) in zip(best, scenario.control_bounds.values(), strict=False))
    chromium.click("#best")
    wait_until(chromium, "!asking")
    assert chromium.run("return AXES.map(shownOf)") == best
    assert run_lines(chromium) == told_result(chromium)
    assert chromium.log() == []


@needs_chromium
@pytest.mark.jit_only
def test_a_map_under_launch_noise_is_the_mean_of_the_map(page: Browser) -> None:
    """Oracle: the mean of what is linear between the cells, by a quadrature of many points along each axis."""
    put(page, "error_orientation", 2.5)
    put(page, "error_spin", 0.21)
    wait_for_map(page)
    rewards = rewards_of(page)
    expected = np.array(page.run("return Array.from(map.expected)")).reshape(50, 50)
    z = np.linspace(-6.0, 6.0, 4001)
    density = np.exp(-0.5 * z * z)
    weights = []
    for k, error in enumerate((2.5, 0.21)):
        values = np.array(page.run("return map.axes[arguments[0]].values", k))
        hats = np.stack([np.interp(values[25] + error * z, values, row) for row in np.eye(50)])
        weights.append(hats @ density / density.sum())
    assert expected[25, 25] == pytest.approx(weights[0] @ rewards @ weights[1], abs=2e-6)
    constant = page.run("return smoothed({ ...map, rewards: map.rewards.map(() => 0.7) })[77]")
    assert constant == pytest.approx(0.7)


@needs_chromium
@pytest.mark.jit_only
def test_a_click_on_a_map_chooses_a_launch(page: Browser) -> None:
    wait_for_map(page)
    page.run("document.querySelector('#map').scrollIntoView({ block: 'center' })")
    page.click("#map")  # its middle
    wait_until(page, "!asking")
    found = page.run(
        "const { width, height, left, top, w, h } = chartOf($('map'), map.axes); const [x, y] = map.axes;"
        "return [x.low + (width / 2 - left) / w * (x.high - x.low), y.high - (height / 2 - top) / h * (y.high - y.low)]"
    )
    assert page.run("return AXES.map(shownOf)") == pytest.approx(found, abs=0.3)
    place = page.run("return AXES.map(shownOf)")
    page.press("#map", "\ue014")  # the right arrow key
    wait_until(page, "!asking")
    step = page.run("return map.axes[0].step")
    assert page.run("return AXES.map(shownOf)") == pytest.approx([place[0] + step, place[1]], abs=6e-3)
    assert page.run("return document.querySelectorAll('#maps .cursor').length") == 2
    assert page.run("return map.complete")  # the launch changes nothing in it


@needs_chromium
@pytest.mark.jit_only
def test_a_cloud_is_of_normal_errors(page: Browser) -> None:
    """Oracle: moments of the draws; ``simulate`` of each of them."""
    wait_for_map(page)
    wait_until(page, "cloud?.paths")
    draws = np.array(page.run("return NORMAL"))[[k for i in range(8) for k in range(i, 64, 8)]]  # as workers share them
    assert draws.shape == (64, 2)
    assert draws.mean(axis=0) == pytest.approx([0.0, 0.0], abs=0.06)
    assert draws.std(axis=0) == pytest.approx([1.0, 1.0], abs=0.1)
    assert abs(np.corrcoef(draws.T)[0, 1]) < 0.1
    scenario, context = drawn("sled_snow")
    errors = draws * [math.radians(scenario.control.noise_orientation_deg), scenario.control.noise_spin_rad_s]
    told = [float(value) for value in page.run("return cloud.paths.map(({ reward }) => String(reward))")]
    for (orientation, spin), reward in zip(errors.tolist(), told, strict=True):
        tried = context._replace(orientation=context.orientation + orientation, spin=context.spin + spin)
        assert reward == pytest.approx(float(in_python(scenario, tried).jam.reward), abs=1e-9)
    assert f"mean reward {np.mean(told):.3f}" in page.text("#cloud-words")
    assert page.run("return document.querySelectorAll('#cloud polyline').length") == 64


@needs_chromium
@pytest.mark.jit_only
def test_contexts_and_their_marks_can_be_chosen(chromium: Browser, tmp_path: Path) -> None:
    """Oracle: ``simulate`` of the context and of the marked launch; the axes are what the scenario chooses."""
    scenario, context = drawn("sled_snow")
    _, other = drawn("sled_snow", 8)
    mark = Mark("an agent", "A", "#0072b2", {"orientation": 0.1, "speed": 9.25}, 0.875)
    another = Mark("another", "B", "#ffffff", {"orientation": -0.05, "speed": 8.5}, 0.9)
    contexts = [Played("one", context), Played("another", other, (another, mark))]
    place = written(tmp_path, play_page(scenario, contexts, axes=("orientation", "speed")))
    visit(chromium, place)
    assert_same(chromium, in_python(scenario, context))
    assert not chromium.run("return document.querySelectorAll('#marks button').length")
    select(chromium, "context", "1")
    wait_for_map(chromium)
    assert_same(chromium, in_python(scenario, other))
    assert "speed at launch [m/s]" in chromium.text("#map")
    chromium.click("[data-mark='1']")
    wait_until(chromium, "!asking && isChanged('speed')")
    marked = other._replace(orientation=0.1 / (math.pi / 180.0) * (math.pi / 180.0), speed=9.25)
    assert_same(chromium, in_python(scenario, marked))
    visit(chromium, place, f"#{chromium.run('return address()')}")
    assert_same(chromium, in_python(scenario, marked))
    wait_for_map(chromium)
    assert chromium.run("return [...document.querySelectorAll('#marks button')].map(one => one.textContent)") == [
        "Banother 0.900",
        "Aan agent 0.875",
    ]
    put(chromium, "friction", 0.1)
    wait_until(chromium, "!document.querySelector('#marks button')")  # they are of another surface
    visit(chromium, place, "#context=none")
    assert "context = none: must be one of one, another" in chromium.text("#problem")
    assert chromium.log() == []


# What cannot be simulated.


def spoilt(file: Path, folder: Path, old: str, new: str) -> Path:
    """A copy of a page in which something is different."""
    text = file.read_text(encoding="utf-8")
    assert old in text
    place = folder / "spoilt.html"
    place.write_text(text.replace(old, new), encoding="utf-8")
    return place


@needs_chromium
def test_a_file_that_is_cut_says_so(chromium: Browser, file: Path, tmp_path: Path) -> None:
    text = file.read_text(encoding="utf-8")
    for share in (0.5, 0.8, 0.999):
        cut = tmp_path / "cut.html"
        cut.write_text(text[: int(share * len(text))], encoding="utf-8")
        chromium.open(cut)
        assert "the file is cut" in chromium.text("#problem")


@needs_chromium
def test_a_kernel_that_is_damaged_or_does_not_start_is_told(chromium: Browser, file: Path, tmp_path: Path) -> None:
    kernel = data_of(file.read_text(encoding="utf-8"))["kernel"]
    chromium.open(spoilt(file, tmp_path, kernel[1000:1010], "AAAAAAAAAA"))
    wait_until(chromium, "!$('problem').hidden && $('problem').textContent.includes('damaged')")
    chromium.open(spoilt(file, tmp_path, kernel, base64.b64encode(zlib.compress(b"no kernel")).decode()))
    wait_until(chromium, "$('problem').textContent.includes('The kernel does not start')")
    assert chromium.run("return document.querySelector('main').hidden")
    first = '<script type="application/json"'
    chromium.open(spoilt(file, tmp_path, first, f"<script>delete globalThis.WebAssembly</script>{first}"))
    assert "has no WebAssembly" in chromium.text("#problem")


@needs_chromium
def test_a_descent_that_takes_too_long_is_stopped(chromium: Browser, file: Path, tmp_path: Path) -> None:
    """The worker never answers here, as if a descent had no end."""
    endless = "const state = given ?? states(scene, [launch])[0];"
    hasty = spoilt(file, tmp_path, "const PATIENCE = 200;", "const PATIENCE = 2;")
    chromium.open(spoilt(hasty, tmp_path, endless, f"for (;;);{endless}"))
    wait_until(chromium, "$('problem').textContent.includes('given up')")
    assert "stopped after 2 s" in chromium.text("#problem")
    chromium.log()


@needs_chromium
@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_is_too_wide_or_too_small(chromium: Browser, file: Path, width: int) -> None:
    chromium.screen(width, 900)
    visit(chromium, file)
    chromium.must_be_readable(width)
