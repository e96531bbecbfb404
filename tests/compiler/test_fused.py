"""The fused multiply-add of processors that have no such instruction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sledenv.compiler import fused
from sledenv.compiler.targets import OTHER, target_of
from tests.compiled import compiled
from tests.compiler import multiply
from tests.fused import fused_exactly, hard_cases

pytestmark = pytest.mark.jit_only


def same_bits(found: np.ndarray, cases: np.ndarray) -> None:
    """Compare with fractions, signs of zeros included."""
    expected = np.array([fused_exactly(*case) for case in cases.tolist()])
    np.testing.assert_array_equal(found.view(np.int64), expected.view(np.int64))


def test_whole_numbers_decide_every_case() -> None:
    """Oracle: fractions; of all cases, also those for which additions would do."""
    exactly, cases = compiled(fused.exactly), hard_cases(100_000, seed=1)
    same_bits(np.array([exactly(*case) for case in cases.tolist()]), cases)


@pytest.mark.skipif(target_of(OTHER).fused, reason="the general processor of this kind has the instruction")
def test_an_older_processor_rounds_once(tmp_path: Path) -> None:
    """Oracle: fractions; one by one and as vectors, in an object without the instruction."""
    multiply.LIBRARY.make(tmp_path, OTHER)
    multiply.LIBRARY.load((tmp_path / f"{OTHER}.kernel").read_bytes().partition(b"\n")[2])
    cases = hard_cases(100_000, seed=2)
    a, b, c = (np.ascontiguousarray(cases[:, i].reshape(-1, multiply.EIGHT)) for i in range(3))
    ones, eights = np.empty_like(a), np.empty_like(a)
    multiply.multiply(a, b, c, ones, eights)
    same_bits(ones.ravel(), cases)
    same_bits(eights.ravel(), cases)
