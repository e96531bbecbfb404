"""The work that ``python -m perf versus`` times, and the process that does it in one of two trees.

Both trees are given the same work by the same code, that of this folder, which knows public names of sledenv alone.
Everything runs on one thread.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

import sledenv
from perf.env import IDS, SINGLE, scalar, vector
from perf.harness import timed
from perf.reference import BODY, FEW, LAUNCH, LAW, MANY, SLOPE, launches

_LANES = 1024


class Workload(NamedTuple):
    """A piece of work that is timed."""

    about: str
    unit: str  # of work
    prepare: Callable[[], tuple[Callable[[], Any], float]]  # gives a run, and how many units it does


def _batch(launched: Any, solver: Any = "compliant", rebounds: int = FEW) -> tuple[Callable[[], Any], float]:
    settings = sledenv.Settings(solver, max_rebounds=rebounds)
    run = partial(sledenv.simulate_batch, BODY, LAW, SLOPE, launched, settings)
    return run, float(run().outcomes["rebounds"].sum())


_COPIES = np.tile(LAUNCH, (64, 1))
WORKLOADS: dict[str, Workload] = {
    "simulate": Workload(
        "simulate() of the reference descent, 5 rebounds",
        "rebound",
        lambda: (partial(sledenv.simulate, BODY, LAW, SLOPE, LAUNCH, max_rebounds=FEW), FEW),
    ),
    "batch": Workload("64 copies of it by simulate_batch", "rebound", lambda: _batch(_COPIES)),
    "settling": Workload(
        "the same, 20 rebounds, with settled rolling", "rebound", lambda: _batch(_COPIES, rebounds=MANY)
    ),
    "random": Workload("1,000 random launches by simulate_batch", "rebound", lambda: _batch(launches(1000))),
    "rigid": Workload("the same on rigid surfaces", "rebound", lambda: _batch(launches(1000), "rigid")),
    "step": Workload("SledDescent by gym.make", "step", lambda: (scalar(gym.make(IDS["SledDescent"])), SINGLE)),
    "launches": Workload("native vector env of SledLaunch", "step", lambda: (vector("SledLaunch", _LANES), _LANES)),
    "rides": Workload("native vector env of SledDescent", "step", lambda: (vector("SledDescent", _LANES), _LANES)),
}


def main() -> None:
    """Prepare the workloads that are named, one per line, and time the last one at each empty line.

    A name is answered by its units of work, an empty line by the CPU time [s] per unit, an error by its words.
    """
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what a library prints is no answer
    measure: Callable[[], float] | None = None
    for order in sys.stdin:
        answer: float | str
        try:
            if name := order.strip():
                measure = None
                run, answer = WORKLOADS[name].prepare()
                measure = timed(run, answer)
            else:
                answer = measure() if measure else "nothing is prepared"
        except Exception as error:
            answer = f"{type(error).__name__}: {error}".splitlines()[0]
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
