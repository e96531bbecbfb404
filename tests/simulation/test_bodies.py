"""Bodies: every field is checked, what is derived agrees with its definition, and records hold what was given."""

from __future__ import annotations

import copy
import math
import pickle
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from mpmath import mp, mpf

from sledenv.kernel import outline as kernel
from sledenv.kernel.outline import BODY, MOST_ARCS
from sledenv.simulation.bodies import Body, Segment, check_bodies, records_of, segment
from sledenv.simulation.outlines import Arc, bulged, outline_of
from sledenv.simulation.shapes import circular_segment, disc, hull, polygon, rod
from tests.oracles import support

SEGMENT = {"mass": 1.0, "radius": 0.1, "eccentricity": 0.05, "inertia": 7.5e-3, "half_angle": 1.9}
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
ANY_OUTLINE = [
    segment(1.0, 0.5, 0.2, 0.1, 2.0),
    disc(1.0, 0.5),
    rod(1.0, 1.0),
    rod(1.0, 1.0, 0.2),
    polygon(1.0, SQUARE, 0.1),
    hull(1.0, [(0.0, 0.0, 0.5), (1.0, 0.2, 0.0), (-0.2, 0.9, 0.1)], ["wheel", "nose", "head"], None, 0.1, (0.0, 0.0)),
]


def support_height(body: Body, phi: float) -> float:
    """Height [m] of the mass centre when the lowest point touches, as the kernel has it."""
    return kernel.support_height(body.record[0], phi)


# --- fields ----------------------------------------------------------------------------------------------------------


def test_the_ends_of_the_ranges_are_accepted() -> None:
    """Oracle: the ranges in the docstrings: a point, a full disc, no thickness, a short side, a flat arc."""
    assert segment(1.0, 0.0, 0.0, 1.0, math.pi).half_angle == math.pi
    assert segment(1.0, 0.1, 0.0, 1.0) == Segment(1.0, 0.1, 0.0, 1.0, math.pi)
    assert Body(1.0, 1.0, [Arc(0.0, 0.0, 0.0, 0.0)]).size == 0.0
    assert rod(1.0, 1.0, 0.0).size == 0.5
    stadium = Body(1.0, 1.0, [Arc(0.55e-9, 0.0, 1.0, -math.pi), Arc(-0.55e-9, 0.0, 1.0, 0.0)])
    assert stadium.record["side"][0, :2].tolist() == [2.0, 2.0]
    flat = Body(1.0, 1.0, bulged(rod(1.0, 1.0).arcs, 0, 4.9e5))
    assert (len(flat.parts), flat.size) == (4, pytest.approx(0.5, rel=1e-6))
    assert flat.lowest_support == pytest.approx(0.0, abs=5e-10)


@pytest.mark.parametrize("body", ANY_OUTLINE)
def test_a_body_is_a_value(body: Body) -> None:
    """Oracle: equal ones are made of equal numbers; it survives pickling, and what can be typed makes it anew."""
    for again in (pickle.loads(pickle.dumps(body)), copy.deepcopy(body), eval(body.typed())):
        assert type(again) is type(body)
        assert again == body
        assert hash(again) == hash(body)
        assert again.record.tobytes() == body.record.tobytes()
    assert body != body.replace(mass=2.0)
    assert body not in (None, 1.0, body.arcs)
    assert len({*ANY_OUTLINE, *ANY_OUTLINE}) == len(ANY_OUTLINE)


# --- outlines that are none ------------------------------------------------------------------------------------------


def corners(*places: tuple[float, float, float]) -> list[Arc]:
    return [Arc(x, y, 0.0, begin) for x, y, begin in places]


QUARTER = 0.5 * math.pi


# --- parts and records -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("half_angle", [0.3, QUARTER, 2.0, math.pi])
def test_a_segment_has_the_record_of_its_arcs(half_angle: float) -> None:
    """Oracle: ``Body``, which is given the same arcs; codes of parts are those of kernel.records.Feature."""
    body = segment(2.0, 0.5, 0.48, 0.1, half_angle)
    same = Body(2.0, 0.1, body.arcs)
    for name in BODY.names:
        if name not in ("part", "side"):
            assert same.record[name].tobytes() == body.record[name].tobytes(), name
    names = ("nose", "arc", "tail") if half_angle < math.pi else ("arc",)
    assert tuple(arc.part for arc in body.arcs) == names
    assert body.parts == ("arc", "nose", "tail", "chord")
    count = len(names)
    assert [body.parts[int(code) - 1] for code in body.record["part"][0, :count]] == list(names)
    assert body.record["side"][0, :count].tolist() == ([0.0, 0.0, 4.0] if count == 3 else [0.0])
    assert body.record["corner"][0, :count].tolist() == ([1.0, 0.0, 1.0] if count == 3 else [0.0])


