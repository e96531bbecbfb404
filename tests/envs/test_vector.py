"""The native vector environments are SyncVectorEnv of the scalar ones, bit for bit, whatever the number of lanes."""

from __future__ import annotations

import copy
import pickle

import gymnasium as gym
import numpy as np
import pandas as pd
import pytest
from gymnasium.error import InvalidAction, ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import sledenv
from sledenv.envs import DESCENT_ID, LAUNCH_ID
from sledenv.envs.info import INFO_KEYS
from sledenv.envs.vector import SledVectorEnv
from tests.envs.kinds import NATIVE, SCALAR, WIDTH, both_ids, equal
from tests.envs.test_bodies import SEVERAL
from tests.own_scenarios import own_scenario, ride_over_bumps

MODES = list(AutoresetMode)


def native(
    lanes: int, mode: AutoresetMode = AutoresetMode.SAME_STEP, env_id: str = LAUNCH_ID, **options
) -> SledVectorEnv:
    return NATIVE[env_id](
        lanes, autoreset_mode=mode, **{"scenario": own_scenario("brake_mat"), "info": INFO_KEYS} | options
    )


def actions(rng: np.random.Generator, lanes: int, env_id: str = LAUNCH_ID) -> np.ndarray:
    return rng.uniform(-1.0, 1.0, (lanes, WIDTH[env_id])).astype(np.float32)


@both_ids
def test_make_vec_gives_the_native_batch_by_default_and_its_spec_makes_it_again(env_id):
    given = {"control": "spin"} if env_id == LAUNCH_ID else {}
    env = gym.make_vec(env_id, num_envs=3, scenario=own_scenario("ice_drop"), **given)
    assert isinstance(env, NATIVE[env_id])
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    one = SCALAR[env_id](own_scenario("ice_drop"), **given)
    assert env.single_observation_space == one.observation_space
    assert env.single_action_space == one.action_space
    assert env.observation_space.shape == (3, *one.observation_space.shape)
    assert env.action_space.shape == (3, 1)
    again = gym.make_vec(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert isinstance(again, NATIVE[env_id])
    assert equal(env.reset(seed=1), again.reset(seed=1))
    sync = gym.make_vec(env_id, num_envs=3, vectorization_mode="sync")
    assert isinstance(sync, SyncVectorEnv)


TASKS = [
    {"scenario": own_scenario("brake_mat")},
    {"scenario": ride_over_bumps(noise_rad_s=0.3), "max_episode_steps": 3},  # as by TimeLimit
    {"scenario": SEVERAL},
    {"scenario": "paper_impact"},
    {
        "scenario": own_scenario("ice_fast"),
        "control": "spin",
        "solver": "rigid",
        "split": "train",
        "launch_noise": (0.2, 0.0),
    },
]


# Each mode with each task, and each environment with both.
@pytest.mark.parametrize(
    ("env_id", "mode", "given"),
    [(list(NATIVE)[(i + k) % 2], mode, given) for i, mode in enumerate(MODES) for k, given in enumerate(TASKS)]
    + [(DESCENT_ID, mode, TASKS[1]) for mode in MODES[1:2]],
)
def test_every_autoreset_mode_agrees_with_syncvectorenv_in_all_it_returns(env_id, mode, given):
    """Oracle: Gymnasium's SyncVectorEnv of the scalar environment; lanes run out of step by partial resets."""
    given = given if env_id == LAUNCH_ID else {key: value for key, value in given.items() if key != "control"}
    env = native(5, mode, env_id, **given)
    sync = gym.make_vec(env_id, num_envs=5, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **given)
    assert env.metadata["autoreset_mode"] is sync.metadata["autoreset_mode"] is mode
    rng, ended = np.random.default_rng(0), np.zeros(5, bool)
    with pytest.raises(ResetNeeded, match="call reset before step"):
        env.step(env.action_space.sample())
    with pytest.raises(ResetNeeded, match="the first reset must be one of all lanes"):
        env.reset(options={"reset_mask": np.arange(5) > 0})
    assert equal(env.reset(seed=11), sync.reset(seed=11))
    assert env.np_random_seed == sync.np_random_seed
    for _ in range(15):
        action = rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        if mode is AutoresetMode.NEXT_STEP:
            action[ended] = np.nan  # of lanes that are being reset
        one, other = env.step(action), sync.step(action)
        assert env.observation_space.contains(one[0])
        assert equal(one, other)
        mask, ended = rng.random(5) < (0.5 if env_id == LAUNCH_ID else 0.1), one[2] | one[3]
        if mode is AutoresetMode.DISABLED:
            mask |= ended
        if mask.any():
            seeds = [int(seed) if chance < 0.3 else None for seed, chance in zip(range(5), rng.random(5), strict=True)]
            given = {"options": {"reset_mask": mask}, "seed": seeds}
            assert equal(env.reset(**copy.deepcopy(given)), sync.reset(**copy.deepcopy(given)))
            ended &= ~mask


def test_contexts_are_given_for_all_lanes_or_one_a_lane_and_leave_the_streams_alone():
    """Oracle: a twin that was given none."""
    env, twin = native(3), native(3)
    env.reset(seed=3)
    twin.reset(seed=3)
    own = sledenv.load_scenario(own_scenario("brake_mat"))
    contexts = [own.sample(np.random.default_rng(i)) for i in range(3)]
    _, info = env.reset(options={"context": contexts})
    assert info["context"]["friction"].tolist() == [context.friction for context in contexts]
    assert equal(env.step(np.zeros((3, 2), np.float32))[0], twin.reset()[0])  # the draw after the first
    _, info = env.reset(options={"context": contexts[1]})
    assert set(info["context"]["speed"]) == {contexts[1].speed}
    frictions = np.array([0.3, 0.4, 0.5])
    assert np.array_equal(env.reset(options={"context": {"friction": frictions}})[1]["context"]["friction"], frictions)


@pytest.mark.parametrize("mode", MODES)
@both_ids
def test_nothing_that_is_returned_is_used_again(env_id, mode):
    """Oracle: what a twin returns after a user has written into everything."""
    env, twin = native(2, mode, env_id), native(2, mode, env_id)
    action, calls = np.zeros((2, WIDTH[env_id]), np.float32), []
    for one in (env, twin):
        calls = [one.reset(seed=0), one.step(action), one.reset(seed=0), one.step(action)]
        if one is env:
            for observations, *_, info in calls:
                observations[:] = 9.0
                overwrite(info)
    if mode is not AutoresetMode.DISABLED or env_id == DESCENT_ID:
        calls.append(twin.step(action))
        assert equal(env.step(action), calls[-1])
    assert equal(env.reset(seed=0), calls[0])
    assert equal(env.step(action), calls[1])


def overwrite(info: dict) -> None:
    """Write into all arrays and lists of an info."""
    for value in info.values():
        if isinstance(value, dict):
            overwrite(value)
        elif value.dtype == object:
            for part in value:
                if isinstance(part, dict):
                    overwrite(part)
                elif part is not None:
                    part[:] = [] if isinstance(part, list) else 9.0
        else:
            value[:] = 1


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.zeros((2, 2)), r"actions have shape \(2, 2\): must be \(3, 2\)"),
        (np.zeros((3, 1)), r"actions have shape \(3, 1\): must be \(3, 2\), columns orientation, spin"),
        ([[0.0, 0.0], [0.0, np.nan], [0.0, 0.0]], r"actions\[1\] = \[0.0, nan\]: must be within \[-1.0, 1.0\]"),
        ([[0.0, 0.0], [0.0, 0.0], [1.5, 0.0]], r"actions\[2\] = \[1.5, 0.0\]: must be within"),
        ([[0.0, 0.0], [0.0], [0.0, 0.0]], r"actions = \[\[0.0, 0.0\], .*: must be numbers, columns orientation, spin"),
        (None, "actions = None: must be numbers"),
        (pd.DataFrame({"orientation": np.zeros(3), "spn": 0.0}), "actions has the column 'spn': must have the columns"),
        (pd.DataFrame({"spin": np.zeros(3)}), "actions has no column 'orientation'"),
    ],
)
def test_a_wrong_action_is_refused_and_no_lane_advances(action, message):
    """Oracle: a twin that was never given it."""
    env, twin = native(3), native(3)
    env.reset(seed=6)
    twin.reset(seed=6)
    with pytest.raises(InvalidAction, match=message):
        env.step(action)
    good = actions(np.random.default_rng(0), 3)
    assert equal(env.step(good), twin.step(good))
    assert equal(env.reset(), twin.reset())


