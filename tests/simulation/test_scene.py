"""Laws, slopes and launches: every field is checked, and what is derived agrees with its definition."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.shapes import rod

SEGMENT = {"mass": 1.0, "radius": 0.1, "eccentricity": 0.05, "inertia": 7.5e-3, "half_angle": 1.9}
CHECKED: dict[Any, dict[str, Any]] = {  # what checks its fields
    segment: SEGMENT,
    Body: {"mass": 1.0, "inertia": 0.1, "arcs": rod(1.0, 1.0).arcs},
    ContactLaw: {"stiffness": 1e6, "asymmetry": 0.5, "friction": 0.1, "rolling_arm": 1e-3, "corner_rolling_arm": 0.0},
    Slope: {"angle": 0.1, "length": 10.0, "gravity": 9.81},
    Zone: dict(zip(Zone._fields, (1.0, 2.0, 0.1, 1e-3, 0.0, 0.5, 1e6), strict=True)),
    State: {"x": 0.0, "y": 1.0, "phi": 0.5, "u": 1.0, "v": -1.0, "omega": 2.0},
}


@pytest.mark.parametrize("kind", CHECKED, ids=lambda kind: kind.__name__)
def test_a_field_is_a_float_and_checked_in_whatever_way_it_is_given(kind: Any) -> None:
    """Oracle: the kernel reads doubles; the error of a new one, and the object itself after pickling."""
    given = CHECKED[kind]
    numbers = {field: value for field, value in given.items() if isinstance(value, float)}
    for convert in (np.float32, np.float64, lambda value: int(value) if value == int(value) else value):
        made = kind(**given | {field: convert(value) for field, value in numbers.items()})
        assert {type(getattr(made, field)) for field in numbers} == {float}
    change = made.replace if isinstance(made, Body) else made._replace
    for field in given:
        with pytest.raises((ValueError, TypeError), match=rf"{kind.__name__}\.{field} = nan: must be"):
            change(**{field: math.nan})
    again = pickle.loads(pickle.dumps(made))
    assert type(again) is type(change()) is type(made)
    assert again == change() == made
    if not isinstance(made, Body):
        with pytest.raises(ValueError, match=rf"{kind.__name__}\.{made._fields[0]} = nan"):
            type(made)._make([math.nan, *made[1:]])


def test_the_ends_of_the_ranges_are_accepted() -> None:
    """Oracle: the ranges in the docstrings: no losses, no gravity, a slope without end."""
    assert ContactLaw(1e6, 0.0, 0.0, 0.0).corner_rolling_arm == 0.0
    assert Slope(-1.5, math.inf, 0.0) == (-1.5, math.inf, 0.0, (), (), (), 1.2)
    assert Zone(-1.0, math.inf, 0.0, 0.0) == (-1.0, math.inf, 0.0, 0.0, 0.0, None, None)
    assert Zone(0.0, 1.0, 0.0, 0.0, restitution=1.0).restitution == 1.0
    assert Slope(0.1, 5.0, 9.81, [Zone(-1.0, 2.0, 0.1, 0.0), (2.0, 5.0, 0.0, 0.0, 0.0)]).zones[1].begin == 2.0
    assert len(Slope(0.1, zones=[Zone(k, k + 1, 0.1, 0.0) for k in range(8)]).row) == 59
    assert len(Slope(0.1, profile=np.column_stack([np.arange(16384), np.arange(16384) % 2])).profile) == 16384
    assert len(Slope(0.1, profile=[(0.0, 0.0), (1.0, 5.67)]).profile) == 2
    assert len(Slope(0.1, profile=[(-1e300, 0.0), (0.0, 1e300), (1e300, 0.0)]).profile) == 3  # no number is squared


def test_a_row_has_nan_where_a_zone_has_nothing_of_its_own() -> None:
    """Oracle: the fields, by hand; what is given by name leaves the others out."""
    zone = Zone(1.0, 2.0, 0.1, 0.2, 0.3, stiffness=1e5)
    np.testing.assert_array_equal(zone.row, [1.0, 2.0, 0.1, 0.2, 0.3, math.nan, 1e5])
    np.testing.assert_array_equal(Slope(0.1, zones=[zone]).row, [0.1, math.inf, 9.81, *zone.row])
    assert list(zone.given()) == ["begin", "end", "friction", "rolling_arm", "corner_rolling_arm", "stiffness"]
    assert eval(repr(zone)) == zone  # as one types it


def test_restitution_is_that_of_the_asymmetry() -> None:
    """Oracle: e = sqrt((1 - Delta)/(1 + Delta)); Delta = 0.6 gives e = 0.5; springs need an asymmetry below 1."""
    for asymmetry, restitution in ((0.6, 0.5), (0.0, 1.0), (1.0, 0.0)):
        assert ContactLaw(1e6, asymmetry, 0.1, 0.0).restitution == pytest.approx(restitution, rel=1e-15)
    assert _law_of(0.0).asymmetry == 1.0
    for small in (1e-9, 1e-300):
        assert 0.0 < _law_of(small).restitution < 1e-7


def _law_of(restitution: float) -> ContactLaw:
    return ContactLaw.from_restitution(restitution, stiffness=1e6, friction=0.1, rolling_arm=0.0)


HILL = ((-1.0, 0.0), (0.0, 1.0), (2.0, 0.5))


@pytest.mark.parametrize("given", [HILL, [list(vertex) for vertex in HILL], np.array(HILL), list(map(np.array, HILL))])
def test_a_profile_is_pairs_of_floats_however_it_is_given(given: Any) -> None:
    """Oracle: the pairs; equality, hash, pickle, repr and a changed field go with them."""
    slope = Slope(0.1, 50.0, profile=given)
    assert slope.profile == HILL
    assert {type(number) for vertex in slope.profile for number in vertex} == {float}
    assert slope == Slope(0.1, 50.0, profile=HILL) == eval(repr(slope)) == pickle.loads(pickle.dumps(slope))
    assert hash(slope) == hash(Slope(0.1, 50.0, profile=HILL))
    assert slope != Slope(0.1, 50.0)
    assert slope._replace(angle=0.2).profile == HILL
    assert slope.row == (0.1, 50.0, 9.81)
    assert slope.vertices.flags.c_contiguous
    np.testing.assert_array_equal(slope.vertices, [(*vertex, 0.0) for vertex in HILL])


@pytest.mark.parametrize("given", [[0.0, 2.0, 0.5], np.array([0.0, 2.0, 0.5]), (0, 2, 0.5)])
def test_vertices_are_rounded_with_one_radius_or_one_each(given: Any) -> None:
    """Oracle: what is given; vertices that are left out take their radii with them, and no radius is none."""
    slope = Slope(0.1, 50.0, profile=HILL, rounding=given)
    assert slope.rounding == (0.0, 2.0, 0.5)
    np.testing.assert_array_equal(slope.vertices[:, 2], given)
    assert Slope(*slope) == slope == pickle.loads(pickle.dumps(slope)) == eval(repr(slope))
    assert Slope(0.1, profile=HILL, rounding=3.0).rounding == (3.0, 3.0, 3.0)
    assert Slope(0.1, profile=HILL, rounding=math.inf).rounding == (math.inf,) * 3
    assert Slope(0.1, profile=HILL, rounding=[0.0, 0.0, 0.0]).rounding == Slope(0.1, rounding=1.0).rounding == ()
    straight = Slope(0.1, profile=[(-1.0, 0.0), (0.0, 1.0), (1.0, 0.75), (2.0, 0.5)], rounding=[1.0, 2.0, 3.0, 4.0])
    assert straight.rounding == (1.0, 2.0, 4.0)


def test_vertices_without_a_turn_are_left_out() -> None:
    """Oracle: by hand: in the middle, at a level end, and all of them."""
    assert Slope(0.1, profile=[(0, 0), (1, 0), (2, 1), (2.5, 1.5), (3, 2), (5, 2)]).profile == ((1.0, 0.0), (3.0, 2.0))
    assert Slope(0.1, profile=[(0, 0), (1, 0), (2, 0)]).profile == ()
    assert Slope(0.1, profile=[(0, -0.0), (1, 0)]) == Slope(0.1)
    assert Slope(0.1, profile=[(0, 2), (1, 2), (2, 2)]).profile == ((0.0, 2.0), (2.0, 2.0))
    assert len(Slope(0.1, profile=[(0, 0), (1, 0), (2, 2e-13), (3, 2e-13)]).profile) == 2


@given(
    st.lists(st.tuples(st.floats(0.05, 5.0), st.integers(-13, 13)), min_size=1, max_size=6),
    st.lists(st.floats(0.0, 1.0), max_size=40),
)
def test_how_straight_pieces_are_cut_changes_no_bit(pieces: list[tuple[float, int]], cuts: list[float]) -> None:
    """Oracle: the profile that is not cut; what is made of a profile that was made is that profile."""
    lengths, angles = np.array(pieces).T
    x, y = np.r_[0.0, np.cumsum(lengths)], np.r_[0.0, np.cumsum(lengths * np.tan(0.1 * angles))]
    whole = Slope(0.1, profile=np.column_stack([x, y]))
    assert Slope(0.1, profile=whole.profile) == whole
    places = np.unique(np.r_[x, -1.0 + (x[-1] + 2.0) * np.array(cuts)])
    places = places[np.isin(places, x) | (np.abs(places[:, np.newaxis] - x).min(axis=1) > 1e-3)]
    places = places[np.isin(places, x) | np.r_[True, np.diff(places) > 1e-3]]
    cut = Slope(0.1, profile=np.column_stack([places, np.interp(places, x, y)]))
    assert cut.profile == whole.profile


def test_small_turns_add_up() -> None:
    """Oracle: a circle whose 2,000 vertices turn by 1e-14 each: what is left out lies less than that off the rest."""
    x = np.linspace(0.0, 1000.0, 2001)
    arc = np.column_stack([x, 0.5e-14 * (x**2 - 1000.0 * x)])
    slope = Slope(0.1, profile=arc)
    assert 2 <= len(slope.profile) < 2001
    assert np.abs(slope.height_at(x) - arc[:, 1]).max() < 2e-11
