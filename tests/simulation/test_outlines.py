"""Outlines: hulls, arcs in place of sides, areas, and the records of the kernel, held against sampled points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from sledenv.kernel import outline as kernel
from sledenv.simulation.bodies import Body
from sledenv.simulation.outlines import (
    Arc,
    bulged,
    fewer_circles,
    hull_of_circles,
    in_order,
    mass_properties,
    outline_of,
    shifted,
)
from sledenv.simulation.shapes import hull, polygon, rod

TURN = 2.0 * math.pi
seeds = st.integers(0, 2**32 - 1)


# --- outlines at random ----------------------------------------------------------------------------------------------


def normal(phi: float) -> np.ndarray:
    """Where the body points down at an orientation."""
    return np.array([-math.sin(phi), -math.cos(phi)])


def in_turn(phi: float) -> float:
    phi = (phi + math.pi) % TURN - math.pi
    return phi if phi < math.pi else -math.pi


def turned(arcs: Sequence[Arc], angle: float) -> tuple[Arc, ...]:
    """The same outline in a frame in which it has been turned counter-clockwise."""
    s, c = math.sin(angle), math.cos(angle)
    return in_order(
        [
            arc._replace(x=c * arc.x - s * arc.y, y=s * arc.x + c * arc.y, begin=in_turn(arc.begin - angle))
            for arc in arcs
        ]
    )


def turn_of(arcs: Sequence[Arc], k: int) -> float:
    return (arcs[(k + 1) % len(arcs)].begin - arcs[k].begin) % TURN if len(arcs) > 1 else TURN


def points_of(arcs: Sequence[Arc], each: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of all arcs, both ends of each among them, and which arc they are of."""
    points = []
    for k, arc in enumerate(arcs):
        phi = arc.begin + np.linspace(0.0, turn_of(arcs, k), each)
        points.append(np.column_stack([arc.x - arc.radius * np.sin(phi), arc.y - arc.radius * np.cos(phi)]))
    return np.vstack(points), np.repeat(np.arange(len(arcs)), each)


def circles_at_random(rng: np.random.Generator) -> np.ndarray:
    count = int(rng.integers(1, 9))
    radii = np.where((rng.random(count) < 0.4) & (count > 1), 0.0, rng.uniform(0.0, 1.0, count))
    return np.column_stack([rng.normal(size=(count, 2)), radii])


def hull_at_random(rng: np.random.Generator) -> tuple[Arc, ...]:
    """A hull of circles, of which an arc may stand in place of a side."""
    circles = circles_at_random(rng)
    arcs = hull_of_circles(circles, ["arc"] * len(circles), ["side"] * len(circles))
    if len(arcs) > 1 and rng.random() < 0.6:
        arcs = bulged(arcs, int(rng.integers(len(arcs))), float(10.0 ** rng.uniform(3.0, 5.0)))
    return arcs


def rounded_at_random(rng: np.random.Generator) -> tuple[Arc, ...]:
    """Two to four straight sides, each followed by one to three arcs that join smoothly."""
    while True:
        runs = rng.integers(1, 4, int(rng.integers(2, 5))).tolist()
        turns = rng.dirichlet(np.full(sum(runs), 2.0)) * TURN
        radii = [float(rng.uniform(0.05, 2.0)) if k or rng.random() < 0.6 else 0.0 for run in runs for k in range(run)]
        begins = (-math.pi if rng.random() < 0.3 else rng.uniform(-3.0, 3.0)) + np.append(0.0, np.cumsum(turns)[:-1])
        ends = begins + turns
        last = np.cumsum(runs) - 1
        along = np.column_stack([-np.cos(ends), np.sin(ends)])
        spans = [r * (normal(end) - normal(begin)) for r, begin, end in zip(radii, begins, ends, strict=True)]
        lengths = rng.uniform(0.1, 2.0, len(runs))
        lengths -= np.linalg.pinv(along[last].T) @ (lengths @ along[last] + sum(spans))
        if turns.min() < 0.05 or lengths.min() < 0.05 or np.abs(lengths @ along[last] + sum(spans)).max() > 1e-12:
            continue
        arcs, point, sides = [], np.zeros(2), dict(zip(last.tolist(), lengths, strict=True))
        for k, (r, begin) in enumerate(zip(radii, begins, strict=True)):
            x, y = (point - r * normal(begin)).tolist()
            arcs.append(Arc(x, y, r, in_turn(float(begin))))
            point = point + spans[k] + sides.get(k, 0.0) * along[k]
        return in_order(arcs)


