"""Which feature touches and where: the support of an outline, continuity where features meet, mirror symmetry."""

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
from tests.bodies import rod, touching
from tests.oracles import support

DISC = segment(1.0, 0.1, 0.05, 7.5e-3)
POINT = segment(1.0, 0.0, 0.0, 0.02)
SEGMENT = circular_segment(1.0, 0.5, math.radians(110.0))
SHALLOW = circular_segment(1.0, 0.5, 0.3)
LOPSIDED = segment(1.0, 0.5, 0.5, 0.1, 2.0)  # mass centre on the arc
ROD = rod(1.0, 0.4, 0.02)  # mass centre on the chord
BODIES = [DISC, POINT, SEGMENT, SHALLOW, LOPSIDED, ROD]
CORNERED = [SEGMENT, SHALLOW, LOPSIDED, ROD]
ANGLES = st.floats(-math.pi, math.pi)
bodies = st.sampled_from(BODIES)


@given(bodies, st.floats(-30.0, 30.0))
def test_support_height_is_that_of_arc_and_corners(body: Segment, phi: float) -> None:
    """Oracle: the positions of arc and corners, from the rotated body coordinates, by plain sines."""
    assert support_height(body, phi) == pytest.approx(float(support(body, np.array(phi))), rel=1e-13, abs=1e-14)


@pytest.mark.parametrize("body", [DISC, POINT])
@pytest.mark.parametrize("phi", [0.0, 0.7, -2.0, math.pi])
def test_arms_of_the_arc_are_the_textbook_ones(body: Segment, phi: float) -> None:
    """Oracle: a = h sin(phi), b = r - h cos(phi), docs/physics.md, section 1."""
    feature, a, b = touching(body, phi)
    (local,) = within_a_turn(np.array([phi]))
    assert feature == ARC
    assert a == pytest.approx(body.eccentricity * math.sin(local), abs=1e-16)
    assert b == pytest.approx(body.radius - body.eccentricity * math.cos(phi), rel=1e-15)


@pytest.mark.parametrize("body", CORNERED)
@pytest.mark.parametrize("side", [1, -1])
def test_arms_of_a_corner_are_those_of_a_sharp_arc_end(body: Segment, side: int) -> None:
    """Oracle: a = h sin(phi) - r sin(phi -+ alpha), b = r cos(phi -+ alpha) - h cos(phi), physics.md, section 8."""
    alpha, r, h = body.half_angle, body.radius, body.eccentricity
    for phi in np.linspace(alpha + 0.01, math.pi - 0.01, 9) * side:
        feature, a, b = touching(body, phi)
        assert feature == (TAIL if side > 0 else NOSE)
        assert a == pytest.approx(h * math.sin(phi) - r * math.sin(phi - side * alpha), abs=1e-15)
        assert b == pytest.approx(r * math.cos(phi - side * alpha) - h * math.cos(phi), abs=1e-15)


@pytest.mark.parametrize("body", CORNERED)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_arms_are_continuous_where_the_arc_ends(body: Segment, side: float) -> None:
    """Oracle: the end of the arc is the corner."""
    edge = side * body.half_angle
    corner = TAIL if side > 0.0 else NOSE
    part, *at_edge = touching(body, edge)
    beyond, *behind = touching(body, math.nextafter(edge, 4.0 * side))
    assert (part, beyond) == (ARC, corner)
    assert behind == pytest.approx(at_edge, abs=1e-15)


@given(bodies, ANGLES.filter(lambda phi: abs(phi) != math.pi))
@example(SEGMENT, SEGMENT.half_angle)
@example(DISC, 0.0)
def test_the_mirrored_pose_has_the_mirrored_contact_bit_for_bit(body: Segment, phi: float) -> None:
    """Oracle: mirror symmetry, phi -> -phi: nose and tail change places, a changes its sign."""
    feature, a, b = touching(body, phi)
    mirrored, a_mirrored, b_mirrored = touching(body, -phi)
    assert mirrored == {ARC: ARC, NOSE: TAIL, TAIL: NOSE}[feature]
    assert (a_mirrored, b_mirrored) == (-a, b)


@given(bodies, ANGLES, st.integers(-(10**6), 10**6))
def test_whole_turns_change_nothing(body: Segment, phi: float, turns: int) -> None:
    """Oracle: periodicity, up to the rounding of phi."""
    many = phi + turns * 2.0 * math.pi
    assert abs(within_a_turn(np.array([many]))[0]) <= math.pi
    rounding = 4e-16 * (abs(many) + 4.0) * (body.radius + body.eccentricity)
    assert abs(support_height(body, many) - support_height(body, phi)) <= 2.0 * rounding


def test_a_direction_does_not_depend_on_how_many_there_are():
    """Oracle: one by one, bit for bit; math, to the rounding of an angle."""
    angles = np.random.default_rng(0).uniform(-1e3, 1e3, 1001)
    alone = np.hstack([directions(angles[i : i + 1]) for i in range(len(angles))])
    for some in (slice(None), slice(500, 507)):
        assert np.array_equal(directions(angles[some]), alone[:, some])
    rounding = np.finfo(float).eps * (1.0 + np.abs(angles))
    for found, exact in zip(alone, (math.cos, math.sin), strict=True):
        assert (np.abs(found - [exact(angle) for angle in angles.tolist()]) <= rounding).all()


@pytest.mark.jit_only
def test_an_infinite_angle_has_no_direction():
    cosine, sine = directions(np.array([0.0, np.inf, -np.inf, np.nan]))
    assert np.isnan(cosine).tolist() == np.isnan(sine).tolist() == [False, True, True, True]
