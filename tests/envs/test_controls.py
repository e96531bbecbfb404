"""Whatever an agent chooses of the launch: bounds, words, energy, and one answer of all environments."""

from __future__ import annotations

import pickle
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import given
from hypothesis import strategies as st
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import sledenv
from sledenv import Context, Scenario
from sledenv.envs import LAUNCH_ID
from sledenv.envs.launch import SledLaunch
from sledenv.envs.task import Task
from sledenv.envs.vector import SledLaunchVector
from sledenv.scenarios.sections import CONTROLS, control_words
from tests.own_scenarios import own_scenario

BOUNDS = {"orientation": (-120.0, 150.0), "spin": (-3.0, 7.0), "speed": (2.5, 5.0)}  # in deg, rad/s, m/s
WORDS = tuple(control_words(BOUNDS))
COLUMN = {"orientation": 2, "spin": 5, "speed": 3}  # of State

every_word = pytest.mark.parametrize("control", WORDS)


def with_bounds(name: str = own_scenario("brake_mat"), length: float = 10.0) -> Scenario:
    """A shipped scenario in which the speed may be chosen too, all within ``BOUNDS``."""
    content = sledenv.load_scenario(name).model_dump(mode="json", by_alias=True)
    keys = {"orientation_deg": "orientation", "spin_rad_s": "spin", "speed_m_s": "speed"}
    content["control"] |= {key: BOUNDS[name] for key, name in keys.items()}
    content["slope"]["length_m"] = length
    return Scenario.model_validate(content)


SCENARIO = with_bounds()
SHORT = with_bounds(length=2.0)


def in_context_units(name: str) -> np.ndarray:
    return np.radians(BOUNDS[name]) if name == "orientation" else np.array(BOUNDS[name])


def test_a_word_is_a_combination_in_the_order_of_the_actions():
    """Oracle: the words by hand; all that a control stands for is a field of the context."""
    assert tuple(BOUNDS) == tuple(CONTROLS)
    assert set(CONTROLS) <= set(Context._fields)
    assert control_words(BOUNDS) == {
        "both": ("orientation", "spin"),
        "orientation": ("orientation",),
        "spin": ("spin",),
        "speed": ("speed",),
        "orientation+spin": ("orientation", "spin"),
        "orientation+speed": ("orientation", "speed"),
        "spin+speed": ("spin", "speed"),
        "orientation+spin+speed": ("orientation", "spin", "speed"),
        "all": ("orientation", "spin", "speed"),
    }
    assert tuple(control_words(["spin", "orientation"])) == ("both", "orientation", "spin", "orientation+spin", "all")


@given(
    control=st.sampled_from(WORDS),
    draws=st.lists(st.floats(0.0, 1.0, exclude_max=True), min_size=11, max_size=11),
    action=st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3),
)
def test_an_action_scales_to_the_bounds_and_leaves_the_rest_to_the_context(control, draws, action):
    """Oracle: the bounds by hand; -1 and 1 are the bounds themselves."""
    task = Task(SCENARIO, control)
    contexts = SCENARIO.contexts(np.array([draws]))
    scenes = SCENARIO.scenes(contexts)
    drawn = scenes.launches[0]
    count = len(task.controlled)
    for values in (action[:count], [-1.0] * count, [1.0] * count):
        state = task.aimed(scenes, np.array([values])).launches[0]
        for name, column in COLUMN.items():
            if name in task.controlled:
                low, high = in_context_units(name)
                wanted = low + (high - low) * 0.5 * (values[task.controlled.index(name)] + 1.0)
                assert state[column] == pytest.approx(wanted, abs=1e-14)
                assert low <= state[column] <= high
            else:
                assert state[column] == drawn[column]
        assert (state[0], state[4]) == (drawn[0], drawn[4])


@every_word
def test_the_energy_of_a_chosen_speed_counts_as_supplied(control):
    """Oracle: m (u1^2 - u0^2)/2, for two contexts that differ in nothing but the speed, on a level floor."""
    content = SCENARIO.model_dump(mode="json", by_alias=True)
    content["slope"]["angle_deg"] = 0.0
    task = Task(Scenario.model_validate(content), control)
    contexts = task.scenario.contexts(np.full((2, 11), 0.5))
    actions = np.full((2, len(task.controlled)), 0.2)
    if "speed" in task.controlled:
        actions[:, task.controlled.index("speed")] = -1.0, 1.0
        speeds = np.array(BOUNDS["speed"])
    else:
        contexts[:, 3] = speeds = np.array([1.0, 4.0])
    scenes = task.aimed(task.scenes(contexts), actions)
    assert scenes.launches[:, 3].tolist() == speeds.tolist()
    supplied = task.descend(scenes).outcomes["supplied"]
    assert np.diff(supplied) == pytest.approx(0.5 * task.bodies[0].mass * np.diff(speeds**2), rel=1e-9)


@every_word
def test_what_is_chosen_is_not_observed_and_contexts_are_drawn_as_ever(control):
    """Oracle: an environment that chooses both, from the same seed; the fields of the context by hand."""
    env, twin = SledLaunch(SCENARIO, control), SledLaunch(SCENARIO)
    for seed in (5, None):
        observation, info = env.reset(seed=seed)
        assert info == twin.reset(seed=seed)[1]
        for name in BOUNDS:
            assert (observation[Context._fields.index(name)] == 0.0) == (name in env.task.controlled)
        env.step(np.zeros(env.action_space.shape, np.float32))
        twin.step(np.zeros(2, np.float32))


@every_word
def test_both_checkers_pass_without_a_warning(control):
    """Oracle: Gymnasium's and SB3's check_env; pytest turns warnings into errors."""
    env = SledLaunch(SHORT, control)
    check_env(env, skip_render_check=True)
    check_env_sb3(env)


@pytest.mark.parametrize("control", ["speed", "orientation+speed", "orientation+spin+speed"])
def test_a_scenario_without_bounds_of_the_speed_has_no_control_of_it(control):
    """Oracle: the message; "all" is what there is."""
    allowed = "must be one of 'both', 'orientation', 'spin', 'orientation[+]spin', 'all'$"
    with pytest.raises(ValueError, match=f"control = '{control.replace('+', '[+]')}': {allowed}"):
        gym.make(LAUNCH_ID, scenario=own_scenario("brake_mat"), control=control)
    assert Task(own_scenario("brake_mat"), "all").controlled == ("orientation", "spin")


@pytest.mark.parametrize("control", ["trim", "spin+orientation", "speed+speed", "orientation+", "", "Both"])
def test_a_wrong_word_is_answered_with_the_known_ones(control):
    for kind in (SledLaunch, partial(SledLaunchVector, 2)):
        with pytest.raises(
            ValueError, match=r"^control = '.*': must be one of 'both', .*'orientation\+speed', .*'all'$"
        ):
            kind(SCENARIO, control)


def test_words_for_the_same_choice_make_the_same_task():
    """Oracle: the first word; a snapshot of one is a snapshot of the other."""
    assert Task(SCENARIO, "orientation+spin").control == Task(own_scenario("brake_mat"), "all").control == "both"
    env, twin = SledLaunch(SCENARIO, "all"), SledLaunch(SCENARIO, "orientation+spin+speed")
    env.reset(seed=0)
    twin.restore(pickle.loads(pickle.dumps(env.snapshot())))
    action = np.full(3, 0.25, np.float32)
    assert env.step(action)[1] == twin.step(action)[1]
