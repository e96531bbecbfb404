"""What a descent is given: every field is checked, and derived parameters agree with their definitions."""

from __future__ import annotations

import math
import pickle
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf

from sledenv.kernel import params as kernel_params
from sledenv.simulation.bodies import Body, circular_segment, sled, sled_rise
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import lowest_support, support_heights
from tests.oracles import segment_by_strips, support

SLED = {"mass": 120.0, "length": 1.2, "rocker_radius": 1.0, "mass_centre_height": 0.14, "gyration_radius": 0.38}
GOOD: dict[Any, dict[str, float]] = {
    Body: {"mass": 1.0, "radius": 0.1, "eccentricity": 0.05, "inertia": 7.5e-3, "half_angle": 1.9},
    ContactLaw: {
        "stiffness": 1e6,
        "asymmetry": 0.5,
        "friction": 0.1,
        "rolling_arm": 1e-3,
        "corner_rolling_arm": 0.0,
    },
    Slope: {"angle": 0.1, "length": 10.0, "gravity": 9.81},
    State: {"x": 0.0, "y": 1.0, "phi": 0.5, "u": 1.0, "v": -1.0, "omega": 2.0},
    circular_segment: {"mass": 1.0, "radius": 0.1, "half_angle": 1.9},
    sled: SLED,
}
BELOW_ZERO, ABOVE_HALF_TURN = -1e-300, math.nextafter(math.pi, 4.0)
OUT_OF_RANGE = [
    (Body, "mass", [0.0, -1.0], "(0, inf)"),
    (Body, "radius", [BELOW_ZERO], "[0, inf)"),
    (Body, "eccentricity", [BELOW_ZERO], "[0, inf)"),
    (Body, "inertia", [0.0, -1.0], "(0, inf)"),
    (Body, "half_angle", [0.0, -1.0, ABOVE_HALF_TURN], "(0, pi] rad"),
    (ContactLaw, "stiffness", [0.0, -1.0], "(0, inf)"),
    (ContactLaw, "asymmetry", [BELOW_ZERO, 1.0, 2.0], "[0, 1)"),
    (ContactLaw, "friction", [BELOW_ZERO], "[0, inf)"),
    (ContactLaw, "rolling_arm", [BELOW_ZERO], "[0, inf)"),
    (ContactLaw, "corner_rolling_arm", [BELOW_ZERO], "[0, inf)"),
    (Slope, "angle", [math.pi / 2, -math.pi / 2, 3.0], "(-pi/2, pi/2) rad"),
    (Slope, "length", [0.0, -1.0], "(0, inf] m"),
    (Slope, "gravity", [BELOW_ZERO], "[0, inf)"),
    *((State, field, [], "a finite number") for field in State._fields),
    (circular_segment, "mass", [0.0], "(0, inf)"),
    (circular_segment, "radius", [0.0], "(0, inf)"),
    (circular_segment, "half_angle", [0.0, ABOVE_HALF_TURN], "(0, pi] rad"),
    (sled, "mass", [0.0], "(0, inf)"),
    (sled, "length", [0.0, -1.0], "(0, inf)"),
    (sled, "rocker_radius", [0.0], "(0, inf)"),
    (sled, "mass_centre_height", [BELOW_ZERO], "[0, inf)"),
    (sled, "gyration_radius", [0.0], "(0, inf)"),
]
MAY_BE_INFINITE = {(Slope, "length")}


@pytest.mark.parametrize(("kind", "field", "values", "allowed"), OUT_OF_RANGE)
def test_a_number_outside_its_range_is_refused_by_name(
    kind: Any, field: str, values: list[float], allowed: str
) -> None:
    """Oracle: the range written beside the field; NaN and the infinities lie outside all of them but one; a word."""
    refused = [*values, math.nan, -math.inf]
    if (kind, field) not in MAY_BE_INFINITE:
        refused.append(math.inf)
    for value in refused:
        with pytest.raises(ValueError, match="must be") as caught:
            kind(**GOOD[kind] | {field: value})
        assert f"{kind.__name__}.{field} = {value!r}: must be" in str(caught.value)
        assert allowed in str(caught.value)
    with pytest.raises(TypeError, match="must be a number") as no_number:
        kind(**GOOD[kind] | {field: "steep"})
    assert f"{kind.__name__}.{field} = 'steep': must be a number" in str(no_number.value)
    assert allowed in str(no_number.value)


