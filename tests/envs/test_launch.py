"""SledLaunch keeps the contracts of Gymnasium and stable-baselines3, adds no physics, and offers every control."""

from __future__ import annotations

import json
import pickle
import re
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import InvalidAction
from gymnasium.utils.env_checker import check_env
from hypothesis import given
from hypothesis import strategies as st
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import sledenv
from sledenv.envs import DESCENT_ID, LAUNCH_ID
from sledenv.envs.inputs import checked_actions
from sledenv.envs.render import draw_film
from sledenv.envs.task import Task
from sledenv.scenarios import Context, Scenario
from sledenv.scenarios.sections import CONTROLS, control_words
from tests.envs.kinds import SCALAR, both_ids, equal
from tests.own_scenarios import own_scenario

SCENARIOS = sledenv.scenario_names()
BOUNDS = {"orientation": (-120.0, 150.0), "spin": (-3.0, 7.0), "speed": (2.5, 5.0)}  # in deg, rad/s, m/s
WORDS = tuple(control_words(BOUNDS))

every_word = pytest.mark.parametrize("control", WORDS)
CONTENT = sledenv.load_scenario(own_scenario("brake_mat")).model_dump(mode="json", by_alias=True)
KEYS = {"orientation_deg": "orientation", "spin_rad_s": "spin", "speed_m_s": "speed"}
CONTENT["control"] |= {key: BOUNDS[name] for key, name in KEYS.items()}
SCENARIO = Scenario.model_validate(CONTENT)  # in which the speed may be chosen too


def make(**kwargs):
    return gym.make(LAUNCH_ID, **{"scenario": own_scenario("bowl_snow")} | kwargs)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_both_checkers_pass_without_a_warning(scenario):
    """Oracle: Gymnasium's and SB3's check_env; pytest turns warnings into errors."""
    env = make(scenario=scenario)
    check_env(env.unwrapped, skip_render_check=True)
    check_env_sb3(env.unwrapped)


@given(
    seed=st.integers(0, 10_000),
    chosen=st.lists(st.floats(-1, 1, width=32), min_size=3, max_size=3),
    scenario=st.sampled_from([SCENARIO, *map(sledenv.load_scenario, SCENARIOS)]),
    data=st.data(),
)
def test_a_step_is_the_simulated_descent_bit_for_bit(seed, chosen, scenario, data):
    """Oracle: simulate() of the launch that the action asks for, built from the bounds of the scenario by hand."""
    words = control_words(scenario.control_bounds)
    control = data.draw(st.sampled_from(list(words)))
    env = make(scenario=scenario, control=control, launch_noise=(0.0, 0.0))
    observation, info = env.reset(seed=seed)
    assert env.observation_space.contains(observation)
    action = np.array(chosen[: len(words[control])], np.float32)
    _, reward, terminated, truncated, after = env.step(action)
    assert terminated is True
    assert truncated is False
    context = sledenv.scenarios.Context(**info["context"])
    given = {}
    for name, value in zip(words[control], action.astype(float).tolist(), strict=True):
        low, high = scenario.control_bounds[name]
        low, high = np.radians((low, high)) if name == "orientation" else (low, high)
        given[name] = low + 0.5 * (value + 1.0) * (high - low)
    launch = scenario.given(context, **given).launch
    assert launch.u == given.get("speed", context.speed)
    descent = sledenv.simulate(
        *scenario.given(context)[:3], launch,
        max_time=scenario.limits.max_time_s, max_rebounds=scenario.limits.max_rebounds,
        tolerance=scenario.limits.tolerance,
        end_on_chord=scenario.ends.on_chord, end_touching=scenario.ends.touching,
        run_out=scenario.slope_section.run_out_m,
    )  # fmt: skip
    assert reward == descent.jam.reward
    assert 0.0 <= reward <= 1.0
    assert after["rebounds"].keys() == set(descent.rebounds.dtype.names)
    assert all(np.array_equal(column, descent.rebounds[name]) for name, column in after["rebounds"].items())
    assert after["is_success"] == (descent.status == "finish")
    assert sledenv.simulation.STATUS_OF_CODE[after["descent"]["status"]] == descent.status
    assert after["descent"]["energy"] == descent.energy._asdict()
    assert after["jam"]["jam_index"] == 1.0 - reward
    assert after["context"] == info["context"]  # what was drawn, not what was chosen
    assert json.loads(json.dumps(after)) == after


