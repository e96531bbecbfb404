"""Zones of a slope against closed forms, and against the slope without zones."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest

import sledenv
from sledenv.simulation.settings import Solver
from sledenv.simulation.support import support_height
from tests.bodies import same_bits, touching
from tests.kernel.test_outlines import block, laid

SOLVERS = pytest.mark.parametrize("solver", ["compliant", "rigid"])
GRAVITY = 9.81


LAW = sledenv.ContactLaw(1e9, 0.5, 0.1, 0.0)


class Block(NamedTuple):
    """A block that slides on its two ends."""

    ahead: float  # [m] of the mass centre
    behind: float  # [m]
    height: float  # [m] of the mass centre
    angle: float  # [rad]
    zones: list[sledenv.Zone]

    def friction(self, place: float) -> float:
        return next((zone.friction for zone in self.zones if zone.begin <= place < zone.end), LAW.friction)

    def gain(self, x: float, way: float) -> float:
        """Acceleration [m/s^2] where it slides one way, 1 or -1.

        Loads balance the moments: ahead N_1 - behind N_2 = way height (f_1 N_1 + f_2 N_2).
        """
        f_1, f_2 = self.friction(x + self.ahead), self.friction(x - self.behind)
        lever_1, lever_2 = self.ahead - way * self.height * f_1, self.behind + way * self.height * f_2
        mean = (f_1 * lever_2 + f_2 * lever_1) / (lever_1 + lever_2)
        return GRAVITY * (math.sin(self.angle) - way * mean * math.cos(self.angle))

    def slid(self, x: float, speed: float, to: float) -> tuple[float, float, float]:
        """Time [s] until it reaches a place or stops, where it is then, and its speed [m/s]."""
        way, time = math.copysign(1.0, to - x), 0.0
        edges = {edge + arm for zone in self.zones for edge in zone[:2] for arm in (-self.ahead, self.behind)}
        between = [edge for edge in edges if min(x, to) < edge < max(x, to)]
        for begin, end in pairwise(sorted([x, *between, to], reverse=way < 0.0)):
            gain, length = way * self.gain(0.5 * (begin + end), way), abs(end - begin)
            square = speed * speed + 2.0 * gain * length
            if square <= 0.0:
                return time - speed / gain, begin - way * 0.5 * speed * speed / gain, 0.0
            faster = math.sqrt(square)
            time, speed = time + 2.0 * length / (speed + faster), faster
        return time, to, speed


ZONES = [
    sledenv.Zone(0.9, 1.1, 0.45, 0.0),
    sledenv.Zone(1.7, 2.4, 0.0, 0.0),
    sledenv.Zone(2.4, 3.1, 0.3, 0.0),
]


@SOLVERS
@pytest.mark.parametrize(("width", "offset"), [(0.4, 0.0), (0.4, 0.06), (1.0, -0.1)])
def test_a_block_slides_on_its_ends_from_zone_to_zone(width: float, offset: float, solver: Solver) -> None:
    """Oracle: a constant acceleration between the crossings of either end; the work of friction."""
    height, angle, speed, length = 0.3, 0.1, 2.5, 4.0
    body, slope = block(width, height, offset), sledenv.Slope(angle, length, GRAVITY, ZONES)
    descent = sledenv.simulate(body, LAW, slope, laid(body, 0.0, speed), solver=solver)
    sliding = Block(0.5 * width - offset, 0.5 * width + offset, 0.5 * height, angle, ZONES)
    time, _, faster = sliding.slid(0.0, speed, length)
    near = 1e-12 if solver == "rigid" else 1e-6
    assert str(descent.status) == "finish"
    assert descent.time == pytest.approx(time, rel=near)
    assert descent.state.u == pytest.approx(faster, rel=near)
    assert descent.state.phi == pytest.approx(0.0, abs=near)
    lost = body.mass * (GRAVITY * math.sin(angle) * length + 0.5 * (speed**2 - faster**2))
    assert descent.energy.sliding == pytest.approx(lost, rel=near)


@SOLVERS
@pytest.mark.parametrize("friction", [0.25, 0.7])
def test_a_block_comes_to_rest_where_a_zone_holds_it(friction: float, solver: Solver) -> None:
    """Oracle: it stops with one end in the zone or with both, and stays, as both their frictions hold it there."""
    body, angle, zones = block(0.4, 0.2), 0.15, [sledenv.Zone(1.0, 5.0, friction, 0.0)]
    slope, speed = sledenv.Slope(angle, 9.0, GRAVITY, zones), 1.2
    descent = sledenv.simulate(body, LAW, slope, laid(body, 0.0, speed), solver=solver)
    time, place, _ = Block(0.2, 0.2, 0.1, angle, zones).slid(0.0, speed, 5.0)
    assert (place < 1.2) == (friction > 0.5)  # one end
    assert str(descent.status) == "jammed"
    assert descent.state.x == pytest.approx(place, rel=1e-12 if solver == "rigid" else 1e-6)
    assert descent.time == pytest.approx(time, rel=1e-12 if solver == "rigid" else 1e-6)


BODIES = {
    "disc": sledenv.disc(3.0, 0.5, 0.2, 0.3),
    "segment": sledenv.circular_segment(100.0, 0.5, 1.9),
    "polygon": sledenv.polygon(2.0, [(0.5, -0.2), (-0.4, -0.2), (-0.3, 0.3), (0.4, 0.2)]),
    "sled": sledenv.sled(),
}
SNOW = sledenv.ContactLaw(1e6, 0.4, 0.2, 0.004, 0.002)


@SOLVERS
@pytest.mark.parametrize("name", BODIES)
def test_zones_that_are_like_the_law_change_nothing(name: str, solver: Solver) -> None:
    """Oracle: the descent without zones: rebounds but for rounding, and bit for bit if no zone is touched."""
    body, slope = BODIES[name], sledenv.Slope(0.2, 50.0, GRAVITY)
    launch = sledenv.State(0.0, support_height(body, 0.2) + 0.3, 0.2, 5.0, -1.0, 1.0)
    options: dict[str, Any] = {"solver": solver, "max_rebounds": 3}
    one = sledenv.simulate(body, SNOW, slope, launch, **options)
    left = [row["x"] - touching(body, float(row["phi"]))[1] for row in one.rebounds]  # where contacts end
    places = np.sort([*one.rebounds["x_contact"], *left])
    inside = (0.5 * (places[1:] + places[:-1])).tolist()
    alike = [sledenv.Zone(begin, end, *SNOW[2:]) for begin, end in pairwise([-3.0, *inside, 40.0])]
    other = sledenv.simulate(body, SNOW, slope._replace(zones=alike), launch, **options)
    for field in ("t", "x", "phi", "u_after", "v_after", "omega_after", "loss_sliding", "loss_rolling"):
        assert other.rebounds[field] == pytest.approx(one.rebounds[field], rel=1e-12, abs=1e-12)
    behind, beyond = sledenv.Zone(-9.0, -5.0, 0.9, 0.1), sledenv.Zone(45.0, 50.0, 0.9, 0.1)
    for far in ([behind], [beyond], [behind, beyond._replace(end=math.inf)]):
        other = sledenv.simulate(body, SNOW, slope._replace(zones=far), launch, **options)
        same_bits(one.outcome, other.outcome)
        same_bits(one.rebounds, other.rebounds)
