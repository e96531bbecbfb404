"""Which arc of a body touches at an orientation, with its geometry and its rolling arm."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sledenv.closed_forms.arguments import Floats
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import ContactLaw
from sledenv.simulation.support import lowest_arms, within_a_turn

TURN = 2.0 * math.pi


class Sector(NamedTuple):
    """The orientations at which one arc touches, and its geometry: docs/physics.md (8.2)."""

    low: float  # [rad]
    high: float  # [rad]
    h: float  # [m]
    r: float  # [m]
    shift: float  # [rad]
    arm: float  # [m] delta


def sectors(body: Body, law: ContactLaw) -> list[Sector]:
    """Split (-pi, pi] by the arc that touches; an arc that is lowest at +-pi has the first and the last sector."""
    record = body.record[0]
    count = int(record["count"])
    begin, h, r, corner = (record[name][:count].tolist() for name in ("begin", "h", "r", "corner"))
    shift = np.arctan2(record["across"][:count], record["along"][:count]).tolist()
    arms = [rolling_arm(law, of_a_corner) for of_a_corner in corner]
    return list(map(Sector, begin, [*begin[1:], math.pi], h, r, shift, arms))


def rolling_arm(law: ContactLaw, corner: float) -> float:
    """Rolling arm [m] of an arc, from its entry ``corner`` in the record of a body."""
    return law.corner_rolling_arm if corner else law.rolling_arm


def arms_at(body: Body, law: ContactLaw, phi: Floats) -> tuple[Floats, Floats, Floats]:
    """Arms a, b and rolling arm [m] of the arc that touches at each orientation.

    Where one hands over to the next, it is the larger one, as in the simulator.
    """
    arcs, arms = lowest_arms(body.record, within_a_turn(phi.ravel()))
    arm = np.where(body.record["corner"][0][arcs] > 0.0, law.corner_rolling_arm, law.rolling_arm)
    a, b, arm = (column.reshape(phi.shape) for column in (*arms.T, arm))
    return a, b, arm