def test_records_are_made_of_whatever_bodies_are_given_as() -> None:
    """Oracle: the records of the bodies one by one."""
    bodies = [ANY_OUTLINE[k] for k in (0, 3, 0, 1, 5, 1)]
    table = records_of(bodies, 6)
    assert (table.dtype, table.shape) == (BODY, (6,))
    for row, body in zip(table, bodies, strict=True):
        assert row.tobytes() == body.record[0].tobytes()
    assert records_of(bodies[0], 6) is bodies[0].record
    assert records_of(tuple(bodies), 6).tobytes() == table.tobytes()
    assert records_of(table, 6).tobytes() == table.tobytes()
    assert records_of(table[:1], 6).tobytes() == table[:1].tobytes()
    rows = np.array([[1.0, 0.5, 0.2, 0.1, 2.0], [1.0, 0.5, 0.0, 0.125, math.pi]])
    assert records_of(rows, 2).tobytes() == records_of([ANY_OUTLINE[0], ANY_OUTLINE[1]], 2).tobytes()
    assert records_of(np.array([[1, 1, 0, 1, 3]]), 1)["r"][0, 1] == 1.0


# --- segments --------------------------------------------------------------------------------------------------------


@given(st.floats(1e-3, 1e3), st.floats(1e-3, math.pi), st.floats(-0.5, 1.5))
def test_just_those_segments_are_accepted_whose_mass_centre_never_passes_below_the_slope(
    radius: float, half_angle: float, share: float
) -> None:
    """Oracle: the lowest of the support heights over a fine grid, which holds the upright body and the chord."""
    least = radius * max(math.cos(half_angle), 0.0)
    eccentricity = least + share * (radius - least)
    assume(eccentricity >= 0.0)
    shape = SimpleNamespace(radius=radius, eccentricity=eccentricity, half_angle=half_angle)
    lowest = support(shape, np.linspace(-math.pi, math.pi, 401)).min()
    assume(abs(lowest) > 1e-14 * radius)
    row = [1.0, radius, eccentricity, 1.0, half_angle]
    for make in (lambda: segment(*row), lambda: check_bodies("row", np.array([row]))):
        with nullcontext() if lowest > 0.0 else pytest.raises(ValueError, match=r"(segment|row)\.eccentricity"):
            make()


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


# --- other bodies ----------------------------------------------------------------------------------------------------


def test_a_rod_lies_along_the_slope() -> None:
    """Oracle: two corners half its length downhill and uphill; m l^2/12; the nose is down after it has fallen on it."""
    body = rod(3.0, 2.0)
    assert (body.size, body.lowest_support, body.inertia) == (1.0, 0.0, pytest.approx(1.0, rel=1e-15))
    assert body.parts == ("nose", "tail", "bottom", "top")
    nose, tail = body.arcs
    assert (nose[:2], tail[:2]) == ((1.0, 0.0), (-1.0, 0.0))
    for phi in (-2.5, -1.0, -0.1, 0.1, 1.0, 2.5):
        arc, a, b = kernel.lowest_arms(body.record[0], phi)
        end = 1.0 if phi < 0.0 else -1.0
        assert body.arcs[arc].part == ("nose" if phi < 0.0 else "tail")
        assert (a, b) == pytest.approx((-end * math.cos(phi), -end * math.sin(phi)), rel=1e-15)
    assert rod(3.0, 2.0, inertia=0.7).inertia == 0.7


