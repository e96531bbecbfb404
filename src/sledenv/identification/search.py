"""The search for laws and launches whose descents follow recorded poses: what is fitted, and which minima there are."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from sledenv.identification.fitting import (
    AGAIN,
    ROUNDING,
    Fit,
    Floats,
    Interval,
    LocalMinimumError,
    Loss,
    Parameter,
    Problem,
    profiled,
    solve,
)
from sledenv.identification.flights import (
    Flight,
    explained,
    first_guess,
    flights_of,
    law_of,
    lifted,
    likely_laws,
)
from sledenv.identification.law import LAW
from sledenv.identification.recordings import FEWEST, Recording
from sledenv.simulation.bodies import Body, Segment
from sledenv.simulation.interpolation import drawable_rows, states_at
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.rules import FINITE, POSITIVE, checked
from sledenv.simulation.scene import Slope, State
from sledenv.simulation.settings import Solver
from sledenv.simulation.simulate import simulate

STIFFNESS = "log10_stiffness"
CLOSE = 1.92  # by which the cost of a law may exceed the least one so that it is in an interval of level 0.95
_TOLD = (STIFFNESS, *LAW)  # parameters before the launches
_UNITS = dict(zip(State._fields, ("m", "m", "rad", "m/s", "m/s", "rad/s"), strict=True))
_WIDEST = {"stiffness": (1e-6, 1e15), "friction": (0.0, 100.0)}  # of bounds that are given
_TAIL = 0.08  # [s] by which a horizon grows where flights are too short to be told apart
_APART = 15.0  # by which the cost of a law may exceed the least one: half of what chi-squared may
_KEPT = 8  # laws that are followed at a time
_EVEN, _SMALL = (0.1, 0.5, 0.9), (0.01, 0.15, 0.6)  # of bounds: restitution; friction and arms, where none is told
_DRAWS = 32  # laws and launches that are drawn for each rebound
_BACK = 4  # rebounds from which more are drawn where none of those explains what follows
_SCANNED = np.linspace(0.0, 1.0, 24) ** 3  # of bounds of friction and arm, where they are tried
_TRIED = 3  # of them, fitted
_WIDER = 3.0  # than their covariance
_BESIDE = (1.05, 1.15, 1.3, 1.6, 2.2, 4.0)  # factors of a friction, where another minimum is looked for
_EQUAL = 1e-3  # difference of two costs that counts as none
_ALIKE = 0.05  # of their scales: laws that differ by less are one
_TAME = 3.0  # noise levels from which a pose counts as wrong
_LIMIT = 15  # steps of one minimisation on the way
_LONGEST, _SHORTEST = 0.1, 0.02  # contacts of stiffnesses that are tried: [s], and in intervals of frames
_STIFFNESSES = 7  # that are tried at the start
_LEAST = 1e-3  # restitution of compliant surfaces: springs that give nothing back never let go


def parameters_of(
    body: Body, solver: Solver, recordings: Sequence[Recording], bounds: Mapping[str, tuple[float, float]]
) -> list[Parameter]:
    """Return all parameters: those of the law, then the launches."""
    frame = min(float(np.median(np.diff(one.times))) for one in recordings)
    arm = body.radius if isinstance(body, Segment) and body.radius > 0.0 else body.size
    longest, shortest = (body.mass * (math.pi / time) ** 2 for time in (_LONGEST, min(_SHORTEST * frame, 0.01)))
    usual = {
        "stiffness": (longest, shortest),
        "restitution": (0.0 if solver == "rigid" else _LEAST, 1.0),
        "friction": (0.0, 1.5),
        "rolling_arm": (0.0, arm),
        "corner_rolling_arm": (0.0, arm),
    }
    for name, (low, high) in bounds.items():
        if name not in usual or (name == "stiffness" and solver == "rigid"):
            raise ValueError(f"bounds: {name!r} is not fitted: must be one of {', '.join(usual)}")
        least, most = (usual | _WIDEST)[name]
        if not least <= low < high <= most:
            raise ValueError(f"bounds: {name} = ({low!r}, {high!r}): must be in order and in [{least:g}, {most:g}]")
    ends = usual | dict(bounds)
    scales = {"restitution": 0.05, "friction": 0.05, "rolling_arm": 0.02 * arm, "corner_rolling_arm": 0.02 * arm}
    low, high = np.log10(ends["stiffness"]).tolist()
    found = [Parameter(STIFFNESS, "", low, high, 0.3)]
    found += [Parameter(name, "m" if name.endswith("arm") else "", *ends[name], scales[name]) for name in LAW]
    for recording in recordings:
        found += _launch_parameters(body, recording, f"[{recording.name}]" if len(recordings) > 1 else "")
    return found


def _launch_parameters(body: Body, recording: Recording, suffix: str) -> list[Parameter]:
    """Bounds of a launch: no farther away, nor faster, than the poses are apart."""
    size, frame = body.size, float(np.diff(recording.times).min())
    middle = np.median(recording.poses, axis=0)
    wide = np.ptp(recording.poses, axis=0) + np.array([size, size, 2.0 * math.pi])
    fastest = np.array([size, size, math.pi]) / frame + wide / np.ptp(recording.times)
    second = math.sqrt(size / 9.81)  # a typical time of a fall
    low, high = np.append(middle - wide, -fastest), np.append(middle + wide, fastest)
    scales = 0.03 * np.array([size, size, 1.0, size / second, size / second, 1.0 / second])
    rows = zip(_UNITS.items(), low.tolist(), high.tolist(), scales.tolist(), strict=True)
    return [Parameter(name + suffix, unit, least, most, scale) for (name, unit), least, most, scale in rows]


def known_of(fixed: Mapping[str, float], bounds: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Return the values of the parameters that are not fitted, by the names of the fit."""
    found = {} if "corner_rolling_arm" in bounds else {"corner_rolling_arm": 0.0}
    for name, value in fixed.items():
        if name not in (*LAW, "stiffness"):
            raise ValueError(f"fixed: {name!r} is no parameter: must be one of {', '.join((*LAW, 'stiffness'))}")
        if name in bounds:
            raise ValueError(f"bounds: {name!r} is fixed")
        if name == "stiffness":
            found[STIFFNESS] = math.log10(checked("fixed", name, value, POSITIVE))
        else:
            found[name] = checked("fixed", name, value, FINITE)
    return found


