"""Wheel collisions in closed form: Table 1 corrected and completed, against the general impact solver and by hand."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import numpy as np
import pytest

from sledenv.closed_forms.wheel import collide_wheel
from sledenv.kernel.books import contact_mode
from sledenv.kernel.contacts import IMPACT
from sledenv.kernel.impact import ENERGETIC, MOST_PHASES, impact
from sledenv.kernel.records import PHASE, Mode
from tests.compiled import compiled

MODE_NAMES = np.array(["", *(mode.name.lower().replace("_", "-") for mode in Mode)], dtype=object)
NO_PHASES = np.empty(0, PHASE)
SIZES = [5000, pytest.param(1_000_000, marks=pytest.mark.slow)]


def impacts(cases: np.ndarray, out: np.ndarray, modes: np.ndarray, phases: np.ndarray, hits: np.ndarray) -> None:
    """Solve each row of cases (m, J, r, f, delta, e, u, v, omega) by the general solver with a = 0, b = r."""
    hit = hits[0]
    for i in range(len(cases)):
        m, inertia, r, f, delta, e, u, v, omega = cases[i]
        slip = u + r * omega
        hit["per_mass"], hit["per_inertia"], hit["size"] = 1.0 / m, 1.0 / inertia, r
        hit["a"], hit["b"], hit["friction"], hit["rolling_arm"], hit["restitution"] = 0.0, r, f, delta, e
        hit["v_t"], hit["omega"], hit["v_n"] = slip, omega, v
        count = impact(ENERGETIC, hit, phases)
        out[i, 0] = hit["v_t"] - r * hit["omega"]
        out[i, 1] = hit["v_n"]
        out[i, 2] = hit["omega"]
        out[i, 3] = hit["tangential_impulse"]
        out[i, 4] = hit["normal_impulse"]
        out[i, 5] = hit["rolling_impulse"]
        modes[i] = contact_mode(slip, omega, hit["v_t"], hit["omega"]) if count <= MOST_PHASES else 0


kernel_impacts = compiled(impacts)


def solve(cases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(u, v, omega, SF, P, moment impulse) of every case and the name of its mode, by the general solver."""
    out, modes = np.zeros((len(cases), 6)), np.zeros(len(cases), np.int64)
    kernel_impacts(cases, out, modes, NO_PHASES, np.zeros(1, IMPACT))
    return out, MODE_NAMES[modes]


def random_wheels(n: int, seed: int, boundaries: bool) -> np.ndarray:
    """Rows (m, J, r, f, delta, e, u, v, omega) of every size and any sign, many of them with exact zeros.

    With ``boundaries``, also wheels on the border of two scenarios, where rounding decides which of them is found.
    """
    rng = np.random.default_rng(seed)

    def scaled(*shares: tuple[float, float]) -> np.ndarray:
        factors, weights = zip(*shares, strict=True)
        return rng.choice(factors, n, p=weights)

    m, r = 10.0 ** rng.uniform(-2, 2, n), 10.0 ** rng.uniform(-2, 1, n)
    inertia = m * r * r * 10.0 ** rng.uniform(-1.5, 0.3, n)
    f = rng.uniform(0, 1.5, n) * scaled((0.0, 0.1), (0.1, 0.3), (1.0, 0.6))
    delta = r * rng.uniform(0, 1, n) * scaled((0.0, 0.1), (0.1, 0.4), (1.0, 0.5))
    e = np.select([(share := rng.random(n)) < 0.1, share < 0.2], [0.0, 1.0], rng.random(n))
    u = rng.normal(size=n) * scaled((0.0, 0.15), (1.0, 0.45), (5.0, 0.4))
    v = -np.abs(rng.normal(size=n)) * scaled((1.0, 0.5), (5.0, 0.5))
    omega = rng.normal(size=n) / r * scaled((0.0, 0.15), (1.0, 0.45), (5.0, 0.4))
    u = np.where(rng.random(n) < 0.08, -(r * omega), u)  # no slip
    if boundaries:
        share = rng.random(n)
        rolling_friction = m * r * delta / (inertia + m * r * r)
        f = np.select([share < 0.05, share < 0.1], [delta / r, rolling_friction], f)
        v = np.where(rng.random(n) < 0.05, 0.0, v)
    else:
        f = np.where((f == 0.0) & (u == 0.0), 0.2, f)  # slip and spin would stop at once
    return np.stack([m, inertia, r, f, delta, e, u, v, omega], axis=1)


