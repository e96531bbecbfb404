"""The script of the page on gradients."""

from __future__ import annotations

import numpy as np
import pytest

from examples.gradients import (
    COARSE,
    ERROR,
    GRID,
    STEP,
    TRIMS,
    estimates,
    first_flights,
    impact,
    land_parallel,
    path_derivative,
    reward,
    smoothed,
)
from sledenv import State, load_scenario, sensitivity
from sledenv.agents.land_parallel import Agent
from sledenv.agents.scan import changed
from sledenv.benchmark.problem import Problem


@pytest.fixture(scope="module")
def begun():
    """Two contexts, each where its first trim is chosen."""
    return first_flights(2)


def spin_after(begun, spins):
    return impact(begun, spins)["omega_after"]


def test_the_errors_are_those_of_the_scenario():
    rider = load_scenario("sled_rollers").rider
    assert (rider.noise_rad_s, rider.trim_rad_s) == (ERROR, 1.0)


def test_the_rule_is_that_of_the_agent(begun):
    """Oracle: the agent, whose trims are float32."""
    rides = begun.take(np.repeat([0, 1], 40))
    for spins in (np.tile(np.linspace(-1.0, 1.0, 40), 2), np.zeros(80)):
        trims = Agent(Problem("sled_rollers", "descent")).plan(rides.scenes, rides.flights)
        np.testing.assert_allclose(land_parallel(rides), trims[:, 0], atol=1e-6)
        rides.hop(spins)


def test_a_ride_earns_what_the_agent_earns(begun):
    """Oracle: the ride of the agent where the spin that it lends first is asked for."""
    problem = Problem(changed(load_scenario("sled_rollers"), 1.0, 1.0, None, 0.0), "descent")
    batch, trims = problem.ride(Agent(problem), problem.drawn(problem.contexts("test", 2), "test"))
    np.testing.assert_allclose(reward(begun, trims[:, 0]), batch.jam.reward, atol=1e-4)


def test_the_derivative_of_one_impact_is_exact(begun):
    """Oracle: :func:`sledenv.sensitivity`, which extrapolates differences of descents launched where the flight begins.

    A spin that is lent first is a spin of the launch. Of the difference 3e-5 is rounding over its step.
    """
    task = Problem("sled_rollers", "descent").task
    spins = np.array([[-0.93, -0.31, 0.17], [-0.6, 0.23, 0.81]])
    found = path_derivative(spin_after, begun, spins)
    for lane, given in enumerate(spins):
        body, law, slope, _ = task.scenario.given_in(begun.scenes.take([lane]))
        flight = begun.flights[lane]
        for spin, derivative in zip(given, found[lane], strict=True):
            launch = State(*(float(flight[name]) for name in State._fields[:5]), float(flight["omega"] + spin))
            exact = sensitivity(body, law, slope, launch, task.settings, parameters=["omega"], rebounds=1)
            assert derivative == pytest.approx(exact.rebounds[0, -1, 0], rel=1e-5, abs=3e-5)
    assert np.ptp(found) > 10.0


def test_means_over_errors_have_their_closed_forms():
    """Of a wave, and of a step: no path sees that, and the derivative of its mean is the density of the error."""
    mean, derivative = smoothed(np.array([np.sin(3.0 * GRID), GRID > 0.2]), GRID)
    less = np.exp(-0.5 * (3.0 * ERROR) ** 2)
    np.testing.assert_allclose(mean[0], less * np.sin(3.0 * TRIMS), atol=1e-6)
    np.testing.assert_allclose(derivative[0], 3.0 * less * np.cos(3.0 * TRIMS), atol=1e-5)
    density = np.exp(-0.5 * ((TRIMS - 0.2) / ERROR) ** 2) / (np.sqrt(2.0 * np.pi) * ERROR)
    np.testing.assert_allclose(derivative[1], density, atol=0.05)


def test_which_estimates_are_unbiased():
    """Oracle: closed forms of the derivative of the mean, of a wave and of a step."""
    errors = np.random.default_rng(0).normal(0.0, ERROR, (4000, 64))
    spins = 0.2 + errors
    wave = estimates(np.sin(3.0 * spins), 3.0 * np.cos(3.0 * spins), errors)
    step = estimates(1.0 * (errors > 0.0) + 0.1 * spins, np.full(errors.shape, 0.1), errors)
    truths = 3.0 * np.exp(-0.5 * (3.0 * ERROR) ** 2) * np.cos(0.6), 0.1 + 1.0 / (np.sqrt(2.0 * np.pi) * ERROR)

    def off(found, truth):
        return abs(found.mean() - truth) / (found.std() / np.sqrt(found.size))

    assert off(wave["likelihood ratio"], truths[0]) < 4.0
    assert off(wave["pathwise"], truths[0]) < 4.0
    assert wave["mixed by variance"].std() < 0.3 * wave["likelihood ratio"].std()
    assert off(step["likelihood ratio"], truths[1]) < 4.0
    np.testing.assert_allclose(step["pathwise"], 0.1)
    # No variance: all of it is believed, or as much as one standard error of the likelihood ratio allows.
    np.testing.assert_allclose(step["mixed by variance"], 0.1)
    assert np.all(step["mixed, bounded"] < step["likelihood ratio"])
    assert step["mixed, bounded"].mean() > 0.7 * truths[1]


def test_of_rides_the_likelihood_ratio_is_unbiased_and_the_path_derivative_is_not(begun):
    """Oracle: the derivative of the mean on a dense grid of rides."""
    alone = begun.take([1])
    truth = smoothed(reward(alone, GRID[np.newaxis]), GRID, np.array([-0.8]))[1][0, 0]
    errors = np.random.default_rng(1).normal(0.0, ERROR, (1, 1500))
    earned, slopes = (of(alone, errors - 0.8) for of in (reward, lambda *given: path_derivative(reward, *given)))
    found = estimates(earned, slopes, errors)
    spread = np.std((earned - earned.mean()) * errors / ERROR**2) / np.sqrt(errors.size)
    assert truth > 3.0
    assert abs(found["likelihood ratio"][0] - truth) < 4.0 * spread < 0.3 * truth
    assert abs(found["pathwise"][0]) < 0.3 * truth


def test_no_difference_is_taken_over_a_jump():
    """Of a step with a slope, at places nearer to it than the step of a difference."""
    spins = np.array([[-0.4 * STEP, 0.3 * STEP, COARSE[0]]])
    found = path_derivative(lambda _, spin: 0.5 * spin + (spin > 0.0), None, spins)
    np.testing.assert_allclose(found, 0.5, rtol=1e-6)
