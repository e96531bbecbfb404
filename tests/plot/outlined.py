"""Bodies of other outlines than a segment, and descents of them, over profiles too, for pictures and pages."""

from __future__ import annotations

import functools
import math
from typing import Final

import numpy as np

from sledenv.simulation import sleds
from sledenv.simulation.bodies import Body
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.outlines import bulged
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.shapes import hull, polygon, rod
from sledenv.simulation.simulate import simulate
from tests.bodies import run


def runner_and_head() -> Body:
    """A slightly bent runner between two round ends, with the head of a rider above it."""
    circles = [(0.62, -0.17, 0.06), (-0.62, -0.17, 0.06), (-0.15, 0.62, 0.12)]
    body = hull(110.0, circles, ["nose", "tail", "head"], ["runner", "back", "front"], 18.0, (0.0, 0.0))
    nose = [arc.part for arc in body.arcs].index("nose")
    return Body(110.0, 18.0, bulged(body.arcs, nose, 4.0, "runner"))


CRATE: Final = polygon(40.0, [(-0.4, -0.3), (0.4, -0.3), (0.4, 0.3), (-0.4, 0.3)])
BOULDER: Final = polygon(900.0, [(0.0, 0.0), (0.9, -0.1), (1.3, 0.5), (0.8, 1.1), (0.1, 0.9)], 0.08)
RIDER: Final = runner_and_head()
RIDDEN: Final = sleds.sled()
LINE: Final = rod(5.0, 1.2)

_ROCK = ContactLaw.from_restitution(0.4, stiffness=1e7, friction=0.5, rolling_arm=0.005)
_SNOW = ContactLaw.from_restitution(0.3, stiffness=1e6, friction=0.08, rolling_arm=0.0)
_WOOD = ContactLaw.from_restitution(0.5, stiffness=1e6, friction=0.3, rolling_arm=0.0)
SETTINGS: Final = {
    "boulder": (BOULDER, _ROCK, Slope(0.5, 12.0), (0.0, 0.6, 0.3, 2.0, 0.0, -2.0)),
    "rider": (RIDER, _SNOW, Slope(0.25, 15.0), (0.0, 0.4, 0.15, 4.0, 0.0, -1.0)),
    "ridden": (RIDDEN, _SNOW, Slope(0.25, 15.0), (0.0, 0.4, -1.3, 4.0, 0.0, -3.0)),
    "line": (LINE, _WOOD, Slope(0.3, 8.0), (0.0, 0.4, 0.5, 2.0, 0.0, -3.0)),
}


@functools.cache
def descent_of(name: str, solver: str) -> Descent:
    """Return the descent of one of these bodies, with its trajectory."""
    return run(*SETTINGS[name], solver=solver)  # type: ignore[arg-type]


def bumpy() -> Slope:
    """Eight bumps."""
    feet = 4.0 + 4.4 * np.arange(8.0)
    corners = np.array([(0.0, 0.0), (1.5, 0.3), (2.0, 0.3), (3.5, 0.0)])
    profile = corners + np.stack([feet, 0.0 * feet], axis=-1)[:, np.newaxis]
    return Slope(math.radians(9.0), 42.0, profile=profile.reshape(-1, 2))


def hillside() -> Slope:
    """A hillside of 60 random pieces, steep above and nearly level below, with two zones; the plane is level."""
    rng = np.random.default_rng(3)
    along = rng.uniform(0.8, 2.4, 60)
    grade = np.append(rng.uniform(-1.3, -0.1, 40), rng.uniform(-0.2, 0.1, 20))
    profile = np.insert(np.cumsum(np.stack([along, along * grade], axis=-1), axis=0), 0, 0.0, axis=0)
    zones = [Zone(20.0, 40.0, 0.3, 0.01, restitution=0.2, stiffness=5e6), Zone(60.0, math.inf, 0.8, 0.05)]
    return Slope(0.0, profile[-1, 0] + 10.0, zones=zones, profile=profile)


PROFILES: Final = {
    "sled": (RIDDEN, _SNOW._replace(friction=0.03), bumpy(), State(0.0, 0.6, 0.1, 6.0)),
    "rock": (BOULDER, _ROCK, hillside(), State(-0.5, 1.2, 0.3, 4.0, 0.0, -2.0)),
}


@functools.cache
def ride_of(name: str) -> Descent:
    """Return the descent of one of these bodies over its profile, with its trajectory."""
    return simulate(*PROFILES[name], record="trajectory")
