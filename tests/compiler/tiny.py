"""A tiny library of compiled entries, and the program that makes its object files: python tiny.py FOLDER TARGET..."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sledenv.compiler.entries import Table
from sledenv.compiler.jit import kernel
from sledenv.compiler.library import Library


class Weights(NamedTuple):
    """Factors of the columns."""

    first: float
    second: float


SUM = np.dtype([("count", "i8"), ("value", "f8")])


@kernel
def _weighed(weights: Weights, row: np.ndarray) -> float:
    return float(weights.first * row[0] + weights.second * row[1])


def _add_up(
    weights: Weights, rows: np.ndarray, sums: np.ndarray, factor: float, first: int, last: int, negative: bool
) -> None:
    """Add to each sum, from the first to before the last, what its row weighs."""
    for i in range(first, last):
        value = factor * _weighed(weights, rows[i])
        sums[i]["value"] += -value if negative else value
        sums[i]["count"] += 1


LIBRARY = Library(Path(__file__), Path(__file__).parent)
KINDS = (Weights, Table(np.dtype(float), 2), Table(SUM), float, int, int, bool)
add_up = LIBRARY.entry("add_up", _add_up, *KINDS)


def known() -> str:
    """Sum of one row."""
    sums = np.zeros(1, SUM)
    add_up(Weights(1.0, 1e-3), np.array([[2.0, 3.0]]), sums, 1.1, 0, 1, False)
    return sums.tobytes().hex()


LIBRARY.known = known

if __name__ == "__main__":
    from sledenv.compiler.build import make

    make(LIBRARY, Path(sys.argv[1]), sys.argv[2:])
