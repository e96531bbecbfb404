"""Kinds of laws, and of any tuples, are told apart when kernels are compiled."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest

from sledenv.compiler.jit import by_type, kernel
from sledenv.kernel.laws import law_of_row
from sledenv.kernel.params import CompliantLaw, RigidLaw
from sledenv.simulation.scene import ContactLaw
from tests.compiled import compiled


class Two(NamedTuple):
    first: float
    second: float


class Checked(Two):
    __slots__ = ()


class Three(NamedTuple):
    first: float
    second: float
    third: float


@kernel
def _difference(scale: float, given: Any) -> float:
    return float(scale * (given.first - given.second))


@kernel
def _sum(scale: float, given: Any) -> float:
    return float(scale * (given.first + given.second))


_chosen = by_type(1, {Two: _difference}, _sum)


@compiled
def _choose(scale: float, given: Any) -> float:
    return float(_chosen(scale, given))


@compiled
def _again(like: Any, laws: np.ndarray) -> Any:
    return law_of_row(like, laws, 0)


@pytest.mark.parametrize(
    ("given", "expected"), [(Two(3.0, 2.0), 2.0), (Checked(3.0, 2.0), 2.0), (Three(3.0, 2.0, 1.0), 10.0)]
)
def test_the_type_of_a_tuple_chooses_the_kernel(given: Any, expected: float) -> None:
    """Oracle: the kernel by hand; a class that checks its fields counts as the one below it."""
    assert _choose(2.0, given) == expected


@pytest.mark.parametrize(("like", "kind"), [(CompliantLaw, CompliantLaw), (ContactLaw, CompliantLaw), (RigidLaw,) * 2])
def test_a_row_becomes_a_law_of_the_same_kind(like: Any, kind: Any) -> None:
    """Oracle: the fields; a law that checks its fields counts as the one below it."""
    row = np.arange(1.0, len(kind._fields) + 1.0) / 8.0  # which all laws accept
    made = _again(like._make((0.5 * row).tolist()), row[np.newaxis])
    assert type(made) is kind
    assert tuple(made) == tuple(row)
