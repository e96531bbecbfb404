"""Bodies told by their outline: against tests/outline_oracle.py, closed forms, the mirror image and the ledger."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import sledenv
from sledenv.simulation.settings import Solver
from tests import outline_oracle as oracle
from tests.profile_springs import follow
from tests.profiles import LEVEL, gravity_of

FAST, ALL = 12, 200  # random cases
SEEDS = [seed if seed < FAST else pytest.param(seed, marks=pytest.mark.slow) for seed in range(ALL)]
SOLVERS: list[Solver] = ["compliant", "rigid"]
PRECISION = 1e-9
MAX_TIME = 3.0
GRAVITY = 9.81
PLASTIC = math.nextafter(1.0, 0.0)  # asymmetry of next to no restitution


# --- the same case for both ------------------------------------------------------------------------------------------


def body_of(body: oracle.Body) -> sledenv.Body:
    """The body with each arc a part of its own."""
    arcs = [
        sledenv.Arc(arc.x, arc.y, arc.radius, arc.begin, f"arc {k}", f"side {k}", arc.corner)
        for k, arc in enumerate(body.arcs)
    ]
    return sledenv.Body(body.mass, body.inertia, arcs)


def given(case: oracle.Case) -> tuple[Any, ...]:
    """Body, law, slope and launch."""
    zones = [sledenv.Zone(*zone) for zone in case.slope.zones]
    slope = sledenv.Slope(case.slope.angle, gravity=case.slope.gravity, zones=zones)
    return body_of(case.body), sledenv.ContactLaw(*case.law), slope, sledenv.State(*case.launch)


def simulated(case: oracle.Case, solver: Solver, **options: Any) -> sledenv.Descent:
    return sledenv.simulate(*given(case), solver=solver, **{"max_rebounds": 2, "max_time": MAX_TIME} | options)


def expected(case: oracle.Case, solver: Solver, **options: Any) -> oracle.Descent:
    options = {"max_rebounds": 2, "max_time": MAX_TIME} | options
    if solver == "compliant":
        return oracle.follow_compliant(case, **options)
    slowest = 1e-5 * math.sqrt(case.slope.gravity * oracle.Outline(case.body).size)
    return oracle.follow_rigid(case, settle_speed=slowest, **options)


def case_of(
    body: sledenv.Body, law: tuple[float, ...], slope: tuple[float, float], launch: tuple[float, ...]
) -> oracle.Case:
    """The case of a body of the package."""
    arcs = tuple(oracle.Arc(*arc[:4], bool(arc.corner)) for arc in body.arcs)
    mine = oracle.Body(body.mass, body.inertia, arcs)
    return oracle.Case(mine, oracle.Law(*law), oracle.Slope(*slope), oracle.State(*launch))


ENDINGS = {"rebounds": "log_full", "rest": "jammed", "max_time": "timeout"}
STATE = ("u_after", "v_after", "omega_after")
IMPULSES = ("normal_impulse", "tangential_impulse", "rolling_impulse")
LOSSES = ("loss_hysteresis", "loss_sliding", "loss_rolling")


def assert_same(descent: sledenv.Descent, wanted: oracle.Descent, case: oracle.Case, precision: float) -> None:
    """Compare rebounds and final states, each number by its scale."""
    mass, size = case.body.mass, oracle.Outline(case.body).size
    before = [abs(value) for one in wanted.rebounds for value in (one.before.u, one.before.v, size * one.before.omega)]
    speed = max(before, default=1.0)
    assert str(descent.status) == ENDINGS[wanted.end]
    assert len(descent.rebounds) == len(wanted.rebounds)
    for found, one in zip(descent.rebounds, wanted.rebounds, strict=True):
        numbers = {"t_touchdown": one.t_touchdown, "t": one.t, "phi": one.state.phi, "x": one.state.x}
        numbers |= dict(zip(STATE, one.state[3:], strict=True)) | dict(zip(LOSSES, one.losses, strict=True))
        numbers |= dict(zip(IMPULSES, one.impulses, strict=True))
        if one.both:  # how the points share a moment is open
            del numbers["rolling_impulse"]
        scales = {"x": size, "u_after": speed, "v_after": speed, "omega_after": speed / size}
        scales |= dict.fromkeys(IMPULSES, mass * speed) | dict.fromkeys(LOSSES, mass * speed**2)
        scales["rolling_impulse"] = mass * speed * size
        for name, value in numbers.items():
            assert found[name] == pytest.approx(value, rel=0, abs=precision * scales.get(name, 1.0)), name
    units = [size, size, 1.0, speed, speed, speed / size]
    for name, value, scale in zip(oracle.State._fields, wanted.state, units, strict=True):
        assert getattr(descent.state, name) == pytest.approx(value, rel=0, abs=precision * scale), name


# --- random outlines -------------------------------------------------------------------------------------------------


@pytest.mark.jit_only
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_random_outline_rebounds_as_in_the_oracle(seed: int, solver: Solver) -> None:
    """Oracle: scipy and plain formulas. Polygons, hulls of circles, segments and ovals, with nearly flat landings."""
    case = oracle.random_case(seed)
    descent = simulated(case, solver, record="trajectory")
    assert abs(descent.energy.residual) <= 1e-11 * descent.energy.turnover
    assert min(descent.energy.hysteresis, descent.energy.sliding, descent.energy.rolling) >= 0.0
    if solver == "compliant" and descent.trajectory["touching"].max() > 2:  # some 3 in 100: the oracle knows two points
        return
    wanted = expected(case, solver)
    assert abs(wanted.residual) <= 1e-11 * wanted.turnover
    assert_same(descent, wanted, case, PRECISION)


@pytest.mark.jit_only
@pytest.mark.parametrize("seed", [68, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (73, 96))])
def test_three_points_at_once_rebound_as_springs_do(seed: int) -> None:
    """Oracle: tests/profile_springs.py, on a level without end, in the limit of no layer; it has one rolling arm."""
    body, law, slope, launch = given(oracle.random_case(seed))
    law = law._replace(corner_rolling_arm=law.rolling_arm)
    descent = sledenv.simulate(body, law, slope, launch, max_rebounds=2, max_time=MAX_TIME, record="trajectory")
    assert descent.trajectory["touching"].max() == 3
    one, half = (
        follow(body, law, gravity_of(slope), LEVEL, tuple(launch), contacts=2, max_time=MAX_TIME, layer=a, steps=10**7)
        for a in (1e-4, 5e-5)
    )
    assert len(one.rows) == len(half.rows) > 0
    for row, wanted in zip(descent.rebounds, 2.0 * half.rows[:, 4:] - one.rows[:, 4:], strict=False):
        found = row["u_after"], row["v_after"], row["omega_after"]
        assert np.array(found) == pytest.approx(wanted, rel=0, abs=1e-7 * np.abs(wanted).max())


@pytest.mark.jit_only
@pytest.mark.parametrize("count", [25, pytest.param(200, marks=pytest.mark.slow)])
@pytest.mark.parametrize("solver", SOLVERS)
def test_many_rebounds_of_random_outlines_keep_the_ledger(solver: Solver, count: int) -> None:
    """Oracle: energy is kinetic, potential, stored or lost; no descent fails."""
    for seed in range(1000, 1000 + count):
        descent = simulated(oracle.random_case(seed), solver, max_rebounds=200, max_time=20.0)
        assert str(descent.status) in ("log_full", "jammed", "timeout", "buried"), seed
        assert abs(descent.energy.residual) <= PRECISION * descent.energy.turnover, seed


def beside_a_side(radius: float, length: float, tilt: float) -> oracle.Case:
    """A flat arc that ends in a straight side; the round end beyond is lowest, or the arc at a negative tilt."""
    arcs = oracle.oval([(0.05, radius, length), (math.pi - 0.05, 0.1, 0.0)], 0.0, 0.0)
    phi = arcs[1].begin + tilt
    body, law = oracle.Body(1.0, 0.1, arcs), oracle.Law(1e4, 0.5, 0.3, 0.0, 0.0)
    height = oracle.Outline(body).support_height(phi) + 0.05
    return oracle.Case(body, law, oracle.Slope(0.1, GRAVITY), oracle.State(0.0, height, phi, 1.0, 0.0, 0.0))


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(("radius", "length", "tilt"), [(3.0, 0.3, -0.02), (30.0, 0.8, 0.001), (30.0, 0.8, 0.4)])
def test_a_flat_arc_may_end_in_a_corner_of_hardly_any_angle(
    radius: float, length: float, tilt: float, solver: Solver
) -> None:
    """Oracle: the same outline there. With corners what is across a side is the end of the arc and not its circle."""
    case = beside_a_side(radius, length, tilt)
    case = case._replace(body=case.body._replace(arcs=oracle.with_corners(case.body.arcs)))
    assert oracle.Outline(case.body).circles_stay_inside()
    assert_same(simulated(case, solver), expected(case, solver), case, PRECISION)


def test_a_flat_arc_across_a_side_does_not_reach_beyond_its_end() -> None:
    """Oracle: the same outline with a corner at the end of the arc."""
    case = beside_a_side(10.0, 0.5, 0.2)
    cornered = case._replace(body=case.body._replace(arcs=oracle.with_corners(case.body.arcs)))
    wanted = expected(cornered, "compliant", max_rebounds=1)
    assert not wanted.rebounds[0].both
    assert_same(simulated(case, "compliant", max_rebounds=1), wanted, case, PRECISION)


def mirror(case: oracle.Case) -> oracle.Case:
    x, y, phi, u, v, omega = case.launch
    zones = tuple(zone._replace(begin=-zone.end, end=-zone.begin) for zone in reversed(case.slope.zones))
    slope = case.slope._replace(angle=-case.slope.angle, zones=zones)
    return oracle.Case(oracle.mirrored(case.body), case.law, slope, oracle.State(-x, y, -phi, -u, v, -omega))


TURNED = ("x", "phi", "u_before", "omega_before", "u_after", "omega_after", "tangential_impulse", "rolling_impulse")
KEPT = ("t", "t_touchdown", "duration", "mode", "normal_impulse", "peak_force", "peak_penetration", "v_after", *LOSSES)


@pytest.mark.jit_only
@pytest.mark.parametrize("solver", SOLVERS)
def test_the_mirror_image_is_the_same_descent_bit_for_bit(solver: Solver) -> None:
    """Oracle: x turned round; a zero may have either sign."""
    for seed in range(2000, 2030):
        case = oracle.random_case(seed)
        one, image = (simulated(each, solver, max_rebounds=20) for each in (case, mirror(case)))
        assert str(one.status) == str(image.status), seed
        for name in KEPT:
            np.testing.assert_array_equal(one.rebounds[name], image.rebounds[name], err_msg=f"{seed}, {name}")
        for name in TURNED:
            np.testing.assert_array_equal(one.rebounds[name], -image.rebounds[name], err_msg=f"{seed}, {name}")


# --- outlines --------------------------------------------------------------------------------------------------------


def assert_same_arcs(body: sledenv.Body, arcs: tuple[oracle.Arc, ...]) -> None:
    assert len(body.arcs) == len(arcs)
    for one, other in zip(body.arcs, sorted(arcs, key=lambda arc: arc.begin), strict=True):
        assert one[:4] == pytest.approx(other[:4], abs=1e-12)
        assert one.corner == other.corner


def test_hulls_of_circles_are_those_of_the_oracle() -> None:
    """Oracle: the circle with the largest b between all orientations at which two have the same."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        circles = np.column_stack([rng.normal(size=(6, 2)), rng.uniform(0.0, 0.8, 6) * (rng.random(6) < 0.8)])
        arcs = oracle.hull([tuple(circle) for circle in circles.tolist()])
        if oracle.Outline(oracle.Body(1.0, 1.0, arcs)).lowest <= 0.0:
            continue
        assert_same_arcs(sledenv.hull(1.0, circles, inertia=1.0, centre=(0.0, 0.0)), arcs)


