"""Random convex bodies on planes, and closed forms of blocks: ledger, mirror image, exact impacts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import sledenv
from sledenv.simulation.settings import Solver
from sledenv.simulation.support import support_height
from tests.bodies import lowest_arc
from tests.oracles import rational_impact
from tests.plane_cases import mirrored, plane_case

GRAVITY = 9.81
PLASTIC = math.nextafter(1.0, 0.0)  # asymmetry of next to no restitution
SOLVERS = pytest.mark.parametrize("solver", ["compliant", "rigid"])


@pytest.mark.jit_only
@pytest.mark.parametrize("count", [200, pytest.param(20_000, marks=pytest.mark.slow)])
@SOLVERS
def test_random_descents_end_and_create_no_energy(solver: Solver, count: int) -> None:
    """Oracle: conservation of energy. Of 10,000 one may exhaust its steps; no other failure is known."""
    endings = Counter[str]()
    for seed in range(count):
        case = plane_case(seed, zoned=seed % 2 == 1, finish=20.0)
        descent = sledenv.simulate(*case[1:], solver=solver, max_rebounds=2000, max_time=20.0)
        endings[str(descent.status)] += 1
        assert abs(descent.energy.residual) <= 1e-9 * descent.energy.turnover, case.name
        assert min(descent.energy.hysteresis, descent.energy.sliding, descent.energy.rolling) >= 0.0, case.name
    assert endings["step_budget"] <= 1e-4 * count
    assert set(endings) <= {"finish", "jammed", "timeout", "log_full", "step_budget"}
    assert min(endings["finish"], endings["jammed"]) > 0.1 * count


SAME = ("t", "t_touchdown", "duration", "mode", "peak_force", "peak_penetration", "normal_impulse", "v_after")
LOST = ("loss_hysteresis", "loss_sliding", "loss_rolling")
TURNED = ("x", "phi", "u_before", "omega_before", "u_after", "omega_after", "tangential_impulse", "rolling_impulse")


@pytest.mark.jit_only
@SOLVERS
def test_the_mirror_image_is_the_same_descent_bit_for_bit(solver: Solver) -> None:
    """Oracle: x turned round; a zero may have either sign."""
    for seed in range(150):
        case = plane_case(seed, zoned=seed % 2 == 1)
        one, image = (
            sledenv.simulate(*each[1:], solver=solver, max_rebounds=20, max_time=6.0) for each in (case, mirrored(case))
        )
        assert one.status == image.status, case.name
        for name in (*SAME, *LOST):
            np.testing.assert_array_equal(one.rebounds[name], image.rebounds[name], err_msg=f"{case.name}, {name}")
        for name in TURNED:
            np.testing.assert_array_equal(one.rebounds[name], -image.rebounds[name], err_msg=f"{case.name}, {name}")


@pytest.mark.jit_only
def test_rigid_bodies_fly_freely_and_rebound_as_exact_impacts() -> None:
    """Oracle: the parabola between rebounds; rational_impact with the friction of the zone in which the point lies.

    Impacts of several points are left out, those of contacts that last, and slow ones.
    """
    exact = 0
    for seed in range(150):
        body, law, slope, launch = plane_case(seed, zoned=True)[1:]
        now, begin = launch, 0.0
        for row in sledenv.simulate(body, law, slope, launch, solver="rigid", max_rebounds=4, max_time=5.0).rebounds:
            time, down = row["t_touchdown"] - begin, GRAVITY * math.sin(slope.angle)
            before = (now.u + down * time, now.v - GRAVITY * math.cos(slope.angle) * time, now.omega)
            assert (row["u_before"], row["v_before"], row["omega_before"]) == pytest.approx(before, abs=1e-11)
            (arc, a, b), part = lowest_arc(body, float(row["phi"])), body.parts[row["feature"] - 1]
            approach = row["v_before"] - a * row["omega_before"]
            if row["duration"] > 0.0 or part != arc.part or approach > -1e-2:
                break
            place_and_angle = now.x + now.u * time + 0.5 * down * time * time, now.phi + now.omega * time
            assert (row["x"], row["phi"]) == pytest.approx(place_and_angle, abs=1e-11)
            place = float(row["x"]) - a
            zone = next((zone for zone in slope.zones if zone.begin <= place < zone.end), law)
            met = row["u_before"] + b * row["omega_before"], row["omega_before"], approach
            given = body.mass, body.inertia, a, b, zone.friction, zone.rolling_arm, law.restitution
            wanted = rational_impact(*map(float, (*given, *met)))
            if wanted.approach <= 0.0:  # it stays
                break
            speed = float(np.abs(before * np.array([1.0, 1.0, body.size])).max())
            u, v = wanted.slip - b * wanted.omega, wanted.approach + a * wanted.omega
            assert (row["u_after"], row["v_after"]) == pytest.approx((u, v), abs=1e-11 * speed), seed
            assert row["omega_after"] == pytest.approx(wanted.omega, abs=1e-11 * speed / body.size), seed
            losses = wanted.loss_normal, wanted.loss_sliding, wanted.loss_rolling
            assert [row[name] for name in LOST] == pytest.approx(losses, abs=1e-11 * body.mass * speed**2), seed
            now = sledenv.State(float(row["x"]), b, float(row["phi"]), u, v, wanted.omega)
            begin, exact = float(row["t"]), exact + 1
    assert exact > 200


# Closed forms.


def block(width: float, height: float, offset: float = 0.0) -> sledenv.Body:
    """A block that lies on its bottom at phi = 0, the mass centre ``offset`` downhill of its middle."""
    b, h = 0.5 * width, 0.5 * height
    inertia = 2.0 * (width**2 + height**2) / 12.0
    return sledenv.polygon(2.0, [(b, -h), (-b, -h), (-b, h), (b, h)], inertia=inertia, centre=(offset, 0.0))


def laid(body: sledenv.Body, phi: float, u: float = 0.0) -> sledenv.State:
    """At rest on the surface, but for a velocity along it."""
    return sledenv.State(0.0, support_height(body, phi), phi, u)


def rigid(body: sledenv.Body, friction: float, launch: sledenv.State, **options: Any) -> sledenv.simulation.Descent:
    law = sledenv.ContactLaw(1e8, PLASTIC, friction, 0.0)
    return sledenv.simulate(body, law, sledenv.Slope(0.0, gravity=GRAVITY), launch, solver="rigid", **options)


def time_between(speed: Callable[[float], float], start: float, end: float) -> float:
    """Time [s] of a motion that starts at rest: d(angle)/speed, with the square root at its start taken out."""
    span = end - start
    found, _ = quad(lambda s: abs(span) * s / speed(start + span * s * s), 0.0, 1.0, epsabs=0, epsrel=1e-12)
    return 2.0 * float(found)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_square_tips_over_its_corner_like_an_inverted_pendulum(sense: float) -> None:
    """Oracle: p^2 = m g R/J_corner, theta'^2 = 2 p^2 (cos(theta0) - cos(theta)); an elliptic integral."""
    body, start, end = block(0.5, 0.5), 0.02, 0.25 * math.pi - 0.01
    radius = 0.25 * math.sqrt(2.0)
    square_of_p = body.mass * GRAVITY * radius / (body.inertia + body.mass * radius**2)
    fall = time_between(
        lambda theta: math.sqrt(4.0 * square_of_p * math.sin(0.5 * (theta - start)) * math.sin(0.5 * (theta + start))),
        start,
        end,
    )
    state = rigid(body, 2.0, laid(body, sense * (0.25 * math.pi + start)), max_time=fall).state
    assert state.phi == pytest.approx(sense * (0.25 * math.pi + end), abs=1e-9)
    corner = state.x + sense * radius * math.sin(end)
    assert corner == pytest.approx(sense * radius * math.sin(start), abs=1e-9)  # sticks


