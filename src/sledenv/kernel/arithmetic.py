"""Angles, sine, cosine and a root by plain arithmetic, so that every platform computes the same bits."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel

TURN: Final = 2.0 * math.pi
# pi/2 in three parts, of which the first two are exact in 33 bits (Cody and Waite).
_QUARTER_1, _QUARTER_2, _QUARTER_3 = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21
_S = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 9))
_C = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(1, 9))


@kernel
def wrap(angle: float) -> float:
    """Return an angle [rad] less its whole turns, in [-pi, pi]; odd in the angle, as a mirror is."""
    return angle - TURN * float(np.rint(angle * (1.0 / TURN)))


@kernel
def sine_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine of an angle [rad] within some turns of zero, to 2 ulp: Taylor series on [-pi/4, pi/4]."""
    quarter = float(np.rint(angle * (2.0 / math.pi)))
    x = ((angle - quarter * _QUARTER_1) - quarter * _QUARTER_2) - quarter * _QUARTER_3
    q = x * x
    odd = _S[4] + q * (_S[5] + q * (_S[6] + q * _S[7]))
    odd = _S[0] + q * (_S[1] + q * (_S[2] + q * (_S[3] + q * odd)))
    even = _C[4] + q * (_C[5] + q * (_C[6] + q * _C[7]))
    even = _C[0] + q * (_C[1] + q * (_C[2] + q * (_C[3] + q * even)))
    s, c = x + x * (q * odd), 1.0 + q * even
    left = quarter - 4.0 * float(np.rint(quarter * 0.25))  # -2, -1, 0, 1 or 2
    if left == 1.0:
        return c, -s
    if left == -1.0:
        return -c, s
    if left == 0.0:
        return s, c
    return -s, -c


@kernel
def angle_of(across: float, along: float) -> float:
    """Angle [rad] of the direction (along, across), in [-pi, pi], to 2 ulp; 0 of no direction."""
    x, y = abs(along), abs(across)
    longer = max(x, y)
    if not longer > 0.0:
        return 0.0
    ratio = min(x, y) / longer
    q = ratio * ratio
    rough = ratio * (0.9954 + q * (q * 0.0793 - 0.2887))
    if y > x:
        rough = 0.5 * math.pi - rough
    if along < 0.0:
        rough = math.pi - rough
    if across < 0.0:
        rough = -rough
    s, c = sine_cosine(rough)
    # Tangent of what is left: below a hundredth, so that four terms of the series suffice.
    t = (across * c - along * s) / (along * c + across * s)
    q = t * t
    return rough + t * (1.0 + q * (-1.0 / 3.0 + q * (1.0 / 5.0 - q / 7.0)))


@kernel
def sixteenth_root(number: float) -> float:
    """Root of order 16."""
    return math.sqrt(math.sqrt(math.sqrt(math.sqrt(number))))


@kernel
def sign_of(number: float) -> int:
    """-1, 0 or 1."""
    if number > 0.0:
        return 1
    return -1 if number < 0.0 else 0
