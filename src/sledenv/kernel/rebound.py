"""How contacts end: one by one, with the last one the rebound, and with it the descent if a part may not touch."""

from __future__ import annotations

from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import sine_cosine, wrap
from sledenv.kernel.books import close_rebound, part_of, side_that_lies
from sledenv.kernel.contacts import LEAST_FORCED, drop
from sledenv.kernel.geometry import place, velocities
from sledenv.kernel.ground import is_rigid
from sledenv.kernel.params import Limits
from sledenv.kernel.records import LOG_FULL, RUNNING

DOWN: Final = 4e-15  # of the size: a gap this small is rounding


@kernel
def gap_to(body: np.void, pieces: np.ndarray, motion: np.void, arc: int, j: int) -> float:
    """Gap [m] of an arc to a piece where the body is."""
    piece, s, c = pieces[j], motion["sine"], motion["cosine"]
    x, y = c * body["cx"][arc] - s * body["cy"][arc], s * body["cx"][arc] + c * body["cy"][arc]
    x, y = x + (motion["x"] - piece["x"]), y + (motion["y"] - piece["y"])
    return float(piece["tx"] * y - piece["ty"] * x - body["r"][arc])


@kernel
def put_down(body: np.void, pieces: np.ndarray, motion: np.void, contact: np.void) -> None:
    """Put a body exactly where a contact touches that has been placed, unless it is there but for rounding."""
    gap = gap_to(body, pieces, motion, contact["arc"], contact["piece"])
    if abs(gap) > DOWN * body["size"]:
        motion["x"], motion["y"] = motion["x"] - contact["nx"] * gap, motion["y"] - contact["ny"] * gap


@kernel
def put_on(body: np.void, pieces: np.ndarray, motion: np.void, contact: np.void) -> None:
    """Put the body exactly where a contact says: it has moved by series of its own."""
    motion["sine"], motion["cosine"] = sine_cosine(wrap(motion["phi"]))
    place(body, pieces, motion, contact)
    put_down(body, pieces, motion, contact)
    rate = contact["gap_rate"] - velocities(motion, contact)[0]
    motion["u"], motion["v"] = motion["u"] + contact["nx"] * rate, motion["v"] + contact["ny"] * rate


@kernel
def put_back(space: np.void, flight: np.void) -> None:
    """Write where the body is into its flight."""
    motion = space["motion"]
    flight["t"], flight["x"], flight["y"], flight["phi"] = motion["t"], motion["x"], motion["y"], motion["phi"]
    flight["u"], flight["v"], flight["omega"] = motion["u"], motion["v"], motion["omega"]
    flight["drag"] = space["drag"]


@kernel
def touches_end(body: np.void, limits: Limits, space: np.void) -> bool:
    """Whether a part of the body touches whose touch ends the descent."""
    contacts, parts = space["contacts"], int(limits.end_parts)
    if parts == 0:
        return False
    for c in range(contacts["count"]):
        if (parts >> int(part_of(body, contacts["at"][c]))) & 1 != 0:
            return True
    return bool((parts >> int(side_that_lies(body, contacts))) & 1 != 0)


@kernel
def end_rebound(body: np.void, limits: Limits, slip: float, flight: np.void, log: np.ndarray, space: np.void) -> int:
    """Record a rebound whose last contact has ended with some slip [m/s]; return the status."""
    close_rebound(body, space, slip, flight, log[min(flight["rebounds"], log.shape[0] - 1)])
    motion = space["motion"]
    motion["sine"], motion["cosine"] = sine_cosine(wrap(motion["phi"]))
    space["stalled"], space["forced"] = 0, LEAST_FORCED
    put_back(space, flight)
    return LOG_FULL if flight["rebounds"] >= limits.max_rebounds else RUNNING


@kernel
def separate(
    body: np.void, pieces: np.ndarray, limits: Limits, c: int, flight: np.void, log: np.ndarray, space: np.void
) -> int:
    """Take a contact that has ended off the list; the rebound is over with the last one. Return the status."""
    contacts = space["contacts"]
    slip = contacts["at"][c]["slip"]
    if is_rigid(space["ground"]):
        space["lifted"] = space["undecided"] = 1
        if contacts["count"] == 1:
            put_on(body, pieces, space["motion"], contacts["at"][0])
    drop(contacts, c)
    return RUNNING if contacts["count"] > 0 else end_rebound(body, limits, slip, flight, log, space)
