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
from sledenv.kernel.descend import SPACE as RIGID_SPACE
from sledenv.kernel.entries import LIBRARY, run_lanes, run_rigid_lanes
from sledenv.kernel.params import RigidLaw
from sledenv.kernel.records import OUTCOME, REBOUND
from sledenv.kernel.state import new
from sledenv.simulation.checks import checked_descent
from sledenv.simulation.profiles import laid
from sledenv.simulation.simulate import put_at_launch

# Result and error, of which there are none; numbers; tables with their lengths; work space; the last lane.
_RIGID_SIGNATURE = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_int64] * 27)
_SIGNATURE = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_int64] * 29)
_LAUNCH, _ROW = 8 * len(State._fields), OUTCOME.itemsize


@functools.cache
def _rigid_loop() -> Callable[..., None]:
    """Return the loop around the entry of rigid surfaces, called by its address for one lane after the other."""
    descend = _RIGID_SIGNATURE(LIBRARY.find(run_rigid_lanes.name))

    @numba.njit
    def loop(
        numbers: Any, body: Any, law: Any, slope: Any, starts: Any, ground: Any, log: Any, space: Any, ends: Any
    ) -> None:
        here = numbers.ctypes.data
        for i in range(starts.shape[0]):
            space[0]["lane"] = 0.0
            start, end = starts.ctypes.data + i * _LAUNCH, ends.ctypes.data + i * _ROW
            descend(
                here, here, here, body.ctypes.data, 1, law.ctypes.data, 1, law.size,
                slope.ctypes.data, 1, slope.size, start, 1, starts.shape[1], here, 0, 2, end, 1,
                log.ctypes.data, 1, log.size, here, 0, space.ctypes.data, 1, 1,
            )  # fmt: skip

    return loop  # type: ignore[no-any-return]


@functools.cache
def _loop() -> Callable[..., None]:
    """Return the same around the entry of compliant surfaces."""
    descend = _SIGNATURE(LIBRARY.find(run_lanes.name))

    @numba.njit
    def loop(
        numbers: Any, body: Any, law: Any, slope: Any, starts: Any, ground: Any, log: Any, space: Any, ends: Any
    ) -> None:
        here = numbers.ctypes.data
        for i in range(starts.shape[0]):
            space[0]["lane"] = 0.0
            start, end = starts.ctypes.data + i * _LAUNCH, ends.ctypes.data + i * _ROW
            descend(
                here, here, here, body.ctypes.data, 1, law.ctypes.data, 1, law.size,
                slope.ctypes.data, 1, slope.size, start, 1, starts.shape[1], here, 0, 2, ground.ctypes.data, 1, end, 1,
                log.ctypes.data, 1, log.size, here, 0, space.ctypes.data, 1, 1,
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
    touching, limits = checked_descent(body, law, slope, State(*starts[0]), settings).touching, settings.limits
    log = np.zeros(max_rebounds, REBOUND)
    rigid = isinstance(touching, RigidLaw)
    loop = _rigid_loop() if rigid else _loop()
    numbers = np.array([*touching, *limits] if rigid else limits)
    rows, ground = [np.array(one, float) for one in (touching, slope[:3])], laid(slope.vertices)

    def run() -> np.ndarray:
        outcomes = np.zeros(len(starts), OUTCOME)
        put_at_launch(outcomes, starts)
        loop(numbers, body.record, *rows, starts, ground, log, new(RIGID_SPACE if rigid else SPACE), outcomes)
        return outcomes

    return run