def rocking_speed(p: float, alpha: float, turned: float) -> Callable[[float], float]:
    """Spin of a block that rocks on its corner, tilted by theta, from rest at ``turned``."""

    def speed(theta: float) -> float:
        middle, half = alpha - 0.5 * (theta + turned), 0.5 * abs(turned - theta)
        return 2.0 * p * math.sqrt(abs(math.sin(middle) * math.sin(half)))

    return speed


@pytest.mark.parametrize(("alpha", "share"), [(0.05, 0.4), (0.3, 0.6)])
def test_a_block_rocks_as_housner_has_it(alpha: float, share: float) -> None:
    """Oracle: quarter of a period arccosh(1/(1 - theta0/alpha))/p; then the share 1 - 1.5 sin^2(alpha) of the spin."""
    radius = 0.5
    body = block(2.0 * radius * math.sin(alpha), 2.0 * radius * math.cos(alpha))
    p = math.sqrt(body.mass * GRAVITY * radius / (body.inertia + body.mass * radius**2))
    tilt = share * alpha
    speed = rocking_speed(p, alpha, tilt)
    fall = time_between(speed, tilt, 0.0)
    assert fall == pytest.approx(math.acosh(1.0 / (1.0 - share)) / p, rel=alpha**2)  # small angles
    launch = laid(body, tilt)
    before = rigid(body, 50.0, launch, max_time=fall * (1.0 - 1e-9)).state
    assert before.phi == pytest.approx(0.0, abs=1e-8)
    assert before.omega == pytest.approx(-speed(0.0), rel=1e-7)
    # On the other corner it rises up to where the rest of its energy is spent.
    spin = (1.0 - 1.5 * math.sin(alpha) ** 2) * speed(0.0)
    rise = alpha - math.acos(math.cos(alpha) + 0.5 * (spin / p) ** 2)
    back = time_between(rocking_speed(p, alpha, rise), rise, 0.0)
    after = rigid(body, 50.0, launch, max_time=fall + back).state
    assert after.phi == pytest.approx(-rise, abs=1e-7)
    assert after.omega == pytest.approx(0.0, abs=1e-6)