class Model:
    """Descents simulated from a law and launches, at the times of the frames of recordings."""

    def __init__(
        self,
        body: Body,
        slope: Slope,
        solver: Solver,
        recordings: Sequence[Recording],
        parameters: Sequence[Parameter],
        loss: Loss,
    ) -> None:
        self.body, self.slope, self.solver = body, slope, solver
        self.recordings, self.parameters, self.loss = recordings, parameters, loss
        # A difference in the launch of one recording changes none of the others.
        self._rows = lru_cache(maxsize=4 * len(recordings))(self._simulated_rows)

    def problem(self, frames: Sequence[int], fixed: Mapping[str, float], loss: Loss | None = None) -> Problem:
        """Return the problem of fitting the first frames of each recording, with the loss of the model by default."""
        clusters = np.repeat(np.arange(len(frames)), frames)
        residuals = partial(self._residuals, frames)
        return Problem(self.parameters, residuals, fixed, clusters, loss=loss or self.loss, loss_scale=_TAME)

    def _residuals(self, frames: Sequence[int], values: Floats) -> Floats:
        """Residuals of the first frames of each recording, shape (sum of frames, 3), in noise levels."""
        law, launches = values[: len(_TOLD)].tobytes(), values[len(_TOLD) :].reshape(-1, 6)
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


