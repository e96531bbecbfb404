"""Flights of a recorded track, and the laws that could tie them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from sledenv.identification.fitting import Floats, Parameter, solve
from sledenv.identification.law import USUAL, ImpactModel
from sledenv.identification.rebounds import Rebounds, arms_of
from sledenv.identification.recordings import Recording
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import ContactLaw, Slope, State, asymmetry_of
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height

_FIRST = 5  # frames that a flight is first told from
_LEAST = 3  # frames of a flight, below which it is not told from the ones beside it
_GROWTH = 1.6  # of the frames of a flight, from one look to the next
_LOOKS = 30  # at one flight
_BEGUN = 3  # starts of the fit of a law to rebounds
_ANY_LAW = ContactLaw(1.0, 0.5, 0.0, 0.0)  # a touchdown does not depend on it
_TAME = 3.0  # noise levels from which a pose counts as wrong
_CAP = 16.3  # square of a pose's residual, in noise levels, that one of 1,000 exceeds: larger ones count as this
_MEAN, _SPREAD = 3.0, 2.4  # of that square, three numbers a pose
_WRONG = 0.05  # share of wrong poses that is allowed for
_SURE = 4.0  # standard errors
_LEVELS = (0.0, 0.003, 0.01, 0.03, 0.07, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0)  # of bounds: frictions, arms that are held


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
    """Time [s] at which a flight touches down, and the state there."""
    found = simulate(body, _ANY_LAW, slope, lifted(body, launch), solver="rigid", max_rebounds=1)
    if len(found.rebounds) == 0:
        return math.inf, launch
    row = found.rebounds[0]
    t = float(row["t_touchdown"])
    pose = _along(slope, np.array(launch[:3]), np.array(launch[3:]), np.array([t]))[0]
    return start + t, State(*pose.tolist(), *(float(row[f"{name}_before"]) for name in State._fields[3:]))


def first_guess(slope: Slope, recording: Recording) -> State:
    """Return the state at the first frame of a track that does not begin with a flight."""
    return _ballistic(slope, recording, 0, _FIRST, float(recording.times[0]), None)


def rebounds_between(body: Body, tracks: Sequence[Sequence[Flight]]) -> Rebounds:
    """Return the rebounds between the flights of tracks, of which at least one has two."""
    pairs = [pair for track in tracks for pair in pairwise(track)]
    landings = np.array([before.landing for before, _ in pairs])
    after = np.array([after.launch[3:] for _, after in pairs])
    reach, corner = arms_of(body, landings[:, 2])
    k = math.sqrt(body.inertia / body.mass)
    return Rebounds(k, np.hstack([reach, landings[:, 3:]]), after, corner, np.arange(len(pairs)))


def likely_laws(
    body: Body, tracks: Sequence[Sequence[Flight]], parameters: Sequence[Parameter], fixed: Mapping[str, float]
) -> list[dict[str, float]]:
    """Return laws that tie the flights of tracks: the best, and one for each of some frictions and arms.

    The likeliest comes first. Each rebound counts by itself, from the velocities before it, so that an error does not
    grow from one to the next. A rebound that does not slip to its end says nothing of a higher friction, and one
    that stops to turn nothing of a longer arm: the cost is flat there, and no single law would be enough to begin with.

    Parameters
    ----------
    tracks : sequence of sequences of Flight
        At least one of them with two.
    parameters : sequence of Parameter
        Those of ``LAW``.
    fixed : mapping
        Values of those that are known.
    """
    rebounds = rebounds_between(body, tracks)
    problem = ImpactModel(fixed=fixed).problem(rebounds, parameters)
    if not problem.free:
        return [dict(problem.fixed)]
    held = [problem]
    for one in parameters:
        if one.name in ("friction", "rolling_arm") and one.name in problem.free:
            held += [problem.holding({one.name: one.low + (one.high - one.low) * share}) for share in _LEVELS]
    begin = {one.name: min(max(USUAL.get(one.name, 0.0), one.low), one.high) for one in parameters}
    found = [solve(one, begin, starts=_BEGUN) for one in held if one.free]
    return [fit.values for fit in sorted(found, key=lambda fit: fit.cost)]


def lifted(body: Body, state: State) -> State:
    """Return the state above the surface, or on it: noise may have put it below."""
    return state._replace(y=max(state.y, support_height(body, state.phi)))


def law_of(stiffness: float, values: Sequence[float]) -> ContactLaw:
    """Return the contact law of restitution, friction, rolling arms."""
    restitution, *others = values
    return ContactLaw(stiffness, float(asymmetry_of(restitution)), *others)
