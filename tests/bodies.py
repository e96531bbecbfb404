"""Bodies with corners that are no laminas; a launch at a height above the slope."""

from __future__ import annotations

import math

from sledenv.simulation.bodies import Body, least_eccentricity
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height


def rod(mass: float, half_length: float, inertia: float) -> Body:
    """A thin segment whose chord passes through its mass centre: an end touches, or both.

    It lies flat at phi = 0 and pi and stands on its tail at pi/2.
    """
    half_angle = 0.1
    return Body(mass, half_length / math.sin(half_angle), half_length / math.tan(half_angle), inertia, half_angle)


def segment(mass: float, radius: float, share: float, inertia: float, half_angle: float) -> Body:
    """A body whose mass centre lies at a share of the way from the chord to the arc, or from the centre of the arc."""
    least = least_eccentricity(radius, half_angle)
    return Body(mass, radius, least + share * (radius - least), inertia, half_angle)


def run(body: Body, law: ContactLaw, slope: Slope, launch: tuple[float, ...], **options: float) -> Descent:
    """Simulate a launch whose second entry is the clearance of the lowest point [m]."""
    x, clearance, phi, *rates = launch
    state = State(x, clearance + support_height(body, phi), phi, *rates)
    return simulate(body, law, slope, state, record="trajectory", **options)  # type: ignore[arg-type]
