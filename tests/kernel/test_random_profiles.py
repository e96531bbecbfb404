"""Random rides over random profiles: energy, endings, and that no touch is missed."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sledenv
from tests.profile_springs import depths, scene
from tests.profiles import BODIES, LEVEL, Case, gravity_of, random_case
from tests.rough_grounds import rough_case

ENDINGS = {"finish", "jammed", "timeout"}
TIME = 6.0  # [s]


def simulated(case: Case, **options: object) -> sledenv.simulation.Descent:
    return sledenv.simulate(*case[1:], max_time=TIME, max_rebounds=4000, **options)  # type: ignore[arg-type]


@pytest.mark.jit_only
@pytest.mark.parametrize("elastic", [True, False], ids=["no losses", "losses"])
@pytest.mark.parametrize("count", [30, pytest.param(5000, marks=pytest.mark.slow)])
def test_descents_end_and_energy_is_kept_or_lost(count: int, elastic: bool) -> None:
    """Oracle: conservation, of every other one over zones with springs of their own. Where the model ends is rare."""
    buried = 0
    for number in range(count):
        case = random_case((21, number), elastic=elastic, zoned=not elastic and number % 2 == 1)
        descent = simulated(case)
        energy, slack = descent.energy, (1e-9 if elastic else 1e-8) * descent.energy.turnover
        assert descent.status in ENDINGS | {"buried"}, case.name
        assert abs(energy.residual) <= slack, case.name
        assert min(energy.hysteresis, energy.sliding, energy.rolling, energy.stored) >= -1e-3 * slack, case.name
        assert energy.lost == pytest.approx(0.0, abs=slack) or not elastic, case.name
        assert (np.diff(descent.rebounds["t"]) >= 0.0).all(), case.name
        buried += descent.status == "buried"
    assert buried <= count // 500


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
        again.trim(later.trim_spin)
    again.hop()
    assert again.descent().outcome == descent.outcome


@pytest.mark.filterwarnings("ignore:.*too finely:UserWarning")
@pytest.mark.parametrize("number", [1261, 1783, 1889, 1909])
def test_the_ledger_closes_where_a_crest_slips_out_of_a_corner(number: int) -> None:
    """Oracle: conservation. The ground is so soft that the weight presses a body in by a fiftieth of its size.

    The contact has to let go, and what is stored in its spring is lost.
    """
    _, body, law, slope, launch = rough_case(78, number)
    softest = body.mass * slope.gravity / (0.02 * body.size)
    soft = law._replace(stiffness=min(law.stiffness, softest))
    energy = sledenv.simulate(body, soft, slope, launch, max_time=3.0, max_rebounds=200).energy
    assert abs(energy.residual) <= 1e-9 * energy.turnover
