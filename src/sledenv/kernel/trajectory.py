"""Rows of a trajectory, written while there is room and counted in any case."""

from __future__ import annotations

from typing import Final

import numpy as np

from sledenv.kernel.jit import kernel
from sledenv.kernel.records import FLIGHT_LOSSES
from sledenv.kernel.state import copy
from sledenv.kernel.trace import straight

CONTACT_ROWS: Final = 8  # intervals of one step of a contact, close enough to draw it

_tell_losses = straight(lambda flight, row: copy(flight, row, FLIGHT_LOSSES))


@kernel
def next_row(trajectory: np.ndarray, flight: np.void) -> np.void:
    """Count a row and return it, to be filled; where there is no room left, one that nobody will read.

    ``trajectory`` has at least one row. If ``flight["samples"]`` is more than its length in the end, it was too short.
    """
    row: np.void = trajectory[min(flight["samples"], trajectory.shape[0] - 1)]
    flight["samples"] += 1
    _tell_losses(flight, row)
    return row


@kernel
def write_motion(row: np.void, t: float, x: float, y: float, phi: float, u: float, v: float, omega: float) -> None:
    """Fill the time and the motion of a row."""
    row["t"] = t
    row["x"] = x
    row["y"] = y
    row["phi"] = phi
    row["u"] = u
    row["v"] = v
    row["omega"] = omega


@kernel
def write_forces(
    row: np.void, normal: float, tangential: float, rolling: float, feature: int, slip: int, spin: int
) -> None:
    """Fill the contact forces of a row: forces [N], moment [N m], what touches, signs of slip and spin."""
    row["normal"] = normal
    row["tangential"] = tangential
    row["rolling"] = rolling
    row["feature"] = feature
    row["slip"] = slip
    row["spin"] = spin
