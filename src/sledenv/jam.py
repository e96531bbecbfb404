"""How much a rebound or a descent jams: gradual loss, of which being stuck is the extreme; docs/environments.md."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sledenv.kernel.records import FINISH, NON_FINITE


class ReboundJam(NamedTuple):
    """Jam metrics of each rebound, arrays of shape (n,)."""

    grip: np.ndarray  # [-] |tangential impulse| / (friction * normal impulse), 1 where the contact slid throughout
    tangential_loss: np.ndarray  # [-] clip(1 - u_after / u_before, 0, 1)
    stuck: np.ndarray  # bool: neither velocity along the slope nor spin is left
    nearly_stuck: np.ndarray  # bool: both are below 5 % of the entry speed


class DescentJam(NamedTuple):
    """Jam metrics of a descent, floats or arrays of shape (n,)."""

    progress: np.ndarray  # [-] x_end / length, clipped to [0, 1]; 0 on a slope without end
    retention: (
        np.ndarray
    )  # [-] kinetic energy along the slope at the finish over all energy supplied; 0 unless finished
    reward: np.ndarray  # [-] progress / 2 + sqrt(retention) / 2, in [0, 1]

    @property
    def jam_index(self) -> np.ndarray:
        """1 - reward: 0 for a descent that lost nothing, 1 for one that never moved."""
        return 1.0 - self.reward


def rebound_jam(rebounds: np.ndarray, friction: float) -> ReboundJam:
    """Return the jam metrics of each row of ``rebounds`` (a REBOUND array) at Coulomb coefficient ``friction``."""
    available = friction * rebounds["normal_impulse"]
    grip = np.divide(
        np.abs(rebounds["tangential_impulse"]), available, out=np.zeros(rebounds.shape), where=available > 0.0
    )
    before = rebounds["u_before"]
    kept = np.divide(rebounds["u_after"], before, out=np.ones(rebounds.shape), where=before != 0.0)
    return ReboundJam(grip, np.clip(1.0 - kept, 0.0, 1.0), rebounds["stuck"] == 2, rebounds["stuck"] >= 1)


def descent_jam(outcomes: np.ndarray | np.void, mass: float, length: np.ndarray | float) -> DescentJam:
    """Return the jam metrics of ``outcomes`` (an OUTCOME array or record) for a body of ``mass`` [kg].

    The retention compares the kinetic energy of the motion along the slope at the finish with *all* energy supplied:
    launch translation, launch spin, drop height and slope. A descent that spins, hops high or hovers until the time is
    over gains nothing by it.
    """
    finished = outcomes["status"] == FINISH
    lost = outcomes["status"] == NON_FINITE
    x = np.where(lost, 0.0, outcomes["x"])
    u = np.where(finished, np.maximum(outcomes["u"], 0.0), 0.0)
    supplied = np.where(finished, outcomes["supplied"], 1.0)
    kept = 0.5 * mass * np.square(u)
    retention = np.clip(np.divide(kept, supplied, out=np.zeros_like(kept), where=supplied > 0.0), 0.0, 1.0)
    progress = np.clip(x / length, 0.0, 1.0)
    return DescentJam(progress, retention, 0.5 * progress + 0.5 * np.sqrt(retention))
