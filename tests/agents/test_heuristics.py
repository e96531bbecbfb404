"""Agents that know some mechanics: what they promise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtri

from sledenv import load_scenario
from sledenv.agents import land_flat, land_parallel, replan, zero
from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import SEEN
from sledenv.envs.task import Task
from sledenv.scenarios.scenario import Scenario
from sledenv.simulation.records import RUNNING
from tests.own_scenarios import own_scenario, ride_over_bumps

CONTROLS = ["both", "orientation", "spin"]


def altered(name: str, **sections) -> Scenario:
    """A shipped scenario with other sections."""
    content = load_scenario(name).model_dump(mode="json", by_alias=True)
    for section, values in sections.items():
        content[section] |= values
    return Scenario.model_validate(content)


def launched(problem: Problem, contexts: np.ndarray, agent) -> tuple[np.ndarray, np.ndarray]:
    """The launches that an agent chooses, and the first rebound of each descent."""
    task, scenes = problem.task, problem.task.scenes(contexts)
    aimed = task.aimed(scenes, agent.act(task.observe(scenes)).astype(float))
    return aimed.launches, task.descend(aimed, keep_rebounds=True).rebounds[:, 0]


def turned(angle: np.ndarray) -> np.ndarray:
    return np.angle(np.exp(1j * angle))


@pytest.mark.parametrize("control", CONTROLS)
@pytest.mark.parametrize("name", [own_scenario("brake_mat"), own_scenario("ice_drop")])
def test_contexts_come_back_from_what_is_seen_of_them(name, control):
    """Oracle: the contexts that were observed, up to the rounding of float32; a choice is not known."""
    task = Task(name, control)
    contexts = task.scenario.contexts(np.random.default_rng(0).random((50, 11)))
    seen = task.contexts_seen(task.observe(task.scenes(contexts)))
    chosen = [i for i, field in enumerate(("orientation", "spin"), 6) if field in task.controlled]
    assert np.isnan(seen[:, chosen]).all()
    known = np.delete(np.arange(11), chosen)
    low, high = task.scenario.ranges
    assert (np.abs(seen - contexts)[:, known] <= 1e-7 * (high - low)[known]).all()


@pytest.mark.parametrize("scenario", [own_scenario("ice_drop"), ride_over_bumps()], ids=["plane", "bumps"])
def test_flights_come_back_from_what_is_seen_of_them(scenario):
    """Oracle: the rides themselves where a flight begins, and the ground around."""
    task = Task(scenario, ride=True)
    rides = task.rides(task.scenario.draw(np.random.default_rng(1).random((40, task.scenario.draws))))
    rides.hop(np.full(40, 0.5))
    running = np.flatnonzero(rides.flights["status"] == RUNNING)
    scenes, flights = rides.scenes.take(running), rides.flights[running]
    assert len(flights) > 20
    seen = task.columns.values(task.observe(scenes, flights))
    assert scenes.rows["length"] - seen["left"] == pytest.approx(flights["x"], abs=2e-5)
    for name in ("u", "v", "omega"):
        assert seen[name] == pytest.approx(flights[name], abs=2e-5)
    assert seen["trim"] == pytest.approx(0.5, abs=1e-6)
    assert seen["supplied"] * task.bodies[0].mass == pytest.approx(flights["supplied"], rel=1e-6)
    for i, (x, vertices) in enumerate(zip(flights["x"], scenes.grounds(), strict=True)):
        level = np.interp(x, vertices["x"], vertices["y"]) if len(vertices) else 0.0
        assert seen["height"][i] == pytest.approx(flights["y"][i] - level, abs=2e-5)
        for k in range(1, 9 if len(vertices) else 0):
            if seen[f"ahead_{k}_there"][i]:
                there = x + seen[f"ahead_{k}_x"][i]
                assert seen[f"ahead_{k}_y"][i] == pytest.approx(
                    np.interp(there, vertices["x"], vertices["y"]) - level, abs=2e-5
                )


def test_land_flat_rolls_onto_a_rough_mat_and_does_not_slip():
    """Oracle: the slip u + (r - h) omega at the first touch of the simulator, where friction holds what slides."""
    launch, contact = {"speed_m_s": [0.5, 2.0], "drop_m": [0.1, 0.2]}, {"friction": [0.25, 0.6]}
    problem = Problem(altered(own_scenario("brake_mat"), launch=launch, contact=contact))
    contexts = problem.contexts("test", 60)
    agent = land_flat.Agent(problem)
    _, first = launched(problem, contexts, agent)
    body = problem.task.bodies[0]
    slip = first["u_before"] + (body.radius - body.eccentricity) * first["omega_before"]
    assert (first["omega_before"] < -1.0).all()
    assert np.abs(slip).max() < 1e-4


@pytest.mark.parametrize("control", ["all", "orientation+speed", "spin+speed"])
def test_land_flat_touches_upright_at_the_middle_of_the_speeds(control):
    """Oracle: the first rebound of the simulator; the middle of the bounds by hand."""
    launch = {"orientation_deg": [-40, 40], "drop_m": [0.6, 1.5]}
    scenario = altered(own_scenario("ice_drop"), launch=launch, control={"spin_rad_s": [-8, 8], "speed_m_s": [2, 7]})
    problem = Problem(scenario, control=control)
    contexts = problem.contexts("test", 40)
    launches, first = launched(problem, contexts, land_flat.Agent(problem))
    assert (launches[:, 3] == 4.5).all()
    assert (np.abs(launches[:, 5]) < 8.0).all()  # no spin is cut short
    touch = first["t"] - first["duration"]
    assert np.abs(turned(launches[:, 2] + launches[:, 5] * touch)).max() < 1e-5


def test_land_flat_mirrors_with_the_disturbance():
    """Oracle: symmetry of the flight; the mirrored spin needs the mirrored pose."""
    problem = Problem(own_scenario("ice_drop"), control="orientation")
    contexts = problem.contexts("test", 30)
    mirrored = contexts.copy()
    mirrored[:, 7] *= -1.0
    agent = land_flat.Agent(problem)
    poses, others = (agent.act(problem.task.observe(problem.task.scenes(each))) for each in (contexts, mirrored))
    assert np.abs(poses).max() > 0.05
    assert others == pytest.approx(-poses, abs=1e-6)


def test_land_flat_without_fall_or_gravity_still_acts():
    for control in CONTROLS:
        problem = Problem(altered(own_scenario("ice_drop"), slope={"gravity_m_s2": 0}), control=control)
        seen = problem.task.observe(problem.task.scenes(problem.contexts("test", 5)))
        actions = land_flat.Agent(problem).act(seen)
        assert problem.action_space.contains(actions[0])


def test_the_zero_action_earns_what_the_launch_earns_alone():
    """Oracle: the descents of the same launches, bit for bit."""
    problem = Problem(ride_over_bumps(), "descent")
    contexts = problem.contexts("test", 30)
    batch, firsts = problem.judge(zero.Agent(problem), contexts)
    alone = problem.task.descend(problem.task.scenes(contexts)).jam.reward
    assert np.array_equal(batch.jam.reward, alone)
    assert firsts.tolist() == [[0.0]] * 30


def test_replan_earns_more_than_the_rule_and_the_rule_more_than_nothing():
    """Oracle: the zero action; launches that pitch, which a trim can put right before they land."""
    content = ride_over_bumps(trim_rad_s=2.0).model_dump(by_alias=True)
    content["control"]["spin_rad_s"] = (-2.0, 2.0)
    problem = Problem(Scenario.model_validate(content), "descent")
    contexts = problem.contexts("test", 40)
    agents = zero.Agent(problem), land_parallel.Agent(problem), replan.Agent(problem, [17])
    nothing, rule, best = (problem.judge(agent, contexts)[0].jam.reward.mean() for agent in agents)
    assert rule > nothing + 0.02
    assert best > rule + 0.02


def test_the_rule_lands_parallel_to_the_ground():
    """Oracle: the pose at the next touch, where the ground is as steep as where the mass centre is."""
    problem = Problem(ride_over_bumps(trim_rad_s=3.0), "descent")
    task, contexts = problem.task, problem.contexts("test", 60)
    scenes = task.scenes(contexts)
    rides = task.simulator(scenes, keep_rebounds=True)
    rides.wait()
    actions = land_parallel.Agent(problem).plan(task.masked(scenes, rides.flights), rides.flights).astype(float)
    rides.hop(task.spins(scenes, actions, np.zeros(60, int)))
    first = rides.descents().rebounds[:, 0]
    turns = []
    for vertices, row, start in zip(scenes.grounds(), first, scenes.launches, strict=True):
        x, y = vertices["x"], vertices["y"]
        slopes = np.r_[0.0, np.diff(y) / np.diff(x), 0.0]
        pitch = np.arctan(slopes[np.searchsorted(x, row["x_contact"])])
        landed = start[2] + row["t_touchdown"] * row["omega_before"]
        turns.append(abs(turned(landed - pitch)))
    assert np.median(turns) < 0.02


@pytest.mark.parametrize("scenario", [own_scenario("ice_drop"), ride_over_bumps()], ids=["plane", "bumps"])
def test_the_lookahead_of_replan_predicts_what_its_model_earns(scenario):
    """Oracle: the ride itself, trimmed twice, whose ledger knows everything, wherever all ground ahead is seen."""
    problem = Problem(scenario, "descent")
    task, contexts = problem.task, problem.contexts("test", 40)
    agent = replan.Agent(problem, [5])
    rides = task.rides(task.scenes(contexts))
    rides.hop(np.full(40, 0.3))
    running = np.flatnonzero(rides.flights["status"] == RUNNING)
    flights = rides.flights[running]
    scenes = task.masked(rides.scenes.take(running), flights)
    spins = np.linspace(-1.0, 1.0, 40)
    tried = spins[running, np.newaxis] / task.scenario.rider.trim_rad_s
    predicted = agent.predicted(scenes, flights, tried)[:, 0]
    while (rides.flights["status"] == RUNNING).any():
        rides.hop(spins)
    apart = np.abs(predicted - rides.descents(running).jam.reward)
    assert len(running) > 15
    assert np.median(apart) < 1e-7
    assert np.quantile(apart, 0.9) < 1e-6


def test_replan_rates_a_spin_by_the_best_that_can_follow():
    """Oracle: the rides themselves, with each of three spins in the flight behind, which goes on to the end."""
    problem = Problem(ride_over_bumps(), "descent")
    task, contexts, follow = problem.task, problem.contexts("test", 40), (-1.0, 0.0, 1.0)
    rides = task.rides(task.scenes(contexts))
    rides.hop(np.full(40, 0.3))
    running = np.flatnonzero(rides.flights["status"] == RUNNING)
    flights = rides.flights[running]
    scenes = task.masked(rides.scenes.take(running), flights)
    tried = np.full((len(running), 1), 0.5)
    agent = replan.Agent(problem, [1, 3])
    predicted = agent.predicted(scenes, flights, tried)[:, 0]
    earned = []
    for second in follow:
        rest = rides.take(running)
        rest.hop(np.full(len(running), 0.5))
        while (rest.flights["status"] == RUNNING).any():
            rest.hop(np.full(len(running), second))
        earned.append(rest.descents().jam.reward)
    assert (np.ptp(earned, axis=0) > 1e-3).sum() > 5
    assert np.median(np.abs(predicted - np.max(earned, axis=0))) < 1e-7


def test_a_critic_tells_what_follows_behind_the_lookahead(monkeypatch):
    """Oracle: the rides themselves, one spin further, and what is seen of them there; the critic rates the way left."""
    problem = Problem(ride_over_bumps(), "descent")
    task, contexts = problem.task, problem.contexts("test", 40)
    left = task.observation_names.index("left")
    shown = []

    class Critic:
        def expected(self, observations):
            shown.append(observations)
            return 0.25 * observations[:, left]

    rides = task.rides(task.scenes(contexts))
    scenes = task.masked(rides.scenes, rides.flights)
    monkeypatch.setattr(replan, "load_run", lambda run: (problem, Critic(), {}))
    agent = replan.Agent(problem, [1], "{scenario}-critic")
    predicted = agent.predicted(scenes, rides.flights, np.full((40, 1), 0.5))[:, 0]
    rides.hop(np.full(40, 0.5))
    running = np.flatnonzero(rides.flights["status"] == RUNNING)
    seen = task.observe(rides.scenes.take(running), rides.flights[running])
    earned = rides.descents().jam.reward
    earned[running] += 0.25 * seen[:, left]
    assert 10 < len(running) < 40
    assert np.median(np.abs(predicted - earned)) < 1e-6
    # What lies further ahead than the eighth vertex was not seen before.
    near = slice(SEEN, task.observation_names.index("ahead_4_x"))
    assert np.median(np.abs(shown[0][:, near] - seen[:, near])) < 1e-6


def test_replan_takes_a_critic_of_rides_by_the_name_of_its_run():
    problem = Problem("sled_kickers", "descent")
    contexts = problem.contexts("test", 4)
    given = {"spins": [9], "critic": "{scenario}-descent-trim-critic-s0"}
    assert (problem.judge(replan.Agent(problem, **given), contexts)[0].jam.reward > 0.0).all()
    with pytest.raises(ValueError, match="must be 'descent' for a critic of rides"):
        replan.Agent(problem, [9], "sled_mat-launch-spin-critic-s0")


def test_replan_counts_on_the_errors_of_an_unsteady_rider():
    """Oracle: rides with many errors of the first trim, which then lend the same; who expects none earns less."""
    means = []
    unsteady = Problem(ride_over_bumps(noise_rad_s=0.4), "descent")
    contexts = unsteady.contexts("test", 24)
    errors = 0.4 * ndtri((np.arange(16) + 0.5) / 16)
    for problem in (unsteady, Problem(ride_over_bumps(), "descent")):
        task, agent = problem.task, replan.Agent(problem, [21])
        rides = task.rides(task.scenes(contexts))
        trims = agent.plan(task.masked(rides.scenes, rides.flights), rides.flights)[:, 0].astype(float)
        rides = rides.take(np.repeat(np.arange(24), 16))
        spins = np.repeat(trims, 16) + np.tile(errors, 24)
        while (rides.flights["status"] == RUNNING).any():
            rides.hop(spins)
        means.append(rides.descents().jam.reward.mean())
    assert means[0] > means[1] + 0.02


def test_replan_does_nothing_once_a_ride_has_passed_the_line():
    """Oracle: what it does in the other lanes alone."""
    problem = Problem(ride_over_bumps(), "descent")
    task, contexts = problem.task, problem.contexts("test", 4)
    rides = task.rides(task.scenes(contexts))
    flights = rides.flights.copy()
    flights["x"][1] = task.scenario.slope_section.length_m + 1.0
    scenes, agent = task.masked(rides.scenes, flights), replan.Agent(problem, [5])
    found = agent.plan(scenes, flights)
    assert found[1, 0] == 0.0
    others = np.array([0, 2, 3])
    np.testing.assert_array_equal(found[others], agent.plan(scenes.take(others), flights[others]))
    assert not agent.plan(scenes.take(slice(1, 2)), flights[1:2]).any()
