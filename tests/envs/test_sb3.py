"""The adapter is stable-baselines3's DummyVecEnv of monitored environments, bit for bit; algorithms train on it."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.error import ResetNeeded
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.env_util import make_vec_env as theirs
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

import sledenv
from sledenv.envs import DESCENT_ID, LAUNCH_ID
from sledenv.envs.descent import SledDescent
from sledenv.envs.info import INFO_KEYS
from sledenv.envs.launch import SledLaunch
from sledenv.envs.sb3 import SledVecEnv, make_vec_env
from sledenv.envs.vector import SledLaunchVector
from sledenv.simulation import STATUS_OF_CODE
from tests.envs.kinds import SCALAR, WIDTH, both_ids, equal

pytestmark = pytest.mark.filterwarnings("ignore")  # of torch and tensorboard, which this project does not own


@pytest.fixture(autouse=True)
def _one_thread():
    """Networks this small run slower on more."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def make(short_scenario: sledenv.scenarios.Scenario):
    def made(lanes: int, seed: int | None = None, env_id: str = LAUNCH_ID, **options) -> SledVecEnv:
        return make_vec_env(env_id, lanes, seed, env_kwargs={"scenario": short_scenario}, **options)

    return made


def without_times(infos: list[dict]) -> list[dict]:
    """Infos without the time [s] at which an episode ended."""
    for info in infos:
        assert info.get("episode", {"t": 0.0}).pop("t") >= 0.0
    return infos


@both_ids
def test_all_that_episodes_return_is_that_of_dummyvecenv(make, short_scenario, env_id):
    """Oracle: DummyVecEnv of scalar environments in a Monitor, infos included, also where a lane is reset alone."""
    lanes, episodes = 20, 60
    env = make(lanes, 7, env_id, info=INFO_KEYS)
    dummy = DummyVecEnv([lambda: Monitor(SCALAR[env_id](short_scenario))] * lanes)
    assert dummy.seed(7) == env.seed(7)
    assert equal(env.reset(), dummy.reset())
    assert equal(env.reset_infos, dummy.reset_infos)
    rng = np.random.default_rng(3)
    ended = 0
    while ended < episodes:
        action = rng.uniform(-1.0, 1.0, (lanes, WIDTH[env_id])).astype(np.float32)
        *step, infos = env.step(action)
        *other, theirs_infos = dummy.step(action)
        assert equal(step, other)
        assert equal(without_times(infos), without_times(theirs_infos))
        assert equal(env.reset_infos, dummy.reset_infos)
        ended += np.count_nonzero(step[2])
        assert equal(*(one.env_method("reset", indices=[3]) for one in (env, dummy)))


def test_an_episode_that_met_a_limit_has_ended_as_any_other_has(short_scenario):
    """Oracle: the status of the descent; limits are seen, so that PPO and others must not bootstrap there."""
    content = short_scenario.model_dump(mode="json")
    content["limits"]["max_rebounds"] = 2
    given = {"scenario": sledenv.scenarios.Scenario.model_validate(content)}
    env = make_vec_env(DESCENT_ID, 50, 0, env_kwargs=given, info=("descent", "is_success"))
    env.reset()
    rng, seen = np.random.default_rng(0), set()
    for _ in range(20):
        _, _, dones, infos = env.step(rng.uniform(-1.0, 1.0, (50, 1)))
        for done, info in zip(dones, infos, strict=True):
            seen.add(status := str(STATUS_OF_CODE[info["descent"]["status"]]))
            assert done == (status != "running") == ("terminal_observation" in info)
            assert info["TimeLimit.truncated"] is False
            if status == "log_full":
                assert info["terminal_observation"][21] == env.observation_space.high[21]
    assert {"running", "finish", "log_full"} <= seen


@pytest.mark.parametrize(
    ("env_id", "algorithm", "settings"),
    [
        (DESCENT_ID, PPO, {"n_steps": 2, "batch_size": 256, "n_epochs": 1}),
        pytest.param(
            LAUNCH_ID, SAC, {"learning_starts": 1024, "batch_size": 64, "gradient_steps": 2}, marks=pytest.mark.slow
        ),
    ],
)
def test_algorithms_train_on_1024_lanes_with_one_call_save_and_load(make, env_id, algorithm, settings, tmp_path):
    """Oracle: the weights have moved; what was loaded acts alike, and goes on learning in another batch."""
    model = algorithm("MlpPolicy", make(1024, env_id=env_id), seed=0, gamma=0.0, **settings)
    before = [weight.detach().clone() for weight in model.policy.parameters()]
    model.learn(4 * 1024)
    assert model.num_timesteps == 4 * 1024
    assert any((old != new).any() for old, new in zip(before, model.policy.parameters(), strict=True))
    model.save(tmp_path / "model.zip")
    env = make(16, 1, env_id)
    again = algorithm.load(tmp_path / "model.zip", env=env if algorithm is not PPO else make(1024, env_id=env_id))
    observations = env.reset()
    assert np.array_equal(*(one.predict(observations, deterministic=True)[0] for one in (model, again)))
    again.learn(1024, reset_num_timesteps=False)


