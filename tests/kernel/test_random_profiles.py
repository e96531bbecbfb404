"""Random rides over random profiles and planes: energy, the ledger, endings, and how deep bodies are in the ground."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import islice

import numpy as np
import pytest

import sledenv
from tests.profile_springs import depths, scene
from tests.profiles import BODIES, LEVEL, Case, gravity_of, random_case, throws

ENDINGS = {"finish", "jammed", "timeout"}
TIME = 6.0  # [s]
# Rides on which a sketch of the engine lost a contact or missed the birth of one, so that the body sank in the ground.
SUNK = (47, 90, 154, 168, 206, 208, 235, 249, 265, 284)
# Rides on which an arc of the sled comes over a piece that it is in already, beside a crest under the side next to it.
# It moves out, so it gets no spring, and may be deeper than the crest's spring is pressed at that time.
BESIDE_CREST = {772, 870}
# Throws on which it stalled or lost energy: three points, a slip released as its load vanishes, a
# crest deeper in the body than the radius of the arc that it passes to.
THROWS = [(5, False, 22), (5, False, 80), (5, False, 454), (7, True, 895)]


def simulated(case: Case, **options: object) -> sledenv.Descent:
    return sledenv.simulate(*case[1:], max_time=TIME, max_rebounds=4000, **options)  # type: ignore[arg-type]


def mechanical(case: Case, state: sledenv.State) -> float:
    """Kinetic and potential energy [J]."""
    x, y, _, u, v, omega = state
    fall = case.slope.gravity * (y * math.cos(case.slope.angle) - x * math.sin(case.slope.angle))
    return case.body.mass * (0.5 * (u * u + v * v) + fall) + 0.5 * case.body.inertia * omega * omega


def softest(case: Case) -> float:
    """Smallest stiffness [N/m] of a spring that opens, among those of the law and of the zones."""
    found = []
    for own in (case.law, *case.slope.zones):
        restitution = case.law.restitution if own.restitution is None else own.restitution
        stiffness = case.law.stiffness if own.stiffness is None else own.stiffness
        found.append(2.0 * stiffness * restitution**2 / (1.0 + restitution**2))
    return min(found)


def check(case: Case, descent: sledenv.Descent, residual: float) -> None:
    """Everything that must hold of any descent: oracle, conservation of energy."""
    assert descent.status in ENDINGS | {"buried"}, case.name
    assert all(map(math.isfinite, descent.state)), case.name
    energy = descent.energy
    assert abs(energy.residual) <= residual * energy.turnover, case.name
    assert min(energy.hysteresis, energy.sliding, energy.rolling, energy.stored) >= -1e-12 * energy.turnover, case.name
    found = mechanical(case, descent.state)
    assert found == pytest.approx(energy.kinetic + energy.potential, rel=1e-9, abs=1e-9 * energy.turnover), case.name
    assert energy.initial == pytest.approx(mechanical(case, case.launch), rel=1e-9, abs=1e-9 * energy.turnover)
    if descent.status != "buried":  # springs that store so much are pressed so deep at most
        tables = scene(case.body, list(case.slope.profile) or LEVEL)
        deepest = depths(tables, np.array([descent.state[:3]]), case.body.size)[0, 0]
        assert deepest <= math.sqrt(2.0 * max(energy.stored, 0.0) / softest(case)) + 1e-9 * case.body.size, case.name
    rows = descent.rebounds
    for name in rows.dtype.names:
        assert np.isfinite(rows[name]).all(), (case.name, name)
    assert (np.diff(rows["t"]) >= 0.0).all(), case.name


@pytest.mark.jit_only
@pytest.mark.parametrize("count", [15, pytest.param(2000, marks=pytest.mark.slow)])
def test_energy_is_kept_without_losses(count: int) -> None:
    """Oracle: conservation, e = 1 and f = 0, to 1e-9 of what was turned over. Where the model ends is rare."""
    buried = 0
    for number in range(count):
        case = random_case((21, number), elastic=True)
        descent = simulated(case)
        check(case, descent, 1e-9)
        energy = descent.energy
        assert energy.lost == pytest.approx(0.0, abs=1e-9 * energy.turnover), case.name
        kept = mechanical(case, descent.state) + energy.stored - energy.initial
        assert abs(kept) <= 1e-9 * energy.turnover, case.name
        buried += descent.status == "buried"
    assert buried <= count // 500


@pytest.mark.jit_only
@pytest.mark.parametrize("count", [30, pytest.param(20_000, marks=pytest.mark.slow)])
def test_launches_end_as_something_physical(count: int) -> None:
    """Oracle: conservation, with friction, rolling and, of every other one, zones with springs of their own."""
    buried = 0
    for number in range(count):
        case = random_case((23, number), zoned=number % 2 == 1)
        descent = simulated(case)
        check(case, descent, 1e-8)
        buried += descent.status == "buried"
    assert buried <= count // 1000


@pytest.mark.parametrize(("seed", "elastic", "number"), THROWS)
def test_throws_that_are_hard_end_as_something_physical(seed: int, elastic: bool, number: int) -> None:
    """Oracle: conservation, to the end."""
    case = next(islice(throws(seed, elastic=elastic), number, None))
    descent = simulated(case)
    check(case, descent, 1e-9 if elastic else 1e-8)
    assert descent.status in ENDINGS | ({"buried"} if number == 895 else set())


@pytest.mark.slow
@pytest.mark.jit_only
@pytest.mark.parametrize(("seed", "elastic"), [(5, False), (7, True)])
def test_throws_end_as_something_physical(seed: int, elastic: bool) -> None:
    """Oracle: conservation; a thousand of each kind."""
    found = []
    for case in islice(throws(seed, elastic=elastic), 1000):
        descent = simulated(case)
        check(case, descent, 1e-9 if elastic else 1e-8)
        found.append(descent.status)
    assert found.count("buried") <= 2


def flown(case: Case, times: np.ndarray) -> np.ndarray:
    """Poses (N, 3) of x, y, phi in free flight from the launch."""
    x, y, phi, u, v, omega = case.launch
    along, down = gravity_of(case.slope)
    return np.column_stack(
        [x + times * (u + 0.5 * along * times), y + times * (v + 0.5 * down * times), phi + omega * times]
    )


def check_first_touch(case: Case) -> None:
    """Nothing touches before the first contact begins, and something does right after."""
    descent = sledenv.simulate(*case[1:], max_time=TIME, max_rebounds=1)
    touched = descent.rebounds[0]["t_touchdown"] if len(descent.rebounds) else descent.time
    tables = scene(case.body, list(case.slope.profile) or LEVEL)
    before = depths(tables, flown(case, np.linspace(0.0, touched, 2000)[:-1]), case.body.size)
    assert before.max() == 0.0, case.name
    if len(descent.rebounds):
        row = descent.rebounds[0]
        closing = max(abs(row["v_before"]), abs(row["u_before"]), case.body.size * abs(row["omega_before"]), 1.0)
        just = depths(tables, flown(case, np.array([touched - 1e-10, touched + 1e-6])), case.body.size).max(axis=1)
        assert 0.0 == just[0] < just[1] < 2e-5 * closing, case.name


@pytest.mark.jit_only
@pytest.mark.parametrize("count", [80, pytest.param(5000, marks=pytest.mark.slow)])
def test_a_flight_ends_where_the_outline_first_meets_the_ground(count: int) -> None:
    """Oracle: geometry at 2,000 times of the flight in closed form: no touch is missed, a crest in passing neither."""
    for number in range(count):
        check_first_touch(random_case((26, number), length=math.inf))


RIDGES = [
    (-2.44, 0.05),
    (-1.48, 1.54),
    (-0.96, 0.81),
    (-0.1, 0.96),
    (0.43, 1.83),
    (0.92, 0.91),
    (1.23, 1.88),
    (2.12, 2.05),
]
FLIGHTS = {
    "down in a dip that turns by more than a right angle": (
        "sled", [(-1.0, 0.0), (-0.5, -0.5), (0.0, -0.75), (0.25, -0.25)], 0.0, (0.0, 1.7, 2.0, 0.0, 1.0, 10.0)
    ),
    "beside a ridge of 48 degrees, not from behind": (
        "triangle", [*RIDGES, (2.59, 0.86), (3.31, 2.26)], 0.128, (0.57, 3.4, -1.578, -1.5, 0.47, 4.25)
    ),
    "over sharp bumps, spinning fast": (
        "hexagon", [(0.3 * k - 3.0, 0.2 * (k % 2)) for k in range(21)], 0.1, (-1.0, 0.8, 0.3, 4.0, 1.0, -40.0)
    ),
    "the same the other way": (
        "block", [(0.3 * k - 3.0, 0.2 * (k % 2)) for k in range(21)], 0.1, (-1.0, 1.0, 0.3, 4.0, 1.0, 40.0)
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_ends_in_time(name: str) -> None:
    """Oracle: geometry at 2,000 times of the flight."""
    kind, profile, angle, launch = FLIGHTS[name]
    slope = sledenv.Slope(angle, profile=profile)
    check_first_touch(Case(name, BODIES[kind], sledenv.ContactLaw(1e7, 0.5, 0.3, 0.0), slope, sledenv.State(*launch)))


@pytest.mark.parametrize(("above", "touches"), [(-1e-9, 1), (1e-9, 0)])
def test_a_body_that_only_grazes_a_crest_is_seen(above: float, touches: int) -> None:
    """Oracle: a disc whose path lies a hair below the top of a crest touches it; a hair above it does not."""
    slope = sledenv.Slope(0.0, gravity=0.0, profile=[(-1.0, 0.0), (0.0, 1.0), (1.0, 0.0)])
    launch = sledenv.State(-0.2, 1.3 + above, 0.0, 4.0, 0.0, 5.0)
    law = sledenv.ContactLaw(1e7, 0.5, 0.3, 0.0)
    assert len(sledenv.simulate(BODIES["disc"], law, slope, launch, max_time=0.1).rebounds) == touches


def sunk(number: int) -> tuple[str, float, float]:
    """How much deeper arcs are in pieces, and crests in the body, than springs are pressed [sizes].

    A spring is pressed by N/k_open at most. A crest that comes into reach with a depth is deeper than its spring by
    that, which was the depth of the arc beside it: for crests the deepest that springs have been pressed counts. For
    arcs it counts in the rides of ``BESIDE_CREST`` alone.
    """
    case = random_case((24, number))
    descent = simulated(case, record="trajectory")
    rows = descent.trajectory
    pressed = rows["contacts"]["normal"].sum(axis=1) / (case.law.stiffness * (1.0 - case.law.asymmetry))
    tables = scene(case.body, list(case.slope.profile) or LEVEL)
    poses = np.column_stack([rows["x"], rows["y"], rows["phi"]])
    arcs, crests = depths(tables, poses, case.body.size).T / case.body.size
    pressed /= case.body.size
    deepest = np.maximum.accumulate(pressed)
    allowed = deepest if number in BESIDE_CREST else pressed
    return case.name, float((arcs - allowed).max()), float((crests - deepest).max())


FEW = [*range(10), *SUNK, *sorted(BESIDE_CREST)]


@pytest.mark.jit_only
@pytest.mark.parametrize("numbers", [FEW, pytest.param(range(1000), marks=pytest.mark.slow)], ids=["few", "many"])
def test_no_point_is_deeper_in_the_ground_than_springs_are_pressed(numbers: Iterable[int]) -> None:
    """Oracle: geometry of outline and ground, tests/profile_springs.py."""
    assert [found for found in map(sunk, numbers) if max(found[1:]) > 1e-9] == []


@pytest.mark.parametrize("number", range(3))
def test_the_ledger_closes_over_a_profile_with_trims(number: int) -> None:
    """Oracle: conservation, the work of the rider's rotor among what is counted; a copy goes on to the same bits."""
    case = random_case((27, number), planes=False)
    ride = sledenv.Ride(*case[1:], sledenv.Settings(max_time=TIME), rotor_inertia=2.0)
    copies = []
    while ride.status == "running":
        ride.trim((-1.0) ** len(copies) * 0.5)
        copies.append(ride.copy())
        ride.hop()
    descent = ride.descent()
    assert abs(descent.energy.residual) <= 1e-9 * descent.energy.turnover
    again = copies[len(copies) // 2]
    for later in copies[len(copies) // 2 + 1 :]:
        again.hop()
        again.trim(later.lent)
    again.hop()
    assert again.descent().outcome == descent.outcome
