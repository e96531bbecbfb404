"""Fused multiply-adds of numbers and vectors; python multiply.py FOLDER TARGET makes their object."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from sledenv.compiler.entries import Table
from sledenv.compiler.library import Library
from sledenv.compiler.rows import element
from sledenv.compiler.trace import block, scalar
from sledenv.compiler.values import fma

EIGHT = 8
_one = scalar(lambda a, b, c: (fma(a, b, c),))


def _vector(a, b, c):  # type: ignore[no-untyped-def]
    vector = fma(block(a, 0, EIGHT), block(b, 0, EIGHT), block(c, 0, EIGHT))
    return tuple(element(vector, i) for i in range(EIGHT))


_eight = scalar(_vector)


def _multiply(a: np.ndarray, b: np.ndarray, c: np.ndarray, ones: np.ndarray, eights: np.ndarray) -> None:
    """Write the results of eight cases in a row, one by one and all at once."""
    for i in range(a.shape[0]):
        for k in range(EIGHT):
            ones[i, k] = _one(a[i, k], b[i, k], c[i, k])[0]
        found = _eight(a[i], b[i], c[i])
        for k in range(EIGHT):
            eights[i, k] = found[k]


LIBRARY = Library(Path(__file__), Path(__file__).parent)
multiply = LIBRARY.entry("multiply", _multiply, *[Table(np.dtype(float), 2)] * 5)

if __name__ == "__main__":
    from sledenv.compiler.build import make

    make(LIBRARY, Path(sys.argv[1]), sys.argv[2:])
