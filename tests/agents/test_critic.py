"""The agent that searches a distributional critic: its targets, its samples, its search, its file."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from sledenv.agents import curve
from sledenv.agents.classes import Bins, keep
from sledenv.agents.critic import ACTING, Agent, Critic, Sampler, kept, searched
from sledenv.agents.touch import Touch
from sledenv.agents.train import default_settings, run_folder
from sledenv.benchmark.landing import Landing
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import TRAINED, load_run
from sledenv.scenarios.scenario import load_scenario, scenario_names
from tests.own_scenarios import own_scenario

SMALL = {"n_timesteps": 2000, "n_contexts": 20, "n_tries": 20, "warmup": 1, "gradient_steps": 60, "checks": 2}


def settings(problem: Problem) -> dict:
    return default_settings("critic", problem) | SMALL | {"net_arch": [32, 32], "bfloat16": False}


def test_a_target_is_the_reward_that_it_stands_for():
    """Oracle: the least cross-entropy of logits that may be anything is their target; its mean is the reward."""
    bins, rewards = Bins(-0.1, 1.1, 41), torch.linspace(0.0, 1.0, 11)
    logits = torch.zeros(11, 41, requires_grad=True)
    (gradient,) = torch.autograd.grad(bins.loss(logits, rewards), logits)
    targets = 1 / 41 - 11 * gradient  # of softmax and cross-entropy: answer less target, over the rows
    assert (targets >= -1e-5).all()
    np.testing.assert_allclose(targets.sum(dim=1), 1.0, atol=2e-4)
    np.testing.assert_allclose(targets @ bins.middles, rewards, atol=2e-4)
    np.testing.assert_allclose(bins.expected(targets.clamp(min=1e-9).log()), rewards, atol=2e-4)


@pytest.mark.parametrize("scenario", ["sled_snow", own_scenario("boulders"), own_scenario("brake_mat")])
def test_the_first_touch_is_where_the_descent_first_touches(scenario):
    """Oracle: the simulator, to the end of the flight; some bodies touch in another pose on the way."""
    problem = Problem(scenario, launch_noise=(0.0, 0.0))
    task, touch = problem.task, Touch(problem)
    contexts = problem.contexts("train", 100)
    landings = np.random.default_rng(0).uniform(-1.0, 1.0, (100, problem.actions))
    scenes = task.aimed(task.scenes(contexts), Landing(problem).launches(contexts, landings))
    launches, first = scenes.launches, task.descend(scenes, keep_rebounds=True).rebounds[:, 0]
    pose, time, arm, lever, approach, slip, spin = touch._touched(task.observe(task.scenes(contexts)), landings).T
    begun = first["t"] - first["duration"]
    same = np.abs(begun - time) < 2e-3
    assert same.mean() > 0.8
    assert np.median(np.abs(spin - launches[:, 5])) < 1e-5
    turned = (pose - (launches[:, 2] + spin * time) + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(turned).max() < 1e-3
    # A descent has lost at the touch nothing of the energy that the flight keeps.
    angle, speed, fall = contexts[:, 0], launches[:, 3], -launches[:, 4]
    gravity = problem.scenario.slope_section.gravity_m_s2
    u, v = slip - arm * spin, approach + lever * spin
    gained = gravity * (np.sin(angle) * time * (speed + 0.5 * gravity * np.sin(angle) * time))
    gained += gravity * np.cos(angle) * (launches[:, 1] - arm)
    np.testing.assert_allclose(u**2 + v**2 - speed**2 - fall**2, 2.0 * gained, atol=0.05)


def test_numbered_bodies_are_told_apart():
    """Oracle: the contexts, whose bodies have no order."""
    problem = Problem(own_scenario("boulders"))
    contexts = problem.contexts("train", 50)
    inputs = Touch(problem).inputs(problem.task.observe(problem.task.scenes(contexts)), np.zeros((50, 1)))
    assert np.array_equal(inputs[:, 11:16], np.eye(5)[contexts[:, 10].astype(int)])
    assert inputs.dtype == np.float32


def test_a_full_turn_has_no_seam():
    problem = Problem(own_scenario("brake_mat"))
    assert problem.turns == (True, False)
    critic = Critic(Touch(problem), [8], 11)
    seen = np.zeros((1, 11), np.float32)
    ends = np.array([[[-1.0, 0.3], [1.0, 0.3], [0.0, 0.3]]], np.float32)
    low, high, other = critic.rate(seen, ends)[0]
    assert low == pytest.approx(high, abs=1e-6)
    assert low != pytest.approx(other, abs=1e-4)


@pytest.mark.parametrize(
    ("scenario", "noise"),
    [
        (own_scenario("brake_mat"), (0.0, 0.0)),
        (own_scenario("brake_mat"), (0.05, 0.5)),
        ("sled_mat", (0.0, 0.0)),
        ("sled_snow", (0.0, 0.0)),
        (own_scenario("noisy_start"), None),
    ],
)
def test_samples_are_what_the_landings_earn(scenario, noise):
    """Oracle: the simulator, with the contexts and landings that the inputs tell; with noise, rewards scatter."""
    problem = Problem(scenario, launch_noise=noise)
    critic = Critic(Touch(problem), [8], 11)
    sampler = Sampler(problem, {"n_contexts": 6, "n_tries": 10}, np.random.default_rng(1))
    for guided in (False, True):
        inputs, rewards = sampler.sample(critic, guided)
        assert inputs.shape == (60, critic.touch.width)
        assert rewards.shape == (60,)
        seen, columns = inputs[:, :11], inputs[:, 11:]
        landings = []
        for turning in problem.turns:
            landings.append(np.arctan2(columns[:, 0], columns[:, 4]) / np.pi if turning else columns[:, 0])
            columns = columns[:, 8 if turning else 1 :]
        launches = Landing(problem).actions(seen, np.stack(landings, axis=1).astype(np.float32))
        again = problem.descend(problem.task.contexts_seen(seen), launches).jam.reward
        alike = np.isclose(again, rewards, atol=1e-3).mean()  # a cliff may lie between float32 and double
        assert alike < 0.9 if problem.noise.any() else alike > 0.9


def test_a_search_finds_what_is_rated_best():
    """Oracle: many uniform landings, rated by the same critic."""
    problem = Problem(own_scenario("brake_mat"))
    torch.manual_seed(3)
    critic = Critic(Touch(problem), [64, 64], 41)
    seen = problem.task.observe(problem.task.scenes(problem.contexts("test", 5)))
    rng = np.random.default_rng(0)
    anywhere = rng.uniform(-1.0, 1.0, (5, ACTING.anywhere, 2))
    peaks, heights = searched(problem, critic, seen, anywhere, ACTING, lambda *shape: rng.standard_normal((*shape, 2)))
    assert peaks.shape == (5, ACTING.starts, 2)
    assert (np.abs(peaks) <= 1.0).all()
    assert (np.diff(heights, axis=1) <= 0.0).all()
    np.testing.assert_allclose(critic.rate(seen, peaks.astype(np.float32)), heights, atol=1e-5)
    others = critic.rate(seen, rng.uniform(-1.0, 1.0, (5, 20_000, 2)).astype(np.float32))
    assert (others.max(axis=1) <= heights[:, 0] + 1e-5).all()


LESS = {"n_timesteps": 400, "n_contexts": 10, "gradient_steps": 30, "checks": 1}


@pytest.mark.parametrize(
    ("scenario", "checked", "less"),
    [("brake_mat", 12, LESS), pytest.param("round_talus", 128, {}, marks=pytest.mark.slow)],
)
def test_it_learns_the_same_from_the_same_seed_and_better_than_random(scenario, checked, less, tmp_path, monkeypatch):
    """Oracle: random launches in the same contexts; a second run; the file read once more; contexts one by one."""
    monkeypatch.setattr(curve, "_CONTEXTS", checked)  # validating costs more than learning from so few descents
    problem = Problem(own_scenario(scenario))
    chosen, agents = settings(problem) | less, []
    for seed, name in [(0, "one"), (0, "same"), (1, "other")]:
        folder = tmp_path / name
        folder.mkdir()
        agents.append(Agent.train(problem, chosen, seed, folder))
    contexts = problem.contexts("test", 60)
    seen = problem.task.observe(problem.task.scenes(contexts))
    one, same, other = (agent.act(seen) for agent in agents)
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)
    assert np.array_equal(Agent.load(problem, tmp_path / "one").act(seen), one)
    np.testing.assert_allclose(agents[0].act(seen[7:8]), one[7:8], atol=1e-4)
    random = np.random.default_rng(0).uniform(-1.0, 1.0, one.shape)
    assert problem.descend(contexts, one).jam.reward.mean() > problem.descend(contexts, random).jam.reward.mean()
    checks = np.loadtxt(tmp_path / "one" / "learning_curve.csv", delimiter=",", skiprows=1)
    assert (np.diff(checks[:, :2], axis=0) >= 0.0).all()
    assert checks[-1, 0] == chosen["n_timesteps"]


def test_weights_are_plain_numbers(tmp_path):
    """Oracle: NumPy, which refuses to run what a file holds."""
    problem = Problem("sled_mat")
    critic = Critic(Touch(problem), [16, 16, 16], 21)
    keep(critic, tmp_path / "critic.npz")
    with np.load(tmp_path / "critic.npz", allow_pickle=False) as arrays:
        assert {arrays[name].dtype for name in arrays.files} == {np.dtype(np.float16)}
    seen = np.zeros((1, 11), np.float32)
    landings = np.linspace(-1.0, 1.0, 9, dtype=np.float32).reshape(1, 9, 1)
    np.testing.assert_allclose(
        kept(problem, tmp_path / "critic.npz").rate(seen, landings), critic.rate(seen, landings), atol=1e-3
    )


def test_weights_that_are_no_numbers_are_refused(tmp_path):
    """Oracle: one weight of a critic that loads otherwise."""
    problem = Problem("sled_mat")
    critic = Critic(Touch(problem), [8], 11)
    critic.last.bias.data[3] = torch.nan
    keep(critic, tmp_path / "critic.npz")
    with pytest.raises(ValueError, match=r"critic\.npz: last\.bias has weights that are no finite numbers"):
        kept(problem, tmp_path / "critic.npz")
    for cut in (b"", (tmp_path / "critic.npz").read_bytes()[:100]):
        (tmp_path / "critic.npz").write_bytes(cut)
        with pytest.raises(ValueError, match=r"critic\.npz cannot be read: "):
            kept(problem, tmp_path / "critic.npz")


@pytest.mark.parametrize(
    "scenario", [name for name in scenario_names() if not {"paper", "ride"} & set(load_scenario(name).tags)]
)
def test_a_shipped_agent_is_of_its_scenario_as_it_is_and_beats_the_zero_action(scenario):
    """Oracle: the zero action and random launches, in contexts that no training has seen; the scenario itself."""
    problem, agent, config = load_run(run_folder(TRAINED, "critic", Problem(scenario), 0))
    assert config["scenario_hash"] == problem.scenario.hash == Problem(scenario).scenario.hash
    contexts = problem.contexts("test", 40)
    launches = agent.act(problem.task.observe(problem.task.scenes(contexts)))
    zero, random = np.zeros_like(launches), np.random.default_rng(0).uniform(-1.0, 1.0, launches.shape)
    trials = problem.trials(contexts, "test")
    mine, *others = (problem.expect(trials, tried[:, np.newaxis]).mean() for tried in (launches, zero, random))
    assert mine > others[1]
    assert mine > others[0]