def test_seeds_and_options_are_used_once(make, short_scenario):
    """Oracle: DummyVecEnv."""
    env, dummy = make(3), DummyVecEnv([lambda: SledLaunch(short_scenario)] * 3)
    contexts = [short_scenario.sample(np.random.default_rng(i)) for i in range(3)]
    for one in (env, dummy):
        one.seed(4)
        one.reset()
    mixed = [{"context": {"friction": 0.3}, "split": "test"}, {}, {"context": contexts[2]._asdict()}]
    alone = [{"context": context} for context in contexts]
    for options in ({"context": {"friction": 0.3}}, {"split": "test"}, alone, mixed):
        env.set_options(options)
        dummy.set_options(options)
        assert equal(env.reset(), dummy.reset())
        assert equal(env.reset(), dummy.reset())
    env.set_options([{"context": contexts[0]}, 3, {}])
    with pytest.raises(TypeError, match="options of lane 1 = 3: must be a mapping"):
        env.reset()
    env.set_options({"contxt": contexts[0]})
    with pytest.raises(ValueError, match="unknown option 'contxt'"):
        env.reset()
    assert equal(env.reset(), dummy.reset())


def test_attributes_and_methods_are_those_of_the_lanes(make, short_scenario):
    """Oracle: DummyVecEnv of the scalar environment in a Monitor."""
    env, dummy = make(3, info=INFO_KEYS), DummyVecEnv([lambda: Monitor(SledLaunch(short_scenario))] * 3)
    env.seed(2)
    dummy.seed(2)
    env.reset()
    dummy.reset()
    for name in ("render_mode", "action_space", "observation_space", "np_random_seed"):
        assert env.get_attr(name) == dummy.get_attr(name)
        assert env.get_attr(name, indices=[2]) == dummy.get_attr(name, indices=[2])
        assert env.get_attr(name, indices=-1) == dummy.get_attr(name, indices=-1)
    assert env.get_attr("task")[1].scenario == dummy.get_attr("task")[1].scenario
    assert env.has_attr("task")
    assert not env.has_attr("tusk")
    for wrapper in (Monitor, gym.Wrapper, gym.wrappers.TimeLimit):
        assert (
            env.env_is_wrapped(wrapper) == dummy.env_is_wrapped(wrapper) == [wrapper is not gym.wrappers.TimeLimit] * 3
        )
    assert env.env_is_wrapped(Monitor, indices=[0, 1]) == [True] * 2
    assert equal(env.env_method("reset", seed=9, indices=1), dummy.env_method("reset", seed=9, indices=1))
    assert equal(env.env_method("reset"), dummy.env_method("reset"))
    action = np.full((3, 2), 0.25, np.float32)
    for told, expected in zip(env.step(action), dummy.step(action), strict=True):
        assert equal(*map(without_times, (told, expected))) if isinstance(told, list) else equal(told, expected)
    env.set_attr("note", "kept")
    assert env.get_attr("note") == ["kept"] * 3
    with pytest.raises(ValueError, match="lanes share their attributes"):
        env.set_attr("note", "lost", indices=[0])
    for name, given in (("step", [action[0]]), ("snapshot", []), ("restore", [None])):
        with pytest.raises(NotImplementedError, match="cannot be stepped, kept or restored alone"):
            env.env_method(name, *given, indices=0)
    with pytest.raises(IndexError):
        env.get_attr("task", indices=3)


def test_lanes_can_be_drawn(short_scenario):
    """Oracle: DummyVecEnv of the scalar environment in every method that draws."""
    given = {"scenario": short_scenario, "render_mode": "rgb_array"}
    env, dummy = make_vec_env(DESCENT_ID, 2, 3, env_kwargs=given), DummyVecEnv([lambda: SledDescent(**given)] * 2)
    dummy.seed(3)
    assert (env.metadata, env.render_mode) == (dummy.metadata, dummy.render_mode)
    with pytest.raises(ResetNeeded):
        env.render()
    env.reset()
    dummy.reset()
    for _ in range(2):
        assert np.array_equal(env.render(), dummy.render())
        assert equal(env.env_method("render", indices=1), dummy.env_method("render", indices=1))
        assert equal(env.get_images(), dummy.get_images())
        for one in (env, dummy):
            assert len(list(one.env_method("film", indices=0)[0])) > 0
            one.step(np.zeros((2, 1), np.float32))
    assert env.env_method("get_wrapper_attr", "metadata") == dummy.env_method("get_wrapper_attr", "metadata")
    states = ([one.bit_generator.state for one in own.get_attr("np_random")] for own in (env, dummy))
    assert equal(*states)
    assert env.env_method("has_wrapper_attr", "film") == [True, True]


def test_arguments_of_stable_baselines3_are_taken_or_named(short_scenario):
    """Oracle: stable-baselines3's own make_vec_env, for seeds without a seed and for the action space."""
    given = {"env_kwargs": {"scenario": short_scenario, "render_mode": None}}
    seen, chosen = [], []
    for make in (make_vec_env, theirs):
        np.random.seed(4)  # noqa: NPY002  # which SB3 draws seeds from
        seen.append(make(LAUNCH_ID, 3, **given).reset())
        chosen.append(make(LAUNCH_ID, 3, 5, 2, **given).action_space.sample())
    assert equal(*seen)
    assert equal(*chosen)
    for name in ("monitor_dir", "wrapper_class", "vec_env_cls", "vec_env_kwargs", "monitor_kwargs", "wrapper_kwargs"):
        with pytest.raises(TypeError, match=f"{name}: is no argument of a native batch"):
            make_vec_env(LAUNCH_ID, 2, **{name: None})
    with pytest.raises(TypeError, match=r"env_id = .*: must be an id such as"):
        make_vec_env(SledLaunch, 2)


def test_only_a_native_batch_in_the_mode_of_sb3_is_adapted():
    with pytest.raises(ValueError, match="autoreset_mode = 'NextStep': must be 'SameStep'"):
        SledVecEnv(SledLaunchVector(2))
    with pytest.raises(TypeError, match="must be a native vector environment"):
        SledVecEnv(gym.make_vec(LAUNCH_ID, num_envs=2, vectorization_mode="sync"))
