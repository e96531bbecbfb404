"""The first touch of a flight: of spinning bodies over profiles none is missed, and none is made up."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sledenv.kernel import descent, guards
from sledenv.kernel.expansion import expand
from sledenv.kernel.params import Incline, Limits
from tests.compiled import compiled
from tests.engine import BODIES, SEGMENT, incline, new_space, pieces_of, put, record_of

property_of_all = settings(deadline=None, derandomize=True, max_examples=60)
RECORDS = {name: record_of(body) for name, body in (BODIES | {"segment": SEGMENT}).items()}
EACH = 200  # directions within the angle of an arc
NEAR = 5e-6  # [m] as near as they can tell
LIMITS = Limits(*[0.0] * len(Limits._fields))._replace(max_time=2.0, max_steps=1e5, tolerance=1e-14)


def fly(body: Any, pieces: np.ndarray, slope: Incline, limits: Limits, space: Any) -> bool:
    """Go on until something touches; return whether it does before the time is over."""
    while space["motion"]["t"] < limits.max_time:
        expand(body, pieces, slope, space)
        descent._find_event(body, pieces, slope, limits, space)
        descent._move(body, space)
        if space["event"]["code"] == guards.BORN:
            return True
    return False


fly_on = compiled(fly)


# --- the gap, obviously ----------------------------------------------------------------------------------------------


def support(body: Any, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Arms a, b [m] of the lowest point at orientations: it lies at (-a, -b) from the mass centre."""
    count = int(body["count"])
    local = (phi + math.pi) % math.tau - math.pi
    arc = np.searchsorted(body["begin"][1:count], local)
    along, across, sine, cosine = body["along"][arc], body["across"][arc], np.sin(phi), np.cos(phi)
    return along * sine + across * cosine, body["r"][arc] - (along * cosine - across * sine)


def tangents(body: Any) -> tuple[np.ndarray, np.ndarray]:
    """Directions out of the body, those of its sides among them, and how far it reaches in each [m]."""
    ends = [*body["begin"][: int(body["count"])], math.pi]
    phi = np.unique([np.linspace(begin, end, EACH) for begin, end in pairwise(ends)])
    if len(ends) == 2:
        phi = np.linspace(-math.pi, math.pi, 10 * EACH)
    return -np.array([np.sin(phi), np.cos(phi)]), support(body, phi)[1]


