"""Jam theory against brute force and against the simulator: rest on the slope, Painlevé region, stuck wheel."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest

from sledenv.closed_forms.theory import (
    chord_finish_time,
    chord_loads,
    chord_rests,
    chord_slide,
    chord_tipping_friction,
    painleve,
    painleve_threshold,
    static_jam,
    static_jam_angles,
    steepest_jam,
    wheel_stuck_ratio,
)
from sledenv.closed_forms.wheel import collide_wheel
from sledenv.kernel.records import ARC, NOSE, TAIL, Mode
from sledenv.simulation.bodies import Body, circular_segment
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.rigid_impact import rigid_impact
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import arms, feature_at, support_height
from tests.bodies import rod

DISC = Body(1.0, 0.1, 0.05, 7.5e-3)
SLED = circular_segment(100.0, 0.5, math.radians(110.0))
SHELL = circular_segment(10.0, 0.5, math.radians(50.0))
ROD = rod(1.0, 1.0, 1.0 / 3.0)
WHEEL = Body(1.0, 0.1, 0.0, 0.005)
BODIES = {"disc": DISC, "sled": SLED, "shell": SHELL, "rod": ROD, "wheel": WHEEL}
RIGID_EPS, SETTLING_EPS = 1e-9, 1e-6

# body, law, slope: every feature, both signs of the slope
RESTS = {
    "disc": (DISC, ContactLaw(1e12, 0.5, 0.3, 0.003), Slope(0.1)),
    "sled": (SLED, ContactLaw(1e13, 0.5, 0.5, 0.02, 0.03), Slope(0.05)),
    "shell": (SHELL, ContactLaw(1e12, 0.5, 0.5, 0.02, 0.05), Slope(-0.05)),
    "rod": (ROD, ContactLaw(1e11, 0.5, 0.3, 0.02, 0.02), Slope(-0.05)),
    "level": (SLED, ContactLaw(1e12, 0.5, 0.5, 0.02, 0.03), Slope(0.0)),
}


def random_cases(count: int, seed: int = 3) -> list[tuple[Body, ContactLaw, Slope]]:
    rng = np.random.default_rng(seed)
    cases = []
    for body in rng.choice(list(BODIES), count):
        law = ContactLaw(
            1e6, 0.5, rng.uniform(0.0, 1.0), rng.uniform(0.0, 0.05), rng.choice([0.0, rng.uniform(0, 0.3)])
        )
        cases.append((BODIES[body], law, Slope(rng.uniform(-0.6, 0.6))))
    return cases


def rests(body: Body, law: ContactLaw, slope: Slope, phi: float) -> bool:
    """Force balance of one pose, point by point: N and F carry the weight, the rest of the moment is rolling."""
    weight = body.mass * slope.gravity
    normal, force = weight * math.cos(slope.angle), -weight * math.sin(slope.angle)
    local = math.remainder(phi, 2.0 * math.pi)
    feature = feature_at(body, local)
    a, b = arms(body, feature, local)
    moment = np.cross((-a, -b, 0.0), (force, normal, 0.0))[2]
    arm = law.rolling_arm if feature == ARC else law.corner_rolling_arm
    return bool(abs(force) <= law.friction * normal and abs(moment) <= arm * normal)


def laid(
    body: Body, law: ContactLaw, slope: Slope, phi: float, solver: Literal["compliant", "rigid"] = "rigid"
) -> Descent:
    """Lay the body on the slope at rest and let go."""
    return simulate(body, law, slope, State(0.0, support_height(body, phi), phi), solver=solver, max_time=2.0)


def test_a_pose_rests_where_the_forces_balance() -> None:
    """Oracle: forces and moment of each pose, one at a time."""
    for body, law, slope in random_cases(40):
        phi = np.linspace(-7.0, 7.0, 301)
        assert static_jam(body, law, slope, phi).tolist() == [rests(body, law, slope, angle) for angle in phi.tolist()]


def test_the_angles_of_rest_are_those_of_the_condition() -> None:
    """Oracle: static_jam on a grid, and 1e-9 rad to both sides of every bound."""
    bounds = 0
    for body, law, slope in random_cases(200):
        intervals = static_jam_angles(body, law, slope)
        phi = np.linspace(-math.pi, math.pi, 2000)[1:-1]
        inside = np.zeros(phi.shape, dtype=bool)
        for low, high in intervals:
            assert -math.pi <= low <= high <= math.pi
            inside |= (phi >= low) & (phi <= high)
            for edge, inwards in ((low, RIGID_EPS), (high, -RIGID_EPS)):
                if high - low > 4.0 * RIGID_EPS and abs(edge) < math.pi:
                    assert static_jam(body, law, slope, edge + inwards)
                    assert not static_jam(body, law, slope, edge - inwards)
                    bounds += 1
        assert np.array_equal(inside, static_jam(body, law, slope, phi))
    assert bounds > 150


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_rest_is_mirror_symmetric(body: Body) -> None:
    """Oracle: the mirrored pose on the mirrored slope."""
    law, slope, mirror = ContactLaw(1e6, 0.5, 0.4, 0.004, 0.02), Slope(0.13), Slope(-0.13)
    phi = np.linspace(-3.1, 3.1, 997)
    assert np.array_equal(static_jam(body, law, slope, phi), static_jam(body, law, mirror, -phi))
    there = np.array(static_jam_angles(body, law, slope)).ravel()
    back = -np.array(static_jam_angles(body, law, mirror)).ravel()[::-1]
    assert there == pytest.approx(back, abs=1e-14)
    assert painleve(body, law, phi, 1.0, -1.0) == pytest.approx(painleve(body, law, -phi, -1.0, 1.0))


def test_without_rolling_resistance_a_body_only_balances() -> None:
    """Oracle: the vertical through the mass centre meets the contact point, h sin(phi - beta) = -r sin(beta)."""
    law, slope = ContactLaw(1e6, 0.5, 0.5, 0.0), Slope(0.1)
    tilt = math.asin(2.0 * math.sin(0.1))
    points = static_jam_angles(DISC, law, slope)
    assert [low for low, _ in points] == [high for _, high in points]
    assert [low for low, _ in points] == pytest.approx([0.1 + tilt - math.pi, 0.1 - tilt])


def test_a_wheel_rests_everywhere_or_nowhere() -> None:
    """Oracle: r tan(beta) <= delta, whatever the orientation."""
    law = ContactLaw(1e6, 0.5, 0.5, 0.01)
    limit = math.atan(0.1)
    assert static_jam_angles(WHEEL, law, Slope(limit - 1e-9)) == [(-math.pi, math.pi)]
    assert static_jam_angles(WHEEL, law, Slope(limit + 1e-9)) == []
    assert steepest_jam(WHEEL, law, [-1.0, 0.0, 3.0]) == pytest.approx(limit)
    assert steepest_jam(WHEEL, law._replace(friction=0.05), 1.0) == pytest.approx(math.atan(0.05))


def test_the_steepest_slope_is_where_rest_ends() -> None:
    """Oracle: static_jam 1e-9 rad to both sides; the mirrored pose gives the other end."""
    phi = np.linspace(-3.0, 3.0, 73)
    for body, law, _ in random_cases(20):
        highest, lowest = steepest_jam(body, law, phi), -steepest_jam(body, law, -phi)
        assert np.array_equal(np.isnan(highest), np.isnan(lowest))
        for angle, high, low in zip(phi, highest, lowest, strict=True):
            if math.isnan(high):
                assert not any(static_jam(body, law, Slope(beta), angle) for beta in np.linspace(-0.8, 0.8, 33))
                continue
            for edge, outwards in ((high, RIGID_EPS), (low, -RIGID_EPS)):
                assert high - low < 3e-9 or static_jam(body, law, Slope(edge - outwards), angle)
                assert not static_jam(body, law, Slope(edge + outwards), angle)


@pytest.mark.parametrize("name", RESTS)
@pytest.mark.parametrize("solver", ["rigid", "compliant"])
def test_a_body_laid_on_the_slope_jams_inside_and_moves_outside(
    name: str, solver: Literal["rigid", "compliant"]
) -> None:
    """Oracle: the simulator, 1e-9 rad to both sides of every bound.

    On an incline a compliant contact is given 1e-6 rad: laid down unloaded, it has to settle first, and the kick that
    it gets from that dies out with the root of the stiffness.
    """
    body, law, slope = RESTS[name]
    eps = RIGID_EPS if solver == "rigid" or slope.angle == 0.0 else SETTLING_EPS
    intervals = static_jam_angles(body, law, slope)
    assert len(intervals) >= 2
    for low, high in intervals:
        for edge, inwards in ((low, eps), (high, -eps)):
            inside, outside = (laid(body, law, slope, edge + side, solver) for side in (inwards, -inwards))
            assert inside.status == "jammed"
            assert inside.state.phi == pytest.approx(edge + inwards, abs=0.5 * eps)
            assert abs(outside.state.phi - (edge - inwards)) > 0.5 * eps
            if solver == "rigid":
                assert inside.time == 0.0
                assert inside.state == inside.launch
                assert outside.time > 0.0


@pytest.mark.parametrize("slip", [-1.0, 0.0, 1.0])
def test_the_loads_of_the_corners_balance_weight_and_friction(slip: float) -> None:
    """Oracle: sums of forces and of moments about the mass centre, from the places of the two corners."""
    for body in (SLED, SHELL):
        law, slope = ContactLaw(1e6, 0.5, 0.3, 0.01), Slope(-0.2)
        force = -body.mass * 9.81 * (math.sin(slope.angle) if slip == 0.0 else slip * 0.3 * math.cos(slope.angle))
        loads = chord_loads(body, law, slope, 5.0 * slip)
        moment = 0.0
        for normal, feature, phi in zip(loads, (TAIL, NOSE), (math.pi, -math.pi), strict=True):
            a, b = arms(body, feature, phi)
            moment += np.cross((-a, -b, 0.0), (0.5 * force, float(normal), 0.0))[2]
        assert sum(loads) == pytest.approx(body.mass * 9.81 * math.cos(slope.angle))
        assert moment == pytest.approx(0.0, abs=1e-12 * body.mass)


def test_a_body_tips_off_its_chord_where_a_corner_has_no_load_left() -> None:
    """Oracle: chord_loads, to both sides; rolling resistance of the corners shifts them."""
    law, slope = ContactLaw(1e6, 0.5, 9.0, 0.0, 0.0), Slope(0.0)
    for body in (SLED, SHELL):
        for factor in (1.0 - 1e-9, 1.0 + 1e-9):
            friction = factor * chord_tipping_friction(body, law)
            assert (min(chord_loads(body, law._replace(friction=friction), slope, 1.0)) > 0.0) == (factor < 1.0)
            assert chord_rests(body, law, Slope(math.atan(friction))) == (factor < 1.0)
        wide = chord_tipping_friction(body, law._replace(corner_rolling_arm=0.1))
        across = body.radius * math.sin(body.half_angle)
        assert wide == pytest.approx(chord_tipping_friction(body, law) * (across + 0.1) / across)
        assert not chord_rests(body, law._replace(friction=math.tan(0.1)), Slope(0.1 + 1e-9))
    inside = Body(1.0, 0.5, 0.5 * math.cos(1.0), 0.02, 1.0)  # the mass centre lies in the chord
    assert chord_tipping_friction(inside, law) == math.inf


@pytest.mark.parametrize("friction", [0.0, 0.05, 0.4])
@pytest.mark.parametrize("angle", [-0.1, 0.0, 0.2])
@pytest.mark.parametrize("speed", [-2.0, 0.0, 3.0])
def test_a_block_slides_as_its_forces_say(friction: float, angle: float, speed: float) -> None:
    """Oracle: 100,000 steps of Euler's method with the friction of each instant."""
    law, slope = ContactLaw(1e6, 0.5, friction, 0.0), Slope(angle, 5.0)
    time, steps = 4.0, 100_000
    downhill, bound = 9.81 * math.sin(angle), friction * 9.81 * math.cos(angle) * time / steps
    x, u, finish = 0.0, speed, math.inf
    for i in range(steps):
        u += downhill * time / steps
        u = math.copysign(max(abs(u) - bound, 0.0), u)
        x += u * time / steps
        if x >= slope.length and finish == math.inf:
            finish = (i + 1) * time / steps
    assert [float(value) for value in chord_slide(law, slope, speed, time)] == pytest.approx([x, u], abs=2e-3)
    if min(finish, chord_finish_time(law, slope, speed)) < 0.99 * time:
        assert chord_finish_time(law, slope, speed) == pytest.approx(finish, abs=1e-3)


