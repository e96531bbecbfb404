"""Derivatives of a descent, and how far away its events change."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from mpmath import mp, mpf

from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone, asymmetry_of
from sledenv.simulation.sensitivity import (
    LAUNCH,
    REBOUND_QUANTITIES,
    Sensitivity,
    sensitivity,
)
from sledenv.simulation.settings import Settings
from sledenv.simulation.shapes import circular_segment, disc, polygon
from sledenv.simulation.simulate import simulate, simulate_batch
from sledenv.simulation.support import support_height, support_heights
from tests.oracles import (
    DATA_FILE,
    OracleBody,
    OracleRebound,
    OracleState,
    compliant_descent,
    derivatives,
    reference_doubles,
    rigid_descent,
)

REFERENCE = json.loads(DATA_FILE.read_text())
WHEEL = segment(1.0, 0.5, 0.0, 0.1)
DISC = segment(1.0, 0.1, 0.05, 7.5e-3)
SEGMENT = circular_segment(2.0, 0.5, math.radians(60.0))
LAW = ContactLaw(1e6, 0.5, 0.1, 0.001)
G = 9.81
RECORDED = {"time": "t", "x": "x", "phi": "phi", "u": "u_after", "v": "v_after", "omega": "omega_after"}


def law_of(restitution: float, friction: float = 0.0, arm: float = 0.0) -> ContactLaw:
    return ContactLaw.from_restitution(restitution, stiffness=1e6, friction=friction, rolling_arm=arm)


def reference(solver: Any, **options: Any) -> Sensitivity:
    body, state = reference_doubles()
    return sensitivity(
        segment(*body[:4]),
        ContactLaw(*body[4:8]),
        Slope(body.slope, math.inf, body.gravity),
        State(*state),
        Settings(solver, max_rebounds=5),
        **options,
    )


def assert_near_digits(found: Sensitivity, digits: dict[str, list[Any]], worst: float) -> None:
    """Compare derivatives at the fifth rebound with (time, x, y, phi, u, v, omega) of many digits, by parameter."""
    for name, values in digits.items():
        parameter = {"slope": "angle"}.get(name, name).removesuffix("-")
        exact = dict(zip(OracleRebound._fields, values, strict=False))
        for theirs, ours in RECORDED.items():
            value = found.of_rebounds(ours, parameter)[4]
            assert abs(value - float(exact[theirs])) <= worst * abs(float(exact[theirs])) + 1e-15, (parameter, ours)


# --- against many digits ----------------------------------------------------------------------------------------------


def test_the_fifth_rebound_of_the_reference_has_the_derivatives_of_fifty_digits() -> None:
    """Oracle: tests.oracles, differences of descents in 50 digits, by every parameter that plays a part; errors too."""
    found = reference("compliant")
    recorded = REFERENCE["derivatives"]
    assert recorded["rebound"] == len(found.rebounds) == 5
    by = recorded["by"]
    assert {*(name.removesuffix("-") for name in by), "x", "angle"} == {*found.parameters, "slope"}
    assert_near_digits(found, by, 1e-8)
    for name, values in by.items():
        column = found.parameters.index({"slope": "angle"}.get(name, name).removesuffix("-"))
        for theirs, value in zip(recorded["of"], values, strict=True):
            if theirs != "y":
                row = list(REBOUND_QUANTITIES).index(RECORDED[theirs])
                error = abs(found.rebounds[4, row, column] - float(value))
                assert error <= 5.0 * found.rebound_errors[4, row, column]


def rigid_digits(body: OracleBody, state: OracleState) -> list[OracleRebound]:
    with mp.workdps(50):
        restitution = mp.sqrt((1 - mpf(body.asymmetry)) / (1 + mpf(body.asymmetry)))
    return rigid_descent(body, state, restitution, 5)


def test_the_fifth_rebound_of_rigid_surfaces_has_the_derivatives_of_fifty_digits() -> None:
    """Oracle: flights and exact impacts in 50 digits."""
    names = ["y", "phi", "u", "v", "omega-", "restitution", *OracleBody._fields]
    names = [name for name in names if name not in ("stiffness", "asymmetry")]
    assert_near_digits(reference("rigid"), derivatives(rigid_digits, *reference_doubles(), names), 1e-8)


@pytest.mark.slow
def test_recorded_derivatives_are_those_that_the_oracle_computes() -> None:
    """With other digits, steps and order than those recorded."""
    recorded = REFERENCE["derivatives"]["by"]

    def descend(*given: Any) -> list[OracleRebound]:
        return compliant_descent(*given, rebounds=5, dps=44, order=40, step_fraction="0.7")

    found = derivatives(descend, *reference_doubles(), recorded, dps=44)
    with mp.workdps(50):
        for name, values in found.items():
            for value, exact in zip(values, map(mpf, recorded[name]), strict=True):
                assert abs(value - exact) <= mpf("1e-19") * abs(exact) + mpf("1e-20")


# --- closed forms -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("restitution", [0.5, 0.9, 1.0])
def test_a_bouncing_wheel_has_the_derivatives_of_its_closed_form(restitution: float) -> None:
    """Oracle: v_n = e^n v_0, v_0 = sqrt(2 g d), t_n = v_0/g (1 + 2 (e + ... + e^(n-1))), flat ground, no friction."""
    drop, u = 0.5, 2.0
    found = sensitivity(
        WHEEL,
        law_of(restitution),
        Slope(0.0),
        State(0.0, 0.5 + drop, 0.3, u, 0.0, 1.0),
        Settings(solver="rigid", max_rebounds=5),
    )
    n, e, v = np.arange(1, 6), restitution, math.sqrt(2.0 * G * drop)
    powers = np.array([sum(e**k for k in range(1, m)) for m in n])
    slopes = np.array([sum(k * e ** (k - 1) for k in range(1, m)) for m in n])
    near = {"rtol": 1e-9, "atol": 1e-11}
    np.testing.assert_allclose(found.of_rebounds("v_after", "restitution"), n * e ** (n - 1) * v, **near)
    np.testing.assert_allclose(found.of_rebounds("v_after", "y"), e**n * G / v, **near)
    np.testing.assert_allclose(found.of_rebounds("v_after", "radius"), -(e**n) * G / v, **near)
    np.testing.assert_allclose(found.of_rebounds("t", "restitution"), 2.0 * v / G * slopes, **near)
    np.testing.assert_allclose(found.of_rebounds("t", "y"), (1.0 + 2.0 * powers) / v, **near)
    np.testing.assert_allclose(found.of_rebounds("t", "v"), 1.0 / G, **near)
    np.testing.assert_allclose(found.of_rebounds("t", "gravity"), -(1.0 + 2.0 * powers) * v / (2.0 * G * G), **near)
    np.testing.assert_allclose(found.of_rebounds("x", "u"), (1.0 + 2.0 * powers) * v / G, **near)
    np.testing.assert_allclose(found.of_rebounds("x", "x"), 1.0, **near)
    np.testing.assert_allclose(found.of_rebounds("omega_after", "omega"), 1.0, **near)
    for idle in ("mass", "inertia"):
        assert np.abs(found.rebounds[:, :, found.parameters.index(idle)]).max() < 1e-13
    assert (found.of_rebounds("omega_after", "rolling_arm") < 0.0).all()
    assert (found.sides[:, found.parameters.index("restitution")] == (-1 if e == 1.0 else 0)).all()
    assert (found.sides[:, found.parameters.index("rolling_arm")] == 1).all()


def test_a_plastic_impact_has_the_derivatives_of_its_closed_form() -> None:
    """Oracle: m r u - J omega stays, from the flight to rolling on level ground; any e > 0 makes it another descent."""
    m, r, j, u, omega = 1.0, 0.5, 0.1, 4.0, 1.0
    launch, settings = State(0.0, 2.0 * r, 0.3, u, 0.0, omega), Settings(solver="rigid", max_rebounds=1)
    found = sensitivity(segment(m, r, 0.0, j), law_of(0.0, 0.1), Slope(0.0), launch, settings)
    about, momentum = m * r * r + j, m * r * u - j * omega  # u_after = r momentum / about
    assert found.descent.rebounds["u_after"] == pytest.approx(r * momentum / about)
    for parameter, derivative in (
        ("u", m * r * r / about),
        ("omega", -r * j / about),
        ("inertia", -r * omega / about - r * momentum / about**2),
        ("friction", 0.0),
        ("restitution", math.nan),
    ):
        value = found.of_rebounds("u_after", parameter)[0]
        assert value == pytest.approx(derivative, rel=1e-9, abs=1e-12, nan_ok=True), parameter


def test_a_flight_to_the_finish_has_the_derivatives_of_a_projectile() -> None:
    """Oracle: x = u t, y = y0 + v t - g t^2/2 up to x = L: t = L/u; no rebound."""
    u, v, length = 3.0, 2.0, 1.5
    found = sensitivity(DISC, LAW, Slope(0.0, length), State(0.0, 2.0, 0.3, u, v, 4.0))
    assert found.descent.status == "finish"
    assert found.rebounds.shape == (0, len(REBOUND_QUANTITIES), len(found.parameters))
    t = length / u
    exact = {
        ("t", "u"): -length / u**2,
        ("t", "length"): 1.0 / u,
        ("t", "x"): -1.0 / u,
        ("x", "length"): 1.0,
        ("x", "u"): 0.0,
        ("y", "v"): t,
        ("y", "u"): (v - G * t) * -t / u,
        ("y", "gravity"): -0.5 * t**2,
        ("phi", "omega"): t,
        ("phi", "u"): -4.0 * t / u,
        ("v", "gravity"): -t,
        ("u", "angle"): G * t,
        ("progress", "u"): 0.0,
    }
    for (quantity, parameter), value in exact.items():
        assert found.of_end(quantity, parameter) == pytest.approx(value, rel=1e-9, abs=1e-12), (quantity, parameter)


def test_the_reward_has_the_derivative_of_the_energy_that_it_is_made_of() -> None:
    """Oracle: retention = u^2/(u^2 + v^2 + J omega^2/m + 2 g d) of a flight over the end of a level slope."""
    u, omega, y = 3.0, 4.0, 2.0
    found = sensitivity(DISC, LAW, Slope(0.0, 1.5), State(0.0, y, 0.3, u, 0.0, omega))
    supplied = u**2 + 7.5e-3 * omega**2 + 2.0 * G * (y - 0.05)  # the mass centre may lie as low as r - h
    reward = 0.5 + 0.5 * u / math.sqrt(supplied)
    assert float(found.descent.jam.reward) == pytest.approx(reward, rel=1e-14)
    by_u = 0.5 / math.sqrt(supplied) - 0.5 * u * u / supplied**1.5
    assert found.of_end("reward", "u") == pytest.approx(by_u, rel=1e-9)
    assert found.of_end("reward", "y") == pytest.approx(-0.5 * u * G / supplied**1.5, rel=1e-9)
    assert found.of_end("reward", "omega") == pytest.approx(-0.5 * u * 7.5e-3 * omega / supplied**1.5, rel=1e-9)


# --- symmetry and other invariants ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("phi", "u", "omega", "body", "solver"),
    [
        *((0.4, 0.7, 1.3, "segment", "compliant"), (-2.8, 1.5, -4.0, "segment", "rigid")),
        *((2.1, 0.3, 0.2, "disc", "rigid"), (-0.9, 1.9, 3.3, "disc", "compliant")),
    ],
)
def test_the_mirror_image_has_the_mirrored_derivatives(
    phi: float, u: float, omega: float, body: str, solver: Any
) -> None:
    """Oracle: on the level, x, phi, u, omega change their signs, and so do derivatives of one by the others."""
    given = {"segment": SEGMENT, "disc": DISC}[body]
    y = 0.3 + support_height(given, phi)
    one, other = (
        sensitivity(
            given,
            LAW,
            Slope(0.0),
            State(0.0, y, s * phi, s * u, 0.0, s * omega),
            Settings(solver=solver, max_rebounds=4),
        )
        for s in (1.0, -1.0)
    )
    odd = {"x", "phi", "u", "omega", "x_contact", "u_before", "omega_before", "u_after", "omega_after", "angle"}
    rows = np.array([-1.0 if name in odd else 1.0 for name in REBOUND_QUANTITIES])
    columns = np.array([-1.0 if name in odd else 1.0 for name in one.parameters])
    slack = 10.0 * (one.rebound_errors + other.rebound_errors) + 1e-9
    known = np.isfinite(one.rebounds)
    assert (known == np.isfinite(other.rebounds)).all()
    assert known.any()
    apart = np.abs(one.rebounds - other.rebounds * rows[:, np.newaxis] * columns)
    assert (apart[known] <= slack[known]).all()
    flipped = np.where((columns < 0.0)[:, np.newaxis], other.distances[..., ::-1], other.distances)
    np.testing.assert_allclose(one.distances, flipped, rtol=1e-6)
    assert (one.sides == other.sides * columns).all()


def test_whole_turns_of_the_launch_do_not_matter_even_at_half_a_turn() -> None:
    """Oracle: phi and phi - 2 pi are one launch; steps across the half turn must not jump."""
    one, other = (
        sensitivity(DISC, LAW, Slope(0.1), State(0.0, 0.6, phi, 1.0, 0.0, 2.0), Settings(max_rebounds=3))
        for phi in (math.pi, -math.pi)
    )
    np.testing.assert_allclose(one.rebounds, other.rebounds, rtol=1e-7, atol=1e-9)
    assert np.isfinite(one.of_rebounds("phi", "phi")).all()


# --- where the sequence changes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["phi", "u", "y"])
def test_distances_to_another_sequence_are_those_of_a_scan(name: str) -> None:
    """Oracle: 2,001 launches side by side."""
    launch, slope, settings = State(0.0, 0.7, 0.7, 1.0, 0.0, 2.0), Slope(0.2), Settings(max_rebounds=3)
    found = sensitivity(SEGMENT, LAW, slope, launch, settings, parameters=[name])
    below, above = found.distances[-1, 0]
    assert math.isfinite(below) or math.isfinite(above)
    for sign, distance in ((-1.0, below), (1.0, above)):
        changes = np.linspace(0.0, min(1.5 * distance, found.scales[0]), 2001)
        launches = np.tile(np.array(launch), (len(changes), 1))
        launches[:, LAUNCH.index(name)] += sign * changes
        low = launches[:, 1] < support_heights(SEGMENT.record, launches[:, 2])
        launches = launches[: int(np.argmax(low)) if low.any() else None]
        rows = simulate_batch(SEGMENT, LAW, slope, launches, settings, keep_rebounds=True).rebounds
        events = np.stack([rows[column] for column in ("feature", "mode", "sequence")])
        others = np.flatnonzero((events != events[:, :1]).any(axis=(0, 2)))
        assert len(others) == 0 if math.isinf(distance) else len(others) > 0
        if len(others):
            assert changes[others[0] - 1] <= distance * (1.0 + 1e-6)
            assert changes[others[0]] >= distance * (1.0 - 1e-6)


def test_on_a_change_of_sequence_the_derivative_is_one_sided_and_says_so() -> None:
    """Oracle: a wheel without spin on rough ground: rolling resistance opposes either spin, so the spin has a kink."""
    law = law_of(0.5, friction=0.3, arm=0.01)
    launch = State(0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    found = sensitivity(
        WHEEL, law, Slope(0.0), launch, Settings(solver="rigid", max_rebounds=1), parameters=["u", "omega"]
    )
    assert found.distances.max() == 0.0  # it stops nothing where it stands
    assert (found.sides == 0).all()
    assert np.isnan(found.rebounds).all()
    sliding = launch._replace(u=2.0)
    found = sensitivity(WHEEL, law, Slope(0.0), sliding, Settings(solver="rigid", max_rebounds=1), parameters=["omega"])
    (side,) = found.sides[0]
    step = 1e-4 * side
    moved = simulate(WHEEL, law, Slope(0.0), sliding._replace(omega=step), solver="rigid", max_rebounds=1)
    slope = (moved.rebounds["omega_after"][0] - found.descent.rebounds["omega_after"][0]) / step
    assert abs(side) == 1
    assert found.distances[0, 0, (1 - side) // 2] == 0.0
    assert found.of_rebounds("omega_after", "omega")[0] == pytest.approx(slope, rel=1e-6)


def test_how_a_descent_ends_counts_as_an_event() -> None:
    """Oracle: it times out in flight at 0.2 s; falling from higher up it still does, from 5 cm less it has touched."""
    found = sensitivity(WHEEL, law_of(0.5), Slope(0.0), State(0.0, 0.75, 0.0, 1.0), Settings(max_time=0.2))
    drop = 0.25 - 0.5 * G * 0.2**2
    assert found.descent.status == "timeout"
    assert found.distances[-1, found.parameters.index("y"), 0] == pytest.approx(drop, rel=1e-7)
    assert found.distances[-1, found.parameters.index("y"), 1] == math.inf
    assert found.of_end("y", "gravity") == pytest.approx(-0.02, rel=1e-9)


# --- at an end of the range of a parameter ----------------------------------------------------------------------------


def test_where_one_zone_begins_at_the_end_of_another_it_may_begin_later() -> None:
    """Oracle: the closed form, with the law's friction between them; the first zone may end earlier."""
    radius, angle, begin, length, speed = 0.5, 0.2, 1.5, 4.0, 3.0
    zones = [Zone(-9.0, begin, 0.0, 0.0), Zone(begin, math.inf, 0.05, 0.0)]
    found = sensitivity(
        disc(3.0, radius),
        law_of(0.5, 0.02),
        Slope(angle, length, zones=zones),
        State(0.0, radius, 0.0, speed),
        Settings(solver="rigid"),
        parameters=["zone_1_end", "zone_2_begin"],
    )
    down, press = G * math.sin(angle), G * math.cos(angle)
    gains = [down - friction * press for friction in (0.0, 0.02, 0.05)]
    u_1 = math.sqrt(speed**2 + 2.0 * gains[0] * begin)
    u_2 = math.sqrt(u_1**2 + 2.0 * gains[2] * (length - begin))
    for column, gain in (("zone_1_end", gains[1] - gains[0]), ("zone_2_begin", gains[1] - gains[2])):
        # A strip of width w in which it gains so much more raises u^2 by 2 gain w from there on.
        earlier = column == "zone_1_end"
        by_width = gain * (1.0 / u_2 - 1.0 / u_1) / gains[2]
        assert found.of_end("t", column) == pytest.approx(-by_width if earlier else by_width, rel=1e-8)
        assert found.of_end("u", column) == pytest.approx((-gain if earlier else gain) / u_2, rel=1e-8)
    assert found.sides.tolist() == [[-1, 1]] * 2


