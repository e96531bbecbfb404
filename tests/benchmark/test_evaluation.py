"""A policy, in whatever form it is given, is evaluated in the contexts and draws in which all are."""

from __future__ import annotations

import doctest
import pickle
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecCheckNan, VecNormalize

import sledenv
from sledenv.agents import land_parallel
from sledenv.benchmark import evaluation
from sledenv.benchmark.evaluation import Evaluation, evaluation_of
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import TRAINED, load_run
from sledenv.envs.inputs import FIELDS
from sledenv.envs.sb3 import make_vec_env
from sledenv.machine.blame import GivenCodeError
from sledenv.scenarios import load_track, track_names
from sledenv.scenarios.scenario import Context

RIDE, RUN = "sled_rollers", "sled_mat-launch-spin-critic-s0"


def still(observations: np.ndarray) -> np.ndarray:
    return np.zeros((len(observations), 1))


def against(observations: np.ndarray) -> np.ndarray:
    """Trims against the pose."""
    return np.clip(-2.0 * observations[:, 13:14], -1.0, 1.0)


def test_rides_without_trims_earn_what_they_do_in_the_environment():
    """Oracle: the native batch at the same launches, bit for bit."""
    found = sledenv.evaluate(still, RIDE, contexts=8)
    problem = Problem(RIDE, "descent")
    (drawn,) = problem.trials(problem.contexts("test", 8), "test").swapaxes(0, 1)
    contexts = drawn[:, :FIELDS].copy()
    contexts[:, [Context._fields.index(name) for name in ("orientation", "spin")]] += drawn[:, FIELDS:]
    envs = gym.make_vec(problem.id, 8, scenario=RIDE, launch_noise=(0.0, 0.0), autoreset_mode="SameStep")
    envs.reset(seed=0, options={"context": contexts})
    lost, status = np.full((2, 8), np.nan)
    while np.isnan(lost).any():
        _, _, ended, _, infos = envs.step(np.zeros((8, 1), np.float32))
        first = ended & np.isnan(lost)
        if first.any():
            last = infos["final_info"]
            lost[first], status[first] = last["jam"]["jam_index"][first], last["descent"]["status"][first]
    assert np.array_equal(1.0 - found.rewards, lost)
    assert found.mean == found.rewards.mean()
    names = [sledenv.simulation.STATUS_OF_CODE[int(code)] for code in status]
    assert found.falls == names.count("tumbled") / 8
    assert found.finished == names.count("finish") / 8


def test_the_contexts_are_the_first_ones_for_every_number_and_every_policy():
    """Oracle: the rewards of fewer; those of a launch under launch noise are means over 64 draws."""
    few, many = (sledenv.evaluate(still, "sled_mat", count) for count in (2, 4))
    assert np.array_equal(few.rewards, many.rewards[:2])
    assert few.status.shape == (2, 64)
    assert np.array_equal(sledenv.evaluate(against, RIDE, 3).rewards, sledenv.evaluate(against, RIDE, 5).rewards[:3])


def test_tracks_made_by_hand_take_turns():
    """Oracle: each track judged by itself in all contexts, which are those without tracks; what is seen of them."""
    seen: list[np.ndarray] = []

    def watching(observations: np.ndarray) -> np.ndarray:
        seen.append(observations)
        return np.zeros((len(observations), 1))

    found = sledenv.evaluate(watching, RIDE, 27, tracks=True)
    assert found.places == (2 * track_names() + track_names()[:3])
    problem = Problem(RIDE, "descent")
    drawn = problem.trials(problem.contexts("test", 27), "test")
    for k, name in enumerate(track_names()):
        other = problem.on(name)
        assert np.array_equal(other.trials(other.contexts("test", 27), "test"), drawn)
        batch, _ = other.judge(SimpleNamespace(act=still), drawn)
        assert np.array_equal(found.rewards[k::12], batch.jam.reward[k::12])
        assert np.array_equal(found.status[k::12, 0], batch.status[k::12])
    told = problem.task.columns.values(seen[0])  # of the first track, scaled as rollers are
    heights = [told[f"{place}_y"][0] for place in ("behind_1", "ahead_1", "ahead_2", "ahead_3", "ahead_4")]
    rises = np.diff([y for _, y in load_track("camel").profile_m])
    assert np.abs(np.lib.stride_tricks.sliding_window_view(rises, 4) - np.diff(heights)).max(axis=1).min() < 1e-6
    assert sledenv.evaluate(still, RIDE, 27).places is None
    assert str(found).startswith("watching, 27 test contexts of sled_rollers on 12 tracks made by hand; 95 % intervals")
    assert sledenv.evaluate(still, RIDE, 2, tracks=True).places == track_names()[:2]