def test_a_block_that_never_gets_there_takes_for_ever() -> None:
    law = ContactLaw(1e6, 0.5, 0.3, 0.0)
    assert chord_finish_time(law, Slope(0.1, 10.0), 1.0) == math.inf
    assert chord_finish_time(law, Slope(0.1, 10.0), 0.0) == math.inf
    assert chord_finish_time(law, Slope(0.4), 1.0) == math.inf
    assert chord_finish_time(law._replace(friction=0.0), Slope(0.0, 10.0), -1.0) == math.inf


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
@pytest.mark.parametrize("arm", [0.0, 0.01, 0.4])
def test_the_painleve_threshold_is_where_the_region_appears(body: Body, arm: float) -> None:
    """Oracle: the sign of the expression on a fine grid of orientations, over all signs of slip and spin."""
    law = ContactLaw(1e6, 0.5, 0.0, arm, 0.5 * arm)
    threshold = painleve_threshold(body, law)
    phi = np.linspace(-math.pi, math.pi, 200_001)

    def region(friction: float) -> bool:
        tried = law._replace(friction=friction)
        return any((painleve(body, tried, phi, s, w) < 0.0).any() for s in (-1, 1) for w in (-1, 1))

    if threshold == math.inf:
        assert not region(1e9)
    else:
        assert region(threshold * (1.0 + 1e-8) + 1e-8)
        assert threshold == 0.0 or not region(threshold * (1.0 - 1e-12))


