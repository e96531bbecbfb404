"""How a descent changes with its launch, law, slope and body, and how far away its events change."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sledenv.simulation.bisection import bisected, bracket, least_of_smaller
from sledenv.simulation.bodies import Body, Segment, made_body
from sledenv.simulation.derivatives import PARAMETERS, REBOUND_QUANTITIES, Floats, Sensitivity
from sledenv.simulation.neighbours import SIGNS, Neighbours, end_values, places, rebound_values
from sledenv.simulation.richardson import derivatives_of
from sledenv.simulation.rules import checked_choice, checked_count, made
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Settings, checked_settings
from sledenv.simulation.simulate import simulate

_BISECTIONS = 24
_OF_SEGMENTS = ("radius", "eccentricity", "half_angle")


def sensitivity(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    launch: State,
    settings: Settings | None = None,
    *,
    parameters: Sequence[str] | None = None,
    rebounds: int = 10,
) -> Sensitivity:
    """Differentiate a descent with respect to its launch, law, slope and body.

    Derivatives are differences of exact descents that are simulated as one batch: central and one-sided ones over steps
    that are halved again and again, extrapolated (Richardson). Of all estimates the one with the smallest estimated
    error counts, as in C. Ridders, Advances in Engineering Software 4 (1982). A step counts for a rebound only if up to
    there the descents of this and of all smaller steps go through the same events.

    Parameters
    ----------
    body, law, slope, launch
        As for :func:`sledenv.simulate`.
    settings : Settings, optional
        How it is simulated; the default ones otherwise.
    parameters : sequence of str, optional
        Which, of ``sledenv.simulation.derivatives.PARAMETERS``; by default all that play a part. All others stay as
        they are while one is varied: ``y`` and ``phi`` with the radius, the mean stiffness with the restitution.
    rebounds : int
        How many to look at, from the first one, >= 1.

    Returns
    -------
    Sensitivity

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range; nothing is simulated then.
    """
    rebounds = checked_count("rebounds", rebounds)
    settings = checked_settings(settings)
    body, law, slope = made_body(body), made("law", ContactLaw, law), made("slope", Slope, slope)
    names = _checked_parameters(parameters, body, slope, settings.solver)
    descent = simulate(body, law, slope, launch, settings)
    # A neighbour with more rebounds has another sequence; how it goes on does not matter.
    settings = replace(settings, max_rebounds=min(settings.max_rebounds, len(descent.rebounds) + 1))
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):  # where a descent is not finite
        return _differentiated(Neighbours(descent, names, settings), min(rebounds, len(descent.rebounds)))


def _differentiated(neighbours: Neighbours, kept: int) -> Sensitivity:
    """Derivatives of the first rebounds, and of the end."""
    descent, room = neighbours.descent, neighbours.room()[..., np.newaxis]
    steps = np.minimum(neighbours.steps, room)
    runs = neighbours.run(*places(steps), kept)
    agreed = least_of_smaller(runs.agreed.reshape(steps.shape))
    needed = [*range(kept), len(descent.rebounds)]
    fine = [(agreed > count) & (steps < room) for count in needed]  # a step that a bound has cut short is none
    here = [*rebound_values(descent.rebounds[:kept]), *end_values(descent.as_batch())]
    there = [*np.moveaxis(runs.rebounds, 1, 0), runs.end]
    taken = neighbours.rounded(steps)
    found = [derivatives_of(*given, taken) for given in zip(here, there, fine, strict=True)]
    values, errors = zip(*found, strict=True)
    shape = (kept, len(REBOUND_QUANTITIES), len(neighbours.names))
    return Sensitivity(
        descent=descent,
        parameters=neighbours.names,
        values=neighbours.values,
        scales=neighbours.scales,
        rebounds=np.array(values[:-1]).reshape(shape),
        rebound_errors=np.array(errors[:-1]).reshape(shape),
        end=values[-1],
        end_errors=errors[-1],
        sides=np.array([np.diff(each.any(axis=-1).astype(int))[:, 0] for each in fine]),
        distances=_distances(neighbours, steps, agreed, needed),
    )


def _checked_parameters(given: Sequence[str] | None, body: Body, slope: Slope, solver: str) -> tuple[str, ...]:
    """Names of parameters, those that play a part by default."""
    idle = {name for name in PARAMETERS if name.endswith("stiffness")} if solver == "rigid" else set()
    if len(body.arcs) == 1:
        idle |= {"corner_rolling_arm", "half_angle"}
    foreign = () if isinstance(body, Segment) else _OF_SEGMENTS
    idle |= set(foreign)
    if math.isinf(slope.length):
        idle.add("length")
    absent = {name for name in PARAMETERS if name.startswith("zone_")}
    for k, zone in enumerate(slope.zones, 1):
        absent -= {f"zone_{k}_{name}" for name, value in zone.given().items() if math.isfinite(value)}
    idle |= absent
    if given is None:
        return tuple(name for name in PARAMETERS if name not in idle)
    if isinstance(given, str) or not isinstance(given, Sequence) or not given:
        raise ValueError(f"parameters = {given!r}: must be a sequence of names, at least one")
    for name in given:
        checked_choice("parameters", name, tuple(PARAMETERS))
        if name in foreign:
            raise ValueError(f"parameters: {name!r} is that of a segment, and the body is a {type(body).__name__}")
        if name in absent:
            raise ValueError(f"parameters: the slope has no {name!r} that could be varied")
    if len(set(given)) < len(given):
        raise ValueError(f"parameters = {given!r}: must name each parameter once")
    if "length" in given and "length" in idle:
        raise ValueError("parameters: the slope is endless, so that its length cannot be varied")
    return tuple(given)


def _distances(neighbours: Neighbours, steps: Floats, agreed: NDArray[np.int64], needed: list[int]) -> Floats:
    """Distances at which fewer rebounds agree than needed, of several needs, shape (needs, P, 2)."""
    brackets = [bracket(steps, agreed > count) for count in needed]
    low, high = (np.array(ends) for ends in zip(*brackets, strict=True))
    near = np.isfinite(high) & (low > 0.0)
    level, which, side = np.nonzero(near)
    signs, counts = SIGNS[side], np.array(needed)[level]

    def agrees(middle: Floats) -> NDArray[np.bool_]:
        tried, lanes = np.unique(np.stack([which, signs * middle]), axis=1, return_inverse=True)
        same: NDArray[np.bool_] = neighbours.run(tried[0].astype(int), tried[1], 0).agreed[lanes.reshape(-1)] > counts
        return same

    if near.any():
        low[near], high[near] = bisected(low[near], high[near], agrees, _BISECTIONS)
    return np.where(low > 0.0, 0.5 * (low + high), np.where(np.isfinite(high), 0.0, np.inf))
