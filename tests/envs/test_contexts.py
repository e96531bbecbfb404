"""Contexts can be fixed in part, come in splits that share none, and launches can be disturbed."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest

import sledenv
from sledenv.envs import DESCENT_ID, LAUNCH_ID
from sledenv.envs.inputs import FIELDS
from sledenv.envs.vector import SledLaunchVector
from sledenv.simulation.support import support_heights, within_a_turn
from tests.own_scenarios import own_scenario

SPLITS = ("train", "validation", "test")
IDS = (LAUNCH_ID, DESCENT_ID)
BRAKE = sledenv.load_scenario(own_scenario("brake_mat"))
LOW, HIGH = BRAKE.ranges
VARIES = HIGH > LOW

places = st.one_of(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 2**20 - 1).map(lambda n: n / 2**20))


@given(one=places, other=places)
def test_no_value_of_one_split_is_ever_one_of_another_and_equal_draws_lie_far_apart(one, other):
    """Oracle: the claim itself, at arbitrary draws and at the borders of the cells."""
    first = {split: BRAKE.contexts(np.full(len(LOW), one), split) for split in SPLITS}
    second = {split: BRAKE.contexts(np.full(len(LOW), other), split) for split in SPLITS}
    for a in SPLITS:
        assert (first[a] >= LOW).all()
        assert (first[a] <= HIGH).all()
        for b in SPLITS:
            if a != b:
                assert not (first[a] == second[b])[VARIES].any()
                assert (np.abs(first[a] - first[b])[VARIES] > 0.23 * (HIGH - LOW)[VARIES]).all()


@pytest.mark.parametrize("name", IDS)
def test_environments_draw_from_their_split_and_an_option_draws_from_another_once(name):
    """Oracle: Scenario.sample with the stream of the same seed."""
    env = gym.make(name, scenario=own_scenario("brake_mat"), split="train")
    stream = np.random.default_rng(7)  # as Gymnasium seeds
    assert env.reset(seed=7)[1]["context"] == BRAKE.sample(stream, "train")._asdict()
    assert env.reset(options={"split": "test"})[1]["context"] == BRAKE.sample(stream, "test")._asdict()
    assert env.reset()[1]["context"] == BRAKE.sample(stream, "train")._asdict()
    plain = gym.make(name, scenario=own_scenario("brake_mat"))
    assert plain.reset(seed=7)[1]["context"] == BRAKE.sample(np.random.default_rng(7))._asdict()


@pytest.mark.parametrize("name", IDS)
def test_any_part_of_the_context_can_be_fixed_and_the_rest_is_drawn_as_without(name):
    """Oracle: a twin without options, field by field; launches are exact, because an error would be drawn."""
    env, twin = (gym.make(name, launch_noise=(0.0, 0.0)) for _ in range(2))
    env.reset(seed=3)
    twin.reset(seed=3)
    for fixed in ({}, {"friction": 0.35}, {"angle": 0.2, "spin": -1.0}, {"drop": np.float32(0.5), "speed": 3}):
        context = env.reset(options={"context": fixed})[1]["context"]
        assert context == twin.reset()[1]["context"] | {key: float(value) for key, value in fixed.items()}
    whole = BRAKE.sample(np.random.default_rng(0))
    for given_whole in (whole, whole._asdict()):
        assert env.reset(options={"context": given_whole})[1]["context"] == whole._asdict()
    assert env.reset()[1]["context"] == twin.reset()[1]["context"]  # nothing was drawn for them


@pytest.mark.parametrize("control", ["both", "orientation", "spin"])
def test_launch_noise_is_normal_and_disturbs_orientation_and_spin_after_the_action(control):
    """Oracle: the launches without noise; their differences against the normal distribution."""
    sigma = np.array([0.2, 0.7])
    quiet, noisy = SledLaunchVector(4000, control=control), SledLaunchVector(4000, control=control, launch_noise=sigma)
    noisy.reset(seed=0)
    scenes = noisy.episodes.lanes.scenes
    contexts = scenes.drawn
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (4000, len(quiet.task.controlled)))
    exact, disturbed = (
        noisy.task.aimed(given, actions).launches for given in (quiet.task.scenes(contexts[:, :FIELDS]), scenes)
    )
    noise = within_a_turn(disturbed - exact)[:, [2, 5]] / sigma
    for column in noise.T:
        assert kstest(column, "norm").pvalue > 1e-3
    assert abs(np.corrcoef(noise.T)[0, 1]) < 0.05
    same = [0, 3, 4]  # x, u, v
    assert np.array_equal(disturbed[:, same], exact[:, same])
    body = noisy.task.bodies[0]
    clearance = [y - support_heights(body.record, np.array([phi]))[0] for _, y, phi, *_ in disturbed[:200]]
    assert clearance == pytest.approx(contexts[:200, 4], abs=1e-12)
