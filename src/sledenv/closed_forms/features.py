"""Which feature of a body touches at an orientation, with its geometry and its rolling arm."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sledenv.closed_forms.arguments import Floats
from sledenv.kernel.records import ARC, NOSE, TAIL
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import ContactLaw
from sledenv.simulation.support import feature_geometry, has_corners

TURN = 2.0 * math.pi


class Sector(NamedTuple):
    """The orientations at which one feature touches, and its geometry: docs/physics.md (8.2)."""

    low: float  # [rad]
    high: float  # [rad]
    h: float  # [m]
    r: float  # [m]
    shift: float  # [rad]
    arm: float  # [m] delta


def sectors(body: Body, law: ContactLaw) -> list[Sector]:
    """Split (-pi, pi] by the feature that touches."""
    alpha = body.half_angle
    if not has_corners(body):
        return [Sector(-math.pi, math.pi, *feature_geometry(body, ARC), law.rolling_arm)]
    return [
        Sector(-math.pi, -alpha, *feature_geometry(body, NOSE), law.corner_rolling_arm),
        Sector(-alpha, alpha, *feature_geometry(body, ARC), law.rolling_arm),
        Sector(alpha, math.pi, *feature_geometry(body, TAIL), law.corner_rolling_arm),
    ]


def arms_at(body: Body, law: ContactLaw, phi: Floats) -> tuple[Floats, Floats, Floats]:
    """Arms a, b and rolling arm [m] of the feature that touches at each orientation, edges to the arc."""
    local = phi - TURN * np.floor(phi / TURN + 0.5)
    parts = sectors(body, law)
    index = np.zeros(local.shape, dtype=int)
    if len(parts) > 1:
        index = np.where(np.abs(local) <= body.half_angle, 1, np.where(local > 0.0, 2, 0))
    h, r, shift, arm = (np.array([part[i] for part in parts])[index] for i in range(2, 6))
    return h * np.sin(local + shift), r - h * np.cos(local + shift), arm
