"""What the agents of stable-baselines3 share: rewards on one scale, streams of their own, search by the critic."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
import torch
from sb3_contrib import TQC
from stable_baselines3 import PPO, SAC

from sledenv.agents import learning, ride_critic
from sledenv.agents.learning import Landed, Standardised, random_rewards
from sledenv.agents.ppo import Agent as PpoAgent
from sledenv.agents.searching import COARSE, SearchingSAC, SearchingTQC, searching
from sledenv.agents.touch import Touch
from sledenv.agents.train import default_settings
from sledenv.agents.wrappers import Landed as Landed1
from sledenv.agents.wrappers import Standardised as Standardised1
from sledenv.benchmark.landing import Landing
from sledenv.benchmark.problem import Problem
from sledenv.envs.sb3 import make_vec_env
from tests.own_scenarios import own_scenario

pytestmark = pytest.mark.filterwarnings("ignore")  # of torch, which this project does not own


BRAKE_MAT = own_scenario("brake_mat")


def policy_of(algorithm, policy, scenario=BRAKE_MAT):
    problem = Problem(scenario)
    env = make_vec_env(problem.id, 4, env_kwargs={"scenario": scenario})
    settings = {"seed": 0, "gamma": 0.0, "learning_starts": 16, "batch_size": 16}
    model = algorithm(env=env, **searching(policy, problem, settings))
    model.learn(64)
    return problem, model


@pytest.mark.parametrize("scenario", [BRAKE_MAT, own_scenario("track_grade_20"), own_scenario("boulders")])
def test_rewards_of_random_launches_have_mean_0_and_deviation_1(scenario):
    """Oracle: the environment itself, with launches of another stream."""
    problem = Problem(scenario)
    lanes = make_vec_env(problem.id, 1000, 7000, env_kwargs={"scenario": scenario, "split": "train"})
    env = Standardised(lanes, random_rewards(problem, seed=1))
    env.reset()
    launches = np.random.default_rng(5).uniform(-1.0, 1.0, (1000, problem.actions)).astype(np.float32)
    rewards = env.step(launches)[1]
    assert abs(rewards.mean()) < 0.15
    assert rewards.std() == pytest.approx(1.0, abs=0.15)


def test_rewards_that_are_all_alike_are_not_divided_by_zero():
    lanes = make_vec_env("sledenv/SledLaunch-v0", 2, env_kwargs={"scenario": own_scenario("ice_fast")})
    env = Standardised(lanes, np.full(3, 0.5))
    env.reset()
    assert np.isfinite(env.step(np.zeros((2, 2), np.float32))[1]).all()


@pytest.mark.parametrize(("algorithm", "policy"), [(SAC, SearchingSAC), (TQC, SearchingTQC)])
def test_a_searched_launch_is_rated_better_than_the_actors_and_than_nearly_all_others(algorithm, policy):
    """Oracle: the critic itself, on many uniform launches."""
    problem, model = policy_of(algorithm, policy)
    seen = problem.task.observe(problem.task.scenes(problem.contexts("test", 20)))
    found, _ = model.predict(seen, deterministic=True)
    observed = torch.as_tensor(seen)

    def rated(launches: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            told = model.critic(observed, torch.as_tensor(launches))
            return (told.mean((1, 2)) if algorithm is TQC else torch.stack(told).amin(0)[:, 0]).numpy()

    with torch.no_grad():
        proposed = model.actor(observed).numpy()
    best = rated(found)
    assert (best >= rated(proposed)).all()
    rng = np.random.default_rng(0)
    others = np.array([rated(rng.uniform(-1.0, 1.0, found.shape).astype(np.float32)) for _ in range(4 * COARSE)])
    better = (others > best).mean(axis=0)  # the best of so many random ones alone would leave 1/130 in the mean
    assert better.mean() < 0.003
    assert better.max() < 0.02
    assert (abs(found) <= 1.0).all()


@pytest.mark.parametrize(("algorithm", "policy"), [(SAC, SearchingSAC), (TQC, SearchingTQC)])
def test_a_searched_launch_is_a_function_of_what_is_seen_and_survives_saving(algorithm, policy, tmp_path):
    """Oracle: the same observations twice, alone or among others, before and after a file."""
    problem, model = policy_of(algorithm, policy, own_scenario("track_grade_20"))
    seen = problem.task.observe(problem.task.scenes(problem.contexts("test", 30)))
    first, _ = model.predict(seen, deterministic=True)
    model.predict(seen, deterministic=False)
    assert np.array_equal(model.predict(seen, deterministic=True)[0], first)
    assert model.predict(seen[3:4], deterministic=True)[0] == pytest.approx(first[3:4], abs=1e-5)
    model.save(tmp_path / "model.zip")
    assert np.array_equal(algorithm.load(tmp_path / "model.zip").predict(seen, deterministic=True)[0], first)


@pytest.mark.parametrize(("algorithm", "policy"), [(SAC, SearchingSAC), (TQC, SearchingTQC)])
def test_a_critic_is_told_the_first_touch_of_a_landing_and_not_of_a_launch(algorithm, policy):
    """Oracle: what the first layer of its network takes, against the closed forms; without landings it is narrower."""
    problem, model = policy_of(algorithm, policy, own_scenario("boulders"))
    seen = problem.task.observe(problem.task.scenes(problem.contexts("test", 6)))
    landings = np.linspace(-1.0, 1.0, 6 * problem.actions, dtype=np.float32).reshape(6, -1)
    told = []
    (network, *_) = model.critic.q_networks
    network[0][1].register_forward_pre_hook(lambda _, given: told.append(given[0].numpy()))
    with torch.no_grad():
        model.critic(torch.as_tensor(seen), torch.as_tensor(landings))
    np.testing.assert_array_equal(told[0], np.hstack([seen, landings, Touch(problem).inputs(seen, landings)]))
    assert searching(policy, problem, {"landings": False})["policy_kwargs"] == {"touch": None}


def test_sac_explores_with_its_actor():
    """Oracle: a wide actor moves from draw to draw, a search does not."""
    problem, model = policy_of(SAC, SearchingSAC)
    seen = problem.task.observe(problem.task.scenes(problem.contexts("train", 5)))
    one, other = (model.predict(seen, deterministic=False)[0] for _ in range(2))
    assert not np.array_equal(one, other)


def test_lanes_of_two_seeds_share_no_stream(monkeypatch, tmp_path):
    """Oracle: the seeds that the environments are asked for."""
    from sledenv.agents import learning
    from sledenv.agents.sac import Agent

    asked = []

    def made(id, lanes, seed, **rest):
        asked.append(range(seed, seed + lanes))
        return make_vec_env(id, lanes, seed, **rest)

    monkeypatch.setattr(learning, "make_vec_env", made)
    problem = Problem(own_scenario("ice_fast"))
    quick = {"n_timesteps": 512, "learning_starts": 256, "gradient_steps": 1, "checks": 1}
    for seed in range(3):
        folder = tmp_path / str(seed)
        folder.mkdir()
        Agent.train(problem, default_settings("sac", problem) | quick, seed, folder)
    streams = [lane for lanes in asked for lane in lanes]
    assert len(streams) == len(set(streams)) == 3 * 256


def test_a_policy_trains_on_the_landings_that_it_acts_by():
    """Oracle: the agent itself, whose launches an environment earns what the wrapped one earns for its landings."""
    problem = Problem(BRAKE_MAT)
    launches, landings = (make_vec_env(problem.id, 16, 3, env_kwargs={"scenario": BRAKE_MAT}) for _ in range(2))
    seen, also = launches.reset(), (wrapped := Landed(landings, Landing(problem))).reset()
    np.testing.assert_array_equal(seen, also)
    model = PPO("MlpPolicy", wrapped, n_steps=2, seed=0)
    model.policy.action_net.bias.data[:] = torch.tensor([0.3, 0.5])  # an untrained policy neither turns nor spins
    agent = PpoAgent(model, Landing(problem), None)
    for _ in range(3):  # contexts change with every step
        chosen = agent.act(seen)
        told, _ = model.predict(seen, deterministic=True)
        assert np.abs(chosen[:, 0] - told[:, 0]).max() > 0.1
        (seen, rewards, *_), (_, earned, *_) = launches.step(chosen), wrapped.step(told)
        np.testing.assert_array_equal(rewards, earned)


@pytest.mark.parametrize("landings", [True, False])
def test_an_agent_without_landings_launches_what_its_policy_says(landings, tmp_path):
    """Oracle: the policy itself, before and after the agent is read from its folder."""
    problem = Problem(BRAKE_MAT)
    quick = {"n_timesteps": 64, "n_envs": 8, "n_steps": 4, "n_epochs": 1, "batch_size": 8, "checks": 1}
    agents = [PpoAgent.train(problem, default_settings("ppo", problem) | quick | {"landings": landings}, 0, tmp_path)]
    agents += [PpoAgent.load(problem, tmp_path), PpoAgent.load_untrained(problem, tmp_path)]
    seen = problem.task.observe(problem.task.scenes(problem.contexts("test", 50)))
    for agent in agents:
        told, _ = agent.model.predict(seen, deterministic=True)
        assert np.array_equal(agent.act(seen), told) != landings


HIDING = {"launch_noise": (0.01, 0.0), "observe": ["angle", "speed"]}


@pytest.mark.parametrize(("scenario", "environment"), [(BRAKE_MAT, "launch"), ("sled_kickers", "descent")])
def test_agents_train_on_the_problem_on_which_they_are_judged(scenario, environment, tmp_path, monkeypatch):
    """Oracle: the task by which they are judged, with less noise than its scenario and with hidden fields."""
    problem, made = Problem(scenario, environment, **HIDING), []
    monkeypatch.setattr(learning, "make_vec_env", lambda *a, **k: made.append(make_vec_env(*a, **k)) or made[-1])
    quick = {"n_timesteps": 64, "n_envs": 8, "n_steps": 4, "n_epochs": 1, "batch_size": 8, "checks": 1}
    PpoAgent.train(problem, default_settings("ppo", problem) | quick, 0, tmp_path)
    tasks = [lanes.env.task for lanes in made]
    if environment == "descent":
        rides = ride_critic.Rides(problem, default_settings("ride_critic", problem) | {"n_lanes": 2}, 0)
        tasks.append(rides._env.task)
    hidden = [problem.task.observation_names.index(name) for name in ("friction", "restitution")]
    for task in tasks:
        assert (task.identity, task.split) == (problem.task.identity, "train")
        assert not task.varies[hidden].any()


def test_the_wrappers_of_one_environment_are_those_of_the_lanes():
    """Oracle: the wrapped lanes that PPO and SAC train in, with the same contexts and actions."""
    problem = Problem(BRAKE_MAT, **HIDING)
    kwargs = problem.env_kwargs | {"split": "train"}
    one = Standardised1(Landed1(gym.make("sledenv/SledLaunch-v0", **kwargs)))
    lanes = make_vec_env(problem.id, 1, 3, env_kwargs=kwargs)
    vector = Landed(Standardised(lanes, random_rewards(problem, seed=0)), Landing(problem))
    seen, _ = one.reset(seed=3)
    np.testing.assert_array_equal(vector.reset()[0], seen)
    rng = np.random.default_rng(0)
    for _ in range(5):
        action = rng.uniform(-1.0, 1.0, 2).astype(np.float32)
        _, reward, terminated, truncated, _ = one.step(action)
        assert terminated or truncated
        next_seen, rewards, *_ = vector.step(action[np.newaxis])
        assert rewards[0] == pytest.approx(reward, rel=1e-6)
        seen, _ = one.reset()
        np.testing.assert_array_equal(next_seen[0], seen)
