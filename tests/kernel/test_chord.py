"""Both corners of a segment on the slope: closed forms, rocking, random descents, the mirror image."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any, Literal, NamedTuple

import numpy as np
import pytest

from sledenv.closed_forms import on_chord
from sledenv.closed_forms.painleve import painleve
from sledenv.kernel.records import Feature
from sledenv.simulation.bodies import Segment, segment
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Settings
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate, simulate_batch
from sledenv.simulation.support import support_height

Solver = Literal["compliant", "rigid"]
SOLVERS = pytest.mark.parametrize("solver", ["compliant", "rigid"])
GRAVITY = 9.81
SHELL, BOAT, BARREL = (circular_segment(100.0, 0.9, math.radians(degrees)) for degrees in (35.0, 80.0, 110.0))
BLOCK = circular_segment(10.0, 0.5, math.radians(150.0))  # H > L: it stands on its chord


def corners(body: Segment) -> tuple[float, float]:
    """H and L [m]."""
    return body.eccentricity - body.radius * math.cos(body.half_angle), body.radius * math.sin(body.half_angle)


def law_of(friction: float, *, restitution: float = 0.5, stiffness: float = 1e8, arm: float = 0.0) -> ContactLaw:
    return ContactLaw.from_restitution(
        restitution, stiffness=stiffness, friction=friction, rolling_arm=0.0, corner_rolling_arm=arm
    )


def laid(body: Segment, u: float = 0.0, x: float = 0.0) -> State:
    """The chord flat on the surface, without load."""
    return State(x, support_height(body, math.pi), math.pi, u)


# --- closed forms ----------------------------------------------------------------------------------------------------

SLIDES = {  # body, friction, inclination, speed
    "finishes": (SHELL, 0.1, 0.3, 1.0),
    "stops": (BOAT, 0.3, 0.1, 3.0),
    "starts from rest": (BARREL, 0.05, 0.2, 0.0),
    "stops uphill": (SHELL, 0.6, 0.1, -2.0),
    "turns back": (BOAT, 0.05, 0.2, -2.0),
    "without friction": (BARREL, 0.0, 0.1, -1.0),
    "much friction": (BOAT, 1.0, 0.2, 2.0),
}


def rows_on_chord(descent: Descent) -> np.ndarray:
    """Rows of the trajectory from where the body lies on its chord, one for each time; without the last."""
    rows = descent.trajectory[:-1]
    rows = rows[rows["t"] >= descent.outcome["t_on_chord"]]
    return rows[np.append(np.diff(rows["t"]) > 0.0, True)]


@SOLVERS
@pytest.mark.parametrize("arm", [0.0, 0.01])
@pytest.mark.parametrize("case", SLIDES)
def test_a_body_slides_on_its_chord_like_a_block(case: str, arm: float, solver: Solver) -> None:
    """Oracle: on_chord.chord_slide from where it lies, and chord_finish_time."""
    body, friction, beta, speed = SLIDES[case]
    law, slope = law_of(friction, arm=arm), Slope(beta, 20.0)
    descent = simulate(body, law, slope, laid(body, speed), solver=solver, record="trajectory", max_time=20.0)
    rows = rows_on_chord(descent)
    first = rows[0]
    assert first["t"] == descent.outcome["t_on_chord"] < 0.1
    assert first["x"] == descent.outcome["x_on_chord"]
    assert (rows["feature"] == Feature.CHORD).all()
    assert (np.abs(rows["v"]) <= 1e-13).all()  # to rounding: what is exactly zero are the rates of both ends
    assert (rows["omega"] == 0.0).all()
    assert (rows["phi"] == first["phi"]).all()
    moved, u = on_chord.chord_slide(law, slope, first["u"], rows["t"] - first["t"])
    assert rows["x"] - first["x"] == pytest.approx(moved, abs=2e-13 * slope.length)
    assert rows["u"] == pytest.approx(u, abs=2e-13 * max(np.abs(u).max(), 1.0))
    left = slope._replace(length=slope.length - float(first["x"]))
    finish = on_chord.chord_finish_time(law, left, float(first["u"]))
    assert descent.status == ("finish" if finish < math.inf else "jammed")
    if finish < math.inf:
        assert descent.time - first["t"] == pytest.approx(finish, rel=1e-13)
    else:
        stop = abs(first["u"]) / abs(GRAVITY * (friction * math.cos(beta) - math.copysign(math.sin(beta), speed)))
        assert descent.time - first["t"] == pytest.approx(stop, rel=1e-13)
        assert descent.state[3:] == (0.0, 0.0, 0.0)


@SOLVERS
@pytest.mark.parametrize("speed", [3.0, -3.0])
@pytest.mark.parametrize("body", [SHELL, BOAT, BARREL])
def test_the_corners_share_the_weight_as_the_moment_balance_says(body: Segment, speed: float, solver: Solver) -> None:
    """Oracle: on_chord.chord_loads, but for the depths of the springs; the corner ahead carries more."""
    law, slope = law_of(0.3, stiffness=1e10), Slope(0.1)
    expected = on_chord.chord_loads(body, law, slope, speed)
    descent = simulate(body, law, slope, laid(body, speed), solver=solver, record="trajectory", max_time=0.1)
    row = rows_on_chord(descent)[-1]
    assert row["touching"] == 2
    at = dict(zip(row["contacts"]["part"].tolist(), row["contacts"], strict=True))
    tail, nose = at[Feature.TAIL]["normal"], at[Feature.NOSE]["normal"]
    assert (tail, nose) == pytest.approx(expected, rel=1e-12 if solver == "rigid" else 1e-7)
    assert (tail > nose) == (speed > 0.0)
    for corner in (Feature.TAIL, Feature.NOSE):
        assert at[corner]["tangential"] == pytest.approx(-math.copysign(0.3, speed) * at[corner]["normal"])


@SOLVERS
def test_rolling_resistance_keeps_a_body_from_tipping(solver: Solver) -> None:
    """Oracle: tipping friction (L + delta) / H; with 0.9 L of rolling arm it slides flat at 1.8 L / H."""
    (height, half), slope = corners(BOAT), Slope(0.0)
    law = law_of(1.8 * half / height, arm=0.9 * half)
    assert on_chord.chord_tipping_friction(BOAT, law) == pytest.approx(1.9 * half / height)
    descent = simulate(BOAT, law, slope, laid(BOAT, 2.0), solver=solver, record="trajectory")
    assert descent.status == "jammed"
    if solver == "rigid":  # a compliant one hops first, as friction tips it until the corner behind has load again
        assert descent.time == pytest.approx(2.0 / (law.friction * GRAVITY), rel=1e-13)
        assert len(descent.rebounds) == 1


@SOLVERS
@pytest.mark.parametrize("speed", [2.0, -2.0])
@pytest.mark.parametrize("body", [BOAT, BARREL, SHELL])
def test_a_body_with_more_friction_tips_over_the_corner_ahead(body: Segment, speed: float, solver: Solver) -> None:
    """Oracle: J domega/dt of one sliding corner; the other one lifts as its load vanishes."""
    height, half = corners(body)
    law, side = law_of(1.1 * half / height, stiffness=1e10), math.copysign(1.0, speed)
    assert on_chord.chord_tipping_friction(body, law) == pytest.approx(half / height)
    assert min(on_chord.chord_loads(body, law, Slope(0.0), speed)) < 0.0
    descent = simulate(body, law, Slope(0.0), laid(body, speed), solver=solver, record="trajectory", max_rebounds=9)
    rows = descent.trajectory
    ahead = Feature.TAIL if speed > 0.0 else Feature.NOSE
    alone = rows[rows["feature"] == ahead]
    lever = half - law.friction * height  # negative
    normal = body.mass * GRAVITY / (1.0 + body.mass * half * lever / body.inertia)
    turning = side * lever * normal / body.inertia
    if solver == "rigid":
        assert alone[0]["t"] == 0.0
        assert alone[0]["normal"] == pytest.approx(normal, rel=1e-12)
        assert alone[1]["omega"] == pytest.approx(turning * alone[1]["t"], rel=1e-3)
    else:
        lifts = np.flatnonzero((rows["feature"][:-1] == Feature.CHORD) & (rows["feature"][1:] == ahead))[0]
        before, after = rows[lifts], rows[lifts + 1]
        assert before["t"] == after["t"] < 0.01
        behind = Feature.NOSE if speed > 0.0 else Feature.TAIL
        _, arm = feature_arms(body, behind, before["phi"])
        assert before["y"] - arm == pytest.approx(0.0, abs=1e-15)  # with the gap its load vanishes
        assert after["normal"] == pytest.approx(before["normal"], rel=1e-9)


def feature_arms(body: Segment, feature: Feature, phi: float) -> tuple[float, float]:
    """Arms a and b [m] of a corner."""
    height, half = corners(body)
    side = 1.0 if feature == Feature.TAIL else -1.0
    return (
        height * math.sin(phi) + side * half * math.cos(phi),
        -height * math.cos(phi) + side * half * math.sin(phi),
    )


@SOLVERS
@pytest.mark.parametrize("factor", [1.05, 3.0])
def test_a_body_in_the_painleve_region_is_thrown_over_at_once(factor: float, solver: Solver) -> None:
    """Oracle: there are no forces with which it slides flat, nor any with which it slides on the corner ahead."""
    height, half = corners(BOAT)
    law = law_of(factor * (BOAT.inertia / BOAT.mass + half**2) / (half * height), stiffness=1e10)
    assert painleve(BOAT, law, math.pi - 1e-9, 1.0, 0.0) < 0.0  # of the tail
    descent = simulate(BOAT, law, Slope(0.0), laid(BOAT, 2.0), solver=solver, max_time=2e-3)
    assert descent.state.u < 0.5  # of 2 m/s
    assert descent.state.v > 0.4


@SOLVERS
@pytest.mark.parametrize("limit", ["friction", "tipping"])
@pytest.mark.parametrize("body", [BARREL, BLOCK])
def test_it_rests_where_friction_holds_it_and_it_does_not_tip(body: Segment, limit: str, solver: Solver) -> None:
    """Oracle: on_chord.chord_rests, to both sides of its bound."""
    height, half = corners(body)
    tipping = on_chord.chord_tipping_friction(body, law_of(9.0))
    assert tipping == pytest.approx(half / height)
    law = law_of(0.5 * tipping if limit == "friction" else 2.0 * tipping, stiffness=1e10, restitution=0.2)
    for side in (1.0, -1.0):
        for factor in (0.999, 1.001):
            slope = Slope(side * math.atan(factor * min(law.friction, tipping)))
            assert on_chord.chord_rests(body, law, slope) == (factor < 1.0)
            descent = simulate(body, law, slope, laid(body), solver=solver, max_time=0.5)
            assert (descent.status == "jammed") == (factor < 1.0)
            if factor > 1.0 and limit == "friction":
                moved, _ = on_chord.chord_slide(law, slope, 0.0, 0.5)
                assert descent.state.x == pytest.approx(float(moved), rel=1e-9 if solver == "rigid" else 0.1)
            elif factor > 1.0:  # over the corner downhill
                assert side * (descent.state.phi - math.pi) < -1e-4


# --- rocking ---------------------------------------------------------------------------------------------------------


@SOLVERS
@pytest.mark.parametrize("half_angle", [140.0, 150.0])
def test_rocking_from_corner_to_corner_decays(half_angle: float, solver: Solver) -> None:
    """Oracle: of each touch a block that does not slide keeps the share (8.5) of its spin, Housner's."""
    body = circular_segment(10.0, 0.5, math.radians(half_angle))
    height, half = corners(body)
    law = ContactLaw(1e12, 1.0 - 1e-12 if solver == "rigid" else 1.0 - 1e-8, 5.0, 0.0)
    phi = math.pi - 0.6 * math.atan2(half, height)
    launch = State(0.0, support_height(body, phi), phi)
    descent = simulate(body, law, Slope(0.0), launch, solver=solver, record="trajectory", sample_interval=1e-4)
    assert descent.status == "jammed"
    assert abs(descent.state.phi) == pytest.approx(math.pi, abs=1e-8)
    rows = descent.trajectory
    flat = np.cos(rows["phi"]) < -1.0 + 1e-13
    energy = 0.5 * body.mass * (rows["u"] ** 2 + rows["v"] ** 2) + 0.5 * body.inertia * rows["omega"] ** 2
    energy += body.mass * GRAVITY * (rows["y"] - height)
    # Between touches the body turns about one corner or the other, and its energy is constant.
    side = np.sign(np.remainder(rows["phi"], 2.0 * math.pi) - math.pi)
    parts = np.split(energy, swings(side, flat))
    level = [float(np.median(part)) for part in parts if len(part) > 9]
    share = (body.inertia + body.mass * (height**2 - half**2)) / (body.inertia + body.mass * (height**2 + half**2))
    touches = 6 if solver == "rigid" else 3  # later ones are so slow that the springs move as much as the body
    ratios = np.array(level[1 : touches + 1]) / np.array(level[:touches])
    assert ratios == pytest.approx(np.full(touches, share**2), rel=1e-5 if solver == "rigid" else 2e-3)


