"""What touches what on a profile: its pieces, and normals, levers and velocities of the three kinds of contacts."""

from __future__ import annotations

import math
from bisect import bisect_right

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sledenv.kernel import contacts, geometry
from sledenv.kernel.geometry import ARC_CREST, ARC_PIECE, SIDE_CREST
from tests.compiled import compiled
from tests.engine import BODIES, Spring, new_space, pieces_of, put, record_of, touch

first_piece, heights_within = compiled(geometry.first_piece), compiled(geometry.heights_within)
place, velocities = compiled(geometry.place), compiled(geometry.velocities)
touching_place, in_cone = compiled(geometry.touching_place), compiled(geometry.in_cone)
faces_arc, beyond, zone_at = compiled(geometry.faces_arc), compiled(geometry.beyond), compiled(contacts.zone_at)
ROOF = ((-1.0, 0.0), (0.0, 0.5), (1.0, 0.0))  # dip, crest, dip
CREST = 2  # the piece that begins at the top of the roof
BLOCK, SLED = record_of(BODIES["block"]), record_of(BODIES["sled"])
steps = st.tuples(st.floats(0.05, 2.0), st.floats(-1.0, 1.0))
profiles = st.lists(steps, min_size=2, max_size=12)


def walk(along: list[tuple[float, float]]) -> np.ndarray:
    """Vertices one step after the other."""
    return np.cumsum(np.array(along), axis=0)


def height(vertices: np.ndarray, x: float) -> float:
    return float(np.interp(x, vertices[:, 0], vertices[:, 1]))


# --- pieces ----------------------------------------------------------------------------------------------------------


def test_a_plane_is_one_piece_without_an_end() -> None:
    """Oracle: the plane."""
    (piece,) = pieces_of([])
    assert (piece["x"], piece["y"], piece["tx"], piece["ty"], piece["tilt"]) == (0.0, 0.0, 1.0, 0.0, 0.0)
    assert (piece["low"], piece["high"], piece["run_low"], piece["run_high"]) == (-math.inf, math.inf) * 2


@given(profiles)
def test_pieces_go_from_vertex_to_vertex(along: list[tuple[float, float]]) -> None:
    """Oracle: numpy on the list of vertices; outside of them the plane goes on level."""
    vertices = walk(along)
    pieces = pieces_of(vertices)
    tangents = np.vstack([[1.0, 0.0], np.diff(vertices, axis=0), [1.0, 0.0]])
    lengths = np.hypot(*tangents.T)
    tangents /= lengths[:, None]
    np.testing.assert_allclose(np.c_[pieces["tx"], pieces["ty"]], tangents, atol=1e-15)
    np.testing.assert_allclose(pieces["tilt"], np.arctan2(tangents[:, 1], tangents[:, 0]), atol=1e-15)
    np.testing.assert_array_equal(np.c_[pieces["x"], pieces["y"]], vertices[np.r_[0, : len(vertices)]])
    turns = tangents[:-1, 0] * tangents[1:, 1] - tangents[:-1, 1] * tangents[1:, 0]
    np.testing.assert_allclose(pieces["turn"][1:], turns, atol=1e-15)
    np.testing.assert_array_equal(pieces["low"], [-math.inf, *[0.0] * len(vertices)])
    np.testing.assert_allclose(pieces["high"], [0.0, *lengths[1:-1], math.inf], rtol=1e-14)


@given(profiles)
def test_dips_join_pieces_to_a_run(along: list[tuple[float, float]]) -> None:
    """Oracle: from each piece on to the next crest on either side, its vertex laid on the line of the piece.

    Where a dip turns by more than a right angle that vertex lies over the piece; the piece counts all along even so.
    """
    vertices = walk(along)
    pieces = pieces_of(vertices)
    for j, piece in enumerate(pieces):
        low = next((k for k in range(j, 0, -1) if pieces[k]["turn"] < 0.0), None)
        high = next((k for k in range(j + 1, len(pieces)) if pieces[k]["turn"] < 0.0), None)
        ends = []
        for crest, nowhere, own, further in ((low, -math.inf, "low", min), (high, math.inf, "high", max)):
            if crest is None:
                ends.append(nowhere)
            else:
                foot = (vertices[crest - 1] - [piece["x"], piece["y"]]) @ [piece["tx"], piece["ty"]]
                ends.append(further(foot, piece[own]))
        np.testing.assert_allclose([piece["run_low"], piece["run_high"]], ends, atol=1e-13)


@given(profiles, st.floats(-3.0, 15.0), st.integers(0, 11))
def test_the_piece_over_which_a_place_lies(along: list[tuple[float, float]], x: float, at: int) -> None:
    """Oracle: bisect; a vertex belongs to the piece that begins there."""
    vertices = walk(along)
    pieces = pieces_of(vertices)
    for place_ in (x, vertices[at % len(vertices), 0]):
        expected = bisect_right(vertices[:, 0].tolist(), place_)
        assert max(first_piece(pieces, place_), 1) == max(expected, 1)  # the first two begin at the same vertex


