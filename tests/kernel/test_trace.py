"""Straight-line programs: what they compute, and that the series of a step obey the equations of motion."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from sledenv.kernel import series
from sledenv.kernel.friction import mobility, rates
from sledenv.kernel.jit import kernel
from sledenv.kernel.series import WIDTH, Z_ROWS, complete, expand
from sledenv.kernel.state import GAP, OMEGA, V_N, V_T
from sledenv.kernel.trace import (
    LANES,
    absolute,
    compiled,
    fma,
    larger,
    less,
    nearest,
    not_more,
    packed,
    root,
    scalar,
    sine_cosine,
    smaller,
    where,
    where_less,
)


def _samples(z: Any, c: Any) -> None:
    c[0], c[1] = sine_cosine(z[0])
    c[2] = smaller(z[0], z[1])
    c[3] = absolute(z[0]) + 2.0 - 1.0 / z[1]
    c[4] = where_less(z[0], 0.5, 1.0, -z[1])
    c[5] = 3.0 * z[0] + 4.0 * z[1]
    c[6] = fma(z[0], z[1], -2.0)
    c[7] = 4.0


_program = compiled(_samples)


@kernel
def _run(z: np.ndarray, c: np.ndarray) -> None:
    _program(z, c)


def answers(x: float, y: float) -> np.ndarray:
    """Run the program."""
    c = np.full(8, math.nan)
    _run(np.array([x, y]), c)
    return c


def _mixture(x: Any, y: Any) -> tuple[Any, ...]:
    sine, cosine = sine_cosine(x)
    chosen = where(less(x, y) & ~not_more(y, 0.5), larger(x, y), smaller(x, y))
    return sine, cosine, root(x * x + y), nearest(x / y), fma(x, y, -absolute(y)), chosen, 3.0


_one, _many = scalar(_mixture), packed(_mixture, (1, 2), (0, 1, 2, 3, 4, 5, 6))


@kernel
def _alone(x: float, y: float, z: np.ndarray) -> None:
    z[0], z[1], z[2], z[3], z[4], z[5], z[6] = _one(x, y)


@kernel
def _side_by_side(z: np.ndarray) -> None:
    _many(z)


def test_lanes_side_by_side_compute_what_each_does_alone() -> None:
    """Oracle: the same program on single numbers, bit for bit; of a NaN its being one."""
    odd = [0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, 1e300, -1e-300, math.pi, -math.pi / 4.0, 0.5, 1e6]
    pairs = np.array(list(itertools.product(odd, odd)))
    pairs = np.concatenate([pairs, np.random.default_rng(1).normal(0.0, 5.0, (16 * LANES - len(pairs), 2))])
    for part in pairs.reshape(-1, LANES, 2):
        together, alone = np.zeros((7, LANES)), np.zeros((7, LANES))
        together[1:3] = part.T
        _side_by_side(together)
        for lane, (x, y) in enumerate(part):
            column = np.zeros(7)
            _alone(x, y, column)
            alone[:, lane] = column
        assert np.array_equal(together, alone, equal_nan=True)
        assert np.array_equal(np.signbit(together)[~np.isnan(alone)], np.signbit(alone)[~np.isnan(alone)])


@pytest.mark.parametrize(("x", "y"), [(0.3, 2.0), (-1.7, 0.25), (0.0, -3.0), (0.5, 0.5)])
def test_a_program_computes_what_it_says(x: float, y: float) -> None:
    """Oracle: the same in Python."""
    expected = [
        math.sin(x),
        math.cos(x),
        min(x, y),
        abs(x) + 2.0 - 1.0 / y,
        1.0 if x < 0.5 else -y,
        3.0 * x + 4.0 * y,
        x * y - 2.0,
        4.0,
    ]
    assert answers(x, y) == pytest.approx(expected, rel=3e-16, abs=3e-16)


def test_sine_and_cosine_are_those_of_the_library_on_both_sides_of_every_quarter() -> None:
    """Oracle: math; an angle of a contact lies within two turns of zero."""
    angles = np.concatenate(
        [np.random.default_rng(0).uniform(-4 * math.pi, 4 * math.pi, 5000), np.arange(-16, 17) * math.pi / 4]
    )
    for angle in angles:
        sine, cosine = answers(angle, 1.0)[:2]
        assert abs(sine - math.sin(angle)) <= 2.3e-16
        assert abs(cosine - math.cos(angle)) <= 2.3e-16
    assert answers(0.0, 1.0)[0] == 0.0
    assert np.isnan(answers(math.nan, 1.0)[:2]).all()


def test_sine_is_odd_and_cosine_even_bit_for_bit() -> None:
    """Oracle: a mirror image."""
    for angle in np.random.default_rng(1).uniform(0.0, 13.0, 2000):
        one, other = answers(angle, 1.0), answers(-angle, 1.0)
        assert (one[0], one[1]) == (-other[0], other[1])


BRANCHES = [branch for branch in itertools.product((0, -1, 1), repeat=3) if any(branch)]
MASS, INERTIA, H, R, FRICTION, ARM, STIFFNESS = 1.3, 0.02, 0.07, 0.15, 0.4, 0.01, 2e5
INWARD, DOWNHILL = 9.0, 2.5


def told(branch: tuple[int, int, int]) -> np.ndarray:
    """Return what the expansion of a branch is told."""
    gap_rate, slip, spin = branch
    z = np.zeros(Z_ROWS)
    z[series.Z_PER_MASS], z[series.Z_RATIO] = 1.0 / MASS, MASS / INERTIA
    z[series.Z_H], z[series.Z_R] = H, R
    z[series.Z_MU], z[series.Z_RHO] = -slip * FRICTION, -spin * ARM
    z[series.Z_STIFFNESS], z[series.Z_INWARD], z[series.Z_DOWNHILL] = STIFFNESS, INWARD, DOWNHILL
    z[series.Z_THETA] = z[series.Z_PHI] = 0.8
    z[series.Z_SINE], z[series.Z_COSINE] = math.sin(0.8), math.cos(0.8)
    z[series.Z_UNIT] = 1.5e-3
    z[series.Z_GAP] = -2e-3
    z[series.Z_V_N], z[series.Z_V_T], z[series.Z_OMEGA] = 1.1 * gap_rate, 0.7 * slip, 6.0 * spin
    z[series.Z_OTHER] = math.inf
    return z


def value(c: np.ndarray, row: int, s: float) -> float:
    """Value of a row of the table."""
    return float(np.polyval(c[row, ::-1], s))


def rate(c: np.ndarray, row: int, s: float) -> float:
    """Rate of a row of the table [1/unit]."""
    return float(np.polyval((c[row] * np.arange(WIDTH))[:0:-1], s))


@pytest.mark.parametrize("branch", BRANCHES)
def test_the_series_obey_the_equations_of_motion(branch: tuple[int, int, int]) -> None:
    """Oracle: friction.rates with the forces of the series; locked velocities stay zero."""
    gap_rate, slip, spin = branch
    z = told(branch)
    c = np.zeros((series.ROWS, WIDTH))
    expand(gap_rate, slip, spin, z, c)
    unit = z[series.Z_UNIT]
    for s in (0.0, 0.3, 0.8):
        theta = value(c, series.PHI, s)
        a, b = H * math.sin(theta), R - H * math.cos(theta)
        omega = value(c, OMEGA, s)
        normal = value(c, series.R_NORMAL, s)
        force = -slip * FRICTION * normal if slip != 0 else value(c, series.R_FORCE, s)
        moment = -spin * ARM * normal if spin != 0 else value(c, series.R_MOMENT, s)
        drive_t = DOWNHILL + a * omega**2
        drive_n = -INWARD - H * math.cos(theta) * omega**2
        rate_t, rate_w, rate_n = rates(mobility(MASS, INERTIA, a, b), drive_t, drive_n, force, moment, normal)
        size = abs(drive_n) + abs(normal) / MASS + R * abs(rate_w)
        assert rate(c, V_T, s) / unit == pytest.approx(rate_t, abs=1e-10 * size)
        assert rate(c, OMEGA, s) / unit == pytest.approx(rate_w, abs=1e-10 * size / R)
        assert rate(c, V_N, s) / unit == pytest.approx(rate_n, abs=1e-10 * size)
        assert rate(c, GAP, s) / unit == pytest.approx(value(c, V_N, s), abs=1e-12)
        assert rate(c, series.PHI, s) / unit == pytest.approx(omega, abs=1e-12)
        assert rate(c, series.X, s) / unit == pytest.approx(value(c, V_T, s) - b * omega, abs=1e-12)
        for velocity, sign in ((V_N, gap_rate), (V_T, slip), (OMEGA, spin)):
            assert sign != 0 or not c[velocity].any()
        if gap_rate != 0:
            assert normal == pytest.approx(-STIFFNESS * value(c, GAP, s), rel=1e-12)


@pytest.mark.parametrize("branch", BRANCHES)
def test_a_completed_step_is_that_of_the_series(branch: tuple[int, int, int]) -> None:
    """Oracle: the polynomials, and their integrals by Gauss-Legendre quadrature; bounds hold on a fine grid."""
    z = told(branch)
    c = np.zeros((series.ROWS, WIDTH))
    expand(*branch, z, c)
    step = z[series.Z_STEP] = 0.7
    complete(z, c)
    unit = z[series.Z_UNIT]
    for row in (series.X, series.PHI, GAP, V_N, V_T, OMEGA):
        assert z[row + series.E_STATE] == pytest.approx(value(c, row, step), rel=1e-13, abs=1e-15)
    nodes, weights = np.polynomial.legendre.leggauss(30)
    at = 0.5 * step * (nodes + 1.0)
    normal = np.array([value(c, series.R_NORMAL, s) for s in at])
    for answer, factor in (
        (series.E_NORMAL, np.ones(30)),
        (series.E_SLIP, np.array([value(c, V_T, s) for s in at])),
        (series.E_SPIN, np.array([value(c, OMEGA, s) for s in at])),
    ):
        exact = 0.5 * step * unit * float(weights @ (normal * factor))
        assert z[answer] == pytest.approx(exact, rel=1e-12, abs=1e-14)
    grid = np.linspace(0.0, step, 400)
    for safe, row in ((series.E_SAFE_V_N, V_N), (series.E_SAFE_V_T, V_T), (series.E_SAFE_OMEGA, OMEGA)):
        if z[safe] > 0.0:
            assert min(abs(value(c, row, s)) for s in grid) >= 0.999 * z[safe]
    assert max(abs(value(c, series.PHI, s) - value(c, series.PHI, 0.0)) for s in grid) <= 1.001 * z[series.E_TURN]


def test_a_place_where_the_method_stands_still_is_not_taken_for_a_root() -> None:
    """Oracle: a parabola at whose guess the two parts of a step of Chebyshev's method cancel; its roots by hand."""
    z, c = np.zeros(Z_ROWS), np.zeros((series.ROWS, WIDTH))
    c[V_T, :3] = 0.2 - 0.5 - 5.0 * 0.25, 1.0 + 5.0, -5.0  # .2 + (t - .5) - 5 (t - .5)^2
    z[series.Z_MOST] = 2.0
    for guess in np.linspace(0.45, 0.55, 11):
        z[series.Z_GUESS] = guess
        if series.locate(V_T, z, c):
            assert abs(value(c, V_T, z[series.Z_ROOT])) < 1e-14


