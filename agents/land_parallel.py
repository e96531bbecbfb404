"""Land parallel to the ground: the trim with which a sled turns until it lands as the ground there slopes."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.simulation.outlook import look_out
from sledenv.simulation.scenes import Scenes

from .untrained import Untrained

_TURN: Final = 2.0 * np.pi


class Agent(Untrained):
    """Turns the body so that it has the pose of the ground where its mass centre comes as low as it is when it lies.

    The mass centre flies a parabola, and the spin does not change: closed forms tell where the flight ends and which
    spin ends it parallel to the ground, up to whole turns. A part that touches before is left out.
    """

    def __init__(self, problem: Problem) -> None:
        problem.must_be("descent", "land_parallel")
        super().__init__(problem)

    def plan(self, scenes: Scenes, flights: np.ndarray | None) -> NDArray[np.float32]:
        rider = self.problem.scenario.rider
        if rider is None or flights is None:
            return np.zeros((len(scenes.rows), 1), np.float32)
        time, _, pitch, *_ = look_out(scenes, flights).landings.T
        turn, omega = pitch - flights["phi"], flights["omega"]
        wanted = (turn - _TURN * np.rint((turn - omega * time) / _TURN)) / time
        trims = wanted - omega + flights["trim_spin"]
        return np.asarray(np.clip(trims / rider.trim_rad_s, -1.0, 1.0)[:, np.newaxis], np.float32)
