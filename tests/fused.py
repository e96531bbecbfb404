"""Fused multiply-adds in exact arithmetic, and cases in which a shortcut would round wrongly."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np


def fused_exactly(a: float, b: float, c: float) -> float:
    """``a * b + c`` rounded once, by fractions; of what is infinite or zero as plain arithmetic has it."""
    if not (math.isfinite(a) and math.isfinite(b)) or a == 0.0 or b == 0.0:
        return a * b + c
    if not math.isfinite(c):
        return c
    exact = Fraction(a) * Fraction(b) + Fraction(c)
    if exact == 0:
        return a * b + c if c == 0.0 else 0.0
    try:
        size = float(abs(exact))
    except OverflowError:
        size = math.inf
    return size if exact > 0 else -size


def hard_cases(count: int, seed: int = 0) -> np.ndarray:
    """Cases (a, b, c), shape (count, 3): near ties, cancellation, subnormal results, overflow, few bits, any bits."""
    rng = np.random.default_rng(seed)
    kinds = [_few_bits, _cancelling, _near_ties, _tiny, _huge, _apart, _plain]
    parts = [kind(rng, count // len(kinds) + 1) for kind in kinds]
    cases = np.concatenate(parts)[:count]
    special = np.array([0.0, -0.0, 1.0, -1.5, math.inf, -math.inf, 5e-324, -5e-324, 1.7976931348623157e308, 2.0**-1022])
    grid = np.stack(np.meshgrid(special, special, special), -1).reshape(-1, 3)
    grid = grid[~np.isnan([fused_exactly(*case) for case in grid.tolist()])]  # the bits of NaN are nobody's promise
    return np.concatenate([grid, cases])[:count]


def _any(rng: np.random.Generator, shape: tuple[int, ...], low: int, high: int, bits: int = 52) -> np.ndarray:
    """Numbers with so many random bits behind the first one."""
    mantissa = 1.0 + rng.integers(0, 2**bits, shape) * 2.0**-bits
    return np.ldexp(mantissa * rng.choice([-1.0, 1.0], shape), rng.integers(low, high, shape))


def _plain(rng: np.random.Generator, count: int) -> np.ndarray:
    return _any(rng, (count, 3), -40, 40)


def _few_bits(rng: np.random.Generator, count: int) -> np.ndarray:
    return np.where(rng.random((count, 3)) < 0.5, _any(rng, (count, 3), -60, 60, 3), _any(rng, (count, 3), -30, 30))


def _cancelling(rng: np.random.Generator, count: int) -> np.ndarray:
    cases = _any(rng, (count, 3), -400, 400)
    cases[:, 2] = -cases[:, 0] * cases[:, 1] * (1.0 + rng.integers(-2, 3, count) * 2.0**-52)
    return cases


def _near_ties(rng: np.random.Generator, count: int) -> np.ndarray:
    """The product is just beside half a unit in the last place of c, or beside a quarter."""
    c = _any(rng, (count,), -300, 300, 52)
    near = np.spacing(np.abs(c)) * rng.choice([0.5, 0.25, 0.75, 1.5], count)
    b = 1.0 + rng.integers(-3, 4, count) * 2.0 ** -rng.integers(20, 52, count).astype(float)
    a = near * (1.0 + rng.integers(-3, 4, count) * 2.0 ** -rng.integers(20, 52, count).astype(float))
    return np.stack([a * rng.choice([-1.0, 1.0], count), b, c], -1)


def _tiny(rng: np.random.Generator, count: int) -> np.ndarray:
    """Results that are subnormal, or so small that errors of products are."""
    a, b = _any(rng, (count,), -600, -400), _any(rng, (count,), -600, -400)
    c = np.where(rng.random(count) < 0.5, _any(rng, (count,), -1080, -960), 5e-324 * rng.integers(-9, 9, count))
    return np.stack([a, b, c], -1)


def _huge(rng: np.random.Generator, count: int) -> np.ndarray:
    return np.stack([_any(rng, (count,), 450, 1024), _any(rng, (count,), 0, 574), _any(rng, (count,), 990, 1024)], -1)


def _apart(rng: np.random.Generator, count: int) -> np.ndarray:
    return _any(rng, (count, 3), -1022, 1024)