@pytest.mark.parametrize("inertia", [0.01, 1.0 / 3.0, 2.0])
def test_the_painleve_threshold_of_a_rod_is_the_textbook_one(inertia: float) -> None:
    """Oracle: 2 k sqrt(k^2 + h^2) / h^2 with k^2 = J/m; 4/3 for the uniform rod of the literature."""
    k_squared = inertia / 2.0
    expected = 2.0 * math.sqrt(k_squared * (k_squared + 0.49)) / 0.49
    body = rod(2.0, 0.7, inertia)
    assert painleve_threshold(body, ContactLaw(1e6, 0.5, 0.3, 0.0)) == pytest.approx(expected, rel=1e-13)
    assert painleve_threshold(ROD, ContactLaw(1e6, 0.5, 0.3, 0.0)) == pytest.approx(4.0 / 3.0, rel=1e-13)


def test_the_stuck_ratio_is_where_a_wheel_gets_stuck() -> None:
    """Oracle: the closed form of Table 1 and the exact impact in normal impulse, 1e-9 to both sides."""
    rng = np.random.default_rng(7)
    for _ in range(50):
        e, f, arm, fall = rng.uniform(0.0, 1.0), rng.uniform(0.01, 1.0), rng.uniform(1e-4, 0.1), rng.uniform(0.1, 5.0)
        ratio = float(wheel_stuck_ratio(e, f, arm, WHEEL.radius))
        for factor, stuck in ((1.0 - 1e-9, True), (1.0 + 1e-9, False)):
            u = factor * ratio * fall
            wheel = collide_wheel(WHEEL.mass, WHEEL.inertia, WHEEL.radius, f, arm, e, u, -fall)
            assert (wheel.scenario == "stuck") is stuck
            impact = rigid_impact(WHEEL, ContactLaw(1e6, 0.0, f, arm), State(0.0, 0.1, 0.0, u, -fall), restitution=e)
            assert (impact.mode == Mode.STUCK) is stuck


