"""Tracks of scenarios: vertices, and bumps that a number draws; what is refused, and what is seen from a place."""

from __future__ import annotations

import math
import pickle
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sledenv.scenarios.scenario import Context, Scenario
from sledenv.scenarios.tracks import TRACKS
from sledenv.simulation.bodies import Segment
from sledenv.simulation.scene import Profile, Slope, Zone, checked_profile
from tests.own_scenarios import DELETE, changed
from tests.scenarios.test_scenario import problems

BUMPS = {"height_m": [0.4, 0.9], "face_m": [2.5, 4], "top_m": [0.2, 1.5], "gap_m": [2, 8]}
ROOF = [[0, 0], [1, 0.1], [2, 0]]
SIZE = 0.75  # of the body [m]


def bumpy(length: float = 40.0, **keys: Any) -> Scenario:
    return Scenario.model_validate(changed(slope__length_m=length, slope__bumps=BUMPS | keys))


def drawn(scenario: Scenario, count: int = 40, seed: int = 0) -> np.ndarray:
    return scenario.contexts(np.random.default_rng(seed).random((count, scenario.draws)))


def profiles(scenario: Scenario, contexts: np.ndarray) -> list[Profile]:
    """The vertices of the ground of each context, with their radii."""
    return [tuple(ground[["x", "y", "radius"]].tolist()) for ground in scenario.scenes(contexts).grounds()]


# Vertices.


def test_a_profile_is_that_of_every_slope() -> None:
    """Oracle: the simulator's own slope; vertices without a turn are left out of it, but count in the hash."""
    scenario = Scenario.model_validate(changed(slope__profile_m=ROOF))
    context = scenario.sample(np.random.default_rng(0))
    assert scenario.given(context).slope == Slope(context.angle, 10.0, 9.81, (), ROOF)
    assert profiles(scenario, drawn(scenario)) == 40 * [tuple((*vertex, 0.0) for vertex in ROOF)]
    assert len(scenario.scenes(drawn(scenario)).pieces) == len(ROOF) + 1  # which all share
    assert scenario.draws == 11
    assert pickle.loads(pickle.dumps(scenario)) == Scenario.model_validate(scenario.model_dump()) == scenario
    cut = Scenario.model_validate(changed(slope__profile_m=[[0, 0], [0.5, 0.05], [1, 0.1], [2, 0]]))
    assert cut.given(context).slope == scenario.given(context).slope
    plain = Scenario.model_validate(changed())
    assert len({cut.hash, scenario.hash, plain.hash}) == 3
    assert Scenario.model_validate(changed(slope__profile_m=None, slope__bumps=None)).hash == plain.hash


def test_a_launch_over_a_profile_has_the_drop_between_body_and_ground() -> None:
    """Oracle: the least distance of 40 000 points of the outline of a disc from the ground below them."""
    scenario = Scenario.model_validate(changed(slope__profile_m=[[-1, 0], [0, 0.5], [0.4, 0.1], [1, 0.8], [2, 0.8]]))
    contexts = drawn(scenario)
    around = np.linspace(0.0, 2.0 * math.pi, 40_001)
    for context, launch in zip(contexts, scenario.scenes(contexts).launches, strict=True):
        disc, _, slope, alone = scenario.given(Context(*context))
        assert launch.tolist() == list(alone)
        assert isinstance(disc, Segment)
        x = -disc.eccentricity * math.sin(launch[2]) + 0.5 * np.cos(around)
        y = launch[1] + disc.eccentricity * math.cos(launch[2]) + 0.5 * np.sin(around)
        assert (y - slope.height_at(x)).min() == pytest.approx(context[4], abs=1e-4)


