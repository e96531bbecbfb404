"""The pieces of a profile, and normals, levers and velocities of the three kinds of contacts."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sledenv import hull
from sledenv.kernel import contacts, geometry
from sledenv.kernel.geometry import ARC_BEND, ARC_PIECE, SIDE_BEND
from tests.compiled import compiled
from tests.engine import Spring, new_space, pieces_of, put, record_of, touch
from tests.profiles import BODIES

velocities = compiled(geometry.velocities)
touching_place = compiled(geometry.touching_place)
height_at, tangent_at = compiled(geometry.height_at), compiled(geometry.tangent_at)
faces_arc, beyond, zone_at = compiled(geometry.faces_arc), compiled(geometry.beyond), compiled(contacts.zone_at)
ROOF = ((-1.0, 0.0), (0.0, 0.5), (1.0, 0.0))  # dip, crest, dip
CREST = 2  # the piece that begins at the top of the roof
BLOCK, SLED = record_of(BODIES["block"]), record_of(BODIES["sled"])
CLUB = record_of(hull(5.0, [(-0.3, 0.0, 0.1), (0.4, 0.0, 0.3)]))
steps = st.tuples(st.floats(0.05, 2.0), st.floats(-1.0, 1.0))
profiles = st.lists(steps, min_size=2, max_size=12)


def walk(along: list[tuple[float, float]]) -> np.ndarray:
    """Vertices one step after the other."""
    return np.cumsum(np.array(along), axis=0)


def height(vertices: np.ndarray, x: float) -> float:
    return float(np.interp(x, vertices[:, 0], vertices[:, 1]))


# --- pieces ----------------------------------------------------------------------------------------------------------


def turns_of(pieces: np.ndarray) -> np.ndarray:
    """Sine of the turn where each piece begins; that of the first one is 0."""
    tx, ty = pieces["tx"], pieces["ty"]
    return np.r_[0.0, tx[:-1] * ty[1:] - ty[:-1] * tx[1:]]


@given(profiles, st.floats(0.01, 5.0))
def test_a_bend_touches_both_its_pieces(along: list[tuple[float, float]], rounding: float) -> None:
    """Oracle: a circle of that radius through both ends, at right angles to the pieces there, on the side of the turn.

    Its ends lie on the pieces, and no two bends overlap.
    """
    pieces = pieces_of(walk(along), rounding)
    turns = turns_of(pieces)
    for j in range(1, len(pieces)):
        bend, before, after = pieces[j], pieces[j - 1], pieces[j]
        assert bend["bend"] == (1 if turns[j] < 0.0 else -1 if turns[j] > 0.0 else 0)
        if bend["bend"] == 0:
            continue
        assert 0.0 < bend["radius"] <= rounding
        begin, end, centre = (np.array([bend[name + "x"], bend[name + "y"]]) for name in "beq")
        for place_, piece in ((begin, before), (end, after)):
            out = place_ - centre
            assert math.hypot(*out) == pytest.approx(bend["radius"], rel=1e-9)
            assert out @ [piece["tx"], piece["ty"]] == pytest.approx(0.0, abs=1e-12 * (1.0 + rounding))
            assert bend["bend"] * (out @ [-piece["ty"], piece["tx"]]) > 0.0
            foot = (place_ - [piece["x"], piece["y"]]) @ [piece["tx"], piece["ty"]]
            assert min(abs(foot - piece["low"]), abs(foot - piece["high"])) < 1e-12 * (1.0 + abs(foot))
    assert (pieces["high"] - pieces["low"] > 0.0).all()


@given(profiles, st.sampled_from([0.0, 0.3, 2.0]))
def test_heights_and_tangents_are_those_of_pieces_and_circles(
    along: list[tuple[float, float]], rounding: float
) -> None:
    """Oracle: the line through a piece, or the circle of a bend; tangents are difference quotients of heights."""
    vertices = walk(along)
    pieces = pieces_of(vertices, rounding)
    for x in np.linspace(vertices[0, 0] - 1.0, vertices[-1, 0] + 1.0, 41).tolist():
        expected = height(vertices, x)
        for bend in pieces[1:]:
            if bend["bx"] < x < bend["ex"]:
                expected = bend["qy"] + bend["bend"] * math.sqrt(bend["radius"] ** 2 - (x - bend["qx"]) ** 2)
        assert height_at(pieces, x) == pytest.approx(expected, abs=1e-9)
        ends = np.r_[pieces["bx"], pieces["ex"]]
        if np.abs(ends - x).min() > 1e-6:
            tx, ty = tangent_at(pieces, x)
            rate = (height_at(pieces, x + 1e-7) - height_at(pieces, x - 1e-7)) / 2e-7
            assert (ty / tx, math.hypot(tx, ty)) == (pytest.approx(rate, abs=1e-5), pytest.approx(1.0, rel=1e-12))


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
    sign, rounding = pieces[j]["bend"], pieces[j]["radius"]
    middle = np.array([pieces[j]["qx"], pieces[j]["qy"]])
    if kind == SIDE_BEND:
        normal = -outward(body, arc, pose[2])
        for piece, part, sense in ((pieces[j - 1], "b", -1.0), (pieces[j], "e", 1.0)):
            if rounding > 0.0 and sense * (normal @ [piece["tx"], piece["ty"]]) > 0.0:  # beyond an end of the bend
                middle, rounding = np.array([pieces[j][part + "x"], pieces[j][part + "y"]]), 0.0
        begin = mass_centre + turn @ [body["sx"][arc], body["sy"][arc]]
        away = (begin - middle) @ normal
        return away - rounding, normal, middle + away * normal
    centre, radius = mass_centre + turn @ [body["cx"][arc], body["cy"][arc]], body["r"][arc]
    normal = np.array([-pieces[j]["ty"], pieces[j]["tx"]])
    if kind == ARC_BEND:
        normal = sign * (centre - middle) / math.hypot(*(centre - middle))
        gap = sign * (math.hypot(*(centre - middle)) - rounding) - radius
        return gap, normal, centre - radius * normal
    return normal @ (centre - vertex) - radius, normal, centre - radius * normal


FEATURES = [(ARC_PIECE, 1, 1), (ARC_PIECE, 2, 3), (ARC_BEND, 1, CREST), (ARC_BEND, 0, CREST), (SIDE_BEND, 1, CREST)]


@pytest.mark.parametrize(("features", "rounding"), [*product(FEATURES, (0.0, 0.4)), ((ARC_BEND, 2, 3), 0.4)])
@pytest.mark.parametrize("body", [BLOCK, SLED], ids=["block", "sled"])
@pytest.mark.parametrize("phi", [0.0, 0.4, -2.5])
def test_a_contact_lies_and_moves_as_its_features_do(
    features: tuple[int, int, int], body: object, phi: float, rounding: float
) -> None:
    """Oracle: the table of physics.md, section 12; the gap rate is a difference quotient of the gap.

    The slip is what the touching point of the body, held fast on the body, moves along the tangent in a short time.
    """
    if features[0] == SIDE_BEND:
        features = (SIDE_BEND, next(k for k in range(4) if body["length"][k] > 0.0), CREST)
    pieces, space = pieces_of(ROOF, rounding), new_space()
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


def agree(
    body: object, pose: np.ndarray, one: tuple[int, int, int], two: tuple[int, int, int], rounding: float = 0.0
) -> None:
    """Two contacts have the same normal, touching point, gap rate and slip."""
    pieces, space = pieces_of(ROOF, rounding), new_space()
    put(space, pose, (0.7, -0.4, 1.3))
    first, second = (touch(body, pieces, space, features, Spring()) for features in (one, two))
    for name in ("nx", "ny", "normal_lever", "tangent_lever", "gap_rate", "slip"):
        assert first[name] == pytest.approx(second[name], abs=1e-12), name
    gaps = [gap_and_place(body, pieces, features, pose)[0] for features in (one, two)]
    assert gaps[0] == pytest.approx(gaps[1], abs=1e-12)


def pose_with_centre(body: object, arc: int, place_: np.ndarray, phi: float) -> np.ndarray:
    """Pose in which the centre of an arc is at a place."""
    c, s = math.cos(phi), math.sin(phi)
    return np.array([*(place_ - np.array([[c, -s], [s, c]]) @ [body["cx"][arc], body["cy"][arc]]), phi])


@pytest.mark.parametrize("depth", [0.0, 0.01])
@pytest.mark.parametrize(
    ("piece", "bend", "rounding"),
    [*((piece, CREST, rounding) for piece in (CREST - 1, CREST) for rounding in (0.0, 0.4)), (CREST, 3, 0.4)],
)
@pytest.mark.parametrize("phi", [0.3, -1.2])
def test_an_arc_passes_from_a_piece_to_its_bend_without_a_jump(
    depth: float, piece: int, bend: int, phi: float, rounding: float
) -> None:
    """Oracle: with its foot on an end of the bend an arc touches the piece as it touches the bend."""
    pieces = pieces_of(ROOF, rounding)
    ground, end = pieces[piece], "e" if bend == piece else "b"
    foot = np.array([pieces[bend][end + "x"], pieces[bend][end + "y"]])
    centre = foot + (BLOCK["r"][1] - depth) * np.array([-ground["ty"], ground["tx"]])
    agree(BLOCK, pose_with_centre(BLOCK, 1, centre, phi), (ARC_PIECE, 1, piece), (ARC_BEND, 1, bend), rounding)


@pytest.mark.parametrize("depth", [0.0, 0.01])
@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize("turned", [0.3, -0.4])
@pytest.mark.parametrize("rounding", [0.0, 0.4])
def test_a_crest_passes_from_an_arc_to_a_side_without_a_jump(
    depth: float, end: int, turned: float, rounding: float
) -> None:
    """Oracle: where a side begins or ends it touches a crest as the arc there does."""
    side, bend = 1, pieces_of(ROOF, rounding)[CREST]
    arc, phi = (side + end) % 4, turned + math.atan2(-BLOCK["ox"][side], -BLOCK["oy"][side])
    reach = BLOCK["r"][arc] + bend["radius"] - depth
    centre = np.array([bend["qx"], bend["qy"]]) - reach * outward(BLOCK, side, phi)
    pose = pose_with_centre(BLOCK, arc, centre, phi)
    agree(BLOCK, pose, (SIDE_BEND, side, CREST), (ARC_BEND, arc, CREST), rounding)


@given(st.floats(-4.0, 4.0), st.floats(0.0, 1.5))
def test_an_arc_faces_what_lies_in_its_angle(relative: float, distance: float) -> None:
    """Oracle: a plane under the body, turned by the same angle, has that arc as the lowest one. An arc may be wide."""
    for body, arc in [*((BLOCK, arc) for arc in range(4)), (CLUB, 0), (CLUB, 1)]:
        half, middle = body["half"][arc], body["mid"][arc] + (math.pi if body["over"][arc] else 0.0)
        turned = math.remainder(relative - middle, math.tau)
        if abs(abs(turned) - half) < 1e-9:
            continue
        down = np.array([-math.sin(relative), -math.cos(relative)])
        place = np.array([body["cx"][arc], body["cy"][arc]]) + (distance + 0.01) * down
        assert faces_arc(body, arc, *place) == (abs(turned) <= half)
        assert beyond(body, arc, relative) == (0 if abs(turned) <= half else math.copysign(1, turned))


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