def one_of_many(seed: int) -> tuple[Body, ContactLaw, Slope, State]:
    """Body, law, slope and launch of a descent: some go over bumps, begin without spin, or on the ground."""
    rng, bumpy = np.random.default_rng(seed), seed % 2 == 1
    angular = polygon(5.0, [(0, 0), (0.6, 0), (0.6, 0.4), (0, 0.4)], 0.02) if bumpy else SEGMENT
    body = angular if seed // 2 % 2 else disc(rng.uniform(1.0, 20.0), rng.uniform(0.1, 0.4))
    friction, restitution = rng.uniform(0.02, 0.5), rng.uniform(0.3, 0.9)
    law = ContactLaw.from_restitution(restitution, stiffness=1e6, friction=friction, rolling_arm=0.0)
    along = 0.5 + np.cumsum(rng.uniform(0.5, 1.5, 8))
    bumps = np.column_stack([along, np.r_[0.0, rng.uniform(-0.1, 0.1, 7)]])
    slope = Slope(rng.uniform(0.0, 0.2), 12.0, profile=bumps if bumpy else ())
    phi, spin = rng.uniform(-3.0, 3.0), rng.uniform(-5.0, 5.0) if seed % 3 else 0.0
    y = support_height(body, phi) + (0.3 if seed % 5 else 0.0)
    return body, law, slope, State(0.0, y, phi, rng.uniform(0.5, 3.0), 0.0, spin)


