"""The power series of a step: every term of the motion and of the contacts, in contact and in flight."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from sledenv.kernel import expansion
from sledenv.kernel.contacts import ORDER
from sledenv.kernel.geometry import ARC_BEND, ARC_PIECE, SIDE_BEND
from tests.engine import BODIES, Spring, incline, new_space, pieces_of, put, record_of, rows_of, touch
from tests.jets import Course, Jet, Touch, course

expand, longest_step, value = expansion.expand, expansion.longest_step, expansion.value  # as plain Python
BLOCK, DISC = record_of(BODIES["block"]), record_of(BODIES["disc"])
TOP = [(-1.0, 0.0), (0.0, 0.5), (1.0, 0.0)]  # a crest between two dips
ROOF, ROUND = pieces_of(TOP), pieces_of(TOP, 0.3)
PLANE = pieces_of([])
SLOPE = incline(0.2)
PIECE, OTHER_PIECE = (ARC_PIECE, 2, 3), (ARC_PIECE, 1, 1)
CREST, SIDE, DIP = (ARC_BEND, 1, 2), (SIDE_BEND, 1, 2), (ARC_BEND, 2, 3)
SPRINGS = (Spring(arm=0.01), Spring(2e-3, 5e4, 2e4, 0.2, 0.02), Spring(5e-4, 2e4, 2e4, 0.5, 0.0))
POSE, VELOCITY = (0.42, 0.83, 0.07), (1.3, -0.6, 0.9)
GAP, SLIP, SPIN = "gap", "slip", "spin"


def gap_of_side(pieces: np.ndarray, space: Any, side: int) -> float:
    """Gap [m] of the top of the roof to a side of the block."""
    motion, bend = space["motion"], pieces[2]
    dx, dy = bend["qx"] - motion["x"], bend["qy"] - motion["y"]
    along, across = motion["cosine"] * dx + motion["sine"] * dy, motion["cosine"] * dy - motion["sine"] * dx
    away = BLOCK["ox"][side] * (along - BLOCK["sx"][side]) + BLOCK["oy"][side] * (across - BLOCK["sy"][side])
    return float(away - bend["radius"])


def prepared(
    body: Any,
    pieces: np.ndarray,
    features: list[tuple[int, int, int]],
    locked: list[tuple[str, int]],
    pose: tuple[float, ...] = POSE,
    velocity: tuple[float, ...] = VELOCITY,
    fresh: bool = True,
) -> tuple[Any, list[Touch]]:
    """Work space and contacts in a mode: velocities that are locked are zero, the others have the sign they have.

    A side that is ``fresh`` is pressed by as much as the crest is inside.
    """
    space = new_space()
    put(space, pose, velocity)
    contacts = space["contacts"]
    for feature, spring in zip(features, SPRINGS, strict=False):
        touch(body, pieces, space, feature, spring)
    rows = rows_of(space)
    held = [rows[2 * who + (what == SLIP)] if what != SPIN else np.array([0.0, 0.0, 1.0]) for what, who in locked]
    moving = np.array(velocity)
    if held:
        moving = moving - np.linalg.pinv(np.array(held)) @ (np.array(held) @ moving)
    if (SPIN, 0) in locked:
        moving[2] = 0.0
    put(space, pose, moving)
    touches = []
    for c, feature in enumerate(features):
        contact = contacts["at"][c]
        contact["gap_rate"], contact["slip"] = rows[2 * c] @ moving, rows[2 * c + 1] @ moving
        if feature[0] == SIDE_BEND and fresh:
            contact["gap"] = gap_of_side(pieces, space, feature[1])
            contact["depth_offset"] = 0.0
        gap_locked, slip_locked = (GAP, c) in locked, (SLIP, c) in locked
        contact["gap_still"], contact["slip_still"] = gap_locked, slip_locked
        if gap_locked:
            contact["gap_rate"] = 0.0
        if slip_locked:
            contact["slip"] = 0.0
        contact["gap_sign"], contact["slip_sign"] = np.sign(contact["gap_rate"]), np.sign(contact["slip"])
        stiffness = contact["closing"] if contact["gap_rate"] < 0.0 else contact["opening"]
        sign = int(contact["slip_sign"])
        numbers = (float(contact[name]) for name in ("friction", "rolling_arm"))
        touches.append(Touch(feature, float(contact["gap"]), float(stiffness), *numbers, sign, gap_locked, slip_locked))
    contacts["spin_sign"], contacts["spin_still"] = np.sign(moving[2]), (SPIN, 0) in locked
    return space, touches


def followed(body: Any, pieces: np.ndarray, space: Any, touches: list[Touch]) -> Course:
    """The oracle, from the state that has been prepared."""
    motion, contacts = space["motion"], space["contacts"]
    pose, velocity = ([motion[name] for name in names] for names in (("x", "y", "phi"), ("u", "v", "omega")))
    spin = int(contacts["spin_sign"])
    return course(body, pieces, SLOPE, pose, velocity, touches, spin, bool(contacts["spin_still"]), ORDER + 3)


def growth(found: Course) -> float:
    """Rate [1/s] at which the terms of the motion grow."""
    terms = [(k, abs(float(jet.terms[k]))) for jet in found.motion[3:] for k in range(1, ORDER + 1)]
    return max([1.0, *(term ** (1.0 / k) for k, term in terms if term > 0.0)])


def same(series: np.ndarray, jet: Jet, rate: float, last: int, scale: float = 1.0) -> None:
    """Terms agree to rounding, each on its own scale."""
    for k in range(last + 1):
        assert abs(series[k] - float(jet.terms[k])) <= 1e-11 * scale * rate**k, k


def same_motion(space: Any, found: Course) -> None:
    for name, jet in zip(("x", "y", "phi", "u", "v", "omega"), found.motion, strict=True):
        same(space["series"][name], jet, growth(found), ORDER)


def same_contacts(space: Any, touches: list[Touch], found: Course) -> None:
    rate = growth(found)
    for c, contact in enumerate(touches):
        terms = space["series"]["of"][c]
        same(terms["gap"], found.gaps[c], rate, ORDER)
        same(terms["gap_rate"], found.rates[c], rate, ORDER)
        same(terms["slip"], found.slips[c], rate, ORDER)
        last = ORDER - 1 if contact.gap_locked or contact.slip_locked else ORDER
        scale = float(BLOCK["mass"]) * rate
        same(terms["normal"], found.normals[c], rate, last, scale)
        same(terms["force"], found.forces[c], rate, last, scale)
    same(space["series"]["moment"], found.moment, rate, ORDER - 1, float(BLOCK["mass"]) * rate)


ALONE: list[list[tuple[str, int]]] = [
    [],
    [(SLIP, 0)],
    [(GAP, 0)],
    [(SPIN, 0)],
    [(GAP, 0), (SLIP, 0)],
    [(GAP, 0), (SPIN, 0)],
    [(SLIP, 0), (SPIN, 0)],
]
SEVERAL = [
    ([PIECE, OTHER_PIECE], []),
    ([PIECE, OTHER_PIECE], [(GAP, 0), (GAP, 1)]),
    ([PIECE, CREST], []),
    ([PIECE, CREST], [(SLIP, 1)]),
    ([PIECE, CREST], [(GAP, 0), (GAP, 1)]),
    ([PIECE, CREST], [(GAP, 0), (SLIP, 1)]),
    ([PIECE, SIDE], []),
    ([PIECE, SIDE], [(GAP, 1), (SLIP, 0)]),
    ([PIECE, SIDE], [(SPIN, 0), (GAP, 1)]),
    ([PIECE, CREST, SIDE], []),
    ([PIECE, CREST, SIDE], [(GAP, 1), (SLIP, 2)]),
]


def named(locked: list[tuple[str, int]]) -> str:
    return " ".join(f"{what}{who}" for what, who in locked) or "free"


def cases() -> Iterator[Any]:
    """Contacts and what is locked: of one contact, of several, of a side that the crest was in; a fifth is fast."""
    alone = [(ROOF, [feature], locked, True) for feature in (PIECE, CREST, SIDE) for locked in ALONE]
    several = [(ROOF, features, locked, True) for features, locked in SEVERAL]
    turned = [(ROUND, [feature], locked, True) for feature in (CREST, SIDE, DIP) for locked in ALONE]
    both = [(ROUND, [CREST, DIP], [*locked, (GAP, 1)], True) for locked in ([], [(GAP, 0)], [(SLIP, 0)])]
    stale = [
        (ground, [SIDE], locked, False)
        for ground in (ROOF, ROUND)
        for locked in ALONE
        if locked != [(GAP, 0), (SPIN, 0)]
    ]
    for number, (ground, features, locked, fresh) in enumerate((*alone, *several, *turned, *both, *stale)):
        kinds = " ".join(str(feature[0]) for feature in features)
        name = f"{kinds} {named(locked)} {'' if fresh else 'stale'} {'round' if ground is ROUND else ''}"
        yield pytest.param(ground, features, locked, fresh, id=name, marks=[] if number % 5 == 0 else pytest.mark.slow)


@pytest.mark.parametrize(("ground", "features", "locked", "fresh"), [*cases()])
def test_terms_of_contacts(
    ground: np.ndarray, features: list[tuple[int, int, int]], locked: list[tuple[str, int]], fresh: bool
) -> None:
    """Oracle: the equations of motion of physics.md, section 12, integrated with 40 digits; what is locked is zero.

    Where a crest was in a side when it came to touch, the lever goes to the point on the body, however deep the spring
    is pressed.
    """
    space, touches = prepared(BLOCK, ground, features, locked, fresh=fresh)
    expand(BLOCK, SLOPE, space)
    found, series = followed(BLOCK, ground, space, touches), space["series"]
    same_motion(space, found)
    same_contacts(space, touches, found)
    for what, who in locked:
        if what == SPIN:
            assert not np.any(series["omega"][: ORDER + 1])
            assert not np.any(series["phi"][1 : ORDER + 1])
        elif what == GAP:
            assert not np.any(series["of"][who]["gap_rate"][: ORDER + 1])
            assert not np.any(series["of"][who]["gap"][1 : ORDER + 1])
        else:
            assert not np.any(series["of"][who]["slip"][: ORDER + 1])


@pytest.mark.parametrize("locked", [[(SLIP, 0)], pytest.param([], marks=pytest.mark.slow)], ids=named)
def test_terms_of_a_disc_on_a_plane(locked: list[tuple[str, int]]) -> None:
    """Oracle: the equations of motion of physics.md, section 12, integrated with 40 digits."""
    space, touches = prepared(DISC, PLANE, [(ARC_PIECE, 0, 0)], locked, (0.0, 0.3, 1.0), (2.0, -0.5, -3.0))
    expand(DISC, SLOPE, space)
    same_motion(space, followed(DISC, PLANE, space, touches))


def test_a_block_that_slides_flat_keeps_its_spin_and_both_its_gaps() -> None:
    """Oracle: m u' = m g (sin(beta) - f cos(beta)): both have the same friction, so shares do not matter."""
    space = new_space()
    put(space, (0.0, 0.3, 0.0), (2.0, 0.0, 0.0))
    friction = 0.25
    for arc in (1, 2):
        contact = touch(BLOCK, PLANE, space, (ARC_PIECE, arc, 0), Spring(friction=friction))
        contact["gap_still"], contact["slip_sign"] = 1, 1
        contact["gap_rate"] = 0.0
    space["contacts"]["spin_still"] = 1
    expand(BLOCK, SLOPE, space)
    series = space["series"]
    assert series["u"][1] == pytest.approx(SLOPE.downhill - friction * SLOPE.inward, rel=1e-14)
    np.testing.assert_allclose(series["u"][2 : ORDER + 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(series["v"][: ORDER + 1], 0.0, atol=1e-12)
    for name in ("omega", "sw", "cw"):
        assert not np.any(series[name][: ORDER + 1]), name
    for c in (0, 1):
        assert not np.any(series["of"][c]["gap_rate"][: ORDER + 1])


@pytest.mark.parametrize("omega", [0.0, 3.0, -0.7])
def test_terms_in_flight(omega: float) -> None:
    """Oracle: a parabola, a constant spin, and the series of sine and cosine."""
    space = new_space()
    put(space, (0.3, 2.0, 0.4), (1.5, -0.5, omega))
    expand(BLOCK, SLOPE, space)
    series, rest = space["series"], [0.0] * (ORDER - 2)
    np.testing.assert_array_equal(series["x"][: ORDER + 1], [0.3, 1.5, 0.5 * SLOPE.downhill, *rest])
    np.testing.assert_array_equal(series["y"][: ORDER + 1], [2.0, -0.5, -0.5 * SLOPE.inward, *rest])
    np.testing.assert_array_equal(series["phi"][: ORDER + 1], [0.4, omega, 0.0, *rest])
    np.testing.assert_array_equal(series["u"][: ORDER + 1], [1.5, SLOPE.downhill, 0.0, *rest])
    np.testing.assert_array_equal(series["v"][: ORDER + 1], [-0.5, -SLOPE.inward, 0.0, *rest])
    for k in range(ORDER + 1):
        factor = omega**k / math.factorial(k)
        assert series["sine"][k] == pytest.approx(math.sin(0.4 + 0.5 * math.pi * k) * factor, rel=1e-13)
        assert series["cosine"][k] == pytest.approx(math.cos(0.4 + 0.5 * math.pi * k) * factor, rel=1e-13)


@pytest.mark.parametrize("ground", [ROOF, ROUND], ids=["sharp", "round"])
@pytest.mark.parametrize("feature", [PIECE, CREST, SIDE], ids=["arc on piece", "arc on crest", "side on crest"])
def test_series_hold_as_long_as_they_say(feature: tuple[int, int, int], ground: np.ndarray) -> None:
    """Oracle: energy of body and spring, which nothing takes away, from end to end of a step."""
    body, space = BLOCK, new_space()
    put(space, POSE, VELOCITY)
    spring = Spring(friction=0.0, closing=3e4, opening=3e4)
    contact = touch(body, ground, space, feature, spring)
    contact["gap_sign"], contact["slip_sign"] = np.sign(contact["gap_rate"]), 1
    space["contacts"]["spin_sign"] = 1
    expand(body, SLOPE, space)
    longest = longest_step(body, SLOPE, 1e-14, space)
    assert 1e-3 < longest < 1.0
    series = space["series"]

    def energy(t: float) -> float:
        x, y, u, v, omega = (value(series[name], t) for name in ("x", "y", "u", "v", "omega"))
        gap = value(series["of"][0]["gap"], t)
        moving = 0.5 * body["mass"] * (u * u + v * v) + 0.5 * body["inertia"] * omega * omega
        return float(moving + body["mass"] * (SLOPE.inward * y - SLOPE.downhill * x) + 0.5 * spring.closing * gap * gap)

    for share in (0.25, 0.5, 1.0):
        assert energy(share * longest) == pytest.approx(energy(0.0), rel=1e-12)
