"""Zones of a slope against closed forms, and against the slope without zones."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest

import sledenv
from sledenv.simulation.settings import Solver
from sledenv.simulation.support import support_height
from tests import outline_oracle as oracle
from tests.bodies import same_bits, touching
from tests.kernel.test_outlines import KEPT, PRECISION, TURNED, assert_same, block, expected, laid, mirror, simulated

FAST, ALL = 8, 180  # random cases
SEEDS = [seed if seed < FAST else pytest.param(seed, marks=pytest.mark.slow) for seed in range(ALL)]
SOLVERS: list[Solver] = ["compliant", "rigid"]
GRAVITY = 9.81


# --- random zones ----------------------------------------------------------------------------------------------------


def with_zones(case: oracle.Case, solver: Solver, seed: int, most_edges: int = 4) -> oracle.Case:
    """The case with zones that begin where a point touches on the way without any."""
    rng = np.random.default_rng([7, seed])
    outline, free = oracle.Outline(case.body), simulated(case, solver, record="trajectory", sample_interval=1e-3)
    rows = free.trajectory[free.trajectory["normal"] > 0.0] if solver == "compliant" else free.trajectory
    edges = []
    for _ in range(int(rng.integers(1, most_edges + 1))):
        row = rows[rng.integers(len(rows))]
        lowest = outline.lowest_arc(float(row["phi"]))
        arc = int(rng.choice([lowest, lowest, *outline.across([lowest], float(row["phi"]))]))
        a, _ = oracle.arms(case.body.arcs[arc], float(row["phi"]))
        edges.append(float(row["x"]) - a + 1e-3 * outline.size * float(rng.normal()))
    zones = oracle.random_zones(rng, edges, outline.size)
    return case._replace(slope=case.slope._replace(zones=zones))


@pytest.mark.jit_only
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_random_outline_on_random_zones_rebounds_as_in_the_oracle(seed: int, solver: Solver) -> None:
    """Oracle: scipy and plain formulas, each point in a zone of its own."""
    case = with_zones(oracle.random_case(5000 + seed), solver, seed)
    descent = simulated(case, solver)
    assert abs(descent.energy.residual) <= 1e-11 * descent.energy.turnover
    assert min(descent.energy.hysteresis, descent.energy.sliding, descent.energy.rolling) >= 0.0
    try:
        wanted = expected(case, solver)
    except oracle.Unsupported:
        return  # more than two points touch
    if solver == "compliant" and simulated(case, solver, record="trajectory").trajectory["touching"].max() > 2:
        return  # the oracle passes over a third point
    assert abs(wanted.residual) <= 1e-11 * wanted.turnover
    assert_same(descent, wanted, case, PRECISION)


@pytest.mark.slow
def test_the_random_zones_are_passed_in_all_kinds_of_contact(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: itself. Points pass on alone and two at a time, both ways, sliding and rolling, or lie in two zones."""
    seen: set[str] = set()
    points_after = oracle._points_after

    def watched(surface: Any, branch: oracle.Branch, q: np.ndarray, name: str) -> Any:
        if name[:-1] in ("back", "ahead"):
            seen.update((name[:-1], f"{len(branch.points)} points", "rolls" if 0 in branch.slips else "slides"))
        if len({point.zone for point in branch.points}) > 1:
            seen.add("two zones")
        return points_after(surface, branch, q, name)

    monkeypatch.setattr(oracle, "_points_after", watched)
    for seed in (0, 1, 2, 3, 5, 6, 7, 8):
        expected(with_zones(oracle.random_case(5000 + seed), "compliant", seed), "compliant")
    assert seen == {"back", "ahead", "1 points", "2 points", "rolls", "slides", "two zones"}


