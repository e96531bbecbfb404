"""Whether recorded poses are in the frame and the units that they must be in, told from flights, whatever the law."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from sledenv.identification.flights import FEWEST, Recording, explained, flights_of
from sledenv.identification.objective import Floats
from sledenv.identification.plausibility import FACTOR
from sledenv.identification.rebounds import arms_of
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import Slope
from sledenv.simulation.support import support_heights, within_a_turn

_GROWTH = 1.1  # of the frames that a parabola is tried on
_WITHIN = 0.7  # share of those that it explains which are sure to lie before the first rebound
_SURE = 4.0  # standard errors
_OFF, _NEAR = 0.5, 0.2  # of gravity: what is doubted, and what a remedy may leave
_SUNK = 0.1  # of the height at which a body touches: where no recorded one stands, unless its size is another
_REBOUNDS = 2  # of each recording: errors of a flight grow as flights shorten
_UNITS = {  # of the acceleration in flight, by what would be so
    "x_m and y_m were in mm": 1e-3,
    "x_m and y_m were in cm": 1e-2,
    "t_s were in ms": 1e6,
}
_ORIENTATIONS = {
    "phi_rad were in degrees": math.pi / 180.0,
    "phi_rad counted from x to y, and not clockwise": -1.0,
}


class _Fall(NamedTuple):
    """Acceleration of the mass centre before the first rebound."""

    along: float  # [m/s^2]
    away: float
    error: float  # of each


def check_frame(body: Body, slope: Slope, recordings: Sequence[Recording]) -> None:
    """Refuse recordings that another sign or unit would explain, naming it.

    A body in flight accelerates as gravity has it, and a rebound changes its spin by the moment of its impulse. Both
    are seen in the poses, without a law. Where no change that is known explains more, nothing is said.

    Raises
    ------
    ValueError
    """
    for one in recordings:
        heights = support_heights(body, within_a_turn(one.poses[:, 2]))
        if np.median(one.poses[:, 1] / heights) < _SUNK and np.median(one.poses[:, 1]) > 0.0:
            raise ValueError(
                f"recording {one.name!r}: y_m = {np.median(one.poses[:, 1]):.3g} m in the middle, where a body of this "
                f"size touches the slope at {np.median(heights):.3g} m: give all its lengths in m, not in mm or cm"
            )
        fall = _fall(one)
        if fall is None:
            continue
        for words in _gravity_otherwise(slope, fall):
            raise ValueError(
                f"recording {one.name!r}: before the first rebound the body accelerates by {fall.along:.4g} m/s^2 "
                f"along x and {fall.away:.4g} m/s^2 along y, where gravity has "
                f"{slope.gravity * math.sin(slope.angle):.4g} and {-slope.gravity * math.cos(slope.angle):.4g}; "
                f"they would agree if {words}"
            )
    told = _moments(body, slope, recordings)
    if _agree(told):
        return
    for words, factor in _ORIENTATIONS.items():
        turned = [replace(one, poses=one.poses * np.array([1.0, 1.0, factor])) for one in recordings]
        if _agree(_moments(body, slope, turned)):
            share = f"are {_share(told):.3g} times the moments of the impulses" if len(told) else "cannot be told"
            raise ValueError(f"the table: changes of spin {share}; they would agree with them if {words}")


def _fall(recording: Recording) -> _Fall | None:
    """Acceleration in the flight that a recording begins with; None if there is none that tells it."""
    times = recording.times - recording.times[0]
    count, last = 0, FEWEST
    while last <= len(times):
        design = np.vander(times[:last], 3)
        apart = recording.poses[:last, :2] - design @ np.linalg.lstsq(design, recording.poses[:last, :2])[0]
        levels = np.column_stack([apart / recording.noise.position, np.zeros(last)])
        if not explained(levels):
            break
        count, last = last, math.ceil(last * _GROWTH)
    used = math.floor(_WITHIN * count)
    if used < FEWEST:
        return None
    design = np.vander(times[:used], 3)
    found = np.linalg.lstsq(design, recording.poses[:used, :2])[0]
    error = 2.0 * recording.noise.position * math.sqrt(np.linalg.pinv(design.T @ design, hermitian=True)[0, 0])
    return _Fall(2.0 * float(found[0, 0]), 2.0 * float(found[0, 1]), error)


def _gravity_otherwise(slope: Slope, fall: _Fall) -> Iterator[str]:
    """Yield which change would make an acceleration that of gravity, where it is not."""
    g = slope.gravity
    along, away = g * math.sin(slope.angle), -g * math.cos(slope.angle)

    def near(factor: float, value: float, wanted: float) -> bool:
        return abs(factor * value - wanted) < _NEAR * g + _SURE * abs(factor) * fall.error

    if abs(fall.away - away) > _OFF * g + _SURE * fall.error:
        if near(-1.0, fall.away, away):
            yield "y pointed away from the surface and not down: turn the signs of y_m and phi_rad"
        for words, factor in _UNITS.items():
            if near(factor, fall.away, away) and near(factor, fall.along, along):
                yield words
    elif abs(fall.along + along) < 0.5 * abs(along) - _SURE * fall.error:
        yield "x ran downhill: turn the signs of x_m and phi_rad, or that of the angle of the slope"


def _moments(body: Body, slope: Slope, recordings: Sequence[Recording]) -> Floats:
    """Moments of the impulses and changes of spin of the first rebounds, over the mass, shape (n, 2) [m^2/s]."""
    rows = []
    for one in recordings:
        flights = []
        for flight in flights_of(body, slope, one):
            flights.append(flight)
            if len(flights) > _REBOUNDS:
                break
        for before, after in pairwise(flights):
            ((a, b),), _ = arms_of(body, np.array([before.landing.phi]))
            change = np.array(after.launch[3:]) - np.array(before.landing[3:])
            rows.append((b * change[0] - a * change[1], body.inertia / body.mass * change[2]))
    return np.array(rows).reshape(-1, 2)


def _share(moments: Floats) -> float:
    """What the changes of spin are of the moments, by least squares."""
    impulses, spins = moments.T
    return float(impulses @ spins) / float(impulses @ impulses)


def _agree(moments: Floats) -> bool:
    """Whether there are rebounds, and their impulses explain their spins."""
    return len(moments) > 0 and 1.0 / FACTOR <= _share(moments) <= FACTOR
