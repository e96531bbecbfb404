"""A body that lies on its chord, or on another side, against its forces, summed and stepped."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sledenv.closed_forms.on_chord import (
    chord_finish_time,
    chord_loads,
    chord_rests,
    chord_slide,
    chord_tipping_friction,
)
from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.scene import ContactLaw, Slope
from sledenv.simulation.shapes import polygon
from tests.bodies import arms
from tests.closed_forms.make import OUTLINES, SHELL, SLED

Ends = list[tuple[float, float, bool]]  # arms a, b [m] of the two ends of a side that lies flat, and whether a corner


def ends_of(body: Body) -> dict[str, Ends]:
    """Both ends of each straight side, that downhill first: the arc before it and the one after it, clockwise."""
    found = {}
    for arc, after in zip(body.arcs, [*body.arcs[1:], body.arcs[0]], strict=True):
        if arc.side in body.parts:
            found[arc.side] = [(*arms(end, after.begin), bool(end.corner)) for end in (arc, after)]
    return found


SIDES = [(body, side) for body in (SLED, SHELL, *OUTLINES.values()) for side in ends_of(body)]


@pytest.mark.parametrize("slip", [-1.0, 0.0, 1.0])
def test_the_loads_of_the_corners_balance_weight_and_friction(slip: float) -> None:
    """Oracle: sums of forces and of moments about the mass centre, from the places of the two corners."""
    for body, side in SIDES:
        law, slope = ContactLaw(1e6, 0.5, 0.3, 0.01), Slope(-0.2)
        force = -body.mass * 9.81 * (math.sin(slope.angle) if slip == 0.0 else slip * 0.3 * math.cos(slope.angle))
        loads = chord_loads(body, law, slope, 5.0 * slip, side)
        moment = 0.0
        for normal, (a, b, _) in zip(loads, ends_of(body)[side], strict=True):
            moment += np.cross((-a, -b, 0.0), (0.5 * force, float(normal), 0.0))[2]
        assert sum(loads) == pytest.approx(body.mass * 9.81 * math.cos(slope.angle))
        assert moment == pytest.approx(0.0, abs=1e-12 * body.mass)


def test_friction_does_not_tip_a_body_whose_mass_centre_lies_in_its_chord() -> None:
    """Oracle: friction has no arm there."""
    inside = segment(1.0, 0.5, 0.5 * math.cos(1.0), 0.02, 1.0)
    assert chord_tipping_friction(inside, ContactLaw(1e6, 0.5, 9.0, 0.0)) == math.inf


def test_a_body_slides_down_that_friction_does_not_hold() -> None:
    """Oracle: f = tan(beta), 1e-9 to both sides."""
    law = ContactLaw(1e6, 0.5, math.tan(0.1), 0.0)
    assert [chord_rests(SLED, law, Slope(0.1 + side)) for side in (-1e-9, 1e-9)] == [True, False]


@pytest.mark.parametrize("slip", [-1.0, 1.0])
def test_a_body_tips_off_a_side_over_the_end_ahead(slip: float) -> None:
    """Oracle: the load of the other end, chord_loads; the rolling arm of the end ahead lets it reach further."""
    flat, tipped = ContactLaw(1e6, 0.5, 9.0, 0.0, 0.0), ContactLaw(1e6, 0.5, 9.0, 0.03, 0.05)
    for body, side in SIDES:
        (downhill, b, is_corner), (uphill, _, other_is_corner) = ends_of(body)[side]
        reach, corner = (-downhill, is_corner) if slip > 0.0 else (uphill, other_is_corner)
        longer = (reach + (0.05 if corner else 0.03)) / b
        tipping = chord_tipping_friction(body, flat, side, slip)
        assert chord_tipping_friction(body, tipped, side, slip) == pytest.approx(longer)
        for factor in (1.0 - 1e-9, 1.0 + 1e-9):
            loads = chord_loads(body, flat._replace(friction=factor * tipping), Slope(0.0), slip, side)
            assert (loads[1 if slip > 0.0 else 0] > 0.0) == (factor < 1.0)
            assert chord_rests(body, flat, Slope(slip * math.atan(factor * tipping)), side) == (factor < 1.0)


def test_a_body_tips_off_a_side_that_its_mass_centre_is_not_over() -> None:
    """Oracle: the geometry of a leaning quadrilateral; only a slope that rises by 0.2 / 1 or more holds it there."""
    law = ContactLaw(1e6, 0.5, 2.0, 0.0)
    body = polygon(1.0, [(0.0, 0.0), (1.0, 0.0), (3.0, 2.0), (1.0, 2.0)], inertia=1.0, centre=(1.2, 1.0))
    for slip in (-1.0, 1.0):
        assert chord_tipping_friction(body, law, "side 1", slip) == 0.0
    assert min(chord_loads(body, law, Slope(0.0), 0.0, "side 1")) < 0.0
    assert not any(chord_rests(body, law, Slope(angle), "side 1") for angle in (0.3, 0.0, -math.atan(0.2 - 1e-9)))
    assert chord_rests(body, law, Slope(-math.atan(0.2 + 1e-9)), "side 1")


@pytest.mark.parametrize("friction", [0.0, 0.05, 0.4])
@pytest.mark.parametrize("angle", [-0.1, 0.0, 0.2])
@pytest.mark.parametrize("speed", [-2.0, 0.0, 3.0])
def test_a_block_slides_as_its_forces_say(friction: float, angle: float, speed: float) -> None:
    """Oracle: 100,000 steps of Euler's method with the friction of each instant."""
    law, slope = ContactLaw(1e6, 0.5, friction, 0.0), Slope(angle, 5.0)
    time, steps = 4.0, 100_000
    downhill, bound = 9.81 * math.sin(angle), friction * 9.81 * math.cos(angle) * time / steps
    x, u, finish = 0.0, speed, math.inf
    for i in range(steps):
        u += downhill * time / steps
        u = math.copysign(max(abs(u) - bound, 0.0), u)
        x += u * time / steps
        if x >= slope.length and finish == math.inf:
            finish = (i + 1) * time / steps
    assert [float(value) for value in chord_slide(law, slope, speed, time)] == pytest.approx([x, u], abs=2e-3)
    if min(finish, chord_finish_time(law, slope, speed)) < 0.99 * time:
        assert chord_finish_time(law, slope, speed) == pytest.approx(finish, abs=1e-3)


def test_a_block_that_never_gets_there_takes_for_ever() -> None:
    law = ContactLaw(1e6, 0.5, 0.3, 0.0)
    assert chord_finish_time(law, Slope(0.1, 10.0), 1.0) == math.inf
    assert chord_finish_time(law, Slope(0.1, 10.0), 0.0) == math.inf
    assert chord_finish_time(law, Slope(0.4), 1.0) == math.inf
    assert chord_finish_time(law._replace(friction=0.0), Slope(0.0, 10.0), -1.0) == math.inf
