"""The surface along a slope: that of the law, and zones that have their own; docs/physics.md, section 11."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from sledenv.compiler.jit import kernel

MOST_ZONES: Final = 64
PIECES: Final = 2 * MOST_ZONES + 1  # with what lies between the zones

# The slope from its top to its end, in pieces one after the other.
GROUND: Final = np.dtype(
    [
        ("count", "f8"),  # of pieces
        ("begin", "f8", (PIECES + 1,)),  # [m] where each begins, -inf of the first one; the last one ends at inf
        ("friction", "f8", (PIECES,)),  # [-]
        ("arc_arm", "f8", (PIECES,)),  # [m] rolling arm of arcs
        ("corner_arm", "f8", (PIECES,)),  # [m] and of corners
        ("closing", "f8", (PIECES,)),  # [N/m] stiffness of compliant surfaces while a gap closes
        ("opening", "f8", (PIECES,)),  # [N/m] and while it opens
        # Of a contact that begins on it; NaN where they are those of the law.
        ("restitution", "f8", (PIECES,)),  # [-]
        ("stiffness", "f8", (PIECES,)),  # [N/m]
        ("settle_speed", "f8"),  # [m/s] below which an impact of rigid surfaces is plastic
    ]
)


@kernel
def _lay(ground: np.void, begin: float, friction: float, arc_arm: float, corner_arm: float) -> int:
    """Add a piece, whose restitution and stiffness are those of the law, and return its number."""
    piece = int(ground["count"])
    ground["begin"][piece], ground["friction"][piece] = begin, friction
    ground["arc_arm"][piece], ground["corner_arm"][piece] = arc_arm, corner_arm
    ground["restitution"][piece] = ground["stiffness"][piece] = math.nan
    ground["count"] += 1.0
    return piece


@kernel
def lay_ground(law: Any, zones: np.ndarray, ground: np.void) -> None:
    """Write the ground of a slope with zones, rows with the fields of Zone; elsewhere it is as the law says."""
    ground["count"], reached = 0.0, -math.inf
    for k in range(zones.shape[0]):
        begin = zones[k, 0]
        if begin > reached:
            _lay(ground, reached, law.friction, law.rolling_arm, law.corner_rolling_arm)
        piece = _lay(ground, begin, zones[k, 2], zones[k, 3], zones[k, 4])
        ground["restitution"][piece], ground["stiffness"][piece] = zones[k, 5], zones[k, 6]
        reached = zones[k, 1]
    if reached < math.inf:
        _lay(ground, reached, law.friction, law.rolling_arm, law.corner_rolling_arm)
    ground["begin"][int(ground["count"])] = math.inf


@kernel
def lay_springs(law: Any, ground: np.void) -> None:
    """Write how stiff the compliant surfaces are in each piece of a ground that has been laid."""
    for piece in range(int(ground["count"])):
        stiffness, restitution = ground["stiffness"][piece], ground["restitution"][piece]
        closing, opening = 1.0 + law.asymmetry, 1.0 - law.asymmetry
        if not math.isnan(restitution):
            square = restitution * restitution
            closing, opening = 2.0 / (1.0 + square), 2.0 * square / (1.0 + square)
        if math.isnan(stiffness):
            stiffness = law.stiffness
        ground["closing"][piece], ground["opening"][piece] = stiffness * closing, stiffness * opening


@kernel
def lay_rigid(law: Any, ground: np.void) -> None:
    """Write that the surfaces of a ground that has been laid are rigid: any load without depth, none of what opens."""
    for piece in range(int(ground["count"])):
        ground["closing"][piece], ground["opening"][piece] = math.inf, 0.0
        if math.isnan(ground["restitution"][piece]):
            ground["restitution"][piece] = law.restitution
    ground["settle_speed"] = law.settle_speed


@kernel
def is_rigid(ground: np.void) -> bool:
    """Whether the surfaces are rigid: the one place where a descent asks for its law."""
    return bool(ground["closing"][0] == math.inf)
