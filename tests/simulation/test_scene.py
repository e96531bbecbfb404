"""Laws, slopes and launches: every field is checked, and what is derived agrees with its definition."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sledenv.simulation.bodies import segment
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.simulate import simulate

GOOD: dict[Any, dict[str, float]] = {
    ContactLaw: {
        "stiffness": 1e6,
        "asymmetry": 0.5,
        "friction": 0.1,
        "rolling_arm": 1e-3,
        "corner_rolling_arm": 0.0,
    },
    Slope: {"angle": 0.1, "length": 10.0, "gravity": 9.81},
    Zone: {"begin": 1.0, "end": 2.0, "friction": 0.1, "rolling_arm": 1e-3, "corner_rolling_arm": 0.0},
    State: {"x": 0.0, "y": 1.0, "phi": 0.5, "u": 1.0, "v": -1.0, "omega": 2.0},
}
BELOW_ZERO = -1e-300
OUT_OF_RANGE = [
    (ContactLaw, "stiffness", [0.0, -1.0], "(0, inf)"),
    (ContactLaw, "asymmetry", [BELOW_ZERO, 1.0, 2.0], "[0, 1)"),
    (ContactLaw, "friction", [BELOW_ZERO], "[0, inf)"),
    (ContactLaw, "rolling_arm", [BELOW_ZERO], "[0, inf)"),
    (ContactLaw, "corner_rolling_arm", [BELOW_ZERO], "[0, inf)"),
    (Slope, "angle", [math.pi / 2, -math.pi / 2, 3.0], "(-pi/2, pi/2) rad"),
    (Slope, "length", [0.0, -1.0], "(0, inf] m"),
    (Slope, "gravity", [BELOW_ZERO], "[0, inf)"),
    (Zone, "begin", [], "a finite number"),
    (Zone, "end", [], "(-inf, inf] m"),
    (Zone, "friction", [BELOW_ZERO], "[0, inf)"),
    (Zone, "rolling_arm", [BELOW_ZERO], "[0, inf)"),
    (Zone, "corner_rolling_arm", [BELOW_ZERO], "[0, inf)"),
    *((State, field, [], "a finite number") for field in State._fields),
]
MAY_BE_INFINITE = {(Slope, "length"), (Zone, "end")}


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
    with pytest.raises(TypeError, match=r"ContactLaw\.stiffness = .*: must be a number in \(0, inf\)"):
        ContactLaw(value, 0.5, 0.1, 1e-3)


def test_the_ends_of_the_ranges_are_accepted() -> None:
    """Oracle: the ranges in the docstrings: no losses, no gravity, a slope without end."""
    assert ContactLaw(1e6, 0.0, 0.0, 0.0).corner_rolling_arm == 0.0
    assert Slope(-1.5, math.inf, 0.0) == (-1.5, math.inf, 0.0, ())
    assert Slope(0.1) == (0.1, math.inf, 9.81, ())
    assert Zone(-1.0, math.inf, 0.0, 0.0) == (-1.0, math.inf, 0.0, 0.0, 0.0)
    assert Slope(0.1, 5.0, 9.81, [Zone(-1.0, 2.0, 0.1, 0.0), (2.0, 5.0, 0.0, 0.0, 0.0)]).zones[1].begin == 2.0
    assert len(Slope(0.1, zones=[Zone(k, k + 1, 0.1, 0.0) for k in range(8)]).row) == 43


PATCH = Zone(1.0, 2.0, 0.1, 0.0)
BAD_ZONES = [
    (PATCH, TypeError, f"Slope.zones = {PATCH!r}: must be a sequence of Zone"),
    ("ice", TypeError, "Slope.zones = 'ice': must be a sequence of Zone"),
    (3.0, TypeError, "Slope.zones = 3.0: must be a sequence of Zone"),
    (None, TypeError, "Slope.zones = None: must be a sequence of Zone"),
    ([PATCH, 3.0], TypeError, "Slope.zones[1] = 3.0: must be a Zone, or as many numbers: begin, end, friction"),
    ([PATCH, PATCH[:3]], TypeError, "Slope.zones[1] = (1.0, 2.0, 0.1): must be a Zone"),
    ([(1.0, 2.0, -0.1, 0.0, 0.0)], ValueError, "Zone.friction = -0.1: must be in [0, inf)"),
    ([PATCH, PATCH], ValueError, "Slope.zones[1].begin = 1.0: must be >= the end of the zone before, 2.0 m"),
    ([PATCH._replace(end=20.0)], ValueError, "Slope.zones[0].end = 20.0: must be <= Slope.length = 10.0 m, or inf"),
    ([PATCH._replace(begin=10.0, end=math.inf)], ValueError, "Slope.zones[0].begin = 10.0: must be < Slope.length"),
    ([Zone(k, k + 0.5, 0.1, 0.0) for k in range(9)], ValueError, "Slope.zones holds 9: must hold at most 8"),
]


@pytest.mark.parametrize(("zones", "error", "message"), BAD_ZONES, ids=str)
def test_bad_zones_are_named(zones: Any, error: type[Exception], message: str) -> None:
    """Oracle: the message: field, value and range."""
    with pytest.raises(error) as caught:
        Slope(0.1, 10.0, zones=zones)
    assert message in str(caught.value)
    with pytest.raises(error) as caught:
        Slope(0.1, 10.0)._replace(zones=zones)
    assert message in str(caught.value)


@pytest.mark.parametrize("end", [1.0, 0.5])
def test_a_zone_without_length_is_refused(end: float) -> None:
    """Oracle: the message: field, value and range."""
    with pytest.raises(ValueError, match=rf"Zone\.end = {end}: must be > Zone\.begin = 1\.0 m"):
        Zone(1.0, end, 0.1, 0.0)


@pytest.mark.parametrize("kind", [ContactLaw, Slope, State, Zone])
def test_every_field_is_a_float_whatever_it_was_given_as(kind: Any) -> None:
    """Oracle: one compiled specialisation; integers and numpy scalars would compile another."""
    for convert in (np.float32, np.float64, lambda value: int(value) if value == int(value) else value):
        made = kind(**{field: convert(value) for field, value in GOOD[kind].items()})
        assert {type(value) for value in made[: len(GOOD[kind])]} == {float}


@pytest.mark.parametrize("kind", [ContactLaw, Slope, State, Zone])
def test_a_changed_field_is_checked_too(kind: Any) -> None:
    """Oracle: the message of a new one; what has been made needs no second check."""
    made = kind(**GOOD[kind])
    for field in GOOD[kind]:
        with pytest.raises(ValueError, match=rf"{kind.__name__}.{field} = nan: must be"):
            made._replace(**{field: math.nan})
    with pytest.raises(ValueError, match=rf"{kind.__name__}.{kind._fields[0]} = nan"):
        kind._make([math.nan, *made[1:]])
    assert made._replace() == made


@pytest.mark.parametrize("kind", [ContactLaw, Slope, State, Zone])
def test_parameters_survive_pickling(kind: Any) -> None:
    """Oracle: the object itself; worker processes receive it."""
    made = kind(**GOOD[kind])
    again = pickle.loads(pickle.dumps(made))
    assert type(again) is kind
    assert again == made


def test_a_spool_on_its_axle_rolls_as_slowly_as_its_inertia_makes_it() -> None:
    """Oracle: g sin(beta)/(1 + J/(m r^2)), with far more inertia than mass within the axle could have."""
    spool, slope = segment(2.0, 0.01, 0.0, 2.0 * 0.1**2), Slope(math.radians(5.0), 0.5)
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
