"""The givens of a descent beside a body (outline.py): contact law, slope, launch, limits; scenes, which hold them.

Python makes the tuples with the classes of the same names in :mod:`sledenv.simulation`, which check every field.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

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
    air_density: float = 0.0  # [kg/m^3]


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


ZONE_FIELDS: Final = len(Zone._fields)


class Incline(NamedTuple):
    """The slope of a scene as kernels need it: see :func:`incline_of`."""

    downhill: float  # [m/s^2] gravity along the slope,
    inward: float  # [m/s^2] and along the inward normal
    length: float  # [m] where the descent finishes; may be inf
    gravity: float  # [m/s^2]
    drag: float  # [1/m] deceleration by the air over the square of the speed


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
    run_out: float  # [m] behind the end of the slope, which the body still descends once it has passed the finish there
    most_work: float  # [-] steps and hops of one call: it then returns, and the next call goes on
    shortest_flight: float  # [s] a hop goes on through shorter flights


# All that is given of one descent: a row of doubles. Whole numbers are places in pools, which many scenes share.
SCENE: Final = np.dtype(
    [
        ("body", "f8"),  # [-] place of its outline among the bodies
        ("ground", "f8"),  # [-] places of its first piece of ground among the pieces,
        ("ground_end", "f8"),  # [-] and of the one behind its last
        ("zones", "f8"),  # [-] places of its first zone among the zones,
        ("zones_end", "f8"),  # [-] and of the one behind its last
        # The contact law, as in ContactLaw; rigid surfaces have the restitution that belongs to the asymmetry.
        ("stiffness", "f8"),  # [N/m]
        ("asymmetry", "f8"),  # [-]
        ("friction", "f8"),  # [-]
        ("rolling_arm", "f8"),  # [m]
        ("corner_rolling_arm", "f8"),  # [m]
        ("settle_speed", "f8"),  # [m/s] of approach, below which an impact of rigid surfaces is plastic
        # The slope, as in Slope.
        ("angle", "f8"),  # [rad]
        ("length", "f8"),  # [m]
        ("gravity", "f8"),  # [m/s^2]
        ("air_density", "f8"),  # [kg/m^3]
        # The launch, as in State.
        ("x", "f8"),  # [m]
        ("y", "f8"),  # [m]
        ("phi", "f8"),  # [rad]
        ("u", "f8"),  # [m/s]
        ("v", "f8"),  # [m/s]
        ("omega", "f8"),  # [rad/s]
        ("rotor_inertia", "f8"),  # [kg m^2] of the rider's rotor; 1 without a rider, who then lends nothing
        (
            "stream",
            "f8",
        ),  # [-] number of the stream of a rider's errors, of which kernels know nothing
    ]
)


class Scenes(NamedTuple):
    """Scenes, one per lane, and the pools in which they have places."""

    rows: np.ndarray  # of SCENE, one per lane
    bodies: np.ndarray  # of BODY
    pieces: np.ndarray  # of PIECE
    zones: np.ndarray  # fields of Zone, shape (n, ZONE_FIELDS); NaN for None


@kernel
def row_of(table: np.ndarray, lane: int) -> Any:
    """Row of a lane in a table that has one row for each lane, or one row for all lanes."""
    return table[lane if table.shape[0] > 1 else 0]


@kernel
def law_of(scene: np.void) -> ContactLaw:
    """Law of compliant surfaces in a scene."""
    return ContactLaw(
        scene["stiffness"],
        scene["asymmetry"],
        scene["friction"],
        scene["rolling_arm"],
        scene["corner_rolling_arm"],
    )


@kernel
def rigid_law_of(scene: np.void) -> RigidLaw:
    """Law of rigid surfaces in a scene, the stiff limit of that of compliant ones."""
    restitution = math.sqrt((1.0 - scene["asymmetry"]) / (1.0 + scene["asymmetry"]))
    return RigidLaw(
        restitution, scene["friction"], scene["rolling_arm"], scene["corner_rolling_arm"], scene["settle_speed"]
    )


@kernel
def incline_of(scene: np.void, body: np.void) -> Incline:
    """Return what kernels need of the slope of a scene, and of the air over it."""
    sine, cosine = sine_cosine(wrap(scene["angle"]))
    drag = 0.5 * scene["air_density"] * body["drag_area"] * body["per_mass"]
    return Incline(scene["gravity"] * sine, scene["gravity"] * cosine, scene["length"], scene["gravity"], drag)


@kernel
def launch_of(scene: np.void) -> State:
    """State at the launch in a scene."""
    return State(scene["x"], scene["y"], scene["phi"], scene["u"], scene["v"], scene["omega"])
