"""The ride that the page opens with where nothing is asked for: a sled over gentle bumps, to the finish."""

from __future__ import annotations

import math
from typing import Final

from sledenv.pages.play import given_values, simulating_page, told_setting
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Settings
from sledenv.simulation.simulate import simulate
from sledenv.simulation.sleds import RIDER, sled
from sledenv.simulation.support import support_height

_TITLE: Final = "A sled over bumps"
_QUESTION: Final = (
    "A rider lies on a sled and rides over three bumps of packed snow. "
    "The descent ends where the rider touches the snow."
)
_BUMP: Final = ((3.0, 0.0), (4.5, 0.3), (5.0, 0.3), (6.5, 0.0))  # [m], the first of three


def opening_descent() -> Descent:
    """Return the ride, with its trajectory."""
    profile = [(x + 6.5 * k, y) for k in range(3) for x, y in _BUMP]
    body = sled()
    law = ContactLaw.from_restitution(0.2, stiffness=1e6, friction=0.03, rolling_arm=0.001)
    slope = Slope(math.radians(12.0), 24.0, profile=profile)
    launch = State(0.0, 0.2 + support_height(body, 0.0), 0.0, u=7.0)
    settings = Settings(max_time=30.0, max_rebounds=200, end_touching=RIDER)
    return simulate(body, law, slope, launch, settings, record="trajectory")


def opening_page() -> str:
    """Return the page that simulates, opened at the ride."""
    descent = opening_descent()
    given = descent.body, descent.law, descent.slope, descent.launch
    context = told_setting("the ride", 0, given_values(*given), *given[1:])
    assert descent.settings is not None
    return simulating_page(
        [context], [], descent.law, descent.slope, descent.settings, title=_TITLE, question=_QUESTION
    )
