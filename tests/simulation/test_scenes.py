"""Scenes: what is put into lanes is what was there, whoever shares a pool; oracle: the same scenes one by one."""

from __future__ import annotations

import numpy as np
import pytest

import sledenv
from sledenv.simulation.checks import checked_scenes
from sledenv.simulation.scenes import Scenes
from sledenv.simulation.simulator import Simulator, at_launch
from tests.own_scenarios import ride_over_bumps

LAW = sledenv.ContactLaw(1e6, 0.5, 0.1, 0.001)
BODIES = [sledenv.disc(2.0, 0.3), sledenv.disc(3.0, 0.5), sledenv.sled()]


def some(rng: np.random.Generator, count: int) -> Scenes:
    """Scenes of all kinds: bodies, zones and profiles of any length, planes among them."""
    bodies, slopes = [], []
    for _ in range(count):
        zones = [sledenv.Zone(5.0 * k, 5.0 * k + 4.0, 0.2, 0.001) for k in range(rng.integers(0, 4))]
        x = np.cumsum(rng.uniform(1.0, 4.0, rng.integers(2, 9))) + 3.0
        profile = np.column_stack([x, rng.uniform(-0.2, 0.2, len(x))]) if rng.random() < 0.7 else ()
        slopes.append(sledenv.Slope(rng.uniform(0.1, 0.3), 60.0, zones=zones, profile=profile, rounding=0.3))
        bodies.append(BODIES[rng.integers(0, len(BODIES))])
    launches = np.column_stack([np.zeros(count), np.full(count, 3.0), *rng.uniform(-1.0, 3.0, (4, count))])
    return checked_scenes(bodies, LAW, slopes, launches, sledenv.Settings())


def told(scenes: Scenes, lane: int) -> tuple[bytes, ...]:
    """All that a lane has, whatever its places in the pools are."""
    row = scenes.rows[lane]
    zones = scenes.zones[int(row["zones"]) : int(row["zones_end"])]
    pieces = scenes.pieces[int(row["ground"]) : int(row["ground_end"])]
    places = "body", "ground", "ground_end", "zones", "zones_end"
    numbers = np.array([row[name] for name in scenes.rows.dtype.names if name not in places])
    return numbers.tobytes(), scenes.bodies[int(row["body"])].tobytes(), zones.tobytes(), pieces.tobytes()


@pytest.mark.parametrize("seed", range(8))
def test_lanes_hold_what_was_put_there_last(seed: int) -> None:
    """Oracle: a list of lanes, each told by itself; batches that were taken before stay as they were."""
    rng = np.random.default_rng(seed)
    scenes = some(rng, 12)
    expected = [told(scenes, lane) for lane in range(12)]
    kept = []
    for _ in range(12):
        lanes = rng.permutation(12)[: rng.integers(0, 13)]
        if rng.random() < 0.3:
            kept.append((scenes.take(lanes), [expected[lane] for lane in lanes]))
            scenes = scenes.take(slice(None))
        others = some(rng, len(lanes)) if len(lanes) else scenes.take(lanes)
        for lane, number in zip(lanes.tolist(), range(len(lanes)), strict=True):
            expected[lane] = told(others, number)
        scenes = scenes.put(lanes, others)
        assert [told(scenes, lane) for lane in range(12)] == expected
    for taken, were in kept:
        assert [told(taken, lane) for lane in range(len(were))] == were


def test_scenes_are_launched_and_followed_in_any_lane_alike() -> None:
    """Oracle: simulate() of each body, law, slope and launch, bit for bit."""
    scenario = ride_over_bumps()
    rng = np.random.default_rng(2)
    first, second = (scenario.draw(rng.random((6, scenario.draws))) for _ in range(2))
    limits = scenario.settings().limits
    simulator = Simulator(first, False, limits)
    simulator.launch(np.array([4, 1]), second.take(np.array([0, 5])))
    taken = simulator.take(np.array([4, 4, 2]))
    simulator.launch(np.array([4]), second.take(np.array([3])))
    for one, scenes, lane in ((taken, second, 0), (simulator, second, 3)):
        alone = Simulator(scenes.take(np.array([lane])), False, limits)
        alone.run()
        one.run()
        assert one.flights[0 if one is taken else 4].tobytes() == alone.flights[0].tobytes()
    assert taken.flights[0].tobytes() == taken.flights[1].tobytes() != taken.flights[2].tobytes()


def test_a_flight_of_zeros_begins_at_its_launch() -> None:
    """Oracle: flights that were put there before."""
    scenes = some(np.random.default_rng(5), 20)
    limits = sledenv.Settings(max_rebounds=20).limits
    begun = Simulator(scenes, False, limits)
    blank = Simulator(scenes, False, limits, flights=np.zeros_like(at_launch(scenes)))
    for each in (begun, blank):
        each.run()
    assert begun.flights.tobytes() == blank.flights.tobytes()
    assert (begun.flights["rebounds"] > 0).all()


@pytest.mark.parametrize("given", [{"streams": 3.0}, {}])
def test_one_context_is_ridden_with_several_streams_of_errors(given: dict[str, float]) -> None:
    """Oracle: the errors of the scenario, by the number of the stream; that of the track unless another is given."""
    scenario = ride_over_bumps(noise_rad_s=0.3)
    scenes = scenario.draw(np.full((4, scenario.draws), 0.5))
    if given:
        scenes.rows["stream"] = np.arange(4.0)
    errors = scenario.errors(scenes.rows["stream"], np.zeros(4, int))
    assert len(set(errors.tolist())) == (4 if given else 1)
    assert len(np.unique(scenes.rows["ground"])) == 1
