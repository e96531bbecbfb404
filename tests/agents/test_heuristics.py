"""Agents that know some mechanics, and searches for linear policies: what they promise, and what they cost."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from sledenv import load_scenario
from sledenv.agents import cma_es, land_flat, linear, no_trim, ppo, random_search, random_trim, replan
from sledenv.benchmark.problem import Problem
from sledenv.envs.task import Task
from sledenv.scenarios.scenario import Scenario
from tests.own_scenarios import own_scenario

CONTROLS = ["both", "orientation", "spin"]
SEARCHES = {
    "random_search": (random_search.Agent, {"n_timesteps": 1000, "contexts": 10, "scales": [0.5, 2.0]}),
    "cma_es": (
        cma_es.Agent,
        {
            **{"n_timesteps": 1000, "restarts": 2, "popsize": 8, "contexts": 10, "validation": 20},
            **{"scale": 0.3, "sigma0": 0.5},
        },
    ),
}
TRIMS = {"n_timesteps": 400, "contexts": 20}
LOOKAHEAD = {"cells": 300, "trims": 5}


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


def test_flights_come_back_from_what_is_seen_of_them():
    """Oracle: the rides themselves, at their rebounds; the height follows from touching."""
    task = Task(own_scenario("ice_drop"))
    contexts = task.scenario.contexts(np.random.default_rng(1).random((40, 11)))
    rides = task.rides(contexts, task.launches(contexts, np.random.default_rng(2).uniform(-1, 1, (40, 2))))
    rides.hop(np.zeros(40))
    rides.hop(np.full(40, 1.5))
    flights = rides.outcomes()
    flights = flights[flights["status"] == 0]
    assert len(flights) > 20
    observed = np.hstack([np.zeros((len(flights), 11), np.float32), task.observe_flights(flights)])
    states, lent = task.flights_seen(observed)
    for i, name in enumerate(("x", "y", "phi", "u", "v", "omega")):
        meant = turned(flights["phi"]) if name == "phi" else flights[name]
        assert states[:, i] == pytest.approx(meant, abs=5e-6)
    assert lent == pytest.approx(1.5, abs=1e-6)


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


@pytest.mark.parametrize("control", CONTROLS)
def test_a_linear_policy_reaches_all_orientations_and_stays_in_the_box(control):
    task = Problem(own_scenario("brake_mat"), control=control).task
    weights = np.random.default_rng(0).normal(0.0, 3.0, (400, linear.size(task)))
    observations = np.random.default_rng(1).uniform(-1, 1, (20, 11)).astype(np.float32)
    actions = linear.actions(task, weights, observations)
    assert actions.shape == (400, 20, len(task.controlled))
    assert (np.abs(actions) <= 1.0).all()
    assert (np.histogram(actions[..., 0], 8, (-1.0, 1.0))[0] > 0).all()
    assert not linear.actions(task, np.zeros((1, linear.size(task))), observations).any()


@pytest.mark.parametrize("algo", sorted(SEARCHES))
@pytest.mark.parametrize("control", CONTROLS)
def test_a_search_keeps_to_its_budget_repeats_by_seed_and_loads(algo, control, tmp_path, monkeypatch):
    """Oracle: the descents that the problem simulates, counted where it does so."""
    agent, settings = SEARCHES[algo]
    problem = Problem(own_scenario("ice_drop"), control=control)
    descend, counted = Problem.descend, []
    monkeypatch.setattr(Problem, "descend", lambda self, c, a: counted.append(len(c)) or descend(self, c, a))
    first = agent.train(problem, settings, 3, tmp_path)
    assert 0.8 * settings["n_timesteps"] <= sum(counted) <= settings["n_timesteps"]
    assert np.array_equal(agent.load(problem, tmp_path).weights, first.weights)
    assert np.array_equal(agent.train(problem, settings, 3, tmp_path).weights, first.weights)
    assert not np.array_equal(agent.train(problem, settings, 4, tmp_path).weights, first.weights)


def test_cma_es_improves_on_where_it_starts(tmp_path):
    """Oracle: the policy without weights, upright and without spin, which a rough mat stops."""
    problem = Problem(own_scenario("brake_mat"))
    settings = SEARCHES["cma_es"][1] | {"n_timesteps": 6000, "restarts": 1}
    agent = cma_es.Agent.train(problem, settings, 0, tmp_path)
    contexts = problem.contexts("test", 60)
    start = linear.Linear(problem, np.zeros(linear.size(problem.task)))
    found, upright = (problem.judge(each, contexts)[0].jam.reward.mean() for each in (agent, start))
    assert found > upright + 0.15


def test_no_trim_earns_what_its_launch_earns_alone_and_random_trims_do_not(tmp_path):
    """Oracle: the same launch in the problem of one step, bit for bit."""
    problem = Problem(own_scenario("brake_mat"), "descent")
    contexts = problem.contexts("test", 30)
    still, wild = (agent.train(problem, TRIMS, 0, tmp_path) for agent in (no_trim.Agent, random_trim.Agent))
    batch, launches = problem.judge(still, contexts)
    alone = Problem(own_scenario("brake_mat")).descend(contexts, launches).jam.reward
    assert np.array_equal(batch.jam.reward, alone)
    other, same = problem.judge(wild, contexts)
    assert np.array_equal(same, launches)
    assert not np.array_equal(other.jam.reward, alone)
    again = problem.judge(random_trim.Agent.load(problem, tmp_path), contexts)[0].jam.reward
    assert np.array_equal(again, other.jam.reward)


def test_replan_earns_more_with_trims_than_its_launches_do_without():
    """Oracle: the same launches without trims, on a rough mat where trims matter."""
    problem = Problem(own_scenario("brake_mat"), "descent")
    contexts = problem.contexts("test", 30)
    agent = replan.Agent(problem, LOOKAHEAD)
    batch, launches = problem.judge(agent, contexts)
    alone = Problem(own_scenario("brake_mat")).descend(contexts, launches).jam.reward
    assert batch.jam.reward.mean() > alone.mean() + 0.02


def test_the_lookahead_of_replan_predicts_what_its_model_earns():
    """Oracle: a ride, trimmed once, whose ledger knows everything; launched upright without spin."""
    problem = Problem(own_scenario("ice_drop"), "descent")
    task = Task(own_scenario("ice_drop"))
    agent = replan.Agent(problem, LOOKAHEAD)
    contexts = problem.contexts("test", 20)
    rides = task.rides(contexts, task.launches(contexts, np.zeros((20, 2))))
    rides.hop(np.zeros(20))
    observed = np.hstack([task.observe(contexts), task.observe_flights(rides.outcomes())])
    trims = np.linspace(-2.0, 2.0, 20)
    states, lent = task.flights_seen(observed)
    predicted = agent._predicted(task.contexts_seen(observed), states, lent, trims)
    while (rides.outcomes()["status"] == 0).any():
        rides.hop(trims)
    earned = rides.descents().jam.reward
    assert np.median(np.abs(predicted - earned)) < 0.01


@pytest.mark.filterwarnings("ignore")  # of torch, tensorboard and rich, which this project does not own
def test_the_likelihood_of_ppo_counts_only_what_acts(tmp_path):
    """Oracle: before the launch the trim, and afterwards the launch, may be anything."""
    settings = {"n_timesteps": 64, "policy": "MlpPolicy", "n_envs": 8, "n_steps": 8, "batch_size": 64, "n_epochs": 1}
    agent = ppo.Agent.train(Problem(own_scenario("brake_mat"), "descent"), settings, 0, tmp_path)
    before = torch.zeros(2, 20)
    after = before + torch.eye(20)[13]  # a cosine of 1
    launches, trims = torch.tensor([[0.5, 0.2, 0.1], [0.1, 0.3, 0.1]]), torch.tensor([[0.5, 0.2, 0.1], [0.5, 0.2, 0.6]])
    for observed, same, other in ((before, trims, launches), (after, launches, trims)):
        (one, two), (three, four) = (agent.model.policy.evaluate_actions(observed, acts)[1] for acts in (same, other))
        assert one == two
        assert three != four
