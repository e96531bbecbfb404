"""How a free body moves: its path, how that bends, where it ends and what is lost; docs/physics.md, section 7.

Programs of a flight under gravity alone. No other module knows what acts on a body in flight, except that its spin does
not change. ``hop`` is a record of HOP at the start of the flight, from which times [s] are counted.
"""

from __future__ import annotations

import math
from typing import Any

from sledenv.compiler.values import equal, larger, less, not_more, root, where


def accelerations(slope: Any, u: Any, v: Any) -> tuple[Any, Any]:
    """Program of the accelerations [m/s^2] of the mass centre along the slope and away from it, at a velocity."""
    return slope.downhill, -slope.inward


def along(hop: Any, t: Any) -> tuple[Any, Any]:
    """Program of where the mass centre is along the slope [m], and how fast it moves there [m/s]."""
    return hop.x + t * (hop.u + 0.5 * hop.downhill * t), hop.u + hop.downhill * t


def away(hop: Any, t: Any) -> tuple[Any, Any]:
    """Program of the height [m] of the mass centre above the slope, and of its rate [m/s]."""
    return hop.y + t * (hop.v - 0.5 * hop.inward * t), hop.v - hop.inward * t


def turned(hop: Any, t: Any) -> Any:
    """Program of the orientation [rad], not wrapped."""
    return hop.phi + hop.omega * t


def losses(slope: Any, start: Any, t: Any) -> dict[str, Any]:
    """Program of what is lost up to some time, for each of FLIGHT_LOSSES [J/kg]."""
    return {}


# What the search for the touchdown must know. A pull is an acceleration [m/s^2] towards the slope.


def pull(hop: Any, v: Any) -> Any:
    """Program of the pull at some rate [m/s] of the height."""
    return hop.inward


def most_pull(hop: Any) -> Any:
    """Program of a bound of the pull in the whole flight, not negative."""
    return hop.inward


def least_pull(hop: Any, t: Any) -> Any:
    """Program of a bound below the pull up to some time."""
    return hop.inward


def jerks(hop: Any) -> tuple[Any, Any]:
    """Program of the third derivative [m/s^3] of the height at the start, and of a bound of its size in the flight."""
    return 0.0, 0.0


def departures(hop: Any, step: Any, later: Any) -> tuple[Any, ...]:
    """Program of errors [m] of a step along a parabola: of the height, and of its rate times a correction ``later``."""
    return ()


def once_in_reach(hop: Any, time: Any) -> tuple[Any, Any]:
    """Program of a time and the height [m] then; out of reach, of when it has fallen back as far as ``size``."""
    height, _ = away(hop, time)
    above = less(hop.size, height)
    return where(above, larger(hop.in_reach, time), time), where(above, hop.size, height)


def finish_of(hop: Any) -> Any:
    """Program of the first time > 0 at which the mass centre reaches the end of the slope, inf if never."""
    u, acceleration, ahead = hop.u, hop.downhill, hop.length - hop.x
    discriminant = u * u + 2.0 * acceleration * ahead
    speed = root(discriminant)
    time = where(not_more(0.0, u), 2.0 * ahead / (u + speed), (speed - u) / acceleration)
    never = less(discriminant, 0.0) | (less(acceleration, 0.0) & not_more(u, 0.0))
    steady = where(less(0.0, u), ahead / u, math.inf)
    time = where(equal(acceleration, 0.0), steady, where(never, math.inf, time))
    return where(less(ahead, math.inf), time, math.inf)
