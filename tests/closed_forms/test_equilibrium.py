"""Rest on the slope against brute force and against the simulator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

import numpy as np
import pytest

from sledenv.closed_forms.equilibrium import static_jam, static_jam_angles
from sledenv.simulation.bodies import Body
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.shapes import polygon
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height
from tests.closed_forms.make import BODIES, DISC, OUTLINES, ROD, SHELL, SLED, SQUARE, touching

RIGID_EPS, SETTLING_EPS = 1e-9, 1e-6

# body, law, slope: every kind of arc, both signs of the slope
RESTS = {
    "disc": (DISC, ContactLaw(1e12, 0.5, 0.3, 0.003), Slope(0.1)),
    "sled": (SLED, ContactLaw(1e13, 0.5, 0.5, 0.02, 0.03), Slope(0.05)),
    "shell": (SHELL, ContactLaw(1e12, 0.5, 0.5, 0.02, 0.05), Slope(-0.05)),
    "rod": (ROD, ContactLaw(1e11, 0.5, 0.3, 0.02, 0.02), Slope(-0.05)),
    "level": (SLED, ContactLaw(1e12, 0.5, 0.5, 0.02, 0.03), Slope(0.0)),
    "square": (SQUARE, ContactLaw(1e12, 0.5, 0.3, 0.0, 0.02), Slope(0.05)),
    "pebble": (OUTLINES["pebble"], ContactLaw(1e12, 0.5, 0.3, 0.01), Slope(-0.05)),
}


def random_cases(
    count: int, seed: int = 3, bodies: Mapping[str, Body] = BODIES
) -> list[tuple[Body, ContactLaw, Slope]]:
    rng = np.random.default_rng(seed)
    cases = []
    for body in rng.choice(list(bodies), count):
        law = ContactLaw(
            1e6, 0.5, rng.uniform(0.0, 1.0), rng.uniform(0.0, 0.05), rng.choice([0.0, rng.uniform(0, 0.3)])
        )
        cases.append((bodies[body], law, Slope(rng.uniform(-0.6, 0.6))))
    return cases


def rests(body: Body, law: ContactLaw, slope: Slope, phi: float) -> bool:
    """Force balance of one pose, point by point: N and F carry the weight, the rest of the moment is rolling."""
    weight = body.mass * slope.gravity
    normal, force = weight * math.cos(slope.angle), -weight * math.sin(slope.angle)
    a, b, corner = touching(body, phi)
    moment = np.cross((-a, -b, 0.0), (force, normal, 0.0))[2]
    arm = law.corner_rolling_arm if corner else law.rolling_arm
    return bool(abs(force) <= law.friction * normal and abs(moment) <= arm * normal)


def laid(
    body: Body, law: ContactLaw, slope: Slope, phi: float, solver: Literal["compliant", "rigid"] = "rigid"
) -> Descent:
    """Lay the body on the slope at rest and let go."""
    return simulate(body, law, slope, State(0.0, support_height(body, phi), phi), solver=solver, max_time=2.0)


def test_a_pose_rests_where_the_forces_balance() -> None:
    """Oracle: forces and moment of each pose, one at a time."""
    for body, law, slope in [*random_cases(12), *random_cases(12, bodies=OUTLINES)]:
        phi = np.linspace(-7.0, 7.0, 301)
        assert static_jam(body, law, slope, phi).tolist() == [rests(body, law, slope, angle) for angle in phi.tolist()]


@pytest.mark.parametrize("bodies", [BODIES, OUTLINES], ids=["segments", "outlines"])
def test_the_angles_of_rest_are_those_of_the_condition(bodies: Mapping[str, Body]) -> None:
    """Oracle: static_jam on a grid, and 1e-9 rad to both sides of every bound."""
    bounds = 0
    for body, law, slope in random_cases(200, bodies=bodies):
        intervals = static_jam_angles(body, law, slope)
        phi = np.linspace(-math.pi, math.pi, 2000)[1:-1]
        inside = np.zeros(phi.shape, dtype=bool)
        for low, high in intervals:
            assert -math.pi <= low <= high <= math.pi
            inside |= (phi >= low) & (phi <= high)
            for edge, inwards in ((low, RIGID_EPS), (high, -RIGID_EPS)):
                if high - low > 4.0 * RIGID_EPS and abs(edge) < math.pi:
                    assert static_jam(body, law, slope, edge + inwards)
                    assert not static_jam(body, law, slope, edge - inwards)
                    bounds += 1
        assert np.array_equal(inside, static_jam(body, law, slope, phi))
    assert bounds > 150


@pytest.mark.parametrize("name", RESTS)
@pytest.mark.parametrize("solver", ["rigid", "compliant"])
def test_a_body_laid_on_the_slope_jams_inside_and_moves_outside(
    name: str, solver: Literal["rigid", "compliant"]
) -> None:
    """Oracle: the simulator, 1e-9 rad to both sides of every bound.

    On an incline a compliant contact is given 1e-6 rad: laid down unloaded, it has to settle first, and the kick that
    it gets from that dies out with the root of the stiffness.
    """
    body, law, slope = RESTS[name]
    eps = RIGID_EPS if solver == "rigid" or slope.angle == 0.0 else SETTLING_EPS
    intervals = static_jam_angles(body, law, slope)
    assert len(intervals) >= 2
    for low, high in intervals:
        for edge, inwards in ((low, eps), (high, -eps)):
            inside, outside = (laid(body, law, slope, edge + side, solver) for side in (inwards, -inwards))
            assert inside.status == "jammed"
            assert inside.state.phi == pytest.approx(edge + inwards, abs=0.5 * eps)
            assert abs(outside.state.phi - (edge - inwards)) > 0.5 * eps
            if solver == "rigid":
                assert inside.time == 0.0
                assert inside.state == inside.launch
                assert outside.time > 0.0


def test_a_corner_that_touches_at_half_a_turn_rests_on_both_sides_of_it() -> None:
    """Oracle: a triangle that balances on a corner at phi = pi; its range is split there."""
    body = polygon(1.0, [(-0.5, 0.0), (0.5, 0.0), (0.0, 0.8)])
    law = ContactLaw(1e6, 0.5, 0.5, 0.0, 0.01)
    first, *_, last = static_jam_angles(body, law, Slope(0.0))
    assert first[0] == -math.pi
    assert last[1] == math.pi
    half_width = math.asin(0.01 / (0.8 * 2.0 / 3.0))
    assert [first[1], last[0]] == pytest.approx([half_width - math.pi, math.pi - half_width])
    assert static_jam(body, law, Slope(0.0), [math.pi, -math.pi]).all()