def square(side: float, mass: float = 2.0) -> sledenv.Body:
    half = 0.5 * side
    return sledenv.polygon(mass, [(half, -half), (-half, -half), (-half, half), (half, half)])


# --- closed forms ----------------------------------------------------------------------------------------------------


def laid(body: sledenv.Body, phi: float, u: float = 0.0) -> sledenv.State:
    """At rest on the surface, but for a velocity along it."""
    arcs = tuple(oracle.Arc(*arc[:4], False) for arc in body.arcs)
    height = oracle.Outline(oracle.Body(1.0, 1.0, arcs)).support_height(phi)
    return sledenv.State(0.0, height, phi, u)


def rigid(body: sledenv.Body, law: sledenv.ContactLaw, angle: float, launch: sledenv.State, **options: Any) -> Any:
    return sledenv.simulate(body, law, sledenv.Slope(angle, gravity=GRAVITY), launch, solver="rigid", **options)


def time_between(speed: Callable[[float], float], start: float, end: float) -> float:
    """Time [s] of a motion that starts at rest: d(angle)/speed, with the square root at its start taken out."""
    span = end - start
    found, _ = quad(lambda s: abs(span) * s / speed(start + span * s * s), 0.0, 1.0, epsabs=0, epsrel=1e-12)
    return 2.0 * float(found)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_square_tips_over_its_corner_like_an_inverted_pendulum(sense: float) -> None:
    """Oracle: p^2 = m g R/J_corner, theta'^2 = 2 p^2 (cos(theta0) - cos(theta)); an elliptic integral."""
    body, start, end = square(0.5), 0.02, 0.25 * math.pi - 0.01
    radius = 0.25 * math.sqrt(2.0)
    square_of_p = body.mass * GRAVITY * radius / (body.inertia + body.mass * radius**2)
    fall = time_between(
        lambda theta: math.sqrt(4.0 * square_of_p * math.sin(0.5 * (theta - start)) * math.sin(0.5 * (theta + start))),
        start,
        end,
    )
    law = sledenv.ContactLaw(1e8, PLASTIC, 2.0, 0.0)
    descent = rigid(body, law, 0.0, laid(body, sense * (0.25 * math.pi + start)), max_time=fall)
    assert descent.state.phi == pytest.approx(sense * (0.25 * math.pi + end), abs=1e-9)
    corner = descent.state.x + sense * radius * math.sin(end)
    assert corner == pytest.approx(sense * radius * math.sin(start), abs=1e-9)  # sticks


