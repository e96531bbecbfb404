"""Straight-line programs: what they compute."""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
import pytest

from sledenv.compiler.trace import scalar, straight
from sledenv.compiler.values import (
    absolute,
    equal,
    fma,
    larger,
    less,
    nearest,
    not_more,
    root,
    sign,
    sine_cosine,
    smaller,
    where,
    where_less,
    with_sign,
)
from sledenv.kernel.state import new, record
from tests.compiled import compiled

GIVEN = record(*((name, "f8") for name in ("x", "y", *(f"answer_{i}" for i in range(9)))))


def _samples(given: Any) -> None:
    x, y = given.x, given.y
    given.answer_0, given.answer_1 = sine_cosine(x)
    given.answer_2 = smaller(x, y)
    given.answer_3 = absolute(x) + 2.0 - 1.0 / y
    given.answer_4 = where_less(x, 0.5, 1.0, -y)
    given.answer_5 = 3.0 * x + 4.0 * y
    given.answer_6 = fma(x, y, -2.0)
    given.answer_7 = 4.0
    given.answer_8 = given.answer_7 + given.answer_2  # what has just been written


def _mixture(given: Any) -> None:
    x, y = given.x, given.y
    given.answer_0, given.answer_1 = sine_cosine(x)
    given.answer_2 = root(x * x + y)
    given.answer_3 = nearest(x / y)
    given.answer_4 = fma(x, y, -absolute(y))
    given.answer_5 = where(less(x, y) & ~not_more(y, 0.5), larger(x, y), smaller(x, y))
    given.answer_6 = 3.0
    given.answer_7 = where(equal(x, y), sign(x), with_sign(x, y))
    given.x = x + y  # the old one is not asked for again
    given.answer_8 = given.x - x


_program, _mixed = straight(_samples), straight(_mixture)
_sum = scalar(lambda x, y: (x + y, x - y))


class Pair(NamedTuple):
    """A tuple that programs read like a record."""

    x: float
    y: float


_weigh = scalar(lambda pair, given, s: (pair.x * given.x + s, root(pair.y)))


@compiled
def _run(given: np.ndarray) -> None:
    _program(given[0])


@compiled
def _mix(given: np.ndarray) -> None:
    _mixed(given[0])


@compiled
def _sums(x: float, y: float) -> tuple[float, float]:
    return _sum(x, y)


@compiled
def _weighed(pair: Pair, given: np.ndarray, s: float) -> tuple[float, float]:
    return _weigh(pair, given[0], s)


def answers(x: float, y: float) -> np.ndarray:
    """Run the program."""
    given = new(GIVEN)
    given["x"], given["y"] = x, y
    _run(given)
    return np.array([given[0][f"answer_{i}"] for i in range(9)])


def _mixed_in_python(x: float, y: float) -> list[float]:
    chosen = max(x, y) if x < y and not y <= 0.5 else min(x, y)
    signed = math.copysign(x, y) if x != y else math.copysign(1.0, x) if x else x
    return [math.sin(x), math.cos(x), math.sqrt(x * x + y), round(x / y), x * y - abs(y), chosen, 3.0, signed, y]


def test_a_mixture_of_choices_and_roots() -> None:
    """Oracle: the same in Python; what is written does not change what has been read before."""
    odd = [0.0, -0.0, 5e-324, 1e-300, math.pi, -math.pi / 4.0, 0.5, 6.0]
    pairs = [*itertools.product(odd, [0.5, 3.0, math.pi]), *np.random.default_rng(1).uniform(0.1, 5.0, (200, 2))]
    for x, y in pairs:
        given = new(GIVEN)
        given["x"], given["y"] = x, y
        _mix(given)
        answers = [given[0][f"answer_{i}"] for i in range(9)]
        assert answers == pytest.approx(_mixed_in_python(x, y), rel=1e-15, abs=2e-15)


def test_a_function_of_numbers_gives_all_its_answers() -> None:
    """Oracle: by hand."""
    assert _sums(1.5, 0.25) == (1.75, 1.25)


def test_a_function_of_numbers_reads_tuples_and_records() -> None:
    """Oracle: by hand."""
    given = new(GIVEN)
    given["x"] = 3.0
    assert _weighed(Pair(2.0, 16.0), given, 0.5) == (6.5, 4.0)


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
        4.0 + min(x, y),
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
