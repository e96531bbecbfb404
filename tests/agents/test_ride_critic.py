"""The agent that searches a critic of trims: what it is told of landings, what it learns from, its file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sledenv.agents import curve, ride_critic
from sledenv.agents.flight import Flights
from sledenv.agents.land_parallel import Agent as Rule
from sledenv.agents.ride_critic import Agent, Critic, Rides, searched
from sledenv.agents.train import default_settings
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import load_run
from tests.own_scenarios import own_scenario

SCENARIO = "sled_kickers"
SMALL = {"n_lanes": 8, "n_steps": 5, "net_arch": [16, 16], "n_timesteps": 120, "batch_size": 8, "checks": 1}


@pytest.fixture(scope="module")
def problem() -> Problem:
    return Problem(SCENARIO, "descent")


@pytest.fixture(scope="module")
def flights(problem) -> Flights:
    return Flights(problem)


def settings(problem: Problem) -> dict:
    return default_settings("ride_critic", problem) | SMALL


def begun(problem: Problem, count: int = 60):
    """Return scenes, rides that wait for their first trim, and what is seen of them."""
    contexts = problem.contexts("validation", count)
    scenes = problem.task.scenes(contexts)
    rides = problem.task.simulator(scenes, keep_rebounds=True)
    rides.wait()
    return scenes, rides, problem.task.observe(scenes, rides.flights)


def critic_of(flights: Flights) -> Critic:
    return Critic(flights.width, flights.trim_width, [16, 16], 11)


def test_the_ground_is_that_of_the_track(problem, flights):
    """Oracle: straight lines between the vertices of the scenario, as far as they are seen."""
    scenes, rides, seen = begun(problem, 20)
    x = rides.flights["x"]
    away = np.linspace(-3.0, 10.0, 40)
    heights, _ = flights.land(seen).ground.at(np.tile(away.astype(np.float32), (20, 1)))
    for lane, vertices in enumerate(scenes.grounds()):
        known = np.column_stack([vertices["x"], vertices["y"]])
        ground = np.interp(x[lane] + away, *known.T) - np.interp(x[lane], *known.T)
        passed = int(np.searchsorted(known[:, 0], x[lane]))
        first, last = known[max(passed - 2, 0), 0], known[min(passed + 7, len(known) - 1), 0]
        inside = (x[lane] + away >= first) & (x[lane] + away <= last)
        np.testing.assert_allclose(heights[lane][inside], ground[inside], atol=1e-4)


def test_the_landing_is_foreseen(problem, flights):
    """Oracle: the simulator; an end of the sled touches a little before its middle is as low as when it lies."""
    _, rides, seen = begun(problem)
    began, rebounds = rides.flights["t"], rides.flights["rebounds"]
    landings = flights.land(seen)
    rides.hop(np.zeros(len(began)))
    batch = rides.descents()
    lanes = np.flatnonzero(batch.outcomes["rebounds"] > rebounds)
    touches = batch.rebounds[lanes, rebounds[lanes]]
    late = landings.time[lanes] - (touches["t"] - touches["duration"] - began[lanes])
    assert len(lanes) > 50
    assert 0.0 < np.median(late) < 0.1
    assert ((late > -0.03) & (late < 0.2)).mean() > 0.9


def test_a_trim_is_told_by_the_pose_and_spin_it_lands_with(problem, flights):
    """Oracle: uniform rotation."""
    _, rides, seen = begun(problem)
    landings = flights.land(seen)
    trims = np.array([-1.0, 0.0, 0.5], np.float32)
    told = flights.trimmed(landings, np.tile(trims, (len(seen), 1)))
    assert told.shape == (len(seen), 3, flights.trim_width)
    outcomes = rides.flights
    spins = outcomes["omega"][:, np.newaxis] + problem.scenario.rider.trim_rad_s * trims
    angles = outcomes["phi"][:, np.newaxis] + spins * landings.time[:, np.newaxis]
    np.testing.assert_allclose(told[..., 3], angles, atol=1e-3)
    np.testing.assert_allclose(2.0 * told[..., 1], spins, atol=1e-3)
    np.testing.assert_allclose(told[..., 0], angles - landings.pitch[:, np.newaxis], atol=1e-3)


def test_a_plane_without_a_rider_has_landings_too():
    problem = Problem(own_scenario("brake_mat"), "descent")
    flights = Flights(problem)
    landings = flights.land(begun(problem, 5)[2])
    assert landings.inputs.shape == (5, flights.width)
    assert np.isfinite(flights.trimmed(landings, np.zeros((5, 2), np.float32))).all()


def test_a_trim_earned_what_followed_up_to_the_next_trial(problem, flights, monkeypatch):
    """Oracle: sums by hand; a trial in the third flight, of which the critic expects 5, and an end after the fourth."""
    rides = Rides(problem, settings(problem) | {"n_lanes": 1, "n_steps": 5}, 0)
    seen, steps = rides._seen, iter(range(6))
    chosen = np.zeros((1, 1), np.float32)

    class Scripted:
        def step(self, trims):
            step = next(count)
            return seen, np.array([10.0**step]), np.array([step == 3]), np.array([False]), {}

    count = iter(range(5))
    rides._env = Scripted()

    def choose(critic, landings):
        step = next(steps)
        return chosen, np.array([step != 2]), np.array([50000.0 if step == 2 else 7.0], np.float32)

    monkeypatch.setattr(rides, "_chosen", choose)
    samples = rides.sample(critic_of(flights))
    assert samples.earned.tolist() == [50011.0, 50010.0, 1100.0, 1000.0, 10007.0]
    assert rides.descents == 1
    assert samples.flights.shape == (5, flights.width)


def test_the_best_trim_is_done(problem, flights):
    """Oracle: the ratings of each flight by itself; how many flights are rated together does not matter."""
    critic, (_, _, seen) = critic_of(flights), begun(problem, ride_critic._BLOCK + 3)
    actions = Agent(problem, critic).act(seen)
    assert actions.shape == (len(seen), 1)
    assert actions.dtype == np.float32
    for lane in (0, ride_critic._BLOCK, ride_critic._BLOCK + 2):
        landings = flights.land(seen[lane : lane + 1])
        ratings = critic.rate(flights, landings, np.linspace(-1.0, 1.0, 41, dtype=np.float32))
        trims, expected = searched(critic, flights, landings, 41)
        assert expected[0] == ratings.max()
        assert actions[lane, 0] == pytest.approx(trims[0], abs=0.2)  # bfloat16 rounds otherwise in another batch


def test_equal_seeds_give_equal_agents_and_others_do_not(problem, tmp_path, monkeypatch):
    monkeypatch.setattr(curve, "_CONTEXTS", 4)
    weights = []
    for i, seed in enumerate((1, 1, 2)):
        folder = tmp_path / str(i)
        folder.mkdir()
        agent = Agent.train(problem, settings(problem), seed, folder)
        weights.append(agent._critic.last.weight.detach().numpy())
        assert (folder / "learning_curve.csv").read_text().splitlines()[-1].split(",")[0] != "0"
    assert np.array_equal(*weights[:2])
    assert not np.array_equal(*weights[1:])


def test_weights_that_are_no_numbers_are_refused(problem, flights, tmp_path):
    state = {name: value.numpy() for name, value in critic_of(flights).state_dict().items()}
    state["last.bias"] = np.full(11, np.nan)
    np.savez(tmp_path / "critic.npz", **state)
    with pytest.raises(ValueError, match=r"last\.bias has weights that are no finite numbers"):
        Agent.load(problem, tmp_path)


def test_an_agent_that_ships_rides_better_than_the_rule():
    """Oracle: contexts that no training has seen."""
    problem, agent, _ = load_run(Path(f"{SCENARIO}-descent-trim-ride_critic-s0"))
    contexts = problem.contexts("test", 60)
    learned, rule = (problem.judge(each, contexts)[0].jam.reward.mean() for each in (agent, Rule(problem)))
    assert learned > rule + 0.1
