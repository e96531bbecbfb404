"""Rows of a trajectory, written while there is room and counted in any case."""

from __future__ import annotations

from typing import Final

import numpy as np

from sledenv.kernel.jit import kernel

CONTACT_ROWS: Final = 8  # intervals of one step of a contact, close enough to draw it


@kernel
def add_sample(
    trajectory: np.ndarray,
    samples: int,
    t: float,
    x: float,
    y: float,
    phi: float,
    u: float,
    v: float,
    omega: float,
    normal: float,
    tangential: float,
    rolling: float,
    feature: int,
    slip: int,
    spin: int,
) -> int:
    """Write one row if it fits; return the number of rows needed so far."""
    if samples < trajectory.shape[0]:
        row = trajectory[samples]
        row["t"] = t
        row["x"] = x
        row["y"] = y
        row["phi"] = phi
        row["u"] = u
        row["v"] = v
        row["omega"] = omega
        row["normal"] = normal
        row["tangential"] = tangential
        row["rolling"] = rolling
        row["feature"] = feature
        row["slip"] = slip
        row["spin"] = spin
    return samples + 1
