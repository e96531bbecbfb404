"""A ground told by vertices with radii: its arcs, and its heights."""

from __future__ import annotations

import doctest
import math

import numpy as np

from sledenv.simulation import bends as module
from sledenv.simulation.bends import bends, height_of

ROUNDED = np.array([(0.0, 0.0, 2.0), (4.0, 3.0, 0.5), (5.0, 1.0, 9.0), (8.0, 2.0, 0.0), (9.0, 2.0, 0.3)])
TURNS = np.diff([0.0, *np.arctan2(np.diff(ROUNDED[:, 1]), np.diff(ROUNDED[:, 0])), 0.0])


def test_an_arc_touches_both_pieces_at_the_same_distance_from_its_vertex() -> None:
    """Oracle: R tan(turn/2), 0.49 of the shorter piece at most; the centre is a radius from both ends, across."""
    found = bends(ROUNDED)
    pieces = np.hypot(*np.diff(ROUNDED[:, :2], axis=0).T)
    shorter = np.minimum(np.r_[math.inf, pieces], np.r_[pieces, math.inf])
    np.testing.assert_allclose(
        found.lengths, np.minimum(ROUNDED[:, 2] * np.tan(np.abs(TURNS) / 2), 0.49 * shorter), rtol=1e-13
    )
    np.testing.assert_array_equal(found.signs, [-1, 1, -1, 0, 0])
    for ends in (found.begins, found.ends):
        np.testing.assert_allclose(np.hypot(*(ends - ROUNDED[:, :2]).T), found.lengths, atol=1e-14)
        np.testing.assert_allclose(np.hypot(*(ends - found.centres).T), found.radii, atol=1e-13)
        across = ((ends - found.centres) * (ends - ROUNDED[:, :2])).sum(axis=1)
        np.testing.assert_allclose(across, 0.0, atol=1e-13)


def test_heights_lie_on_the_circles_and_on_the_pieces() -> None:
    """Oracle: Pythagoras around the centres; straight interpolation from arc to arc; level outside."""
    found = bends(ROUNDED)
    for k in (0, 1, 2):
        x = np.linspace(found.begins[k, 0], found.ends[k, 0], 9)
        centre, sign = found.centres[k], found.signs[k]
        circle = centre[1] + sign * np.sqrt(found.radii[k] ** 2 - (x - centre[0]) ** 2)
        np.testing.assert_allclose(height_of(ROUNDED, x), circle, atol=1e-13)
    corners = np.array([end for pair in zip(found.begins, found.ends, strict=True) for end in pair])
    x = np.r_[-7.0, 0.5 * (corners[1::2, 0][:-1] + corners[2::2, 0]), 50.0]
    np.testing.assert_allclose(height_of(ROUNDED, x), np.interp(x, *corners.T), atol=1e-13)


def test_a_nearly_straight_ground_has_exact_heights() -> None:
    """Oracle: the sagitta of a radius of a million kilometres, from its series."""
    turn, radius = 1e-9, 1e9
    rounded = np.array([(-9.0, 0.0, 0.0), (0.0, 0.0, radius), (9.0, 9.0 * turn, 0.0)])
    x = np.array([-0.25, 0.0, 0.25])
    np.testing.assert_allclose(height_of(rounded, x), (x + 0.5) ** 2 / (2.0 * radius), rtol=1e-9)


def test_sharp_and_missing_vertices_are_a_polyline() -> None:
    """Oracle: numpy.interp; the plane."""
    x = np.linspace(-1.0, 10.0, 34).reshape(2, 17)
    sharp = ROUNDED * [1.0, 1.0, 0.0]
    np.testing.assert_allclose(height_of(sharp, x), np.interp(x, *sharp[:, :2].T), atol=1e-14)
    np.testing.assert_array_equal(height_of(np.empty((0, 3)), x), np.zeros(x.shape))
    assert height_of(ROUNDED, 8.5).shape == ()
    assert all(len(column) == 0 for column in bends(np.empty((0, 3))))


def test_examples_are_true() -> None:
    """Oracle: their output."""
    assert doctest.testmod(module).failed == 0
