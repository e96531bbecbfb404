"""Bodies with corners that are no laminas; a launch at a height above the slope; descents that are ugly to draw."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.simulation import bodies
from sledenv.simulation.bodies import Body, Segment, least_eccentricity
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.outlines import Arc
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import lowest_arms, support_height


def rod(mass: float, half_length: float, inertia: float) -> Segment:
    """A thin segment whose chord passes through its mass centre: an end touches, or both.

    It lies flat at phi = 0 and pi and stands on its tail at pi/2.
    """
    half_angle = 0.1
    radius, eccentricity = half_length / math.sin(half_angle), half_length / math.tan(half_angle)
    return bodies.segment(mass, radius, eccentricity, inertia, half_angle)


def bowl(mass: float, length: float, radius: float, height: float, gyration_radius: float) -> Segment:
    """A segment by the length of its chord, with its mass centre at a height above the middle of its arc."""
    return bodies.segment(mass, radius, radius - height, mass * gyration_radius**2, math.asin(0.5 * length / radius))


def segment_by_share(mass: float, radius: float, share: float, inertia: float, half_angle: float) -> Segment:
    """A body whose mass centre lies at a share of the way from the chord to the arc, or from the centre of the arc."""
    least = least_eccentricity(radius, half_angle)
    return bodies.segment(mass, radius, least + share * (radius - least), inertia, half_angle)


def touching(body: Body, phi: float) -> tuple[int, float, float]:
    """Code of the part of a body that is lowest at an orientation [rad], and its arms [m]."""
    (arc,), ((a, b),) = lowest_arms(body.record, np.array([phi]))
    return int(body.record["part"][0, arc]), float(a), float(b)


def arms(arc: Arc, phi: float) -> tuple[float, float]:
    """(a, b) [m]: the lowest point of an arc lies at (-a, -b) from the mass centre, by plain sines."""
    sine, cosine = math.sin(phi), math.cos(phi)
    return arc.y * sine - arc.x * cosine, arc.radius - arc.y * cosine - arc.x * sine


def lowest_arc(body: Body, phi: float) -> tuple[Arc, float, float]:
    """The arc of an outline that is lowest at an orientation, and its arms [m]."""
    arc = min(body.arcs, key=lambda arc: (phi - arc.begin) % (2.0 * math.pi))
    return arc, *arms(arc, phi)


def run(body: Body, law: ContactLaw, slope: Slope, launch: tuple[float, ...], **options: float) -> Descent:
    """Simulate a launch whose second entry is the clearance of the lowest point [m]."""
    x, clearance, phi, *rates = launch
    state = State(x, clearance + support_height(body, phi), phi, *rates)
    return simulate(body, law, slope, state, record="trajectory", **options)  # type: ignore[arg-type]


def same_bits(one: Any, other: Any) -> None:
    """Field by field, for there may be anything between them; the sign of a zero counts."""
    for name in one.dtype.names:
        assert one[name].tobytes() == other[name].tobytes(), name


DISC, POINT = bodies.segment(100.0, 0.5, 0.25, 18.75), bodies.segment(1.0, 0.0, 0.0, 1.0)
SLED, ROD = circular_segment(100.0, 0.5, math.radians(110.0)), rod(2.0, 0.5, 0.17)
ICE = ContactLaw.from_restitution(0.5, stiffness=1e6, friction=0.05, rolling_arm=0.005)
MAT = ContactLaw.from_restitution(0.5, stiffness=1e6, friction=0.6, rolling_arm=0.02)
HILL = Slope(0.15, 10.0)
UGLY = {
    "no time passed": (DISC, ICE, HILL, (0.0, 1.0, 0.0, 1.0, 0.0, 1.0), {"max_time": 1e-9}),
    "jammed at launch": (DISC, MAT, Slope(0.0, 10.0), (0.0, 0.0, 0.0), {}),
    "no end": (DISC, ICE, Slope(0.2), (0.0, 1.0, 0.0, 5.0, 0.0, 0.0), {"max_time": 5.0, "sample_interval": 1.0}),
    "far away": (DISC, ICE, Slope(0.0), (0.0, 1e3, 0.0, 1e9, 1e9, 0.0), {"max_time": 100.0}),
    "far launch": (DISC, ICE, Slope(0.0), (1e15, 1.0, 0.0, 1.0, 0.0, 0.0), {"max_time": 0.1}),
    "uphill": (SLED, ICE, Slope(0.3, 5.0), (0.0, 1.0, 0.0, -8.0, 0.0, 0.0), {"max_time": 3.0}),
    "ascent": (SLED, ICE, Slope(-0.3, 5.0), (0.0, 1.0, 0.0, 2.0, 0.0, 0.0), {"max_time": 3.0}),
    "steep": (SLED, ICE, Slope(1.5, 50.0), (0.0, 1.0, 0.0, 2.0, 0.0, 0.0), {"max_time": 3.0}),
    "endless slope": (SLED, ICE, Slope(0.2, 1e300), (0.0, 1.0, 0.0, 2.0, 0.0, 0.0), {"max_time": 1.0}),
    "overflow": (
        DISC,
        ICE,
        Slope(0.0, 10.0),
        (0.0, 1.0, 0.0, -1e300, 1e300, 0.0),
        {"max_time": 1e12, "sample_interval": 1e11},
    ),
    "rod": (ROD, ICE, HILL, (0.0, 0.5, 0.4, 1.0, 0.0, 0.0), {"max_time": 1.0}),
    "point": (POINT, ICE, Slope(0.1, 1.0, 0.0), (0.0, 1.0, 0.0, 1.0, 0.0, 0.0), {}),
    "weightless": (DISC, ICE, Slope(0.1, 10.0, 0.0), (0.0, 1.0, 0.0, 0.0, 0.0, 0.0), {"max_time": 1.0}),
}