def at_random(seed: int) -> Body:
    """A body whose parts and sides are numbered, with the mass centre anywhere within."""
    rng = np.random.default_rng(seed)
    arcs = (hull_at_random if seed % 2 else rounded_at_random)(rng)
    points, _ = points_of(arcs, 20)
    middle = points.mean(axis=0)
    spot = middle + rng.uniform() * (rng.random() < 0.8) * (points[rng.integers(len(points))] - middle)
    arcs = shifted(arcs, *(-spot).tolist())
    return Body(1.0, 1.0, [arc._replace(part=f"arc {k}", side=f"side {k}") for k, arc in enumerate(arcs)])


def arcs_of_rows(body: Body) -> list[int]:
    """Which arc each row of a record is of."""
    count = len(body.arcs)
    return [*range(count)] if body.arcs[0].begin == -math.pi else [count - 1, *range(count)]


# --- what the kernel makes of them -----------------------------------------------------------------------------------


@given(seeds)
def test_a_record_measures_the_outline(seed: int) -> None:
    """Oracle: 400 points of each arc, which sag by r (step)^2/8 at most between two of them."""
    body = at_random(seed)
    record, rows = body._listed()[0], arcs_of_rows(body)
    points, owners = points_of(body.arcs, 400)
    sag = max(arc.radius * (turn_of(body.arcs, k) / 399) ** 2 / 8.0 for k, arc in enumerate(body.arcs))
    noise = 1e-12 * body.size + 1e-15 * max(arc.radius for arc in body.arcs)
    assert -noise <= body.size - np.hypot(*points.T).max() <= sag + noise

    phi = np.append(np.linspace(-math.pi, math.pi, 1001), [arc.begin for arc in body.arcs])
    depths = points @ np.array([-np.sin(phi), -np.cos(phi)])
    lowest = depths.max(axis=0)
    assert -noise - 0.007 * body.size <= body.lowest_support - lowest.min() <= sag + noise
    assert body.lowest_support == pytest.approx(outline_of(body.arcs).lowest, abs=noise)
    for i in [*range(0, 1001, 50), *range(1001, len(phi))]:
        arc, _, b = kernel.lowest_arms(record, float(phi[i]))
        assert -noise <= b - lowest[i] <= sag + noise
        owner = owners[depths[:, i].argmax()]
        if depths[owners != owner, i].max(initial=-math.inf) < lowest[i] - sag - noise:
            assert rows[arc] == owner


def neighbours(body: Body, k: int) -> list[str | None]:
    """Arcs that come down beside one as it turns down and up: across its own side, or that of a smooth neighbour."""
    sides, count = outline_of(body.arcs).sides > 0.0, len(body.arcs)
    found: list[str | None] = []
    for step in (-1, 1):
        across = [(k + steps * step) % count for steps in (1, 2)]
        parts = [body.arcs[arc].part for arc in across if sides[(arc - 1) % count if step > 0 else arc] and arc != k]
        found.append(parts[0] if parts else None)
    return found


def told(body: Body, row: int) -> tuple[object, ...]:
    """Return what a record says of an arc and of those beside it, whichever frame it is told in."""
    record, rows = body._listed()[0], arcs_of_rows(body)
    beside = [int(record[name][row]) for name in ("falling", "rising")]
    return *(None if other < 0 else body.arcs[rows[other]].part for other in beside), record["sinks"][row]