@given(profiles, st.floats(-3.0, 15.0), st.floats(0.0, 4.0))
def test_the_lowest_and_highest_ground_near_a_place(along: list[tuple[float, float]], x: float, reach: float) -> None:
    """Oracle: numpy's interpolation, at the ends and at the vertices between."""
    vertices = walk(along)
    inside = vertices[(vertices[:, 0] > x - reach) & (vertices[:, 0] < x + reach), 1]
    heights = [height(vertices, x - reach), height(vertices, x + reach), *inside]
    expected = (min(heights), max(heights))
    assert heights_within(pieces_of(vertices), x, reach) == pytest.approx(expected, abs=1e-12)


# --- contacts --------------------------------------------------------------------------------------------------------


def outward(body: object, arc: int, phi: float) -> np.ndarray:
    """Direction out of the side behind an arc, in the frame of the slope."""
    c, s = math.cos(phi), math.sin(phi)
    return np.array([[c, -s], [s, c]]) @ [body["ox"][arc], body["oy"][arc]]


def gap_and_place(body: object, pieces: np.ndarray, features: tuple[int, int, int], pose: np.ndarray) -> tuple:
    """Gap, normal, and touching point on the body of two features, from the table of physics.md, section 12."""
    kind, arc, j = features
    c, s = math.cos(pose[2]), math.sin(pose[2])
    turn, mass_centre = np.array([[c, -s], [s, c]]), np.array(pose[:2])
    vertex = np.array([pieces[j]["x"], pieces[j]["y"]])
    if kind == SIDE_CREST:
        normal = -outward(body, arc, pose[2])
        begin = mass_centre + turn @ [body["sx"][arc], body["sy"][arc]]
        gap = (begin - vertex) @ normal
        return gap, normal, vertex + gap * normal
    centre, radius = mass_centre + turn @ [body["cx"][arc], body["cy"][arc]], body["r"][arc]
    normal = np.array([-pieces[j]["ty"], pieces[j]["tx"]])
    if kind == ARC_CREST:
        normal = (centre - vertex) / math.hypot(*(centre - vertex))
    return normal @ (centre - vertex) - radius, normal, centre - radius * normal


FEATURES = [(ARC_PIECE, 1, 1), (ARC_PIECE, 2, 3), (ARC_CREST, 1, CREST), (ARC_CREST, 0, CREST), (SIDE_CREST, 1, CREST)]


@pytest.mark.parametrize("features", FEATURES)
@pytest.mark.parametrize("body", [BLOCK, SLED], ids=["block", "sled"])
@pytest.mark.parametrize("phi", [0.0, 0.4, -2.5])
def test_a_contact_lies_and_moves_as_its_features_do(features: tuple[int, int, int], body: object, phi: float) -> None:
    """Oracle: the table of physics.md, section 12; the gap rate is a difference quotient of the gap.

    The slip is what the touching point of the body, held fast on the body, moves along the tangent in a short time.
    """
    if features[0] == SIDE_CREST:
        features = (SIDE_CREST, next(k for k in range(4) if body["length"][k] > 0.0), CREST)
    pieces, space = pieces_of(ROOF), new_space()
    pose, velocity = np.array([0.1, 1.1, phi]), np.array([0.7, -0.4, 1.3])
    put(space, pose, velocity)
    contact = touch(body, pieces, space, features, Spring())
    _, normal, point = gap_and_place(body, pieces, features, pose)
    np.testing.assert_allclose([contact["nx"], contact["ny"]], normal, atol=1e-14)
    np.testing.assert_allclose(touching_place(space["motion"], contact), point, atol=1e-12)
    step = 1e-6
    ahead, behind = (gap_and_place(body, pieces, features, pose + sign * step * velocity)[0] for sign in (1, -1))
    rate, slip = velocities(space["motion"], contact)
    assert rate == pytest.approx((ahead - behind) / (2.0 * step), abs=1e-7)
    lever = point - pose[:2]
    moved = velocity[:2] + velocity[2] * np.array([-lever[1], lever[0]])
    assert slip == pytest.approx(moved @ [normal[1], -normal[0]], abs=1e-12)
    assert (contact["gap_rate"], contact["slip"]) == (rate, slip)


def agree(body: object, pose: np.ndarray, one: tuple[int, int, int], two: tuple[int, int, int]) -> None:
    """Two contacts have the same normal, touching point, gap rate and slip."""
    pieces, space = pieces_of(ROOF), new_space()
    put(space, pose, (0.7, -0.4, 1.3))
    first, second = (touch(body, pieces, space, features, Spring()) for features in (one, two))
    for name in ("nx", "ny", "ln", "lt", "gap_rate", "slip"):
        assert first[name] == pytest.approx(second[name], abs=1e-12), name
    gaps = [gap_and_place(body, pieces, features, pose)[0] for features in (one, two)]
    assert gaps[0] == pytest.approx(gaps[1], abs=1e-12)


def pose_with_centre(body: object, arc: int, place_: np.ndarray, phi: float) -> np.ndarray:
    """Pose in which the centre of an arc is at a place."""
    c, s = math.cos(phi), math.sin(phi)
    return np.array([*(place_ - np.array([[c, -s], [s, c]]) @ [body["cx"][arc], body["cy"][arc]]), phi])


