"""The scalar kernel in a plain compiled loop, one descent after the other: what a batch kernel has to beat.

It looks below the public names of sledenv, so ``perf versus`` runs that of each tree, and it takes nothing from this
folder.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from sledenv import Body, ContactLaw, Settings, Slope, State
from sledenv.compiler.entries import entry
from sledenv.kernel.descend import SPACE, descend
from sledenv.kernel.laws import Law
from sledenv.kernel.params import Limits
from sledenv.kernel.records import OUTCOME, REBOUND, TRAJECTORY
from sledenv.kernel.state import new
from sledenv.simulation.checks import checked_descent


# The cache notices changes of the kernel, not of this loop.
@entry
def _loop(
    body: Body, law: Law, slope: Slope, starts: Any, limits: Limits, log: Any, spaces: Any, path: Any, outcomes: Any
) -> None:
    for i in range(starts.shape[0]):
        z = starts[i]
        launch = State(z[0], z[1], z[2], z[3], z[4], z[5])
        descend(body, law, slope, launch, limits, log, spaces, path, outcomes[i : i + 1], False)


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

    def run() -> np.ndarray:
        _loop(body, touching, slope, starts, limits, log, new(SPACE), path, outcomes)
        return outcomes

    return run
