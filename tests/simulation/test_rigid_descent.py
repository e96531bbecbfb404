"""Whole descents in the stiff limit: Zeno sequences, sustained contact, lift-off, chord landings, and their ledger."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sledenv import ContactLaw, Slope, State, circular_segment, rigid_impact, segment, simulate
from sledenv.simulation.support import support_height

GRAVITY = 9.81
DISC = segment(1.0, 0.1, 0.05, 7.5e-3)
PILOT = segment(1.0, 0.5, 0.25, 0.1875)  # J = m (r^2 - h^2): the mass centre is a node of rolling


def laid(body, phi, u=0.0, omega=0.0):
    """Launch on the surface, without gap rate."""
    a = (support_height(body, phi + 1e-7) - support_height(body, phi - 1e-7)) / 2e-7 if omega else 0.0
    return State(0.0, support_height(body, phi), phi, u, a * omega, omega)


def rigid(body, law, slope, state, **kwargs):
    return simulate(body, law, slope, state, solver="rigid", **kwargs)


@pytest.mark.parametrize("restitution", [0.3, 0.6, 0.9])
def test_a_bouncing_wheel_settles_after_the_zeno_time(restitution):
    """Oracle: 2 v0 e / (G (1 - e)) from the first impact on, and each flight shorter by exactly e."""
    wheel = segment(1.0, 0.1, 0.0, 5e-3)
    law = ContactLaw.from_restitution(restitution, stiffness=1e6, friction=0.0, rolling_arm=0.0)
    descent = rigid(wheel, law, Slope(0.0), State(0, 0.6, 0, 1.0), settle_speed=1e-9, max_time=20)
    fall, last = math.sqrt(2 * 0.5 / GRAVITY), descent.rebounds[-1]
    flights = np.diff(descent.rebounds["t"][:-1])
    flights = flights[flights > 1e-4]  # shorter ones are differences of rounded times
    assert np.allclose(flights[1:] / flights[:-1], restitution, rtol=1e-6)
    settled = last["t"] - last["duration"] - fall
    assert settled == pytest.approx(2 * fall * restitution / (1 - restitution), abs=1e-7)
    assert descent.state.u == pytest.approx(1.0, abs=1e-12)


def test_a_wheel_that_slides_through_all_its_bounces_keeps_the_closed_form_speed():
    """Oracle: u_inf = u0 + v0 (2 e tan(beta) - f (1 + e)) / (1 - e), docs/physics.md, section 6."""
    beta, e, f, drop = math.radians(8.0), 0.5, 0.02, 0.3
    wheel = segment(1.0, 0.1, 0.0, 5e-3)
    law = ContactLaw.from_restitution(e, stiffness=1e6, friction=f, rolling_arm=0.0)
    slope = Slope(beta, gravity=GRAVITY)
    inward, downhill = GRAVITY * math.cos(beta), GRAVITY * math.sin(beta)
    fall = math.sqrt(2 * drop / inward)
    v0, u0 = inward * fall, 5.0 + downhill * fall
    descent = rigid(wheel, law, slope, State(0, 0.1 + drop, 0, 5.0), settle_speed=1e-9, max_time=60)
    last = descent.rebounds[-1]
    assert last["u_before"] == pytest.approx(u0 + v0 * (2 * e * math.tan(beta) - f * (1 + e)) / (1 - e), abs=1e-7)


SUSTAINED = {
    "slide and rotate": (PILOT, ContactLaw(1e9, 0.5, 0.05, 0.002), 0.15, 0.9, 1.0, 0.0),
    "roll": (PILOT, ContactLaw(1e9, 0.5, 0.9, 0.002), 0.15, 0.9, 0.0, 0.0),
    "slide with stopped rotation": (segment(1.0, 0.5, 0.05, 0.2), ContactLaw(1e9, 0.5, 0.1, 0.2), 0.3, 0.2, 1.0, 0.0),
    "slip stops, then rolls": (PILOT, ContactLaw(1e9, 0.5, 0.4, 0.01), 0.05, -0.6, 1.5, 0.0),
    "stuck": (PILOT, ContactLaw(1e9, 0.5, 0.6, 0.2), 0.05, 0.1, 0.0, 0.0),
    "a corner slides": (circular_segment(1.0, 0.5, 1.2), ContactLaw(1e9, 0.5, 0.1, 0.01, 0.01), 0.1, 1.6, 0.5, 0.0),
    "from the arc over the corner": (
        circular_segment(1.0, 0.5, 1.2),
        ContactLaw(1e9, 0.5, 0.7, 0.01),
        0.1,
        1.1,
        0.0,
        0.0,
    ),
}


@pytest.mark.parametrize("case", SUSTAINED)
def test_sustained_contact_is_the_limit_of_the_compliant_one(case):
    """Oracle: the compliant solver, whose distance from the rigid one falls as c^-1/2."""
    body, law, beta, phi, u, omega = SUSTAINED[case]
    slope = Slope(beta)
    launch = laid(body, phi, u, omega)
    stiff = np.array([1e8, 1e10])
    distance = []
    exact = rigid(body, law, slope, launch, max_time=0.3)
    for c in stiff:
        soft = simulate(body, law._replace(stiffness=c), slope, launch, max_time=0.3)
        assert soft.status == exact.status or exact.status == "jammed"
        distance.append(max(abs(p - q) for p, q in zip(soft.state, exact.state, strict=True)))
    assert distance[0] < 2e-2
    assert distance[1] < 0.3 * distance[0] or distance[1] < 1e-6


def test_a_rolling_eccentric_disc_lifts_off_where_the_normal_force_vanishes():
    """Oracle: the gap acceleration without contact, -(G + h cos(phi) omega^2), vanishes there; it lands again."""
    body = segment(1.0, 0.5, 0.4, 0.05)
    law = ContactLaw(1e9, 0.5, 3.0, 0.0)
    phi = 0.0
    spin = -40.0
    launch = State(0.0, support_height(body, phi), phi, -0.1 * spin, 0.0, spin)
    descent = rigid(body, law, Slope(0.0), launch, max_rebounds=3)
    first, second, _ = descent.rebounds
    assert descent.status == "log_full"
    assert first["duration"] > 0.01
    assert second["t"] - second["duration"] - first["t"] > 1e-3
    assert second["v_before"] < 0.0
    free = GRAVITY + 0.4 * math.cos(first["phi"]) * first["omega_after"] ** 2
    assert abs(free) < 1e-9 * GRAVITY


def test_a_segment_that_rolls_onto_its_corner_too_fast_takes_off_there_once():
    """Oracle: on the corner it would have to be pulled down with h_c omega^2 > G, and nothing pulls."""
    body = circular_segment(1.0, 0.5, math.radians(110.0))
    phi, spin = -1.8, -9.0
    a, b = body.eccentricity * math.sin(phi), support_height(body, phi)
    launch = State(0.0, b, phi, -b * spin, a * spin, spin)
    law = ContactLaw(1e6, 0.6, 0.6, 0.0)
    descent = rigid(body, law, Slope(0.1), launch, max_rebounds=2)
    first, second = descent.rebounds
    assert first["phi"] == pytest.approx(-body.half_angle, abs=1e-12)
    assert second["t"] - second["duration"] - first["t"] > 1e-3
    assert descent.status == "log_full"


CONVERGENCE = {
    "slip stops": (DISC, 0.5, 0.9, 0.001, 0.3, 1.0, -3.0, 0.0),
    "spin reverses, slip reverses": (DISC, 0.5, 0.1, 0.001, 0.6, 1.0, -4.0, 6.0),
    "slip reverses, spin reverses": (segment(1.0, 0.1, 0.05, 2e-3), 0.3, 0.15, 0.001, -0.9, 0.3, -5.0, -10.0),
}


@pytest.mark.parametrize("case", CONVERGENCE)
def test_the_compliant_impact_converges_to_the_rigid_one_as_the_root_of_the_compliance(case):
    """Oracle: rigid_impact; the contact lasts c^-1/2, and so far the configuration moves."""
    body, asymmetry, friction, arm, phi, u, v, omega = CONVERGENCE[case]
    launch = State(0.0, support_height(body, phi), phi, u, v, omega)
    exact = rigid_impact(body, ContactLaw(1.0, asymmetry, friction, arm), launch)
    slips = {phase.slip for phase in exact.phases}
    spins = {phase.spin for phase in exact.phases}
    assert ({-1, 1} <= slips) == ("slip reverses" in case)
    assert ({-1, 1} <= spins) == ("spin reverses" in case)
    stiffness = 10.0 ** np.arange(8, 13)
    error = []
    for c in stiffness:
        law = ContactLaw(c, asymmetry, friction, arm)
        after = simulate(body, law, Slope(0.0, gravity=0.0), launch, max_rebounds=1).state
        error.append(
            math.hypot(
                after.u - exact.state.u, after.v - exact.state.v, body.radius * (after.omega - exact.state.omega)
            )
        )
    slope = np.polyfit(np.log(stiffness), np.log(error), 1)[0]
    assert slope == pytest.approx(-0.5, rel=0.05)