def test_a_model_acts_without_exploration_and_sees_what_it_has_learned_with(tmp_path):
    """Oracle: the formula of VecNormalize. A model that was loaded is refused until its statistics are given."""
    lanes = make_vec_env("sledenv/SledDescent-v0", 8, 0, env_kwargs={"scenario": RIDE, "split": "train"})
    env = VecCheckNan(VecNormalize(lanes))
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=64, n_epochs=2, seed=0, device="cpu").learn(256)
    found = sledenv.evaluate(model, RIDE, 10)
    statistics = model.get_vec_normalize_env()
    count = float(statistics.obs_rms.count)

    def by_hand(seen: np.ndarray) -> np.ndarray:
        scaled = (seen - statistics.obs_rms.mean) / np.sqrt(statistics.obs_rms.var + statistics.epsilon)
        return model.predict(np.clip(scaled, -10.0, 10.0).astype(np.float32), deterministic=True)[0]

    assert np.array_equal(found.rewards, sledenv.evaluate(by_hand, RIDE, 10).rewards)
    assert found.policy == "PPO"
    assert float(statistics.obs_rms.count) == count  # nothing is learned from test contexts
    model.save(tmp_path / "model.zip")
    statistics.save(str(tmp_path / "statistics.pkl"))
    again = PPO.load(tmp_path / "model.zip", device="cpu")
    with pytest.raises(ValueError, match=r"^normalize = None: must be the VecNormalize with which the policy was"):
        sledenv.evaluate(again, RIDE, 10)
    read = VecNormalize.load(str(tmp_path / "statistics.pkl"), make_vec_env("sledenv/SledDescent-v0"))
    assert np.array_equal(sledenv.evaluate(again, RIDE, 10, normalize=read).rewards, found.rewards)


def test_an_agent_acts_and_a_run_is_loaded(tmp_path, monkeypatch):
    """Oracle: the same agents, judged by the problem."""
    problem = Problem(RIDE, "descent")
    agent = land_parallel.Agent(problem)
    found = sledenv.evaluate(agent, RIDE, 10)
    assert found.policy == "land_parallel"
    batch, _ = problem.judge(agent, problem.trials(problem.contexts("test", 10), "test"))
    assert np.array_equal(found.rewards, batch.jam.reward)
    problem, critic, _ = load_run(TRAINED / RUN)
    by_hand = evaluation_of(problem, critic, 3, "critic")
    for run in (RUN, TRAINED / RUN):
        for scenario in (None, problem.scenario):
            found = sledenv.evaluate(run, scenario, 3)
            assert found.policy == "critic"
            assert np.array_equal(found.rewards, by_hand.rewards)


def test_the_result_is_printed_in_a_few_lines_and_cannot_be_changed():
    """Oracle: means by hand; Wilson's interval of no fall in 50."""
    rewards = np.random.default_rng(0).uniform(0.2, 0.6, 50)
    status = np.full((50, 2), "finish", dtype="U8")
    status[0] = "timeout"
    found = Evaluation("mine", "ours", rewards, status)
    low, high = found.interval
    assert str(found).splitlines() == [
        "mine, 50 test contexts of ours; 95 % intervals",
        f"mean reward  {rewards.mean():.3f} [{low:.3f}, {high:.3f}]",
        "falls        0.0% [0.0, 7.1]",
        "finished     98.0%",
    ]
    with pytest.raises(ValueError, match="read-only"):
        found.rewards[0] = 1.0
    assert pickle.loads(pickle.dumps(found)).interval == (low, high)


SPACE = Problem("sled_rollers", "descent").task.observation_space


