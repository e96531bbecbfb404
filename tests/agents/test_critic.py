"""The agent that searches a critic: what it is told of touches, what it learns from, its search, its file."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.special import ndtr

from sledenv.agents import curve
from sledenv.agents.critic import _ACTING, _BLOCK, Agent, Critic, Episodes, Search, _write
from sledenv.agents.features import LaunchFeatures, RideFeatures, features_of
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import TRAINED, load_run, read_settings
from sledenv.scenarios.configuration import CONFIGS
from sledenv.scenarios.scenario import load_scenario, scenario_names
from tests.own_scenarios import own_scenario

SCENARIO = "sled_kickers"
COLUMNS = ("context", "state", "landing")
SMALL = {"n_envs": 8, "n_steps": 5, "net_arch": [16, 16], "n_timesteps": 120, "batch_size": 8, "checks": 1}


@pytest.fixture(scope="module")
def problem() -> Problem:
    return Problem(SCENARIO, "descent", columns=COLUMNS)


def settings(problem: Problem, **own) -> dict:
    given = read_settings(CONFIGS / "agents", "sledenv.agents.critic", problem.environment)
    given.pop("env_kwargs", None)
    return given | SMALL | own


def begun(problem: Problem, count: int = 60):
    """Return scenes, rides that wait for their first trim, and what is seen of them."""
    scenes = problem.task.scenes(problem.contexts("validation", count))
    rides = problem.task.simulator(scenes, keep_rebounds=True)
    rides.wait()
    return scenes, rides, problem.task.observe(scenes, rides.flights)


def critic_of(problem: Problem, bins: int = 11, blur: float = 0.06) -> Critic:
    return Critic(problem.task.observation_space.shape[0], features_of(problem).width, [16, 16], bins, blur)


def test_a_target_is_the_reward_that_it_stands_for(problem):
    """Oracle: the least cross-entropy of logits that may be anything is their target; its mean is the reward."""
    critic, rewards = critic_of(problem, 51), torch.linspace(0.0, 1.0, 11)
    logits = torch.zeros(11, 1, 51, requires_grad=True)
    critic.forward = lambda *_: logits
    (gradient,) = torch.autograd.grad(critic.loss(None, None, rewards), logits)
    targets = (1 / 51 - 11 * gradient)[:, 0]  # of softmax and cross-entropy: answer less target, over the rows
    assert (targets >= -1e-5).all()
    np.testing.assert_allclose(targets.sum(dim=1), 1.0, atol=2e-4)
    np.testing.assert_allclose(targets @ (0.5 * (critic.edges[1:] + critic.edges[:-1])), rewards, atol=1e-3)


@pytest.mark.parametrize("scenario", ["sled_snow", own_scenario("boulders"), own_scenario("brake_mat")])
def test_the_first_touch_is_where_the_descent_first_touches(scenario):
    """Oracle: the simulator, to the end of the flight; some bodies touch in another pose on the way."""
    problem = Problem(scenario, launch_noise=(0.0, 0.0))
    task = problem.task
    contexts = problem.contexts("train", 100)
    chosen = np.random.default_rng(0).uniform(-1.0, 1.0, (100, problem.actions))
    scenes = task.aimed(task.scenes(contexts), chosen)
    launches, first = scenes.launches, task.descend(scenes, keep_rebounds=True).rebounds[:, 0]
    seen = task.observe(task.scenes(contexts))
    inputs = LaunchFeatures(problem).of_actions(seen, chosen[:, np.newaxis].astype(np.float32))[:, 0]
    np.testing.assert_allclose(inputs[:, : problem.actions], chosen, atol=1e-6)
    sine, cosine = inputs[:, problem.actions : problem.actions + 2].T
    time, arm, lever, approach, slip, spin = inputs[:, -6:].T
    begun = first["t"] - first["duration"]
    same = np.abs(begun - time) < 2e-3
    assert same.mean() > 0.8
    assert np.abs(spin - launches[:, 5]).max() < 1e-4
    turned = np.arctan2(sine, cosine) - (launches[:, 2] + spin * time)
    assert np.abs((turned + np.pi) % (2.0 * np.pi) - np.pi).max() < 1e-3
    # A descent has lost at the touch nothing of the energy that the flight keeps.
    angle, speed, fall = contexts[:, 0], launches[:, 3], -launches[:, 4]
    gravity = problem.scenario.slope_section.gravity_m_s2
    u, v = slip - arm * spin, approach + lever * spin
    gained = gravity * (np.sin(angle) * time * (speed + 0.5 * gravity * np.sin(angle) * time))
    gained += gravity * np.cos(angle) * (launches[:, 1] - arm)
    np.testing.assert_allclose(u**2 + v**2 - speed**2 - fall**2, 2.0 * gained, atol=0.05)


def test_a_trim_is_told_by_the_pose_and_spin_it_lands_with(problem):
    """Oracle: uniform rotation, and the landing that the environment foresees."""
    _, rides, seen = begun(problem)
    values = problem.task.columns.values(seen)
    trims = np.array([-1.0, 0.0, 0.5], np.float32)
    told = RideFeatures(problem).of_actions(seen, np.tile(trims[:, np.newaxis], (len(seen), 1, 1)))
    assert told.shape == (len(seen), 3, RideFeatures(problem).width)
    outcomes = rides.flights
    spins = outcomes["omega"][:, np.newaxis] + problem.scenario.rider.trim_rad_s * trims
    angles = outcomes["phi"][:, np.newaxis] + spins * values["landing_time"][:, np.newaxis]
    np.testing.assert_allclose(told[..., 2], angles, atol=1e-3)
    np.testing.assert_allclose(told[..., 1], spins, atol=1e-3)
    np.testing.assert_allclose(told[..., 3], np.sin(angles - values["landing_pitch"][:, np.newaxis]), atol=1e-3)
    with pytest.raises(ValueError, match="must have 'landing', which the critic of rides reads"):
        features_of(Problem(SCENARIO, "descent", columns=COLUMNS[:2]))


def test_an_end_that_is_told_to_be_low_touches_first(problem):
    """Oracle: the simulator, which says what part of the sled touched: its nose or its tail."""
    _, rides, seen = begun(problem, 200)
    trims = np.random.default_rng(1).uniform(-1.0, 1.0, (200, 1)).astype(np.float32)
    told = RideFeatures(problem).of_actions(seen, trims[:, np.newaxis])[:, 0]
    back, front = told[:, -6], told[:, -3]  # how high the ends are over the ground
    began = rides.flights["rebounds"].copy()
    rides.hop(problem.scenario.rider.trim_rad_s * trims[:, 0].astype(float))
    batch = rides.descents()
    lanes = np.flatnonzero(batch.outcomes["rebounds"] > began)
    touched = batch.rebounds[lanes, began[lanes]]
    ahead = touched["x_contact"] > touched["x"] - touched["duration"] * touched["u_before"]  # of the mass centre
    clear = np.abs(front - back)[lanes] > 0.1
    assert clear.sum() > 40
    agrees = ((front < back)[lanes] == ahead) | ((front > back)[lanes] == ~ahead)
    assert agrees[clear].mean() > 0.9


def test_a_ride_is_learned_by_what_was_lent(problem, monkeypatch):
    """Oracle: the spins that the task draws for what was asked, errors included, also of flights that end the ride."""
    episodes, lent = Episodes(problem, settings(problem, n_envs=200), 0), []
    drawn = problem.task.__class__.spins

    def spins(task, scenes, actions, *given):
        lent.append(drawn(task, scenes, actions, *given))
        return lent[-1]

    monkeypatch.setattr(problem.task.__class__, "spins", spins)
    told = episodes.sample(None).actions[:, 0, 0]
    assert episodes.ended > 20
    np.testing.assert_allclose(told, np.concatenate(lent) / problem.scenario.rider.trim_rad_s, atol=1e-5)


def test_a_trim_earned_what_followed_up_to_the_next_trial(problem, monkeypatch):
    """Oracle: sums by hand; a trial in the third flight, of which the critic expects 500, the fourth ends."""
    rides = Episodes(problem, settings(problem, n_envs=1), 0)
    seen, steps, count = rides._seen, iter(range(6)), iter(range(5))
    chosen = np.zeros((1, 1), np.float32)

    class Scripted:
        def step(self, trims):
            step = next(count)
            info = {"final_obs": seen.astype(object)}
            return seen, np.array([10.0**step]), np.array([step == 3]), np.array([False]), info

    def choose(critic):
        step = next(steps)
        return chosen, np.array([step != 2]), np.array([500.0 if step == 2 else 7.0], np.float32)

    rides._env = Scripted()
    monkeypatch.setattr(rides, "_chosen", choose)
    samples = rides.sample(critic_of(problem))
    assert samples.earned.tolist() == [511.0, 510.0, 1100.0, 1000.0, 10007.0]
    assert rides.ended == 1
    assert samples.actions.shape == (5, 1, RideFeatures(problem).width)


@pytest.mark.parametrize(("scenario", "noise"), [("sled_mat", (0.0, 0.0)), (own_scenario("brake_mat"), (0.05, 0.5))])
def test_samples_of_launches_are_what_they_earn(scenario, noise):
    """Oracle: the simulator, with contexts and launches that the inputs tell; with noise, rewards scatter."""
    problem = Problem(scenario, launch_noise=noise)
    episodes = Episodes(problem, settings(problem, n_envs=60, n_steps=1), 1)
    for critic in (None, critic_of(problem, blur=0.2)):
        seen, inputs, earned = episodes.sample(critic)
        launches = inputs[:, 0, : problem.actions].astype(float)
        again = problem.descend(problem.task.contexts_seen(seen), launches).jam.reward
        alike = np.isclose(again, earned, atol=1e-3).mean()  # a cliff may lie between float32 and double
        assert alike < 0.9 if problem.noise.any() else alike > 0.9
    assert episodes.ended == 120


@pytest.mark.parametrize("environment", ["descent", "launch"])
def test_the_best_action_is_done_however_many_are_rated_together(environment):
    """Oracle: the ratings of each observation by itself, averaged over their neighbours by a loop."""
    problem = Problem("sled_kickers", "descent", columns=COLUMNS) if environment == "descent" else Problem("sled_snow")
    torch.manual_seed(2)
    critic = critic_of(problem)
    scenes = problem.task.scenes(problem.contexts("validation", _BLOCK + 3))
    seen = problem.task.observe(scenes)
    actions = Agent(problem, [critic]).act(seen)
    assert actions.shape == (len(seen), problem.actions)
    assert actions.dtype == np.float32
    search, features = Search(problem, 0.06, *_ACTING), features_of(problem)
    off = np.hypot(0.06, features.error)
    for lane in (0, _BLOCK, _BLOCK + 2):
        ratings = critic.rate(features, seen[lane : lane + 1], search._rated)[0].astype(float)
        smooth = []
        for one in search.actions:
            near = np.exp(-0.5 * ((search._rated - one) ** 2).sum(axis=1) / off**2)
            smooth.append((near * ratings).sum() / near.sum())
        chosen = int(np.flatnonzero((search.actions == actions[lane]).all(axis=1))[0])
        assert smooth[chosen] == pytest.approx(max(smooth), abs=1e-5)
        assert Agent(problem, [critic]).expected(seen[lane : lane + 1])[0] == pytest.approx(max(smooth), abs=1e-4)


@pytest.mark.parametrize("environment", ["descent", "launch"])
def test_equal_seeds_give_equal_agents_and_others_do_not(environment, tmp_path, monkeypatch):
    """And the learning curve counts the descents of both critics, one behind the other; a launch is one."""
    monkeypatch.setattr(curve, "_CONTEXTS", 4)
    problem = Problem("sled_kickers", "descent", columns=COLUMNS) if environment == "descent" else Problem("sled_mat")
    weights = []
    for i, seed in enumerate((1, 1, 2)):
        folder = tmp_path / str(i)
        folder.mkdir()
        agent = Agent.train(problem, settings(problem), seed, folder)
        weights.append(agent._critics[0].last.weight.detach().numpy())
        descents = np.loadtxt(folder / "learning_curve.csv", delimiter=",", skiprows=1)[:, 0]
        assert (np.diff(descents) > 0).all()
        assert environment == "descent" or descents.tolist() == [40, 80, 120, 160]
    assert np.array_equal(*weights[:2])
    assert not np.array_equal(*weights[1:])


def test_weights_are_plain_finite_numbers_and_critics_are_rated_in_the_mean(problem, tmp_path):
    """Oracle: NumPy, which refuses to run what a file holds; the mean of what each critic rates; the message."""
    torch.manual_seed(4)
    critics, search = [critic_of(problem, 21) for _ in range(3)], Search(problem, 0.06, *_ACTING)
    _write(critics, tmp_path / "critic.npz")
    with np.load(tmp_path / "critic.npz", allow_pickle=False) as arrays:
        assert {arrays[name].dtype for name in arrays.files if "blur" not in name} == {np.dtype(np.float16)}
    seen = begun(problem, 4)[2]
    each = [critic.rate(search.features, seen, search._rated) @ search._near for critic in critics]
    expected = np.mean(each, axis=0).max(axis=1)
    np.testing.assert_allclose(Agent.load(problem, tmp_path).expected(seen), expected, atol=2e-3)
    critics[0].last.bias.data[3] = torch.inf
    _write(critics, tmp_path / "critic.npz")
    with pytest.raises(ValueError, match=r"critic\.npz: 0\.last\.bias has weights that are no finite numbers"):
        Agent.load(problem, tmp_path)


@pytest.mark.parametrize(
    "scenario", [name for name in scenario_names() if not {"paper", "engineer"} & set(load_scenario(name).tags)]
)
def test_a_shipped_agent_is_of_its_scenario_as_it_is_and_beats_the_zero_action(scenario):
    """Oracle: no action at all, in contexts that no training has seen; the scenario itself."""
    (run,) = TRAINED.glob(f"{scenario}-*-critic-s0")
    problem, agent, config = load_run(run)
    now = Problem(scenario, problem.environment)
    assert config["scenario_hash"] == problem.scenario.hash == now.scenario.hash

    class Zero:
        def act(self, observations):
            return np.zeros((len(observations), 1), np.float32)

    trials = problem.trials(problem.contexts("test", 40), "test")
    mine, zero = (problem.judge(one, trials)[0].jam.reward.mean() for one in (agent, Zero()))
    assert mine > zero


def test_a_rating_is_a_mean_over_the_error(problem):
    """Oracle: of a critic that knows a step at half of the largest trim, the normal distribution of the error."""
    search = Search(problem, 0.0001, 0.1, 4000)
    error = problem.scenario.rider.noise_rad_s / problem.scenario.rider.trim_rad_s

    class Step:
        def rate(self, features, observations, actions):
            return np.tile((actions[:, 0] > 0.5).astype(np.float32), (len(observations), 1))

    assert search.features.error == pytest.approx(error)
    mean = Step().rate(None, np.zeros((1, 1)), search._rated) @ search._near
    np.testing.assert_allclose(mean[0], ndtr((search.actions[:, 0] - 0.5) / error), atol=0.05)
    assert np.abs(search.actions).max() == 1.0 < np.abs(search._rated).max()