def test_actions_and_contexts_of_a_frame_are_taken_by_name():
    """Oracle: a twin that is given arrays; columns stand in another order."""
    env, twin = native(3), native(3)
    rng = np.random.default_rng(2)
    contexts = np.array([sledenv.load_scenario(own_scenario("brake_mat")).sample(rng) for _ in range(3)])
    frame = pd.DataFrame(contexts, columns=sledenv.scenarios.Context._fields).iloc[:, ::-1]
    for given, known in (
        (frame, contexts),
        (frame.iloc[1], contexts[1]),
        ({"drop": frame["drop"]}, {"drop": contexts[:, 4]}),
    ):
        assert equal(env.reset(seed=3, options={"context": given}), twin.reset(seed=3, options={"context": known}))
        chosen = actions(rng, 3)
        asked = pd.DataFrame(chosen[:, ::-1], columns=["spin", "orientation"])
        assert equal(env.step(asked), twin.step(chosen))


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        (
            {"options": {"contxt": None}},
            ValueError,
            "unknown option 'contxt': must be one of 'context', 'split', 'reset_mask'",
        ),
        ({"options": {"context": np.zeros((2, 12))}}, ValueError, r"context has shape \(2, 12\): must be \(12,\) or"),
        (
            {"options": {"context": [[0.1, 0.1, e, 1.0, 0.5, *[0.0] * 7] for e in (0.5, 0.0, 0.5)]}},
            ValueError,
            r"context\[1\]\.restitution = 0.0: must be in \(0, 1\]",
        ),
        ({"options": {"context": pd.DataFrame({"drop": [1.0] * 3})}}, ValueError, "context has no column 'angle'"),
        ({"options": {"reset_mask": [True, False, False]}}, TypeError, "must be an array of bool"),
        ({"options": {"reset_mask": np.ones(2, bool)}}, ValueError, r"has shape \(2,\): must be \(3,\)"),
        ({"options": {"reset_mask": np.zeros(3, bool)}}, ValueError, "no lane to reset"),
        ({"seed": [1, 2]}, ValueError, "seed has 2 entries: must be one per lane, 3"),
        ({"seed": [5, 6, -1]}, ValueError, r"seed\[2\] = -1: must be an integer >= 0"),
    ],
)
def test_a_wrong_reset_is_refused_and_changes_nothing(given, error, message):
    """Oracle: a twin that was never reset so."""
    env, twin = native(3), native(3)
    env.reset(seed=6)
    twin.reset(seed=6)
    with pytest.raises(error, match=message):
        env.reset(**given)
    action = actions(np.random.default_rng(0), 3)
    assert equal(env.step(action), twin.step(action))
    assert equal(env.reset(), twin.reset())


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"num_envs": 0}, ValueError, "num_envs = 0: must be an integer >= 1"),
        ({"autoreset_mode": "never"}, ValueError, "autoreset_mode = 'never': must be one of 'NextStep', 'SameStep'"),
        ({"info": "jam"}, ValueError, "must be a sequence of any of"),
        ({"render_mode": "oil"}, ValueError, "render_mode = 'oil': must be one of 'human', 'rgb_array'"),
        ({"num_envs": 10**12}, MemoryError, "num_envs = 1000000000000: as many lanes take"),
        ({"num_envs": 10**400}, ValueError, r"num_envs = 10+\.\.\.0+: must be an integer in \[1, 92"),
        ({"max_episode_steps": 0}, ValueError, "max_episode_steps = 0: must be an integer >= 1"),
    ],
)
def test_bad_arguments_name_the_argument_and_what_is_allowed(given, error, message):
    with pytest.raises(error, match=message):
        gym.make_vec(LAUNCH_ID, **{"num_envs": 2} | given)


