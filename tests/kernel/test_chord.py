"""Both corners of a segment on the slope: closed forms of sliding, tipping and rest."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest

from sledenv.closed_forms import on_chord
from sledenv.closed_forms.painleve import painleve
from sledenv.kernel.records import Feature
from sledenv.simulation.bodies import Segment
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height
from tests.bodies import arms

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
        behind = next(arc for arc in body.arcs if arc.part == ("nose" if speed > 0.0 else "tail"))
        assert before["y"] - arms(behind, before["phi"])[1] == pytest.approx(
            0.0, abs=1e-15
        )  # with the gap its load vanishes
        assert after["normal"] == pytest.approx(before["normal"], rel=1e-9)


@SOLVERS
@pytest.mark.parametrize("factor", [1.05, 3.0])
def test_a_body_in_the_painleve_region_falls_over_at_once(factor: float, solver: Solver) -> None:
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
