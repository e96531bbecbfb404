"""Tracks made by hand: what is refused, and the scenario of a ride on one."""

from __future__ import annotations

import doctest
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from sledenv.scenarios import Track, handmade, load_track, scenario, track_names
from sledenv.scenarios.configuration import CONFIGS, write_yaml
from sledenv.scenarios.scenario import Context, Scenario, load_scenario, scenario_names

GIVEN = {
    "id": "mine",
    "title": "Mine",
    "description": "One bump.",
    "length_m": 20,
    "profile_m": [[4, 0], [6, 0.5], [8, 0]],
}
RIDES = [name for name in scenario_names() if load_scenario(name).is_ride]


def test_the_tracks_that_ship_are_the_files_of_the_folder_and_differ() -> None:
    """Oracle: the folder. Each begins and ends level, so that a sled starts and finishes on its runners."""
    names = track_names()
    assert names == tuple(sorted(file.stem for file in (CONFIGS / "tracks").glob("*.yaml")))
    tracks = [load_track(name) for name in names]
    assert [track.id for track in tracks] == list(names)
    for what in ("title", "description", "profile_m"):
        assert max(Counter(getattr(track, what) for track in tracks).values()) == 1
    for track in tracks:
        (begin, level), (end, _) = track.profile_m[0], track.profile_m[-1]
        assert (level, track.length_m) == (0.0, 50.0)
        assert begin >= 3.0
        assert end <= 47.0


def test_a_track_is_read_from_a_file(tmp_path: Path) -> None:
    """Oracle: the mapping."""
    write_yaml(tmp_path / "mine.yaml", GIVEN)
    assert load_track(tmp_path / "mine.yaml") == Track.model_validate(GIVEN)


@pytest.mark.parametrize("name", RIDES)
def test_a_ride_on_a_track_is_the_same_over_other_ground(name: str) -> None:
    """Oracle: all that a descent is given, but for the profile and the length of the slope."""
    plain = load_scenario(name)
    there = {track: plain.on(track) for track in track_names()}
    assert len({plain.hash, *(one.hash for one in there.values())}) == 13
    for track, one in there.items():
        made = load_track(track)
        assert one.id == f"{name}_on_{track}"
        assert one.is_ride
        assert one == Scenario.model_validate(one.model_dump(by_alias=True))
        for mine, other in zip(plain.ranges, one.ranges, strict=True):
            assert np.array_equal(mine, other)
        context = Context(*plain.contexts(np.random.default_rng(1).random(12), "test").tolist())
        assert context == Context(*one.contexts(np.random.default_rng(1).random(12), "test").tolist())
        mine, other = plain.given(context), one.given(context)
        assert (other.body, other.law) == (mine.body, mine.law)
        assert other.launch._replace(y=0.0) == mine.launch._replace(y=0.0)
        planes = [slope._replace(profile=(), rounding=(), length=1.0) for slope in (mine.slope, other.slope)]
        assert planes[0] == planes[1]
        assert other.slope.length == made.length_m
        assert [(x, y) for x, y in other.slope.profile] == list(made.profile_m)
        assert (one.rider, one.limits, one.ends, one.control) == (plain.rider, plain.limits, plain.ends, plain.control)


def test_a_track_is_as_round_as_the_bumps_were() -> None:
    rollers = load_scenario("sled_rollers")
    bumps = rollers.slope_section.bumps
    assert bumps is not None
    slope = rollers.slope_section.model_copy(update={"bumps": bumps.model_copy(update={"rounding_m": 0.3})})
    assert rollers.model_copy(update={"slope_section": slope}).on("whoops").slope_section.rounding_m == 0.3
    assert rollers.on(Track.model_validate(GIVEN)).slope_section.rounding_m == 0.0


def test_the_examples_run() -> None:
    """Oracle: what they print."""
    assert [doctest.testmod(module).failed for module in (handmade, scenario)] == [0, 0]
