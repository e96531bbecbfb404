"""Drag of the air, quadratic in the speed of the mass centre: docs/physics.md, section 9."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.contacts import ORDER
from sledenv.kernel.params import Incline

FAINT: Final = 1e-12  # of the weight: drag below is left out, for the speed is no power series where it is zero
LOST, FOUND = 0.5, 2.0  # times that: where a step ends in which drag is felt, and one in which it is not


@kernel
def felt(slope: Incline, motion: np.void) -> Incline:
    """Return the slope without the air where its drag is too faint to be felt."""
    if slope.drag == 0.0:
        return slope
    square = motion["u"] * motion["u"] + motion["v"] * motion["v"]
    if slope.drag * square > FAINT * slope.gravity:
        return slope
    return Incline(slope.downhill, slope.inward, slope.length, slope.gravity, 0.0)


@kernel
def pulled(slope: Incline, motion: np.void) -> Incline:
    """Return the slope with what gravity and the air do together to a body as it moves now, in place of gravity."""
    if slope.drag == 0.0:
        return slope
    u, v = motion["u"], motion["v"]
    rate = slope.drag * math.sqrt(u * u + v * v)
    return Incline(slope.downhill - rate * u, slope.inward + rate * v, slope.length, slope.gravity, slope.drag)


@kernel
def _square_term(s: np.void, k: int) -> float:
    """Term of order ``k`` of the square of the speed."""
    u, v, total = s["u"], s["v"], 0.0
    for i in range(k + 1):
        total += u[i] * u[k - i] + v[i] * v[k - i]
    return total


@kernel
def drag_term(s: np.void, k: int) -> tuple[float, float]:
    """Write terms of order ``k`` of the speed and its square; return those of speed times velocity, along x and y.

    The square of the speed is not zero: the recurrence of a root divides by the speed.
    """
    u, v, speed = s["u"], s["v"], s["speed"]
    total = _square_term(s, k)
    s["square"][k] = total
    if k == 0:
        speed[0] = math.sqrt(total)
    else:
        for i in range(1, k):
            total -= speed[i] * speed[k - i]
        speed[k] = total / (2.0 * speed[0])
    along, up = 0.0, 0.0
    for i in range(k + 1):
        along += speed[i] * u[k - i]
        up += speed[i] * v[k - i]
    return along, up


@kernel
def write_margin(slope: Incline, is_felt: bool, s: np.void, poly: np.ndarray) -> None:
    """Write how far the square of the speed is from where drag is no longer felt, or is felt again, as a series.

    A step ends there. The series of the speed would go on below zero where a body that moves along a line turns back.
    """
    sign = 1.0 if is_felt else -1.0
    for k in range(ORDER + 1):
        poly[k] = s["square"][k] if is_felt else -_square_term(s, k)
    poly[0] -= sign * (LOST if is_felt else FOUND) * FAINT * slope.gravity / slope.drag