@pytest.mark.parametrize("value", [None, [1.0], {}, 1j, object, "1", b"1", np.array("1")], ids=repr)
def test_what_is_not_a_number_is_refused(value: Any) -> None:
    """Oracle: the documented TypeError for what is not a real number, of all fields by the same rule."""
    with pytest.raises(TypeError, match=r"Body\.mass = .*: must be a number in \(0, inf\)"):
        Body(value, 0.1, 0.05, 7.5e-3)


def test_the_ends_of_the_ranges_are_accepted() -> None:
    """Oracle: the ranges in the docstrings: a point, a full disc, no losses, no gravity, a slope without end."""
    assert Body(1.0, 0.0, 0.0, 1.0, math.pi).half_angle == math.pi
    assert ContactLaw(1e6, 0.0, 0.0, 0.0).corner_rolling_arm == 0.0
    assert Slope(-1.5, math.inf, 0.0) == (-1.5, math.inf, 0.0)
    assert Slope(0.1) == (0.1, math.inf, 9.81)
    assert Body(1.0, 0.1, 0.0, 1.0) == (1.0, 0.1, 0.0, 1.0, math.pi)


@pytest.mark.parametrize(
    ("radius", "eccentricity", "half_angle", "allowed"),
    [
        pytest.param(0.1, 0.11, math.pi, "[0.0, 0.1] m", id="disc"),
        pytest.param(0.1, 0.11, 3.0, "[0.0, 0.1] m", id="below the arc"),
        pytest.param(0.5, 0.2, 1.0, f"[{0.5 * math.cos(1.0)!r}, 0.5] m", id="beyond the chord"),
        pytest.param(0.0, 0.4, math.pi, "[0.0, 0.0] m", id="one end of a rod"),
        pytest.param(0.0, 0.4, 0.1, "[0.0, 0.0] m", id="both ends at one place"),
    ],
)
def test_a_mass_centre_outside_the_body_is_refused(
    radius: float, eccentricity: float, half_angle: float, allowed: str
) -> None:
    """Oracle: the geometry; at some orientation it would lie below the lowest point of the outline."""
    phi = np.linspace(-math.pi, math.pi, 1001)
    assert support(kernel_params.Body(1.0, radius, eccentricity, 1e-3, half_angle), phi).min() < 0.0
    with pytest.raises(ValueError, match=rf"^Body.eccentricity = {eccentricity}: must be in .* = {re.escape(allowed)}"):
        Body(1.0, radius, eccentricity, 1e-3, half_angle)


@given(st.floats(1e-3, 1e3), st.floats(1e-3, math.pi), st.floats(-0.5, 1.5))
def test_just_those_bodies_are_accepted_whose_mass_centre_never_passes_below_the_slope(
    radius: float, half_angle: float, share: float
) -> None:
    """Oracle: the lowest of the support heights over a fine grid, which holds the upright body and the chord."""
    least = max(radius * math.cos(half_angle), 0.0)
    eccentricity = least + share * (radius - least)
    assume(eccentricity >= 0.0)
    given_body = kernel_params.Body(1.0, radius, eccentricity, 1.0, half_angle)
    lowest = support(given_body, np.linspace(-math.pi, math.pi, 401)).min()
    assume(abs(lowest) > 1e-14 * radius)
    if lowest > 0.0:
        assert Body(*given_body) == given_body
    else:
        with pytest.raises(ValueError, match=r"Body\.eccentricity"):
            Body(*given_body)


@settings(deadline=None)  # the first call compiles
@given(st.floats(1e-6, math.pi / 2), st.floats(1e-3, 1e3))
def test_a_mass_centre_on_the_outline_is_accepted(half_angle: float, half_length: float) -> None:
    """Oracle: the support height of a thin rod is zero where it lies flat, however its place is rounded."""
    radius = half_length / math.sin(half_angle)
    for eccentricity in (half_length / math.tan(half_angle), radius * math.cos(half_angle), radius):
        body = Body(1.0, radius, min(eccentricity, radius), 1.0, half_angle)
        assert abs(lowest_support(body)) <= 1e-15 * radius


@settings(deadline=None)  # the first call compiles
@given(st.floats(1e-150, math.pi))
def test_every_segment_holds_its_mass_centre(half_angle: float) -> None:
    """Oracle: the mass centre of a lamina lies in its convex hull."""
    assert lowest_support(circular_segment(1.0, 1.0, half_angle)) >= 0.0


