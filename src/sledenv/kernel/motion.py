"""How a free body moves: its path, how that bends, where it ends and what is lost; docs/physics.md, section 7.

Only gravity acts. All modules use that the spin of a body in flight is constant; only this one knows what acts on it.
``hop`` is a record of HOP at the start of the flight. Times [s] are counted from there.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel


def accelerations(slope: Any, u: Any, v: Any) -> tuple[Any, Any]:
    """Program of the accelerations [m/s^2] of the mass centre along the slope and away from it, at a velocity."""
    return slope.downhill, -slope.inward


def losses(slope: Any, start: Any, t: Any) -> dict[str, Any]:
    """Program of what is lost up to some time, for each of FLIGHT_LOSSES [J/kg]."""
    return {}


@kernel
def along(hop: np.void, t: float) -> tuple[float, float]:
    """Where the mass centre is along the slope [m], and how fast it moves there [m/s]."""
    return hop["x"] + t * (hop["u"] + 0.5 * hop["downhill"] * t), hop["u"] + hop["downhill"] * t


@kernel
def away(hop: np.void, t: float) -> tuple[float, float]:
    """Height [m] of the mass centre above the slope, and its rate [m/s]."""
    return hop["y"] + t * (hop["v"] - 0.5 * hop["inward"] * t), hop["v"] - hop["inward"] * t


@kernel
def turned(hop: np.void, t: float) -> float:
    """Orientation [rad], not wrapped."""
    return hop["phi"] + hop["omega"] * t  # type: ignore[no-any-return]


# What the search for the touchdown must know. A pull is an acceleration [m/s^2] towards the slope.


@kernel
def pull(hop: np.void, v: float) -> float:
    """Pull at some rate [m/s] of the height."""
    return hop["inward"]  # type: ignore[no-any-return]


@kernel
def most_pull(hop: np.void) -> float:
    """Bound of the pull in the whole flight, not negative."""
    return hop["inward"]  # type: ignore[no-any-return]


@kernel
def least_pull(hop: np.void, t: float) -> float:
    """Bound below the pull up to some time."""
    return hop["inward"]  # type: ignore[no-any-return]


@kernel
def jerks(hop: np.void) -> tuple[float, float]:
    """Third derivative [m/s^3] of the height at the start, and a bound of its size in the flight."""
    return 0.0, 0.0


@kernel
def departure(hop: np.void, step: float, later: float) -> float:
    """Error [m] of a step along a parabola: that of the height, and that of its rate times a correction ``later``."""
    return 0.0


@kernel
def once_in_reach(hop: np.void, time: float) -> tuple[float, float]:
    """Return a time [s] and the height [m] then. Out of reach, the time is that of the fall back to ``size``."""
    if not time < math.inf:
        return time, hop["size"]
    height, _ = away(hop, time)
    if height > hop["size"]:
        return max(hop["in_reach"], time), hop["size"]
    return time, height


@kernel
def finish_time(hop: np.void) -> float:
    """First time [s] > 0 at which the mass centre reaches the end of the slope, inf if never."""
    u, acceleration, ahead = hop["u"], hop["downhill"], hop["length"] - hop["x"]
    if not ahead < math.inf:
        return math.inf
    if acceleration == 0.0:
        return ahead / u if u > 0.0 else math.inf
    discriminant = u * u + 2.0 * acceleration * ahead
    if discriminant < 0.0 or (acceleration < 0.0 and u <= 0.0):
        return math.inf
    speed = math.sqrt(discriminant)
    return float(2.0 * ahead / (u + speed) if u >= 0.0 else (speed - u) / acceleration)
