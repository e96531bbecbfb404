"""What kernels are given beside a body (outline.py): contact law, slope, launch state and limits, as tuples of floats.

Python makes them with the classes of the same names in :mod:`sledenv.simulation`, which check every field.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import sine_cosine, wrap


class ContactLaw(NamedTuple):
    """How the body touches the slope: docs/physics.md, section 5."""

    stiffness: float  # [N/m] c; c(1 + asymmetry) loading, c(1 - asymmetry) unloading
    asymmetry: float  # [-] Delta in [0, 1)
    friction: float  # [-] f, Coulomb
    rolling_arm: float  # [m] delta of an arc; rolling resistance is delta * N
    corner_rolling_arm: float  # [m] delta of a corner


class RigidLaw(NamedTuple):
    """The stiff limit of a contact law: docs/physics.md, sections 4 and 6."""

    restitution: float  # [-] energetic
    friction: float  # [-] f, Coulomb
    rolling_arm: float  # [m] delta of an arc
    corner_rolling_arm: float  # [m] delta of a corner
    settle_speed: float  # [m/s] of approach, below which an impact is plastic


Law = ContactLaw | RigidLaw


class Slope(NamedTuple):
    """A straight incline: docs/physics.md, section 1."""

    angle: float  # [rad] beta, positive downhill
    length: float  # [m] where the descent finishes; may be inf
    gravity: float  # [m/s^2]


class Zone(NamedTuple):
    """A part of a slope with a surface of its own: docs/physics.md, section 11."""

    begin: float  # [m] of the places x of the contact point,
    end: float  # [m] and where the zone ends; may be inf
    friction: float  # [-] f, Coulomb
    rolling_arm: float  # [m] delta of an arc
    corner_rolling_arm: float  # [m] delta of a corner
    # Of a contact that begins in the zone; None, and NaN in a row, where they are those of the law.
    restitution: float | None  # [-] energetic
    stiffness: float | None  # [N/m] c


# A row of a table of slopes has the fields of a slope, then those of its zones in their order. Where it has fewer zones
# than another row, the rest is NaN. A profile is not in it: all lanes of a batch have the same.
SLOPE_FIELDS, ZONE_FIELDS = len(Slope._fields), len(Zone._fields)


class Incline(NamedTuple):
    """What a kernel needs of a slope: see :func:`incline_of`."""

    downhill: float  # [m/s^2] gravity along the slope,
    inward: float  # [m/s^2] and along the inward normal
    # As in Slope, from its second field on.
    length: float  # [m] where the descent finishes; may be inf
    gravity: float  # [m/s^2]


class State(NamedTuple):
    """Position, orientation and velocity of the body: docs/physics.md, section 1."""

    x: float  # [m] mass centre, along the slope, downhill positive
    y: float  # [m] mass centre, along the outward normal
    phi: float  # [rad] orientation, counter-clockwise, not wrapped
    u: float  # [m/s] xdot
    v: float  # [m/s] ydot
    omega: float  # [rad/s] phidot


class Limits(NamedTuple):
    """Where a simulation stops and how finely it is integrated and sampled."""

    max_time: float  # [s]
    max_steps: float  # [-] integration steps in contact
    tolerance: float  # [-] ten times the first terms that series of a contact step leave out, over the speed
    sample_interval: float  # [s] longest time between two rows of a trajectory
    max_rebounds: float  # [-] at which a descent ends
    end_on_chord: float  # 1: a descent ends where the body lies on a straight side, 0: it goes on
    end_parts: float  # the sum of 2^code of the parts of the body whose touch ends a descent
    run_out: float  # [m] behind the end of the slope, which the body still descends once it has passed the line there
    most_work: float  # [-] steps and hops of one call: it then returns, and the next call goes on
    shortest_flight: float  # [s] a hop goes on through shorter flights


@kernel
def row_of(table: np.ndarray, lane: int) -> Any:
    """Row of a lane in a table that has one row for each lane, or one row for all lanes."""
    return table[lane if table.shape[0] > 1 else 0]


@kernel
def law_of(table: np.ndarray, lane: int) -> ContactLaw:
    """Law of compliant surfaces in the row of a lane."""
    row = row_of(table, lane)
    return ContactLaw(row[0], row[1], row[2], row[3], row[4])


@kernel
def rigid_law_of(table: np.ndarray, lane: int) -> RigidLaw:
    """Law of rigid surfaces in the row of a lane."""
    row = row_of(table, lane)
    return RigidLaw(row[0], row[1], row[2], row[3], row[4])


@kernel
def slope_of(table: np.ndarray, lane: int) -> Slope:
    """Slope in the row of a lane."""
    row = row_of(table, lane)
    return Slope(row[0], row[1], row[2])


@kernel
def incline_of(slope: Slope) -> Incline:
    """Return what kernels need of a slope."""
    sine, cosine = sine_cosine(wrap(slope.angle))
    return Incline(slope.gravity * sine, slope.gravity * cosine, slope.length, slope.gravity)


@kernel
def launch_of(table: np.ndarray, lane: int) -> State:
    """State at the launch in the row of a lane."""
    row = row_of(table, lane)
    return State(row[0], row[1], row[2], row[3], row[4], row[5])
