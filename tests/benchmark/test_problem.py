"""Problems: what is judged equals episodes of the environment, noise is the same for all, expectation is a mean."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from sledenv.benchmark.problem import ENVIRONMENTS, TRIALS, Problem
from sledenv.envs.inputs import FIELDS
from sledenv.scenarios.scenario import Context, Scenario, load_scenario
from sledenv.simulation import STATUS_OF_CODE
from tests.own_scenarios import own_scenario, ride_over_bumps


class Scripted:
    """Acts by a fixed linear map, so that every observation counts."""

    def __init__(self, inputs: int, actions: int) -> None:
        self._weights = np.random.default_rng(3).normal(0.0, 0.6, (inputs, actions))

    def act(self, observations: np.ndarray) -> np.ndarray:
        return np.tanh(observations @ self._weights).astype(np.float32)


@pytest.fixture(scope="module")
def noisy() -> Scenario:
    """brake_mat with launch noise, and the orientation alone to choose."""
    content = load_scenario(own_scenario("brake_mat")).model_dump(by_alias=True)
    content["control"] |= {"chosen": "orientation", "noise_orientation_deg": 4.0, "noise_spin_rad_s": 0.5}
    return Scenario.model_validate(content)


@pytest.mark.parametrize(
    "scenario", [own_scenario("brake_mat"), ride_over_bumps(noise_rad_s=0.3)], ids=["mat", "bumps"]
)
@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_an_agent_is_judged_as_in_episodes_of_the_environment(environment, scenario):
    """Oracle: the scalar environment, episode by episode, bit for bit."""
    problem = Problem(scenario, environment)
    contexts = problem.contexts("test", 6)
    env = gym.make(problem.id, scenario=problem.scenario)
    agent = Scripted(env.observation_space.shape[0], problem.actions)
    batch, actions = problem.judge(agent, contexts)
    for i, context in enumerate(contexts):
        observation, _ = env.reset(options={"context": context})
        ended, first, total = False, None, 0.0
        while not ended:
            action = agent.act(observation[np.newaxis])[0]
            first = action if first is None else first
            observation, reward, terminated, truncated, info = env.step(action)
            ended, total = terminated or truncated, total + reward
        assert total == pytest.approx(batch.jam.reward[i], abs=1e-12)
        assert info["descent"]["time"] == batch.outcomes["t"][i]
        assert STATUS_OF_CODE[info["descent"]["status"]] == batch.status[i]
        assert np.array_equal(first.astype(float), actions[i])
    assert len(set(batch.outcomes["t"].tolist())) == 6


def test_a_scenario_says_what_is_chosen_and_how_noisy_the_launch_is(noisy):
    """Oracle: the settings of the scenario; an environment may be made otherwise."""
    problem = Problem(noisy)
    assert problem.control == "orientation"
    assert problem.actions == 1
    assert problem.task.noise == pytest.approx([np.radians(4.0), 0.5])
    env = gym.make(problem.id, scenario=noisy, control="both", launch_noise=(0.0, 0.0)).unwrapped
    assert env.action_space.shape == (2,)
    assert not env.task.noise.any()


def test_the_expected_reward_is_the_mean_over_the_trials(noisy):
    """Oracle: every trial by itself; all contexts share their errors, whose deviations are those of the scenario."""
    problem = Problem(noisy)
    contexts = problem.contexts("train", 3)
    actions = np.linspace(-1.0, 1.0, 5).reshape(1, 5, 1).repeat(3, axis=0)
    trials = problem.trials(contexts, "train")
    assert trials.shape == (3, TRIALS, 14)
    assert np.array_equal(trials[0, :, FIELDS:], trials[2, :, FIELDS:])
    assert not np.isclose(
        trials[0, :, FIELDS:], problem.trials(contexts, "test")[0, :, FIELDS:]
    ).any()  # nobody knows the test
    assert trials[0, :, FIELDS:].std(axis=0) == pytest.approx(problem.noise, rel=0.1)
    assert trials[0, :, FIELDS:].mean(axis=0) == pytest.approx([0.0, 0.0], abs=0.1 * problem.noise.min())
    slow = [
        [np.mean([problem.descend(trial[np.newaxis], [action]).jam.reward[0] for trial in trials[i]]) for action in row]
        for i, row in enumerate(actions)
    ]
    assert problem.expect(trials, actions) == pytest.approx(np.array(slow), abs=1e-14)
    assert Problem(noisy, launch_noise=(0.0, 0.0)).trials(contexts, "test").shape == (3, 1, 14)
    drawn = problem.drawn(problem.contexts("train", 2 * TRIALS), "train")
    assert np.array_equal(drawn[:TRIALS, FIELDS:], trials[0, :, FIELDS:])
    assert np.array_equal(drawn[TRIALS:, FIELDS:], trials[0, :, FIELDS:])


def test_scenes_draw_what_is_hidden_from_all_of_its_range_and_leave_the_rest():
    """Oracle: uniform and normal moments; a problem that sees all has the same scenes but for the hidden fields."""
    seen = [name for name in Context._fields[:11] if name not in ("friction", "restitution")]
    problem = Problem("sled_snow", observe=seen)
    contexts = problem.contexts("test", 2)
    scenes = problem.scenes(contexts, 256, (5,))
    hidden = np.flatnonzero(problem.task.hidden)
    low, high = problem.scenario.ranges
    assert [Context._fields[i] for i in hidden] == ["friction", "restitution"]
    for i in hidden:
        assert scenes[0, :, i].min() < low[i] + 0.02 * (high[i] - low[i])
        assert scenes[0, :, i].max() > high[i] - 0.02 * (high[i] - low[i])
        assert scenes[0, :, i].mean() == pytest.approx(0.5 * (low[i] + high[i]), rel=0.02)
    assert scenes[0, :, FIELDS:].std(axis=0) == pytest.approx(problem.noise, rel=0.05)
    others = np.delete(np.arange(FIELDS), hidden)
    assert (scenes[1][:, others] == contexts[1, others]).all()
    assert (
        problem.trials(contexts, "test")[..., :FIELDS] == contexts[:, np.newaxis]
    ).all()  # judged where it really is
    still = problem.scenes(contexts, 8, (5,), noisy=(True, False))[0, :, FIELDS:]
    assert still[:, 0].all()
    assert not still[:, 1].any()


def test_shifted_contexts_are_harder_and_seen_on_the_scale_of_the_others():
    """Oracle: the numbers of one ride, each a quarter above, and the observation that they make by hand."""
    problem = Problem("sled_rollers", "descent")
    other = problem.shifted()
    plain, shifted = (one.contexts("test", 40) for one in (problem, other))
    speed = Context._fields.index("speed")
    assert shifted[:, speed] == pytest.approx(1.25 * plain[:, speed])
    assert np.array_equal(np.delete(shifted, speed, axis=1), np.delete(plain, speed, axis=1))
    slopes = (one.scenario.given(Context(*contexts[0])).slope for one, contexts in ((problem, plain), (other, shifted)))
    low, high = (max(y for _, y in slope.profile) for slope in slopes)
    assert high == pytest.approx(1.25 * low)
    seen = []

    class Watching:
        def act(self, observations):
            seen.append(observations)
            return np.zeros((len(observations), 1), np.float32)

    names, (low, high) = problem.task.observation_names, (6.5, 10.0)
    other.judge(Watching(), other.trials(shifted, "test"))
    told = 2.0 * (shifted[:, speed] - low) / (high - low) - 1.0
    first = seen[0][:, names.index("speed")]
    assert len(first) == 40
    assert first == pytest.approx(told, abs=1e-6)
    assert first.max() > 1.0
    heights = [names.index(f"{side}_y") for side in ("behind_2", "behind_1", *(f"ahead_{k}" for k in range(1, 9)))]
    assert max(np.abs(one[:, heights]).max() for one in seen) > 1.0


class Swinging:
    """Trims to and fro, by what is left of the way."""

    def act(self, observations):
        return np.sin(40.0 * observations[:, 11:12])


@pytest.mark.parametrize("scenario", ["sled_rollers", "sled_kickers"])
def test_a_ride_is_repeated_from_its_trims(scenario):
    """Oracle: the batch of all rides, bit for bit."""
    problem = Problem(scenario, "descent")
    scenes = problem.trials(problem.contexts("test", 4), "test")[:, 0]
    batch, trims = problem.ride(Swinging(), scenes)
    for i in range(len(scenes)):
        made = trims[i][~np.isnan(trims[i])].tolist()
        descent = problem.task.ridden(problem.task.scenes(scenes[i : i + 1]), made, record="trajectory")
        assert descent.jam.reward == batch.jam.reward[i]
        assert descent.time == batch.outcomes["t"][i]
        assert descent.trajectory["t"][-1] == descent.time