@pytest.mark.jit_only
@pytest.mark.parametrize("solver", SOLVERS)
def test_the_mirror_image_passes_the_mirrored_zones(solver: Solver) -> None:
    """Oracle: x turned round, zones [begin, end] become [-end, -begin]."""
    for seed in range(20):
        case = with_zones(oracle.random_case(6000 + seed), solver, seed)
        if case.slope.zones and case.slope.zones[-1].end == math.inf:  # none begins at -inf
            zones = (*case.slope.zones[:-1], case.slope.zones[-1]._replace(end=1e3))
            case = case._replace(slope=case.slope._replace(zones=zones))
        one, image = (simulated(each, solver, max_rebounds=20) for each in (case, mirror(case)))
        assert str(one.status) == str(image.status), seed
        for name in KEPT:
            np.testing.assert_array_equal(one.rebounds[name], image.rebounds[name], err_msg=f"{seed}, {name}")
        for name in TURNED:
            np.testing.assert_array_equal(one.rebounds[name], -image.rebounds[name], err_msg=f"{seed}, {name}")


# --- closed forms ----------------------------------------------------------------------------------------------------

LAW = sledenv.ContactLaw(1e9, 0.5, 0.1, 0.0)


class Block(NamedTuple):
    """A block that slides on its two ends."""

    ahead: float  # [m] of the mass centre
    behind: float  # [m]
    height: float  # [m] of the mass centre
    angle: float  # [rad]
    zones: list[sledenv.Zone]

    def friction(self, place: float) -> float:
        return next((zone.friction for zone in self.zones if zone.begin <= place < zone.end), LAW.friction)

    def gain(self, x: float, way: float) -> float:
        """Acceleration [m/s^2] where it slides one way, 1 or -1.

        Loads balance the moments: ahead N_1 - behind N_2 = way height (f_1 N_1 + f_2 N_2).
        """
        f_1, f_2 = self.friction(x + self.ahead), self.friction(x - self.behind)
        lever_1, lever_2 = self.ahead - way * self.height * f_1, self.behind + way * self.height * f_2
        mean = (f_1 * lever_2 + f_2 * lever_1) / (lever_1 + lever_2)
        return GRAVITY * (math.sin(self.angle) - way * mean * math.cos(self.angle))

    def slid(self, x: float, speed: float, to: float) -> tuple[float, float, float]:
        """Time [s] until it reaches a place or stops, where it is then, and its speed [m/s]."""
        way, time = math.copysign(1.0, to - x), 0.0
        edges = {edge + arm for zone in self.zones for edge in zone[:2] for arm in (-self.ahead, self.behind)}
        between = [edge for edge in edges if min(x, to) < edge < max(x, to)]
        for begin, end in pairwise(sorted([x, *between, to], reverse=way < 0.0)):
            gain, length = way * self.gain(0.5 * (begin + end), way), abs(end - begin)
            square = speed * speed + 2.0 * gain * length
            if square <= 0.0:
                return time - speed / gain, begin - way * 0.5 * speed * speed / gain, 0.0
            faster = math.sqrt(square)
            time, speed = time + 2.0 * length / (speed + faster), faster
        return time, to, speed


