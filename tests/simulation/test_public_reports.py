"""Faults that users of other engines have reported in public: here each has the right value."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import sledenv
from sledenv import ContactLaw, Slope, State, simulate
from sledenv.simulation import Descent

GRAVITY = 9.81
BALL = sledenv.disc(1.0, 0.1)


def dropped(restitution: float, friction: float = 0.0, u: float = 0.0, omega: float = 0.0, **how: Any) -> Descent:
    """Drop the ball by a metre onto level ground."""
    law = ContactLaw.from_restitution(restitution, stiffness=1e8, friction=friction, rolling_arm=0.0)
    return simulate(BALL, law, Slope(0.0, math.inf), State(0.0, 1.1, 0.0, u, 0.0, omega), **how)


def test_a_polygon_slides_over_a_bend_without_a_jerk() -> None:
    """As reported in https://github.com/erincatto/box2d/issues/341, of edges with ghost vertices.

    Oracle: without friction and losses nothing takes speed along the slope but the slope itself.
    """
    box = sledenv.polygon(10.0, [(-0.3, -0.1), (0.3, -0.1), (0.3, 0.1), (-0.3, 0.1)], 0.01)
    ground = Slope(0.0, 12.0, profile=[(3.0, 0.0), (6.0, -0.3), (9.0, -0.9)])
    law = ContactLaw.from_restitution(1.0, stiffness=1e7, friction=0.0, rolling_arm=0.0)
    done = simulate(box, law, ground, State(0.5, 0.1, 0.0, 3.0, 0.0, 0.0), record="trajectory")
    assert done.status == "finish"
    assert np.min(done.trajectory["u"]) > 3.0 - 1e-4  # all but what the springs give way by
    assert done.energy.hysteresis == pytest.approx(0.0, abs=1e-9 * done.energy.supplied)


def test_an_elastic_ball_never_bounces_higher() -> None:
    """As reported in https://github.com/jrouwe/JoltPhysics/issues/1286. Oracle: the height of the first of 1,000."""
    done = dropped(1.0, max_rebounds=1000, max_time=1e4)
    speed = np.abs(done.rebounds["v_after"])
    assert len(speed) == 1000
    np.testing.assert_allclose(speed, math.sqrt(2.0 * GRAVITY), rtol=1e-9)


def test_no_bounce_absorbs_what_is_left() -> None:
    """As reported in https://github.com/NVIDIAGameWorks/PhysX/issues/351, of a threshold of 2 m/s.

    Oracle: every speed is e times the one before, down to a few micrometres per second.
    """
    done = dropped(0.5, solver="rigid")
    speed = done.rebounds["v_after"]
    *_, last, zero = speed
    assert (zero, done.status) == (0.0, "jammed")
    assert last < 2e-5
    speed = speed[:-1]
    np.testing.assert_allclose(speed[1:] / speed[:-1], 0.5, rtol=1e-6)


@pytest.mark.parametrize(("u", "omega"), [(0.0, 0.0), (20.0, 0.0), (0.0, 50.0), (20.0, -50.0)])
def test_spin_and_speed_along_a_smooth_ground_leave_the_bounces_alone(u: float, omega: float) -> None:
    """As reported in https://github.com/avianphysics/avian/issues/200, of bounces that decay with spin."""
    done = dropped(1.0, u=u, omega=omega, max_rebounds=50)
    np.testing.assert_allclose(done.rebounds["v_after"], math.sqrt(2.0 * GRAVITY), rtol=1e-9)
    np.testing.assert_allclose(done.rebounds["u_after"], u, atol=1e-12)
    np.testing.assert_allclose(done.rebounds["omega_after"], omega, atol=1e-12)


@pytest.mark.parametrize("solver", ["rigid", "compliant"])
def test_a_ball_is_spun_by_its_first_touch_and_not_by_its_last(solver: str) -> None:
    """As reported in https://github.com/mbsim-env/mbsim/issues/49.

    Oracle: a disc that sticks keeps two thirds of its speed, and rolls.
    """
    done = dropped(0.7, friction=2.0, u=3.0, solver=solver, max_rebounds=1)
    first = done.rebounds[0]
    assert (first["u_after"], first["omega_after"]) == pytest.approx((2.0, -20.0), rel=1e-6)


