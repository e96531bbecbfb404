"""Arguments that Python passes to compiled code, and those that it refuses to pass."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

ROWS = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 30.0]])


@pytest.fixture
def module(tiny: Any) -> Any:
    """Return the tiny library, whose object file is at hand."""
    tiny.shipped.write_bytes(tiny.made)
    return tiny.load()


def test_every_kind_of_argument_arrives(module: Any) -> None:
    """Oracle: by hand; records outside the range stay as they are."""
    sums = np.zeros(3, module.SUM)
    module.add_up(module.Weights(1.0, 0.5), ROWS, sums, 2.0, 1, 3, True)
    assert sums.tolist() == [(0, 0.0), (1, -24.0), (1, -36.0)]


def test_numbers_may_follow_later(module: Any) -> None:
    """Oracle: by hand; a table that nobody else keeps lives on."""
    sums = np.zeros(3, module.SUM)
    run = module.add_up.prepared(module.Weights(1.0, 0.5), ROWS.copy(), sums, 1.0)
    for i in (2, 0, 2):
        run(i, i + 1, False)
    assert sums.tolist() == [(1, 6.0), (0, 0.0), (2, 36.0)]


SWAPPED = ROWS.astype(ROWS.dtype.newbyteorder())


@pytest.mark.jit_only
@pytest.mark.parametrize(
    "wrong",
    [ROWS.astype("f4"), ROWS.astype("i8"), SWAPPED, ROWS[0], ROWS[:, np.newaxis], ROWS[:, ::-1], ROWS.T],
    ids=str,
)
def test_an_array_of_another_type_or_layout_is_refused(wrong: np.ndarray, module: Any) -> None:
    """Oracle: the message; nothing has been written."""
    sums = np.zeros(3, module.SUM)
    with pytest.raises(TypeError, match="add_up takes Table"):
        module.add_up(module.Weights(1.0, 0.5), wrong, sums, 2.0, 0, 2, False)
    assert not sums["count"].any()


def test_plain_python_runs_where_nothing_is_to_be_compiled(tiny: Any) -> None:
    """Oracle: what compiled code gives, in a process that loads no numba and does not say that it makes an object."""
    program = "print(tiny.known(), 'numba' in sys.modules)"
    assert tiny.start(program, NUMBA_DISABLE_JIT="1").communicate() == (f"{tiny.known} False\n", "")