@pytest.mark.parametrize("rounding", [0.0, 0.2])
def test_a_polygon_is_the_same_whichever_way_it_is_told(rounding: float) -> None:
    """Oracle: corners in the other direction, from another one on, from another origin; names go with them."""
    points = np.array([(0.0, 0.0), (3.0, -0.5), (4.0, 2.0), (1.0, 3.0), (-0.5, 1.5)])
    parts, sides = list("abcde"), ["ab", "bc", "cd", "de", "ea"]
    body = polygon(2.0, points, rounding, parts, sides)
    assert sorted(body.parts) == sorted(parts + sides)
    for reverse in (False, True):
        for first in range(5):
            order = [(first + k) % 5 for k in range(5)]
            names = [sides[k] for k in order]
            if reverse:
                order.reverse()
                names = [sides[k - 1] for k in order]
            moved = points[order] + (7.0, -3.0)
            other = polygon(2.0, moved, rounding, [parts[k] for k in order], names)
            assert [arc[4:] for arc in other.arcs] == [arc[4:] for arc in body.arcs]
            assert np.array([arc[:4] for arc in other.arcs]) == pytest.approx(
                np.array([arc[:4] for arc in body.arcs]), abs=1e-14
            )
            assert other.inertia == pytest.approx(body.inertia, rel=1e-14)


def test_a_rounded_polygon_touches_its_sides_from_within() -> None:
    """Oracle: it loses nothing where a side is down, and the closed form of a square with round corners elsewhere."""
    body, sharp = polygon(1.0, SQUARE, 0.2), polygon(1.0, SQUARE)
    for phi in (0.0, 0.5 * math.pi, -0.5 * math.pi, math.pi):
        assert support_height(body, phi) == pytest.approx(support_height(sharp, phi), rel=1e-15)
    assert body.size == pytest.approx(0.3 * math.sqrt(2.0) + 0.2, rel=1e-15)
    assert outline_of(body.arcs).sides == pytest.approx([0.6] * 4, rel=1e-14)
    assert body.inertia < sharp.inertia - (1.0 - math.pi / 4.0) * 0.04 * 0.5**2  # without what is cut off


def test_a_hull_is_uniform_unless_its_inertia_is_given() -> None:
    """Oracle: a bar with round ends, in closed form; a disc; a polygon of corners without radius."""
    mass, half, r = 3.0, 0.5, 0.2
    bar, ends = 4.0 * half * r, math.pi * r**2
    inertia = bar * (half**2 + r**2) / 3.0 + ends * (0.5 * r**2 + half**2 + 2.0 * half * 4.0 * r / (3.0 * math.pi))
    body = hull(mass, [(1.0 - half, 2.0, r), (1.0 + half, 2.0, r)])
    assert body.inertia == pytest.approx(mass * inertia / (bar + ends), rel=1e-14)
    assert sorted(arc.x for arc in body.arcs) == pytest.approx([-half, half], rel=1e-14)
    assert hull(mass, [(1.0, 2.0, r)]).inertia == pytest.approx(0.5 * mass * r**2, rel=1e-14)
    points = [(0.0, 0.0), (1.0, -0.25), (1.5, 0.5), (0.5, 1.0)]
    cornered, same = hull(mass, [(x, y, 0.0) for x, y in points]), polygon(mass, points)
    assert cornered.inertia == pytest.approx(same.inertia, rel=1e-14)
    assert np.array([arc[:4] for arc in cornered.arcs]) == pytest.approx(
        np.array([arc[:4] for arc in same.arcs]), abs=1e-15
    )


@pytest.mark.parametrize("excess", [1, 3, 40])
def test_of_too_many_corners_the_message_tells_which_will_do(excess: int) -> None:
    """Oracle: these rows make a body; no corner is farther from their polygon than the message says, by geometry."""
    count = MOST_ARCS + excess
    angle = 2.0 * math.pi * (np.arange(count) + np.random.default_rng(excess).uniform(-0.3, 0.3, count)) / count
    points = np.column_stack([0.9 * np.cos(angle), 0.3 * np.sin(angle)])
    circles = np.column_stack([points, np.zeros(count)])
    for make, table, name in ((polygon, points, "points has"), (hull, circles, "circles: the hull has")):
        with pytest.raises(ValueError, match=rf"{name} {count} .*: must have . to {MOST_ARCS}; rows \[") as caught:
            make(1.0, table)
        text = str(caught.value)
        rows = [int(row) for row in text[text.index("[") + 1 : text.index("]")].split(", ")]
        depth = float(text.partition("lies ")[2].split(" m")[0])
        assert len(make(1.0, table[rows]).arcs) == len(rows) == MOST_ARCS
        kept = points[rows]
        along = np.roll(kept, -1, axis=0) - kept
        outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, np.newaxis]
        farthest = ((points[:, np.newaxis] - kept) * outward).sum(axis=2).max()
        assert f"{depth:.2g}" == f"{farthest:.2g}"
