"""A page to ride: a visitor trims the flights of a sled beside the rides of agents, which the kernel in it repeats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from sledenv.pages.html import filled
from sledenv.pages.kernel import descent_input, packed_kernel
from sledenv.pages.play import exact_text
from sledenv.pages.scenes import drawn_body
from sledenv.plot.riders import pieces
from sledenv.scenarios.scenario import Context, Scenario
from sledenv.scenarios.sections import RiderSection
from sledenv.simulation.jam import SHARE_OF_PROGRESS


class Ridden(NamedTuple):
    """A ride beside the visitor's."""

    name: str
    trims: Sequence[float]  # in [-1, 1], of one flight after the other


class Hill(NamedTuple):
    """A context that a visitor can ride in."""

    name: str
    context: Context
    rides: Sequence[Ridden] = ()
    scenario: Scenario | None = None  # whose context it is, if not that of the page


def ride_page(scenario: Scenario, hills: Sequence[Hill], title: str | None = None) -> str:
    """Return a page to ride, which needs no other file and no network: docs/browser.md.

    Parameters
    ----------
    scenario : Scenario
        With a rider; one of rides.
    hills : sequence of Hill
        What can be chosen, at least one; the first is chosen at first. One with a scenario of its own, which has the
        same rider, is told by the description of that.
    title : str, optional
        That of the scenario by default.

    Raises
    ------
    ValueError
        If the scenario has no rider, or there is no hill.
    """
    rider = scenario.rider
    if rider is None:
        raise ValueError(f"scenario {scenario.id} has no rider: must have one who can trim")
    if not hills:
        raise ValueError("hills is empty: must hold at least one")
    own = [hill.scenario or scenario for hill in hills]
    exact = {
        "trim": rider.trim_rad_s,
        "rotor_inertia": rider.rotor_inertia_kg_m2,
        "hills": [_told(one, rider, hill) for one, hill in zip(own, hills, strict=True)],
    }
    drawn = [drawn_body(one.given(hill.context).body) for one, hill in zip(own, hills, strict=True)]
    content = {
        "title": title or scenario.title,
        "named": hills[0].scenario is not None,
        "noise": rider.noise_rad_s,
        "ends": " or ".join(scenario.settings().end_parts),
        "exact": exact_text(exact),
        "drawn": drawn,
        "share": SHARE_OF_PROGRESS,
        "turns": ("nose up", "nose down") if pieces(own[0].given(hills[0].context).body) else ("backwards", "forwards"),
        "kernel": packed_kernel(),
    }
    return filled("ride.html", data=content)


def _told(scenario: Scenario, rider: RiderSection, hill: Hill) -> dict[str, Any]:
    """Return a context as the page must know it, with all digits of its numbers."""
    name, context, rides, own = hill
    given = scenario.given(context)
    scene = descent_input(*given, scenario.settings())
    scene["limits"]["shortest_flight"] = rider.shortest_flight_s
    most = scenario.limits.max_rebounds if rider.noise_rad_s > 0.0 else 0  # a ride has no more flights
    errors = scenario.errors(np.full(most, context.track), np.arange(most))
    return {
        "name": name,
        "question": own.description if own else scenario.question,
        "scene": scene,
        "errors": errors.tolist(),
        "rides": [{"name": ride.name, "trims": [float(trim) for trim in ride.trims]} for ride in rides],
        "parts": given.body.parts,
        "ends": scenario.settings().end_parts,
        "size": given.body.size,
    }