def speed_scale(cases: np.ndarray) -> np.ndarray:
    """Largest speed of entry [m/s], 1 if there is none."""
    _, _, r, _, _, _, u, v, omega = cases.T
    scale = np.maximum.reduce([np.abs(u), np.abs(v), r * np.abs(omega)])
    return np.where(scale > 0.0, scale, 1.0)


def rules_that_hold(m, inertia, r, f, delta, impulse, u, omega):  # type: ignore[no-untyped-def]
    """Truth of the rules of modes 1 to 7 (docs/physics.md, section 3), each a range of the normal impulse.

    Works for floats and, exactly, for fractions. A path goes through its modes as the impulse grows; the border between
    two is the sum of the impulses of the phases before it.
    """
    infinity = math.inf
    slip = u + r * omega
    about_contact = inertia + m * r * r
    s = 1 if slip > 0 else -1 if slip < 0 else (-1 if omega > 0 else 1)
    t = 1 if omega > 0 else -1 if omega < 0 else -s
    grips = f * about_contact >= m * r * delta
    holds = r * f <= delta
    slowing = (f * about_contact + s * t * m * r * delta) / (m * inertia)  # of slip
    despinning = (delta + s * t * r * f) / inertia
    p1 = abs(slip) / slowing if slowing > 0 else infinity
    p2 = abs(omega) / despinning if despinning > 0 else infinity
    if slip == 0 and grips:
        p1 = 0 * p1 if p1 < infinity else 0.0
    if omega == 0 and holds:
        p2 = 0 * p2 if p2 < infinity else 0.0

    rest = infinity  # everything has stopped
    p3 = infinity  # the second of slip and spin stops
    if p1 < p2 and p1 < infinity:
        spin = abs(omega) - despinning * p1
        if grips:
            rest = p1 + spin * about_contact / delta if delta > 0 else infinity if spin > 0 else p1
        else:
            p3 = p1 + spin * inertia / (delta - r * f)
            slip_back = (p3 - p1) * (m * r * delta - f * about_contact) / (m * inertia)
            rest = p3 + m * slip_back / f if f > 0 else infinity
    elif p2 < p1 and p2 < infinity:
        left = abs(slip) - slowing * p2
        if holds:
            rest = p2 + m * left / f if f > 0 else infinity
        else:
            p3 = p2 + left * m * inertia / (f * about_contact - m * r * delta)
            rest = p3 + (p3 - p2) * (r * f - delta) / inertia * about_contact / delta if delta > 0 else infinity
    elif p1 < infinity:
        rest = p1

    slide_roll = impulse < p1 and impulse < p2
    stop_roll = (p1 < p2 and grips and p1 <= impulse and impulse < rest) or (
        p2 < p1 and not holds and p3 <= impulse and impulse < rest
    )
    slide = (p2 < p1 and holds and p2 <= impulse and impulse < rest) or (
        p1 < p2 and not grips and p3 <= impulse and impulse < rest
    )
    stuck = impulse >= rest
    spin_reversal = p2 < p1 and not holds and p2 <= impulse and impulse < p3
    slip_reversal = p1 < p2 and not grips and p1 <= impulse and impulse < p3
    double_reversal = not grips and not holds
    return slide_roll, stop_roll, slide, stuck, spin_reversal, slip_reversal, double_reversal


# --- against the general solver --------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", SIZES)
def test_closed_forms_agree_with_the_general_impact(n: int) -> None:
    """Oracle: kernel.impact.impact, which knows no scenario; error in units of the largest speed of entry."""
    cases = random_wheels(n, seed=1, boundaries=True)
    m, _, r, *_ = cases.T
    expected, _ = solve(cases)
    result = collide_wheel(*cases.T)
    speed = speed_scale(cases)
    found = (result.u, result.v, result.omega, result.tangential_impulse, result.normal_impulse)
    for value, column, unit in zip(found, expected.T, (1.0, 1.0, 1.0 / r, m, m), strict=False):
        assert np.max(np.abs(value - column) / (unit * speed)) < 1e-12
    moment = result.arm * result.normal_impulse
    assert np.max(np.abs(moment - expected[:, 5]) / (m * r * speed)) < 1e-12


