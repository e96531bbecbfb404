"""Dips, crests and tables against closed forms: docs/physics.md, section 12."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import sledenv
from tests.bodies import same_bits
from tests.plane_cases import mirrored
from tests.profiles import BODIES, Profile, random_case

G = 9.81
VELOCITIES = ("u_after", "v_after", "omega_after")
LAW = sledenv.ContactLaw.from_restitution(0.5, stiffness=1e7, friction=0.2, rolling_arm=0.002)
ICE = LAW._replace(friction=0.0, rolling_arm=0.0)


def after(descent: sledenv.simulation.Descent) -> np.ndarray:
    """Velocities after each rebound."""
    return np.column_stack([descent.rebounds[name] for name in VELOCITIES])


def loads(row: np.void) -> np.ndarray:
    """Contacts of a row of a trajectory."""
    contacts: np.ndarray = row["contacts"][: row["touching"]]
    return contacts


# The same ground, told in another way.


@pytest.mark.parametrize("kind", BODIES)
@pytest.mark.parametrize("tilt", [0.1, -0.07])
def test_a_straight_line_is_the_plane_turned(kind: str, tilt: float) -> None:
    """Oracle: a profile at -tilt to the plane is the plane of angle + tilt, its frame turned."""
    body, angle = BODIES[kind], 0.12
    sine, cosine = math.sin(tilt), math.cos(tilt)
    line = [(x, -x * math.tan(tilt)) for x in (-80.0, 120.0)]
    plane = sledenv.State(0.0, 1.4, 0.3, 3.0, -1.0, 0.5)
    turned = sledenv.State(
        plane.x * cosine + plane.y * sine,
        plane.y * cosine - plane.x * sine,
        plane.phi - tilt,
        plane.u * cosine + plane.v * sine,
        plane.v * cosine - plane.u * sine,
        plane.omega,
    )
    given: dict[str, Any] = {"max_rebounds": 3, "max_time": 20.0}
    one = sledenv.simulate(body, LAW, sledenv.Slope(angle + tilt), plane, **given)
    other = sledenv.simulate(body, LAW, sledenv.Slope(angle, profile=line), turned, **given)
    assert one.status == other.status
    expected = after(one) @ np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(after(other), expected, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(other.rebounds["t"], one.rebounds["t"], rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("number", range(4))
def test_the_mirror_image_of_a_ride_is_the_ride_of_the_mirror_image(number: int) -> None:
    """Oracle: symmetry; three contacts, whose error grows from one to the next."""
    case = random_case((11, number), zoned=True, length=math.inf)
    one, other = (sledenv.simulate(*seen[1:], max_rebounds=3, max_time=3.0) for seen in (case, mirrored(case)))
    assert one.status == other.status
    np.testing.assert_allclose(after(other), after(one) * [-1.0, 1.0, -1.0], rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(after(other)[:1], after(one)[:1] * [-1.0, 1.0, -1.0], rtol=0.0, atol=1e-10)


def test_vertices_far_away_cost_no_step_and_change_no_bit() -> None:
    """Oracle: what a step cannot reach does not matter: 20 vertices, and 2,000 of which as many are near."""
    rng = np.random.default_rng(4)
    near = [(float(x), float(y)) for x, y in zip(np.arange(20) * 2.0 - 4.0, rng.uniform(0.0, 0.4, 20), strict=True)]
    heights = rng.uniform(0.0, 0.4, 1980)
    far = [(float(x), float(y)) for x, y in zip(np.arange(1980) * 0.5 + 200.0, heights, strict=True)]
    launch = sledenv.State(0.0, 2.0, 0.0, 4.0)
    few, many = (
        sledenv.simulate(
            BODIES["sled"], LAW, sledenv.Slope(0.05, profile=[*near, (100.0, 0.0), *rest]), launch, max_time=4.0
        )
        for rest in ([], far)
    )
    assert few.outcome["steps"] == many.outcome["steps"]
    same_bits(few.rebounds, many.rebounds)


# Dips.


@pytest.mark.parametrize("radius", [0.5, 0.03])
@pytest.mark.parametrize("degrees", [2.0, 20.0])
def test_a_disc_that_slides_into_a_dip_loses_what_points_into_the_ramp(radius: float, degrees: float) -> None:
    """Oracle: V cos(turn) along the ramp and e V sin(turn) normal to it; exact without gravity."""
    turn, speed = math.radians(degrees), 5.0
    slope = sledenv.Slope(0.0, gravity=0.0, profile=[(0.0, 0.0), (100.0, 100.0 * math.tan(turn))])
    launch = sledenv.State(-1.0, radius * (1.0 + 1e-6), 0.0, speed)
    row = sledenv.simulate(sledenv.disc(1.0, radius), ICE, slope, launch, max_rebounds=1).rebounds[0]
    along = row["u_after"] * math.cos(turn) + row["v_after"] * math.sin(turn)
    normal = row["v_after"] * math.cos(turn) - row["u_after"] * math.sin(turn)
    assert along == pytest.approx(speed * math.cos(turn), rel=1e-11)
    assert normal == pytest.approx(0.5 * speed * math.sin(turn), rel=1e-11)
    assert row["omega_after"] == 0.0


@pytest.mark.parametrize("degrees", [5.0, 30.0])
@pytest.mark.parametrize("arm", [0.0, 0.001])
def test_a_disc_at_rest_in_a_dip_presses_on_both_sides(degrees: float, arm: float) -> None:
    """Oracle: N = m g/(2 cos(turn)) on each; no friction."""
    theta, radius = math.radians(degrees), 0.3
    height = 10.0 * math.tan(theta)
    slope = sledenv.Slope(0.0, profile=[(-10.0, height), (0.0, 0.0), (10.0, height)])
    launch = sledenv.State(0.0, radius / math.cos(theta), 0.0)
    law = ICE._replace(rolling_arm=arm)
    descent = sledenv.simulate(BODIES["disc"], law, slope, launch, record="trajectory", max_time=1.0)
    assert descent.status == "jammed"
    contacts = loads(descent.trajectory[-1])
    assert len(contacts) == 2
    expected = BODIES["disc"].mass * G / (2.0 * math.cos(theta))
    assert contacts["normal"].tolist() == pytest.approx([expected] * 2, rel=1e-9)
    assert sorted(contacts["normal_x"].tolist()) == pytest.approx([-math.sin(theta), math.sin(theta)], rel=1e-12)
    assert sorted(contacts["ground"].tolist()) == [2, 4]  # the pieces before and behind vertex 1


# Crests.


def rolled(turn: float, friction: float) -> sledenv.simulation.Descent:
    """A disc that rolls over a crest with v0^2 = 0.1 g r."""
    radius = 0.5
    speed = math.sqrt(0.1 * G * radius)
    law = sledenv.ContactLaw.from_restitution(0.3, stiffness=1e9, friction=friction, rolling_arm=0.0)
    slope = sledenv.Slope(0.0, profile=[(0.0, 0.0), (10.0, -10.0 * math.tan(turn))])
    launch = sledenv.State(-0.2, radius, 0.0, speed, 0.0, -speed / radius)
    body = sledenv.disc(1.0, radius)
    assert body.inertia == pytest.approx(0.5 * radius**2)
    return sledenv.simulate(
        body, law, slope, launch, record="trajectory", sample_interval=1e-3, max_rebounds=1, max_time=2.0
    )


def test_a_disc_rolls_over_a_crest_and_gains_what_it_falls() -> None:
    """Oracle: v^2 = v0^2 + (4/3) g r (1 - cos(turn)): 0.4119 g r after 40 degrees."""
    turn = math.radians(40.0)
    rows = rolled(turn, 50.0).trajectory
    behind = rows[(rows["touching"] == 1) & (rows["contacts"][:, 0]["ground"] == 2)]
    squared = (behind["u"] ** 2 + behind["v"] ** 2) / (G * 0.5)
    np.testing.assert_allclose(squared, 0.1 + (4.0 / 3.0) * (1.0 - behind["y"] / 0.5), rtol=1e-4)
    assert squared[0] == pytest.approx(0.4119, rel=0.01)


def test_a_disc_that_rolls_leaves_a_crest_where_its_weight_no_longer_turns_it() -> None:
    """Oracle: acos((3 v0^2/(g r) + 4)/7) = 52.10 degrees."""
    row = rolled(math.radians(80.0), 1e3).rebounds[0]
    assert math.degrees(math.asin(row["x"] / 0.5)) == pytest.approx(math.degrees(math.acos(4.3 / 7.0)), abs=0.02)


GRIP = sledenv.ContactLaw.from_restitution(0.3, stiffness=1e9, friction=2.0, rolling_arm=0.0)
TABLE: Profile = [(0.0, 0.0), (1.5, -8.0)]


@pytest.mark.parametrize("beyond", [-0.2, -0.02, 0.02, 0.2])
def test_a_block_on_the_edge_of_a_table_tips_when_its_mass_centre_is_beyond(beyond: float) -> None:
    """Oracle: statics; then it turns about the crest as a pendulum does, (J + m d^2) omega^2/2 = m g (fall)."""
    block = BODIES["block"]
    slope = sledenv.Slope(0.0, profile=TABLE)
    launch = sledenv.State(beyond, 0.3, 0.0)
    descent = sledenv.simulate(block, GRIP, slope, launch, record="trajectory", max_time=0.6 if beyond > 0.0 else 3.0)
    if beyond < 0.0:
        assert descent.status == "jammed"
        assert abs(descent.state.phi) < 1e-5
        return
    rows = descent.trajectory[(descent.trajectory["touching"] == 1) & (descent.trajectory["phi"] < -0.05)]
    rows = rows[rows["phi"] > -0.3]
    assert len(rows) > 10
    assert (rows["contacts"][:, 0]["ground"] == 1).all()  # vertex 0
    about = block.inertia + block.mass * (beyond**2 + 0.3**2)
    np.testing.assert_allclose(0.5 * about * rows["omega"] ** 2, block.mass * G * (0.3 - rows["y"]), rtol=2e-3)


def test_a_plate_slides_over_the_edge_of_a_table() -> None:
    """Oracle: Lagrange's equations of a side without friction on a point, integrated by scipy."""
    plate = sledenv.polygon(10.0, [(-0.5, -0.05), (0.5, -0.05), (0.5, 0.05), (-0.5, 0.05)], rounding=0.02)
    high, speed = 0.05, 1.3
    law = ICE._replace(stiffness=1e9)
    span = 0.45
    descent = sledenv.simulate(
        plate, law, sledenv.Slope(0.0, profile=TABLE), sledenv.State(-0.2, high, 0.0, speed), max_time=span
    )

    def rates(_: float, q: np.ndarray) -> list[float]:
        s, phi, ds, dphi = q  # s: of the mass centre from the crest, along the plate
        moment = -plate.mass * (G * s * math.cos(phi) + 2.0 * s * ds * dphi - high * s * dphi**2)
        ddphi = moment / (plate.inertia + plate.mass * s * s)
        return [ds, dphi, s * dphi**2 - G * math.sin(phi) + high * ddphi, ddphi]

    start = 0.2 / speed  # when the mass centre passes the crest
    s, phi, ds, dphi = solve_ivp(rates, (start, span), [0.0, 0.0, speed, 0.0], rtol=1e-10, atol=1e-12).y[:, -1]
    along, out = np.array([math.cos(phi), math.sin(phi)]), np.array([-math.sin(phi), math.cos(phi)])
    place = s * along + high * out
    velocity = (ds - high * dphi) * along + s * dphi * out
    expected = [*place, phi, *velocity, dphi]
    assert s < 0.45  # still on the side
    np.testing.assert_allclose(descent.state, expected, rtol=0.0, atol=2e-3 * abs(dphi))