def at_an_end(name: str, law: ContactLaw, slope: Slope, change: float) -> tuple[ContactLaw, Slope]:
    """Law and slope with a parameter that is so much more than the least that it may be, or than the most."""
    if name == "restitution":
        return law._replace(asymmetry=float(asymmetry_of(1.0 + change))), slope
    if not name.startswith("zone_1_"):
        return law._replace(**{name: change}), slope
    fields = {"friction": 0.1, "rolling_arm": 0.01, "restitution": 0.5}
    name = name.removeprefix("zone_1_")
    fields[name] = 1.0 + change if name == "restitution" else change
    return law, slope._replace(zones=[Zone(-1.0, 8.0, **fields)])


def by_hand(run: Any, reach: float) -> np.ndarray:
    """Derivative to one side: differences over seven steps that are halved, in Neville's scheme."""
    steps = reach * 0.5 ** np.arange(7)
    column = [(run(step) - run(0.0)) / step for step in steps]
    for order in range(1, len(steps)):
        column = [fine + (fine - coarse) / (2.0**order - 1.0) for coarse, fine in pairwise(column)]
    return np.asarray(column[0])


@pytest.mark.parametrize(
    ("name", "descents"),
    [
        ("rolling_arm", 25),
        *((name, 10) for name in ("friction", "corner_rolling_arm", "restitution")),
        *((f"zone_1_{name}", 10) for name in ("friction", "rolling_arm", "restitution")),
    ],
)
def test_at_an_end_of_its_range_a_parameter_has_the_derivative_to_the_other_side(name: str, descents: int) -> None:
    """Oracle: one-sided differences of descents over planes and bumps, extrapolated here."""
    settings = Settings(max_rebounds=3)
    side = -1 if name.endswith("restitution") else 1
    for seed in range(descents):
        body, law, slope, launch = one_of_many(seed)
        found = sensitivity(body, *at_an_end(name, law, slope, 0.0), launch, settings, parameters=[name])
        assert (found.sides == side).all(), f"descent {seed}: 0 where some quantity, perhaps a jam metric, has none"
        assert (found.distances[:, 0, (1 - side) // 2] == math.inf).all()

        def run(step: float, given: Any = (body, law, slope, launch)) -> np.ndarray:
            body, law, slope, launch = given
            descent = simulate(body, *at_an_end(name, law, slope, side * step), launch, settings)
            rows = np.stack([descent.rebounds[quantity] for quantity in REBOUND_QUANTITIES], axis=-1)
            return np.r_[rows.ravel(), descent.time, descent.state]

        reach = min(found.distances[-1, 0, (1 + side) // 2] / 4.0, 0.01)
        values = np.r_[found.rebounds[:, :, 0].ravel(), found.end[:7, 0]]
        np.testing.assert_allclose(side * by_hand(run, reach), values, rtol=1e-6, atol=1e-6 * np.abs(values).max())


@pytest.mark.parametrize(("solver", "name"), [("rigid", "y"), ("compliant", "eccentricity")])
def test_where_a_change_makes_a_body_fall_there_is_no_derivative_at_an_end_of_a_range(solver: Any, name: str) -> None:
    """Oracle: a wheel on the ground that begins higher up by h falls, and touches with a speed of sqrt(2 g h).

    On rigid ground it bounces, ever less. On springs it does not, but the time of the touch has no derivative by h.
    """
    wheel, launch = segment(1.0, 0.5, 0.0, 0.1), State(0.0, 0.5, 0.0, 1.0, 0.0, -2.0)
    settings = Settings(solver, max_time=3.0)
    found = sensitivity(wheel, law_of(0.5, 0.3), Slope(0.0), launch, settings, parameters=[name])
    assert (found.sides == 0).all()
    assert np.isnan(found.rebounds).all()
    assert np.isnan(found.end).all()
    assert found.distances[-1, 0].tolist() == [math.inf, 0.0]


# --- zones, rest ------------------------------------------------------------------------------------------------------


def times_into_a_zone(speed: float, gains: tuple[float, float], begin: float, length: float) -> tuple[float, float]:
    """Derivatives of the time [s] over a length by where the second of two accelerations begins, and by that itself.

    t = (u_1 - u_0)/g_1 + (u_2 - u_1)/g_2, u_1^2 = u_0^2 + 2 g_1 begin, u_2^2 = u_1^2 + 2 g_2 (length - begin).
    """
    before, within = gains
    u_1 = math.sqrt(speed**2 + 2.0 * before * begin)
    u_2 = math.sqrt(u_1**2 + 2.0 * within * (length - begin))
    by_begin = 1.0 / u_1 + ((before - within) / u_2 - before / u_1) / within
    return by_begin, (length - begin) / (u_2 * within) - (u_2 - u_1) / within**2


@pytest.mark.parametrize("rolls", [False, True])
def test_the_time_of_a_wheel_that_goes_into_a_zone_by_begin_and_surface(rolls: bool) -> None:
    """Oracle: the closed form; a wheel that slides turns slower than it goes, one that rolls has 3/2 of the mass."""
    radius, angle, begin, length, speed = 0.5, 0.1, 1.5, 4.0, 3.0
    zone = Zone(begin, length, 0.6, 0.02) if rolls else Zone(begin, math.inf, 0.05, 0.0)
    law = law_of(0.5, 0.6, 0.005) if rolls else law_of(0.5)
    launch = State(0.0, radius, 0.0, speed, 0.0, -speed / radius if rolls else 0.0)
    found = sensitivity(disc(3.0, radius), law, Slope(angle, length, zones=[zone]), launch, Settings(solver="rigid"))
    mass = 1.5 if rolls else 1.0
    down, press = G * math.sin(angle) / mass, G * math.cos(angle) / mass
    gains = (down - 0.01 * press, down - 0.04 * press) if rolls else (down, down - 0.05 * press)
    by_begin, by_gain = times_into_a_zone(speed, gains, begin, length)
    assert found.of_end("t", "zone_1_begin") == pytest.approx(by_begin, rel=1e-9)
    friction, arm = (0.0, -press / radius * by_gain) if rolls else (-press * by_gain, None)
    assert found.of_end("t", "zone_1_friction") == pytest.approx(friction, rel=1e-9, abs=1e-12)
    if arm is not None:
        assert found.of_end("t", "zone_1_rolling_arm") == pytest.approx(arm, rel=1e-9)
    assert ("zone_1_end" in found.parameters) == rolls  # a zone without end has none to vary
    assert "zone_2_begin" not in found.parameters


def test_a_body_at_rest_on_its_chord_stays_there_whatever_the_friction() -> None:
    """Oracle: tan(0.1) < 0.9: it rests at once; nothing but its place depends on anything."""
    launch = State(0.0, support_height(SEGMENT, math.pi), math.pi)
    found = sensitivity(SEGMENT, law_of(0.3, 0.9), Slope(0.1, 3.0), launch, Settings(solver="rigid"))
    assert found.descent.status == "jammed"
    assert found.of_end("x", "friction") == 0.0
    assert found.of_end("x", "x") == 1.0
    assert found.distances[-1, found.parameters.index("friction"), 0] == pytest.approx(0.9 - math.tan(0.1), rel=1e-6)


# --- growth -----------------------------------------------------------------------------------------------------------


def test_the_growth_of_a_wheel_without_friction_is_that_of_its_matrix() -> None:
    """Oracle: singular values of the closed-form derivatives of a first rebound, in natural units."""
    drop, e, u, omega = 0.5, 0.6, 2.0, 1.0
    found = sensitivity(
        WHEEL,
        law_of(e),
        Slope(0.0),
        State(0.0, 0.5 + drop, 0.3, u, 0.0, omega),
        Settings(solver="rigid", max_rebounds=1),
    )
    v = math.sqrt(2.0 * G * drop)
    t, by_y, by_v = v / G, 1.0 / v, 1.0 / G  # of the fall, and how it changes
    matrix = np.array(
        [
            [1.0, u * by_y, 0.0, t, u * by_v, 0.0],
            [0.0, omega * by_y, 1.0, 0.0, omega * by_v, t],
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            [0.0, e * G / v, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        ]
    )
    size, speed = 0.5, math.sqrt(G * 0.5)
    units = np.array([size, size, 1.0, speed, speed, speed / size])
    np.testing.assert_allclose(found.units, units)
    scaled = matrix * units / units[[0, 2, 3, 4, 5], np.newaxis]
    np.testing.assert_allclose(found.growth[0], np.linalg.svd(scaled, compute_uv=False), rtol=1e-8)