class Model:
    """Has the spaces of a model."""

    def __init__(self, seen: int = 99, acts: int = 1, **given: Any) -> None:
        self.observation_space = SPACE if seen == 99 else spaces.Box(-1.0, 1.0, (seen,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (acts,), np.float32)
        vars(self).update(given)

    def predict(self, observations: np.ndarray) -> Any:
        raise AssertionError("nothing is asked")


class Remembering:
    def predict(self, observations: np.ndarray, state: Any = None) -> Any:
        return still(observations), np.zeros(3)


class Broken:
    def predict(self, observations: np.ndarray) -> Any:
        return observations + np.zeros(3)


@pytest.mark.parametrize(
    ("policy", "given", "message"),
    [
        (still, {"scenario": "sled_rolers"}, "unknown scenario 'sled_rolers' (did you mean 'sled_rollers'?)"),
        (still, {"scenario": None}, "scenario = None: must be the name or the file of a scenario, or a Scenario"),
        (still, {"contexts": 1}, "contexts = 1: must be an integer >= 2"),
        (still, {"environment": "flight"}, "environment = 'flight': must be one of 'launch', 'descent'"),
        (still, {"control": "spin"}, "control = 'spin': must be one of 'trim'"),
        (still, {"observe": ["sped"]}, "observe = ['sped']: must be 'all' or a sequence of any of 'angle'"),
        (still, {"launch_noise": (0.1, -1.0)}, "launch_noise.spin = -1.0: must be in [0, inf)"),
        (None, {}, "policy = None: must be a function of observations, an object with predict or act, or the"),
        (Model, {}, "policy = <class"),
        (
            Model(observation_space=spaces.Box(-1.0, 1.0, (99,))),
            {},
            "policy.observation_space has other bounds: must be",
        ),
        (
            Model(22),
            {},
            "policy.observation_space has shape (22,): must be (99,) of sledenv/SledDescent-v0 in sled_rollers",
        ),
        (
            Model(99, 2),
            {},
            "policy.action_space has shape (2,): must be (1,) of sledenv/SledDescent-v0 in sled_rollers",
        ),
        (Model(), {"normalize": 5}, "normalize = 5: must be a VecNormalize of stable-baselines3"),
        (
            Model(),
            {"normalize": SimpleNamespace(normalize_obs=still, observation_space=spaces.Box(-1, 1, (22,)))},
            "normalize.observation_space has shape (22,): must be (99,)",
        ),
        (Model(_last_obs=np.full((2, 99), 1.5)), {}, "normalize = None: must be the VecNormalize with which the"),
        (still, {"tracks": True, "shifted": True}, "tracks = True: must be False where shifted is True"),
        (
            still,
            {"tracks": True, "scenario": "sled_mat"},
            "tracks = True: must be False, sledenv/SledLaunch-v0 in sled_mat is no ride over ground",
        ),
        (
            still,
            {"tracks": True, "environment": "launch"},
            "tracks = True: must be False, sledenv/SledLaunch-v0 in sled_rollers is no ride over ground",
        ),
        (RUN, {"control": "spin"}, f"control = 'spin': must be left out, the run {RUN} has its own"),
        (RUN, {}, "scenario = 'sled_rollers' with the hash "),
        (Path("runs/nothing"), {}, "runs/nothing: there is no such run, neither here nor among those"),
        (lambda seen: np.zeros((len(seen), 2)), {}, "agent <lambda>, scenario sled_rollers: actions have shape (3, 2)"),
        (lambda seen: still(seen) + 1.5, {}, "agent <lambda>, scenario sled_rollers: actions[0] = [1.5]: must be with"),
        (lambda seen: None, {}, "agent <lambda>, scenario sled_rollers: actions "),
    ],
)
def test_what_cannot_be_evaluated_is_refused_by_name(policy, given, message, monkeypatch):
    """Oracle: the message. But for actions, nothing has been simulated by then."""
    if not message.startswith("agent"):
        monkeypatch.setattr(evaluation, "evaluation_of", None)
    with pytest.raises((TypeError, ValueError, FileNotFoundError), match=f"^{re.escape(message)}"):
        sledenv.evaluate(policy, **{"scenario": RIDE, "contexts": 3} | given)


@pytest.mark.parametrize(
    ("policy", "message"),
    [
        (Remembering(), "agent Remembering, scenario sled_rollers: act raised TypeError: predict returned a state"),
        (Broken(), "agent Broken: predict raised ValueError: operands"),
        (lambda seen: seen[99], "agent <lambda>, scenario sled_rollers: act raised IndexError: index 99"),
    ],
)
def test_a_mistake_of_a_policy_is_told_as_its_own(policy, message):
    """Oracle: whose, what, and the name of this file where it is in it."""
    with pytest.raises(GivenCodeError, match=f"^{re.escape(message)}") as raised:
        sledenv.evaluate(policy, RIDE, 3)
    if "state" not in message:
        assert re.search(r" \(test_evaluation\.py, line \d+\)$", str(raised.value))


def test_the_examples_run():
    """Oracle: what they print, the scores without trims and by a rule."""
    assert doctest.testmod(evaluation).failed == 0
