"""Laws, slopes and launches: every field is checked, and what is derived agrees with its definition."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sledenv.simulation.scene import ContactLaw, Slope, Zone


def test_the_ends_of_the_ranges_are_accepted() -> None:
    """Oracle: the ranges in the docstrings: no losses, no gravity, a slope without end."""
    assert ContactLaw(1e6, 0.0, 0.0, 0.0).corner_rolling_arm == 0.0
    assert Slope(-1.5, math.inf, 0.0) == (-1.5, math.inf, 0.0, (), (), (), 1.2)
    assert Slope(0.1) == (0.1, math.inf, 9.81, (), (), (), 1.2)
    assert Zone(-1.0, math.inf, 0.0, 0.0) == (-1.0, math.inf, 0.0, 0.0, 0.0, None, None)
    assert Zone(0.0, 1.0, 0.0, 0.0, restitution=1.0).restitution == 1.0
    assert Slope(0.1, 5.0, 9.81, [Zone(-1.0, 2.0, 0.1, 0.0), (2.0, 5.0, 0.0, 0.0, 0.0)]).zones[1].begin == 2.0
    assert len(Slope(0.1, zones=[Zone(k, k + 1, 0.1, 0.0) for k in range(8)]).row) == 59


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
    ([Zone(k, k + 0.5, 0.1, 0.0) for k in range(65)], ValueError, "Slope.zones holds 65: must hold at most 64"),
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


def test_a_row_has_nan_where_a_zone_has_nothing_of_its_own() -> None:
    """Oracle: the fields, by hand; what is given by name leaves the others out."""
    zone = Zone(1.0, 2.0, 0.1, 0.2, 0.3, stiffness=1e5)
    np.testing.assert_array_equal(zone.row, [1.0, 2.0, 0.1, 0.2, 0.3, math.nan, 1e5])
    np.testing.assert_array_equal(Slope(0.1, zones=[zone]).row, [0.1, math.inf, 9.81, *zone.row])
    assert list(zone.given()) == ["begin", "end", "friction", "rolling_arm", "corner_rolling_arm", "stiffness"]
    assert eval(repr(zone)) == zone  # as one types it


@pytest.mark.parametrize("end", [1.0, 0.5])
def test_a_zone_without_length_is_refused(end: float) -> None:
    """Oracle: the message: field, value and range."""
    with pytest.raises(ValueError, match=rf"Zone\.end = {end}: must be > Zone\.begin = 1\.0 m"):
        Zone(1.0, end, 0.1, 0.0)


def test_restitution_is_that_of_the_asymmetry() -> None:
    """Oracle: e = sqrt((1 - Delta)/(1 + Delta)); Delta = 0.6 gives e = 0.5, 0 an elastic contact, 1 a plastic one."""
    assert ContactLaw(1e6, 0.6, 0.1, 0.0).restitution == pytest.approx(0.5, rel=1e-15)
    assert ContactLaw(1e6, 0.0, 0.1, 0.0).restitution == 1.0
    assert ContactLaw(1e6, 1.0, 0.1, 0.0).restitution == 0.0


@given(st.floats(1e-3, 1.0))
def test_a_law_built_from_the_restitution_has_it(restitution: float) -> None:
    """Oracle: the round trip; 1 - Delta = 2 e^2/(1 + e^2) is rounded to 1e-16."""
    law = ContactLaw.from_restitution(
        restitution, stiffness=2e6, friction=0.3, rolling_arm=0.01, corner_rolling_arm=0.02
    )
    assert law.restitution == pytest.approx(restitution, rel=1e-15 + 1e-16 / restitution**2)
    assert (law.stiffness, law.friction, law.rolling_arm, law.corner_rolling_arm) == (2e6, 0.3, 0.01, 0.02)


@pytest.mark.parametrize("value", [-0.1, 1.0 + 1e-15, math.nan])
def test_a_restitution_outside_its_range_is_refused_by_name(value: float) -> None:
    """Oracle: the documented range."""
    with pytest.raises(ValueError, match=r"ContactLaw\.restitution = .*: must be in \[0, 1\]"):
        ContactLaw.from_restitution(value, stiffness=1e6, friction=0.1, rolling_arm=0.0)


@pytest.mark.parametrize("restitution", [1e-9, 1e-300])
def test_no_restitution_but_0_is_taken_for_that(restitution: float) -> None:
    """Oracle: springs need an asymmetry below 1; 0 has the asymmetry 1."""
    assert 0.0 < _law_of(restitution).restitution < 1e-7
    assert _law_of(0.0).asymmetry == 1.0


def _law_of(restitution: float) -> ContactLaw:
    return ContactLaw.from_restitution(restitution, stiffness=1e6, friction=0.1, rolling_arm=0.0)


HILL = ((-1.0, 0.0), (0.0, 1.0), (2.0, 0.5))


@pytest.mark.parametrize("given", [HILL, [list(vertex) for vertex in HILL], np.array(HILL), list(map(np.array, HILL))])
def test_a_profile_is_pairs_of_floats_however_it_is_given(given: Any) -> None:
    """Oracle: the pairs; equality, hash, pickle, repr and a changed field go with them."""
    slope = Slope(0.1, 50.0, profile=given)
    assert slope.profile == HILL
    assert {type(number) for vertex in slope.profile for number in vertex} == {float}
    assert slope == Slope(0.1, 50.0, profile=HILL)
    assert hash(slope) == hash(Slope(0.1, 50.0, profile=HILL))
    assert slope != Slope(0.1, 50.0)
    assert slope._replace(angle=0.2).profile == HILL
    assert eval(repr(slope)) == slope  # as one types it
    again = pickle.loads(pickle.dumps(slope))
    assert type(again) is Slope
    assert again == slope
    assert slope.row == (0.1, 50.0, 9.81)
    assert slope.vertices.dtype == float
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


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        (-0.1, ValueError, "Slope.rounding = -0.1: must be in [0, inf] m"),
        (math.nan, ValueError, "Slope.rounding = nan: must be in [0, inf] m"),
        ("1", TypeError, "Slope.rounding = '1': must be a number"),
        ([1.0, 2.0], ValueError, "Slope.rounding holds 2 numbers: must hold one for each of 3 vertices"),
        ([1.0, -2.0, 0.0], ValueError, "Slope.rounding[1] = -2.0: must be in [0, inf] m"),
        ([1.0, "a", 0.0], TypeError, "Slope.rounding[1] = 'a': must be a number"),
    ],
)
def test_a_radius_that_is_none_is_told(given: Any, error: type[Exception], message: str) -> None:
    """Oracle: the message: field, value and range."""
    with pytest.raises(error) as caught:
        Slope(0.1, profile=HILL, rounding=given)
    assert message in str(caught.value)


def test_a_plane_has_no_vertices() -> None:
    """Oracle: the shape that kernels take; heights of 0."""
    for slope in (Slope(0.1), Slope(0.1, profile=[]), Slope(0.1, profile=np.empty((0, 2)))):
        assert slope.profile == ()
        assert slope.vertices.shape == (0, 3)
        np.testing.assert_array_equal(slope.height_at([[1.0, 2.0]]), [[0.0, 0.0]])


def test_heights_go_straight_from_vertex_to_vertex_and_level_beyond() -> None:
    """Oracle: by hand."""
    slope = Slope(0.1, profile=HILL)
    np.testing.assert_allclose(
        slope.height_at([-9.0, -1.0, -0.25, 0.0, 1.0, 2.0, 9.0]), [0, 0, 0.75, 1, 0.75, 0.5, 0.5]
    )
    assert slope.height_at(1.0).shape == ()
    with pytest.raises(TypeError, match="x = 'there': must be numbers"):
        slope.height_at("there")  # type: ignore[arg-type]


BAD_PROFILES = [
    (3.0, TypeError, "Slope.profile = 3.0: must be a sequence of pairs (x, y) of numbers, or an array of shape (n, 2)"),
    ("hill", TypeError, "Slope.profile = 'hill': must be a sequence of pairs"),
    (None, TypeError, "Slope.profile = None: must be a sequence of pairs"),
    ([(0.0, 0.0), (1.0, [2.0])], TypeError, "Slope.profile[1].y = [2.0]: must be a number"),
    ({0.0: 1.0}, TypeError, "Slope.profile = {0.0: 1.0}: must be a sequence of pairs"),
    ([(0.0, 0.0), 1.0], TypeError, "Slope.profile[1] = 1.0: must be a pair (x, y) of numbers"),
    ([(0.0, 0.0), (1.0, 2.0, 3.0)], TypeError, "Slope.profile[1] = (1.0, 2.0, 3.0): must be a pair"),
    ([(0.0, 0.0), (1.0, "high")], TypeError, "Slope.profile[1].y = 'high': must be a number"),
    ([(0.0, 0.0), (1.0, True)], TypeError, "Slope.profile[1].y = True: must be a number"),
    (np.zeros((2, 2), bool), TypeError, "Slope.profile holds bool: must hold numbers, columns x, y"),
    (np.array([["a", "b"], ["c", "d"]]), TypeError, "Slope.profile holds <U1: must hold numbers"),
    (np.ma.masked_array(np.array(HILL), np.zeros((3, 2), bool)), TypeError, "Slope.profile is a masked array"),
    ([(0.0, 0.0), np.ma.masked_array([1.0, 2.0])], TypeError, "Slope.profile[1] is a masked array"),
    (np.zeros(4), ValueError, "Slope.profile has shape (4,): must be (n, 2), columns x, y"),
    (np.zeros((4, 3)), ValueError, "Slope.profile has shape (4, 3): must be (n, 2)"),
    (
        np.array([[0.0, 0.0], [1.0, np.nan]]),
        ValueError,
        "Slope.profile[1].y = nan: must be a finite number",
    ),
    ([(0.0, 0.0), (math.inf, 1.0)], ValueError, "Slope.profile[1].x = inf: must be a finite number"),
    ([(0.0, 0.0)], ValueError, "Slope.profile holds 1: must hold no vertex, or 2 to 16384"),
    (np.zeros((16385, 2)), ValueError, "Slope.profile holds 16385: must hold no vertex, or 2 to 16384"),
    ([(0.0, 0.0), (0.0, 1.0)], ValueError, "Slope.profile[1].x = 0.0: must be > that of the vertex before, 0.0 m"),
    ([(0.0, 0.0), (2.0, 1.0), (1.0, 0.0)], ValueError, "Slope.profile[2].x = 1.0: must be > that of the vertex before"),
    ([(0.0, 0.0), (1.0, 5.7)], ValueError, "Slope.profile[1].y = 5.7: must be in [-5.67"),
    ([(0.0, 0.0), (1.0, -5.7)], ValueError, "at most 80 degrees steep to the plane"),
]


@pytest.mark.parametrize(("profile", "error", "message"), BAD_PROFILES, ids=lambda value: str(value)[:40])
def test_a_bad_profile_is_named(profile: Any, error: type[Exception], message: str) -> None:
    """Oracle: the message: field, value and range."""
    with pytest.raises(error) as caught:
        Slope(0.1, profile=profile)
    assert message in str(caught.value)
    with pytest.raises(error):
        Slope(0.1)._replace(profile=profile)


def test_the_limits_of_a_profile_are_accepted() -> None:
    """Oracle: the ranges in the docstring; places so far apart that their squares overflow are numbers too."""
    assert len(Slope(0.1, profile=np.column_stack([np.arange(16384), np.arange(16384) % 2])).profile) == 16384
    assert len(Slope(0.1, profile=[(0.0, 0.0), (1.0, 5.67)]).profile) == 2
    assert len(Slope(0.1, profile=[(-1e300, 0.0), (0.0, 1e300), (1e300, 0.0)]).profile) == 3


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
