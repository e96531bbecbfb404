"""Checks of what descents over a profile are given, and what scenes are made of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sledenv.kernel.params import ZONE_FIELDS
from sledenv.kernel.records import RUNNING
from sledenv.simulation.bodies import segment
from sledenv.simulation.checks import checked_descent, checked_scenes
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.ride import RideBatch
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.settings import Settings
from sledenv.simulation.shapes import circular_segment, polygon
from sledenv.simulation.simulate import simulate, simulate_batch
from sledenv.simulation.support import resting_heights

LAW = ContactLaw(1e6, 0.5, 0.3, 0.0)
DISC = segment(2.0, 0.5, 0.1, 0.3)
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
SHARP, ROUND = polygon(2.0, SQUARE), polygon(2.0, SQUARE, rounding=0.05)
HILL = Slope(0.1, 20.0, profile=[(2.0, 0.0), (3.0, 0.5), (5.0, 0.0)])
LAUNCH = State(0.0, 3.0, 0.0)


@pytest.mark.parametrize("body", [SHARP, circular_segment(2.0, 1.0, 1.2)], ids=["square", "cap"])
def test_a_sharp_corner_is_refused_on_crests_alone_and_all_else_on_rigid_ones(body: Any) -> None:
    """Oracle: the message, which names the remedies; nothing where body or crests are round."""
    remedy, high = (
        r" has a sharp corner: .*polygon\(\.\.\., rounding=\.\.\.\).*rounding=\.\.\.\) crests",
        State(0.0, 9.0, 0.0),
    )
    dip = Slope(0.1, profile=[(0.0, 2.0), (1.0, 1.0), (2.0, 2.0)])  # whose ends are crests
    for slope in (HILL, dip, HILL._replace(rounding=[0.1, 0.0, 0.1])):
        with pytest.raises(ValueError, match=f"^body{remedy}"):
            checked_descent(body, LAW, slope, high, Settings())
    with pytest.raises(ValueError, match=rf"^body\[1\]{remedy}"):
        checked_scenes([ROUND, body], LAW, HILL, [LAUNCH] * 2, Settings())
    with pytest.raises(ValueError, match=r"^solver = 'rigid': must be 'compliant' on a slope with a profile$"):
        simulate(DISC, LAW, HILL, LAUNCH, solver="rigid")
    level, smooth = Slope(0.1, profile=[(0.0, 2.0), (1.0, 2.0)]), HILL._replace(rounding=0.1)
    for round_enough, slope in ((body, level), (body, smooth), (ROUND, HILL), (DISC, HILL)):
        scenes = checked_descent(round_enough, LAW, slope, high, Settings()).scenes
        assert len(scenes.grounds()[0]) == len(slope.profile)


@pytest.mark.parametrize("length", [1.3, 2.5, 3.0, 4.0, 20.0])
def test_the_finish_may_lie_on_any_ground(length: float) -> None:
    """Oracle: the speed at the finish is that along the ground under the mass centre, told by its gradient there.

    At a vertex the piece behind it counts.
    """
    slope = HILL._replace(length=length)
    law = LAW._replace(friction=0.0, rolling_arm=0.0)
    descent = simulate(DISC, law, slope, State(0.0, 1.5, 0.0, 6.0))
    assert descent.status == "finish"
    assert descent.at_line is not None
    rise = float(np.diff(slope.height_at([length, length + 1e-6]))[0]) / 1e-6
    time, speed = descent.at_line
    assert (time, descent.state.x) == (descent.time, length)
    expected = (descent.state.u + rise * descent.state.v) / math.hypot(1.0, rise)
    assert speed == pytest.approx(expected, rel=1e-7)
    assert 0.0 < descent.jam.retention <= 1.0


BUMPS = Slope(0.1, 20.0, profile=[(1.0, 0.0), (3.0, 0.4), (4.0, 0.4), (6.0, 0.0)])


@pytest.mark.parametrize("other", [Slope(0.1, 20.0), HILL._replace(profile=HILL.profile[:2]), (0.1, 20.0, 9.81)])
def test_lanes_may_have_profiles_of_their_own(other: Any) -> None:
    """Oracle: each descent by itself, bit for bit; a ride that is launched anew has other ground under it."""
    slopes, launches = [HILL, other, HILL, BUMPS], [LAUNCH._replace(u=1.0 + 0.1 * k) for k in range(4)]
    alone = [simulate(DISC, LAW, slope, launch).outcome for slope, launch in zip(slopes, launches, strict=True)]
    assert [*simulate_batch(DISC, LAW, slopes, launches).outcomes] == alone
    rides = RideBatch(DISC, LAW, HILL, launches)
    rides.launch(np.array([3, 1]), LAW, [BUMPS, other], [launches[3], launches[1]])
    while (rides.outcomes()["status"] == RUNNING).any():
        rides.hop(np.zeros(4))
    assert [*rides.outcomes()] == alone


@pytest.mark.parametrize("x", [-3.0, 1.7, 2.5, 3.0, 4.9])
def test_a_launch_must_not_lie_below_the_ground(x: float) -> None:
    """Oracle: the height at which the body rests; what lies below it by rounding is lifted there."""
    (lowest,) = resting_heights(DISC.record, np.array([x]), np.zeros(1), Grounds.of([HILL.vertices])).tolist()
    launch = State(x, lowest, 0.0)
    assert checked_descent(DISC, LAW, HILL, launch, Settings()).launch == launch
    rounded = launch._replace(y=lowest - 5e-10 * DISC.size)
    assert checked_descent(DISC, LAW, HILL, rounded, Settings()).launch == launch
    assert checked_scenes(DISC, LAW, HILL, [rounded], Settings()).launches[0, 1] == lowest
    below = launch._replace(y=lowest - 2e-9 * DISC.size)
    with pytest.raises(ValueError, match=rf"^State\.y = .* lies below the surface; at x = {x} m and phi = 0\.0 rad"):
        checked_descent(DISC, LAW, HILL, below, Settings())
    with pytest.raises(ValueError, match=rf"^launches\[1\]\.y = .* must be at y >= {lowest} m"):
        checked_scenes(DISC, LAW, HILL, [launch, below], Settings())


@pytest.mark.parametrize("zones", [0, 1, 3])
def test_rows_of_zones_hold_seven_numbers(zones: int) -> None:
    """Oracle: the rows of the slopes; NaN for None. A slope that has fewer zones has fewer rows."""
    slopes = [
        Slope(0.1, zones=[Zone(k, k + 1.0, 0.1, 0.0, restitution=0.5) for k in range(zones)]),
        Slope(0.1, zones=[Zone(0.0, 1.0, 0.2, 0.0, stiffness=1e5)][:zones]),
    ]
    table = np.array([(*slope.row, *[math.nan] * 7 * (zones - len(slope.zones))) for slope in slopes])
    for given in (slopes, table):
        scenes = checked_scenes(DISC, LAW, given, [LAUNCH] * 2, Settings())
        assert scenes.zones.shape == (sum(len(slope.zones) for slope in slopes), ZONE_FIELDS)
        for row, slope in zip(scenes.rows, slopes, strict=True):
            own = scenes.zones[int(row["zones"]) : int(row["zones_end"])]
            np.testing.assert_array_equal([row["angle"], row["length"], row["gravity"], *own.ravel()], slope.row)
