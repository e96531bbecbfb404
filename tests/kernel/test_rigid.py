"""The impact in normal impulse against an exact oracle, published closed forms, and what energy allows."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from sledenv.kernel.contacts import IMPACT
from sledenv.kernel.impact import ENERGETIC, MOST_PHASES, NEWTON, POISSON, impact
from sledenv.kernel.records import PHASE
from tests.oracles import ImpactResult, rational_impact, wang_mason

HYPOTHESES = {"energetic": ENERGETIC, "poisson": POISSON, "newton": NEWTON}

# Columns of a case: what an impact is told.
MASS, INERTIA, A, B, SIZE, FRICTION, ARM, RESTITUTION, V_T, OMEGA, V_N = range(11)
GIVEN = ("a", "b", "size", "friction", "rolling_arm", "restitution", "v_t", "omega", "v_n")
IMPULSES = ("normal_impulse", "tangential_impulse", "rolling_impulse")
FOUND = ("v_t", "omega", "v_n", *IMPULSES, "hysteresis", "sliding", "rolling")


def random_impacts(n: int, seed: int) -> np.ndarray:
    """Bodies with h up to 0.95 r, rods and wheels; f up to 3; large and small delta; exact zeros of everything."""
    rng = np.random.default_rng(seed)

    def scaled(*shares: tuple[float, float]) -> np.ndarray:
        factors, weights = zip(*shares, strict=True)
        return rng.choice(factors, n, p=weights)

    r = rng.uniform(0.05, 0.5, n) * scaled((0.0, 0.1), (1.0, 0.9))
    h = np.where(r > 0.0, r * rng.uniform(0.0, 0.95, n) * scaled((0.0, 0.05), (1.0, 0.95)), rng.uniform(0.1, 1.0, n))
    size = r + h
    mass = 10.0 ** rng.uniform(-1, 2, n)
    inertia = mass * size**2 * 10.0 ** rng.uniform(-1.5, 0.0, n)
    phi = rng.uniform(-math.pi, math.pi, n) * scaled((0.0, 0.05), (1.0, 0.95))
    a, b = h * np.sin(phi), r - h * np.cos(phi)
    b = np.where(rng.random(n) < 0.03, 0.0, b)
    f = rng.uniform(0.0, 3.0, n) * scaled((0.0, 0.1), (0.2, 0.4), (1.0, 0.5))
    delta = size * rng.uniform(0.0, 1.0, n) * scaled((0.0, 0.15), (0.1, 0.55), (1.0, 0.2), (3.0, 0.1))
    e = np.select([(share := rng.random(n)) < 0.1, share < 0.2], [0.0, 1.0], rng.random(n))
    v_t = rng.normal(size=n) * scaled((0.0, 0.15), (1.0, 0.45), (5.0, 0.4))
    omega = rng.normal(size=n) / size * scaled((0.0, 0.15), (1.0, 0.45), (5.0, 0.4))
    v_n = -np.abs(rng.normal(size=n)) * scaled((0.0, 0.05), (0.2, 0.15), (1.0, 0.5), (5.0, 0.3))
    return np.stack([mass, inertia, a, b, size, f, delta, e, v_t, omega, v_n], axis=1)


def coarse_impacts(n: int, seed: int) -> np.ndarray:
    """Impacts from a coarse grid of dyadic numbers: zeros, ties and simultaneous events, exactly."""
    rng = random.Random(seed)
    columns = (
        (1.0, 2.0),
        (0.125, 0.25, 0.5, 1.0),
        (-1.0, -0.5, 0.0, 0.25, 0.5, 1.0),
        (-0.5, 0.0, 0.25, 0.5, 1.0),
        (1.0,),
        (0.0, 0.25, 0.5, 1.0, 2.0, 3.0),
        (0.0, 0.125, 0.25, 0.5, 1.0, 2.0),
        (0.0, 0.5, 1.0),
        (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0),
        (-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0),
        (0.0, -0.5, -1.0, -2.0),
    )
    return np.array([[rng.choice(values) for values in columns] for _ in range(n)])


def solve(case: list[float], hypothesis: int = ENERGETIC, phases: np.ndarray | None = None) -> tuple:
    """Velocities, impulses and losses of one impact, and the number of its phases."""
    hit = np.zeros(1, IMPACT)[0]
    hit["per_mass"], hit["per_inertia"] = 1.0 / case[MASS], 1.0 / case[INERTIA]
    for name, value in zip(GIVEN, case[A:], strict=True):
        hit[name] = value
    count = impact(hypothesis, hit, phases)
    return *(float(hit[name]) for name in FOUND), count


def oracle(case: list[float], hypothesis: str = "energetic") -> ImpactResult:
    return rational_impact(*case[:SIZE], *case[FRICTION:], hypothesis=hypothesis)


def scales(case: list[float]) -> tuple[float, float]:
    """Largest speed of entry [m/s], 1 if there is none, and the size of the body [m]."""
    return max(abs(case[V_T]), abs(case[OMEGA]) * case[SIZE], abs(case[V_N])) or 1.0, case[SIZE]


def kinetic(case: list[float], v_t: float, omega: float, v_n: float) -> float:
    """Kinetic energy [J] of contact velocities."""
    u, v = v_t - case[B] * omega, v_n + case[A] * omega
    return 0.5 * case[MASS] * (u * u + v * v) + 0.5 * case[INERTIA] * omega * omega


def worst_error(case: list[float], found: tuple, expected: ImpactResult) -> float:
    """Largest error of velocities and impulses in units of the speed of entry, and of losses in its square."""
    speed, size = scales(case)
    momentum = case[MASS] * speed
    units = (speed, speed / size, speed, momentum, momentum, momentum * size, *[momentum * speed] * 3)
    return max(abs(p - q) / unit for p, q, unit in zip(found[:9], expected[:9], units, strict=True))


# --- against the exact oracle ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [200, pytest.param(20_000, marks=pytest.mark.slow)])
def test_an_impact_agrees_with_exact_fractions(n: int) -> None:
    """Oracle: tests.oracles.rational_impact; the phases are the same too."""
    phases = np.zeros(MOST_PHASES, PHASE)
    for case in random_impacts(n, seed=n).tolist():
        expected = oracle(case)
        found = solve(case, phases=phases)
        assert worst_error(case, found, expected) < 1e-12, case
        signs = [(row["slip"], row["spin"], bool(row["restitution"])) for row in phases[: found[9]]]
        assert signs == [(phase.slip, phase.spin, phase.opening) for phase in expected.phases], case


@pytest.mark.parametrize("n", [100, pytest.param(2000, marks=pytest.mark.slow)])
def test_other_hypotheses_ties_and_simultaneous_events_agree_with_exact_fractions(n: int) -> None:
    """Oracle: rational_impact; ties are on a grid where locks sit exactly on their bounds, phases may differ there."""
    for case in random_impacts(n, seed=1).tolist():
        for hypothesis in ("poisson", "newton"):
            assert worst_error(case, solve(case, HYPOTHESES[hypothesis]), oracle(case, hypothesis)) < 1e-12, case
    for case in coarse_impacts(2 * n, seed=2).tolist():
        assert worst_error(case, solve(case), oracle(case)) < 1e-13, case


# --- restitution -----------------------------------------------------------------------------------------------------


def test_poisson_without_rolling_resistance_agrees_with_wang_and_mason() -> None:
    """Published: Wang and Mason (1992), closed forms of every contact mode for Poisson's hypothesis."""
    cases = random_impacts(600, seed=3)
    cases[:, ARM] = 0.0
    cases = cases[cases[:, V_N] < 0.0]
    modes = set()
    for case in cases.tolist():
        mode, *expected = wang_mason(*case[:SIZE], case[FRICTION], *case[RESTITUTION:])
        modes.add(mode)
        speed, size = scales(case)
        found = solve(case, POISSON)
        for value, known, unit in zip(found[:3], expected, (speed, speed / size, speed), strict=True):
            assert value == pytest.approx(known, abs=1e-12 * unit), (mode, case)
    assert modes == {"sliding", "sticking, C", "sticking, R", "reversed sliding, C", "reversed sliding, R"}


