"""Agents that know some mechanics: what they promise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtri

from sledenv import load_scenario
from sledenv.agents import land_flat, land_parallel, replan, replan_critic, zero
from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import SEEN
from sledenv.envs.task import FLIGHT, VERTEX, Task
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


def first_touch(problem: Problem, contexts: np.ndarray, launches: np.ndarray) -> np.ndarray:
    """Rebounds of many descents, the first of each."""
    task = problem.task
    return task.descend_batch(contexts, launches, keep_rebounds=True).rebounds[:, 0]


def turned(angle: np.ndarray) -> np.ndarray:
    return np.angle(np.exp(1j * angle))


@pytest.mark.parametrize("control", CONTROLS)
@pytest.mark.parametrize("name", [own_scenario("brake_mat"), own_scenario("ice_drop")])
def test_contexts_come_back_from_what_is_seen_of_them(name, control):
    """Oracle: the contexts that were observed, up to the rounding of float32; a choice is not known."""
    task = Task(name, control)
    contexts = task.scenario.contexts(np.random.default_rng(0).random((50, 11)))
    seen = task.contexts_seen(task.observe(contexts))
    chosen = [i for i, field in enumerate(("orientation", "spin"), 6) if field in task.controlled]
    assert np.isnan(seen[:, chosen]).all()
    known = np.delete(np.arange(11), chosen)
    low, high = task.scenario.ranges
    assert (np.abs(seen - contexts)[:, known] <= 1e-7 * (high - low)[known]).all()


@pytest.mark.parametrize("scenario", [own_scenario("ice_drop"), ride_over_bumps()], ids=["plane", "bumps"])
def test_flights_come_back_from_what_is_seen_of_them(scenario):
    """Oracle: the rides themselves where a flight begins, and the ground around."""
    task = Task(scenario, ride=True)
    contexts = task.scenario.contexts(np.random.default_rng(1).random((40, task.scenario.draws)))
    rides = task.rides(contexts)
    rides.await_flights(np.arange(40))
    rides.hop(np.full(40, 0.5))
    running = rides.outcomes()["status"] == RUNNING
    flights, contexts = rides.outcomes()[running], contexts[running]
    assert len(flights) > 20
    observed = task.observe(contexts, flights)
    seen = task.flights_seen(observed)
    profiles = task.scenario.profiles(contexts)
    profiles = profiles * (len(contexts) if len(profiles) == 1 else 1)
    ground = np.array(
        [
            np.interp(x, *np.array(known).T[:2]) if known else 0.0
            for x, known in zip(flights["x"], profiles, strict=True)
        ]
    )
    meant = [
        flights["x"],
        flights["y"] - ground,
        turned(flights["phi"]),
        *(flights[name] for name in ("u", "v", "omega")),
    ]
    apart = seen.states - np.stack(meant, axis=-1)
    assert np.abs(np.delete(apart, 1, axis=1)).max() < 2e-5
    assert -2e-5 < apart[:, 1].min() <= np.quantile(apart[:, 1], 0.8) < 2e-5  # lifted off ground that is seen no more
    assert seen.lent == pytest.approx(0.5, abs=1e-6)
    assert seen.supplied == pytest.approx(flights["supplied"], rel=1e-6)
    for known, told, level in zip(profiles, seen.profiles, ground, strict=True):
        for x, y, _ in told:
            assert y == pytest.approx(np.interp(x, *np.array(known).T[:2]) - level, abs=2e-5)


def test_land_flat_rolls_onto_a_rough_mat_and_does_not_slip():
    """Oracle: the slip u + (r - h) omega at the first touch of the simulator, where friction holds what slides."""
    launch, contact = {"speed_m_s": [0.5, 2.0], "drop_m": [0.1, 0.2]}, {"friction": [0.25, 0.6]}
    problem = Problem(altered(own_scenario("brake_mat"), launch=launch, contact=contact))
    contexts = problem.contexts("test", 60)
    agent = land_flat.Agent(problem)
    launches = problem.task.launches(contexts, agent.act(problem.task.observe(contexts)).astype(float))
    first = first_touch(problem, contexts, launches)
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
    actions = land_flat.Agent(problem).act(problem.task.observe(contexts)).astype(float)
    launches = problem.task.launches(contexts, actions)
    assert (launches[:, 3] == 4.5).all()
    assert (np.abs(launches[:, 5]) < 8.0).all()  # no spin is cut short
    first = first_touch(problem, contexts, launches)
    touch = first["t"] - first["duration"]
    assert np.abs(turned(launches[:, 2] + launches[:, 5] * touch)).max() < 1e-5


def test_land_flat_mirrors_with_the_disturbance():
    """Oracle: symmetry of the flight; the mirrored spin needs the mirrored pose."""
    problem = Problem(own_scenario("ice_drop"), control="orientation")
    contexts = problem.contexts("test", 30)
    mirrored = contexts.copy()
    mirrored[:, 7] *= -1.0
    agent = land_flat.Agent(problem)
    poses, others = (agent.act(problem.task.observe(each)) for each in (contexts, mirrored))
    assert np.abs(poses).max() > 0.05
    assert others == pytest.approx(-poses, abs=1e-6)


def test_land_flat_without_fall_or_gravity_still_acts():
    for control in CONTROLS:
        problem = Problem(altered(own_scenario("ice_drop"), slope={"gravity_m_s2": 0}), control=control)
        actions = land_flat.Agent(problem).act(problem.task.observe(problem.contexts("test", 5)))
        assert problem.action_space.contains(actions[0])


def test_the_zero_action_earns_what_the_launch_earns_alone():
    """Oracle: the descents of the same launches, bit for bit."""
    problem = Problem(ride_over_bumps(), "descent")
    contexts = problem.contexts("test", 30)
    batch, firsts = problem.judge(zero.Agent(problem), contexts)
    alone = problem.task.descend_batch(contexts, problem.task.launches(contexts)).jam.reward
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
    rides = task.rides(contexts, keep_rebounds=True)
    rides.await_flights(np.arange(60))
    actions = land_parallel.Agent(problem).act(task.observe(contexts, rides.outcomes())).astype(float)
    rides.hop(task.spins(contexts, actions, np.zeros(60, int)))
    first = rides.descents().rebounds[:, 0]
    turns = []
    for profile, row, start in zip(task.scenario.profiles(contexts), first, task.launches(contexts), strict=True):
        x, y, _ = np.array(profile).T
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
    rides = task.rides(contexts)
    rides.await_flights(np.arange(40))
    rides.hop(np.full(40, 0.3))
    running = np.flatnonzero(rides.outcomes()["status"] == RUNNING)
    observed = task.observe(contexts[running], rides.outcomes(running))
    spins = np.linspace(-1.0, 1.0, 40)
    tried = spins[running, np.newaxis] / task.scenario.rider.trim_rad_s
    predicted = agent.predicted(task.contexts_seen(observed), task.flights_seen(observed), tried)[:, 0]
    while (rides.outcomes()["status"] == RUNNING).any():
        rides.hop(spins)
    apart = np.abs(predicted - rides.descents(running).jam.reward)
    assert len(running) > 15
    assert np.median(apart) < 1e-7
    assert np.quantile(apart, 0.9) < 1e-6


def test_replan_rates_a_spin_by_the_best_that_can_follow():
    """Oracle: the rides themselves, with each of three spins in the flight behind, which goes on to the end."""
    problem = Problem(ride_over_bumps(), "descent")
    task, contexts, follow = problem.task, problem.contexts("test", 40), (-1.0, 0.0, 1.0)
    rides = task.rides(contexts)
    rides.await_flights(np.arange(40))
    rides.hop(np.full(40, 0.3))
    running = np.flatnonzero(rides.outcomes()["status"] == RUNNING)
    observed = task.observe(contexts[running], rides.outcomes(running))
    tried = np.full((len(running), 1), 0.5)
    agent = replan.Agent(problem, [1, 3])
    predicted = agent.predicted(task.contexts_seen(observed), task.flights_seen(observed), tried)[:, 0]
    earned = []
    for second in follow:
        rest = rides.take(running)
        rest.hop(np.full(len(running), 0.5))
        while (rest.outcomes()["status"] == RUNNING).any():
            rest.hop(np.full(len(running), second))
        earned.append(rest.descents().jam.reward)
    assert (np.ptp(earned, axis=0) > 1e-3).sum() > 5
    assert np.median(np.abs(predicted - np.max(earned, axis=0))) < 1e-7


def test_a_critic_tells_what_follows_behind_the_lookahead():
    """Oracle: the rides themselves, one spin further, and what is seen of them there; the critic rates the way left."""
    problem = Problem(ride_over_bumps(), "descent")
    task, contexts = problem.task, problem.contexts("test", 40)
    left = SEEN + FLIGHT.index("left")
    shown = []

    class Critic:
        def expected(self, observations):
            shown.append(observations)
            return 0.25 * observations[:, left]

    rides = task.rides(contexts)
    rides.await_flights(np.arange(40))
    observed = task.observe(contexts, rides.outcomes())
    agent = replan_critic.Agent(problem, [1], Critic())
    predicted = agent.predicted(task.contexts_seen(observed), task.flights_seen(observed), np.full((40, 1), 0.5))[:, 0]
    rides.hop(np.full(40, 0.5))
    outcomes = rides.outcomes()
    running = np.flatnonzero(outcomes["status"] == RUNNING)
    seen = task.observe(contexts[running], outcomes[running])
    earned = rides.descents().jam.reward
    earned[running] += 0.25 * seen[:, left]
    assert 10 < len(running) < 40
    assert np.median(np.abs(predicted - earned)) < 1e-6
    flight = slice(SEEN, SEEN + FLIGHT.index("time"))
    assert np.median(np.abs(shown[0][:, flight] - seen[:, flight])) < 1e-6
    near = slice(
        SEEN + len(FLIGHT), SEEN + len(FLIGHT) + 5 * len(VERTEX)
    )  # what lies further ahead was not seen before
    np.testing.assert_allclose(shown[0][:, near], seen[:, near], atol=1e-5)


def test_replan_counts_on_the_errors_of_an_unsteady_rider():
    """Oracle: rides with many errors of the first trim, which then lend the same; who expects none earns less."""
    means = []
    unsteady = Problem(ride_over_bumps(noise_rad_s=0.4), "descent")
    contexts = unsteady.contexts("test", 24)
    errors = 0.4 * ndtri((np.arange(16) + 0.5) / 16)
    for problem in (unsteady, Problem(ride_over_bumps(), "descent")):
        task, agent = problem.task, replan.Agent(problem, [21])
        rides = task.rides(contexts)
        rides.await_flights(np.arange(24))
        trims = agent.act(task.observe(contexts, rides.outcomes()))[:, 0].astype(float)
        rides = rides.take(np.repeat(np.arange(24), 16))
        spins = np.repeat(trims, 16) + np.tile(errors, 24)
        while (rides.outcomes()["status"] == RUNNING).any():
            rides.hop(spins)
        means.append(rides.descents().jam.reward.mean())
    assert means[0] > means[1] + 0.02


def test_replan_does_nothing_once_a_ride_has_passed_the_line():
    """Oracle: what it does in the other lanes alone."""
    problem = Problem(ride_over_bumps(), "descent")
    task, contexts = problem.task, problem.contexts("test", 4)
    rides = task.rides(contexts)
    rides.await_flights(np.arange(4))
    flights = rides.outcomes()
    flights["x"][1] = task.scenario.slope_section.length_m + 1.0
    observed, agent = task.observe(contexts, flights), replan.Agent(problem, [5])
    found = agent.act(observed)
    assert found[1, 0] == 0.0
    np.testing.assert_array_equal(found[[0, 2, 3]], agent.act(observed[[0, 2, 3]]))
    assert not agent.act(observed[1:2]).any()
