"""Drag of the air against closed forms, an integrator that knows nothing of series, and the energy that is lost."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from sledenv.simulation.bodies import Body
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.ride import Ride
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Settings
from sledenv.simulation.shapes import disc, polygon, rod
from sledenv.simulation.simulate import simulate
from sledenv.simulation.sleds import sled

G = 9.81
AREA, DENSITY = 0.05, 1.2
BALL = disc(2.0, 0.1).replace(drag_area=AREA)
RATE = 0.5 * DENSITY * AREA / 2.0  # [1/m]
TERMINAL = math.sqrt(G / RATE)
LEVEL = Slope(0.0, air_density=DENSITY)
LAW = ContactLaw(1e6, 0.5, 0.1, 1e-4)
EXACT = pytest.approx


def after(time: float, launch: State, body: Body = BALL, slope: Slope = LEVEL, **options: Any) -> Descent:
    """A descent up to a time, without a rebound before."""
    return simulate(body, LAW, slope, launch, max_time=time, **options)


@pytest.mark.parametrize("time", [1e-4, 0.3, 5.0, 60.0])
def test_a_fall_from_rest_follows_the_hyperbolic_tangent(time):
    """Oracle: v = V tanh(g t / V) and its integral; the drag is left out while it is too faint for a series."""
    fallen = TERMINAL**2 / G * math.log(math.cosh(G * time / TERMINAL))
    end = after(time, State(0.0, 3000.0, 0.0)).state
    assert end.v == EXACT(-TERMINAL * math.tanh(G * time / TERMINAL), rel=1e-12)
    assert 3000.0 - end.y == EXACT(fallen, rel=1e-12, abs=1e-12)


def test_a_launch_upward_follows_the_tangent_and_turns_where_the_speed_is_zero():
    """Oracle: v = V tan(arctan(v0 / V) - g t / V) up to the top, whose time and height are known."""
    up = 60.0
    top = TERMINAL / G * math.atan(up / TERMINAL)
    height = TERMINAL**2 / (2.0 * G) * math.log1p((up / TERMINAL) ** 2)
    for time in (0.3 * top, 0.9 * top):
        end = after(time, State(0.0, 1000.0, 0.0, 0.0, up)).state
        assert end.v == EXACT(TERMINAL * math.tan(math.atan(up / TERMINAL) - G * time / TERMINAL), rel=1e-12)
    end = after(top + 2.0, State(0.0, 1000.0, 0.0, 0.0, up)).state
    assert end.v == EXACT(-TERMINAL * math.tanh(G * 2.0 / TERMINAL), rel=1e-11)
    assert end.y - 1000.0 == EXACT(height - TERMINAL**2 / G * math.log(math.cosh(G * 2.0 / TERMINAL)), rel=1e-11)


def test_a_slide_up_a_slope_follows_the_tangent_until_it_stops():
    """Oracle: u = U tan(arctan(u0 / U) - a t / U), with the deceleration a of gravity and friction and U^2 = a / k."""
    angle, friction, speed = 0.1, 0.3, 20.0
    plate, law = rod(5.0, 1.0, 0.1).replace(drag_area=AREA), ContactLaw(1e6, 0.5, friction, 0.0)
    slope, launch = Slope(-angle, air_density=1.2), State(0.0, 0.05, 0.0, speed)
    rate = 0.5 * 1.2 * AREA / 5.0
    slows = G * (math.sin(angle) + friction * math.cos(angle))
    scale = math.sqrt(slows / rate)
    stops = scale / slows * math.atan(speed / scale)
    for time in (0.2 * stops, 0.8 * stops):
        end = simulate(plate, law, slope, launch, Settings(max_time=time, solver="rigid")).state
        assert end.u == EXACT(scale * math.tan(math.atan(speed / scale) - slows * time / scale), rel=1e-12)
    whole = simulate(plate, law, slope, launch, Settings(solver="rigid"))
    assert whole.status == "jammed"
    assert whole.time == EXACT(stops, rel=1e-9)
    assert whole.state.x == EXACT(math.log1p((speed / scale) ** 2) / (2.0 * rate), rel=1e-9)


@pytest.mark.parametrize("area", [1e-3, 0.05, 3.0])
def test_an_oblique_flight_is_that_of_an_integrator(area):
    """Oracle: Runge and Kutta of order 8, with tolerances of 1e-13."""
    slope, launch, rate = Slope(0.3, air_density=DENSITY), State(1.0, 80.0, 0.2, 25.0, 9.0, 3.0), 0.15 * DENSITY * area

    def slope_of(_: float, y: np.ndarray) -> list[float]:
        speed = math.hypot(y[2], y[3])
        return [y[2], y[3], G * math.sin(0.3) - rate * speed * y[2], -G * math.cos(0.3) - rate * speed * y[3]]

    body = disc(0.5 * 1.0 / 0.15, 0.1).replace(drag_area=area)
    found = solve_ivp(slope_of, (0.0, 2.5), [1.0, 80.0, 25.0, 9.0], method="DOP853", rtol=1e-13, atol=1e-13)
    end = after(2.5, launch, body, slope).state
    assert [end.x, end.y, end.u, end.v] == EXACT(found.y[:, -1].tolist(), rel=1e-11)
    assert end.omega == 3.0


def test_each_row_tells_what_the_air_has_taken_so_far():
    """Oracle: the energy that is missing at each row of a long flight."""
    slope, launch = Slope(0.3, air_density=DENSITY), State(0.0, 300.0, 0.0, 25.0, 9.0)
    rows = after(3.0, launch, slope=slope, sample_interval=0.1, record="trajectory").trajectory
    high = G * (math.cos(0.3) * rows["y"] - math.sin(0.3) * rows["x"])
    energy = BALL.mass * (0.5 * (rows["u"] ** 2 + rows["v"] ** 2) + high)
    assert rows["drag"] == EXACT(energy[0] - energy, rel=1e-9, abs=1e-9)
    assert rows["drag"][-1] > 10.0


BODIES = {
    "sled": sled(),
    "disc": disc(2.0, 0.1),
    "triangle": polygon(0.5, [(-0.4, -0.1), (0.4, -0.1), (0.1, 0.2)], 0.02),
    "rod": rod(5.0, 1.0, 0.1),
}


@given(
    st.sampled_from(sorted(BODIES)),
    st.floats(-4.0, 1.0),
    st.sampled_from([0.0, 1.2, 1000.0]),
    st.sampled_from(["compliant", "rigid", "profile"]),
    st.floats(0.0, 0.6),
    st.sampled_from([0.0, 0.02, 0.4]),
    st.floats(0.05, 1.0),
    st.integers(0, 2**32 - 1),
)
def test_books_close_and_no_air_takes_nothing(name, area, density, ground, angle, friction, bounce, seed):
    """Oracle: conservation of energy; without air the bits of a body without drag area."""
    rng = np.random.default_rng(seed)
    law = ContactLaw.from_restitution(
        bounce, stiffness=10.0 ** rng.uniform(4.0, 7.5), friction=friction, rolling_arm=1e-3
    )
    vertices = np.column_stack([np.cumsum(rng.uniform(0.5, 2.0, 10)), rng.uniform(-0.2, 0.2, 10)])
    slope = Slope(angle, 30.0, profile=vertices if ground == "profile" else (), rounding=0.5, air_density=density)
    launch = State(
        0.0,
        BODIES[name].size + vertices[:, 1].max() + rng.uniform(0.0, 1.0),
        rng.uniform(-3.0, 3.0),
        *rng.normal(0.0, 8.0, 3),
    )
    settings = Settings(max_time=20.0, solver="rigid" if ground == "rigid" else "compliant")
    found = simulate(BODIES[name].replace(drag_area=10.0**area), law, slope, launch, settings)
    assert found.status not in ("step_budget", "non_finite")
    assert found.energy.drag >= 0.0
    assert abs(found.energy.residual) < 1e-9 * found.energy.turnover
    if density == 0.0:
        assert simulate(BODIES[name], law, slope, launch, settings).outcome == found.outcome


def test_hops_one_after_the_other_are_the_whole_descent():
    """A hop goes back to where a long flight begins: what the air takes there is not booked twice."""
    body, slope, launch = sled().replace(drag_area=0.3), Slope(math.radians(15.0), 60.0), State(0.0, 0.6, 0.1, 8.0)
    whole = simulate(body, LAW, slope, launch)
    hops = Ride(body, LAW, slope, launch, shortest_flight=0.05)
    while hops.hop() == "running":
        pass
    assert hops.descent().outcome == whole.outcome
    assert whole.energy.drag > 0.0
