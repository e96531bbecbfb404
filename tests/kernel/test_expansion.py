"""The power series of a step, in contact and in flight: they obey Newton's equations from end to end of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from sledenv.kernel import expansion
from sledenv.kernel.contacts import ORDER
from sledenv.kernel.geometry import ARC_BEND, ARC_PIECE, SIDE_BEND
from tests.engine import Spring, incline, new_space, pieces_of, put, record_of, rows_of, touch
from tests.profiles import BODIES

expand, longest_step, value = expansion.expand, expansion.longest_step, expansion.value  # as plain Python
BLOCK = record_of(BODIES["block"])
TOP = [(-1.0, 0.0), (0.0, 0.5), (1.0, 0.0)]  # a crest between two dips
ROOF, ROUND = pieces_of(TOP), pieces_of(TOP, 0.3)
SLOPE = incline(0.2)
PIECE, OTHER_PIECE = (ARC_PIECE, 2, 3), (ARC_PIECE, 1, 1)
CREST, SIDE, DIP = (ARC_BEND, 1, 2), (SIDE_BEND, 1, 2), (ARC_BEND, 2, 3)
SPRINGS = (Spring(arm=0.01), Spring(2e-3, 5e4, 2e4, 0.2, 0.02), Spring(5e-4, 2e4, 2e4, 0.5, 0.0))
POSE, VELOCITY = (0.42, 0.83, 0.07), (1.3, -0.6, 0.9)
GAP, SLIP, SPIN = "gap", "slip", "spin"
Features = list[tuple[int, int, int]]
Locked = list[tuple[str, int]]


def prepared(pieces: np.ndarray, features: Features, locked: Locked) -> Any:
    """Work space with contacts in a mode: velocities that are locked are zero, the others have the sign they have."""
    space = new_space()
    put(space, POSE, VELOCITY)
    contacts = space["contacts"]
    for feature, spring in zip(features, SPRINGS, strict=False):
        touch(BLOCK, pieces, space, feature, spring)
    rows, moving = rows_of(space), np.array(VELOCITY)
    held = [rows[2 * who + (what == SLIP)] if what != SPIN else np.array([0.0, 0.0, 1.0]) for what, who in locked]
    if held:
        moving = moving - np.linalg.pinv(np.array(held)) @ (np.array(held) @ moving)
    if (SPIN, 0) in locked:
        moving[2] = 0.0
    put(space, POSE, moving)
    for c in range(len(features)):
        contact = contacts["at"][c]
        contact["gap_still"], contact["slip_still"] = (GAP, c) in locked, (SLIP, c) in locked
        contact["gap_rate"] = 0.0 if contact["gap_still"] else rows[2 * c] @ moving
        contact["slip"] = 0.0 if contact["slip_still"] else rows[2 * c + 1] @ moving
        contact["gap_sign"], contact["slip_sign"] = np.sign(contact["gap_rate"]), np.sign(contact["slip"])
    contacts["spin_sign"], contacts["spin_still"] = np.sign(moving[2]), (SPIN, 0) in locked
    return space


ALONE: list[Locked] = [
    [],
    [(SLIP, 0)],
    [(GAP, 0)],
    [(SPIN, 0)],
    [(GAP, 0), (SLIP, 0)],
    [(GAP, 0), (SPIN, 0)],
    [(SLIP, 0), (SPIN, 0)],
]
SEVERAL: list[tuple[Features, Locked]] = [
    ([PIECE, OTHER_PIECE], []),
    ([PIECE, OTHER_PIECE], [(GAP, 0), (GAP, 1)]),
    ([PIECE, CREST], [(SLIP, 1)]),
    ([PIECE, CREST], [(GAP, 0), (GAP, 1)]),
    ([PIECE, CREST], [(GAP, 0), (SLIP, 1)]),
    ([PIECE, SIDE], [(GAP, 1), (SLIP, 0)]),
    ([PIECE, SIDE], [(SPIN, 0), (GAP, 1)]),
    ([PIECE, CREST, SIDE], []),
    ([PIECE, CREST, SIDE], [(GAP, 1), (SLIP, 2)]),
]


def cases() -> Iterator[Any]:
    """Contacts and what is locked: of one contact on sharp and on round ground, and of several."""
    alone = [(ROOF, [feature], locked) for feature in (PIECE, CREST, SIDE) for locked in ALONE]
    turned = [(ROUND, [feature], locked) for feature in (CREST, SIDE, DIP) for locked in ALONE]
    both = [(ROUND, [CREST, DIP], [*locked, (GAP, 1)]) for locked in ([], [(GAP, 0)], [(SLIP, 0)])]
    for ground, features, locked in (*alone, *((ROOF, *several) for several in SEVERAL), *turned, *both):
        names = [str(feature[0]) for feature in features] + [f"{what}{who}" for what, who in locked]
        yield pytest.param(ground, features, locked, id=" ".join([*names, "round" if ground is ROUND else "sharp"]))


def moved(pieces: np.ndarray, features: Features, series: Any, before: Any, t: float) -> Any:
    """Work space in which body and contacts are where the series say at a time of the step."""
    space = new_space()
    put(space, *([value(series[name], t) for name in names] for names in (("x", "y", "phi"), ("u", "v", "omega"))))
    for c, feature in enumerate(features):
        contact = touch(BLOCK, pieces, space, feature, SPRINGS[c]._replace(depth=-value(series["of"][c]["gap"], t)))
        depth = contact["depth_offset"] - before["contacts"]["at"][c]["depth_offset"]
        assert depth == pytest.approx(0.0, abs=1e-12)  # springs follow the geometry
    return space


@pytest.mark.parametrize(("ground", "features", "locked"), [*cases()])
def test_series_obey_newtons_equations_from_end_to_end_of_a_step(
    ground: np.ndarray, features: Features, locked: Locked
) -> None:
    """Oracle: forces as the law has them, gaps and normals of the geometry, at four times; what is locked is zero."""
    space = prepared(ground, features, locked)
    expand(BLOCK, SLOPE, space)
    series, contacts = space["series"], space["contacts"]
    longest = min(longest_step(BLOCK, SLOPE, 1e-14, space), 0.3)
    assert longest > 1e-3
    for t in (0.0, 0.3 * longest, 0.7 * longest, longest):
        there = moved(ground, features, series, space, t)
        rows, velocity = rows_of(there), np.array([value(series[name], t) for name in ("u", "v", "omega")])
        weight = BLOCK["mass"] * np.array([SLOPE.downhill, -SLOPE.inward])
        push, load = np.array([*weight, value(series["moment"], t)]), 0.0
        for c in range(len(features)):
            contact, terms = contacts["at"][c], series["of"][c]
            normal, force = value(terms["normal"], t), value(terms["force"], t)
            push += normal * rows[2 * c] + force * rows[2 * c + 1]
            load += contact["rolling_arm"] * normal
            assert value(terms["gap_rate"], t) == pytest.approx(rows[2 * c] @ velocity, abs=1e-11)
            assert value(terms["slip"], t) == pytest.approx(rows[2 * c + 1] @ velocity, abs=1e-11)
            stiffness = contact["closing"] if contact["gap_sign"] < 0 else contact["opening"]
            if not contact["gap_still"]:
                assert normal == pytest.approx(-stiffness * value(terms["gap"], t), rel=1e-12)
            if not contact["slip_still"]:
                assert force == pytest.approx(-contact["slip_sign"] * contact["friction"] * normal, rel=1e-11)
        if not contacts["spin_still"]:
            assert value(series["moment"], t) == pytest.approx(-contacts["spin_sign"] * load, rel=1e-11, abs=1e-12)
        rates = [sum(k * series[name][k] * t ** (k - 1) for k in range(1, ORDER + 1)) for name in ("u", "v", "omega")]
        masses = np.array([BLOCK["mass"], BLOCK["mass"], BLOCK["inertia"]])
        assert masses * rates == pytest.approx(push, abs=1e-8 * np.abs(push).max())
    for what, who in locked:
        zero = series["omega"] if what == SPIN else series["of"][who]["gap_rate" if what == GAP else "slip"]
        assert not np.any(zero[: ORDER + 1])


@pytest.mark.parametrize("omega", [0.0, 3.0, -0.7])
def test_terms_in_flight(omega: float) -> None:
    """Oracle: a parabola, a constant spin, and the series of sine and cosine."""
    space = new_space()
    put(space, (0.3, 2.0, 0.4), (1.5, -0.5, omega))
    expand(BLOCK, SLOPE, space)
    series, rest = space["series"], [0.0] * (ORDER - 2)
    for name, terms in (
        ("x", [0.3, 1.5, 0.5 * SLOPE.downhill]),
        ("y", [2.0, -0.5, -0.5 * SLOPE.inward]),
        ("phi", [0.4, omega, 0.0]),
        ("u", [1.5, SLOPE.downhill, 0.0]),
        ("v", [-0.5, -SLOPE.inward, 0.0]),
    ):
        np.testing.assert_array_equal(series[name][: ORDER + 1], [*terms, *rest])
    for k in range(ORDER + 1):
        factor = omega**k / math.factorial(k)
        assert series["sine"][k] == pytest.approx(math.sin(0.4 + 0.5 * math.pi * k) * factor, rel=1e-13)
        assert series["cosine"][k] == pytest.approx(math.cos(0.4 + 0.5 * math.pi * k) * factor, rel=1e-13)
