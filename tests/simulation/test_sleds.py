"""A skeleton sled with its rider: parts and mass properties, what ends a descent that touches with the rider."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Settings
from sledenv.simulation.simulate import simulate
from sledenv.simulation.sleds import sled
from sledenv.simulation.support import lowest_arms, support_height
from tests.bodies import same_bits

RIDDEN = sled()
ICE = ContactLaw.from_restitution(0.1, stiffness=2e6, friction=0.01, rolling_arm=0.0)
TRACK = Slope(math.radians(8.0), 30.0)
RIDER = RIDDEN.parts.index("rider") + 1


def launched(phi: float, drop: float, omega: float = 0.0) -> State:
    return State(0.0, support_height(RIDDEN, phi) + drop, phi, 8.0, 0.0, omega)


def test_mass_and_mass_centre_are_those_of_the_parts() -> None:
    """Oracle: sums over sled and limbs by hand: the whole rider lies 1.0075 m from the soles."""
    assert RIDDEN.mass == pytest.approx(120.0)
    heights = 80.0 * (0.1 + 0.122 * 0.055 + 0.2 * 0.085 + 0.678 * 0.12) + 40.0 * 0.05
    bow = 15.0 - math.sqrt((15.0 - 0.03) ** 2 - 0.445**2) - 0.03  # how far the runners bend below their ends
    assert support_height(RIDDEN, 0.0) == pytest.approx(heights / 120.0 + bow, rel=1e-12)
    assert math.sqrt(RIDDEN.inertia / RIDDEN.mass) == pytest.approx(0.368, abs=0.001)
    forward = sled(balance=0.2)
    shift = 80.0 / 120.0 * 0.2 * 0.5 * 0.95
    runners = [next(arc.x for arc in body.arcs if arc.radius == 15.0) for body in (RIDDEN, forward)]
    assert runners[0] - runners[1] == pytest.approx(shift, rel=1e-9)


def test_a_number_of_another_kind_makes_the_same_sled() -> None:
    """Oracle: the sled of the same number as a float."""
    assert sled(rider_mass=np.float32(80)) == sled(rider_mass=80.0)  # type: ignore[arg-type]


def test_it_stands_on_its_runners_and_its_length_is_that_of_the_rider() -> None:
    """Oracle: the geometry. Its flat arc is lowest near phi = 0, the rider at phi = pi."""
    arcs, _ = lowest_arms(RIDDEN.record, np.array([0.0, 0.02, -0.02, math.pi, 1.5, -1.5]))
    parts = [RIDDEN.parts[int(RIDDEN.record["part"][0, arc]) - 1] for arc in arcs]
    assert parts == ["runner", "runner", "runner", "rider", "legs", "rider"]
    points = [(arc.x - arc.radius, arc.x + arc.radius) for arc in RIDDEN.arcs if arc.radius < 1.0]
    assert max(high for _, high in points) - min(low for low, _ in points) == pytest.approx(1.75, rel=1e-12)


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
def test_a_descent_ends_where_the_rider_touches(solver: Any) -> None:
    """Oracle: the same descent without the rule touches with the rider later or never."""
    settings = Settings(solver, max_time=20.0, end_touching="rider")
    fallen = 0
    for phi in np.linspace(-math.pi, math.pi, 21).tolist():
        launch = launched(phi, 0.3, 0.5)
        free, ruled = (simulate(RIDDEN, ICE, TRACK, launch, s) for s in (Settings(solver, max_time=20.0), settings))
        touched = np.flatnonzero(free.rebounds["feature"] == RIDER)
        if ruled.status == "tumbled":
            fallen += 1
            count = len(ruled.rebounds)
            same_bits(free.rebounds[: count - 1], ruled.rebounds[: count - 1])
            assert len(touched) == 0 or count <= touched[0] + 1
            assert ruled.time <= free.time
        else:
            assert len(touched) == 0
            same_bits(free.rebounds, ruled.rebounds)
    assert 4 < fallen < 21


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
@pytest.mark.parametrize(("part", "ends"), [("legs", True), ("runner", True), ("frame", True), ("rider", False)])
def test_a_flat_landing_touches_with_the_side_and_with_both_its_ends(solver: Any, part: str, ends: bool) -> None:
    """Oracle: the outline; the side behind the runners goes from their end to the feet."""
    phi = next(arc.begin for arc in RIDDEN.arcs if arc.part == "legs")
    descent = simulate(RIDDEN, ICE, TRACK, launched(phi, 0.3), solver=solver, end_touching=part, max_rebounds=1)
    assert (descent.status == "tumbled") == ends
    assert len(descent.rebounds) == 1


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
def test_a_descent_ends_at_the_first_of_several_parts(solver: Any) -> None:
    """Oracle: the descents that end at each of them."""
    settings, ends = Settings(solver, max_time=20.0), set()
    for phi in (-2.5, -0.8, 0.0, 0.3, 0.8, 2.0, 3.1):
        given = RIDDEN, ICE, TRACK, launched(phi, 0.3), settings
        alone = [simulate(*given, end_touching=part) for part in ("rider", "legs")]
        both = simulate(*given, end_touching=["rider", "legs"])
        assert both.outcome == min(alone, key=lambda one: one.time).outcome
        ends.add(str(both.status))
    assert ends in ({"tumbled", "jammed"}, {"tumbled", "finish"})
