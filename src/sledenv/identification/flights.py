"""The flights of a recorded track, the laws that could tie them, and whether its frame and units are right."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from sledenv.identification.fitting import solve
from sledenv.identification.objective import Floats, Parameter, Problem
from sledenv.identification.plausibility import FACTOR
from sledenv.identification.rebounds import arms_of
from sledenv.simulation.bodies import Body
from sledenv.simulation.rigid_impact import velocities_after
from sledenv.simulation.scene import ContactLaw, Slope, State, asymmetry_of
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height, support_heights, within_a_turn

LAW = ("restitution", "friction", "rolling_arm", "corner_rolling_arm")
FEWEST = 8  # frames of a recording
_FIRST = 5  # frames that a flight is first told from
_LEAST = 3  # frames of a flight, below which it is not told from the ones beside it
_GROWTH = 1.6  # of the frames of a flight, from one look to the next
_LOOKS = 30  # at one flight
_ANY_LAW = ContactLaw(1.0, 0.5, 0.0, 0.0)  # a touchdown does not depend on it
_TAME = 3.0  # noise levels from which a pose counts as wrong
_CAP = 16.3  # square of a pose's residual, in noise levels, that one of 1,000 exceeds: larger ones count as this
_MEAN, _SPREAD = 3.0, 2.4  # of that square, three numbers a pose
_WRONG = 0.05  # share of wrong poses that is allowed for
_SURE = 4.0  # standard errors
_GROSS = 0.1  # share of the root of the energy that counts as a gross error of a rebound
# Of the bounds, where a law is tried: friction and arms, restitution.
_LEVELS = np.array([0.0, 0.003, 0.01, 0.03, 0.07, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0])
_EVEN, _FEW = np.linspace(0.0, 1.0, 9), np.array([0.1, 0.5, 0.9])
_STRETCH = 1.1  # of the frames that a parabola is tried on
_WITHIN = 0.7  # share of those that it explains which are sure to lie before the first rebound
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


class Noise(NamedTuple):
    """Standard deviations of recorded poses."""

    position: float  # [m] of x and of y
    angle: float  # [rad]


@dataclass(frozen=True)
class Recording:
    """Poses of one body over time.

    Attributes
    ----------
    name : str
    times : ndarray, shape (n,)
        [s], increasing.
    poses : ndarray, shape (n, 3)
        x, y of the mass centre [m] and phi [rad], which may be less whole turns.
    noise : Noise
    """

    name: str
    times: Floats
    poses: Floats
    noise: Noise

    def residuals(self, poses: Floats) -> Floats:
        """What poses, shape (m, 3), of the first m frames differ by from the recorded ones, in noise levels."""
        apart = self.poses[: len(poses)] - poses
        apart[:, 2] = np.remainder(apart[:, 2] + math.pi, 2.0 * math.pi) - math.pi
        apart[:, :2] /= self.noise.position
        apart[:, 2] /= self.noise.angle
        return apart

    def until(self, time: float) -> int:
        """Return the number of frames before a time [s]."""
        return int(np.searchsorted(self.times, time))


class Flight(NamedTuple):
    """A flight and the rebound that ends it."""

    start: float  # [s]
    launch: State  # there
    end: float  # [s] of its touchdown, inf if it has none
    landing: State  # there


def explained(rows: Floats) -> bool:
    """Whether residuals, shape (n, 3), in noise levels, are noise but for a few wrong poses.

    Compares the mean of their squares, each at most that which one in 1,000 exceeds, with what it is by chance.
    """
    if len(rows) == 0:
        return True
    squares = np.minimum(np.sum(rows * rows, axis=1), _CAP)
    allowed = _MEAN + _WRONG * _CAP + _SURE * _SPREAD / math.sqrt(len(rows))
    return bool(squares.mean() <= allowed)


def flights_of(body: Body, slope: Slope, recording: Recording) -> Iterator[Flight]:
    """Follow a track from flight to flight, as long as they have frames enough to be told apart.

    A flight is fitted to more and more of its frames. The simulator tells from it when it touches down, and no later
    frame is used; the next one begins with the pose there, so that its velocities alone are free.

    Yields
    ------
    Flight
        In order; none at all if the recording does not begin with one.
    """
    slope = slope._replace(length=math.inf)
    start, pose = float(recording.times[0]), None
    last = len(recording.times)
    while True:
        first = recording.until(start)
        stop, end = min(first + _FIRST, last), math.inf
        for _ in range(_LOOKS):
            if stop - first < _LEAST:
                return
            launch = _ballistic(slope, recording, first, stop, start, pose)
            end, landing = _touchdown(body, slope, launch, start)
            before, stop = stop, min(recording.until(end), first + math.ceil((stop - first) * _GROWTH), last)
            if stop == before:
                break
        if not explained(_apart(slope, recording, first, stop, start, launch)):
            return
        yield Flight(start, launch, end, landing)
        if stop == last:
            return
        start, pose = end, np.array(landing[:3])


def _pulls(slope: Slope) -> Floats:
    """Acceleration [m/s^2], [rad/s^2] in flight."""
    return np.array([slope.gravity * math.sin(slope.angle), -slope.gravity * math.cos(slope.angle), 0.0])


def _along(slope: Slope, pose: Floats, rates: Floats, times: Floats) -> Floats:
    """Poses, shape (n, 3), at times [s] after one of a flight."""
    t = times[:, None]
    found: Floats = pose + rates * t + 0.5 * _pulls(slope) * t * t
    return found


def _apart(slope: Slope, recording: Recording, first: int, stop: int, start: float, launch: State) -> Floats:
    """Residuals of a flight in frames ``first`` to ``stop``."""
    poses = _along(slope, np.array(launch[:3]), np.array(launch[3:]), recording.times[first:stop] - start)
    return replace(recording, poses=recording.poses[first:stop]).residuals(poses)


def _ballistic(slope: Slope, recording: Recording, first: int, stop: int, start: float, pose: Floats | None) -> State:
    """Fit a flight to frames ``first`` to ``stop``; its pose at the start is free if it is None."""
    frames = recording.poses[first:stop]
    times = recording.times[first:stop] - start
    turned = np.unwrap(frames[:, 2])
    slopes = np.polyfit(times, np.column_stack([frames[:, :2], turned]), 1)[0]
    begin = slopes - _pulls(slope) * times.mean()
    known = [] if pose is None else pose.tolist()

    def residuals(values: Floats) -> Floats:
        state = State(*known, *values)
        return _apart(slope, recording, first, stop, start, state).ravel()

    free = begin if known else np.concatenate([frames[0, :2], turned[:1], begin])
    found = least_squares(residuals, free, loss="soft_l1", f_scale=_TAME, x_scale="jac")
    return State(*known, *found.x.tolist())


def _touchdown(body: Body, slope: Slope, launch: State, start: float) -> tuple[float, State]:
    """When [s] a flight touches down, and the state there."""
    found = simulate(body, _ANY_LAW, slope, lifted(body, launch), solver="rigid", max_rebounds=1)
    if len(found.rebounds) == 0:
        return math.inf, launch
    row = found.rebounds[0]
    t = float(row["t_touchdown"])
    pose = _along(slope, np.array(launch[:3]), np.array(launch[3:]), np.array([t]))[0]
    return start + t, State(*pose.tolist(), *(float(row[f"{name}_before"]) for name in State._fields[3:]))


def first_guess(slope: Slope, recording: Recording) -> State:
    """State at the first frame, of a track that does not begin with a flight."""
    return _ballistic(slope, recording, 0, _FIRST, float(recording.times[0]), None)


def grid_of(parameters: Sequence[Parameter], fixed: Mapping[str, float], few: bool = False) -> Floats:
    """Laws all over their bounds, shape (E, F, D, C, 4); closer together where friction and arms are small."""
    levels = {one.name: one.low + (one.high - one.low) * (_LEVELS[2::3] if few else _LEVELS) for one in parameters}
    levels["restitution"] = parameters[0].low + (parameters[0].high - parameters[0].low) * (_FEW if few else _EVEN)
    levels |= {name: np.array([value]) for name, value in fixed.items()}
    grid: Floats = np.stack(np.meshgrid(*(levels[name] for name in LAW), indexing="ij"), axis=-1)
    return grid


def likely_laws(
    body: Body,
    tracks: Sequence[Sequence[Flight]],
    parameters: Sequence[Parameter],
    fixed: Mapping[str, float],
) -> list[dict[str, float]]:
    """Laws that tie the flights of tracks, the likeliest first: the best, and one for each of some frictions and arms.

    Each rebound counts by itself, from the velocities before it, so that an error does not grow from one to the next.
    A rebound that does not slip to its end says nothing of a higher friction, and one that stops to turn nothing of a
    longer arm: the cost is flat there, and no single law would be enough to begin with.

    Parameters
    ----------
    tracks : sequence of sequences of Flight
        At least one of them with two.
    parameters : sequence of Parameter
        Those of ``LAW``.
    fixed : mapping
        Values of those that are known.
    """
    pairs = [pair for track in tracks for pair in pairwise(track)]
    landings = np.array([before.landing for before, _ in pairs])
    after = np.array([after.launch[3:] for _, after in pairs])
    k = math.sqrt(body.inertia / body.mass)
    scales = np.array([1.0, 1.0, k]) / np.linalg.norm(landings[:, 3:] * [1.0, 1.0, k], axis=1)[:, None]
    reach, corner = arms_of(body, landings[:, 2])
    contacts = np.hstack([reach, landings[:, 3:]])

    def residuals(values: Floats) -> Floats:
        """Velocities after each rebound, in shares of the root of the energy before it; of laws of shape (..., 4)."""
        laws = values.reshape(-1, 1, len(LAW))
        rows = np.empty((len(laws), len(pairs), 3))
        rows[..., :2] = laws[..., :2]
        rows[..., 2] = np.where(corner, laws[..., 3], laws[..., 2])
        hits = np.tile(contacts, (len(laws), 1))
        found = velocities_after(k, hits, rows.reshape(-1, 3)).reshape(-1, len(pairs), 3)
        apart: Floats = ((found - after) * scales).reshape(*values.shape[:-1], len(pairs), 3)
        return apart

    problem = Problem(parameters, residuals, fixed, loss_scale=_GROSS)
    if not problem.free:
        return [dict(fixed)]
    grid = grid_of(parameters, fixed)
    costs = np.sum(np.sqrt(1.0 + np.sum(residuals(grid) ** 2, axis=-1) / _GROSS**2), axis=-1)
    found = [solve(problem, dict(zip(LAW, grid[np.unravel_index(costs.argmin(), costs.shape)], strict=True)), starts=1)]
    for axis, name in ((1, "friction"), (2, "rolling_arm")):
        for i in range(grid.shape[axis]):
            laws, sums = np.take(grid, i, axis), np.take(costs, i, axis)
            law = dict(zip(LAW, laws[np.unravel_index(sums.argmin(), sums.shape)].tolist(), strict=True))
            held = problem.holding({name: law[name]})
            if held.free:
                found.append(solve(held, law, starts=1))
    return [fit.values for fit in sorted(found, key=lambda fit: fit.cost)]


def lifted(body: Body, state: State) -> State:
    """Return the state above the surface, or on it: noise may have put it below."""
    return state._replace(y=max(state.y, support_height(body, state.phi)))


def law_of(stiffness: float, values: Sequence[float]) -> ContactLaw:
    """Return the contact law of restitution, friction, rolling arms."""
    restitution, *others = values
    return ContactLaw(stiffness, float(asymmetry_of(restitution)), *others)


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
        count, last = last, math.ceil(last * _STRETCH)
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
