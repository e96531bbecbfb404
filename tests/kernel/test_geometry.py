"""Which feature of a body touches a plane and where: the support of an outline, whole turns, mirror symmetry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sledenv.kernel.records import ARC, NOSE, TAIL
from sledenv.simulation.bodies import Segment, segment
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.support import directions, support_height, within_a_turn
from tests.bodies import lowest_arc, rod, touching
from tests.oracles import support

DISC, SEGMENT = segment(1.0, 0.1, 0.05, 7.5e-3), circular_segment(1.0, 0.5, math.radians(110.0))
BODIES = [
    *(DISC, SEGMENT, segment(1.0, 0.0, 0.0, 0.02), circular_segment(1.0, 0.5, 0.3)),
    segment(1.0, 0.5, 0.5, 0.1, 2.0),  # mass centre on the arc
    rod(1.0, 0.4, 0.02),  # mass centre on the chord
]
ANGLES = st.floats(-math.pi, math.pi)
bodies = st.sampled_from(BODIES)


@given(bodies, st.floats(-30.0, 30.0))
@example(SEGMENT, SEGMENT.half_angle)
@example(SEGMENT, math.nextafter(SEGMENT.half_angle, 4.0))
def test_arms_are_those_of_the_lowest_point(body: Segment, phi: float) -> None:
    """Oracle: the positions of arc and corners, from the rotated body coordinates, by plain sines."""
    (local,) = within_a_turn(np.array([phi])).tolist()
    code, a, b = touching(body, phi)
    arc, *arms = lowest_arc(body, local)
    assert (a, b) == pytest.approx(arms, abs=1e-14)
    assert b == support_height(body, phi) == pytest.approx(float(support(body, np.array(phi))), rel=1e-13, abs=1e-14)
    if abs(abs(local) - body.half_angle) > 1e-12:
        assert body.parts[code - 1] == arc.part


@given(bodies, ANGLES.filter(lambda phi: abs(phi) != math.pi))
@example(SEGMENT, SEGMENT.half_angle)
@example(DISC, 0.0)
def test_the_mirrored_pose_has_the_mirrored_contact_bit_for_bit(body: Segment, phi: float) -> None:
    """Oracle: mirror symmetry, phi -> -phi: nose and tail change places, a changes its sign."""
    (feature, a, b), mirrored = touching(body, phi), touching(body, -phi)
    assert mirrored == ({ARC: ARC, NOSE: TAIL, TAIL: NOSE}[feature], -a, b)


@given(bodies, ANGLES, st.integers(-(10**6), 10**6))
def test_whole_turns_change_nothing(body: Segment, phi: float, turns: int) -> None:
    """Oracle: periodicity, up to the rounding of phi."""
    many = phi + turns * 2.0 * math.pi
    assert abs(within_a_turn(np.array([many]))[0]) <= math.pi
    rounding = 4e-16 * (abs(many) + 4.0) * (body.radius + body.eccentricity)
    assert abs(support_height(body, many) - support_height(body, phi)) <= 2.0 * rounding


def test_a_direction_does_not_depend_on_how_many_there_are() -> None:
    """Oracle: one by one, bit for bit; math, to the rounding of an angle."""
    angles = np.random.default_rng(0).uniform(-1e3, 1e3, 1001)
    alone = np.hstack([directions(angles[i : i + 1]) for i in range(len(angles))])
    for some in (slice(None), slice(500, 507)):
        assert np.array_equal(directions(angles[some]), alone[:, some])
    rounding = np.finfo(float).eps * (1.0 + np.abs(angles))
    for found, exact in zip(alone, (math.cos, math.sin), strict=True):
        assert (np.abs(found - [exact(angle) for angle in angles.tolist()]) <= rounding).all()
