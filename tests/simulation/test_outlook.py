"""The ground around a place and a landing as they are told, against slow and obvious versions."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import sledenv
from sledenv.envs import DESCENT_ID
from sledenv.envs.sb3 import make_vec_env
from sledenv.envs.task import Task
from sledenv.envs.vector import SledDescentVector
from sledenv.kernel.params import SCENE
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.outlook import AHEAD, BEHIND, LANDING, PLACES, look_out
from sledenv.simulation.records import OUTCOME
from sledenv.simulation.scene import Slope
from sledenv.simulation.scenes import NO_ZONES, Scenes

Profile = list[tuple[float, float]]


def slowly_around(profile: Profile, x: float) -> list[list[float]]:
    """Two vertices behind a place and eight ahead, one after the other, relative to the ground there; 1 if there."""
    ground = float(np.interp(x, *np.array(profile).T)) if profile else 0.0
    behind = [vertex for vertex in profile if vertex[0] <= x][-BEHIND:]
    ahead = [vertex for vertex in profile if vertex[0] > x][:AHEAD]
    slots = [None] * (BEHIND - len(behind)) + behind + ahead + [None] * (AHEAD - len(ahead))
    return [4 * [0.0] if one is None else [one[0] - x, one[1] - ground, 0.0, 1.0] for one in slots]


def scenes_on(ground: Grounds, lanes: int, slope: Slope | None = None, lying: float = 0.1) -> Scenes:
    """Scenes of lanes on some ground, whose body is a disc with a radius."""
    rows = np.zeros(lanes, SCENE)
    rows["ground"], rows["ground_end"] = ground.places.T
    if slope is not None:
        rows["angle"], rows["length"], rows["gravity"] = slope[:3]
    return Scenes(rows, sledenv.disc(1.0, lying).record, ground.pieces, NO_ZONES)


def at(places: np.ndarray) -> np.ndarray:
    """Flights that begin at places."""
    flights = np.zeros(len(places), OUTCOME)
    flights["x"] = places
    return flights


@given(st.lists(st.integers(0, 14), min_size=1, max_size=6), st.integers(0, 2**32), st.booleans(), st.booleans())
def test_vertices_around_places_are_those_that_a_slow_search_finds(
    counts: list[int], seed: int, one: bool, exact: bool
) -> None:
    """Oracle: a search vertex by vertex; of one ground for all or of one each, at vertices and between."""
    rng = np.random.default_rng(seed)
    profiles: list[Profile] = []
    for count in counts[:1] if one else counts:
        x = np.cumsum(rng.uniform(0.2, 3.0, count))
        profiles.append(list(zip(x.tolist(), rng.normal(size=count).tolist(), strict=True)))
    vertices = np.full((len(profiles), max(map(len, profiles)), 3), np.inf)
    for row, profile in zip(vertices, profiles, strict=True):
        row[: len(profile)] = np.array([(*vertex, 0.0) for vertex in profile]).reshape(-1, 3)
    places = rng.uniform(-2.0, 25.0, len(counts))
    if exact and vertices.shape[1]:
        found = vertices[0 if one else np.arange(len(counts)), rng.integers(vertices.shape[1], size=len(counts)), 0]
        places = np.where(np.isfinite(found), found, places)
    for ground in (Grounds.drawn(vertices), Grounds.of([row[np.isfinite(row[:, 0])] for row in vertices])):
        scenes = scenes_on(ground, len(counts))
        seen = look_out(scenes, at(places), ahead=False)
        assert seen.landings.shape[0] == 0
        for i, laid_out in enumerate(scenes.grounds()):
            profile = profiles[0 if one else i]
            assert list(zip(laid_out["x"], laid_out["y"], strict=True)) == profile
            np.testing.assert_allclose(seen.around[i], slowly_around(profile, places[i]), rtol=0.0, atol=1e-12)


# Landings.


def slow_landing(slope: Slope, flight: np.void, lying: float) -> tuple[float, float]:
    """Time and place of a landing, by a march in steps of a tenth of a millisecond."""
    t = np.arange(1, 12_801) * 1e-4
    downhill, inward = slope.gravity * math.sin(slope.angle), slope.gravity * math.cos(slope.angle)
    x = flight["x"] + (flight["u"] + 0.5 * downhill * t) * t
    y = flight["y"] + (flight["v"] - 0.5 * inward * t) * t
    ground, ahead = slope.height_at(x), slope.height_at(x + 1e-6)
    rise = (ahead - ground) / 1e-6
    clear = (y - ground) / np.sqrt(1.0 + rise * rise) - lying
    falls = flight["v"] - inward * t < rise * (flight["u"] + downhill * t)
    first = int(np.argmax((clear <= 0.0) & falls))
    return float(t[first]), float(x[first])


@pytest.mark.parametrize("rounding", [0.0, 1.5])
def test_a_landing_is_where_a_march_along_the_parabola_meets_the_ground(rounding: float) -> None:
    """Oracle: a slow march, and the heights that the slope tells; velocities and pose by closed forms."""
    rng, lying = np.random.default_rng(5), 0.12
    profile = [(1.0, 0.0), (4.0, 0.5), (4.6, 0.5), (7.0, 0.0), (9.0, 0.1), (12.0, 0.6), (15.0, 0.0)]
    slope = Slope(0.08, 40.0, profile=profile, rounding=rounding)
    scenes = scenes_on(Grounds.of([slope.vertices]), 1, slope, lying)
    for _ in range(40):
        flights = np.zeros(1, OUTCOME)
        flights["x"], flights["phi"] = rng.uniform(0.0, 5.0), rng.uniform(-9.0, 9.0)
        flights["y"] = slope.height_at(flights["x"]) + lying + rng.uniform(0.02, 0.6)
        flights["u"], flights["v"], flights["omega"] = rng.uniform(2.0, 9.0), rng.uniform(0.0, 2.0), rng.normal()
        flights["trim_spin"] = 0.3
        seen = look_out(scenes, flights)
        found = dict(zip(LANDING, seen.landings[0, : len(LANDING)].tolist(), strict=True))
        time, x = slow_landing(slope, flights[0], lying)
        if abs(found["time"] - time) > 0.021:  # a skim between two looks
            continue
        assert found["time"] == pytest.approx(time, abs=2e-4)
        assert found["distance"] == pytest.approx(x - flights["x"][0], abs=2e-3)
        place = found["distance"] + flights["x"][0]
        pitch = math.atan((slope.height_at(place + 1e-7) - slope.height_at(place - 1e-7)) / 2e-7)
        if abs(pitch - found["pitch"]) < 1e-5:  # not at a vertex
            u = flights["u"][0] + slope.gravity * math.sin(0.08) * found["time"]
            v = flights["v"][0] - slope.gravity * math.cos(0.08) * found["time"]
            assert found["approach"] == pytest.approx(math.sin(pitch) * u - math.cos(pitch) * v, abs=1e-4)
            assert found["speed"] == pytest.approx(math.cos(pitch) * u + math.sin(pitch) * v, abs=1e-4)
            pose = flights["phi"][0] + (flights["omega"][0] - 0.3) * found["time"] - pitch
            assert math.remainder(found["pose"] - pose, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-5)
        assert found["spin"] == pytest.approx(flights["omega"][0] - 0.3)
        heights = seen.landings[0, len(LANDING) : len(LANDING) + len(PLACES)]
        told = np.array(PLACES) + place < slope.vertices[-1, 0] - 0.5  # the ninth vertex is none here
        expected = slope.height_at(place + np.array(PLACES)) - slope.height_at(place)
        np.testing.assert_allclose(heights[told], expected[told], atol=1e-9)


def test_nothing_is_told_of_ground_behind_the_eighth_vertex() -> None:
    """Oracle: another ground behind it leaves all that is told."""
    x = np.arange(1.0, 13.0)
    one = np.column_stack([x, np.tile([0.0, 0.3], 6), np.full(12, 0.2)])
    other = one.copy()
    other[8:, 1] += 0.5
    flights = np.zeros(1, OUTCOME)
    flights["x"], flights["y"], flights["u"], flights["v"] = 0.5, 1.5, 9.0, 4.0
    first, second = (look_out(scenes_on(Grounds.of([rows]), 1, Slope(0.1)), flights) for rows in (one, other))
    assert first.landings.tobytes() == second.landings.tobytes()
    assert first.around.tobytes() == second.around.tobytes()


# What environments make of it.


def test_columns_can_be_chosen_and_are_the_same_in_all_kinds_of_environments() -> None:
    """Oracle: all of them; lane by lane the scalar environment, bit for bit."""
    kwargs = {"scenario": "sled_rollers"}
    native = SledDescentVector(3, autoreset_mode="Disabled", info=(), **kwargs)
    adapter = make_vec_env(DESCENT_ID, 3, seed=7, env_kwargs=kwargs)
    scalars = [gym.make(DESCENT_ID, **kwargs) for _ in range(3)]
    fewer = gym.make(DESCENT_ID, columns=("context", "state", "ground"), **kwargs)
    seen, theirs = native.reset(seed=7)[0], adapter.reset()
    assert seen.shape == (3, 52 + len(LANDING) + 2 * len(PLACES)) == theirs.shape
    assert scalars[0].unwrapped.observation_names[52:55] == ("landing_time", "landing_distance", "landing_pitch")
    for i, scalar in enumerate(scalars):
        assert np.array_equal(scalar.reset(seed=7 + i)[0], seen[i])
        assert np.array_equal(theirs[i], seen[i])
    assert np.array_equal(fewer.reset(seed=7)[0], seen[0, :52])
    actions = np.array([[0.3], [-0.2], [0.0]], np.float32)
    stepped, *_ = native.step(actions)
    assert np.array_equal(scalars[1].step(actions[1])[0], stepped[1])
    alone = Task("sled_rollers", ride=True, columns=["landing", "context"])
    assert alone.groups == ("context", "landing")
