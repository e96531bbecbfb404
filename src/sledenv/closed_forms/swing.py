"""The small swing of a body about its rest on a curved arc, in closed form: where, and its period."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sledenv.closed_forms.features import TURN, pressed
from sledenv.simulation.bodies import Body, made_body
from sledenv.simulation.scene import Slope
from sledenv.simulation.support import lowest_arms


class Swing(NamedTuple):
    """Where a body swings, and how long it takes to and fro."""

    part: str  # of the body, that touches
    phi: float  # [rad] in the middle of the swing, in (-pi, pi]
    period: float  # [s]


def small_swings(body: Body, slope: Slope, *, sticks: bool = True) -> list[Swing]:
    """Small swings of a body on its arcs: rolling without slip, or with nothing to hold it along the slope.

    Both follow from the equations of motion (1.5) of docs/physics.md with the gap closed, linear in the angle from the
    middle of the swing. With theta = phi + shift of the arc that touches (8.2):

    *It sticks.* Rolling has ``dx = -b dphi``, so the height of the mass centre, ``y cos(beta) - x sin(beta)``, has the
    derivatives ``a cos(beta) + b sin(beta)`` and ``h cos(theta - beta)``. The first is 0 in the middle, where the mass
    centre is above the contact point: ``h sin(theta - beta) = -r sin(beta)``. The inertia is that about this point:

        T = 2 pi sqrt((J + m (a^2 + b^2)) / (m g h cos(theta - beta)))

    *It slides freely.* Without friction nothing but gravity acts along the slope, and the body slides down as if it did
    not swing. Across the slope the mass centre follows ``y = b``, with the derivatives ``a`` and ``h cos(theta)``. In
    the middle theta = 0 and a = 0, so a turn hardly moves the mass centre, and the inertia is J:

        T = 2 pi sqrt(J / (m g cos(beta) h))

    On a level slope both have their middle where the mass centre is lowest, at H = r - h.

    Parameters
    ----------
    body : Body
        What swings.
    slope : Slope
        On which it does; its length and its zones do not matter.
    sticks : bool
        Which of the two. Friction holds the middle of the first if ``f >= tan|beta|``.

    Returns
    -------
    list of Swing
        One for each arc on which the body comes back to its rest, in order of ``phi``. Left out are the square of the
        amplitude (in units of the gyration radius over h), compliance, and rolling resistance, with which a body comes
        to rest beside the middle. A body does not swing on a corner, and a wheel rests anywhere. Where two arcs meet
        just in the middle, the period is that of the one that touches there.

    Raises
    ------
    TypeError, ValueError
        If gravity is 0, or the slope has zones or a profile.
    """
    body, slope = made_body(body), pressed(slope)
    record = body.record[0]
    found = []
    for arc in range(int(record["count"])):
        h, r, across, along = (float(record[name][arc]) for name in ("h", "r", "across", "along"))
        if not (r * abs(math.sin(slope.angle)) if sticks else 0.0) < h:
            continue
        lean = -math.asin(r * math.sin(slope.angle) / h) if sticks else -slope.angle  # theta - beta
        phi = math.remainder(slope.angle + lean - math.atan2(across, along), TURN)
        phi = abs(phi) if abs(phi) == math.pi else phi
        touching, arms = lowest_arms(body.record, np.array([phi]))
        if touching[0] != arc:
            continue
        if sticks:
            inertia, steepness = body.inertia + body.mass * float(arms[0] @ arms[0]), math.cos(lean)
        else:
            inertia, steepness = body.inertia, math.cos(slope.angle)
        period = TURN * math.sqrt(inertia / (body.mass * slope.gravity * h * steepness))
        found.append(Swing(body.parts[int(record["part"][arc]) - 1], phi, period))
    return sorted(found, key=lambda swing: swing.phi)