@pytest.mark.parametrize("kind", [Body, ContactLaw, Slope, State])
def test_every_field_is_a_float_whatever_it_was_given_as(kind: Any) -> None:
    """Oracle: one compiled specialisation; integers and numpy scalars would compile another."""
    for convert in (np.float32, np.float64, lambda value: int(value) if value == int(value) else value):
        made = kind(**{field: convert(value) for field, value in GOOD[kind].items()})
        assert {type(value) for value in made} == {float}


@pytest.mark.parametrize("kind", [Body, ContactLaw, Slope, State])
def test_a_changed_field_is_checked_too(kind: Any) -> None:
    """Oracle: the message of a new one; what has been made needs no second check."""
    made = kind(**GOOD[kind])
    for field in kind._fields:
        with pytest.raises(ValueError, match=rf"{kind.__name__}.{field} = nan: must be"):
            made._replace(**{field: math.nan})
    with pytest.raises(ValueError, match=rf"{kind.__name__}.{kind._fields[0]} = nan"):
        kind._make([math.nan, *made[1:]])
    assert made._replace() == made


@pytest.mark.parametrize("kind", [Body, ContactLaw, Slope, State])
def test_parameters_survive_pickling(kind: Any) -> None:
    """Oracle: the object itself; worker processes receive it."""
    made = kind(**GOOD[kind])
    again = pickle.loads(pickle.dumps(made))
    assert type(again) is kind
    assert again == made


@pytest.mark.parametrize("half_angle", [0.299, 0.3, 1.0, math.pi / 2, 1.895, 2.5, 3.1, math.pi])
def test_segment_has_the_mass_centre_and_the_inertia_of_its_lamina(half_angle: float) -> None:
    """Oracle: the lamina cut into strips and summed; small half-angles lose digits to cancellation, like alpha^-5."""
    body = circular_segment(3.0, 0.7, half_angle)
    eccentricity, about_arc_centre = segment_by_strips(0.7, half_angle)
    lost = 1e-13 * max(1.0, half_angle**-5)
    assert body.eccentricity == pytest.approx(eccentricity, rel=lost, abs=1e-16)
    assert body.inertia == pytest.approx(3.0 * (about_arc_centre - eccentricity**2), rel=lost)
    assert body[:2] == (3.0, 0.7)
    assert body.half_angle == half_angle


@pytest.mark.parametrize("half_angle", [1e-9, 1e-6, 1e-3, 0.03, 0.1, 0.299, math.pi / 2, math.pi])
def test_no_segment_loses_digits(half_angle: float) -> None:
    """Oracle: the closed form in 80 digits; of a half disc 4/(3 pi), of a disc 0 and 1/2."""
    with mp.workdps(80):
        alpha = mpf(half_angle)
        area = alpha - mp.sin(alpha) * mp.cos(alpha)
        eccentricity = 2 * mp.sin(alpha) ** 3 / (3 * area)
        inertia = (1 + 2 * mp.sin(alpha) ** 3 * mp.cos(alpha) / (3 * area)) / 2 - eccentricity**2
        body = circular_segment(1.0, 1.0, half_angle)
        assert body.inertia == pytest.approx(float(inertia), rel=2e-15, abs=0.0)
        assert body.eccentricity == pytest.approx(float(eccentricity), rel=3e-16, abs=1e-16)


@pytest.mark.parametrize("half_angle", [0.01, 0.3, 1.0, 2.0, 3.0, math.pi])
def test_no_lamina_has_more_inertia_than_masses_on_its_arc(half_angle: float) -> None:
    """docs/physics.md (8.12)."""
    body = circular_segment(2.0, 0.5, half_angle)
    assert body.inertia < 2.0 * (body.radius - body.eccentricity) * (body.radius + body.eccentricity)


def test_a_spool_on_its_axle_rolls_as_slowly_as_its_inertia_makes_it() -> None:
    """Oracle: g sin(beta)/(1 + J/(m r^2)), with far more inertia than mass within the axle could have."""
    spool, slope = Body(2.0, 0.01, 0.0, 2.0 * 0.1**2), Slope(math.radians(5.0), 0.5)
    law = ContactLaw.from_restitution(0.5, stiffness=1e9, friction=0.3, rolling_arm=0.0)
    descent = simulate(spool, law, slope, State(0.0, 0.01, 0.0), solver="rigid")
    acceleration = 9.81 * math.sin(slope.angle) / (1.0 + 100.0)
    assert descent.time == pytest.approx(math.sqrt(2.0 * slope.length / acceleration), rel=1e-9)


