"""Environments over tracks: what is told of them, that lanes have their own, and what is given back comes again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sledenv.envs.descent import SledDescent
from sledenv.envs.launch import SledLaunch
from sledenv.envs.task import Task
from sledenv.envs.vector import SledDescentVector, SledLaunchVector
from sledenv.scenarios.scenario import Scenario, load_scenario

LANES = 6


@pytest.fixture(scope="module")
def rollers() -> Scenario:
    """Return a sled over bumps."""
    bumps = {"height_m": [0.15, 0.4], "face_m": [3, 6], "top_m": [0.2, 1.5], "gap_m": [1, 4]}
    slope = {"angle_deg": [7, 11], "length_m": 25, "bumps": bumps}
    content = load_scenario("sled_snow").model_dump()
    return Scenario.model_validate(content | {"id": "rollers", "slope": slope, "zones": []})


def test_the_number_of_a_track_is_told_and_never_seen(rollers: Scenario) -> None:
    """Oracle: contexts that differ by it alone: what is seen of them differs in the vertices ahead."""
    env = SledLaunch(rollers, launch_noise=(0.0, 0.0))
    first, told = env.reset(seed=3)
    assert told["context"]["track"] >= 1.0
    assert first.shape == (35,)
    assert "track" not in env.task.observation_names
    assert env.task.contexts_seen(first[np.newaxis])[0, -1] == 0.0
    rewards = set()
    for track in (7, 8, 7.0, 8):
        again, info = env.reset(options={"context": told["context"] | {"track": track}})
        assert info["context"] == told["context"] | {"track": float(track)}
        np.testing.assert_array_equal(again[:11], first[:11])
        assert (again[11:] != first[11:]).any()
        rewards.add(env.step(np.zeros(env.action_space.shape, np.float32))[1])
    assert len(rewards) == 2
    for wrong in (0.5, -1, 2**32):
        with pytest.raises(ValueError, match=r"context\.track = .*: must be a whole number in \[0, 4294967296\)"):
            env.reset(options={"context": {"track": wrong}})
    with pytest.raises(ValueError, match=r"observe = \['track'\]: must be 'all' or a sequence"):
        SledLaunch(rollers, observe=["track"])
    with pytest.raises(ValueError, match="solver = 'rigid': must be 'compliant' in scenario rollers"):
        SledLaunch(rollers, solver="rigid")


@pytest.mark.parametrize(("one", "many"), [(SledLaunch, SledLaunchVector), (SledDescent, SledDescentVector)])
def test_each_lane_has_a_track_of_its_own(rollers: Scenario, one: Any, many: Any) -> None:
    """Oracle: an environment alone for each lane, of the same seed, bit for bit, over several episodes."""
    batch, alone = many(LANES, scenario=rollers), [one(rollers) for _ in range(LANES)]
    seeds = list(range(10, 10 + LANES))
    seen, told = batch.reset(seed=seeds)
    singles = [env.reset(seed=seed) for env, seed in zip(alone, seeds, strict=True)]
    assert len(set(told["context"]["track"].tolist())) == LANES
    rng, over = np.random.default_rng(0), np.zeros(LANES, bool)
    for _ in range(12):
        for i, (observation, _) in enumerate(singles):
            np.testing.assert_array_equal(seen[i], observation)
        actions = rng.uniform(-1.0, 1.0, batch.action_space.shape).astype(np.float32)
        seen, rewards, terminated, truncated, _ = batch.step(actions)
        for i, env in enumerate(alone):
            if over[i]:
                singles[i] = env.reset()
                continue
            observation, reward, *_ = env.step(actions[i])
            singles[i] = observation, {}
            assert reward == rewards[i]
        over = terminated | truncated


def test_a_batch_of_descents_is_each_of_them_alone(rollers: Scenario) -> None:
    """Oracle: Task.descend of each context; with bodies of two kinds as well."""
    content = rollers.model_dump()
    other = content["body"] | {"balance": 0.05}
    for scenario in (
        rollers,
        Scenario.model_validate(content | {"body": {"kind": "choice", "of": [content["body"], other]}}),
    ):
        task = Task(scenario)
        contexts = scenario.contexts(np.random.default_rng(1).random((8, scenario.draws)))
        actions = np.random.default_rng(2).uniform(-1.0, 1.0, (8, len(task.controlled)))
        launches = task.launches(contexts, actions)
        batch = task.descend_batch(contexts, launches)
        for i in range(8):
            alone = task.descend(contexts[i : i + 1], task.launch(contexts[i : i + 1], actions[i : i + 1]))
            assert alone.as_batch().outcomes[0] == batch.outcomes[i]


def test_speeds_are_scaled_by_all_that_a_profile_can_supply(rollers: Scenario) -> None:
    """Oracle: the energy of a fall from the highest to the lowest vertex on top of that of the plane."""
    content = rollers.model_dump()
    content["slope"] |= {"bumps": None}
    flat = Task(Scenario.model_validate(content))
    content["slope"] |= {"profile_m": [(5, 0), (10, -2), (15, -2), (20, 0)]}
    deep = Task(Scenario.model_validate(content))
    assert deep._speed**2 - flat._speed**2 == pytest.approx(2.0 * 9.81 * 2.0)