# --- the rules of existence ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [2000, pytest.param(200_000, marks=pytest.mark.slow)])
def test_exactly_one_rule_holds_and_it_names_the_scenario_and_the_mode(n: int) -> None:
    """Oracle: the rules as ranges of the normal impulse, evaluated separately; the mode code of the kernel."""
    cases = random_wheels(n, seed=4, boundaries=False)
    scenarios, modes = collide_wheel(*cases.T).scenario, solve(cases)[1]
    for (m, inertia, r, f, delta, e, u, v, omega), scenario, mode in zip(cases.tolist(), scenarios, modes, strict=True):
        held = rules_that_hold(m, inertia, r, f, delta, m * abs(v) * (1.0 + e), u, omega)
        assert sum(held) == 1
        assert scenario == mode == MODE_NAMES[1 + held.index(True)]
    assert set(scenarios) == set(MODE_NAMES[1:]) - {"double-reversal"}


def test_exactly_one_rule_holds_on_every_border() -> None:
    """Oracle: exact fractions from a coarse grid, so that zeros and borders of scenarios are met exactly and often."""
    rng = random.Random(5)

    def draw(*values: str) -> Fraction:
        return Fraction(rng.choice(values))

    borders = 0
    for _ in range(1000):
        m, r = draw("1", "2"), draw("1/2", "1")
        inertia = m * r * r * draw("1/2", "1", "2/5")
        f, delta = draw("0", "1/8", "1/4", "1/2", "1"), r * draw("0", "1/8", "1/4", "1/2", "3/4")
        e = draw("0", "1/2", "1")
        u, v, omega = (draw("-2", "-1", "-1/2", "0", "1/2", "1", "2", "3") for _ in range(3))
        impulse = m * abs(v) * (1 + e)
        held = rules_that_hold(m, inertia, r, f, delta, impulse, u, omega)
        assert sum(held) == 1
        if v > 0:
            continue
        name = MODE_NAMES[1 + held.index(True)]
        result = collide_wheel(*map(float, (m, inertia, r, f, delta, e, u, v, omega)))
        if result.scenario == name:
            continue
        # On a border rounding may choose the neighbour, whose velocities are the same: one of them is all but zero.
        borders += 1
        speeds = (result.u, result.omega, result.u + float(r) * result.omega)
        assert min(abs(value) for value in speeds if value != 0.0 or result.scenario == "stuck") < 1e-14
    assert borders < 100


def test_a_wheel_without_spin_is_stuck_iff_its_entry_is_steep_enough() -> None:
    """Oracle: the border |u|/|v| = (1 + e) min(f, delta/r), 1e-9 to both sides, whatever mass and inertia."""
    m, inertia, r, f, delta, e, _, v, _ = random_wheels(5000, seed=8, boundaries=False).T
    ratio = (1.0 + e) * np.minimum(f, delta / r)
    for factor, stuck in ((1.0 - 1e-9, True), (1.0 + 1e-9, False)):
        found = collide_wheel(m, inertia, r, f, delta, e, factor * ratio * v, v).scenario == "stuck"
        assert np.array_equal(found, np.where(ratio > 0.0, stuck, True))


# --- known values ----------------------------------------------------------------------------------------------------

# m = 2, r = 1/2, J = 1/4, e = 1/2, v = -2, thus P = 6, I = 3/4; delta = 1/8 gives f_r = 1/6 and delta/r = 1/4.
BY_HAND = [
    # f, u, omega: u1, omega1, SF, d, scenario
    (1 / 2, 8.0, 0.0, 6.5, -3.0, -3.0, 1 / 8, "slide-roll"),
    (1 / 2, 2.25, 0.0, 1.0, -2.0, -2.5, 1 / 8, "stop-roll"),
    (1 / 8, 2.0, 0.0, 1.625, 0.0, -0.75, 1 / 16, "slide"),
    (1 / 2, 0.5, 0.0, 0.0, 0.0, -1.0, 1 / 12, "stuck"),
    # Rolling on: the friction f_r per normal force keeps it up.
    (1 / 2, -3.0, 6.0, -2.5, 5.0, 1.0, -1 / 8, "stop-roll"),
    # p2 = 2/3: friction turns the spin back, as r f > delta ...
    (1 / 2, 8.0, 1.0, 6.5, -8 / 3, -3.0, 7 / 72, "spin-reversal"),
    # ... and slip stops after it.
    (1 / 2, 2.0, 1.0, 7 / 9, -14 / 9, -22 / 9, 7 / 72, "stop-roll"),
    # p1 = 48/35: rolling resistance turns the slip back, as f < f_r ...
    (1 / 8, -0.9, 3.0, -39 / 56, 57 / 70, 57 / 140, -1 / 8, "slip-reversal"),
    # ... and spin stops after it (p1 = 8/7).
    (1 / 8, -0.5, 2.0, -15 / 56, 0.0, 13 / 28, -41 / 336, "slide"),
]