@pytest.mark.parametrize("restitution", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("hypothesis", list(HYPOTHESES))
def test_a_frictionless_impact_loses_the_textbook_energy(hypothesis: str, restitution: float) -> None:
    """Oracle: (1 - e^2) v_n^2 / (2 W_nn), and v_n reversed e times, for every hypothesis."""
    for case in random_impacts(40, seed=4).tolist():
        case[FRICTION], case[ARM], case[RESTITUTION] = 0.0, 0.0, restitution
        found = solve(case, HYPOTHESES[hypothesis])
        w_nn = 1.0 / case[MASS] + case[A] ** 2 / case[INERTIA]
        energy = kinetic(case, *case[V_T:])
        assert found[2] == pytest.approx(-restitution * case[V_N], rel=1e-12, abs=0.0)
        assert found[6] == pytest.approx((1.0 - restitution**2) * case[V_N] ** 2 / (2.0 * w_nn), abs=1e-13 * energy)
        assert (found[4], found[5], found[7], found[8]) == (0.0, 0.0, 0.0, 0.0)


def test_newtons_restitution_creates_energy_where_the_energetic_one_does_not() -> None:
    """A uniform rod of 1 m and 1 kg at 45 degrees, f = 0.7, e = 1: 1.828 J become 2.828 J under Newton's hypothesis.

    Stick begins within the impact and reverses the slip's drag on the normal motion, so the work of restitution that
    makes v_n return at 3 m/s exceeds that of compression by 1.431 J; friction takes only 0.431 J of it.
    """
    arm = 0.5 * math.sin(math.pi / 4.0)
    case = [1.0, 1.0 / 12.0, arm, arm, 0.5, 0.7, 0.0, 1.0, 2.0, 5.0, -3.0]
    assert kinetic(case, 2.0, 5.0, -3.0) == pytest.approx(1.8278319, abs=1e-7)
    newton, energetic = solve(case, NEWTON), solve(case, ENERGETIC)
    assert newton[2] == pytest.approx(3.0, rel=1e-14)
    assert newton[6] == pytest.approx(-1.4307692, abs=1e-7)
    assert kinetic(case, *newton[:3]) == pytest.approx(2.8278319, abs=1e-7)
    assert energetic[6] == 0.0
    assert kinetic(case, *energetic[:3]) == pytest.approx(1.8278319 - energetic[7], abs=1e-7)
    assert energetic[7] > 0.0


# --- double compression and jam --------------------------------------------------------------------------------------

# m = 1; inertia, a, b, f, delta, e, v_t, v_n: the spin starts from zero.
DOUBLE = [
    (0.009, 0.23, 0.09, 2.9, 0.4, 0.8, 3.0, -2.0),
    (0.035, 0.47, 0.33, 1.5, 0.8, 0.5, 2.0, -2.0),
    (0.008, 0.39, 0.17, 1.3, 0.6, 0.3, 2.0, -2.0),
    (0.027, 0.44, 0.24, 1.6, 0.7, 0.5, 1.0, -1.0),
]


@pytest.mark.parametrize(("inertia", "a", "b", "f", "delta", "e", "v_t", "v_n"), DOUBLE)
def test_an_impact_can_compress_twice(
    inertia: float, a: float, b: float, f: float, delta: float, e: float, v_t: float, v_n: float
) -> None:
    """Rolling against its resistance, the body drives the contact back down: |a| delta > a^2 + b^2 + J/m."""
    assert abs(a) * delta > a * a + b * b + inertia
    case = [1.0, inertia, a, b, 0.5, f, delta, e, v_t, 0.0, v_n]
    phases = np.zeros(MOST_PHASES, PHASE)
    found = solve(case, phases=phases)
    stages = [int(row["restitution"]) for row in phases[: found[9]]]
    assert [stage for k, stage in enumerate(stages) if k == 0 or stage != stages[k - 1]] == [0, 1, 0, 1]
    assert worst_error(case, found, oracle(case)) < 1e-12


def jamming(cases: np.ndarray) -> np.ndarray:
    """Entries with slip and spin into the Painleve region: J/m + a^2 + a (b f s_t + delta s_w) < 0."""
    drag = cases[:, B] * cases[:, FRICTION] * np.sign(cases[:, V_T]) + cases[:, ARM] * np.sign(cases[:, OMEGA])
    inside = cases[:, INERTIA] / cases[:, MASS] + cases[:, A] ** 2 + cases[:, A] * drag < 0.0
    return inside & slips_and_spins(cases)


def slips_and_spins(cases: np.ndarray) -> np.ndarray:
    return (cases[:, V_T] != 0.0) & (cases[:, OMEGA] != 0.0)


def test_a_jamming_contact_has_an_impact_without_approach() -> None:
    """v_n = 0 at entry: inside the Painleve region no finite force is consistent, so slip or spin stops at once."""
    cases = random_impacts(20_000, seed=9)
    cases[:, V_N] = 0.0
    region = jamming(cases)
    for case in cases[region][:30].tolist():
        found = solve(case)
        assert found[3] > 0.0
        assert found[7] + found[8] > 0.0
        assert worst_error(case, found, oracle(case)) < 1e-12
    for case in cases[~region & slips_and_spins(cases)][:30].tolist():
        assert solve(case) == (*case[V_T:], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)


# --- energy, symmetry, bookkeeping -----------------------------------------------------------------------------------


def test_the_mirrored_impact_is_the_same_bit_for_bit() -> None:
    cases = np.concatenate([random_impacts(200, seed=11), coarse_impacts(200, seed=11)])
    mirrored = cases.copy()
    mirrored[:, [A, V_T, OMEGA]] *= -1.0
    sign = np.array([-1, -1, 1, 1, -1, -1, 1, 1, 1, 1])
    for case, other in zip(cases.tolist(), mirrored.tolist(), strict=True):
        assert np.array_equal(np.array(solve(case)), sign * np.array(solve(other))), case


def test_a_short_list_of_phases_is_filled_from_the_front() -> None:
    case = [1.0, *DOUBLE[0][:3], 0.5, *DOUBLE[0][3:7], 0.0, DOUBLE[0][7]]
    full, short = np.zeros(MOST_PHASES, PHASE), np.zeros(2, PHASE)
    assert solve(case, phases=full) == solve(case, phases=short) == solve(case)
    assert solve(case)[9] == 6
    assert np.array_equal(full[:2], short)
