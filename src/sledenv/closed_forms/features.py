"""Arguments of closed forms, checked, and the arc of a body that touches at an orientation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.simulation.bodies import Body, made_body
from sledenv.simulation.rules import Rule, made
from sledenv.simulation.scene import ContactLaw, Slope
from sledenv.simulation.support import lowest_arms, within_a_turn

Floats = NDArray[np.float64]
IS_NUMBER: Rule = (lambda v: ~np.isnan(v), "a number")
TURN = 2.0 * math.pi


def resting(body: Body, law: ContactLaw, slope: Slope) -> tuple[Body, ContactLaw, Slope]:
    """Return what rests, how it touches and where, each checked."""
    return made_body(body), made("law", ContactLaw, law), pressed(slope)


def pressed(slope: Slope) -> Slope:
    """Return a plane of one surface onto which gravity presses what lies there."""
    slope = made("slope", Slope, slope)
    for name in ("zones", "profile"):
        if given := getattr(slope, name):
            raise ValueError(
                f"Slope.{name} has {len(given)} entries: must be empty, the closed form is of a plain slope"
            )
    if slope.gravity == 0.0:
        raise ValueError("Slope.gravity = 0.0: must be > 0, nothing else holds a body at rest on the slope")
    return slope


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
