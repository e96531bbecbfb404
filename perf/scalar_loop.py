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
from sledenv.kernel.descend import SPACE
from sledenv.kernel.entries import LIBRARY, run_descent
from sledenv.kernel.records import OUTCOME, REBOUND, TRAJECTORY
from sledenv.kernel.state import new
from sledenv.simulation.checks import checked_descent

# Result and error, of which there are none; numbers; log, spaces, trajectory and outcome with their lengths; once.
_SIGNATURE = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_int64] * 12)
_ROW = OUTCOME.itemsize


@functools.cache
def _loop(name: str) -> Callable[..., None]:
    """Return the loop around the entry of a name, which is called by its address."""
    descend = _SIGNATURE(LIBRARY.find(name))

    @numba.njit
    def loop(numbers: Any, place: int, starts: Any, nowhere: Any, log: Any, space: Any, path: Any, ends: Any) -> None:
        for i in range(starts.shape[0]):
            for j in range(starts.shape[1]):
                numbers[place + j] = starts[i, j]
            none, end = nowhere.ctypes.data, ends.ctypes.data + i * _ROW
            given, rows, work, samples = numbers.ctypes.data, log.ctypes.data, space.ctypes.data, path.ctypes.data
            descend(none, none, given, rows, log.size, work, space.size, samples, path.size, end, 1, 0)

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
    touching, limits = checked_descent(body, law, slope, State(*starts[0]), settings).touching, settings.limits
    log, path, outcomes = np.zeros(max_rebounds, REBOUND), np.zeros(0, TRAJECTORY), np.zeros(len(starts), OUTCOME)
    loop = _loop(run_descent(touching).name)
    numbers, nowhere = np.array([*body, *touching, *slope, *starts[0], *limits]), np.zeros(2)
    place = len(body) + len(touching) + len(slope)  # of the launch among the numbers

    def run() -> np.ndarray:
        loop(numbers, place, starts, nowhere, log, new(SPACE), path, outcomes)
        return outcomes

    return run
