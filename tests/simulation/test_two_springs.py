"""The oracle for the contact of both corners: closed forms, the ledger, the mirror image, laws made smooth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sledenv.simulation.bodies import Segment
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.shapes import circular_segment
from tests.two_springs import BOTH, SPIN, TILT, Chord, Contact, U, V, follow, random_contacts

HALF_DISC = circular_segment(80.0, 0.5, math.radians(90.0))


def law_of(restitution: float, *, stiffness: float = 1e8, friction: float = 0.0, arm: float = 0.0) -> ContactLaw:
    return ContactLaw.from_restitution(
        restitution, stiffness=stiffness, friction=friction, rolling_arm=0.0, corner_rolling_arm=arm
    )


def kinetic(body: Segment, state: State) -> float:
    """Kinetic energy [J]."""
    return 0.5 * body.mass * (state.u**2 + state.v**2) + 0.5 * body.inertia * state.omega**2


def lying(body: Segment, law: ContactLaw, slope: Slope, u: float) -> State:
    """The chord flat and at rest in the normal direction, at the penetration at which the mean stiffness carries."""
    penetration = body.mass * slope.gravity * math.cos(slope.angle) / (2.0 * law.stiffness)
    return State(0.0, Chord(body, law, slope).depth - penetration, math.pi, u)


@pytest.mark.parametrize("restitution", [0.1, 0.7, 1.0])
@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_a_flat_landing_without_friction_is_one_spring(restitution: float, gravity: float) -> None:
    law, slope, speed = law_of(restitution), Slope(0.0, gravity=gravity), 2.0
    result = follow(HALF_DISC, law, slope, State(0.0, Chord(HALF_DISC, law, slope).depth, math.pi, 1.0, -speed))
    weight, stiffness = HALF_DISC.mass * gravity, 2.0 * law.stiffness * (1.0 + law.asymmetry)
    deepest = (weight + math.sqrt(weight**2 + stiffness * HALF_DISC.mass * speed**2)) / stiffness
    rebound = math.sqrt(restitution**2 * speed**2 - 2.0 * gravity * deepest * (1.0 - restitution**2))  # physics (5.11)
    assert result.end == "separated"
    assert result.state.v == pytest.approx(rebound, rel=1e-11)
    assert (result.state.u, result.state.omega, result.state.phi) == (1.0, 0.0, math.pi)


def test_random_contacts_keep_the_ledger_and_end_in_every_way() -> None:
    results = []
    for contact in random_contacts(60, seed=12):
        result = follow(*contact)
        gained = contact.body.mass * contact.slope.gravity * math.sin(contact.slope.angle) * abs(result.state.x)
        assert abs(result.residual) <= 1e-11 * (kinetic(contact.body, contact.state) + gained), contact
        assert min(result.hysteresis, result.sliding, result.rolling) >= 0.0
        assert result.doubt == 0.0  # every branch was entered in agreement with all laws
        results.append(result)
    assert {"separated", "rest", "max_time"} <= {result.end for result in results}
    assert sum(result.both for result in results) > 15
    assert any(result.lies for result in results)


@pytest.mark.slow
def test_the_mirror_image_is_the_same_contact() -> None:
    for contact in random_contacts(40, seed=13):
        x, y, phi, u, v, omega = contact.state
        slope = Slope(-contact.slope.angle)
        result, image = follow(*contact), follow(contact.body, contact.law, slope, State(-x, y, -phi, -u, v, -omega))
        ours, theirs = np.array(result.state), np.array(image.state) * [-1.0, 1.0, -1.0, -1.0, 1.0, -1.0]
        assert (image.end, image.both) == (result.end, result.both)
        assert image.time == pytest.approx(result.time, rel=1e-11)
        np.testing.assert_allclose(theirs, ours, rtol=1e-11, atol=1e-11 * max(1.0, abs(u), abs(v)))


@pytest.mark.parametrize("arm", [0.0, 0.01])
@pytest.mark.parametrize(("factor", "end"), [(1.0 + 1e-6, "rest"), (1.0 - 1e-6, "max_time")])
def test_a_chord_rests_where_friction_holds_it(arm: float, factor: float, end: str) -> None:
    slope = Slope(0.2)
    law = law_of(0.3, friction=factor * math.tan(slope.angle), arm=arm)
    result = follow(HALF_DISC, law, slope, lying(HALF_DISC, law, slope, 0.0), max_time=0.5)
    assert result.end == end
    if end == "max_time":
        pull = slope.gravity * (math.sin(slope.angle) - law.friction * math.cos(slope.angle))
        assert result.state.u == pytest.approx(0.5 * pull, rel=1e-6)


def smoothed(contact: Contact, duration: float, share: float) -> np.ndarray:
    """u, v, omega after ``duration`` where every jump is spread over velocities of ``share`` of the entry speed."""
    chord, (x, y, phi, u, v, omega) = Chord(*contact[:3]), contact.state
    wide = share * max(abs(u), abs(v), chord.size * abs(omega))
    stiffness, asymmetry, friction = contact.law.stiffness, contact.law.asymmetry, contact.law.friction

    def sign(velocity: float) -> float:
        return velocity / math.hypot(velocity, wide)

    def rates(_: float, q: np.ndarray) -> list[float]:
        (a, b), penetrations, spin = chord.arms(q[TILT]), chord.penetrations(q), q[SPIN]
        normal = [stiffness * (1.0 - asymmetry * sign(q[V] - a[i] * spin)) * max(0.0, penetrations[i]) for i in BOTH]
        pull = [-friction * normal[i] * sign(q[U] + b[i] * spin) for i in BOTH]
        moment = -contact.law.corner_rolling_arm * sum(normal) * sign(chord.size * spin)
        moment += sum(b[i] * pull[i] - a[i] * normal[i] for i in BOTH)
        accelerations = [chord.along + sum(pull) / chord.mass, sum(normal) / chord.mass - chord.into]
        return [q[U], q[V], spin, *accelerations, moment / chord.inertia]

    start = [x, y - chord.depth, phi - math.pi, u, v, omega]
    settings = {"method": "LSODA", "rtol": 1e-10, "atol": 1e-13, "max_step": 0.1 * chord.unit}
    return solve_ivp(rates, (0.0, duration), start, **settings).y[3:, -1]


@pytest.mark.slow
def test_laws_made_smooth_approach_it() -> None:
    seen = 0
    for contact in random_contacts(60, seed=5):
        result = follow(*contact)
        locks = sum(0 in branch.slips or 0 in branch.gaps for _, branch in result.branches)
        if not (result.both and result.end == "separated" and locks and contact.law.friction):
            continue
        seen += 1
        scale = np.array([1.0, 1.0, Chord(*contact[:3]).size])
        speed = max(np.abs(np.array(contact.state[3:]) * scale))
        exact = np.array(result.state[3:])
        errors = [
            max(np.abs(smoothed(contact, result.time, share) - exact) * scale) / speed for share in (1e-3, 1e-4, 1e-5)
        ]
        assert errors[2] < 5e-4, contact
        assert errors[2] < 0.1 * errors[0], contact  # first order: some hundredth
    assert seen > 4
