"""Arguments of closed forms, checked: a body at rest on a slope, and numbers that may be infinite."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sledenv.simulation.bodies import Body, made_body
from sledenv.simulation.rules import Rule, made
from sledenv.simulation.scene import ContactLaw, Slope

Floats = NDArray[np.float64]
IS_NUMBER: Rule = (lambda v: ~np.isnan(v), "a number")


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
