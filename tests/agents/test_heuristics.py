"""Agents that know some mechanics: what they promise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtri

from sledenv import load_scenario
from sledenv.agents import land_flat, land_parallel, replan, zero
from sledenv.benchmark.problem import Problem
from sledenv.scenarios.scenario import Scenario
from sledenv.simulation.records import RUNNING
from tests.own_scenarios import own_scenario, ride_over_bumps


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
