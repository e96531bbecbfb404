"""Launches told by their first touch, against the first rebound of the simulated descent."""

import numpy as np
import pytest

from sledenv.benchmark.landing import Landing, fall_time
from sledenv.benchmark.problem import Problem
from sledenv.scenarios.scenario import Scenario, load_scenario
from tests.own_scenarios import own_scenario

TURN = 2.0 * np.pi


def slab() -> Scenario:
    """A shipped scenario with a polygon for a body."""
    content = load_scenario(own_scenario("brake_mat")).model_dump(by_alias=True)
    points = [[0.0, 0.0], [0.8, 0.0], [0.8, 0.6], [0.1, 0.7]]
    return Scenario.model_validate(content | {"body": {"kind": "polygon", "mass_kg": 100, "points_m": points}})


@pytest.mark.parametrize(
    ("scenario", "control"),
    [
        (own_scenario("brake_mat"), "both"),
        (own_scenario("round_talus"), "both"),
        (own_scenario("spinning_entry"), "orientation"),
        pytest.param(slab(), "both", id="slab-both"),
    ],
)
def test_a_launch_lands_in_the_pose_that_told_it(scenario, control):
    """Oracle: the first rebound of the simulator; what misses touches earlier, in another pose on the way."""
    problem = Problem(scenario, control=control, solver="rigid")
    landing, task = Landing(problem), problem.task
    contexts = problem.contexts("validation", 2000)
    landings = np.random.default_rng(0).uniform(-1.0, 1.0, (len(contexts), problem.actions))
    launches = landing.launches(contexts, landings)
    assert np.abs(launches).max() <= 1.0
    np.testing.assert_array_equal(launches[:, 1:], landings[:, 1:])
    scenes = task.aimed(task.scenes(contexts), launches)
    states, first = scenes.launches, task.descend(scenes, keep_rebounds=True).rebounds[:, 0]
    off = first["phi"] - np.pi * landings[:, 0]
    lands = np.abs(off - TURN * np.rint(off / TURN)) < 1e-9
    time = landing.flight_time(contexts, np.pi * landings[:, 0], lambda _: states[:, 5])
    np.testing.assert_allclose(first["t"][lands], time[lands], rtol=1e-12)
    assert (first["t"][~lands] < time[~lands]).all()
    assert lands.mean() > 0.99


def test_the_mirror_image_of_a_landing_is_that_of_its_launch():
    problem = Problem(own_scenario("ice_drop"))
    contexts = problem.contexts("test", 50)
    landings = np.random.default_rng(1).uniform(-1.0, 1.0, (50, 2))
    landings[:, 1] = 0.0  # a spin of 7.5 rad/s, in the middle of its bounds
    launches = Landing(problem).launches(contexts, landings)
    turned = Problem(own_scenario("brake_mat"))  # has the mirrored spin, and the same body and gravity
    spin = np.full(50, 7.5 / 8.0)
    here = Landing(turned).launches(contexts, np.stack([landings[:, 0], spin], axis=1))
    there = Landing(turned).launches(contexts, np.stack([-landings[:, 0], -spin], axis=1))
    np.testing.assert_allclose(here[:, 0], launches[:, 0], atol=1e-12)
    np.testing.assert_allclose(there[:, 0], -here[:, 0], atol=1e-12)


@pytest.mark.parametrize("control", ["orientation+speed", "all"])
def test_a_speed_along_the_slope_leaves_the_landing_as_it_is(control):
    """Oracle: the same launches without a choice of the speed."""
    content = load_scenario(own_scenario("brake_mat")).model_dump(by_alias=True)
    content["control"]["speed_m_s"] = (2.0, 8.0)
    problem = Problem(Scenario.model_validate(content), control=control)
    without = Problem(own_scenario("brake_mat"), control=control.removesuffix("+speed"))
    contexts = problem.contexts("test", 50)
    landings = np.random.default_rng(2).uniform(-1.0, 1.0, (50, problem.actions))
    launches = Landing(problem).launches(contexts, landings)
    np.testing.assert_array_equal(launches[:, :-1], Landing(without).launches(contexts, landings[:, :-1]))
    np.testing.assert_array_equal(launches[:, -1], landings[:, -1])


@pytest.mark.parametrize("control", ["spin", "orientation"])
def test_what_is_not_free_to_turn_is_told_by_its_launch(control):
    problem = Problem(own_scenario("ice_drop"), control=control)
    if control == "orientation":
        narrow = problem.scenario.model_copy(
            update={"control": problem.scenario.control.model_copy(update={"orientation_deg": (-90.0, 90.0)})}
        )
        problem = Problem(narrow, control=control)
    landings = np.linspace(-1.0, 1.0, 8)[:, np.newaxis]
    np.testing.assert_array_equal(Landing(problem).launches(problem.contexts("test", 8), landings), landings)


def test_the_time_of_a_fall_solves_its_equation():
    """Oracle: height = fall t + G t^2 / 2, and what is not above the ground has fallen already."""
    height, fall = np.array([0.0, 0.5, 2.0, 1.0, -1.0]), np.array([1.0, 0.0, 3.0, -2.0, 1.0])
    time = fall_time(height, fall, np.full(5, 9.81))
    np.testing.assert_allclose(fall * time + 0.5 * 9.81 * time**2, np.maximum(height, 0.0), atol=1e-14)
    assert (time >= 0.0).all()
    assert fall_time(np.ones(1), np.zeros(1), np.zeros(1)) == 0.0  # neither speed nor gravity
