"""Arguments of closed forms, checked: arrays of numbers, a body at rest on a slope."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sledenv.simulation.bodies import Body, made_body
from sledenv.simulation.rules import made
from sledenv.simulation.scene import ContactLaw, Slope

Floats = NDArray[np.float64]


def is_number(values: Floats) -> NDArray[np.bool_]:
    """Whether values are numbers, infinite ones included."""
    return ~np.isnan(values)


def numbers(
    owner: str, name: str, values: ArrayLike, accepts: Callable[[Floats], NDArray[np.bool_]], allowed: str
) -> Floats:
    """Return an argument as an array of floats, or raise an error that names it, a value and what is allowed."""
    try:
        found = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise TypeError(f"{owner}: {name} = {values!r}: must be numbers") from None
    wrong = found[~accepts(found)]
    if wrong.size > 0:
        raise ValueError(f"{owner}: {name} = {wrong.flat[0]}: must be {allowed}")
    return found


def resting(body: Body, law: ContactLaw, slope: Slope) -> tuple[Body, ContactLaw, Slope]:
    """Return what rests, how it touches and where, each checked."""
    return made_body(body), made("law", ContactLaw, law), pressed(slope)


def pressed(slope: Slope) -> Slope:
    """Return a slope onto which gravity presses what lies there."""
    slope = made("slope", Slope, slope)
    if slope.gravity == 0.0:
        raise ValueError("Slope.gravity = 0.0: must be > 0, nothing else holds a body at rest on the slope")
    return slope