class Search:
    """Fits of one law after another to more and more of each recording, as long as it is explained."""

    def __init__(self, model: Model, fixed: Mapping[str, float], rng: np.random.Generator) -> None:
        self.model, self.fixed, self.rng = model, fixed, rng
        self.flights = [list(flights_of(model.body, model.slope, one)) for one in model.recordings]
        self.horizons = [_horizons(track, one) for track, one in zip(self.flights, model.recordings, strict=True)]
        self.level = [0] * len(self.flights)
        self.open = [i for i, horizon in enumerate(self.horizons) if len(horizon) > 1]
        self.starts = self._first()

    def run(self) -> list[Fit]:
        """Return fits to all that is explained, the best first."""
        found: list[Fit] = []
        best: list[Fit] = []  # of each level
        candidates: Sequence[Mapping[str, float]] = self.starts
        while self.open:
            level = [count + (i in self.open) for i, count in enumerate(self.level)]
            rebounds = any(level[i] < len(self.flights[i]) for i in self.open)
            fits = self._fitted([*candidates, *self._drawn(best[-1:] if rebounds else [], level)], level)
            if self._unexplained(fits[0], level):
                more = self._drawn(best[-_BACK:], level) if best else self._nearer(candidates, level)
                fits = distinct([*fits, *self._fitted(more, level, len(more))])
            failed = self._unexplained(fits[0], level)
            if failed:
                self.open = [i for i in self.open if i not in failed]
                continue
            found, candidates, self.level = fits, [fit.values for fit in fits], level
            best.append(fits[0])
            self.open = [i for i in self.open if level[i] + 1 < len(self.horizons[i])]
        return found

    def frames(self, level: Sequence[int]) -> tuple[int, ...]:
        """Return how many frames of each recording are used."""
        return tuple(horizon[k] for horizon, k in zip(self.horizons, level, strict=True))

    def _problem(self, level: Sequence[int], loss: Loss | None = None) -> Problem:
        return self.model.problem(self.frames(level), self.fixed, loss)

    def _first(self) -> list[dict[str, float]]:
        """Laws to begin with, and the launches."""
        model = self.model
        stiff, *law = model.parameters[: len(_TOLD)]
        held = {name: value for name, value in self.fixed.items() if name in LAW}
        if any(len(track) > 1 for track in self.flights):
            first = [track[:2] for track in self.flights]  # later ones may not be flights
            laws = [one for tracks in (first, self.flights) for one in likely_laws(model.body, tracks, law, held)]
        else:
            tried = [
                [held[one.name]] if one.name in held else [one.low + (one.high - one.low) * share for share in shares]
                for one, shares in zip(law, (_EVEN, _SMALL, _SMALL, _SMALL), strict=True)
            ]
            laws = [dict(zip(LAW, values, strict=True)) for values in itertools.product(*tried)]
        levels = np.linspace(stiff.low, stiff.high, _STIFFNESSES).tolist()
        if STIFFNESS in self.fixed:
            levels = [self.fixed[STIFFNESS]]
        launches: list[float] = []
        for track, one in zip(self.flights, model.recordings, strict=True):
            launches += track[0].launch if track else first_guess(model.slope, one)
        names = [one.name for one in model.parameters]
        low, high = np.array([one[2:4] for one in model.parameters]).T
        rows = [
            np.clip([level, *(one[name] for name in LAW), *launches], low, high) for level in levels for one in laws
        ]
        return [dict(zip(names, row.tolist(), strict=True)) for row in rows]

    def _fitted(self, candidates: Sequence[Mapping[str, float]], level: Sequence[int], most: int = _KEPT) -> list[Fit]:
        """Fit from those candidates whose cost is lowest."""
        problem = self._problem(level)
        return distinct([solve(problem, one, starts=1, limit=_LIMIT) for one in _cheapest(problem, candidates, most)])

    def _nearer(self, candidates: Sequence[Mapping[str, float]], level: Sequence[int]) -> list[Mapping[str, float]]:
        """Candidates, and what fits from them find that take no pose for wrong: of exact ones all look so at first."""
        problem = self._problem(level, "linear")
        return [*candidates, *(solve(problem, one, starts=1, limit=_LIMIT).values for one in candidates)]

    def _unexplained(self, fit: Fit, level: Sequence[int]) -> list[int]:
        """Recordings whose new frames, or all of them, differ from a fit by more than noise."""
        rows = np.split(fit.problem.rows(fit.vector), np.cumsum(self.frames(level))[:-1])
        begun = self.frames(self.level)
        return [i for i in self.open if not (explained(rows[i]) and explained(rows[i][begun[i] :]))]

    def _drawn(self, fits: Sequence[Fit], level: Sequence[int]) -> list[Mapping[str, float]]:
        """Laws and launches like those of fits to fewer frames, and laws of the start: the best of each.

        Several laws may explain the first rebounds equally well, so that the next one tells which of them are right.
        """
        problem = self._problem(level)
        found = []
        for fit in fits:
            guessed = [fit.values | {name: one[name] for name in LAW} for one in self.starts]
            for group in (guessed, _like(fit, self.rng)):
                found += _cheapest(problem, group, _TRIED)
        return found


def _cheapest(problem: Problem, group: Sequence[Mapping[str, float]], most: int) -> list[Mapping[str, float]]:
    return sorted(group, key=lambda values: problem.cost(problem.values(values)))[:most]


