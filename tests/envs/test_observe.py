"""Observations: what is told of what varies, on measured scales; info tells how the body was let go."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import sledenv
from sledenv.envs import DESCENT_ID, LAUNCH_ID
from sledenv.envs.columns import AROUND, FORESEEN, GROUPS, Columns
from sledenv.envs.descent import SledDescent
from sledenv.envs.launch import SledLaunch
from sledenv.envs.task import Task
from sledenv.envs.vector import SledDescentVector
from sledenv.scenarios.scenario import Context
from sledenv.simulation.outlook import LANDING, VERTEX

IDS = (LAUNCH_ID, DESCENT_ID)
HIDDEN = ("friction", "restitution")
FIELDS = Context._fields[:11]
SEEN = tuple(name for name in FIELDS if name not in HIDDEN)
COLUMNS = [Context._fields.index(name) for name in HIDDEN]


@pytest.mark.parametrize("name", IDS)
def test_what_is_hidden_reads_zero_and_nothing_else_changes(name):
    """Oracle: a twin that sees all, with the same seed and actions."""
    env, twin = gym.make(name, observe=SEEN), gym.make(name)
    env.action_space.seed(0)
    for seed in range(5):
        seen, told = env.reset(seed=seed)
        everything, theirs = twin.reset(seed=seed)
        assert told == theirs
        ended = False
        while not ended:
            assert (seen[COLUMNS] == 0.0).all()
            assert (everything[COLUMNS] != 0.0).all()
            assert (np.delete(seen, COLUMNS) == np.delete(everything, COLUMNS)).all()
            action = env.action_space.sample()
            seen, *step = env.step(action)
            everything, *theirs = twin.step(action)
            assert step == theirs
            ended = step[1] or step[2]


def test_a_hidden_field_is_taken_to_be_in_the_middle_of_its_range_by_those_who_ask():
    task, whole = Task("sled_snow", observe=SEEN), Task("sled_snow")
    contexts = whole.scenario.contexts(np.random.default_rng(0).random((50, len(Context._fields))))
    seen, full = (one.contexts_seen(one.observe(one.scenes(contexts))) for one in (task, whole))
    low, high = task.scenario.ranges
    assert np.allclose(seen[:, COLUMNS], 0.5 * (low + high)[COLUMNS], rtol=1e-12)
    others = [i for i in range(len(low)) if i not in COLUMNS]
    assert np.array_equal(seen[:, others], full[:, others], equal_nan=True)
    assert (task.hidden == np.isin(Context._fields, HIDDEN)).all()
    assert not whole.hidden.any()


def rollers(**slope: Any) -> sledenv.scenarios.Scenario:
    """A sled over bumps, or over other ground."""
    bumps = {"height_m": [0.15, 0.4], "face_m": [3, 6], "top_m": [0.2, 1.5], "gap_m": [1, 4]}
    ground = {"angle_deg": [7, 11], "length_m": 25} | (slope or {"bumps": bumps})
    content = sledenv.load_scenario("sled_snow").model_dump()
    return sledenv.scenarios.Scenario.model_validate(content | {"id": "rollers", "slope": ground, "zones": []})


def test_the_number_of_a_track_is_told_and_never_seen():
    """Oracle: contexts that differ by it alone: what is seen of them differs in the vertices ahead."""
    env = SledLaunch(rollers(), launch_noise=(0.0, 0.0))
    first, told = env.reset(seed=3)
    assert first.shape == (35,)
    assert "track" not in env.task.observation_names
    assert env.task.contexts_seen(first[np.newaxis])[0, -1] == 0.0
    rewards = set()
    for track in (7, 8, 7.0):
        again, info = env.reset(options={"context": told["context"] | {"track": track}})
        assert info["context"] == told["context"] | {"track": float(track)}
        assert np.array_equal(again[:11], first[:11])
        assert (again[11:] != first[11:]).any()
        rewards.add(env.step(np.zeros(env.action_space.shape, np.float32))[1])
    assert len(rewards) == 2
    with pytest.raises(ValueError, match=r"context\.track = 0.5: must be a whole number in \[0, 4294967296\)"):
        env.reset(options={"context": {"track": 0.5}})
    with pytest.raises(ValueError, match="solver = 'rigid': must be 'compliant' in scenario rollers"):
        SledLaunch(rollers(), solver="rigid")


def test_speeds_are_scaled_by_all_that_a_profile_can_supply():
    """Oracle: the energy of a fall from the highest to the lowest vertex on top of that of the plane."""
    flat, deep = Task(rollers(bumps=None)), Task(rollers(profile_m=[(5, 0), (10, -2), (15, -2), (20, 0)]))
    assert deep.columns.scales.speed**2 - flat.columns.scales.speed**2 == pytest.approx(2.0 * 9.81 * 2.0)


@pytest.mark.parametrize("noise", [(0.0, 0.0), (0.02, 0.05)])
@pytest.mark.parametrize("kind", [SledLaunch, SledDescent])
def test_info_tells_the_launch_with_its_error(kind, noise):
    """Oracle: simulate() with what info tells, whose reward must be that of the episode."""
    env = kind("sled_mat", launch_noise=noise)
    scenario = env.task.scenario
    for seed in range(10):
        env.reset(seed=seed)
        total, ended = 0.0, False
        action = np.zeros(env.action_space.shape, np.float32)
        while not ended:
            _, reward, terminated, truncated, info = env.step(action)
            total, ended = total + reward, terminated or truncated
        context = Context(**info["context"])
        told = info["launch"]
        meant = scenario.given(context).launch
        launch = meant._replace(phi=told["orientation"], omega=told["spin"], u=told["speed"])
        height = sledenv.simulation.support.support_height(scenario.given(context).body, launch.phi)
        launch = launch._replace(y=height + context.drop)
        again = sledenv.simulate(
            *scenario.given(context)[:3],
            launch,
            scenario.settings("compliant"),
        )
        assert again.jam.reward == pytest.approx(total, abs=1e-12)
        assert (told["orientation"] != context.orientation) == bool(noise[0])
        assert told["speed"] == context.speed


RIDES = [name for name in sledenv.scenario_names() if sledenv.load_scenario(name).rider is not None]


@pytest.fixture(scope="module")
def seen() -> dict[str, tuple[np.ndarray, Columns]]:
    """Return what is seen of rides with random trims, by scenario."""
    found = {}
    for name in RIDES:
        env = SledDescentVector(64, name, columns=GROUPS, info=(), autoreset_mode="SameStep")
        rng, told = np.random.default_rng(0), [env.reset(seed=0)[0]]
        told += [env.step(rng.uniform(-1.0, 1.0, (64, 1)).astype(np.float32))[0] for _ in range(24)]
        found[name] = np.concatenate(told), env.task.columns
    return found


def test_the_kernel_tells_what_the_columns_say():
    assert tuple(one.name for one in AROUND) == VERTEX
    assert tuple(one.name for one in FORESEEN) == LANDING


def test_values_are_read_back_in_their_units(seen):
    """Oracle: the scales one by one."""
    rows, columns = seen["sled_rollers"]
    values = columns.values(rows)
    assert values["left"] == pytest.approx(rows[:, columns.names.index("left")] * 50.0, abs=1e-4)
    assert values["landing_time"] == pytest.approx(rows[:, columns.names.index("landing_time")] * 0.8, abs=1e-6)
    assert set(zip(columns.names, columns.units, strict=True)) >= {("u", "m/s"), ("angle", "rad"), ("ahead_1_x", "m")}
