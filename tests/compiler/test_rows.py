"""Rows of coefficients in vector instructions, against the same in numpy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sledenv.compiler import rows
from sledenv.compiler.rows import WIDTH, sums
from sledenv.compiler.trace import scalar, straight
from sledenv.compiler.values import rough_angle, rough_root
from sledenv.kernel.state import new, record
from tests.compiled import compiled

ANSWERS = (
    "powers",
    "without_constant",
    "times",
    "moved_on",
    "with_first",
    "sums_from",
    "of",
    "numbers",
    "values",
)
HANDLED = record(("series", "f8", (WIDTH,)), *((name, "f8", (WIDTH,)) for name in ANSWERS))
VECTORS = 11  # more than are summed at once


def _handled(given: Any) -> None:
    """Write what each function makes of a series."""
    row = rows.read(given.series)
    s = given.series[1]
    given.powers = rows.powers(s)
    given.without_constant = rows.without_constant(row)
    given.times = rows.times(row, rows.COUNT)
    given.moved_on = rows.moved_on(row, s)
    given.with_first = rows.with_first(row, s)
    given.sums_from = rows.sums_from(row)
    given.of = rows.of([given.series[2], 7.0, given.series[3]])
    many = [row[i % 3] * float(i + 1) for i in range(VECTORS)]
    given.numbers = rows.of([*sums([rows.added(row), rows.sizes(row)]), *sums(many)])
    given.values = [rows.values(given.series, 19, row[0] * 0.01), row[1], row[2]]


_program = straight(_handled)
ORDERS = (15, 17, 18)
_root = scalar(lambda a: tuple(rough_root(a, n) for n in ORDERS))
_angle = scalar(lambda sine, cosine: (rough_angle(sine, cosine),))


@compiled
def _run(given: np.ndarray) -> None:
    _program(given[0])


@compiled
def _run_root(a: float) -> tuple[float, float, float]:
    return _root(a)


@compiled
def _run_angle(sine: float, cosine: float) -> float:
    return _angle(sine, cosine)[0]


def test_rows_are_handled_as_numpy_does() -> None:
    """Oracle: numpy, on random coefficients of both signs and all sizes."""
    for seed in range(20):
        generator = np.random.default_rng(seed)
        z = generator.normal(size=WIDTH) * 10.0 ** generator.uniform(-3.0, 1.0, WIDTH)
        given = new(HANDLED)
        given["series"] = z
        _run(given)
        c = given[0]
        s = z[1]
        count = np.arange(WIDTH)
        weights = np.arange(1.0, VECTORS + 1)
        parts = z.reshape(-1, rows.EIGHT)
        numbers = [z.sum(), np.abs(z[2:]).sum(), *(w * parts[i % 3].sum() for i, w in enumerate(weights))]
        tolerance = {"rel": 1e-13, "abs": 1e-13 * np.abs(z).sum() * VECTORS}
        assert c["powers"] == pytest.approx(s**count, rel=1e-14)
        assert np.array_equal(c["without_constant"], [0.0, *z[1:]])
        assert np.array_equal(c["times"], z * count)
        assert np.array_equal(c["moved_on"], [s, *z[:-1]])
        assert np.array_equal(c["with_first"], [s, *z[1:]])
        assert c["sums_from"] == pytest.approx(np.cumsum(z[::-1])[::-1], **tolerance)
        assert np.array_equal(c["of"], [z[2], 7.0, z[3], *np.zeros(WIDTH - 3)])
        assert c["numbers"] == pytest.approx([*numbers, *np.zeros(WIDTH - len(numbers))], **tolerance)
        assert c["values"][: rows.EIGHT] == pytest.approx(np.polyval(z[18::-1], 0.01 * z[: rows.EIGHT]), **tolerance)


def test_a_rough_root_is_at_most_two_thousandths_too_small() -> None:
    """Oracle: the power function; a step must not come out too long."""
    for a in 10.0 ** np.random.default_rng(0).uniform(-300.0, 300.0, 20_000):
        for n, found in zip(ORDERS, _run_root(a), strict=True):
            assert 0.998 <= found / a ** (1.0 / n) <= 1.0
    assert max(_run_root(0.0)) < 1e-15
    assert np.isnan(_run_root(math.nan)).all()
    assert np.isnan(_run_root(math.inf)).all()


def test_a_rough_angle_is_right_to_a_thousandth_in_every_quarter() -> None:
    """Oracle: atan2, whatever the lengths of the arguments."""
    for angle in np.linspace(-math.pi, math.pi, 5001)[1:-1]:
        for length in (1e-200, 1.0, 1e200):
            found = _run_angle(length * math.sin(angle), length * math.cos(angle))
            assert abs(found - angle) < 1e-3
            assert _run_angle(-length * math.sin(angle), length * math.cos(angle)) == -found
    assert math.isnan(_run_angle(math.nan, 1.0))
    assert math.isnan(_run_angle(0.0, 0.0))