def swings(side: np.ndarray, flat: np.ndarray) -> np.ndarray:
    """Rows at which the body tilts to the other side."""
    known = np.flatnonzero(~flat & (side != 0.0))
    return known[1:][side[known[1:]] != side[known[:-1]]]


# --- random descents -------------------------------------------------------------------------------------------------


class Lanes(NamedTuple):
    """Descents of one body: one a lane."""

    body: Segment
    laws: np.ndarray  # (N, 5) fields of ContactLaw
    slopes: np.ndarray  # (N, 3) fields of Slope
    launches: np.ndarray  # (N, 6) fields of State


def random_lanes(rng: np.random.Generator, lanes: int, *, near: bool) -> Lanes:
    """Launches of a random segment, with some exact zeros; all of them chord down if ``near``."""

    def some(values: np.ndarray, share: float) -> np.ndarray:
        return np.where(rng.random(lanes) < share, 0.0, values)

    body = circular_segment(100.0, rng.uniform(0.2, 1.0), math.radians(rng.uniform(15.0, 165.0)))
    restitution = np.where(rng.random(lanes) < 0.9, rng.uniform(1e-3, 1.0, lanes), 1.0)
    laws = np.stack(
        [
            10.0 ** rng.uniform(6.0, 9.0, lanes),
            (1.0 - restitution**2) / (1.0 + restitution**2),
            some(rng.uniform(0.0, 0.8, lanes), 0.2),
            rng.uniform(0.0, 0.02, lanes),
            some(rng.uniform(0.0, 0.02, lanes), 0.5),
        ],
        axis=1,
    )
    slopes = np.stack([some(rng.uniform(0.0, 0.5, lanes), 0.1), np.full(lanes, 20.0), np.full(lanes, GRAVITY)], axis=1)
    phi = rng.uniform(-math.pi, math.pi, lanes)
    if near:
        phi = rng.choice([-1.0, 1.0], lanes) * (math.pi - some(rng.uniform(0.0, 0.5, lanes), 0.1))
    lowest = np.array([support_height(body, angle) for angle in phi.tolist()])
    launches = np.stack(
        [
            np.zeros(lanes),
            lowest + some(rng.uniform(0.0, 0.5, lanes), 0.1),
            phi,
            some(rng.uniform(-3.0, 6.0, lanes), 0.1),
            some(rng.uniform(-4.0, 0.0, lanes), 0.1),
            some(rng.uniform(-6.0, 6.0, lanes), 0.25),
        ],
        axis=1,
    )
    return Lanes(body, laws, slopes, launches)


