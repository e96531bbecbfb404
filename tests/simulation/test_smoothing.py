"""A surveyed section told by few vertices with large radii."""

from __future__ import annotations

import doctest
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from sledenv.simulation import smoothing
from sledenv.simulation.bends import bends
from sledenv.simulation.smoothing import fit_ground

Floats = NDArray[np.float64]

MIRRORED = np.array([-1.0, 1.0, 1.0])
STAIRS = np.array(
    [
        (0.0, 0.0),
        *((0.3 * k + dx, -0.15 * (k - back)) for k in range(1, 9) for dx, back in ((0.0, 1), (0.03, 0))),
        (4.0, -1.2),
    ]
)
CLIFFS = np.array(
    [(0, 0), (10, -2), (12, -2.2), (13.5, -10), (20, -12), (20.6, -15), (30, -16), (31, -15.7), (90, -30)]
)


def surveyed(hill: Callable[[Floats], Floats], length: float, step: float, noise: float = 0.0, seed: int = 0) -> Floats:
    """Points of a hill each ``step``, with normally distributed errors."""
    x = np.linspace(0.0, length, round(length / step) + 1)
    return np.column_stack([x, hill(x) + np.random.default_rng(seed).normal(0.0, noise, len(x))])


def waves(x: Floats) -> Floats:
    """Three sines, with radii from 4.7 m."""
    return np.sin(2 * np.pi * x / 25) + 0.3 * np.sin(2 * np.pi * x / 9.3 + 1) + 0.8 * np.sin(2 * np.pi * x / 60 + 2)


def swell(x: Floats) -> Floats:
    """A hill that begins and ends level, with radii from 63 m."""
    return 1.0 - np.cos(2 * np.pi * x / 50)


def heights(rounded: Floats, x: Floats) -> Floats:
    """Heights by Pythagoras, from the circles around the centres, and straight lines between them."""
    arcs = bends(rounded)
    ends = np.stack([arcs.begins, arcs.ends], axis=1).reshape(-1, 2)
    found = np.interp(x, *ends.T)
    for sign, radius, (cx, cy), begin, end in zip(
        arcs.signs, arcs.radii, arcs.centres, arcs.begins[:, 0], arcs.ends[:, 0], strict=True
    ):
        on = (x > begin) & (x < end) & (sign != 0.0)
        found[on] = cy + sign * np.sqrt(np.maximum(radius**2 - (x[on] - cx) ** 2, 0.0))
    return found


def largest_difference(section: Floats, rounded: Floats) -> float:
    """Largest difference [m] at places that are dense all over the section and beyond it."""
    (low, high), wide = section[[0, -1], 0], np.ptp(section[:, 0])
    points = np.r_[section[:, 0], rounded[:, 0], bends(rounded).begins[:, 0], bends(rounded).ends[:, 0]]
    x = np.sort(np.r_[np.linspace(low - 0.6 * wide, high + 0.6 * wide, 20_001), points])
    x = np.r_[x, 0.5 * (x[1:] + x[:-1])]
    return float(np.abs(heights(rounded, x) - np.interp(x, *section.T)).max())


def check(section: Floats, tolerance: float) -> Floats:
    """Fit a section, hold what holds always, and return the fit."""
    rounded = fit_ground(section, tolerance)
    assert 2 <= len(rounded) <= len(section)
    along, up = np.diff(rounded[:, :2], axis=0).T
    assert (along > 0.0).all()
    assert (np.abs(up) <= math.tan(math.radians(80.0)) * along * (1.0 + 1e-12)).all()
    assert rounded[0, 0] >= section[0, 0]
    assert rounded[-1, 0] <= section[-1, 0]
    np.testing.assert_array_equal(rounded[[0, -1], 1], section[[0, -1], 1])
    assert (rounded[:, 2] >= 0.0).all()
    rounding = 1e-9 * np.abs(section).max()  # of circles far larger than the section, by Pythagoras
    assert largest_difference(section, rounded) <= tolerance * (1.0 + 1e-9) + rounding
    return rounded


def curvatures(rounded: Floats, x: Floats) -> Floats:
    """Curvatures [1/m] at places x, > 0 in a dip."""
    arcs = bends(rounded)
    found = np.zeros(len(x))
    for k in np.flatnonzero(arcs.signs):
        found[(x >= arcs.begins[k, 0]) & (x < arcs.ends[k, 0])] = -arcs.signs[k] / arcs.radii[k]
    return found


SECTIONS: dict[str, tuple[Floats, float, int]] = {  # and how many vertices are enough
    "waves, each 0.05 m, 1 mm": (surveyed(waves, 100.0, 0.05), 0.001, 110),
    "waves, each 0.25 m, 10 mm": (surveyed(waves, 100.0, 0.25), 0.01, 40),
    "waves, each 1 m, 50 mm": (surveyed(waves, 100.0, 1.0), 0.05, 26),
    "waves, each 0.05 m, noise of 2 mm, 10 mm": (surveyed(waves, 100.0, 0.05, 0.002), 0.01, 48),
    "waves, each 0.05 m, noise of 2 mm, 6 mm": (surveyed(waves, 100.0, 0.05, 0.002), 0.006, 75),
    "swell, each 0.1 m, 5 mm": (surveyed(swell, 100.0, 0.1), 0.005, 18),
    "stairs, 5 mm": (STAIRS, 0.005, 18),
    "cliffs, 20 mm": (CLIFFS, 0.02, 9),
}