def test_ground_may_be_rounded() -> None:
    """Oracle: the simulator's own slope; a radius of 0 is none, and is not told in the hash.

    One that there is no room for is told as it is asked for.
    """
    scenario = Scenario.model_validate(changed(slope__profile_m=ROOF, slope__rounding_m=[0, 0.5, 0]))
    context = scenario.sample(np.random.default_rng(0))
    assert scenario.given(context).slope == Slope(context.angle, 10.0, 9.81, (), ROOF, (0.0, 0.5, 0.0))
    plain = Scenario.model_validate(changed(slope__profile_m=ROOF))
    assert Scenario.model_validate(changed(slope__profile_m=ROOF, slope__rounding_m=0)).hash == plain.hash
    assert scenario.hash != plain.hash
    large = Scenario.model_validate(changed(slope__profile_m=ROOF, slope__rounding_m=[5, 50, 0]))
    assert large.given(context).slope == Slope(context.angle, 10.0, 9.81, (), ROOF, (5.0, 50.0, 0.0))
    wide = bumpy(rounding_m=30)
    assert set(wide.given(wide.sample(np.random.default_rng(0))).slope.rounding) == {30.0}
    bumps = bumpy(rounding_m=0.3)
    assert bumpy(rounding_m=0).hash == bumpy().hash != bumps.hash
    contexts = drawn(bumps, 5)
    for profile, sharp, context in zip(profiles(bumps, contexts), profiles(bumpy(), contexts), contexts, strict=True):
        assert profile == bumps.given(Context(*context)).slope.ground == tuple((x, y, 0.3) for x, y, _ in sharp)


def test_a_zone_may_be_given_by_pieces() -> None:
    """Oracle: the places of the vertices; behind the finish a zone goes on."""
    zones = [{"pieces": [1, 2], "friction": 0.5}, {"pieces": [0, 0], "friction": [0.1, 0.2]}]
    profile = [[-1, 0], [1, 0.1], [2, 0], [3, 0], [30, 0.1]]
    content = changed(slope__profile_m=profile, slope__length_m=31) | {"zones": zones}
    scenario = Scenario.model_validate(content)
    context = scenario.sample(np.random.default_rng(0))
    assert (context.zone_begin, 0.1 < context.zone_friction < 0.2) == (-1.0, True)
    first, second = scenario.given(context).slope.zones
    assert (first, second) == (Zone(-1, 1, context.zone_friction, 0.005), Zone(1, 3, 0.5, 0.005))
    assert Scenario.model_validate(scenario.model_dump()) == scenario
    (last,) = Scenario.model_validate(content | {"zones": [{"pieces": [3, 3], "friction": 0.5}]}).zones
    assert (last.begin_m, last.end_m) == ((3, 3), 30)
    allowed = "must be a pair [first, last] of whole numbers in [0, 3], pieces of the profile"
    for wrong in ([2, 1], [0, 4], [-1, 0], [0.5, 1], [0], 3, "01"):
        (line,) = problems(content | {"zones": [{"pieces": wrong, "friction": 0.5}]})
        assert line == f"scenario example: zones.0.pieces = {wrong!r}: {allowed}"
    (line,) = problems(content | {"zones": [{"pieces": [0, 0], "begin_m": 0, "friction": 0.5}]})
    assert line.endswith("zones.0: must have either begin_m and end_m, pieces or material, not begin_m and pieces")


def test_a_slope_ends_where_its_ground_is_level_unless_its_length_is_given() -> None:
    """Oracle: the last vertex and the size of the body; a profile in the plane is none, and may be rigid."""
    scenario = Scenario.model_validate(changed(slope__profile_m=ROOF, slope__length_m=DELETE))
    assert scenario.slope_section.length_m == 2.0 + SIZE
    flat = Scenario.model_validate(changed(slope__profile_m=[[0, 0], [1, 0], [2, 0]]))
    assert flat.settings("rigid").solver == "rigid"


# Bumps.


@st.composite
def sections(draw: st.DrawFn) -> dict[str, Any]:
    def pair(low: float, high: float) -> list[float]:
        return sorted(draw(st.tuples(st.floats(low, high), st.floats(low, high))))

    keys = {"height_m": pair(0.001, 2), "face_m": pair(0.5, 5), "top_m": pair(0, 3), "gap_m": pair(0, 5)}
    if draw(st.booleans()):
        keys["back_m"] = pair(0.5, 6)
    if draw(st.booleans()):
        keys["start_m"] = draw(st.floats(SIZE, 10))
    return keys