@both_ids
def test_pictures_are_those_of_syncvectorenv(env_id):
    """Oracle: those of Gymnasium's SyncVectorEnv."""
    given = {"scenario": own_scenario("ice_drop"), "launch_noise": (0.1, 0.3), "render_mode": "rgb_array"}
    env, sync = gym.make_vec(env_id, 2, **given), gym.make_vec(env_id, 2, vectorization_mode="sync", **given)
    env.reset(seed=5)
    sync.reset(seed=5)
    rng = np.random.default_rng(0)
    for _ in range(3):
        assert np.array_equal(env.render(), sync.render())
        action = actions(rng, 2, env_id)
        env.step(action)
        sync.step(action)


@pytest.mark.parametrize(("env_id", "mode"), list(zip(NATIVE, MODES[:2], strict=True)))
def test_a_restored_batch_goes_on_bit_for_bit(env_id, mode):
    """Oracle: what followed the first time, and a copy of the batch that was never used."""
    env, other = native(4, mode, env_id), native(4, mode, env_id)
    with pytest.raises(ResetNeeded):
        env.snapshot()
    env.reset(seed=8)
    rng = np.random.default_rng(0)
    env.step(actions(rng, 4, env_id))
    kept = pickle.loads(pickle.dumps(env.snapshot()))
    todo = [actions(rng, 4, env_id) for _ in range(20)]
    followed = [env.step(action) for action in todo]
    for one in (env, other):
        one.restore(kept)
        assert equal([one.step(action) for action in todo], followed)
    more = native(5, mode, env_id)
    with pytest.raises(ValueError, match=r"snapshot.task\['num_envs'\] = 4: .* of another task, must be 5"):
        more.restore(kept)
    drawn = native(4, mode, env_id, render_mode="rgb_array")
    with pytest.raises(ValueError, match="a batch that draws needs a snapshot of one that does"):
        drawn.restore(kept)
    drawn.reset(seed=8)
    drawn.step(todo[0])
    shown, taken = drawn.render(), drawn.snapshot()
    drawn.step(todo[1])
    drawn.restore(taken)
    assert np.array_equal(drawn.render(), shown)


@pytest.mark.parametrize("seed", [5, [5, None, 7]], ids=str)
def test_the_random_numbers_of_the_batch_are_those_of_gymnasiums_and_no_lanes(seed):
    """Oracle: VectorEnv.reset with the seed of lane 0; the episodes of a batch from which nobody draws."""
    env, twin = native(3), native(3)
    assert equal(env.reset(seed=seed), twin.reset(seed=seed)) or isinstance(seed, list)
    assert env.np_random.random() == np.random.default_rng(5).random()
    assert env.np_random is not env.episodes.generators[0]
    env.reset(options={"reset_mask": np.array([False, True, True])}, seed=9)
    assert env.np_random.random() == np.random.default_rng(5).random(2)[1]


def test_vectorenv_is_among_the_direct_bases_of_a_batch():
    """Oracle: what skrl's wrap_env looks at."""
    assert all(gym.vector.VectorEnv in kind.__bases__ for kind in NATIVE.values())