@pytest.mark.parametrize("row", [GAP, V_N, V_T, OMEGA])
def test_the_first_root_is_located_and_a_later_one_is_not(row: int) -> None:
    """Oracle: (t - .4) (t - 1.1) (t + 3)."""
    z, c = np.zeros(Z_ROWS), np.zeros((series.ROWS, WIDTH))
    c[row, :4] = np.poly([0.4, 1.1, -3.0])[::-1]
    z[series.Z_MOST], z[series.Z_GUESS] = 2.0, 0.42
    assert series.locate(row, z, c)
    assert z[series.Z_ROOT] == pytest.approx(0.4, rel=1e-14)
    z[series.Z_GUESS] = 1.09
    assert not series.locate(row, z, c)
    z[series.Z_MOST], z[series.Z_GUESS] = 0.3, 0.42
    assert not series.locate(row, z, c)
    z[series.Z_GUESS] = math.nan
    assert not series.locate(row, z, c)


@pytest.mark.parametrize("apart", [1e-1, 1e-2, 1e-3, 1e-4])
def test_a_root_beside_another_is_as_good_as_any(apart: float) -> None:
    """Oracle: (t - .5) (t - .5 - apart): the value there is rounding, from guesses near and far."""
    z, c = np.zeros(Z_ROWS), np.zeros((series.ROWS, WIDTH))
    c[V_T, :3] = np.poly([0.5, 0.5 + apart])[::-1]
    z[series.Z_MOST] = 2.0
    located = 0
    for guess in 0.5 - apart * np.concatenate([np.logspace(-8.0, -1.0, 30), [0.0]]):
        z[series.Z_GUESS] = guess
        if series.locate(V_T, z, c):
            located += 1
            assert abs(z[series.Z_ROOT] - 0.5) * apart < 1e-15
    assert located > 0