@pytest.mark.parametrize("depth", [0.0, 0.01])
@pytest.mark.parametrize("piece", [CREST - 1, CREST])
@pytest.mark.parametrize("phi", [0.3, -1.2])
def test_an_arc_passes_from_a_piece_to_its_crest_without_a_jump(depth: float, piece: int, phi: float) -> None:
    """Oracle: with its foot on the crest an arc touches the piece as it touches the crest."""
    ground = pieces_of(ROOF)[piece]
    centre = np.array([0.0, 0.5]) + (BLOCK["r"][1] - depth) * np.array([-ground["ty"], ground["tx"]])
    agree(BLOCK, pose_with_centre(BLOCK, 1, centre, phi), (ARC_PIECE, 1, piece), (ARC_CREST, 1, CREST))


@pytest.mark.parametrize("depth", [0.0, 0.01])
@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("phi", [0.3, -1.2])
def test_a_crest_passes_from_an_arc_to_a_side_without_a_jump(depth: float, end: int, phi: float) -> None:
    """Oracle: where a side begins or ends it touches a crest as the arc there does."""
    side = 1
    arc = (side + end) % 4
    centre = np.array([0.0, 0.5]) - (BLOCK["r"][arc] - depth) * outward(BLOCK, side, phi)
    agree(BLOCK, pose_with_centre(BLOCK, arc, centre, phi), (SIDE_CREST, side, CREST), (ARC_CREST, arc, CREST))


@pytest.mark.parametrize("name", ["sled", "block", "hexagon", "triangle"])
def test_sides_go_from_arc_to_arc(name: str) -> None:
    """Oracle: each end of a side lies on its arc and is level with the other one; smooth joins have one point."""
    body = record_of(BODIES[name])
    arcs = int(body["arcs"])
    for k in range(arcs):
        after = (k + 1) % arcs
        out = np.array([body["ox"][k], body["oy"][k]])
        begin, end = (np.array([body["cx"][i], body["cy"][i]]) + body["r"][i] * out for i in (k, after))
        np.testing.assert_allclose([body["sx"][k], body["sy"][k]], begin, atol=1e-12)
        np.testing.assert_allclose((end - begin) @ out, 0.0, atol=1e-9)
        assert math.hypot(*out) == pytest.approx(1.0, abs=1e-14)
        assert math.hypot(*(end - begin)) == pytest.approx(body["length"][k], abs=1e-9)
        assert bool(body["smooth"][k]) == (body["length"][k] == 0.0)


@given(st.floats(-4.0, 4.0), st.floats(0.0, 1.5))
def test_an_arc_faces_what_lies_in_its_angle(relative: float, distance: float) -> None:
    """Oracle: a plane under the body, turned by the same angle, has that arc as the lowest one."""
    for arc in range(4):
        middle, half = BLOCK["mid"][arc], BLOCK["half"][arc]
        turned = (relative - middle + math.pi) % math.tau - math.pi
        if abs(abs(turned) - half) < 1e-9:
            continue
        down = np.array([-math.sin(relative), -math.cos(relative)])
        place_ = np.array([BLOCK["cx"][arc], BLOCK["cy"][arc]]) + (distance + 0.01) * down
        assert faces_arc(BLOCK, arc, *place_) == (abs(turned) <= half)
        assert beyond(BLOCK, arc, relative) == (0 if abs(turned) <= half else math.copysign(1, turned))


@given(st.floats(-3.1, 3.1), st.floats(-3.1, 3.1))
def test_a_centre_over_a_crest_lies_between_the_normals_of_its_pieces(direction: float, phi: float) -> None:
    """Oracle: the angle of the normal on the crest lies between those of its pieces."""
    pieces = pieces_of(ROOF)
    low, high = pieces[CREST]["tilt"], pieces[CREST - 1]["tilt"]
    if min(abs(direction - low), abs(direction - high)) < 1e-9:
        return
    normal = np.array([-math.sin(direction), math.cos(direction)])
    pose = pose_with_centre(BLOCK, 1, np.array([0.0, 0.5]) + 0.2 * normal, phi)
    c, s = math.cos(phi), math.sin(phi)
    seen = np.array([[c, s], [-s, c]]) @ (np.array([0.0, 0.5]) - pose[:2])
    # Below the crest, where no body is, the sides of both lines are crossed the other way round.
    assert in_cone(BLOCK, pieces, 1, CREST, *seen, phi) == (low <= direction <= high)


@pytest.mark.parametrize(
    ("x", "zone"), [(-1.0, 0), (0.0, 0), (0.5, 1), (1.0, 2), (1.5, 2)], ids=["before", "edge", "in", "end", "behind"]
)
def test_the_zone_of_a_place_is_the_rougher_one_at_a_boundary(x: float, zone: int) -> None:
    """Oracle: half-open intervals; at a boundary the larger friction, as in the mirror image."""
    ground = new_space()["ground"]
    ground["count"] = 3.0
    ground["begin"][:4] = -math.inf, 0.0, 1.0, math.inf
    ground["friction"][:3] = 0.3, 0.1, 0.2
    assert zone_at(ground, x) == zone
