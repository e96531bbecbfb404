"""The small swing against the simulator, against the angles of rest, and against what is known of a hoop."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sledenv
from sledenv.closed_forms.equilibrium import static_jam_angles
from sledenv.closed_forms.swing import small_swings
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Settings
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height
from tests.closed_forms.make import BODIES, DISC, OUTLINES, SLED, SQUARE, WHEEL

SWINGING = {"sled with its rider": (sledenv.sled(), 0.001), "segment": (SLED, 0.02), "disc": (DISC, 0.02)}


def passages(body: Body, slope: Slope, middle: float, start: float, friction: float, time: float) -> np.ndarray:
    """Times [s] at which the simulator has a body, let go off the middle of its swing, pass it."""
    law = ContactLaw(1e9, 0.5, friction, 0.0)
    phi = middle + start
    launch = State(0.0, support_height(body, phi), phi)
    settings = Settings(solver="rigid", max_time=time, sample_interval=time / 2000.0)
    rows = simulate(body, law, slope, launch, settings, record="trajectory").trajectory
    off = rows["phi"] - middle
    before = np.flatnonzero(off[:-1] * off[1:] < 0.0)
    share = off[before] / (off[before] - off[before + 1])
    return rows["t"][before] + share * (rows["t"][before + 1] - rows["t"][before])


@pytest.mark.parametrize("beta", [0.0, 0.03, -0.03])
@pytest.mark.parametrize("sticks", [True, False], ids=["sticks", "slides"])
@pytest.mark.parametrize("name", SWINGING)
def test_the_simulator_swings_with_this_period(name: str, sticks: bool, beta: float) -> None:
    """Oracle: the descent of a body let go beside its rest; the first quarter and three halves."""
    body, start = SWINGING[name]
    slope = Slope(beta if sticks else 10.0 * beta)
    swing = min(small_swings(body, slope, sticks=sticks), key=lambda swing: abs(swing.phi))
    assert swing.part == ("runner" if "rider" in name else "arc")
    times = passages(body, slope, swing.phi, start, 10.0 if sticks else 0.0, 1.9 * swing.period)
    assert times / swing.period == pytest.approx([0.25, 0.75, 1.25, 1.75], abs=2e-3)


def test_a_hoop_with_a_weight_swings_as_in_textbooks() -> None:
    """Oracle: T = 2 pi sqrt(2 M r/(m g)) of a hoop M that rolls, with a point mass m on its rim."""
    hoop, weight, radius, gravity = 3.0, 0.5, 0.4, 9.81
    mass = hoop + weight
    eccentricity = weight * radius / mass
    inertia = hoop * (radius**2 + eccentricity**2) + weight * (radius - eccentricity) ** 2
    for begin in (0.3, -math.pi):  # where the outline begins does not matter
        body = Body(mass, inertia, [sledenv.bodies.Arc(0.0, eccentricity, radius, begin, "rim")])
        [swing] = small_swings(body, Slope(0.0, gravity=gravity))
        assert swing.part == "rim"
        assert swing.phi == pytest.approx(0.0)
        assert swing.period == pytest.approx(2.0 * math.pi * math.sqrt(2.0 * hoop * radius / (weight * gravity)))
    upside_down = Body(mass, inertia, [sledenv.bodies.Arc(0.0, -eccentricity, radius, 0.3, "rim")])
    [turned] = small_swings(upside_down, Slope(0.0, gravity=gravity))
    assert turned[1:] == pytest.approx((math.pi, swing.period))


@pytest.mark.parametrize("beta", [0.0, 0.15, -0.15])
@pytest.mark.parametrize("name", [*BODIES, *OUTLINES])
def test_a_body_that_sticks_swings_where_it_rests_and_comes_back(name: str, beta: float) -> None:
    """Oracle: the points of balance of static_jam_angles, and the height of the mass centre beside each as it rolls."""
    body, slope = BODIES.get(name) or OUTLINES[name], Slope(beta)
    balanced = [low for low, _ in static_jam_angles(body, ContactLaw(1e6, 0.5, 10.0, 0.0), slope)]
    swings = small_swings(body, slope)
    for swing in swings:
        assert min(abs(swing.phi - phi) for phi in balanced) < 1e-12
    lowest = []
    for phi in balanced:
        step = 1e-4
        here, left, right = (support_height(body, phi + turn) for turn in (0.0, -step, step))
        rolled = 0.5 * step * (left + 2.0 * here + right)  # dx = -b dphi, from one side to the other
        along = 0.5 * step * (here + left), -0.5 * step * (here + right)
        assert rolled == pytest.approx(along[0] - along[1])
        heights = [
            y * math.cos(beta) - x * math.sin(beta) for x, y in ((along[0], left), (0.0, here), (along[1], right))
        ]
        if name != "wheel" and min(heights[0], heights[2]) > heights[1] + 1e-12:
            lowest.append(phi)
    assert [swing.phi for swing in swings] == pytest.approx(lowest)


def test_what_does_not_swing() -> None:
    """Oracle: a wheel rests anywhere or nowhere, a square on corners and sides only, and an arc not if it is steep."""
    for sticks in (True, False):
        assert small_swings(WHEEL, Slope(0.0), sticks=sticks) == []
        assert small_swings(SQUARE, Slope(0.0), sticks=sticks) == []
    assert small_swings(DISC, Slope(0.6)) == []  # r sin(beta) > h: it rolls down
    assert len(small_swings(DISC, Slope(0.6), sticks=False)) == 1