OPTIONS: dict[str, Any] = {"max_time": 20.0, "max_rebounds": 2000}
# Bodies (mass, radius, eccentricity, inertia, half angle), laws, angles of the slope and launches.
ROCKS_LONG = {
    "slips": (
        (100.0, 0.7416066622436126, 0.5721199499957434, 7.799143499963918, 0.9092834320202128),
        (5691230.939136697, 0.0, 0.48322952491815796, 0.0022600976633841354, 0.011110365077925293),
        0.334020861978919,
        (0.0, 0.7580883902977837, 1.6950071937026898, 0.0, -0.34075385136268066, 4.80985601400025),
    ),
    "creeps": (
        (100.0, 0.3028561622153597, 0.12884560538384562, 2.92966237044078, 1.5689057750840498),
        (91213591.47879024, 0.0, 0.44655588748052005, 0.016793291856932735, 0.0),
        0.2589822506485702,
        (0.0, 0.16075181987225748, -3.0751084525893035, 3.3171535389189337, -3.3201096408527433, 0.0),
    ),
    "is held": (
        (100.0, 0.32762381594258794, 0.2477029358175629, 1.616764660002259, 0.9423154716310047),
        (14227096.042686993, 0.0, 0.7091059103414326, 0.005780032333429115, 0.0),
        0.22524216315387768,
        (0.0, 0.23548345887725744, -0.6792573628839667, 1.031136527007038, -2.6026219705300795, 0.0),
    ),
}


