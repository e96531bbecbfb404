"""The page to ride: its rides are those of Python, and a visitor can ride with the keys alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from sledenv.envs.task import Task
from sledenv.pages.ride import Hill, Ridden, ride_page
from sledenv.scenarios import load_track, track_names
from sledenv.scenarios.scenario import Context, Scenario, load_scenario, scenario_names
from sledenv.simulation.outcomes import Descent
from tests.browser import Browser, assert_needs_nothing, at_speed, patient, wait_until

SEEDS: Final = (4, 5)
LEFT, RIGHT = "\ue012", "\ue014"  # the arrow keys
STANDS = "!asking && !looking && !going"


def drawn(name: str, seed: int) -> tuple[Scenario, Context]:
    scenario = load_scenario(name).ride()
    return scenario, scenario.sample(np.random.default_rng(seed))


def in_python(scenario: Scenario, context: Context, trims: Sequence[float]) -> Descent:
    """The ride of some trims, and of none behind them."""
    task = Task(scenario, ride=True)
    return task.ridden(task.scenes(np.array([context])), [*trims, *[0.0] * 60], "trajectory")


def page_of(name: str) -> str:
    """Two hills, with a ride of many trims and one of none."""
    hills = []
    for seed in SEEDS:
        scenario, context = drawn(name, seed)
        steady = [Ridden("steady", [0.25] * 30), Ridden("a <rule>", [0.0] * 30)]
        hills.append(Hill(f"draw {seed}", context, steady))
    return ride_page(scenario, hills)


@pytest.mark.parametrize("name", [name for name in scenario_names() if load_scenario(name).rider])
def test_every_scenario_with_a_rider_has_a_page_that_refers_to_nothing_outside(name: str) -> None:
    assert_needs_nothing(page_of(name))


def test_a_page_to_ride_needs_a_rider_and_a_hill() -> None:
    scenario, context = drawn("paper_impact", 0)
    with pytest.raises(ValueError, match="scenario paper_impact has no rider"):
        ride_page(scenario, [Hill("drawn", context)])
    with pytest.raises(ValueError, match="hills is empty"):
        ride_page(load_scenario("sled_rollers"), [])


# What a browser shows.


@pytest.fixture
def page(chromium: Browser, tmp_path: Path) -> Iterator[Browser]:
    """The rider is unsteady: errors are part of each ride."""
    file = tmp_path / "ride.html"
    file.write_text(patient(page_of("sled_kickers")), encoding="utf-8")
    chromium.open(file)
    wait_until(chromium, f"riders.length > 0 && {STANDS}")
    yield chromium
    assert chromium.log() == []  # no error, and no request that the page's policy refused


def told(page: Browser, rider: int) -> list[float]:
    """Time, place and reward of a ride, with all digits."""
    numbers = page.run(
        "const { outcome, jam } = riders[arguments[0]]; return [outcome.t, outcome.x, jam.reward].map(String)", rider
    )
    return [float(number) for number in numbers]


def numbers_of(descent: Descent) -> list[float]:
    return [descent.time, descent.state.x, descent.jam.reward]


def test_a_ride_with_the_keys_alone_ends_with_the_score_of_python(page: Browser) -> None:
    """Oracle: ``Ride`` with the same trims and the errors of the context, bit for bit; so of the other rides."""
    scenario, context = drawn("sled_kickers", SEEDS[0])
    at_speed(page, 50.0)
    assert "Get to the finish without a fall" in page.text("#words")
    page.press("body", " ")
    wait_until(page, f"atTakeoff() && {STANDS}")
    assert page.run("return $('ahead').childElementCount") == 2  # the path to where it lands, and the pose there
    trims = []
    keys = RIGHT * 3, LEFT * 5, LEFT * 4
    while not page.run("return isOver()"):
        page.press("body", keys[len(trims) % len(keys)])
        trims.append(page.run("return trimOf()"))
        page.press("body", " ")
        wait_until(page, f"(atTakeoff() || isOver()) && {STANDS}")
    assert trims[:3] == [-0.15, 0.1, 0.3]
    assert page.run("return you().trims") == trims
    descent = in_python(scenario, context, trims)
    assert told(page, 0) == numbers_of(descent)
    for rider, trim in ((1, 0.25), (2, 0.0)):
        assert told(page, rider) == numbers_of(in_python(scenario, context, [trim] * 30))
    for rider in range(3):
        assert page.text(f".rider:nth-child({rider + 1}) .score") == f"{told(page, rider)[-1]:.3f}"
    score = f"{descent.jam.reward:.3f}"
    assert page.text("#words").endswith(f"Score {score}, your best here {score}.")


def test_a_fall_is_told_and_the_best_score_stays(page: Browser) -> None:
    """Oracle: the parts that touch in the last row of ``Ride``, of those that end it."""
    scenario, context = drawn("sled_kickers", SEEDS[1])  # on which all three fall
    page.run("location.hash = arguments[0]", f"slope=draw+{SEEDS[1]}")
    wait_until(page, f"hill === E.hills[1] && {STANDS}")
    at_speed(page, 50.0)
    page.click("#through")
    scores = []
    for trim in (1.0, -1.0, 0.0):
        page.click("#again")
        wait_until(page, f"time === 0 && {STANDS}")
        page.run("setTrim(arguments[0])", -trim)
        page.click("#go")
        wait_until(page, f"isOver() && {STANDS}")
        descent = in_python(scenario, context, [trim] * 30)
        scores.append(float(descent.jam.reward))
        assert told(page, 0) == numbers_of(descent)
        last = descent.contacts[descent.contacts["row"] == descent.contacts["row"][-1]]
        parts = {descent.body.parts[code - 1] for code in last["part"]} & set(scenario.settings().end_parts)
        words = page.text("#words")
        assert words.endswith(f"your best here {max(scores):.3f}.")
        assert descent.status == "tumbled"
        assert words.startswith(f"You fell at {descent.state.x:.1f} m: {' and '.join(parts)} on the snow.")
        assert page.text("#go") == "Ride again"
    assert page.run("return riders.every(one => hasEnded(one))")


def test_a_link_holds_the_slope_and_a_flight_can_be_taken_back(page: Browser) -> None:
    """Oracle: ``Ride`` with as many trims as there were take-offs, all alike."""
    scenario, context = drawn("sled_kickers", SEEDS[1])
    at_speed(page, 50.0)
    page.run("location.hash = arguments[0]", f"slope=draw+{SEEDS[1]}")
    wait_until(page, f"hill === E.hills[1] && {STANDS}")
    page.run("$('hill').selectedIndex = 0; $('hill').dispatchEvent(new Event('input'))")
    wait_until(page, f"hill === E.hills[0] && {STANDS}")
    assert page.run("return location.hash") == f"#slope=draw+{SEEDS[0]}"
    page.run("history.back()")
    wait_until(page, f"hill === E.hills[1] && {STANDS}")
    page.click("#through")
    page.click("#up")
    page.click("#go")
    wait_until(page, f"isOver() && {STANDS}")
    flights = page.run("return you().trims.length")
    assert flights > 1
    assert told(page, 0) == numbers_of(in_python(scenario, context, [0.05] * flights))
    page.click("#back")
    wait_until(page, f"atTakeoff() && {STANDS}")
    assert page.run("return you().trims.length") == flights - 1
    page.click("#go")
    wait_until(page, f"isOver() && {STANDS}")
    assert told(page, 0) == numbers_of(in_python(scenario, context, [0.05] * flights))
    page.click("#again")
    wait_until(page, f"time === 0 && {STANDS}")
    assert page.text("#go") == "Start"


def test_a_track_is_chosen_by_its_title(chromium: Browser, tmp_path: Path) -> None:
    """Oracle: titles and descriptions of the tracks; ``Ride`` on the one that is chosen, bit for bit."""
    scenario, context = drawn("sled_rollers", SEEDS[0])
    tracks = [load_track(name) for name in track_names()]
    hills = [Hill(one.title, context, [Ridden("none", [0.0] * 30)], scenario.on(one)) for one in tracks]
    file = tmp_path / "ride.html"
    file.write_text(patient(ride_page(scenario, hills, "Tracks")), encoding="utf-8")
    chromium.screen(390, 844)
    chromium.open(file)
    wait_until(chromium, f"riders.length > 0 && {STANDS}")
    assert chromium.text("h1") == "Tracks"
    assert chromium.run("return [...$('hill').options].map(one => one.textContent)") == [one.title for one in tracks]
    assert chromium.text("#hills").startswith("track")
    chromium.run("$('hill').selectedIndex = 8; $('hill').dispatchEvent(new Event('input'))")
    wait_until(chromium, f"hill === E.hills[8] && {STANDS}")
    assert chromium.text("#question") == tracks[8].description
    assert told(chromium, 1) == numbers_of(in_python(scenario.on(tracks[8]), context, [0.0] * 30))
    chromium.must_be_readable(390)
    assert chromium.log() == []