@both_ids
def test_the_films_since_the_last_call_are_the_film_of_the_whole_descent(env_id, short_scenario):
    """Oracle: the film of the descent, simulated beside the environment."""
    env = SCALAR[env_id](short_scenario)
    env.reset(seed=3)
    films = [list(env.film())]
    assert len(films[0]) == 1
    action, before = np.zeros(env.action_space.shape, np.float32), env.snapshot()
    env.step(action)
    again = next(env.film())
    env.restore(before)
    ended = False
    while not ended:
        *_, ended, _, _ = env.step(action)
        films.append(list(env.film()))
        assert list(env.film()) == []
    assert np.array_equal(again, films[1][0])
    context, scenario = env.task.context(env.episodes.lanes.scenes), env.task.scenario
    chosen = () if env_id == DESCENT_ID else (0.0, 0.5 * sum(scenario.control.spin_rad_s))
    given = *scenario.given(context)[:3], scenario.given(context, *chosen).launch
    whole = sledenv.simulate(*given, record="trajectory", end_on_chord=scenario.ends.on_chord)
    assert len(films) > (2 if env_id == DESCENT_ID else 1)
    assert np.array_equal([picture for film in films[1:] for picture in film], list(draw_film(whole))[1:])
    env.reset(seed=4)
    assert len(list(env.film())) == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"episode": {}}, "must hold lanes, trims"),
        ({"episode": None}, "must hold lanes, trims"),
        ({"episode": {"pasts": []}}, r"snapshot.episode\['pasts'\] is empty"),
        ({"task": None}, "of another task"),
    ],
)
def test_a_snapshot_that_has_been_changed_is_refused_and_the_episode_goes_on(change, message):
    """Oracle: a twin that was never given it."""
    env, twin = make().unwrapped, make().unwrapped
    env.reset(seed=4)
    twin.reset(seed=4)
    taken = env.snapshot()
    if change.get("episode"):
        change = {"episode": taken.episode | change["episode"]}
    with pytest.raises((TypeError, ValueError), match=message):
        env.restore(taken._replace(**change))
    assert env.step(np.zeros(2, np.float32))[1] == twin.step(np.zeros(2, np.float32))[1]


def test_an_action_outside_by_rounding_is_on_the_bound():
    """Oracle: Gymnasium's RescaleAction at its own bounds, whatever they are."""
    env, furthest, rng = make(), 0.0, np.random.default_rng(0)
    space = env.action_space
    for away, width in zip(rng.uniform(-500.0, 500.0, 300), 10.0 ** rng.uniform(-3.0, 3.0, 300), strict=True):
        scaled = gym.wrappers.RescaleAction(env, np.float32(away * width), np.float32((away + 1.0) * width))
        asked = np.array([scaled.action(scaled.action_space.low), scaled.action(scaled.action_space.high)])
        within = checked_actions(space, ("orientation", "spin"), asked, 2)
        assert np.array_equal(within, np.clip(asked, space.low, space.high))
        furthest = max(furthest, np.abs(asked).max() - 1.0)
    assert furthest > 1e-6  # rounding is met
    env.reset(seed=0)
    with pytest.raises(InvalidAction, match=r"action = \[1.001, 0.0\]: must be within .*; .*\.ClipAction puts"):
        env.step(np.array([1.001, 0.0]))


@pytest.mark.parametrize("env_id", [LAUNCH_ID, DESCENT_ID])
def test_the_limit_of_the_spec_ends_no_episode_of_a_shipped_scenario(env_id):
    """Oracle: the limits of the scenarios."""
    most = max(sledenv.load_scenario(name).limits.max_rebounds for name in SCENARIOS)
    assert gym.spec(env_id).max_episode_steps > (1 if env_id == LAUNCH_ID else most + 1)


@both_ids
@pytest.mark.parametrize("make", [gym.make, gym.make_vec])
def test_an_unknown_argument_is_told_in_pythons_own_words(make, env_id):
    """Oracle: Python, of a function without that argument. At these words TorchRL takes its `frameskip` back."""
    with pytest.raises(TypeError) as pythons:
        (lambda: None)(frameskip=1)
    words = str(pythons.value)[str(pythons.value).index("got an unexpected keyword argument") :]
    with pytest.raises(TypeError, match=re.escape(f".__init__() {words}; it has ")):
        make(env_id, frameskip=1)


@both_ids
@pytest.mark.parametrize("make", [gym.make, gym.make_vec])
@pytest.mark.parametrize("kind", [str, Path])
def test_a_spec_makes_the_same_environment_in_another_folder(make, env_id, kind, tmp_path, monkeypatch):
    """Oracle: the environment itself; the absolute path. Names and scenarios stay what they are."""
    file = Path(own_scenario("ice_drop"))
    monkeypatch.chdir(file.parent)
    env = make(env_id, scenario=kind(file.name))
    monkeypatch.chdir(tmp_path)
    assert env.spec.kwargs["scenario"] == str(file)
    for spec in (env.spec, pickle.loads(pickle.dumps(env.spec)), EnvSpec.from_json(env.spec.to_json())):
        assert equal(env.reset(seed=2), make(spec).reset(seed=2))
    for scenario in ("sled_mat", SCENARIO):
        assert make(env_id, scenario=scenario).spec.kwargs["scenario"] == scenario
    assert "scenario" not in make(env_id).spec.kwargs


def test_entries_of_observations_and_actions_have_names():
    """Oracle: the spaces; the documented order."""
    for name in (LAUNCH_ID, DESCENT_ID):
        given = {"control": "spin"} if "Launch" in name else {}
        one, batch = gym.make(name, **given).unwrapped, gym.make_vec(name, 2, **given)
        assert len(one.observation_names) == one.observation_space.shape[0]
        assert len(one.action_names) == one.action_space.shape[0]
        assert (batch.observation_names, batch.action_names) == (one.observation_names, one.action_names)
        assert one.observation_names[:11] == sledenv.scenarios.Context._fields[:11]
        assert one.action_names == ("spin" if given else "trim",)


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