@pytest.mark.jit_only
@pytest.mark.parametrize("case", ROCKS_LONG)
def test_ten_seconds_on_both_ends_of_the_chord_create_no_energy(case: str) -> None:
    """Oracle: conservation of energy. Ends that stick at different depths take turns, thousands of times undamped.

    The errors of a turn added up to 5e-9, and to 1e-9 if only those of the spin were taken off. Forces that hold the
    spin are far larger than what they differ by: rounded, they let it go at once, without end.
    """
    made, law, angle, launch = ROCKS_LONG[case]
    body = segment(*made[:4], half_angle=made[4])
    descent = simulate(body, ContactLaw(*law), Slope(angle, 20.0, GRAVITY), State(*launch), **OPTIONS)
    assert descent.status == "timeout"
    energy = descent.energy
    lost = energy.hysteresis + energy.sliding + energy.rolling
    assert abs(energy.residual) < 1e-11 * (energy.initial + abs(energy.potential) + lost)


@pytest.mark.jit_only
@pytest.mark.parametrize(("bodies", "lanes"), [(6, 60), pytest.param(200, 500, marks=pytest.mark.slow)])
@SOLVERS
def test_random_descents_end_and_create_no_energy(solver: Solver, bodies: int, lanes: int) -> None:
    """Oracle: conservation of energy. Of 100,000 one may exhaust its steps; no other failure is known.

    Some bodies with a flat arc are pressed so deep into the softest slopes that both its ends are in them.
    """
    rng, endings = np.random.default_rng(11), Counter[str]()
    for number in range(bodies):
        body, laws, slopes, launches = random_lanes(rng, lanes, near=number % 2 == 0)
        batch = simulate_batch(body, laws, slopes, launches, Settings(solver=solver, **OPTIONS))
        ends = batch.outcomes
        endings.update(batch.status.tolist())
        lost = ends["hysteresis"] + ends["sliding"] + ends["rolling"]
        residual = ends["kinetic"] + ends["potential"] + ends["stored"] + lost - ends["initial"]
        # A chord that is nearly flat is laid flat at a touch: the height is right to 1e-12 of the size.
        error = np.abs(residual) / (np.abs(ends["initial"]) + np.abs(ends["potential"]) + lost)
        assert error.max() < 1e-10, (number, int(error.argmax()))
        for loss in ("hysteresis", "sliding", "rolling"):
            assert (ends[loss] >= 0.0).all(), number
    assert endings["step_budget"] <= 1e-5 * bodies * lanes
    assert endings["buried"] <= (1e-4 * bodies * lanes if solver == "compliant" else 0)
    assert set(endings) <= {"finish", "jammed", "timeout", "log_full", "step_budget", "buried"}
    assert min(endings["finish"], endings["jammed"]) > 0.1 * bodies * lanes