def _like(fit: Fit, rng: np.random.Generator) -> list[dict[str, float]]:
    """Values drawn from the covariance of a fit, made wider; those that it does not tell, from their bounds.

    Those of the fit as well, but for a friction or an arm anywhere in its bounds: the cost may be flat there.
    """
    names = fit.problem.free
    low, high = np.array([fit.problem.parameter(name)[2:4] for name in names]).T
    values = np.tile([fit.values[name] for name in names], (_DRAWS, 1))
    covariance = fit.covariance.to_numpy()
    told = np.isfinite(np.diag(covariance))
    left, sizes, _ = np.linalg.svd(covariance[np.ix_(told, told)], hermitian=True)
    values[:, told] += rng.standard_normal((_DRAWS, told.sum())) @ (left * np.sqrt(sizes)).T * _WIDER
    untold = ~told & np.isin(names, _TOLD)
    anywhere = low + (high - low) * rng.uniform(size=values.shape) ** 3  # small ones make more of a difference
    values[:, untold] = anywhere[:, untold]
    drawn = [fit.values | dict(zip(names, row, strict=True)) for row in np.clip(values, low, high).tolist()]
    for name in (name for name in ("friction", "rolling_arm") if name in names):
        one = fit.problem.parameter(name)
        drawn += [fit.values | {name: one.low + (one.high - one.low) * share} for share in _SCANNED.tolist()]
    return drawn


def _horizons(flights: Sequence[Flight], recording: Recording) -> list[int]:
    """Numbers of frames that are fitted one after the other: up to the end of each flight, then step by step."""
    count = len(recording.times)
    ends = [min(recording.until(flight.end), count) for flight in flights] or [min(FEWEST, count)]
    step = max(FEWEST, math.ceil(_TAIL / float(np.median(np.diff(recording.times)))))
    return sorted({*ends, *range(ends[-1] + step, count, step), count})


def distinct(fits: Sequence[Fit]) -> list[Fit]:
    """Return fits whose costs are near the least one, the best first, one for each law."""
    kept: list[Fit] = []
    for fit in sorted(fits, key=lambda fit: fit.cost):
        if fit.cost <= (kept or [fit])[0].cost + _APART and all(_differ(fit, other) for other in kept):
            kept.append(fit)
    return kept[:_KEPT]


def _differ(one: Fit, other: Fit) -> bool:
    """Whether two fits are minima of their own: one may be flat, as where rebounds do not tell the friction."""
    law = [parameter for parameter in one.problem.parameters if parameter.name in _TOLD]
    return abs(one.cost - other.cost) >= _EQUAL and any(
        abs(one.values[name] - other.values[name]) > _ALIKE * scale for name, *_, scale in law
    )


def settled(fits: Sequence[Fit], again: int = AGAIN) -> tuple[Fit, dict[str, Interval]]:
    """Return the best fit, and intervals of the law that hold those of all minima that are as good.

    A minimum with a lower cost, here or beside an interval, is where the fit goes on, so many times at most.
    """
    names = [name for name in fits[0].problem.free if name in _TOLD]
    fit, intervals = profiled(solve(fits[0].problem, fits[0].values, starts=1), names)
    allowed = 2.0 * CLOSE * fit.cost / (fit.problem.rows(fit.vector).size - len(fit.problem.free))
    for values in (*(other.values for other in fits[1:]), *_beside(fit, intervals)):
        other = solve(fit.problem, values, starts=1)
        inside = all(ends.low <= other.values[name] <= ends.high for name, ends in intervals.items())
        if not inside and fit.cost - _EQUAL < other.cost < fit.cost + allowed:
            there = replace(other, cost=fit.cost)  # against which costs around this minimum are compared
            try:
                intervals = {name: _hull(ends, there.interval(name)) for name, ends in intervals.items()}
            except LocalMinimumError as lower:
                other = solve(fit.problem, lower.values, starts=1)
        if again and other.cost < fit.cost - max(_EQUAL, ROUNDING * fit.cost):
            return settled([other, fit], again - 1)
    return fit, intervals


def _beside(fit: Fit, intervals: Mapping[str, Interval]) -> Iterator[dict[str, float]]:
    """Values that may belong to another minimum, with a friction outside of its interval.

    Beyond a friction at which a rebound stops to slip, the cost may rise at first and fall again.
    """
    if "friction" in intervals:
        low, high, *_ = intervals["friction"]
        friction = fit.problem.parameter("friction")
        for value in (end for factor in _BESIDE for end in (low / factor, high * factor)):
            if friction.low <= value <= friction.high:
                cost, values = fit.held(friction=value)
                if cost < fit.cost + _APART:
                    yield values


def _hull(one: Interval, other: Interval) -> Interval:
    """Return the smallest interval that holds both."""
    low, high = min(one, other, key=lambda ends: ends.low), max(one, other, key=lambda ends: ends.high)
    return Interval(low.low, high.high, low.low_on_bound, high.high_on_bound)