def test_restitution_is_that_of_the_asymmetry() -> None:
    """Oracle: e = sqrt((1 - Delta)/(1 + Delta)); Delta = 0.6 gives e = 0.5, Delta = 0 an elastic contact."""
    assert ContactLaw(1e6, 0.6, 0.1, 0.0).restitution == pytest.approx(0.5, rel=1e-15)
    assert ContactLaw(1e6, 0.0, 0.1, 0.0).restitution == 1.0


@given(st.floats(1e-3, 1.0))
def test_a_law_built_from_the_restitution_has_it(restitution: float) -> None:
    """Oracle: the round trip; 1 - Delta = 2 e^2/(1 + e^2) is rounded to 1e-16."""
    law = ContactLaw.from_restitution(
        restitution, stiffness=2e6, friction=0.3, rolling_arm=0.01, corner_rolling_arm=0.02
    )
    assert law.restitution == pytest.approx(restitution, rel=1e-15 + 1e-16 / restitution**2)
    assert (law.stiffness, law.friction, law.rolling_arm, law.corner_rolling_arm) == (2e6, 0.3, 0.01, 0.02)


@pytest.mark.parametrize("value", [0.0, -0.1, 1.0 + 1e-15, math.nan])
def test_a_restitution_outside_its_range_is_refused_by_name(value: float) -> None:
    """Oracle: the documented range; a compliant contact cannot have e = 0, for Delta = 1 would not push back."""
    with pytest.raises(ValueError, match=r"ContactLaw\.restitution = .*: must be in \(0, 1\]"):
        ContactLaw.from_restitution(value, stiffness=1e6, friction=0.1, rolling_arm=0.0)


def test_the_smallest_restitution_is_accepted() -> None:
    """Oracle: the documented range (0, 1]."""
    assert ContactLaw.from_restitution(1e-9, stiffness=1e6, friction=0.1, rolling_arm=0.0).restitution < 1e-8


def test_a_sled_has_the_lengths_it_is_given() -> None:
    """Oracle: a circle of radius 1 m; its chord of 1.2 m lies .2 m above the arc, a 3-4-5 triangle."""
    body = sled(**SLED)
    assert (body.mass, body.radius) == (120.0, 1.0)
    assert 2.0 * body.radius * math.sin(body.half_angle) == pytest.approx(1.2, rel=1e-15)
    assert body.radius * (1.0 - math.cos(body.half_angle)) == pytest.approx(0.2, rel=1e-14)
    assert lowest_support(body) == pytest.approx(0.2 - 0.14, rel=1e-12)  # it lies on its chord
    assert float(support_heights(body, np.zeros(1))[0]) == pytest.approx(0.14, rel=1e-15)
    assert math.sqrt(body.inertia / body.mass) == pytest.approx(0.38, rel=1e-15)


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        pytest.param("mass_centre_height", 0.2000001, "[0, 0.2]", id="above the chord"),
        pytest.param("rocker_radius", 0.5999999, "[length/2, inf) = [0.6, inf)", id="shorter than half the chord"),
        pytest.param("rocker_radius", 30.0, "mass_centre_height = 0.14: must be a number in [0, 0.0060", id="flat"),
    ],
)
def test_a_sled_whose_chord_does_not_close_it_is_refused(field: str, value: float, allowed: str) -> None:
    """Oracle: the sagitta of the arc."""
    with pytest.raises(ValueError, match=f"sled.{field} = {value}|below the chord") as caught:
        sled(**SLED | {field: value})
    assert allowed in str(caught.value)


@given(st.floats(0.3, 3.0), st.floats(0.5, 50.0), st.floats(0.0, 1.0))
def test_every_sled_that_is_accepted_is_a_body(length: float, times: float, share: float) -> None:
    """Oracle: ``Body`` itself, which refuses a mass centre outside the convex hull of arc and chord."""
    radius = length * times
    body = sled(100.0, length, radius, share * sled_rise(length, radius), 0.4)
    assert lowest_support(body) >= -1e-12 * radius