@pytest.mark.jit_only
@SOLVERS
def test_the_mirror_image_descends_as_the_mirror_image_bit_for_bit(solver: Solver) -> None:
    """Oracle: mirror symmetry of body, slope and launch: x, phi, u and omega change sign."""
    rng = np.random.default_rng(22)
    mirror = np.array([-1.0, 1.0, -1.0, -1.0, 1.0, -1.0])
    touched = 0
    for _ in range(8):
        body, laws, slopes, launches = random_lanes(rng, 50, near=True)
        slopes[:, 1] = math.inf
        image = slopes * [-1.0, 1.0, 1.0]
        one, other = (
            simulate_batch(
                body, laws, at, of, Settings(solver=solver, max_time=6.0, max_rebounds=200), keep_rebounds=True
            )
            for at, of in ((slopes, launches), (image, launches * mirror))
        )
        assert np.array_equal(one.outcomes["status"], other.outcomes["status"])
        assert np.array_equal(one.states, other.states * mirror)
        for name in ("t", "t_on_chord", "steps", "rebounds", "hysteresis", "sliding", "rolling", "stored"):
            assert np.array_equal(one.outcomes[name], other.outcomes[name]), name
        swapped = np.array([Feature.NONE, Feature.ARC, Feature.TAIL, Feature.NOSE, Feature.CHORD])
        assert np.array_equal(swapped[one.rebounds["feature"]], other.rebounds["feature"])
        touched += np.count_nonzero((one.rebounds["feature"] == Feature.CHORD).any(axis=1))
    assert touched > 200
