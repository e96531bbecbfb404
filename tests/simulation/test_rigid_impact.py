"""rigid_impact: published cases, the paper's body in the rigid limit, corners, phases, and what it refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sledenv import Body, ContactLaw, State, circular_segment, polygon, rigid_impact, segment
from sledenv.bodies import Segment
from sledenv.simulation import Mode
from sledenv.simulation.rigid_impact import Hypothesis, velocities_after
from tests.bodies import rod
from tests.oracles import rational_impact

PAPER_BODY = segment(1.0, 0.1, 0.05, 7.5e-3)
PAPER_LAW = ContactLaw(9810.0, 0.5, 0.1, 0.001)
PAPER_STATE = State(0.0, 0.07, math.pi / 4, 0.0, -10.0, 0.0)


def smooth(friction: float, rolling_arm: float = 0.0, corner_rolling_arm: float = 0.0) -> ContactLaw:
    """A law without hysteresis; the restitution is given to rigid_impact."""
    return ContactLaw(1.0, 0.0, friction, rolling_arm, corner_rolling_arm)


def kinetic(body: Segment, state: State) -> float:
    return 0.5 * body.mass * (state.u**2 + state.v**2) + 0.5 * body.inertia * state.omega**2


def random_entries(n: int, seed: int) -> list[tuple[Segment, ContactLaw, State, float]]:
    """Discs, segments and rods in every orientation, with the restitution."""
    rng = np.random.default_rng(seed)
    entries = []
    for k in range(n):
        mass, r = 10.0 ** rng.uniform(-1, 2), rng.uniform(0.1, 0.5)
        body = (
            segment(mass, r, r * rng.uniform(0.0, 0.95), mass * r * r * rng.uniform(0.1, 1.0)),
            circular_segment(mass, r, rng.uniform(0.5, 2.5)),
            rod(mass, r, mass * r * r / 3.0),
        )[k % 3]
        law = smooth(rng.uniform(0.0, 1.5), r * rng.uniform(0.0, 0.3), r * rng.uniform(0.0, 0.1))
        phi = rng.uniform(-10.0, 10.0)
        state = State(0.0, 1.0, phi, rng.normal(), -abs(3.0 * rng.normal()), 3.0 * rng.normal() / r)
        entries.append((body, law, state, rng.uniform(0.0, 1.0)))
    return entries


def contact_arms(body: Segment, phi: float) -> tuple[float, float]:
    """Arms of the lowest point, by docs/physics.md (1.2) and, for the corners, section 8."""
    h, r, alpha = body.eccentricity, body.radius, body.half_angle
    phi = math.remainder(phi, 2.0 * math.pi)
    if abs(phi) <= alpha:
        return h * math.sin(phi), r - h * math.cos(phi)
    edge = phi - math.copysign(alpha, phi)
    return h * math.sin(phi) - r * math.sin(edge), r * math.cos(edge) - h * math.cos(phi)


# --- known values ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("hypothesis", ["energetic", "poisson", "newton"])
def test_any_body_in_any_orientation_agrees_with_exact_fractions(hypothesis: Hypothesis) -> None:
    """Oracle: rational_impact with the arms of arc and corners computed here, each with its own rolling arm."""
    hit = 0
    for body, law, state, e in random_entries(90, seed=2):
        a, b = contact_arms(body, state.phi)
        cornered = abs(math.remainder(state.phi, 2.0 * math.pi)) > body.half_angle
        arm = law.corner_rolling_arm if cornered else law.rolling_arm
        slip, v_n = state.u + b * state.omega, state.v - a * state.omega
        found = rigid_impact(body, law, state, restitution=e, hypothesis=hypothesis)
        if v_n > 0.0:
            assert found.state == state
            assert found.phases == ()
            continue
        hit += 1
        given = body.mass, body.inertia, a, b, law.friction, arm, e, slip, state.omega, v_n
        known = rational_impact(*given, hypothesis=hypothesis)
        speed = max(abs(state.u), abs(state.v), abs(state.omega) * (body.radius + body.eccentricity))
        unit, energy = body.mass * speed, kinetic(body, state)
        assert found.state.omega == pytest.approx(known.omega, rel=1e-9, abs=1e-9)
        assert found.state.u == pytest.approx(known.slip - b * known.omega, abs=1e-9 * speed)
        assert found.state.v == pytest.approx(known.approach + a * known.omega, abs=1e-9 * speed)
        assert found.normal_impulse == pytest.approx(known.normal, abs=1e-9 * unit)
        assert found.tangential_impulse == pytest.approx(known.friction, abs=1e-9 * unit)
        assert found.rolling_impulse == pytest.approx(known.moment, abs=1e-9 * unit)
        losses = (found.loss_hysteresis, found.loss_sliding, found.loss_rolling)
        assert losses == pytest.approx((known.loss_normal, known.loss_sliding, known.loss_rolling), abs=1e-9 * energy)
    assert hit > 40


# --- what every impact obeys -----------------------------------------------------------------------------------------


def test_phases_follow_each_other_and_add_up() -> None:
    """Oracle: where each ends; some of these bodies reverse both slip and spin."""
    modes = set()
    for body, law, state, e in random_entries(300, seed=6):
        result, reached = rigid_impact(body, law, state, restitution=e), 0.0
        modes.add(result.mode)
        for phase in result.phases:
            assert phase.start == pytest.approx(reached, rel=1e-15, abs=0.0)
            assert phase.impulse > 0.0
            assert {phase.slip, phase.spin} <= {-1, 0, 1}
            reached = phase.start + phase.impulse
        assert result.normal_impulse == pytest.approx(reached, rel=1e-15, abs=0.0)
        assert [phase.restitution for phase in result.phases[:1] + result.phases[1:][-1:]] in ([], [False, True])
    assert Mode.DOUBLE_REVERSAL in modes


def test_the_restitution_is_that_of_the_law_unless_given() -> None:
    """Oracle: the same number given; a plastic impact has no phase of restitution."""
    law = ContactLaw.from_restitution(0.6, stiffness=1e6, friction=0.3, rolling_arm=0.01)
    same = rigid_impact(PAPER_BODY, law._replace(asymmetry=0.1), PAPER_STATE, restitution=law.restitution)
    assert rigid_impact(PAPER_BODY, law, PAPER_STATE) == same
    plastic = rigid_impact(PAPER_BODY, law, PAPER_STATE, restitution=0.0)
    assert not any(phase.restitution for phase in plastic.phases)


# --- refusals --------------------------------------------------------------------------------------------------------


BLOCK = polygon(20.0, [(0.0, 0.0), (0.6, 0.0), (0.6, 0.4), (0.0, 0.4)])
ROUNDED = polygon(20.0, [(0.0, 0.0), (0.6, 0.0), (0.6, 0.4), (0.0, 0.4)], rounding=0.02)


@pytest.mark.parametrize(
    ("body", "flat"), [(BLOCK, 0.0), (ROUNDED, -0.5 * math.pi), (circular_segment(2.0, 0.5, 1.0), math.pi)], ids=repr
)
@pytest.mark.parametrize("omega", [0.0, 1.0, -1.0])
def test_a_body_that_comes_down_flat_is_refused_and_one_that_is_turned_by_little_is_not(
    body: Body, flat: float, omega: float
) -> None:
    """Oracle: two points are as low as each other; turned by a thousandth one of them is hit."""
    with pytest.raises(ValueError, match=r"state.phi = .*: the body comes down on two points at once there"):
        rigid_impact(body, PAPER_LAW, State(0.0, 0.0, flat, 0.0, -1.0, omega))
    rises = State(0.0, 0.0, flat, 1.0, 1.0 + abs(omega), omega)
    assert rigid_impact(body, PAPER_LAW, rises).state == rises  # no point approaches
    for turn in (-1e-3, 1e-3):
        assert rigid_impact(body, PAPER_LAW, State(0.0, 0.0, flat + turn, 0.0, -1.0, omega)).phases


@pytest.mark.parametrize("hypothesis", ["energetic", "poisson", "newton"])
def test_many_impacts_told_by_their_arms_are_those_of_the_bodies(hypothesis: Hypothesis) -> None:
    """Oracle: rigid_impact of each; one that does not approach is left as it is."""
    for body, law, state, e in [*random_entries(60, 8), (PAPER_BODY, PAPER_LAW, PAPER_STATE._replace(v=3.0), 0.5)]:
        a, b = contact_arms(body, state.phi)
        arm = law.rolling_arm if abs(math.remainder(state.phi, math.tau)) <= body.half_angle else law.corner_rolling_arm
        contacts = np.array([[a, b, state.u, state.v, state.omega]])
        after = velocities_after(
            math.sqrt(body.inertia / body.mass), contacts, np.array([[e, law.friction, arm]]), hypothesis
        )
        expected = rigid_impact(body, law, state, restitution=e, hypothesis=hypothesis).state[3:]
        assert after[0] == pytest.approx(expected, rel=1e-9, abs=1e-11)
