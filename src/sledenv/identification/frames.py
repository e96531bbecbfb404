"""Frame, signs and units of recorded poses, checked without a law: flights fall as gravity has it, spins balance."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from sledenv.identification.flights import explained, flights_of, rebounds_between
from sledenv.identification.plausibility import FACTOR
from sledenv.identification.recordings import FEWEST, Recording
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import Slope
from sledenv.simulation.support import support_heights, within_a_turn

_STRETCH = 1.1  # of the frames that a parabola is tried on
_WITHIN = 0.7  # share of those that it explains which are sure to lie before the first rebound
_SURE = 4.0  # standard errors
_OFF, _NEAR = 0.5, 0.2  # of gravity: what is doubted, and what a remedy may leave
_SUNK = 0.1  # of the height at which a body touches: where no recorded one stands, unless its size is another
_REBOUNDS = 2  # of each recording: errors of a flight grow as flights shorten
_GRAVITY_OTHERWISE = (  # what would be so, and factors of the acceleration along x and y
    ("y pointed away from the surface and not down: turn the signs of y_m and phi_rad", 1.0, -1.0),
    ("x_m and y_m were in mm", 1e-3, 1e-3),
    ("x_m and y_m were in cm", 1e-2, 1e-2),
    ("t_s were in ms", 1e6, 1e6),
)
_SPINS_OTHERWISE = (  # and factors of the orientation
    ("phi_rad were in degrees", math.pi / 180.0),
    ("phi_rad counted from x to y, and not clockwise", -1.0),
)


def check_frame(body: Body, slope: Slope, recordings: Sequence[Recording]) -> None:
    """Refuse recordings that another sign or unit would explain, naming it.

    A body in flight accelerates as gravity has it, and a rebound changes its spin by the moment of its impulse. Both
    are seen in the poses, without a law. Where no change that is known explains more, nothing is said.

    Raises
    ------
    ValueError
    """
    gravity = slope.gravity * np.array([math.sin(slope.angle), -math.cos(slope.angle)])
    for one in recordings:
        height = float(np.median(one.poses[:, 1]))
        heights = support_heights(body, within_a_turn(one.poses[:, 2]))
        if height > 0.0 and np.median(one.poses[:, 1] / heights) < _SUNK:
            raise ValueError(
                f"recording {one.name!r}: y_m = {height:.3g} m in the middle, where a body of this size touches the "
                f"slope at {np.median(heights):.3g} m: give all its lengths in m, not in mm or cm"
            )
        fall, error = _fall(one)
        for words in _gravity_otherwise(gravity, fall, error):
            raise ValueError(
                f"recording {one.name!r}: before the first rebound the body accelerates by {fall[0]:.4g} m/s^2 along "
                f"x and {fall[1]:.4g} m/s^2 along y, where gravity has {gravity[0]:.4g} and {gravity[1]:.4g}; they "
                f"would agree if {words}"
            )
    share = _share(body, slope, recordings)
    if not 1.0 / FACTOR <= share <= FACTOR:
        for words, factor in _SPINS_OTHERWISE:
            turned = [replace(one, poses=one.poses * np.array([1.0, 1.0, factor])) for one in recordings]
            if 1.0 / FACTOR <= _share(body, slope, turned) <= FACTOR:
                told = "cannot be told" if math.isnan(share) else f"are {share:.3g} times the moments of the impulses"
                raise ValueError(f"the table: changes of spin {told}; they would agree with them if {words}")


def _fall(recording: Recording) -> tuple[np.ndarray, float]:
    """Acceleration [m/s^2] along x and y in the flight that a recording begins with, and its error; NaN if untold."""
    times = recording.times - recording.times[0]

    def parabola(frames: int) -> tuple[np.ndarray, np.ndarray]:
        design = np.vander(times[:frames], 3)
        return design, np.linalg.lstsq(design, recording.poses[:frames, :2])[0]

    count, last = 0, FEWEST
    while last <= len(times):
        design, found = parabola(last)
        apart = (recording.poses[:last, :2] - design @ found) / recording.noise.position
        if not explained(np.column_stack([apart, np.zeros(last)])):
            break
        count, last = last, math.ceil(last * _STRETCH)
    used = math.floor(_WITHIN * count)
    if used < FEWEST:
        return np.full(2, np.nan), math.nan
    design, found = parabola(used)
    error = 2.0 * recording.noise.position * math.sqrt(np.linalg.pinv(design.T @ design, hermitian=True)[0, 0])
    return 2.0 * found[0], error


def _gravity_otherwise(gravity: np.ndarray, fall: np.ndarray, error: float) -> Iterator[str]:
    """Yield which change would make an acceleration that of gravity, where it is not."""
    g, slack = float(np.linalg.norm(gravity)), _SURE * error
    if abs(fall[1] - gravity[1]) > _OFF * g + slack:
        for words, *factors in _GRAVITY_OTHERWISE:
            if (np.abs(factors * fall - gravity) < _NEAR * g + np.abs(factors) * slack).all():
                yield words
    elif abs(fall[0] + gravity[0]) < 0.5 * abs(gravity[0]) - slack:
        yield "x ran downhill: turn the signs of x_m and phi_rad, or that of the angle of the slope"


def _share(body: Body, slope: Slope, recordings: Sequence[Recording]) -> float:
    """Share of the moments of the first impulses in the changes of spin, by least squares; NaN without a rebound."""
    tracks = [list(islice(flights_of(body, slope, one), _REBOUNDS + 1)) for one in recordings]
    if all(len(track) < 2 for track in tracks):
        return math.nan
    rebounds = rebounds_between(body, tracks)
    moments = rebounds.moments.sum(axis=1)
    return float(moments @ rebounds.changes_of_spin) / float(moments @ moments)