ZONES = [
    sledenv.Zone(0.9, 1.1, 0.45, 0.0),
    sledenv.Zone(1.7, 2.4, 0.0, 0.0),
    sledenv.Zone(2.4, 3.1, 0.3, 0.0),
]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(("width", "offset"), [(0.4, 0.0), (0.4, 0.06), (1.0, -0.1)])
def test_a_block_slides_on_its_ends_from_zone_to_zone(width: float, offset: float, solver: Solver) -> None:
    """Oracle: a constant acceleration between the crossings of either end; the work of friction."""
    height, angle, speed, length = 0.3, 0.1, 2.5, 4.0
    body, slope = block(width, height, offset), sledenv.Slope(angle, length, GRAVITY, ZONES)
    descent = sledenv.simulate(body, LAW, slope, laid(body, 0.0, speed), solver=solver)
    sliding = Block(0.5 * width - offset, 0.5 * width + offset, 0.5 * height, angle, ZONES)
    time, _, faster = sliding.slid(0.0, speed, length)
    near = 1e-12 if solver == "rigid" else 1e-6
    assert str(descent.status) == "finish"
    assert descent.time == pytest.approx(time, rel=near)
    assert descent.state.u == pytest.approx(faster, rel=near)
    assert descent.state.phi == pytest.approx(0.0, abs=near)
    lost = body.mass * (GRAVITY * math.sin(angle) * length + 0.5 * (speed**2 - faster**2))
    assert descent.energy.sliding == pytest.approx(lost, rel=near)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_block_slides_uphill_into_a_zone_and_back_out_of_it(solver: Solver) -> None:
    """Oracle: constant accelerations up to where it turns round in the zone, and from there on."""
    body, angle, zones = block(0.4, 0.2), 0.4, [sledenv.Zone(-9.0, -1.0, 0.2, 0.0)]
    slope, sliding = sledenv.Slope(angle, 0.5, GRAVITY, zones), Block(0.2, 0.2, 0.1, angle, zones)
    descent = sledenv.simulate(body, LAW, slope, laid(body, 0.0, -5.0), solver=solver)
    rising, top, _ = sliding.slid(0.0, 5.0, -9.0)
    falling, _, speed = sliding.slid(top, 0.0, 0.5)
    assert top < -1.2
    near = 1e-12 if solver == "rigid" else 1e-6
    assert str(descent.status) == "finish"
    assert descent.time == pytest.approx(rising + falling, rel=near)
    assert descent.state.u == pytest.approx(speed, rel=near)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("friction", [0.25, 0.7])
def test_a_block_comes_to_rest_where_a_zone_holds_it(friction: float, solver: Solver) -> None:
    """Oracle: it stops with one end in the zone or with both, and stays, as both their frictions hold it there."""
    body, angle, zones = block(0.4, 0.2), 0.15, [sledenv.Zone(1.0, 5.0, friction, 0.0)]
    slope, speed = sledenv.Slope(angle, 9.0, GRAVITY, zones), 1.2
    descent = sledenv.simulate(body, LAW, slope, laid(body, 0.0, speed), solver=solver)
    time, place, _ = Block(0.2, 0.2, 0.1, angle, zones).slid(0.0, speed, 5.0)
    assert (place < 1.2) == (friction > 0.5)  # one end
    assert str(descent.status) == "jammed"
    assert descent.state.x == pytest.approx(place, rel=1e-12 if solver == "rigid" else 1e-6)
    assert descent.time == pytest.approx(time, rel=1e-12 if solver == "rigid" else 1e-6)