def test_nothing_rebounds_where_restitution_is_zero() -> None:
    """As reported in https://github.com/schteppe/p2.js/issues/138, of a box that falls flat and bounces once."""
    box = sledenv.polygon(2.0, [(-0.25, -0.25), (0.25, -0.25), (0.25, 0.25), (-0.25, 0.25)])
    law = ContactLaw.from_restitution(0.0, stiffness=1e8, friction=0.3, rolling_arm=0.0)
    done = simulate(box, law, Slope(0.0, 10.0), State(0.0, 1.25, 0.0, 0.0, 0.0, 0.0), solver="rigid")
    assert done.status == "jammed"
    assert np.all(np.abs(done.rebounds["v_after"]) <= 1e-6)
    assert done.state.y == pytest.approx(0.25, abs=1e-5)


@pytest.mark.parametrize("rolling_arm", [0.0, 0.001])
def test_a_ball_stops_by_rolling_resistance_alone(rolling_arm: float) -> None:
    """As reported in https://github.com/schteppe/cannon.js/issues/293. Oracle: (3/2) m a = m g delta/r of a disc."""
    radius, speed = 0.1, 1.0
    law = ContactLaw.from_restitution(0.3, stiffness=1e8, friction=0.5, rolling_arm=rolling_arm)
    body, start = sledenv.disc(1.0, radius), State(0.0, radius, 0.0, speed, 0.0, -speed / radius)
    done = simulate(body, law, Slope(0.0, math.inf), start, max_time=100.0)
    if rolling_arm == 0.0:
        assert done.state.u == pytest.approx(speed, rel=1e-9)
        assert done.state.x == pytest.approx(100.0, rel=1e-6)
    else:
        deceleration = 2.0 / 3.0 * GRAVITY * rolling_arm / radius
        assert done.status == "jammed"
        assert done.state.x == pytest.approx(speed**2 / (2.0 * deceleration), rel=1e-3)  # it sinks in as it starts


def test_a_rolling_ball_does_not_hop() -> None:
    """As reported in https://github.com/chandlerprall/GoblinPhysics/pull/74, of a period in its height.

    Oracle: it sinks into the springs as it starts, at most twice as deep as they carry it, and touches for ever.
    """
    law = ContactLaw.from_restitution(0.5, stiffness=1e6, friction=0.5, rolling_arm=0.0)
    start = State(0.0, 0.1, 0.0, 2.0, 0.0, -20.0)
    done = simulate(BALL, law, Slope(0.0, math.inf), start, max_time=50.0, record="trajectory")
    assert done.rebounds["duration"].tolist() == [50.0]
    assert np.ptp(done.trajectory["y"]) < 2.0 * GRAVITY / law.stiffness


@pytest.mark.parametrize("size", [0.05, 0.5, 5.0])
@pytest.mark.parametrize("corners", [3, 4, 7])
def test_an_elastic_body_keeps_its_energy_whatever_its_shape_and_size(size: float, corners: int) -> None:
    """As reported in https://github.com/liabru/matter-js/issues/13. Oracle: the ledger after 30 rebounds."""
    angles = 2.0 * math.pi * np.arange(corners) / corners
    body = sledenv.polygon(size**2, size * np.column_stack([np.cos(angles), np.sin(angles)]))
    law = ContactLaw.from_restitution(1.0, stiffness=1e8, friction=0.0, rolling_arm=0.0)
    start = State(0.0, 3.0 * size, 0.3, 1.0, 0.0, 2.0)
    done = simulate(body, law, Slope(0.0, math.inf), start, max_rebounds=30, max_time=1e3)
    lost = done.energy.hysteresis + done.energy.sliding + done.energy.rolling
    assert abs(lost) < 1e-9 * done.energy.supplied
    assert done.status == "log_full"
