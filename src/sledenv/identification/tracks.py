"""From recorded poses over time to the contact law and the launches that explain them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from sledenv.checks import BatchSolver, checked_choice
from sledenv.descent import Descent, simulate
from sledenv.identification.fitting import Fit, Interval, LocalMinimumError, Loss, Parameter, Problem, profiled, solve
from sledenv.identification.flights import (
    LAW,
    Flight,
    Noise,
    Recording,
    explained,
    first_guess,
    flights_of,
    grid_of,
    law_of,
    lifted,
    likely_laws,
)
from sledenv.identification.rebounds import numbers
from sledenv.outline import drawable_rows, reach, states_at
from sledenv.params import POSITIVE, Body, ContactLaw, Slope, State, checked, made
from sledenv.replay import Ghost
from sledenv.text import TRAJECTORY_COLUMNS

Floats = NDArray[np.float64]

TIME = TRAJECTORY_COLUMNS["t"]
POSE = tuple(TRAJECTORY_COLUMNS[name] for name in ("x", "y", "phi"))
RECORDING = "recording"

_STIFFNESS = "log10_stiffness"
_UNITS = dict(zip(State._fields, ("m", "m", "rad", "m/s", "m/s", "rad/s"), strict=True))
_FEWEST = 8  # frames of a recording
_TAIL = 0.08  # [s] by which a horizon grows where flights are too short to be told apart
_APART = 15.0  # by which the cost of a law may exceed the least one: half of what chi-squared may
_KEPT = 8  # laws that are followed at a time
_DRAWS = 32  # laws and launches that are drawn for each rebound
_BACK = 4  # rebounds from which more are drawn where none of those explains what follows
_SCANNED = np.linspace(0.0, 1.0, 24) ** 3  # of bounds of friction and arm, where they are tried
_TRIED = 3  # of them, fitted
_WIDER = 3.0  # than their covariance
_BESIDE = (1.05, 1.15, 1.3, 1.6, 2.2, 4.0)  # factors of a friction, where another minimum is looked for
_EQUAL = 1e-3  # difference of two costs that counts as none
_ALIKE = 0.05  # of their scales: laws that differ by less are one
_TAME = 3.0  # noise levels from which a pose counts as wrong
_MISFIT = 1.5  # mean square of residuals, in noise levels, from which it is said
_CLOSE = 1.92  # by which the cost of a law may exceed the least one so that it is in an interval of level .95
_LIMIT = 15  # steps of one minimisation on the way
_DRAWN = 0.01  # [s] between two rows in flight of a descent that is shown, simulate's default
_FLOOR = 1e-6  # least noise, of the size of the body and [rad]: about the precision of a single float
_LONGEST, _SHORTEST = 0.1, 0.02  # contacts of stiffnesses that are tried: [s], and in intervals of frames
_STIFFNESSES = 7  # that are tried at the start


def identify_tracks(
    table: pd.DataFrame,
    body: Body,
    slope: Slope,
    *,
    solver: BatchSolver = "rigid",
    fixed: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    noise: tuple[float, float] | None = None,
    loss: Loss = "soft_l1",
    seed: int = 0,
) -> TrackFit:
    """Fit a contact law, and the launch of each recording, to recorded poses of a body.

    The flights between rebounds are found first: they tell the velocities before and after each, and these a first
    guess of the law, for each of several frictions. From there whole descents are fitted, over more and more rebounds,
    because their cost has many local minima and each rebound enlarges errors. A recording is used as far as it is
    explained: up to where residuals exceed the noise by more than chance and a few wrong poses can tell.

    Parameters
    ----------
    table : DataFrame
        Columns ``t_s``, ``x_m``, ``y_m`` and ``phi_rad``: time, position of the mass centre in the frame of the slope
        and orientation, with or without whole turns. ``recording``, if there, tells several recordings of the same
        body and law apart. Times increase within a recording; a frame whose pose is NaN is left out.
    body, slope
        What was recorded, and where. The length of the slope does not matter.
    solver : {"rigid", "compliant"}
        Rigid surfaces, or the two-stiffness contact, whose stiffness is fitted as well.
    fixed : mapping, optional
        Values of parameters that are known, of ``restitution``, ``friction``, ``rolling_arm`` [m],
        ``corner_rolling_arm`` [m], 0 unless there are bounds of it, and ``stiffness`` [N/m].
    bounds : mapping, optional
        Lower and upper bound of fitted ones; restitution in [0, 1], friction in [0, 1.5], arms from 0 to the radius
        and stiffness, of contacts that last from .02 intervals of frames to .1 s, by default.
    noise : tuple of float, optional
        Standard deviations of a position [m] and of an orientation [rad]. Estimated from the third differences of
        poses by default, by their median so that rebounds and wrong poses hardly count.
    loss : {"soft_l1", "linear"}
        As for :class:`~sledenv.identification.fitting.Problem`; ``"soft_l1"`` bears wrong poses.
    seed : int
        Of the laws and launches that are drawn where none of those that were followed explains what comes next.

    Returns
    -------
    TrackFit

    Raises
    ------
    TypeError, ValueError
        Naming recording, column, value and what is allowed; if no body touches the slope; or if no rebound can be
        explained.
    """
    checked_choice("solver", solver, get_args(BatchSolver))
    checked_choice("loss", loss, get_args(Loss))
    body, slope = made("body", Body, body), made("slope", Slope, slope)._replace(length=math.inf)
    known = None
    if noise is not None:
        names = zip(Noise._fields, noise, strict=True)
        known = Noise(*(checked("noise", name, value, POSITIVE) for name, value in names))
    held = _known(fixed or {}, bounds or {}, solver)
    recordings = recordings_of(table, reach(body), known)
    model = _Model(body, slope, solver, recordings, _parameters(body, solver, recordings, bounds or {}), loss)
    if solver == "rigid":
        held[_STIFFNESS] = model.parameters[0].high  # which rigid surfaces do not use
    search = _Search(model, held, np.random.default_rng(seed))
    fits = search.run()
    if not fits:
        raise ValueError(_nothing_told(search))
    best, intervals = _settled(fits)
    others = [fit for fit in _distinct([best, *fits]) if fit is not best]
    return TrackFit(body, slope, solver, recordings, search.frames(search.level), best, intervals, others, model)


def _nothing_told(search: _Search) -> str:
    """Why no law could be fitted."""
    if all(
        track and track[-1].end > one.times[-1]
        for track, one in zip(search.flights, search.model.recordings, strict=True)
    ):
        return "the table: the body touches the slope in no recording, so that nothing tells the law"
    noise = ", ".join(
        f"{one.name!r} {one.noise.position:.2g} m, {one.noise.angle:.2g} rad" for one in search.model.recordings
    )
    return (
        "the table: no law explains the first rebound of any recording to within its noise "
        f"({noise}): are the body, the slope, the units and the frame right, and is the noise? "
        "A contact that lasts for some frames needs compliant surfaces"
    )


def _settled(fits: Sequence[Fit]) -> tuple[Fit, dict[str, Interval]]:
    """Return the best fit, and intervals of the law that hold those of all minima that are as good.

    A minimum with a lower cost, here or beside an interval, is where the fit goes on.
    """
    names = [name for name in fits[0].problem.free if name in (*LAW, _STIFFNESS)]
    fit, intervals = profiled(solve(fits[0].problem, fits[0].values, starts=1), names=names)
    rows = fit.problem.rows(fit.vector)
    allowed = 2.0 * _CLOSE * fit.cost / (rows.size - len(fit.problem.free))
    for values in (*(other.values for other in fits[1:]), *_beside(fit, intervals)):
        other = solve(fit.problem, values, starts=1)
        inside = all(ends.low <= other.values[name] <= ends.high for name, ends in intervals.items())
        if not inside and fit.cost - _EQUAL < other.cost < fit.cost + allowed:
            there = replace(other, cost=fit.cost)  # against which costs around this minimum are compared
            try:
                intervals = {name: _hull(ends, there.interval(name)) for name, ends in intervals.items()}
            except LocalMinimumError as lower:
                other = solve(fit.problem, lower.values, starts=1)
        if other.cost < fit.cost - _EQUAL:
            return _settled([other, fit])
    return fit, intervals


def _beside(fit: Fit, intervals: Mapping[str, Interval]) -> Iterator[dict[str, float]]:
    """Values that may belong to another minimum, with a friction outside of its interval.

    Beyond a friction at which a rebound stops to slip, the cost may rise at first and fall again.
    """
    if "friction" not in intervals:
        return
    low, high, *_ = intervals["friction"]
    friction = fit.problem.parameter("friction")
    for factor in _BESIDE:
        for value in (low / factor, high * factor):
            if friction.low <= value <= friction.high:
                cost, values = fit.held(friction=value)
                if cost < fit.cost + _APART:
                    yield values


def _hull(one: Interval, other: Interval) -> Interval:
    """Return the smallest interval that holds both."""
    low, high = min(one, other, key=lambda ends: ends.low), max(one, other, key=lambda ends: ends.high)
    return Interval(low.low, high.high, one.level, low.low_on_bound, high.high_on_bound)


def recordings_of(table: pd.DataFrame, size: float, noise: Noise | None = None) -> list[Recording]:
    """Check a table and return its recordings.

    Parameters
    ----------
    table
        As for :func:`identify_tracks`.
    size : float
        Of the body [m]: noise below a millionth of it counts as that much.
    noise : Noise, optional
        Estimated for each recording by default.
    """
    missing = [name for name in (TIME, *POSE) if name not in table.columns]
    if missing:
        raise ValueError(f"the table has no column {missing[0]!r}: must have {', '.join((TIME, *POSE))}")
    if RECORDING not in table.columns:
        return [_recording("0", table, size, noise)]
    if table[RECORDING].isna().any():
        row = int(np.argmax(table[RECORDING].isna()))
        raise ValueError(f"column {RECORDING!r}, row {row}: must name the recording")
    return [_recording(str(name), rows, size, noise) for name, rows in table.groupby(RECORDING, sort=False)]


def _recording(name: str, table: pd.DataFrame, size: float, noise: Noise | None) -> Recording:
    columns = []
    for column in (TIME, *POSE):
        try:
            columns.append(numbers(table, column))
        except ValueError as error:
            raise ValueError(f"recording {name!r}: {error}") from None
    times, poses = columns[0], np.stack(columns[1:], axis=-1)
    if not np.isfinite(times).all():
        row = int(np.argmin(np.isfinite(times)))
        raise ValueError(f"recording {name!r}: {TIME} = {times[row]} in row {row}: must be a finite number")
    if (np.diff(times) <= 0.0).any():
        row = int(np.argmax(np.diff(times) <= 0.0)) + 1
        raise ValueError(
            f"recording {name!r}: {TIME} = {times[row]!r} in row {row}: must increase from {times[row - 1]!r}"
        )
    if np.isinf(poses).any():
        row, column = np.argwhere(np.isinf(poses))[0].tolist()
        raise ValueError(
            f"recording {name!r}: {POSE[column]} = {poses[row, column]} in row {row}: must be finite or NaN"
        )
    seen = np.isfinite(poses).all(axis=1)
    if seen.sum() < _FEWEST:
        raise ValueError(f"recording {name!r}: {seen.sum()} frames with a pose: must be at least {_FEWEST}")
    times, poses = times[seen], poses[seen]
    found = noise if noise is not None else _noise(name, times, poses)
    return Recording(name, times, poses, Noise(max(found.position, _FLOOR * size), max(found.angle, _FLOOR)))


def _noise(name: str, times: Floats, poses: Floats) -> Noise:
    """Estimate the noise from third differences of equally spaced poses, whose variance is 20 times that of a pose."""
    steps = np.diff(times)
    even = np.abs(steps - np.median(steps)) < 0.01 * np.median(steps)
    even = even[:-2] & even[1:-1] & even[2:]
    if even.sum() < _FEWEST:
        raise ValueError(f"recording {name!r}: frames are too unevenly spaced to tell the noise: noise must be given")
    turned = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
    sizes = np.abs(np.diff(turned, n=3, axis=0)[even])
    position, angle = (float(np.median(part)) / (0.6745 * math.sqrt(20.0)) for part in (sizes[:, :2], sizes[:, 2]))
    return Noise(position, angle)


def _parameters(
    body: Body, solver: BatchSolver, recordings: Sequence[Recording], bounds: Mapping[str, tuple[float, float]]
) -> list[Parameter]:
    """Return all parameters: those of the law, then the launches."""
    frame = min(float(np.median(np.diff(one.times))) for one in recordings)
    arm = body.radius if body.radius > 0.0 else reach(body)
    default = {
        "stiffness": tuple(
            body.mass * (math.pi / time) ** 2 for time in (_LONGEST, min(_SHORTEST * frame, 0.1 * _LONGEST))
        ),
        "restitution": (0.0, 1.0),
        "friction": (0.0, 1.5),
        "rolling_arm": (0.0, arm),
        "corner_rolling_arm": (0.0, arm),
    }
    widest = default | {"stiffness": (1e-6, 1e15), "friction": (0.0, 100.0)}
    for name, pair in bounds.items():
        if name not in default or (name == "stiffness" and solver == "rigid"):
            raise ValueError(f"bounds: {name!r} is not fitted: must be one of {', '.join(default)}")
        low, high = pair
        least, most = widest[name]
        if not least <= low < high <= most:
            raise ValueError(f"bounds: {name} = ({low!r}, {high!r}): must be in order and in [{least:g}, {most:g}]")
    low, high = np.log10((default | dict(bounds))["stiffness"]).tolist()
    found = [Parameter(_STIFFNESS, "", low, high, 0.3)]
    for name, scale in zip(LAW, (0.05, 0.05, 0.02 * arm, 0.02 * arm), strict=True):
        unit = "m" if name.endswith("arm") else ""
        low, high = (default | dict(bounds))[name]
        found.append(Parameter(name, unit, low, high, scale))
    for recording in recordings:
        found.extend(_launch_parameters(body, recording, len(recordings) > 1))
    return found


def _launch_parameters(body: Body, recording: Recording, several: bool) -> list[Parameter]:
    """Bounds of a launch: no farther away, nor faster, than the poses are apart."""
    size, frame = reach(body), float(np.diff(recording.times).min())
    middle, wide = (
        np.median(recording.poses, axis=0),
        np.ptp(recording.poses, axis=0) + np.array([size, size, 2.0 * math.pi]),
    )
    fastest = np.array([size, size, math.pi]) / frame + wide / np.ptp(recording.times)
    second = math.sqrt(size / 9.81)  # a typical time of a fall
    low, high = np.append(middle - wide, -fastest), np.append(middle + wide, fastest)
    scales = 0.03 * np.array([size, size, 1.0, size / second, size / second, 1.0 / second])
    suffix = f"[{recording.name}]" if several else ""
    rows = zip(_UNITS.items(), low.tolist(), high.tolist(), scales.tolist(), strict=True)
    return [Parameter(name + suffix, unit, least, most, scale) for (name, unit), least, most, scale in rows]


def _known(
    fixed: Mapping[str, float], bounds: Mapping[str, tuple[float, float]], solver: BatchSolver
) -> dict[str, float]:
    """Values of the parameters that are not fitted, by the names of the fit."""
    for name in fixed:
        if name not in (*LAW, "stiffness"):
            raise ValueError(f"fixed: {name!r} is no parameter: must be one of {', '.join((*LAW, 'stiffness'))}")
        if name in bounds:
            raise ValueError(f"bounds: {name!r} is fixed")
    found = {name: float(value) for name, value in fixed.items() if name != "stiffness"}
    if "corner_rolling_arm" not in bounds:
        found.setdefault("corner_rolling_arm", 0.0)
    if "stiffness" in fixed:
        found[_STIFFNESS] = math.log10(checked("fixed", "stiffness", fixed["stiffness"], POSITIVE))
    return found


class _Model:
    """What is fitted to recordings: the descents simulated from a law and launches, at the times of the frames."""

    def __init__(
        self,
        body: Body,
        slope: Slope,
        solver: BatchSolver,
        recordings: Sequence[Recording],
        parameters: Sequence[Parameter],
        loss: Loss,
    ) -> None:
        self.body, self.slope, self.solver = body, slope, solver
        self.recordings, self.parameters, self.loss = recordings, parameters, loss
        # A difference in the launch of one recording changes none of the others.
        self._rows = lru_cache(maxsize=4 * len(recordings))(self._simulated_rows)

    def problem(self, frames: Sequence[int], fixed: Mapping[str, float]) -> Problem:
        """Problem of fitting the first frames of each recording."""
        clusters = np.repeat(np.arange(len(frames)), frames)
        return Problem(
            self.parameters, partial(self.residuals, tuple(frames)), fixed, clusters, loss=self.loss, loss_scale=_TAME
        )

    def residuals(self, frames: Sequence[int], values: Floats) -> Floats:
        """Residuals of the first frames of each recording, shape (sum of frames, 3), in noise levels."""
        law, launches = values[: len(LAW) + 1].tobytes(), values[len(LAW) + 1 :].reshape(-1, 6)
        return np.concatenate([self._rows(i, count, law, launches[i].tobytes()) for i, count in enumerate(frames)])

    def _simulated_rows(self, i: int, frames: int, law: bytes, launch: bytes) -> Floats:
        recording = self.recordings[i]
        times = recording.times[:frames] - recording.times[0]
        descent = self.descent(np.frombuffer(law), State(*np.frombuffer(launch).tolist()), float(times[-1]))
        return recording.residuals(states_at(drawable_rows(descent), times)[:, :3])

    def descent(self, law: Floats, launch: State, time: float, interval: float | None = None) -> Descent:
        """Simulate a descent for ``time`` [s], with rows every ``interval`` in flight or, by default, at its ends.

        ``law`` holds the parameters before the launches.
        """
        return simulate(
            self.body,
            law_of(10.0 ** float(law[0]), law[1:].tolist()),
            self.slope,
            lifted(self.body, launch),
            solver=self.solver,
            max_time=time,
            record="trajectory",
            sample_interval=interval or time,
        )


class _Search:
    """Fits of one law after another to more and more of each recording, as long as it is explained."""

    def __init__(self, model: _Model, fixed: Mapping[str, float], rng: np.random.Generator) -> None:
        self.model, self.fixed, self.rng = model, fixed, rng
        body, slope, recordings = model.body, model.slope, model.recordings
        self.flights = [list(flights_of(body, slope, one)) for one in recordings]
        self.horizons = [_horizons(track, one) for track, one in zip(self.flights, recordings, strict=True)]
        self.level = [0] * len(recordings)
        self.open = [i for i, horizon in enumerate(self.horizons) if len(horizon) > 1]
        self.starts: list[dict[str, float]] = []

    def run(self) -> list[Fit]:
        """Return fits to all that is explained, the best first."""
        found: list[Fit] = []
        history: list[Fit] = []
        candidates = self.starts = self._first()
        while self.open:
            level = [count + (i in self.open) for i, count in enumerate(self.level)]
            rebounds = any(level[i] < len(self.flights[i]) for i in self.open)
            drawn = self._drawn(history[-1:], level) if rebounds else []
            fits = self._fitted([*candidates, *drawn], level)
            if self._unexplained(fits[0], level):
                more = self._drawn(history[-_BACK:], level) if history else candidates
                fits = _distinct([*fits, *self._fitted(more, level, len(more))])
            failed = self._unexplained(fits[0], level)
            if failed:
                self.open = [i for i in self.open if i not in failed]
                continue
            found, candidates, self.level = fits, [fit.values for fit in fits], level
            history.append(fits[0])
            self.open = [i for i in self.open if level[i] + 1 < len(self.horizons[i])]
        return found

    def frames(self, level: Sequence[int]) -> list[int]:
        """How many frames of each recording are used."""
        return [horizon[k] for horizon, k in zip(self.horizons, level, strict=True)]

    def _first(self) -> list[dict[str, float]]:
        """Laws to begin with, and the launches."""
        model = self.model
        launches = [
            track[0].launch if track else first_guess(model.slope, one)
            for track, one in zip(self.flights, model.recordings, strict=True)
        ]
        names = [one.name for one in model.parameters]
        stiff, *law = model.parameters[: len(LAW) + 1]
        held = {name: value for name, value in self.fixed.items() if name in LAW}
        if any(len(track) > 1 for track in self.flights):
            first = [track[:2] for track in self.flights]  # later ones may not be flights
            laws = [
                one
                for tracks in (first, self.flights)
                for one in likely_laws(model.body, model.slope, tracks, law, held)
            ]
        else:
            laws = [
                dict(zip(LAW, values, strict=True)) for values in grid_of(law, held, few=True).reshape(-1, len(LAW))
            ]
        levels = np.linspace(stiff.low, stiff.high, _STIFFNESSES)
        if _STIFFNESS in self.fixed:
            levels = np.array([self.fixed[_STIFFNESS]])
        begun = np.concatenate([np.array(launch) for launch in launches])
        low, high = np.array([one[2:4] for one in model.parameters]).T
        return [
            dict(zip(names, np.clip([level, *(one[name] for name in LAW), *begun], low, high).tolist(), strict=True))
            for level in levels
            for one in laws
        ]

    def _fitted(self, candidates: Sequence[Mapping[str, float]], level: Sequence[int], most: int = _KEPT) -> list[Fit]:
        """Fit from those candidates whose cost is lowest."""
        problem = self.model.problem(self.frames(level), self.fixed)
        costs = [problem.cost(problem.values(one)) for one in candidates]
        order = np.argsort(costs, kind="stable")[:most]
        return _distinct([solve(problem, candidates[k], starts=1, limit=_LIMIT) for k in order.tolist()])

    def _unexplained(self, fit: Fit, level: Sequence[int]) -> list[int]:
        """Recordings whose new frames, or all of them, differ from a fit by more than noise."""
        rows = np.split(fit.problem.rows(fit.vector), np.cumsum(self.frames(level))[:-1])
        begun = [horizon[k] for horizon, k in zip(self.horizons, self.level, strict=True)]
        return [i for i in self.open if not (explained(rows[i]) and explained(rows[i][begun[i] :]))]

    def _drawn(self, fits: Sequence[Fit], level: Sequence[int]) -> list[Mapping[str, float]]:
        """Laws and launches like those of fits to fewer frames, and laws of the start: the best of each.

        Several laws may explain the first rebounds equally well, so that the next one tells which of them are right.
        """
        found = []
        for fit in fits:
            guessed = [fit.values | {name: one[name] for name in LAW} for one in self.starts]
            for group in (guessed, _like(fit, self.rng)):
                found += self._cheapest(group, level)
        return found

    def _cheapest(self, group: Sequence[Mapping[str, float]], level: Sequence[int]) -> list[Mapping[str, float]]:
        problem = self.model.problem(self.frames(level), self.fixed)
        costs = [problem.cost(problem.values(one)) for one in group]
        return [group[k] for k in np.argsort(costs, kind="stable")[:_TRIED].tolist()]


def _like(fit: Fit, rng: np.random.Generator) -> list[dict[str, float]]:
    """Values drawn from the covariance of a fit, made wider; those that it does not tell, from their bounds.

    Those of the fit as well, but for a friction or an arm anywhere in its bounds: the cost may be flat there.
    """
    names = fit.problem.free
    covariance = fit.covariance.to_numpy()
    told = np.isfinite(np.diag(covariance))
    low, high = np.array([fit.problem.parameter(name)[2:4] for name in names]).T
    values = np.tile([fit.values[name] for name in names], (_DRAWS, 1))
    left, sizes, _ = np.linalg.svd(covariance[np.ix_(told, told)], hermitian=True)
    values[:, told] += rng.standard_normal((_DRAWS, told.sum())) @ (left * np.sqrt(sizes)).T * _WIDER
    untold = ~told & np.array([name in (*LAW, _STIFFNESS) for name in names])
    anywhere = low + (high - low) * rng.uniform(size=values.shape) ** 3  # small ones make more of a difference
    values[:, untold] = anywhere[:, untold]
    drawn = [dict(zip(names, row, strict=True)) for row in np.clip(values, low, high).tolist()]
    for name in ("friction", "rolling_arm"):
        if name in names:
            one = fit.problem.parameter(name)
            drawn += [fit.values | {name: one.low + (one.high - one.low) * share} for share in _SCANNED.tolist()]
    return drawn


def _horizons(flights: Sequence[Flight], recording: Recording) -> list[int]:
    """Numbers of frames that are fitted one after the other: up to the end of each flight, then step by step."""
    count = len(recording.times)
    ends = [min(recording.until(flight.end), count) for flight in flights] or [min(_FEWEST, count)]
    step = max(_FEWEST, math.ceil(_TAIL / float(np.median(np.diff(recording.times)))))
    return sorted({*ends, *range(ends[-1] + step, count, step), count})


def _distinct(fits: Sequence[Fit]) -> list[Fit]:
    """Fits whose costs are near the least one, the best first, one for each law."""
    kept: list[Fit] = []
    for fit in sorted(fits, key=lambda fit: fit.cost):
        if kept and fit.cost > kept[0].cost + _APART:
            break
        if all(_differ(fit, other) for other in kept):
            kept.append(fit)
    return kept[:_KEPT]


def _differ(one: Fit, other: Fit) -> bool:
    """Whether two fits are minima of their own: one may be flat, as where rebounds do not tell the friction."""
    if abs(one.cost - other.cost) < _EQUAL:
        return False
    names = [name for name in one.problem.free if name in (*LAW, _STIFFNESS)]
    scales = [one.problem.parameter(name).scale for name in names]
    return any(
        abs(one.values[name] - other.values[name]) > _ALIKE * scale for name, scale in zip(names, scales, strict=True)
    )


@dataclass(frozen=True)
class TrackFit:
    """What was found in recorded poses, and how sure one may be of it.

    Attributes
    ----------
    body, slope, solver
        What the descents were simulated with.
    recordings : list of Recording
        With the noise that was given or estimated.
    frames : list of int
        How many frames of each are explained by the fit, and used.
    fit : Fit
        With the values, their covariance and all starts that lasted.
    intervals : dict
        Profile interval of each fitted parameter of the law, of level .95; that of the stiffness is one of
        ``log10_stiffness``.
    others : list of Fit
        Other laws that explain the recordings nearly as well, the best first.
    """

    body: Body
    slope: Slope
    solver: BatchSolver
    recordings: list[Recording]
    frames: list[int]
    fit: Fit
    intervals: dict[str, Interval]
    others: list[Fit]
    model: _Model

    @property
    def values(self) -> dict[str, float]:
        """Of all parameters: the stiffness [N/m], which rigid surfaces do not use, the law and the launches."""
        logarithm, *others = self.fit.vector.tolist()
        return {"stiffness": 10.0**logarithm, **dict(zip(self.fit.problem.names[1:], others, strict=True))}

    @property
    def law(self) -> ContactLaw:
        """The contact law; of rigid surfaces its stiffness means nothing."""
        values = self.fit.vector
        return law_of(10.0 ** float(values[0]), values[1 : len(LAW) + 1].tolist())

    @cached_property
    def launches(self) -> dict[str, State]:
        """State at the first frame of each recording."""
        rows = self.fit.vector[len(LAW) + 1 :].reshape(-1, 6).tolist()
        return {one.name: State(*row) for one, row in zip(self.recordings, rows, strict=True)}

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row a parameter of the law: ``value``, ``low`` and ``high`` of the interval, ``unit``, ``note``."""
        rows = []
        for name in [_STIFFNESS] * (self.solver != "rigid") + list(LAW):
            value, unit = self.fit.values[name], self.fit.problem.parameter(name).unit
            low = high = math.nan
            note = "not fitted"
            if name in self.intervals:
                low, high, _, low_on_bound, high_on_bound = self.intervals[name]
                ends = [f"{end} end is its bound" for end, on in (("low", low_on_bound), ("high", high_on_bound)) if on]
                note = ", ".join(ends)
            if name == _STIFFNESS:
                name, unit, (value, low, high) = "stiffness", "N/m", (10.0**value, 10.0**low, 10.0**high)
            rows.append((name, value, low, high, unit, note))
        names = ["parameter", "value", "low", "high", "unit", "note"]
        return pd.DataFrame(rows, columns=names).set_index("parameter")

    @cached_property
    def warnings(self) -> list[str]:
        """What casts doubt on the result, a sentence each."""
        found = []
        for name, row in self.used.iterrows():
            if not row["whole"]:
                found.append(
                    f"recording {name!r} is explained until {row['until_s']:.4g} s only, {row['rebounds']} rebounds: "
                    "what follows is not used, and the law may be a wrong one that explains no more than this"
                )
            if row["misfit"] > _MISFIT:
                found.append(f"recording {name!r}: residuals are {math.sqrt(row['misfit']):.1f} times the noise")
        if self.solver == "rigid" and not self.used["whole"].all():
            found.append(
                "surfaces were taken for rigid: contacts that last, for a few milliseconds even, look like this, and "
                "no interval knows of it; fit compliant surfaces, and see whether they explain more"
            )
        for name, interval in self.intervals.items():
            if interval.low_on_bound and interval.high_on_bound:
                found.append(f"the recordings say nothing of {name}: every value in its bounds is as good")
        for other in self.others:
            beyond = [n for n, ends in self.intervals.items() if not ends.low <= other.values[n] <= ends.high]
            if beyond and other.cost - self.fit.cost < _CLOSE:
                law = ", ".join(f"{name} {other.values[name]:.4g}" for name in LAW)
                found.append(f"another law explains the recordings nearly as well: {law}")
        return found

    def __str__(self) -> str:
        """Return the result for a reader: what was used, the law, what to doubt."""
        lines = [f"{len(self.recordings)} recordings, {self.solver} surfaces, flights and rebounds as simulated", ""]
        lines.append(self.used.round(4).to_string())
        lines += ["", f"{'':<20}{'value':>11}  {'95 % interval':^25} unit"]
        for name, row in self.table.iterrows():
            reach = "" if row["note"] == "not fitted" else f"[{row['low']:.5g}, {row['high']:.5g}]"
            lines.append(f"{name!s:<20}{row['value']:>11.5g}  {reach:^25} {row['unit']:<4} {row['note']}".rstrip())
        return "\n".join([*lines, *(f"warning: {text}" for text in self.warnings)])

    def descent(self, name: str | None = None, time: float | None = None) -> Descent:
        """Simulate a recording's descent, with its trajectory, for as long as it was recorded or for ``time`` [s]."""
        i = self._number(name)
        times = self.recordings[i].times
        length = float(times[-1] - times[0]) if time is None else time
        law, launch = self.fit.vector[: len(LAW) + 1], self.launches[self.recordings[i].name]
        return self.model.descent(law, launch, length, _DRAWN)

    def ghost(self, name: str | None = None) -> Ghost:
        """Return a recording for :func:`sledenv.replay.replay_page` of its :meth:`descent`."""
        i = self._number(name)
        one = self.recordings[i]
        rows = self.residuals[self.residuals[RECORDING] == one.name]
        return Ghost(one.times - one.times[0], one.poses, rows[list(POSE)].to_numpy(), self.frames[i])

    @cached_property
    def residuals(self) -> pd.DataFrame:
        """One row a frame of each recording, the unused ones included: recorded less simulated pose."""
        parts = []
        for one, used in zip(self.recordings, self.frames, strict=True):
            times = one.times - one.times[0]
            rows = one.residuals(states_at(drawable_rows(self.descent(one.name)), times)[:, :3])
            apart = rows * np.array([one.noise.position, one.noise.position, one.noise.angle])
            part = pd.DataFrame({RECORDING: one.name, TIME: one.times, **dict(zip(POSE, apart.T, strict=True))})
            parts.append(part.assign(noise_levels=np.linalg.norm(rows, axis=1), used=np.arange(len(times)) < used))
        return pd.concat(parts, ignore_index=True)

    @cached_property
    def used(self) -> pd.DataFrame:
        """One row a recording: its frames, how many are used and until when, rebounds by then, noise, and misfit.

        ``misfit`` is the mean square of a number of the used poses, in noise levels, but for wrong ones: 1 by chance.
        """
        rows = []
        for one, used in zip(self.recordings, self.frames, strict=True):
            until = float(one.times[used - 1])
            log = self.descent(one.name, until - float(one.times[0])).rebounds
            whole = self.residuals.loc[self.residuals[RECORDING] == one.name, "noise_levels"].to_numpy()[:used]
            misfit = float(np.median(whole**2)) / 2.366  # the median of chi-squared of 3 degrees of freedom
            rows.append((one.name, len(one.times), used, until, len(log), used == len(one.times), *one.noise, misfit))
        names = ["frames", "used", "until_s", "rebounds", "whole", "noise_position_m", "noise_angle_rad", "misfit"]
        return pd.DataFrame(rows, columns=[RECORDING, *names]).set_index(RECORDING)

    def _number(self, name: str | None) -> int:
        names = [one.name for one in self.recordings]
        if name is None and len(names) == 1:
            return 0
        if name not in names:
            raise ValueError(f"recording = {name!r}: must be one of {', '.join(map(repr, names))}")
        return names.index(name)