def block(width: float, height: float, offset: float = 0.0) -> sledenv.Body:
    """A block that lies on its bottom at phi = 0, the mass centre ``offset`` downhill of its middle."""
    b, h = 0.5 * width, 0.5 * height
    inertia = 2.0 * (width**2 + height**2) / 12.0
    return sledenv.polygon(2.0, [(b, -h), (-b, -h), (-b, h), (b, h)], inertia=inertia, centre=(offset, 0.0))


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
    law = sledenv.ContactLaw(1e8, PLASTIC, 50.0, 0.0)
    launch = laid(body, tilt)
    before = rigid(body, law, 0.0, launch, max_time=fall * (1.0 - 1e-9))
    assert before.state.phi == pytest.approx(0.0, abs=1e-8)
    assert before.state.omega == pytest.approx(-speed(0.0), rel=1e-7)
    # On the other corner it rises up to where the rest of its energy is spent.
    kept = 1.0 - 1.5 * math.sin(alpha) ** 2
    spin = kept * speed(0.0)
    rise = alpha - math.acos(math.cos(alpha) + 0.5 * (spin / p) ** 2)
    back = time_between(rocking_speed(p, alpha, rise), rise, 0.0)
    after = rigid(body, law, 0.0, launch, max_time=fall + back)
    assert after.state.phi == pytest.approx(-rise, abs=1e-7)
    assert after.state.omega == pytest.approx(0.0, abs=1e-6)