def smallest_gap(body: Any, vertices: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Distance [m] of the body from the ground in each pose; below zero where it is in it.

    The nearest point of a line is the lowest one of the body over it, if that lies over the piece and the mass centre
    is not behind it, on the other side of a ridge. Of a vertex the distance is the largest over all directions of the
    distance from the line that bounds the body there.
    """
    x, y, phi = poses.T
    gaps = np.full(len(poses), math.inf)
    far = 1e3
    if len(vertices):
        ends = np.array([vertices[0] - [far, 0.0], *vertices, vertices[-1] + [far, 0.0]])
    else:
        ends = np.array([[-far, 0.0], [far, 0.0]])
    for begin, end in pairwise(ends):
        length = math.hypot(*(end - begin))
        tx, ty = (end - begin) / length
        a, b = support(body, phi - math.atan2(ty, tx))
        foot = tx * (x - begin[0]) + ty * (y - begin[1]) - a
        above = tx * (y - begin[1]) - ty * (x - begin[0])
        gaps = np.where((foot >= 0.0) & (foot <= length) & (above > 0.0), np.minimum(gaps, above - b), gaps)
    out, reach = tangents(body)
    for vertex in vertices:
        dx, dy = vertex[0] - x, vertex[1] - y
        close = np.flatnonzero(np.hypot(dx, dy) < 1.1 * body["size"])
        if len(close):
            c, s = np.cos(phi[close]), np.sin(phi[close])
            seen = np.array([c * dx[close] + s * dy[close], c * dy[close] - s * dx[close]]).T
            gaps[close] = np.minimum(gaps[close], np.max(seen @ out - reach, axis=1))
    return gaps


def poses_of_flight(slope: Incline, pose: tuple[float, ...], velocity: tuple[float, ...], t: np.ndarray) -> np.ndarray:
    path = np.array(pose) + t[:, None] * np.array(velocity)
    return path + 0.5 * t[:, None] ** 2 * [slope.downhill, -slope.inward, 0.0]


def test_the_gap_of_a_block_to_a_crest_and_to_a_plane() -> None:
    """Oracle: a block that lies level has a flat underside; the tables of this file are right."""
    block = RECORDS["block"]
    roof = np.array([(-1.0, 0.0), (0.0, 0.5), (1.0, 0.0)])
    gaps = smallest_gap(block, roof, np.array([(0.0, 0.9, 0.0), (0.0, 0.7, 0.0), (5.0, 0.4, 0.0)]))
    np.testing.assert_allclose(gaps, [0.1, -0.1, 0.1], atol=NEAR)


# --- flights ---------------------------------------------------------------------------------------------------------

bumps = st.lists(st.tuples(st.floats(0.1, 1.2), st.floats(-0.5, 0.5)), min_size=2, max_size=14)
speeds = st.tuples(st.floats(-3.0, 6.0), st.floats(-3.0, 1.0), st.floats(-10.0, 10.0))


def check_flight(
    body: Any, vertices: np.ndarray, slope: Incline, start: tuple[float, float, float], velocity: tuple[float, ...]
) -> None:
    """The flight goes on until the sampled gap is zero, and not beyond.

    ``start`` is the place along the slope [m], the height [m] over what would touch, and the orientation [rad].
    """
    x, height, phi = start
    top = max(0.0, float(np.max(vertices[:, 1], initial=0.0)))
    pose = (x, top + height + float(body["size"]), phi)
    space, pieces = new_space(), pieces_of(vertices)
    put(space, pose, velocity)
    space["finish"] = math.inf
    touches = fly_on(body, pieces, slope, LIMITS, space)
    end = float(space["motion"]["t"])
    samples = np.linspace(0.0, end, 800)
    gaps = smallest_gap(body, vertices, poses_of_flight(slope, pose, velocity, samples))
    assert np.min(gaps) > -NEAR
    if touches:
        assert abs(gaps[-1]) < NEAR


@property_of_all
@given(
    st.sampled_from(["disc", "block", "triangle", "hexagon", "sled"]),
    bumps,
    st.floats(-0.3, 0.6),
    st.tuples(st.floats(-2.0, 2.0), st.floats(0.01, 0.6), st.floats(-3.1, 3.1)),
    speeds,
)
def test_the_first_touch_over_a_profile_is_not_missed(
    name: str,
    along: list[tuple[float, float]],
    angle: float,
    start: tuple[float, float, float],
    velocity: tuple[float, ...],
) -> None:
    """Oracle: the smallest gap at 800 times up to the touch, from lines and vertices of the ground."""
    vertices = np.cumsum(np.array(along), axis=0) - [2.0, 0.0]
    turns = np.diff(np.arctan2(*np.vstack([[1.0, 0.0], np.diff(vertices, axis=0), [1.0, 0.0]]).T[::-1]))
    assume(np.all(abs(turns) > 1e-6))  # a vertex without a turn is none
    check_flight(RECORDS[name], vertices, incline(angle), start, velocity)


@property_of_all
@given(
    st.sampled_from(["disc", "block", "triangle", "hexagon", "sled", "segment"]),
    st.floats(-0.3, 0.6),
    st.tuples(st.floats(-2.0, 2.0), st.floats(0.01, 0.6), st.floats(-3.1, 3.1)),
    speeds,
)
def test_the_first_touch_over_a_plane_is_not_missed(
    name: str, angle: float, start: tuple[float, float, float], velocity: tuple[float, ...]
) -> None:
    """Oracle: the smallest gap at 800 times up to the touch."""
    check_flight(RECORDS[name], np.zeros((0, 2)), incline(angle), start, velocity)


def test_a_touch_in_a_dip_that_turns_by_more_than_a_right_angle() -> None:
    """Oracle: the smallest gap at 800 times up to the touch; the tail of a sled comes down on the steep side."""
    vertices = np.array([(-1.0, 0.0), (-0.5, -0.5), (0.0, -0.75), (0.25, -0.25)])
    check_flight(RECORDS["sled"], vertices, incline(0.0), (0.0, 0.5, 2.0), (0.0, 1.0, 10.0))


def test_a_ridge_is_not_touched_from_behind() -> None:
    """Oracle: the smallest gap at 800 times up to the touch; the triangle comes down beside a ridge of 48 degrees."""
    vertices = np.array(
        [
            (-2.44, 0.05),
            (-1.48, 1.54),
            (-0.96, 0.81),
            (-0.1, 0.96),
            (0.43, 1.83),
            (0.92, 0.91),
            (1.23, 1.88),
            (2.12, 2.05),
            (2.59, 0.86),
            (3.31, 2.26),
        ]
    )
    check_flight(RECORDS["triangle"], vertices, incline(0.128), (0.57, 0.58, -1.578), (-1.5, 0.47, 4.25))


@pytest.mark.parametrize("name", ["block", "sled", "hexagon", "triangle"])
@pytest.mark.parametrize("omega", [-40.0, 40.0])
def test_a_body_that_spins_fast_over_sharp_bumps_touches_in_time(name: str, omega: float) -> None:
    """Oracle: the smallest gap at 800 times up to the touch."""
    vertices = np.array([(0.3 * k - 3.0, 0.2 * (k % 2)) for k in range(21)])
    check_flight(RECORDS[name], vertices, incline(0.1), (-1.0, 0.2, 0.3), (4.0, 1.0, omega))


def test_a_body_that_only_grazes_a_crest_is_seen() -> None:
    """Oracle: a disc whose lowest path lies a hair below the top of a crest touches it; a hair above it does not."""
    vertices = np.array([(-1.0, -1.0), (0.0, 0.0), (1.0, -1.0)])
    vertices[:, 1] -= vertices[0, 1]
    for above, touched in ((-1e-9, True), (1e-9, False)):
        space = new_space()
        pose, disc = (-0.2, 1.0 + float(RECORDS["disc"]["r"][0]) + above, 0.0), RECORDS["disc"]
        put(space, pose, (4.0, 0.0, 5.0))
        space["finish"] = math.inf
        limits = LIMITS._replace(max_time=0.1)
        assert fly_on(disc, pieces_of(vertices), Incline(0.0, 0.0, math.inf, 0.0), limits, space) == touched