@pytest.mark.parametrize("name", SECTIONS)
def test_the_fit_keeps_the_tolerance_with_few_vertices(name: str) -> None:
    """Oracle: dense places; counts, a third of those of the polyline of Douglas and Peucker on hills."""
    section, tolerance, enough = SECTIONS[name]
    assert len(check(section, tolerance)) <= enough


@pytest.mark.parametrize("tolerance", [0.001, 0.005])
def test_an_arc_between_two_straight_lines_keeps_its_radius(tolerance: float) -> None:
    """Oracle: the radius of 15 m, of which arcs over 0.98 of their pieces have 0.98."""
    angle, radius = 0.4, 15.0
    reach = radius * math.sin(angle)

    def hill(x: Floats) -> Floats:
        away = np.abs(x - 50.0)
        arc = np.sqrt(np.maximum(radius**2 - away**2, 0.0)) - radius
        return np.where(away < reach, arc, radius * (math.cos(angle) - 1.0) - (away - reach) * math.tan(angle))

    rounded = check(surveyed(hill, 100.0, 0.1), tolerance)
    assert len(rounded) <= 8
    np.testing.assert_allclose(rounded[1:-1, 2], radius, rtol=0.1)


def test_radii_come_near_those_of_a_smooth_hill() -> None:
    """Oracle: curvatures of the cosine; none is much larger than its largest; a quarter is straight at most."""
    rounded = check(surveyed(swell, 100.0, 0.1), 0.002)
    x = np.linspace(1.0, 99.0, 9801)
    sharpest = (2 * np.pi / 50) ** 2
    slope = 2 * np.pi / 50 * np.sin(2 * np.pi * x / 50)
    true = sharpest * np.cos(2 * np.pi * x / 50) / (1.0 + slope**2) ** 1.5
    found = curvatures(rounded, x)
    assert np.abs(found).max() < 1.2 * sharpest
    assert np.sqrt(np.mean((found - true) ** 2)) < 0.3 * np.sqrt(np.mean(true**2))
    assert np.mean(found == 0.0) < 0.25


@pytest.mark.parametrize("seed", range(3))
def test_noise_is_smoothed_out(seed: int) -> None:
    """Oracle: the hill without noise; its sharpest radius, 4.7 m, but at the ends, where it has edges."""
    section = surveyed(waves, 100.0, 0.1, noise=0.002, seed=seed)
    rounded = check(section, 0.01)
    x = section[20:-20, 0]
    away = heights(rounded, x) - waves(x)
    assert np.sqrt(np.mean(away**2)) < 0.4 * 0.01
    assert rounded[2:-2, 2].min() > 0.75 * 4.7


def test_stairs_keep_their_edges() -> None:
    """Oracle: their vertices but for the first and the last, which do not turn; the radius whose arc leaves 5 mm."""
    rounded = check(STAIRS, 0.005)
    np.testing.assert_allclose(rounded[:, :2], STAIRS[1:-1], atol=1e-12)
    turn = math.atan2(0.15, 0.03)
    across = math.cos(turn / 2)  # of the bisector, to the upright
    radius = 0.005 * across / (1.0 / math.cos(turn / 2) - 1.0)
    assert (rounded[1:-1, 2] > 0.5 * radius).all()
    assert (rounded[1:-1, 2] < 2.0 * radius).all()


@pytest.mark.parametrize(
    "name",
    [
        "waves, each 0.25 m, 10 mm",
        "waves, each 0.05 m, noise of 2 mm, 10 mm",
        "stairs, 5 mm",
        "cliffs, 20 mm",
        "its own mirror image",
    ],
)
def test_a_mirror_image_has_the_mirrored_fit(name: str) -> None:
    """Oracle: the fit of the section."""
    gauss = surveyed(lambda x: np.exp(-(((x - 50.0) / 5.0) ** 2)), 100.0, 0.1)
    section, tolerance, _ = SECTIONS.get(name, (gauss, 0.002, 0))
    rounded = fit_ground(section, tolerance)
    mirrored = fit_ground(section[::-1] * MIRRORED[:2], tolerance)[::-1] * MIRRORED
    np.testing.assert_allclose(mirrored, rounded, rtol=1e-5, atol=1e-9)
    if name not in SECTIONS:
        shift = np.array([100.0, 0.0, 0.0])
        np.testing.assert_allclose(rounded[::-1] * MIRRORED + shift, rounded, rtol=1e-5, atol=1e-9)


STEPS = st.lists(st.tuples(st.floats(0.01, 10.0), st.floats(-1.0, 1.0)), min_size=1, max_size=40)


@settings(max_examples=40, deadline=None)
@given(STEPS, st.floats(-4.0, 1.0), st.booleans())
def test_any_section_is_kept_within_the_tolerance(steps: list[tuple[float, float]], power: float, smooth: bool) -> None:
    """Oracle: dense places."""
    along, share = np.array(steps).T
    angles = np.radians(80.0) * share
    if smooth:
        angles = np.convolve(np.repeat(angles, 5), np.full(5, 0.2), "same")
        along = np.repeat(along / 5.0, 5)
    section = np.column_stack([np.r_[0.0, np.cumsum(along)], np.r_[0.0, np.cumsum(along * np.tan(angles * 0.999))]])
    check(section, 10.0**power)


def test_examples_are_true() -> None:
    """Oracle: their output."""
    assert doctest.testmod(smoothing).failed == 0