FLAT = {
    "square, no friction": (square(0.4), 0.0, (0.0, -2.0, 0.0), (1e7, 0.4, 0.0, 0.0, 0.0)),
    "square, slips": (square(0.4), 0.0, (3.0, -2.0, 0.0), (1e7, 0.4, 0.3, 0.0, 0.0)),
    "square, sticks": (square(0.4), 0.0, (0.3, -2.0, 0.0), (1e7, 0.4, 0.5, 0.0, 0.0)),
    "block, off its middle": (block(0.4, 0.3, 0.05), 0.0, (1.0, -2.0, 0.0), (1e7, 0.4, 0.2, 0.0, 0.01)),
    "block, on its side": (block(0.4, 0.3, 0.05), 0.5 * math.pi, (-1.0, -1.0, 0.0), (1e7, 0.2, 0.2, 0.0, 0.0)),
    "rod": (sledenv.rod(1.0, 0.9), 0.0, (1.0, -1.0, 0.0), (1e7, 0.3, 0.3, 0.0, 0.0)),
    "rounded rod": (sledenv.rod(1.0, 0.9, 0.1), 0.0, (1.0, -1.0, 0.0), (1e7, 0.3, 0.3, 0.01, 0.0)),
}


def flat_landing(name: str, stiffness: float | None = None) -> oracle.Case:
    """A side that comes down flat, from a height of .1 m."""
    body, phi, (u, v, omega), law = FLAT[name]
    law = (stiffness or law[0], *law[1:])
    phi = min((arc.begin for arc in body.arcs), key=lambda begin: abs(begin - phi))  # exactly the solver's flat
    return case_of(body, law, (0.0, 0.0), (0.0, laid(body, phi).y + 0.1, phi, u, v, omega))


@pytest.mark.parametrize("name", FLAT)
def test_a_flat_landing_is_that_of_two_springs(name: str) -> None:
    """Oracle: both ends on springs."""
    case = flat_landing(name)
    wanted = expected(case, "compliant", max_rebounds=1)
    assert wanted.rebounds[0].both
    assert_same(simulated(case, "compliant", max_rebounds=1), wanted, case, PRECISION)