def test_theory_is_vectorised() -> None:
    law = ContactLaw(1e6, 0.5, 0.4, 0.004, 0.02)
    phi = np.linspace(-3.0, 3.0, 6).reshape(2, 3)
    assert static_jam(SLED, law, Slope(0.1), phi).shape == (2, 3)
    assert steepest_jam(SLED, law, phi).shape == (2, 3)
    assert painleve(SLED, law, phi, np.ones((4, 1, 1)), -1.0).shape == (4, 2, 3)
    assert wheel_stuck_ratio([0.0, 1.0], 0.1, 0.02, 0.1) == pytest.approx([0.1, 0.2])
    assert chord_loads(SLED, law, Slope(0.1), phi)[0].shape == (2, 3)
    assert chord_slide(law, Slope(0.1), phi, np.ones((4, 1, 1)))[1].shape == (4, 2, 3)


def test_wrong_arguments_are_named() -> None:
    law = ContactLaw(1e6, 0.5, 0.4, 0.004)
    with pytest.raises(ValueError, match="static_jam: phi = nan: must be finite"):
        static_jam(DISC, law, Slope(0.1), [0.0, math.nan])
    with pytest.raises(TypeError, match="phi = 'upright': must be numbers"):
        static_jam(DISC, law, Slope(0.1), "upright")
    with pytest.raises(ValueError, match="gravity = 0"):
        static_jam_angles(DISC, law, Slope(0.1, 1.0, 0.0))
    with pytest.raises(ValueError, match=r"restitution = 1\.5: must be in \[0, 1\]"):
        wheel_stuck_ratio(1.5, 0.1, 0.01, 0.1)
    with pytest.raises(ValueError, match=r"radius = 0\.0"):
        wheel_stuck_ratio(0.5, 0.1, 0.01, [0.1, 0.0])
    with pytest.raises(ValueError, match="slip = nan"):
        painleve(DISC, law, 0.0, math.nan, 1.0)
    with pytest.raises(ValueError, match="no chord to lie on"):
        chord_rests(DISC, law, Slope(0.1))
    with pytest.raises(ValueError, match=r"time = -1\.0: must be in \[0, inf\) s"):
        chord_slide(law, Slope(0.1), 1.0, -1.0)
    with pytest.raises(ValueError, match="gravity = 0"):
        chord_finish_time(law, Slope(0.1, 1.0, 0.0), 1.0)
