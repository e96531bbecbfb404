"""Rows of a trajectory, written while there is room and counted in any case."""

from __future__ import annotations

from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import straight
from sledenv.kernel.records import FLIGHT_LOSSES
from sledenv.kernel.state import MOTION, copy

CONTACT_ROWS: Final = 8  # intervals of one step of a contact, close enough to draw it
MOST_ROWS: Final = 1e18  # up to which they are counted

_write_flight = straight(lambda flight, row: copy(flight, row, (*MOTION, *FLIGHT_LOSSES)))


@kernel
def _clear_touches(row: np.void) -> None:
    """Let nothing touch in a row, which may have been written before."""
    for i in range(row["touching"]):
        one = row["contacts"][i]
        one["x"] = one["y"] = one["normal_x"] = one["normal_y"] = one["normal"] = one["tangential"] = 0.0
        one["part"] = one["ground"] = 0
    row["touching"] = 0


@kernel
def next_row(trajectory: np.ndarray, flight: np.void) -> np.void:
    """Count a row and return it, that of a flight as it is; where there is no room left, one that nobody will read.

    ``trajectory`` has at least one row. If ``flight["samples"]`` is more than its length in the end, it was too short.
    """
    row: np.void = trajectory[min(flight["samples"], trajectory.shape[0] - 1)]
    flight["samples"] += 1
    _write_flight(flight, row)
    write_forces(row, 0.0, 0.0, 0.0, 0, 0, 0)
    _clear_touches(row)
    return row


@kernel
def rows_to_write(rows: float, flight: np.void, trajectory: np.ndarray) -> int:
    """Return ``rows``, of a flight or of a step; or none, which are only counted, where there is no room for all."""
    if flight["samples"] + rows <= trajectory.shape[0]:
        return int(rows)
    flight["samples"] = int(min(flight["samples"] + rows, MOST_ROWS))
    return 0


@kernel
def write_motion(row: np.void, t: float, x: float, y: float, phi: float, u: float, v: float, omega: float) -> None:
    """Fill the time and the motion of a row."""
    row["t"], row["x"], row["y"], row["phi"] = t, x, y, phi
    row["u"], row["v"], row["omega"] = u, v, omega


@kernel
def write_forces(
    row: np.void, normal: float, tangential: float, rolling: float, feature: int, slip: int, spin: int
) -> None:
    """Fill the contact forces of a row: forces [N], moment [N m], what touches, signs of slip and spin."""
    row["normal"], row["tangential"], row["rolling"] = normal, tangential, rolling
    row["feature"], row["slip"], row["spin"] = feature, slip, spin
    row["slip_velocity"] = row["friction_ratio"] = 0.0


@kernel
def write_slip(row: np.void, slip_velocity: float, bound: float) -> None:
    """Fill how fast a contact slips [m/s], whose forces are in the row, and how much acts of its friction [N]."""
    row["slip_velocity"] = slip_velocity
    row["friction_ratio"] = row["tangential"] / bound if bound > 0.0 else 0.0


@kernel
def write_touch(row: np.void, x: float, part: int, normal: float, tangential: float) -> None:
    """Add a contact with the plane to a row: its place along it [m], the part that touches, its forces [N]."""
    one = row["contacts"][row["touching"]]
    one["x"], one["y"], one["normal_x"], one["normal_y"] = x, 0.0, 0.0, 1.0
    one["normal"], one["tangential"], one["part"], one["ground"] = normal, tangential, part, 0
    row["touching"] += 1