def on_wheel(angle: float, zones: list[sledenv.Zone], speed: float, length: float, **options: Any) -> sledenv.Descent:
    """A uniform disc of radius .5 m that rolls."""
    slope, body = sledenv.Slope(angle, length, GRAVITY, zones), sledenv.disc(3.0, 0.5)
    law = sledenv.ContactLaw(1e10, 0.5, 0.5, 0.005)
    return sledenv.simulate(body, law, slope, sledenv.State(0.0, 0.5, 0.0, speed, 0.0, -speed / 0.5), **options)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_wheel_rolls_into_a_zone_with_another_rolling_arm(solver: Solver) -> None:
    """Oracle: (m + J/r^2) du/dt = m g (sin(beta) - (delta/r) cos(beta)); its slip stays zero."""
    angle, speed, length = 0.05, 2.0, 4.0
    zones = [sledenv.Zone(1.0, 2.5, 0.3, 0.06), sledenv.Zone(2.5, 3.0, 0.5, 0.0)]
    u, time = speed, 0.0
    for way, arm in ((1.0, 0.005), (1.5, 0.06), (0.5, 0.0), (1.0, 0.005)):
        gain = GRAVITY * (math.sin(angle) - arm / 0.5 * math.cos(angle)) / 1.5
        faster = math.sqrt(u * u + 2.0 * gain * way)
        u, time = faster, time + 2.0 * way / (u + faster)
    descent = on_wheel(angle, zones, speed, length, solver=solver)
    near = 1e-12 if solver == "rigid" else 1e-6
    assert descent.time == pytest.approx(time, rel=near)
    assert descent.state.u == pytest.approx(u, rel=near)
    assert descent.state.omega == pytest.approx(-u / 0.5, rel=near)
    assert descent.energy.sliding == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_wheel_starts_to_slip_where_a_zone_is_too_slippery_and_rolls_again_behind_it(solver: Solver) -> None:
    """Oracle: du/dt = g (sin - f cos), J domega/dt = -(r f - delta) N while it slips; then it sticks and rolls."""
    angle, speed, radius, arm, ice = 0.3, 1.0, 0.5, 0.005, 0.02
    down, press = GRAVITY * math.sin(angle), GRAVITY * math.cos(angle)
    inertia = 0.5 * radius**2  # over the mass

    def reached(u: float, gain: float, way: float) -> tuple[float, float]:
        faster = math.sqrt(u * u + 2.0 * gain * way)
        return faster, 2.0 * way / (u + faster)

    rolling = (down - arm / radius * press) / 1.5
    u, time = reached(speed, rolling, 1.0)
    rim = u  # [m/s] -r omega
    # In the zone
    faster, lasted = reached(u, down - ice * press, 2.0)
    rim += radius * (radius * ice - arm) * press / inertia * lasted
    u, time, way = faster, time + lasted, 3.0
    assert rim < u
    # Behind it friction is large, until the rim is as fast as the wheel.
    gain, spinning = down - 0.5 * press, radius * (radius * 0.5 - arm) * press / inertia
    lasted = (u - rim) / (spinning - gain)
    way, u, time = way + u * lasted + 0.5 * gain * lasted**2, u + gain * lasted, time + lasted
    assert way < 6.0
    u, lasted = reached(u, rolling, 6.0 - way)
    time += lasted
    near = 1e-12 if solver == "rigid" else 1e-6
    descent = on_wheel(angle, [sledenv.Zone(1.0, 3.0, ice, arm)], speed, 6.0, solver=solver)
    assert descent.time == pytest.approx(time, rel=near)
    assert descent.state.u == pytest.approx(u, rel=near)
    assert descent.state.omega == pytest.approx(-u / radius, rel=near)


# --- what changes nothing --------------------------------------------------------------------------------------------

BODIES = {
    "disc": sledenv.disc(3.0, 0.5, 0.2, 0.3),
    "segment": sledenv.circular_segment(100.0, 0.5, 1.9),
    "polygon": sledenv.polygon(2.0, [(0.5, -0.2), (-0.4, -0.2), (-0.3, 0.3), (0.4, 0.2)]),
    "sled": sledenv.sled(),
}
SNOW = sledenv.ContactLaw(1e6, 0.4, 0.2, 0.004, 0.002)


def dropped(body: sledenv.Body, phi: float = 0.2, u: float = 5.0, omega: float = 1.0) -> sledenv.State:
    return sledenv.State(0.0, support_height(body, phi) + 0.3, phi, u, -1.0, omega)


def touched(body: sledenv.Body, descent: sledenv.Descent) -> np.ndarray:
    """Where contacts began and ended along the slope [m], shape (N, 2)."""
    left = [one["x"] - touching(body, float(one["phi"]))[1] for one in descent.rebounds]
    return np.column_stack([descent.rebounds["x_contact"], left])


def assert_close(one: sledenv.Descent, other: sledenv.Descent) -> None:
    """Rebounds but for rounding."""
    assert len(one.rebounds) == len(other.rebounds)
    for name in ("t", "x", "phi", "u_after", "v_after", "omega_after", "loss_sliding", "loss_rolling"):
        scale = 1.0 + np.abs(one.rebounds[name])
        np.testing.assert_allclose(one.rebounds[name] / scale, other.rebounds[name] / scale, rtol=0, atol=1e-12)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", BODIES)
