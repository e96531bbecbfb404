"""Angles, sine, cosine and a root: as near to the exact ones as they promise, and exactly odd or even."""

from __future__ import annotations

import math

import mpmath
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sledenv.kernel import arithmetic
from tests.compiled import compiled

wrap, sine_cosine, angle_of = compiled(arithmetic.wrap), compiled(arithmetic.sine_cosine), compiled(arithmetic.angle_of)
sixteenth_root, sign_of = compiled(arithmetic.sixteenth_root), compiled(arithmetic.sign_of)
angles = st.floats(-20.0, 20.0)
lengths = st.floats(0.5, 2.0) | st.floats(1e-100, 1e100)
signs = st.sampled_from([-1.0, 1.0])


def ulps(found: float, exact: mpmath.mpf) -> float:
    """Distance in units of the last place of the exact number."""
    return float(abs(mpmath.mpf(found) - exact)) / math.ulp(float(exact))


@given(angles)
@example(0.5 * math.pi)
@example(math.pi)
@example(1.5 * math.pi)
@example(0.25 * math.pi)
@example(5e-324)
def test_sine_and_cosine_are_exact_to_two_units_of_the_last_place(angle: float) -> None:
    """Oracle: mpmath with 60 digits; the mirror image, bit by bit."""
    sine, cosine = sine_cosine(angle)
    assert sine_cosine(-angle) == (-sine, cosine)
    with mpmath.workdps(60):
        assert ulps(sine, mpmath.sin(mpmath.mpf(angle))) <= 2.0
        assert ulps(cosine, mpmath.cos(mpmath.mpf(angle))) <= 2.0


@given(lengths, lengths, signs, signs)
def test_an_angle_is_exact_to_two_units_of_the_last_place(across: float, along: float, up: float, on: float) -> None:
    """Oracle: mpmath's atan2 with 60 digits; the mirror image, bit by bit."""
    assert angle_of(-up * across, on * along) == -angle_of(up * across, on * along)
    with mpmath.workdps(60):
        assert ulps(angle_of(up * across, on * along), mpmath.atan2(up * across, on * along)) <= 2.0


@pytest.mark.parametrize(
    ("across", "along", "angle"),
    [(0.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, -2.0, math.pi), (3.0, 0.0, 0.5 * math.pi), (-3.0, 0.0, -0.5 * math.pi)],
)
def test_angles_of_the_axes(across: float, along: float, angle: float) -> None:
    """Oracle: math.atan2, and zero for no direction."""
    assert angle_of(across, along) == angle


@given(st.floats(-1e3, 1e3))
@example(math.pi)
@example(3.0 * math.pi)
def test_an_angle_less_its_turns_is_the_same_direction_within_a_half_turn(angle: float) -> None:
    """Oracle: what is taken away is a whole number of turns; the mirror image, bit by bit."""
    left = wrap(angle)
    turns = (angle - left) / math.tau
    assert abs(left) <= math.pi + math.ulp(abs(angle)) * 2
    assert abs(turns - round(turns)) <= 1e-12
    assert wrap(-angle) == -left


@given(st.floats(1e-300, 1e300))
def test_a_root_of_order_sixteen(number: float) -> None:
    """Oracle: mpmath's root with 60 digits."""
    with mpmath.workdps(60):
        assert ulps(sixteenth_root(number), mpmath.root(mpmath.mpf(number), 16)) <= 2.0


@pytest.mark.parametrize(("number", "sign"), [(2.0, 1), (5e-324, 1), (0.0, 0), (-0.0, 0), (-2.0, -1), (math.nan, 0)])
def test_the_sign_of_a_number(number: float, sign: int) -> None:
    """Oracle: what is larger than zero is positive, what is smaller is negative, all else is zero."""
    assert sign_of(number) == sign
