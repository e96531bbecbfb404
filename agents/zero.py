"""The zero action: the middle of the control bounds, or no trim, whatever the context."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .untrained import Untrained


class Agent(Untrained):
    """Launches upright and without spin where the bounds are symmetric; leaves the rotor of a ride at rest."""

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.zeros((len(observations), self.problem.actions), np.float32)