@settings(deadline=None)
@given(sections(), st.floats(0, 60), st.lists(st.integers(0, TRACKS - 1), min_size=1, max_size=5))
def test_bumps_are_valid_profiles_inside_their_ranges(keys: dict[str, Any], more: float, tracks: list[int]) -> None:
    """Oracle: the checks of the simulator, and a walk along each track, bump by bump."""
    start = keys.get("start_m", SIZE)
    assume(keys["height_m"][1] / min(keys["face_m"][0], keys.get("back_m", keys["face_m"])[0]) < 5.6)
    back = keys.get("back_m", keys["face_m"])
    longest = sum(high for _, high in (keys["gap_m"], keys["face_m"], keys["top_m"], back))
    length = start + longest + SIZE + 1e-6 + more
    scenario = Scenario.model_validate(changed(slope__length_m=length, slope__bumps=keys))
    contexts = drawn(scenario, len(tracks))
    contexts[:, -1] = tracks
    for profile, again in zip(profiles(scenario, contexts), profiles(scenario, contexts[::-1])[::-1], strict=True):
        assert profile == again
        assert checked_profile([vertex[:2] for vertex in profile]) == profile
        corners = [y == 0.0 for _, y, _ in profile]
        assert corners[0]
        assert corners[-1]
        x, tops, reached = profile[0][0], [vertex for vertex in profile if vertex[1] > 0.0], start
        assert reached + keys["gap_m"][0] - 1e-3 <= x <= reached + keys["gap_m"][1] + 1e-9
        for _, y, _ in tops:
            assert keys["height_m"][0] <= y <= keys["height_m"][1]
        for (x0, y0, _), (x1, y1, _) in pairwise(profile):
            low, high = (
                keys["top_m"] if y0 == y1 > 0 else keys["gap_m"] if y0 == y1 else keys["face_m"] if y1 > y0 else back
            )
            assert low - 1e-9 <= x1 - x0 <= high + 1e-9
            assert x1 - x0 >= 1e-3 - 1e-9
        assert profile[-1][0] <= length - SIZE < profile[-1][0] + longest + 1e-9


def test_a_track_is_drawn_alike_on_every_machine() -> None:
    """Oracle: SplitMix64 in whole numbers of Python, and a recorded track."""
    scenario, track = bumpy(), 2_309_737_967

    def mixed(word: int) -> int:
        word = (word ^ word >> 30) * 0xBF58476D1CE4E5B9 % 2**64
        word = (word ^ word >> 27) * 0x94D049BB133111EB % 2**64
        return word ^ word >> 31

    golden, x, vertices = 0x9E3779B97F4A7C15, SIZE, []
    state = mixed(track + golden)
    for bump in range(100):
        draws = [(mixed((state + (5 * bump + k + 1) * golden) % 2**64) >> 11) * 2.0**-53 for k in range(5)]
        low_high = (BUMPS[key] for key in ("gap_m", "face_m", "top_m", "face_m", "height_m"))
        gap, face, top, _, height = (low + (high - low) * u for (low, high), u in zip(low_high, draws, strict=True))
        places = [x := x + step for step in (gap, face, top, face)]
        if x > 40.0 - SIZE:
            break
        vertices += zip(places, (0.0, height, height, 0.0), strict=True)
    context = scenario.sample(np.random.default_rng(0))._replace(track=float(track))
    assert scenario.given(context).slope.profile == tuple(vertices)
    assert scenario.given(context).slope.profile[1] == (12.047977060548822, 0.6394332391876765)


def test_a_context_draws_and_tells_the_number_of_its_track() -> None:
    """Oracle: twelve doubles, the last of which is the number; two splits have none in common."""
    scenario, rng, twin = bumpy(), np.random.default_rng(3), np.random.default_rng(3)
    context = scenario.sample(rng)
    assert context.track == np.floor(TRACKS * twin.random(12)[-1])
    assert rng.random() == twin.random()
    draws = np.random.default_rng(1).random((500, 12))
    draws[:, -1] = np.repeat(draws[:50, -1], 10) + np.tile(np.arange(10), 50) * 2.0**-32  # as near as numbers are
    splits: Any = ("train", "validation", "test")
    numbers = [set(scenario.contexts(np.minimum(draws, 1 - 2.0**-53), split)[:, -1].tolist()) for split in splits]
    assert not numbers[0] & numbers[1] | numbers[0] & numbers[2] | numbers[1] & numbers[2]
    assert scenario.given(context._replace(track=1.0)).slope != scenario.given(context).slope
    assert (scenario.contexts(np.full((2, 11), 0.5))[:, -1] == 0.0).all()
