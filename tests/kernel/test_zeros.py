"""The first zero of a polynomial: none is passed over, none is invented."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sledenv.kernel import zeros
from sledenv.kernel.contacts import DEEPEST, ORDER, WIDTH
from tests.compiled import compiled

first_zero = compiled(zeros.first_zero)
ENDS = (0.25, 1.0, 4.0, 3e-5)


def zero_of(coefficients: list[float] | np.ndarray, end: float, by_construction: int = 0) -> float:
    """First zero of a polynomial whose coefficients come lowest first; inf if there is none."""
    p = np.zeros(ORDER + 1)
    p[: len(coefficients)] = coefficients
    found = first_zero(p, end, by_construction, np.zeros((DEEPEST, WIDTH + 2)))
    return math.inf if found == zeros.NONE else float(found)


def with_roots(real: list[float], pairs: Sequence[tuple[float, float]] = ()) -> list[Fraction]:
    """Exact coefficients, lowest first, of the polynomial with these roots that is 1 at 0.

    A pair is the middle and the distance from the real axis of two conjugate roots.
    """
    product = [Fraction(1)]
    factors = [[Fraction(1), -1 / Fraction(root)] for root in real]
    for middle, far in pairs:
        square = Fraction(middle) ** 2 + Fraction(far) ** 2
        factors.append([Fraction(1), -2 * Fraction(middle) / square, 1 / square])
    for factor in factors:
        longer = [Fraction(0)] * (len(product) + len(factor) - 1)
        for i, one in enumerate(product):
            for j, two in enumerate(factor):
                longer[i + j] += one * two
        product = longer
    return product


def in_units_of(end: float, p: list[Fraction]) -> list[float]:
    """Coefficients of the polynomial whose argument is made longer by ``end``."""
    return [float(term / Fraction(end) ** k) for k, term in enumerate(p)]


def exact(p: list[float], t: float) -> Fraction:
    total = Fraction(0)
    for term in reversed(p):
        total = total * Fraction(t) + Fraction(term)
    return total


def rounding(p: list[float], t: float) -> float:
    """Error that a value may have."""
    return 4e-15 * sum(abs(term) * t**k for k, term in enumerate(p))


@given(
    st.lists(st.floats(0.02, 2.0), min_size=1, max_size=6),
    st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(0.2, 2.0)), max_size=4),
    st.sampled_from(ENDS),
)
def test_the_first_of_many_roots_is_found(real: list[float], pairs: list[tuple[float, float]], end: float) -> None:
    """Oracle: factors with chosen roots, multiplied in fractions; roots that are close are told apart by the value."""
    first, rest = min(real), sorted(real)[1:]
    assume(abs(first - 1.0) > 1e-6 and all(root - first > 1e-3 for root in rest))
    p = in_units_of(end, with_roots(real, pairs))
    found = zero_of(p, end)
    if first > 1.0:
        assert found == math.inf or abs(exact(p, found)) <= rounding(p, found)
    else:
        assert found <= first * end * (1.0 + 1e-5)
        assert abs(exact(p, found)) <= rounding(p, found)


@given(
    st.lists(st.floats(0.01, 1.5), min_size=1, max_size=8),
    st.lists(st.tuples(st.floats(-1.0, 2.0), st.floats(0.0, 0.5)), max_size=4),
    st.sampled_from(ENDS),
)
def test_a_polynomial_is_positive_before_its_first_zero(
    real: list[float], pairs: list[tuple[float, float]], end: float
) -> None:
    """Oracle: exact values at 200 places before the zero, or before the end where there is none; roots may be close."""
    assume(all(abs(root - 1.0) > 1e-9 for root in real))  # at the end of the step rounding decides
    p = in_units_of(end, with_roots(real, [pair for pair in pairs if math.hypot(*pair) > 0.01]))
    found = zero_of(p, end)
    assert 0.0 <= found < end or found == math.inf
    for t in np.linspace(0.0, min(found * (1.0 - 1e-9), end), 200):
        assert float(exact(p, t)) >= -rounding(p, t)
    if found < math.inf:  # where roots are close, the value is within rounding all about them
        assert abs(float(exact(p, found))) <= 1e3 * rounding(p, found)


@given(st.floats(0.05, 0.95), st.floats(1e-12, 1e-3), st.sampled_from(ENDS))
def test_a_polynomial_that_grazes_zero_passes_it_or_not(root: float, depth: float, end: float) -> None:
    """Oracle: (1 - t / root)^2 -+ depth has its first zero at root (1 - sqrt(depth)), or none."""
    square = with_roots([root, root])
    below, above = in_units_of(end, square), in_units_of(end, square)
    below[0], above[0] = 1.0 - depth, 1.0 + depth
    assert zero_of(above, end) == math.inf
    first = root * (1.0 - math.sqrt(depth))
    assert zero_of(below, end) == pytest.approx(first * end, rel=1e-3 * math.sqrt(depth) + 1e-14 / math.sqrt(depth))


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("end", ENDS)
def test_zeros_by_construction_are_passed_over(count: int, end: float) -> None:
    """Oracle: a power of time times a factor with chosen roots."""
    p = [0.0] * count + [end**-count * term for term in in_units_of(end, with_roots([0.625, 0.75], [(0.3, 0.4)]))]
    assert zero_of(p, end, count) == pytest.approx(0.625 * end, rel=1e-12)
    noisy = [1e-17] * count + p[count:]
    assert zero_of(noisy, end, count) == zero_of(p, end, count)


@pytest.mark.parametrize("p", [[0.0, 1.0], [-1.0, 3.0], [-1e-300, 0.0, 1.0], [0.0, -1.0], [0.0, 1.0, -2.0]])
def test_what_is_not_positive_at_first_is_zero_at_once(p: list[float]) -> None:
    """Oracle: zero is the first time."""
    assert zero_of(p, 1.0) == 0.0


def test_a_root_at_the_end_is_not_within_the_step() -> None:
    """Oracle: the step is half open; a root one part in 10^12 before its end is within."""
    assert zero_of([1.0, -1.0], 1.0) in (math.inf, 1.0)  # within rounding of the end either
    assert zero_of([1.0, -1.0], 1.0 - 1e-12) == math.inf
    assert zero_of([1.0, -1.0], 1.0 + 1e-12) == pytest.approx(1.0, rel=1e-14)
    assert zero_of([1.0, -3.0, 2.0], 0.5 - 1e-12) == math.inf
    assert zero_of([1.0, -3.0, 2.0], 0.5 + 1e-12) == pytest.approx(0.5, rel=1e-14)


@pytest.mark.parametrize("place", range(ORDER + 1))
@pytest.mark.parametrize("rest", [[1.0], [1.0, -2.0], [1.0, -4.0, 3.0], [1.0, -3.0, 5.0, -7.0]])
def test_a_term_that_is_no_number_ends_the_search(place: int, rest: list[float]) -> None:
    """Oracle: it returns."""
    for bad in (math.nan, math.inf, -math.inf):
        p = [*rest, *[0.0] * (ORDER + 1 - len(rest))]
        p[place] = bad
        with np.errstate(invalid="ignore"):
            zero_of(p, 1.0)
