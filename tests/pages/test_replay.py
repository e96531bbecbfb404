"""The page of one descent: what it holds, how it is written, and what a browser shows when its slider is moved."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sledenv.pages.replay import Ghost, replay_page, write_replay
from sledenv.plot.energy import energy_layers
from sledenv.plot.riders import pieces
from sledenv.reproduce.euler import euler_descent
from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.interpolation import drawable_rows, states_at
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.ride import Ride
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.simulate import simulate
from sledenv.simulation.words import mode_name
from tests.bodies import HILL, ICE, SLED, rod, run
from tests.browser import Browser, assert_needs_nothing, at_speed, data_of, wait_until
from tests.pages.shown import assert_same, columns_of, put, visit, written
from tests.plot.outlined import RIDDEN, descent_of

ZONED = Slope(0.15, 10.0, zones=(Zone(1.0, 3.0, 0.3, 0.02), Zone(6.0, math.inf, 0.01, 0.0)))


def dropped(body: Body = SLED, slope: Slope = HILL, **options: Any) -> Descent:
    return run(body, ICE, slope, (0.0, 0.5, 0.2, 3.0, 0.0, 0.5), **options)


@pytest.fixture(scope="module")
def descent() -> Descent:
    return dropped()


def by_euler() -> Descent:
    return euler_descent(SLED, ICE, HILL, dropped().launch, step=1e-3, record="trajectory")


def trimmed(body: Body = SLED, slope: Slope = HILL) -> Descent:
    ride = Ride(body, ICE, slope, dropped(body, slope).launch, record="trajectory", rotor_inertia=1.0)
    ride.hop()
    ride.trim(0.5)
    return ride.run()


def test_a_title_cannot_break_out_of_its_page(descent: Descent) -> None:
    title = "</script><script>alert(1)</script> <b>&amp; /*DATA*/"
    page = replay_page(descent, title)
    assert_needs_nothing(page)
    assert page.count("</script>") == replay_page(descent, "").count("</script>")
    assert data_of(page)["title"] == title


AWAY = State(1.25, 0.9, 7.0, 3.0, -0.2, 0.5)
SPRING = ContactLaw(1e6, 0.613, 0.05, 0.001)
BENT = Slope(0.15, 8.5, profile=[(1.5, 0.0), (3.0, -0.3), (4.5, 0.1), (6.0, -0.4), (8.0, 0.0), (9.0, -0.1)])
ROUND = BENT._replace(rounding=[2.0, 0.9, 0.4, 0.0, 1.5, math.inf])
SHOWN = {
    "over bends": lambda: dropped(RIDDEN, ROUND),
    "within zones": lambda: dropped(slope=ZONED),
    "settled": lambda: dropped(solver="rigid", settle_speed=0.02),
    "fine": lambda: dropped(sample_interval=0.003, tolerance=1e-10, run_out=1.0, max_rebounds=3),
    "spun": lambda: simulate(SLED, SPRING, HILL, AWAY, record="trajectory", end_on_chord=True),
    "no rebounds": lambda: dropped(max_time=1e-3),
    "no time": lambda: dropped(max_time=1e-12),
    "without end": lambda: dropped(slope=Slope(0.2, zones=ZONED.zones), max_time=2.0),
    "long": lambda: dropped(slope=Slope(0.15, 3000.0, zones=ZONED.zones), max_time=4.0),
    "rod": lambda: dropped(rod(2.0, 0.5, 0.17), max_time=1.0),
    "point": lambda: dropped(segment(1.0, 0.0, 0.0, 1.0), max_time=1.0),
    "boulder": lambda: descent_of("boulder", "compliant"),
    "ridden, rigid": lambda: descent_of("ridden", "rigid"),
    "overflow": lambda: broken(dropped()),
    "euler": by_euler,
    "trimmed over bends": lambda: trimmed(RIDDEN, ROUND),
}


COLUMNS = [name for name in dropped().trajectory.dtype.names if name != "contacts"]


def broken(descent: Descent) -> Descent:
    trajectory, rebounds, outcome = descent.trajectory.copy(), descent.rebounds.copy(), descent.outcome.copy()
    trajectory["x"][40:], trajectory["omega"][60:], rebounds["u_after"][-1] = math.nan, math.inf, math.nan
    outcome["x"] = math.nan
    state = State.found([math.nan] * 6)
    return replace(descent, trajectory=trajectory, rebounds=rebounds, state=state, outcome=outcome, settings=None)


def test_a_page_draws_the_rider_and_the_heavy_side_of_other_bodies() -> None:
    """Oracle: the pieces that figures show."""
    drawn = data_of(replay_page(descent_of("ridden", "compliant"), "rider"))["drawn"][0]
    assert [piece["part"] for piece in drawn["pieces"]] == [piece.part for piece in pieces(RIDDEN)]
    assert drawn["pieces"][0]["points"] == pytest.approx(pieces(RIDDEN)[0].points, abs=1e-8)
    (heavy,) = data_of(replay_page(descent_of("boulder", "compliant"), "boulder"))["drawn"][0]["pieces"]
    assert max(y for _, y in heavy["points"]) == pytest.approx(0.0, abs=1e-9)


def test_a_descent_without_trajectory_is_refused_and_nothing_is_written(descent: Descent, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text("older")
    with pytest.raises(ValueError, match='record="trajectory"'):
        write_replay(replace(descent, trajectory=descent.trajectory[:0]), page, "none")
    assert page.read_text() == "older"
    write_replay(descent, page, "new")
    assert [file.name for file in tmp_path.iterdir()] == ["page.html"]
    assert data_of(page.read_text(encoding="utf-8"))["title"] == "new"


# What a browser shows.


@pytest.fixture(scope="module")
def file(descent: Descent, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("page"), replay_page(descent, "a <descent>"))


@pytest.fixture
def page(chromium: Browser, file: Path) -> Iterator[Browser]:
    visit(chromium, file)
    yield chromium
    assert chromium.log() == []  # no error, and no request that the page's policy refused


def shown_time(page: Browser) -> float:
    return float(page.text("#time").removesuffix(" s"))


def test_the_page_opens_at_the_launch_and_what_is_changed_is_simulated(page: Browser, descent: Descent) -> None:
    """Oracle: ``simulate`` with the friction typed in, all else as given; reset gives the descent back."""
    assert page.text("#title") == "a <descent>"
    assert shown_time(page) == 0.0
    assert page.text("#contact") == "in flight"
    assert page.run("return document.querySelectorAll('#trace .pose').length") > 2
    assert page.run("return document.querySelectorAll('#rebounds tbody tr').length") == len(descent.rebounds)
    assert not page.run("return $('maps').open")  # no map of 2,500 launches where nobody asked for one
    assert_same(page, descent)
    put(page, "friction", 0.3)
    assert_same(page, simulate(SLED, ICE._replace(friction=0.3), HILL, descent.launch, record="trajectory"))
    page.click("#reset")
    wait_until(page, "!asking && !isChanged('friction')")
    assert_same(page, descent)


@pytest.mark.parametrize("name", SHOWN)
def test_a_page_finds_every_number_of_the_descent_and_shows_it(name: str, chromium: Browser, tmp_path: Path) -> None:
    """Oracles: the descent, bit for bit; ``energy_layers``; nothing shown is NaN."""
    descent = SHOWN[name]()
    visit(chromium, written(tmp_path, replay_page(descent, name)))
    if descent.settings is not None:
        assert_same(chromium, descent)
    else:
        rows = descent.trajectory[np.isfinite(descent.trajectory["x"] + descent.trajectory["omega"])]
        assert columns_of(chromium, "trajectory") == {field: rows[field].tolist() for field in COLUMNS}
    if name in ("over bends", "settled", "ridden, rigid"):
        layers = dict(chromium.run("return Object.entries(energiesOf(shown))"))
        moving, rest = np.split(np.array(list(energy_layers(descent, drawable_rows(descent)).values())), [3])
        *shown, left = layers.values()
        assert np.array(shown) == pytest.approx(moving, rel=1e-9, abs=1e-9)
        assert left[-1] == pytest.approx(rest[:, -1].sum(), rel=1e-6)
    for share in (0.0, 0.3, 0.6, 1.0):
        chromium.run("show(arguments[0] * filmLength())", share)
        assert "NaN" not in chromium.run("return document.documentElement.outerHTML.split('<script')[0]")
    assert chromium.log() == []


def test_a_recorded_motion_lies_on_the_simulated_one(chromium: Browser, descent: Descent, tmp_path: Path) -> None:
    """Oracle: poses of the simulated descent itself, 0.1 m farther along the slope."""
    times = np.linspace(0.0, descent.time, 40)
    poses = states_at(descent.trajectory, times)[:, :3] + [0.1, 0.0, 4.0 * math.pi]  # whole turns are left out
    visit(chromium, written(tmp_path, replay_page(descent, "recorded", Ghost(times, poses, used=30))))
    places = "['#sled', '#ghost'].map(name => document.querySelector(name).getBoundingClientRect().left)"
    sled, recorded = chromium.run(f"return {places}")
    width = chromium.run("return $('scene').getBoundingClientRect().width / scene.W * scene.scale")
    assert recorded - sled == pytest.approx(0.1 * math.cos(HILL.angle) * width, abs=2.0)
    chromium.run(f"goTo({descent.time})")
    colour = chromium.run("return document.querySelector('#ghost').getAttribute('stroke')")
    assert colour == "var(--line)"  # beyond what was used
    assert chromium.log() == []


def film_times(descent: Descent, fps: float) -> np.ndarray:
    """Times [s] of the pictures of a film: an impact that adds 0.5 m/s is seen for 0.6 s, a gentler one for less."""
    log = descent.rebounds
    times = np.r_[0.0, np.column_stack([log["t_touchdown"], log["t"]]).ravel(), descent.time]
    steps, holds = np.diff(times), 0.6 * np.clip(log["normal_impulse"] / (0.5 * descent.body.mass), 0.0, 1.0)
    steps[1::2] = np.maximum(steps[1::2], holds)
    film = np.r_[0.0, np.cumsum(steps)]
    return np.r_[np.interp(np.arange(0.0, film[-1], 1.0 / fps), film, times), descent.time]


def test_the_slider_scrubs_through_the_film(page: Browser, descent: Descent) -> None:
    """Oracle: the definition of the film; one step of the slider is a sixtieth of a second of it."""
    times = film_times(descent, 60.0)
    page.press("#slider", "\ue014" * 5)  # the right arrow key
    assert shown_time(page) == pytest.approx(times[5], abs=1e-4)
    last = int(page.run("return document.querySelector('#slider').max"))
    seen = []
    for step in (10, last // 3, last // 2, last):
        page.run("$('slider').value = arguments[0]; $('slider').dispatchEvent(new Event('input'))", step)
        time = shown_time(page)
        assert time == pytest.approx(times[min(step, len(times) - 1)], abs=1e-4)
        told = page.text("#now dd").removesuffix(" m")
        assert float(told) == pytest.approx(states_at(descent.trajectory, [time])[0, 0], abs=2e-3)
        seen.append(page.run("return document.querySelector('#sled').getBoundingClientRect().left"))
    assert seen == sorted(seen)
    assert page.text("#contact").startswith(("the end: finish", "contact"))


def test_a_row_of_the_table_shows_its_contact(page: Browser, descent: Descent) -> None:
    """Oracle: force, grip and mode that the descent recorded."""
    page.click("#rebounds tbody tr:nth-child(2)")
    rebound = descent.rebounds[1]
    time = shown_time(page)
    assert rebound["t"] - rebound["duration"] <= time <= rebound["t"]
    lines = page.text("#contact").splitlines()
    assert lines[0] == f"contact 2, arc: {mode_name(rebound['mode'])}"
    found = re.search(r"force ([\d.]+) kN, grip ([\d.]+)", lines[1])
    rows = descent.trajectory
    normal, tangential = (np.interp(time, rows["t"], rows[name]) for name in ("normal", "tangential"))
    assert found is not None
    assert 1e3 * float(found[1]) == pytest.approx(normal, rel=0.02)
    assert float(found[2]) == pytest.approx(abs(tangential) / (ICE.friction * normal), abs=0.02)
    assert page.run("return document.querySelectorAll('.cone, .force').length") == 2
    assert page.run("return document.querySelector('tr.current').cells[0].textContent") == "2"


def test_play_runs_to_the_end_and_pause_stops(page: Browser, descent: Descent) -> None:
    at_speed(page, 0.01)  # the film does not end while a busy machine is late to look
    page.click("#play")
    wait_until(page, "position > 0")
    page.click("#play")
    paused = shown_time(page)
    page.run("return new Promise(done => setTimeout(done, 200))")
    assert shown_time(page) == paused < descent.time
    at_speed(page, 1000)
    page.click("#play")
    wait_until(page, "$('play').textContent === 'Play'")
    assert shown_time(page) == pytest.approx(descent.time, abs=1e-4)