@given(seeds)
def test_a_record_knows_who_may_touch_beside_an_arc(seed: int) -> None:
    """Oracle: the outline as a ring."""
    body = at_random(seed)
    sides = outline_of(body.arcs).sides
    for row, k in enumerate(arcs_of_rows(body)):
        beside, smooth = neighbours(body, k), sides[k] == sides[k - 1] == 0.0
        closed = len(body.arcs) == 3 and smooth and beside[0] is not None
        assert told(body, row) == (*beside, closed and turn_of(body.arcs, k) <= math.pi)


@example(503)  # an arc of 4300 m
@given(seeds)
def test_a_record_tells_the_same_in_every_frame(seed: int) -> None:
    """Oracle: another orientation of the body is its origin; then another arc is the lowest at +-pi, or none is."""
    body = at_random(seed)
    for angle in (1.0, -2.5, body.arcs[0].begin + math.pi, body.arcs[-1].begin + 1.0):
        other = Body(1.0, 1.0, turned(body.arcs, angle))
        assert other.size == pytest.approx(body.size, rel=1e-9)
        assert other.lowest_support == pytest.approx(body.lowest_support, abs=1e-9 * body.size)
        rows = {body.arcs[k].part: row for row, k in enumerate(arcs_of_rows(body))}
        for row, k in enumerate(arcs_of_rows(other)):
            assert told(other, row) == told(body, rows[other.arcs[k].part])


# --- hulls -----------------------------------------------------------------------------------------------------------


@given(seeds)
def test_a_hull_reaches_as_far_as_its_circles(seed: int) -> None:
    """Oracle: the support of the hull of several bodies is the largest of theirs, in every direction."""
    circles = circles_at_random(np.random.default_rng(seed))
    arcs = hull_of_circles(circles, [str(k) for k in range(len(circles))], ["side"] * len(circles))
    phi = np.linspace(-math.pi, math.pi, 401)
    down = np.array([-np.sin(phi), -np.cos(phi)])
    farthest = (circles[:, :2] @ down + circles[:, 2:]).max(axis=0)
    points, _ = points_of(arcs, 400)
    assert np.abs((points @ down).max(axis=0) - farthest).max() <= 1e-12 + (TURN / 399) ** 2 / 8.0
    for arc in arcs:
        assert tuple(circles[int(arc.part)]) == arc[:3]
    sides = outline_of(arcs).sides
    assert (sides > 0.0).all() or len(arcs) == 1


def test_a_hull_leaves_out_what_lies_within_it() -> None:
    """Oracle: a square; its middle, a point on a side, a second corner and circles within do not count."""
    square = [(1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (-1.0, -1.0, 0.0), (-1.0, 1.0, 0.0)]
    others = [(0.0, 0.0, 0.0), (1.0, 0.25, 0.0), (1.0, 1.0, 0.0), (0.2, 0.3, 0.4), (0.0, -0.5, 0.5)]
    body = hull(1.0, [*others[:2], *square, *20 * others[2:]], [*"..abcd", *60 * "."], inertia=1.0, centre=(0.0, 0.0))
    assert [arc.part for arc in body.arcs] == ["a", "b", "c", "d"]
    assert [arc.begin for arc in body.arcs] == [-math.pi, -0.5 * math.pi, 0.0, 0.5 * math.pi]


def test_a_circle_may_be_twice_on_a_hull() -> None:
    """Oracle: a point at twice the radius on either side of a circle; the tangents leave it at 60 degrees."""
    circles = [(0.0, 0.0, 0.5), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)]
    body = hull(1.0, circles, ["wheel", "nose", "tail"], ["w", "n", "t"], 1.0, (0.0, 0.0))
    assert [arc.part for arc in body.arcs] == ["nose", "wheel", "tail", "wheel"]
    assert [arc.begin for arc in body.arcs] == pytest.approx(np.radians([-150.0, -30.0, 30.0, 150.0]), abs=1e-15)
    assert body.parts == ("nose", "wheel", "tail", "n", "w", "t")
    assert (body.size, body.lowest_support) == (1.0, pytest.approx(0.5, rel=1e-15))


