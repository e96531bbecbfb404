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

from sledenv import Body, ContactLaw, Settings, Slope
from sledenv.kernel.contacts import SPACE
from sledenv.kernel.entries import LIBRARY, run_lanes
from sledenv.kernel.params import SCENE
from sledenv.kernel.records import OUTCOME, REBOUND
from sledenv.simulation.checks import checked_scenes
from sledenv.simulation.simulator import at_launch

# Result and error, which mean nothing; numbers; whether surfaces are rigid; tables with their lengths; work space;
# the last lane.
_SIGNATURE = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_int64] * 26)
_NOWHERE = 16  # bytes before the numbers, into which these two are written
_SCENE, _ROW = SCENE.itemsize, OUTCOME.itemsize


@functools.cache
def _loop() -> Callable[..., None]:
    """Return the loop around the entry, called by its address for one lane after the other."""
    descend = _SIGNATURE(LIBRARY.find(run_lanes.name))

    @numba.njit
    def loop(
        rigid: int, numbers: Any, rows: Any, bodies: Any, pieces: Any, zones: Any, log: Any, space: Any, ends: Any
    ) -> None:
        nowhere, here = numbers.ctypes.data, numbers.ctypes.data + _NOWHERE
        for i in range(rows.shape[0]):
            space[0]["lane"] = 0.0
            row, end = rows.ctypes.data + i * _SCENE, ends.ctypes.data + i * _ROW
            descend(
                nowhere, nowhere, here, rigid, row, 1, bodies.ctypes.data, bodies.size,
                pieces.ctypes.data, pieces.size, zones.ctypes.data, zones.shape[0], zones.shape[1], here, 0, 2,
                end, 1, log.ctypes.data, 1, log.size, here, 0, space.ctypes.data, 1, 1,
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
    settings = Settings(solver=solver, max_rebounds=max_rebounds)
    scenes = checked_scenes(body, law, slope, launches, settings)
    log, numbers = np.zeros(max_rebounds, REBOUND), np.array([0.0, 0.0, *settings.limits])
    loop = _loop()

    def run() -> np.ndarray:
        outcomes = at_launch(scenes)
        loop(int(solver == "rigid"), numbers, *scenes.given, log, np.zeros(1, SPACE), outcomes)
        return outcomes

    return run