def test_zones_that_are_like_the_law_change_nothing(name: str, solver: Solver) -> None:
    """Oracle: the descent without zones: rebounds but for rounding, and bit for bit if no zone is touched."""
    body = BODIES[name]
    slope = sledenv.Slope(0.2, 50.0, GRAVITY)
    own = SNOW[2:]
    options: dict[str, Any] = {"solver": solver, "max_rebounds": 3}
    one = sledenv.simulate(body, SNOW, slope, dropped(body), **options)
    places = np.sort(touched(body, one), axis=None)
    inside = (0.5 * (places[1:] + places[:-1])).tolist()
    zones = [sledenv.Zone(begin, end, *own) for begin, end in pairwise([-3.0, *inside, 40.0])]
    assert_close(one, sledenv.simulate(body, SNOW, slope._replace(zones=zones), dropped(body), **options))
    behind, beyond = sledenv.Zone(-9.0, -5.0, 0.9, 0.1), sledenv.Zone(45.0, 50.0, 0.9, 0.1)
    for far in ([behind], [beyond], [behind, beyond._replace(end=math.inf)]):
        other = sledenv.simulate(body, SNOW, slope._replace(zones=far), dropped(body), **options)
        same_bits(one.outcome, other.outcome)
        same_bits(one.rebounds, other.rebounds)


# --- boundaries, whatever way places are rounded ----------------------------------------------------------------------

BOX = sledenv.polygon(2.0, [(0.2, -0.1), (-0.2, -0.1), (-0.2, 0.1), (0.2, 0.1)])
SMOOTH = sledenv.ContactLaw(1e8, 0.6, 0.0, 0.0)
SHIFTS = np.random.default_rng(11).uniform(0.1, 3.0, 12).tolist()


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
@pytest.mark.parametrize("friction", [0.4, 2.5])
def test_a_block_that_slides_off_ice_does_the_same_wherever_the_ice_ends(friction: float, solver: Solver) -> None:
    """Oracle: the slope looks the same everywhere. At f = 2.5 the block tips over the end ahead: f > l/b = 2."""
    length = 0.2  # [m] of the block ahead of its mass centre
    given: dict[str, Any] = {"solver": solver, "max_time": 1.3, "record": "trajectory"}
    ends = []
    for shift in [0.0, *SHIFTS]:
        zone = sledenv.Zone(1.0 + length + shift, math.inf, friction, 0.0)
        launch = sledenv.State(shift, support_height(BOX, 0.0), 0.0, 1.0)
        descent = sledenv.simulate(BOX, SMOOTH, sledenv.Slope(0.1, zones=[zone]), launch, **given)
        assert str(descent.status) in ("timeout", "jammed")
        assert abs(descent.energy.residual) <= 1e-12 * descent.energy.turnover
        assert (np.abs(descent.trajectory["phi"]).max() > 1e-3) == (friction > 2.0)
        ends.append((descent.state.x - shift, *descent.state[1:]))
    np.testing.assert_allclose(ends, np.tile(ends[0], (len(ends), 1)), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_point_is_thrown_up_by_the_zone_that_it_enters(sign: float) -> None:
    """Oracle: uphill or down, the spin is the one that friction of the zone gives, and the ledger closes."""
    for shift in SHIFTS:
        edges = (1.2 + shift, 9.0) if sign > 0.0 else (-9.0, -1.2 - shift)
        launch = sledenv.State(sign * shift, support_height(BOX, 0.0), 0.0, sign)
        slope = sledenv.Slope(sign * 0.1, zones=[sledenv.Zone(*edges, 2.5, 0.0)])
        descent = sledenv.simulate(BOX, SMOOTH, slope, launch, solver="rigid", max_time=3.0, max_rebounds=2)
        assert str(descent.status) == "log_full"
        first = descent.rebounds[0]
        assert first["omega_after"] * sign < 0.0
        assert first["loss_sliding"] > 0.0
        assert abs(descent.energy.residual) <= 1e-12 * descent.energy.turnover