def test_fewer_circles_say_how_far_their_hull_lies_within_that_of_all() -> None:
    """Oracle: the farthest point of all circles less that of the chosen ones, in 40,000 directions."""
    rng = np.random.default_rng(2)
    angles = np.linspace(0.0, TURN, 40_001)
    for _ in range(20):
        circles = np.column_stack([rng.normal(size=(30, 2)), rng.uniform(0.0, 0.4, 30)])
        chosen, depth = fewer_circles(circles, 6)
        assert len(hull_of_circles(circles[chosen], [""] * len(chosen), [""] * len(chosen))) <= 6
        heights = circles[:, :2] @ np.stack([np.cos(angles), np.sin(angles)]) + circles[:, 2:]
        within = float((heights.max(axis=0) - heights[chosen].max(axis=0)).max())
        assert within - 1e-12 <= depth <= within + 1e-3


# --- areas -----------------------------------------------------------------------------------------------------------


def test_simple_outlines_have_the_moments_of_textbooks() -> None:
    """Oracle: square d^2/6, board (a^2 + b^2)/12, disc r^2/2; a stadium by Steiner's theorem, with its half discs."""

    def near(area: float, centre: tuple[float, float], inertia: float) -> tuple[Any, ...]:
        return pytest.approx(area, rel=1e-15), pytest.approx(centre, abs=1e-15), pytest.approx(inertia, rel=1e-14)

    square = polygon(3.0, [(0, 0), (2, 0), (2, 2), (0, 2)])
    assert mass_properties(square.arcs) == near(4.0, (0.0, 0.0), 4.0 / 6.0)
    assert square.inertia == pytest.approx(3.0 * 4.0 / 6.0, rel=1e-15)
    assert mass_properties(polygon(1.0, [(1, 1), (1, 2), (4, 2), (4, 1)]).arcs) == near(3.0, (0.0, 0.0), 10.0 / 12.0)
    assert mass_properties([Arc(3.0, -1.0, 2.0, 0.0)]) == near(4.0 * math.pi, (3.0, -1.0), 2.0)
    straight, r = 2.2, 0.4
    board, half_disc, off = 2.0 * r * straight, 0.5 * math.pi * r**2, 4.0 * r / (3.0 * math.pi)
    own, total = r**2 * (0.5 - 16.0 / (9.0 * math.pi**2)), board + 2.0 * half_disc
    moment = board * (straight**2 + 4.0 * r**2) / 12.0 + 2.0 * half_disc * (own + (0.5 * straight + off) ** 2)
    stadium = rod(2.0, straight + 2.0 * r, 2.0 * r)
    assert mass_properties(stadium.arcs) == near(total, (0.0, 0.0), moment / total)
    assert stadium.inertia == pytest.approx(2.0 * moment / total, rel=1e-14)
    with pytest.raises(ValueError, match=r"arcs have an area of 0\.0 m\^2: must be > 0"):
        mass_properties(rod(1.0, 1.0).arcs)


@example(122775)  # a micrometre thick
@given(seeds)
def test_an_outline_has_the_moments_of_a_polygon_with_many_corners(seed: int) -> None:
    """Oracle: the shoelace formulas of 4000 points an arc; they lose the square of a step of each arc.

    The points of a large arc are rounded, which counts against the thickness of the outline.
    """
    body = at_random(seed)
    assume(len(body.arcs) > 2)
    area, centre, inertia = mass_properties(body.arcs)
    points, _ = points_of(body.arcs, 4000)
    following = np.roll(points, -1, axis=0)
    cross = 0.5 * (points[:, 1] * following[:, 0] - points[:, 0] * following[:, 1])
    middle = cross @ (points + following) / (3.0 * cross.sum())
    squares = ((points**2).sum(axis=1) + (points * following).sum(axis=1) + (following**2).sum(axis=1)) / 6.0
    noise = 1e-6 + 1e-15 * max(arc.radius for arc in body.arcs) * body.size / area
    assert area == pytest.approx(cross.sum(), rel=1e-5)
    assert centre == pytest.approx(middle, abs=noise * body.size)
    assert inertia == pytest.approx(cross @ squares / cross.sum() - middle @ middle, abs=noise * body.size**2)
