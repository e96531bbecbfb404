"""The height at which a body touches the ground, against outlines of many points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.outlines import sines_and_cosines
from sledenv.simulation.scene import Slope
from sledenv.simulation.shapes import circular_segment, polygon
from sledenv.simulation.sleds import sled
from sledenv.simulation.support import resting_heights, support_heights

Floats = NDArray[np.float64]

BODIES = {
    "disc": segment(2.0, 0.5, 0.1, 0.3),
    "segment": circular_segment(2.0, 1.0, 1.0),
    "polygon": polygon(3.0, [(0.0, 0.0), (2.0, 0.0), (2.2, 0.6), (1.0, 1.2), (-0.3, 0.5)], rounding=0.08),
    "sharp": polygon(3.0, [(0.0, 0.0), (2.0, 0.0), (2.2, 0.6), (1.0, 1.2), (-0.3, 0.5)]),
    "sled": sled(),
}


def outline(body: Body, phi: float, points: int = 4000) -> Floats:
    """Points of an outline from the mass centre, in order, shape (N, 2)."""
    record, places = body.record[0], []
    for k in range(int(record["count"])):
        low = record["begin"][k]
        high = record["begin"][k + 1] if k + 1 < record["count"] else math.pi
        sine, cosine = sines_and_cosines(np.linspace(low, high, points))
        r, x, y = record["r"][k], -record["across"][k], record["along"][k]
        places.append(np.column_stack([x - r * sine, y - r * cosine]))
    sine, cosine = (of[0] for of in sines_and_cosines(np.array([phi])))
    turned: Floats = np.concatenate(places) @ np.array([[cosine, sine], [-sine, cosine]])
    return turned


def sampled_height(body: Body, x: float, phi: float, slope: Slope) -> float:
    """Largest height of the ground over a point of the outline, or of a vertex, or of a point of a bend, over it."""
    places = outline(body, phi)
    found = [float((slope.height_at(x + places[:, 0]) - places[:, 1]).max())]
    here, there = places, np.roll(places, -1, axis=0)
    points = list(slope.profile)
    if slope.rounding:
        across = np.linspace(x - body.size, x + body.size, 400)
        points = list(zip(across.tolist(), slope.height_at(across).tolist(), strict=True))
    for px, py in points:
        over = (np.minimum(here[:, 0], there[:, 0]) <= px - x) & (np.maximum(here[:, 0], there[:, 0]) >= px - x)
        for (x1, y1), (x2, y2) in zip(here[over], there[over], strict=True):
            part = (px - x - x1) / (x2 - x1) if x1 != x2 else 0.5
            found.append(py - (y1 + part * (y2 - y1)))
    return max(found)


@st.composite
def slopes(draw: st.DrawFn) -> Slope:
    """A slope with a rough profile."""
    count = draw(st.integers(2, 12))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    pieces = 10.0 ** rng.uniform(-1.5, 0.5, count)
    steep = np.tan(rng.uniform(-1.0, 1.0, count) * draw(st.sampled_from([0.1, 0.8, 1.39])))
    x = np.cumsum(pieces) - 0.5 * pieces.sum()
    radii = draw(st.sampled_from([0.0, 0.1, 1.0, 10.0, math.inf])) * rng.uniform(0.5, 1.0, count)
    return Slope(0.1, profile=np.column_stack([x, np.cumsum(steep * pieces)]), rounding=radii)


@given(slopes(), st.sampled_from(sorted(BODIES)), st.floats(-3.0, 3.0), st.floats(-math.pi, math.pi))
def test_a_body_rests_where_its_sampled_outline_does(slope: Slope, name: str, x: float, phi: float) -> None:
    """Oracle: 4,000 points on each arc and the chords between them; nothing is missed but their bulge."""
    body = BODIES[name]
    (found,) = resting_heights(body.record, np.array([x]), np.array([phi]), Grounds.of((slope.vertices,)))
    coarse = 2e-5 if not slope.rounding else 3e-3
    assert found == pytest.approx(sampled_height(body, x, phi, slope), abs=coarse * body.size)


def test_a_disc_in_a_dip_and_on_a_crest_rests_where_geometry_says() -> None:
    """Oracle: r/cos(theta) over a dip of two slopes +-theta, r over a crest, less what a radius cuts off."""
    disc, theta = segment(2.0, 0.5, 0.0, 0.3), 0.4
    rise = 10.0 * math.tan(theta)
    profiles = [((-10.0, s * rise), (0.0, 0.0), (10.0, s * rise)) for s in (1.0, -1.0)]
    where = np.zeros(1), np.zeros(1)
    for radius in (0.0, 0.3, 2.0):
        dip, crest = (
            Grounds.of([Slope(0.0, profile=profile, rounding=[0.0, radius, 0.0]).vertices]) for profile in profiles
        )
        cut = radius * (1.0 / math.cos(theta) - 1.0)  # the disc lies on both pieces unless the dip is rounder
        deep = 0.5 + cut if radius > 0.5 else 0.5 / math.cos(theta)
        assert resting_heights(disc.record, *where, dip)[0] == pytest.approx(deep, rel=1e-14)
        assert resting_heights(disc.record, *where, crest)[0] == pytest.approx(0.5 - cut, rel=1e-14)


def test_many_bodies_on_several_tracks_rest_where_each_alone_does() -> None:
    """Oracle: one at a time, bit for bit, planes among them."""
    x, rng = np.linspace(-20.0, 20.0, 60), np.random.default_rng(4)
    radii = rng.uniform(-0.5, 0.5, 60).clip(0.0)
    vertices = [*(np.column_stack([x, rng.uniform(-0.3, 0.3, 60), radii]) for _ in range(5)), np.empty((0, 3))]
    numbers = rng.integers(0, 6, 500)
    records = np.concatenate([body.record for body in BODIES.values()])[np.arange(500) % len(BODIES)]
    places, phi = rng.uniform(-25.0, 25.0, 500), rng.uniform(-math.pi, math.pi, 500)
    found = resting_heights(records, places, phi, Grounds.of(vertices, numbers))
    for i in range(500):
        alone = records[i : i + 1], places[i : i + 1], phi[i : i + 1], Grounds.of([vertices[numbers[i]]])
        assert resting_heights(*alone)[0] == found[i]


@pytest.mark.parametrize("name", sorted(BODIES))
def test_on_a_plane_a_body_rests_at_its_support_height(name: str) -> None:
    """Oracle: the support height, bit for bit, wherever the body is."""
    phi = np.linspace(-math.pi, math.pi, 201)
    x = np.where(np.arange(201) % 3 == 0, math.nan, np.linspace(-1e300, 1e300, 201))
    found = resting_heights(BODIES[name].record, x, phi, Grounds.of([np.empty((0, 3))]))
    np.testing.assert_array_equal(found, support_heights(BODIES[name].record, phi))
