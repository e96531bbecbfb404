"""Sections as they are surveyed: what is filled up, what it is measured over, and what is refused."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sledenv import Slope
from sledenv.scenarios.terrain import read_ground
from sledenv.simulation.terrain import Reader, checked_section

STEEPEST = math.radians(80.0)
READER = Reader("points", lambda k: f"x[{k}]", ("x", "z"), "steepest")
# An overhang, a step that goes up, a ledge under a roof, a fence with walls at both ends.
OVERHANG = [(0, 20), (10, 20), (9, 18), (9, 12), (10, 10), (15, 8), (30, 8)]
STEP = [(0, 0), (5, 0), (5, 6), (4, 9), (8, 9), (20, 10)]
SPIKE = [(0, 3), (0, 1), (2, 1), (2, 4), (2, 0), (5, 0), (5, 2)]
ROOF = [(0, 20), (10, 20), (5, 19.9), (5, 5), (30, 4)]


def highest_cone(points: np.ndarray, x: np.ndarray, slope: float) -> np.ndarray:
    """The lowest ground over a surface that has no steeper face, slowly: cones under 10,000 points a piece."""
    shares = np.linspace(0.0, 1.0, 10001)[:, np.newaxis]
    surface = np.concatenate([one + shares * (other - one) for one, other in pairwise(points)])
    return np.array([(surface[:, 1] - slope * np.abs(surface[:, 0] - place)).max() for place in x])


def wandering(seed: int) -> np.ndarray:
    """A surface with faces of all inclinations and small overhangs, whose points are drawn."""
    rng = np.random.default_rng(seed)
    along = rng.uniform(0.2, 1.5, 12)
    along[[3, 7]] = [-0.15, 0.0]
    up = rng.uniform(-2.0, 1.0, 12)
    up[[3, 7]] = [-1.0, 1.5]
    return np.column_stack([np.cumsum(along), np.cumsum(up)])


@pytest.mark.parametrize("steepest", [STEEPEST, math.radians(60.0)])
@pytest.mark.parametrize("surface", [OVERHANG, STEP, ROOF, SPIKE, *map(wandering, range(20))])
def test_what_is_too_steep_is_filled_by_the_lowest_ground_that_is_not(surface: Any, steepest: float) -> None:
    """Oracle: cones of the steepest face under every point of the surface."""
    points = np.array(surface, float)
    with pytest.warns(UserWarning, match="under what was filled up"):
        found = checked_section(points, points, READER, steepest)
    along, up = np.diff(found.vertices, axis=0).T
    assert (along > 0.0).all()
    assert (np.abs(up) <= math.tan(steepest) * along).all()
    x = np.linspace(found.vertices[0, 0], found.vertices[-1, 0], 500)
    expected = highest_cone(points, x, math.tan(steepest))
    np.testing.assert_allclose(np.interp(x, *found.vertices.T), expected, atol=0.02)
    again = checked_section(found.vertices, found.vertices, READER, steepest)
    assert again.vertices is found.vertices
    assert (again.moved, again.most) == (0, 0.0)


def test_an_overhang_is_told_by_its_points_and_by_how_far_they_are_from_the_ground() -> None:
    """Oracle: by hand. The face leans from the lip, (10, 20), at 80 degrees to the floor from (10, 10) to (15, 8)."""
    points = np.array(OVERHANG, float)
    with pytest.warns(
        UserWarning, match=r"^steepest: 3 of 7 points are under what was filled up, 2.37 m from the ground"
    ):
        found = checked_section(points, points, READER, STEEPEST)
    slope = math.tan(STEEPEST)
    foot = 10.0 + 10.0 / (slope - 0.4)
    expected = [(0, 20), (10, 20), (foot, 10.0 - 0.4 * (foot - 10.0)), (15, 8), (30, 8)]
    np.testing.assert_allclose(found.vertices, expected, rtol=1e-5)
    assert found.pieces.tolist() == [0, 1, 4, 5, 6]  # the face is of the piece that begins at the lip
    assert found.most == pytest.approx((10.0 - 9.0) * math.sin(STEEPEST) + 8.0 * math.cos(STEEPEST), rel=1e-5)


def test_terrain_in_python_is_that_of_a_file(tmp_path: Path) -> None:
    """Oracle: the reader of files, and the heights of the section over its plane, turned back."""
    x = np.array([-5.0, 0.0, 12.0, 40.0, 61.0])
    z = np.array([63.0, 61.5, 40.0, 31.0, 28.5])
    slope = Slope.from_terrain(x, z)
    lines = [f"{a!r},{b!r}" for a, b in zip(x.tolist(), z.tolist(), strict=True)]
    (tmp_path / "terrain.csv").write_text("\n".join(["x_m,z_m", *lines]))
    ground = read_ground(str(tmp_path / "terrain.csv"))
    assert slope.angle == math.radians(ground.angle_deg or 0.0) == pytest.approx(math.atan2(34.5, 66.0), abs=1e-8)
    np.testing.assert_array_equal(slope.profile, ground.vertices)
    assert slope.length == slope.profile[-1][0]
    sine, cosine = math.sin(slope.angle), math.cos(slope.angle)
    along, off = np.transpose(slope.profile)
    np.testing.assert_allclose(along * cosine + off * sine, x, atol=1e-9)
    np.testing.assert_allclose(off * cosine - along * sine + 61.5, z, atol=1e-9)
    level = Slope.from_terrain(x, z, angle=0.0, length=50.0, gravity=1.6)
    assert level[:3] == (0.0, 50.0, 1.6)
    np.testing.assert_allclose(level.profile, np.column_stack([x, z - 61.5]))


def test_an_overhang_in_python_needs_a_word_and_gets_no_spike() -> None:
    """Oracle: by hand, on a level plane: the lip stays, and no vertex is above the surface."""
    x, z = np.transpose(np.array(OVERHANG, float))
    with pytest.raises(ValueError, match=r"x\[2\]: x = 9: must be > 10 m, that of x\[1\]; .*; steepest, say"):
        Slope.from_terrain(x, z)
    with pytest.warns(UserWarning, match="3 of 7 points"):
        slope = Slope.from_terrain(x, z, angle=0.0, steepest=STEEPEST)
    assert float(slope.height_at(10.0)) == 0.0
    assert max(y for _, y in slope.profile) == 0.0
    assert slope.length == 30.0
