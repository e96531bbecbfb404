"""A run-out behind the finish: the descent is judged at the finish, and a fall behind it keeps nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sledenv
from sledenv import ContactLaw, Settings, Slope, State, simulate, simulate_batch
from sledenv.simulation.scene import Zone
from sledenv.simulation.support import support_height

DISC = sledenv.segment(1.0, 0.1, 0.05, 7.5e-3)
SLED = sledenv.sled()
LAW = ContactLaw.from_restitution(0.4, stiffness=1e6, friction=0.08, rolling_arm=1e-3)
SLOPE = Slope(0.12, 6.0)
SOLVERS = ("compliant", "rigid")


def launches(body: sledenv.Body, count: int = 40) -> list[State]:
    rng = np.random.default_rng(5)
    given = []
    for _ in range(count):
        phi = rng.uniform(-0.8, 0.8)
        y = support_height(body, phi) + rng.uniform(0.0, 0.6)
        given.append(State(0.0, y, phi, rng.uniform(2.0, 7.0), 0.0, rng.uniform(-3.0, 3.0)))
    return given


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("body", [DISC, SLED], ids=["disc", "sled"])
def test_up_to_the_line_it_is_the_descent_without_a_run_out(body: sledenv.Body, solver: str) -> None:
    settings = Settings(solver=solver, max_rebounds=400)
    judged = 0
    for launch in launches(body):
        short, long = (simulate(body, LAW, SLOPE, launch, settings, run_out=run_out) for run_out in (0.0, 3.0))
        assert short.at_line == long.at_line
        if short.status != "finish":
            assert (short.status, short.time, short.state) == (long.status, long.time, long.state)
            assert short.at_line is None
            continue
        judged += 1
        assert short.at_line == (short.time, short.state.u)
        count = len(short.rebounds) - 1  # the last contact may be the one in which it passes the line
        assert short.rebounds[:count].tobytes() == long.rebounds[:count].tobytes()
        assert long.time >= short.time
        assert long.energy.supplied == pytest.approx(short.energy.supplied, rel=1e-14)
        assert long.jam.progress == 1.0
        assert long.jam.retention == short.jam.retention  # nothing falls here: no part of the body is told to
        assert abs(long.energy.residual) < 1e-10 * long.energy.turnover
    assert judged > 10


@pytest.mark.parametrize("solver", SOLVERS)
def test_it_goes_on_as_a_longer_slope_does(solver: str) -> None:
    """The line changes nothing: the descent ends where one on a slope as long as both does, up to rounding."""
    longer = SLOPE._replace(length=SLOPE.length + 3.0)
    same = 0
    for launch in launches(DISC):
        with_line = simulate(DISC, LAW, SLOPE, launch, solver=solver, run_out=3.0)
        without = simulate(DISC, LAW, longer, launch, solver=solver)
        if len(with_line.rebounds) > 15:  # rounding grows from rebound to rebound
            continue
        same += 1
        assert with_line.status == without.status
        np.testing.assert_allclose(with_line.state, without.state, rtol=1e-6, atol=1e-7)
    assert same > 10


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_crash_in_the_run_out_keeps_nothing(solver: str) -> None:
    given = [launch._replace(omega=3.0 * launch.omega) for launch in launches(SLED, 300)]
    options = {"solver": solver, "end_touching": "rider"}
    slope = Slope(0.12, 2.0)
    short = simulate_batch(SLED, LAW, slope, given, Settings(**options))
    long = simulate_batch(SLED, LAW, slope, given, Settings(**options, run_out=6.0))
    crashed = (short.status == "finish") & (long.status == "tumbled")
    assert crashed.any()
    assert (long.outcomes["x"][crashed] > slope.length).all()
    assert (long.jam.retention[crashed] == 0.0).all()
    assert (long.jam.reward[crashed] == 0.5).all()
    safe = (short.status == "finish") & ~crashed
    np.testing.assert_array_equal(long.jam.reward[safe], short.jam.reward[safe])
    np.testing.assert_array_equal(long.outcomes["t_line"][safe], short.outcomes["t"][safe])


def test_a_sliding_block_stops_in_the_run_out() -> None:
    """It has passed the finish, and does not fall: what it had there counts."""
    block = sledenv.polygon(2.0, [(-0.5, -0.1), (0.5, -0.1), (0.5, 0.1), (-0.5, 0.1)])
    law = ContactLaw.from_restitution(0.3, stiffness=1e8, friction=0.05, rolling_arm=0.0)
    slope = Slope(0.1, 6.0, 9.81, [Zone(5.5, math.inf, 0.4, 0.0)])
    start = State(0.0, 0.1, 0.0, 3.0)
    stopped = simulate(block, law, slope, start, solver="rigid", run_out=100.0)
    assert stopped.status == "jammed"
    assert stopped.at_line is not None
    assert stopped.jam.reward > 0.8
    assert 6.0 < stopped.state.x < 106.0
    descent = simulate(block, law, Slope(0.1, 6.0), start, solver="rigid", run_out=100.0)
    pull = 9.81 * (math.sin(0.1) - 0.05 * math.cos(0.1))
    speed = math.sqrt(9.0 + 2.0 * pull * 6.0)
    assert descent.at_line == pytest.approx((2.0 * 6.0 / (3.0 + speed), speed), rel=1e-10)
    assert descent.status == "finish"
    assert descent.state.x == 106.0
