"""The scalar kernel in a plain compiled loop, one descent after the other: what a batch kernel has to beat.

The loop alone is compiled here; the kernel is that of the object file which Python calls. It looks below the public
names of sledenv, so ``perf versus`` runs that of each tree, and it takes nothing from this folder.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable
from typing import Any, Literal

import numba
import numpy as np
from numpy.typing import ArrayLike

from sledenv import Body, ContactLaw, Settings, Slope, State
from sledenv.kernel.contacts import SPACE
from sledenv.kernel.entries import LIBRARY, run_lanes
from sledenv.kernel.records import OUTCOME, REBOUND
from sledenv.simulation.checks import checked_descent
from sledenv.simulation.simulate import put_at_launch

# Result and error, which mean nothing; numbers; whether surfaces are rigid; tables with their lengths; work space;
# the last lane.
_SIGNATURE = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_int64] * 33)
_NOWHERE = 16  # bytes before the numbers, into which these two are written
_LAUNCH, _ROW = 8 * len(State._fields), OUTCOME.itemsize


@functools.cache
def _loop() -> Callable[..., None]:
    """Return the loop around the entry, called by its address for one lane after the other."""
    descend = _SIGNATURE(LIBRARY.find(run_lanes.name))

    @numba.njit
    def loop(
        rigid: int,
        numbers: Any,
        body: Any,
        law: Any,
        slope: Any,
        starts: Any,
        track: Any,
        ground: Any,
        log: Any,
        space: Any,
        ends: Any,
    ) -> None:
        nowhere, here = numbers.ctypes.data, numbers.ctypes.data + _NOWHERE
        for i in range(starts.shape[0]):
            space[0]["lane"] = 0.0
            start, end = starts.ctypes.data + i * _LAUNCH, ends.ctypes.data + i * _ROW
            descend(
                nowhere, nowhere, here, rigid, body.ctypes.data, 1, law.ctypes.data, 1, law.size,
                slope.ctypes.data, 1, slope.size, start, 1, starts.shape[1], here, 0, 2,
                track.ctypes.data, 1, 2,
                ground.ctypes.data, ground.size, end, 1, log.ctypes.data, 1, log.size, here, 0, space.ctypes.data, 1, 1,
            )  # fmt: skip

    return loop  # type: ignore[no-any-return]


def scalar_loop(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    launches: ArrayLike,
    solver: Literal["compliant", "rigid"] = "compliant",
    max_rebounds: int = 1000,
) -> Callable[[], np.ndarray]:
    """Return a function that simulates the launches, shape (N, 6), one by one, and returns their outcomes."""
    starts = np.array(launches, dtype=float, ndmin=2)
    settings = Settings(solver=solver, max_rebounds=max_rebounds)
    lanes = checked_descent(body, law, slope, State(*starts[0]), settings).lanes
    rigid, limits, *_, track, ground = lanes.tables(settings.limits)
    log = np.zeros(max_rebounds, REBOUND)
    loop = _loop()
    numbers, law_row, slope_row = (np.array(one, float) for one in ((0.0, 0.0, *limits), lanes.laws[0], slope[:3]))

    def run() -> np.ndarray:
        outcomes = np.zeros(len(starts), OUTCOME)
        put_at_launch(outcomes, starts)
        loop(rigid, numbers, body.record, law_row, slope_row, starts, track, ground, log, np.zeros(1, SPACE), outcomes)
        return outcomes

    return run