@pytest.mark.parametrize(("f", "u", "omega", "u_1", "omega_1", "force", "arm", "scenario"), BY_HAND)
def test_rows_of_the_completed_table_1(
    f: float, u: float, omega: float, u_1: float, omega_1: float, force: float, arm: float, scenario: str
) -> None:
    """Computed by hand from the rows of docs/physics.md, section 3, and their completion by spin."""
    result = collide_wheel(2.0, 0.25, 0.5, f, 0.125, 0.5, u, -2.0, omega)
    assert result.scenario == scenario
    found = (result.u, result.v, result.omega, result.tangential_impulse, result.normal_impulse, result.arm)
    assert found == pytest.approx((u_1, 1.0, omega_1, force, 6.0, arm), abs=1e-14)


# --- symmetry and energy ---------------------------------------------------------------------------------------------


def test_the_mirrored_entry_gives_the_mirrored_impact_bit_for_bit() -> None:
    cases = random_wheels(5000, seed=9, boundaries=True)
    mirrored = cases * np.array([1, 1, 1, 1, 1, 1, -1, 1, -1])
    one, other = collide_wheel(*cases.T), collide_wheel(*mirrored.T)
    for name, sign in (("u", -1), ("omega", -1), ("tangential_impulse", -1), ("arm", -1), ("v", 1)):
        assert np.array_equal(getattr(one, name), sign * getattr(other, name))
    assert np.array_equal(one.scenario, other.scenario)


@pytest.mark.parametrize("n", SIZES)
def test_energy_is_never_created_and_the_normal_loss_is_that_of_restitution(n: int) -> None:
    """Oracle: kinetic energies; friction takes tangential energy only, restitution (1 - e^2) m v^2/2."""
    cases = random_wheels(n, seed=10, boundaries=True)
    m, inertia, _, f, delta, e, u, v, omega = cases.T
    result = collide_wheel(*cases.T)
    before = 0.5 * m * u**2 + 0.5 * inertia * omega**2
    after = 0.5 * m * result.u**2 + 0.5 * inertia * result.omega**2
    assert np.all(after <= before * (1.0 + 1e-13) + 1e-26 * m * v**2)
    kept = (f == 0.0) & (delta == 0.0)
    assert np.allclose(after[kept], before[kept], rtol=1e-14, atol=0.0)
    assert np.allclose(result.v, -e * v, rtol=1e-15, atol=0.0)
    assert np.all(np.abs(result.tangential_impulse) <= f * result.normal_impulse * (1 + 1e-12) + 1e-14 * m * np.abs(u))
    assert np.all(np.abs(result.arm) <= delta)


def test_wheels_that_do_not_approach_are_left_alone() -> None:
    """Oracle: the entry; at v = 0 there is an impact without impulse."""
    result = collide_wheel(1.0, 0.1, 0.5, 0.3, 0.1, 0.5, [1.0, 1.0], [0.2, 0.0], 3.0)
    assert result.scenario.tolist() == ["none", "slide-roll"]
    rows = np.stack([result.u, result.v, result.omega, result.normal_impulse, result.tangential_impulse, result.arm])
    assert rows.tolist() == [[1.0, 1.0], [0.2, 0.0], [3.0, 3.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]


# --- interface -------------------------------------------------------------------------------------------------------


def test_scalars_give_scalars_and_arrays_broadcast() -> None:
    one = collide_wheel(1.0, 0.1, 0.5, 0.3, 0.1, 0.5, 1.0, -1.0)
    assert all(type(value) is float for value in (one.u, one.v, one.omega, one.tangential_impulse, one.arm))
    assert type(one.scenario) is str
    many = collide_wheel(1.0, 0.1, 0.5, np.array([[0.3], [0.6]]), 0.1, 0.5, np.array([1.0, 2.0, 3.0]), -1)
    assert many.u.shape == many.scenario.shape == many.arm.shape == (2, 3)
    assert (many.u[0, 0], many.omega[0, 0], many.scenario[0, 0]) == (one.u, one.omega, one.scenario)
    empty = collide_wheel(1.0, 0.1, 0.5, 0.3, 0.1, 0.5, np.empty(0), -1.0)
    assert empty.u.shape == empty.scenario.shape == (0,)
