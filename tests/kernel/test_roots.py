"""The first root of a power series: never passed, never invented."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from sledenv.compiler.rows import TERMS, WIDTH
from sledenv.kernel import roots
from tests.compiled import compiled

first_root, horner, locate = compiled(roots.first_root), compiled(roots.horner), compiled(roots.locate)

property_of_all = settings(deadline=None, derandomize=True, max_examples=300)  # the first call compiles


def root_of(coefficients: list[float] | np.ndarray, step: float, vanishing: int = 0, noise: float = 0.0) -> float:
    """First root of a series in [0, step]; the series is copied, for the kernel overwrites it."""
    row = np.zeros(WIDTH)
    row[: len(coefficients)] = coefficients
    return first_root(row, step, vanishing, noise)


def series_with_roots(roots: list[complex]) -> np.ndarray:
    """Coefficients, lowest first, of the polynomial with these roots that is 1 at 0."""
    lowest_first = np.real(np.poly(roots))[::-1]
    return lowest_first / lowest_first[0]


@pytest.mark.parametrize("t", [0.0, 0.5, -2.0, 3.0])
def test_horner_is_the_value_of_the_series(t: float) -> None:
    """Oracle: numpy.polynomial."""
    series = np.zeros(WIDTH)
    series[:TERMS] = np.linspace(1.0, -2.0, TERMS)
    assert horner(series, t) == pytest.approx(np.polynomial.polynomial.polyval(t, series), rel=1e-14)


@property_of_all
@given(
    st.lists(st.floats(0.5, 2.0), min_size=1, max_size=4),
    st.lists(st.complex_numbers(min_magnitude=1.0, max_magnitude=3.0), max_size=1),
    st.floats(0.1, 1.0),
)
def test_the_first_of_several_roots_is_found(real: list[float], pairs: list[complex], step: float) -> None:
    """Oracle: a product of factors with known roots; those on or near the real axis apart from the rest."""
    ordered = sorted(real)
    assume(all(q - p > 0.01 for p, q in pairwise(ordered)) and abs(ordered[0] - step) > 1e-6)
    assume(all(abs(z.imag) > 0.1 for z in pairs))
    series = series_with_roots([*real, *pairs, *(z.conjugate() for z in pairs)])
    found = root_of(series, step)
    if ordered[0] > step:
        assert found == math.inf
    else:
        assert found == pytest.approx(ordered[0], rel=1e-9)


@property_of_all
@given(st.lists(st.integers(-1000, 1000), min_size=TERMS, max_size=TERMS), st.floats(0.05, 2.0), st.floats(0.1, 0.8))
def test_the_root_of_a_random_series_is_that_of_numpy(drawn: list[int], step: float, ratio: float) -> None:
    """Oracle: numpy.roots, and the sign of the series on 2001 points before the root; terms shrink as in a contact."""
    series = 1e-3 * np.array(drawn) * (ratio / step) ** np.arange(TERMS)
    series[0] = abs(series[0]) + 1e-3
    found = root_of(series, step)
    size = np.abs(series * step ** np.arange(TERMS)).sum()
    values = np.polynomial.polynomial.polyval(np.linspace(0.0, min(found, step), 2001), series)
    assert values.min() > -1e-13 * size  # not passed
    if found < math.inf:
        assert abs(values[-1]) < 1e-13 * size  # not invented
    trimmed = np.trim_zeros(series, "b")[::-1]
    exact = [z.real for z in np.roots(trimmed) if abs(z.imag) < 1e-12 and 0.0 < z.real < step * (1.0 - 1e-6)]
    crossings = [t for t in exact if np.polynomial.polynomial.polyval(t * (1.0 + 1e-5), series) < -1e-9 * size]
    if crossings:
        assert found <= min(crossings) * (1.0 + 1e-6)


@pytest.mark.parametrize("at", [0.1, 0.5, 0.9])
@pytest.mark.parametrize("clearance", [1e-3, 1e-6, 1e-9, 1e-12])
def test_a_graze_is_resolved_on_both_sides(at: float, clearance: float) -> None:
    """Oracle: (t - at)^2 +- clearance: never zero, or first zero at at - sqrt(clearance)."""
    above = [at * at + clearance, -2.0 * at, 1.0]
    below = [at * at - clearance, -2.0 * at, 1.0]
    assert root_of(above, 1.0) == math.inf
    assert root_of(below, 1.0) == pytest.approx(at - math.sqrt(clearance), abs=1e-15 / math.sqrt(clearance))


@pytest.mark.parametrize("at", [0.1, 0.5, 0.9])
def test_a_double_root_is_found_where_it_is_or_not_at_all(at: float) -> None:
    """Oracle: (t - at)^2, which touches zero: rounding decides, but no other place is a root."""
    found = root_of([at * at, -2.0 * at, 1.0], 1.0)
    assert found == math.inf or found == pytest.approx(at, abs=1e-7)


@pytest.mark.parametrize(("series", "root"), [([1.0, -1.0], 1.0), ([2.0, -1.0], 2.0), ([1.0, 0.0, -0.25], 2.0)])
def test_a_root_at_the_end_of_the_step_is_found(series: list[float], root: float) -> None:
    """Oracle: 1 - t on [0, 1] and alike, exact in floats."""
    assert root_of(series, root) == root
    assert root_of(series, math.nextafter(root, 0.0)) in (math.inf, pytest.approx(root, rel=1e-15))
    assert root_of(series, root * (1.0 - 1e-9)) == math.inf


@pytest.mark.parametrize(
    "series", [[0.0], [0.0, 1.0], [0.0, 0.0, 1.0], [1.0], [1.0, 2.0, 3.0], [1e-3, *[0.0] * 19, 1.0]]
)
def test_a_series_that_does_not_become_negative_has_no_root(series: list[float]) -> None:
    """Oracle: by hand; the zero series stays zero."""
    assert root_of(series, 2.0) == math.inf


@pytest.mark.parametrize("series", [[-1.0, 5.0], [0.0, -1.0, 5.0], [0.0, 0.0, -1.0, 5.0], [-1e-3, 0.0, 0.0]])
def test_a_series_that_starts_downwards_has_its_root_at_once(series: list[float]) -> None:
    """Oracle: by hand, the sign of the first coefficient that is not zero."""
    assert root_of(series, 1.0) == 0.0


def test_coefficients_that_vanish_by_construction_are_not_roots() -> None:
    """Oracle: t^k (1 - 2 t), whose rounded leading coefficients would otherwise be negative at 0."""
    for vanishing in (1, 2, 3):
        series = [-1e-12] * vanishing + [1.0, -2.0]
        assert root_of(series, 1.0) == 0.0
        assert root_of(series, 1.0, vanishing) == pytest.approx(0.5, rel=1e-15)


def test_a_leading_coefficient_within_the_noise_counts_as_zero() -> None:
    """Oracle: t - t^2 after a rounding error of 1e-13 of its first coefficient; twice the noise is a value."""
    series = [-1e-13, 1.0, -1.0]
    assert root_of(series, 2.0) == 0.0
    assert root_of(series, 2.0, noise=1e-13) == pytest.approx(1.0, rel=1e-12)
    assert root_of(series, 2.0, noise=0.4e-13) == 0.0


@property_of_all
@given(st.floats(1e-9, 1e9), st.floats(1e-9, 1e9))
@example(1.0, 1.0)
def test_the_root_scales_with_the_unit_of_time_and_ignores_that_of_the_series(time: float, value: float) -> None:
    """Oracle: q(t) = value (1 - t/time)(3 - t/time)."""
    series = value * np.array([3.0, -4.0 / time, 1.0 / time**2])
    assert root_of(series, 2.0 * time) == pytest.approx(time, rel=1e-14)
    assert root_of(series, 0.99 * time) == math.inf


def test_steep_series_of_high_order_are_followed_to_the_root() -> None:
    """Oracle: cos(w t) up to order 20 on half a period and its zero pi/(2 w)."""
    w = 30.0
    series = np.zeros(21)
    series[::2] = [(-1) ** k * w ** (2 * k) / math.factorial(2 * k) for k in range(11)]
    assert root_of(series, math.pi / w) == pytest.approx(math.pi / (2.0 * w), rel=1e-12)


@pytest.mark.parametrize(("series", "vanishing"), [([0.0, -1.0, 3.0], 1), ([0.0, 0.0, -1.0], 2), ([1.0, -1.0], 0)])
def test_an_interval_of_no_length_holds_no_root(series: list[float], vanishing: int) -> None:
    """Oracle: what is zero by construction is no root, and there is nothing behind it."""
    assert root_of(series, 0.0, vanishing) == math.inf


def row_of(*coefficients: float) -> np.ndarray:
    """Row of a series."""
    row = np.zeros(WIDTH)
    row[: len(coefficients)] = coefficients
    return row


def test_a_place_where_the_method_stands_still_is_not_taken_for_a_root() -> None:
    """Oracle: a parabola at whose guess the two parts of a step of Chebyshev's method cancel; its roots by hand."""
    series = row_of(0.2 - 0.5 - 5.0 * 0.25, 1.0 + 5.0, -5.0)  # .2 + (t - .5) - 5 (t - .5)^2
    for guess in np.linspace(0.45, 0.55, 11):
        found = locate(series, float(guess), 2.0)
        assert found == -1.0 or abs(horner(series, found)) < 1e-14


def test_the_first_root_is_located_and_a_later_one_is_not() -> None:
    """Oracle: (t - .4) (t - 1.1) (t + 3)."""
    series = row_of(*np.poly([0.4, 1.1, -3.0])[::-1])
    assert locate(series, 0.42, 2.0) == pytest.approx(0.4, rel=1e-14)
    assert locate(series, 1.09, 2.0) == -1.0
    assert locate(series, 0.42, 0.3) == -1.0
    assert locate(series, math.nan, 0.3) == -1.0


@pytest.mark.parametrize("apart", [1e-1, 1e-2, 1e-3, 1e-4])
def test_a_root_beside_another_is_as_good_as_any(apart: float) -> None:
    """Oracle: (t - .5) (t - .5 - apart): the value there is rounding, from guesses near and far."""
    series = row_of(*np.poly([0.5, 0.5 + apart])[::-1])
    located = 0
    for guess in 0.5 - apart * np.concatenate([np.logspace(-8.0, -1.0, 30), [0.0]]):
        found = locate(series, float(guess), 2.0)
        if found > 0.0:
            located += 1
            assert abs(found - 0.5) * apart < 1e-15
    assert located > 0
