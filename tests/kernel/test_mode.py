"""The choice of a mode: its forces and accelerations, and when a body rests."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import linprog

from sledenv.kernel import mode
from sledenv.kernel.geometry import ARC_BEND, ARC_PIECE, SIDE_BEND
from sledenv.kernel.params import Incline
from tests.engine import Spring, incline, new_space, pieces_of, put, record_of, rows_of, touch
from tests.profiles import BODIES

choose = mode.choose  # as plain Python: to compile it takes longer than to call it some hundred times
BLOCK = record_of(BODIES["block"])
PLANE, ROOF = pieces_of([]), pieces_of([(-1.0, 0.0), (0.0, 0.5), (1.0, 0.0)])
MASSES = np.array([BLOCK["mass"], BLOCK["mass"], BLOCK["inertia"]], dtype=float)
SPIN_ROW = np.array([0.0, 0.0, 1.0])
Features = tuple[int, int, int]
ANYWHERE: list[Features] = [
    (ARC_PIECE, 1, 1),
    (ARC_PIECE, 2, 3),
    (ARC_BEND, 1, 2),
    (SIDE_BEND, 1, 2),
    (ARC_PIECE, 0, 2),
]
FLAT: list[Features] = [(ARC_PIECE, 1, 0), (ARC_PIECE, 2, 0)]

depths = st.floats(1e-4, 2e-2)
springs = st.builds(
    Spring,
    depths,
    st.floats(2e4, 5e4),
    st.floats(2e3, 2e4),
    st.floats(0.01, 0.8),
    st.one_of(st.just(0.0), st.floats(1e-3, 0.1)),
)
speeds = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-3.0, 3.0))
poses = st.tuples(st.floats(0.2, 0.6), st.floats(0.8, 1.0), st.floats(-3.0, 3.0))
angles = st.floats(-0.5, 0.5)


class Scene(NamedTuple):
    """A body with its contacts, some of whose velocities are zero."""

    pieces: np.ndarray
    slope: Incline
    pose: tuple[float, ...]
    velocity: tuple[float, ...]
    features: Sequence[Features]
    springs: Sequence[Spring]
    zeros: Sequence[int]  # velocities that are zero: 2 c is gap rate, 2 c + 1 slip of contact c, -1 the spin


def row(space: Any, zero: int) -> np.ndarray:
    return SPIN_ROW if zero < 0 else rows_of(space)[zero]


def prepared(scene: Scene) -> Any:
    """Work space of a scene; what depends on velocities that are zero is zero too."""
    space = new_space()
    put(space, scene.pose, scene.velocity)
    for feature, spring in zip(scene.features, scene.springs, strict=True):
        touch(BLOCK, scene.pieces, space, feature, spring)
    velocity = np.array(scene.velocity)
    if scene.zeros:
        held = np.array([row(space, zero) for zero in scene.zeros])
        velocity = velocity - np.linalg.pinv(held, rcond=1e-9) @ (held @ velocity)
        velocity[abs(velocity) < 1e-12] = 0.0
    if -1 in scene.zeros:
        velocity[2] = 0.0
    put(space, scene.pose, velocity)
    for c in range(len(scene.features)):
        contact = space["contacts"]["at"][c]
        for zero, name in ((2 * c, "gap_rate"), (2 * c + 1, "slip")):
            rate = row(space, zero) @ velocity
            contact[name] = 0.0 if zero in scene.zeros or abs(rate) < 1e-12 else rate
    return space


def drifts(scene: Scene, space: Any) -> np.ndarray:
    """How gap rates and slips change while u, v and omega do not: difference quotients of their rows."""
    velocity, step = np.array([space["motion"][name] for name in ("u", "v", "omega")]), 1e-5
    ahead, behind = (
        np.array(rows_of(prepared(scene._replace(pose=tuple(np.array(scene.pose) + sign * step * velocity), zeros=()))))
        for sign in (1, -1)
    )
    return np.asarray((ahead - behind) @ velocity / (2.0 * step))


def free(scene: Scene) -> np.ndarray:
    """Acceleration without contacts."""
    return np.array([scene.slope.downhill, -scene.slope.inward, 0.0])


def chosen(space: Any) -> np.ndarray:
    return np.array([space["choice"][name] for name in ("du", "dv", "domega")])


def same_acceleration(found: np.ndarray, expected: np.ndarray, size: float = 1e3) -> None:
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=2e-9 * size)


def check_laws(scene: Scene, space: Any) -> None:
    """The forces move the body as Newton says, and each one is within its bounds, or at the one its velocity tells."""
    choice, contacts = space["choice"], space["contacts"]
    count = len(scene.features)
    rows, turning, found = np.array(rows_of(space)), drifts(scene, space), chosen(space)
    share = choice["share"][:count]
    forces = np.ravel([[s["normal"], s["force"]] for s in share])
    push = rows.T @ forces + SPIN_ROW * choice["moment"]
    same_acceleration(found, free(scene) + push / MASSES)
    changes = rows @ found + turning
    slack, slow = 1e-8 * max(500.0, *abs(forces)), 1e-6
    load = 0.0
    for c in range(count):
        contact = contacts["at"][c]
        normal, force = share[c]["normal"], share[c]["force"]
        depth, bound = -contact["gap"], contact["friction"] * normal
        load += contact["rolling_arm"] * normal
        ends = (contact["opening"] * depth, contact["closing"] * depth)
        assert ends[0] - slack <= normal <= ends[1] + slack
        assert abs(force) <= bound + slack
        for speed, change, at_bound in (
            (contact["gap_rate"], changes[2 * c], (normal - ends[1], normal - ends[0])),
            (contact["slip"], changes[2 * c + 1], (force - bound, force + bound)),
        ):
            if speed < 0.0 or (speed == 0.0 and change < -slow):
                assert abs(at_bound[0]) <= slack
            if speed > 0.0 or (speed == 0.0 and change > slow):
                assert abs(at_bound[1]) <= slack
    moment, omega = choice["moment"], space["motion"]["omega"]
    assert abs(moment) <= load + slack
    if omega > 0.0 or (omega == 0.0 and found[2] > slow):
        assert abs(moment + load) <= slack
    if omega < 0.0 or (omega == 0.0 and found[2] < -slow):
        assert abs(moment - load) <= slack


# --- contacts at random ----------------------------------------------------------------------------------------------


def scenes(zeros: list[int], each: st.SearchStrategy[Spring] = springs, least: int = 1) -> st.SearchStrategy[Scene]:
    """Scenes of the block on the roof, with one to three contacts and some of the velocities zero."""
    return st.builds(
        lambda features, each, pose, angle, speed, zeros: Scene(
            ROOF,
            incline(angle),
            pose,
            speed,
            features,
            each[: len(features)],
            [zero for zero in zeros if zero < 2 * len(features)],
        ),
        st.lists(st.sampled_from(ANYWHERE), min_size=1, max_size=3, unique=True),
        st.tuples(each, each, each),
        poses,
        angles,
        speeds,
        st.lists(st.sampled_from(zeros), min_size=least, max_size=3, unique=True),
    )


RANDOM = {
    "slips and spin at zero": scenes([1, 3, -1]),
    "gaps at zero, without friction": scenes([0, 2], springs.map(lambda one: one._replace(friction=0.0, arm=0.0))),
    "anything at zero": scenes(
        [0, 1, 2, 3, -1], springs.map(lambda one: one._replace(friction=min(one.friction, 0.3), arm=0.3 * one.arm))
    ),
}


@pytest.mark.parametrize("kind", RANDOM)
@given(st.data())
def test_forces_obey_the_laws(kind: str, data: st.DataObject) -> None:
    """Oracle: the laws of physics.md, section 5, read off the forces; gap rates that are zero count among them."""
    scene = data.draw(RANDOM[kind])
    space = prepared(scene)
    choose(BLOCK, ROOF, scene.slope, space)
    assume(space["choice"]["zeros"] > 0)
    check_laws(scene, space)


# --- locks that depend on each other ---------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.0, 1e-13])
def test_what_depends_on_zeros_becomes_exactly_zero(noise: float) -> None:
    """Oracle: two gap rates of one normal are zero, so the spin is; a slip is then the same everywhere."""
    each = [Spring(1.2e-2, 3e4, 1e4, 0.3, 0.0)] * 2
    scene = Scene(PLANE, incline(0.2), (0.0, 0.3, 0.0), (2.0, 0.0, 0.0), FLAT, each, (0, 2))
    space = prepared(scene)
    space["motion"]["omega"] = noise
    choose(BLOCK, PLANE, scene.slope, space)
    assert space["motion"]["omega"] == 0.0
    assert space["contacts"]["at"][0]["slip"] == pytest.approx(2.0) == space["contacts"]["at"][1]["slip"]


# --- rest ------------------------------------------------------------------------------------------------------------


def margin(scene: Scene, space: Any) -> float:
    """By what part all forces could be smaller, or the bounds wider, for the sum of wrenches to hold the weight.

    A linear programme: loads between their bounds, friction and rolling within the loads times coefficients, both ``t``
    times as large as they are, and ``t`` as small as possible. The body rests if it is below 1.
    """
    contacts = space["contacts"]
    count = len(scene.features)
    rows, weight = np.array(rows_of(space)), MASSES * free(scene)
    # Unknowns: N and F of each contact, M, t.
    width = 2 * count + 2
    balance = np.zeros((3, width))
    balance[:, : 2 * count], balance[2, -2] = rows.T, 1.0
    above: list[np.ndarray] = []
    rolling = np.zeros(width)
    for c in range(count):
        contact = contacts["at"][c]
        middle = -0.5 * contact["gap"] * (contact["opening"] + contact["closing"])
        spread = -0.5 * contact["gap"] * (contact["closing"] - contact["opening"])
        rolling[2 * c] = contact["rolling_arm"]
        for sign in (-1.0, 1.0):
            load, slide = np.zeros(width + 1), np.zeros(width + 1)
            load[2 * c], load[-2], load[-1] = sign, -spread, sign * middle
            slide[2 * c], slide[2 * c + 1] = -contact["friction"], sign
            above += [load, slide]
    for sign in (-1.0, 1.0):
        turn = np.zeros(width + 1)
        turn[:width], turn[-3] = -rolling, sign
        above.append(turn)
    matrix = np.array(above)
    found = linprog(
        np.eye(width)[-1],
        A_ub=matrix[:, :-1],
        b_ub=matrix[:, -1],
        A_eq=balance,
        b_eq=-weight,
        bounds=[(None, None)] * (width - 1) + [(0.0, None)],
    )
    return float(found.fun) if found.status == 0 else math.inf


def rests_where_it_should(scene: Scene) -> None:
    space = prepared(scene)
    widest = margin(scene, space)
    assume(not 1.0 - 1e-6 < widest < 1.0 + 1e-6)
    if widest < 1.0:  # with a margin in friction and rolling too
        tight = prepared(scene)
        tight["contacts"]["at"]["friction"] *= 1.0 - 1e-6
        tight["contacts"]["at"]["rolling_arm"] *= 1.0 - 1e-6
        assume(margin(scene, tight) < 1.0)
    else:
        loose = prepared(scene)
        loose["contacts"]["at"]["friction"] *= 1.0 + 1e-6
        loose["contacts"]["at"]["rolling_arm"] *= 1.0 + 1e-6
        assume(margin(scene, loose) > 1.0)
    assert choose(BLOCK, scene.pieces, scene.slope, space) == (widest < 1.0)
    if widest < 1.0:
        check_laws(scene, space)
        same_acceleration(chosen(space), np.zeros(3))


holding = st.builds(
    Spring,
    st.floats(2e-3, 2e-2),
    st.floats(3e4, 6e4),
    st.floats(2e3, 2e4),
    st.one_of(st.just(0.0), st.floats(0.05, 1.0)),
    st.one_of(st.just(0.0), st.floats(0.01, 0.3)),
)
STILL = (0.0, 0.0, 0.0)
UNDER_A_SIDE: list[Features] = [*FLAT, (SIDE_BEND, 1, 2)]
LAID: dict[str, st.SearchStrategy[Scene]] = {
    "on one contact": st.builds(
        lambda phi, angle, one: Scene(
            PLANE, incline(angle), (0.0, 0.3, phi), STILL, [(ARC_PIECE, 1, 0)], [one], (0, 1, -1)
        ),
        st.floats(-1.5, -0.6),
        angles,
        holding,
    ),
    "flat": st.builds(  # all locks depend on each other
        lambda angle, each: Scene(PLANE, incline(angle), (0.0, 0.3, 0.0), STILL, FLAT, each, (0, 1, 2, 3, -1)),
        angles,
        st.tuples(holding, holding),
    ),
    "on several contacts": st.builds(
        lambda scene: scene._replace(velocity=STILL, zeros=[*range(2 * len(scene.features)), -1]), scenes([-1], holding)
    ),
    "with a crest under its side": st.builds(
        lambda angle, each, x: Scene(
            ROOF, incline(angle), (x, 0.8, 0.0), STILL, UNDER_A_SIDE, each, (0, 1, 2, 3, 4, 5, -1)
        ),
        angles,
        st.tuples(holding, holding, holding),
        st.floats(0.3, 0.7),
    ),
}


@pytest.mark.parametrize("laid", LAID)
@given(st.data())
def test_a_body_rests_if_a_wrench_balances_its_weight(laid: str, data: st.DataObject) -> None:
    """Oracle: a linear programme over the wrenches that all contacts offer, by scipy."""
    rests_where_it_should(data.draw(LAID[laid]))


def test_forces_at_their_bounds_hold_whatever_way_they_are_rounded() -> None:
    """Oracle: F = -m g sin(beta) at its bound f N, and the moment about the point of contact at its bound delta N."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        slope, phi = incline(rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.5)), rng.uniform(-1.5, -0.6)
        scene = Scene(PLANE, slope, (0.0, 0.3, phi), STILL, [(ARC_PIECE, 1, 0)], [Spring(1e-2, 8e4, 1e4)], (0, 1, -1))
        space = prepared(scene)
        contact, (gap, slip) = space["contacts"]["at"][0], rows_of(space)
        contact["friction"] = abs(slope.downhill) / slope.inward
        contact["rolling_arm"] = abs(gap[2] - slip[2] * slope.downhill / slope.inward)
        assert choose(BLOCK, PLANE, slope, space)
        contact["friction"] *= 0.999
        assert not choose(BLOCK, PLANE, slope, space)
