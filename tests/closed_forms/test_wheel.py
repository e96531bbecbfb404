"""Wheel collisions in closed form: Table 1 corrected and completed, against the general impact solver and by hand."""

from __future__ import annotations

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


@pytest.mark.parametrize("n", SIZES)
def test_the_scenario_is_the_mode_of_the_general_impact(n: int) -> None:
    """Oracle: the mode code of the kernel, from the velocities before and after, away from the borders."""
    cases = random_wheels(n, seed=4, boundaries=False)
    scenarios = collide_wheel(*cases.T).scenario
    assert np.array_equal(scenarios, solve(cases)[1])
    assert set(scenarios) == set(MODE_NAMES[1:]) - {"double-reversal"}


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


# --- symmetry --------------------------------------------------------------------------------------------------------


def test_the_mirrored_entry_gives_the_mirrored_impact_bit_for_bit() -> None:
    cases = random_wheels(5000, seed=9, boundaries=True)
    mirrored = cases * np.array([1, 1, 1, 1, 1, 1, -1, 1, -1])
    one, other = collide_wheel(*cases.T), collide_wheel(*mirrored.T)
    for name, sign in (("u", -1), ("omega", -1), ("tangential_impulse", -1), ("arm", -1), ("v", 1)):
        assert np.array_equal(getattr(one, name), sign * getattr(other, name))
    assert np.array_equal(one.scenario, other.scenario)


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
