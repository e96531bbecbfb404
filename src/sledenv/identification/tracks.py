"""From recorded poses over time to the contact law and the launches that explain them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import get_args

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view

from sledenv.identification.fitting import Fit, Interval
from sledenv.identification.flights import FEWEST, LAW, Noise, Recording, check_frame, law_of
from sledenv.identification.objective import Floats, Loss
from sledenv.identification.search import CLOSE, STIFFNESS, Model, Search, distinct, known_of, parameters_of, settled
from sledenv.identification.tables import RECORDING, numbered, numbers, place, recorded_names
from sledenv.pages.columns import TRAJECTORY_COLUMNS
from sledenv.pages.replay import Ghost
from sledenv.simulation.bodies import Body, made_body
from sledenv.simulation.interpolation import drawable_rows, states_at
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.rules import (
    POSITIVE,
    checked,
    checked_bounds,
    checked_choice,
    checked_mapping,
    checked_pair,
    checked_seed,
    made,
)
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Solver

TIME = TRAJECTORY_COLUMNS["t"]
POSE = tuple(TRAJECTORY_COLUMNS[name] for name in ("x", "y", "phi"))

_MISFIT = 1.5  # mean square of residuals, in noise levels, from which it is said
_DRAWN = 0.01  # [s] between two rows in flight of a descent that is shown, simulate's default
_NORMAL = 0.6745  # median of the size of a normal error, in standard deviations
_FLOOR = 1e-6  # least noise, of the size of the body and [rad]: about the precision of a single float


def identify_tracks(
    table: pd.DataFrame,
    body: Body,
    slope: Slope,
    *,
    solver: Solver = "rigid",
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
        Lower and upper bound of fitted ones; restitution in [0, 1], from .001 on compliant surfaces, friction in
        [0, 1.5], arms from 0 to the radius of a segment or to the size of any other body, and stiffness, of contacts
        that last from .02 intervals of frames to .1 s, by default.
    noise : tuple of float, optional
        Standard deviations of a position [m] and of an orientation [rad]. Estimated from the third differences of
        poses by default, by their median so that rebounds and wrong poses hardly count.
    loss : {"soft_l1", "linear"}
        As for :class:`~sledenv.identification.objective.Problem`; ``"soft_l1"`` bears wrong poses.
    seed : int
        Of the laws and launches that are drawn where none of those that were followed explains what comes next.

    Returns
    -------
    TrackFit

    Raises
    ------
    TypeError, ValueError
        Naming recording, column, value and what is allowed; if another sign or unit would explain the poses; if no
        body touches the slope; or if no rebound can be explained.
    """
    checked_choice("solver", solver, get_args(Solver))
    checked_choice("loss", loss, get_args(Loss))
    body, slope = made_body(body), made("slope", Slope, slope)._replace(length=math.inf)
    if body.drag_area > 0.0:
        wanted = "must be 0, fits know no air: body.replace(drag_area=0.0)"
        raise ValueError(f"body.drag_area = {body.drag_area!r}: {wanted}")
    known = None
    if noise is not None:
        names = zip(Noise._fields, checked_pair("noise", noise), strict=True)
        known = Noise(*(checked("noise", name, value, POSITIVE) for name, value in names))
    limits = checked_bounds(bounds)
    held = known_of(checked_mapping("fixed", fixed), limits)
    recordings = recordings_of(table, body.size, known)
    check_frame(body, slope, recordings)
    model = Model(body, slope, solver, recordings, parameters_of(body, solver, recordings, limits), loss)
    if solver == "rigid":
        held[STIFFNESS] = model.parameters[0].high  # which rigid surfaces do not use
    search = Search(model, held, np.random.default_rng(checked_seed(seed)))
    fits = search.run()
    if not fits:
        raise ValueError(_nothing_told(search))
    best, intervals = settled(fits)
    others = [fit for fit in distinct([best, *fits]) if fit is not best]
    if STIFFNESS in intervals:
        found = intervals.pop(STIFFNESS)
        intervals["stiffness"] = found._replace(low=10.0**found.low, high=10.0**found.high)
    return TrackFit(body, slope, solver, recordings, search.frames(search.level), best, intervals, others, model)


def _nothing_told(search: Search) -> str:
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
        f"({noise}): are the body, the slope, the units, the frame and the zero of phi_rad right, and is the noise? "
        "A contact that lasts for some frames needs compliant surfaces, poses without noise a body and a slope that "
        "are told as exactly, or a noise that makes up for it"
    )


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
        raise ValueError(f"{missing[0]}: there is no such column; poses over time need {', '.join((TIME, *POSE))}")
    table = numbered(table)
    names = recorded_names(table)
    if names is None:
        return [_recording("0", table, size, noise)]
    return [_recording(str(name), rows, size, noise) for name, rows in table.groupby(names, sort=False)]


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
        raise ValueError(f"recording {name!r}: {TIME} = {times[row]} in {place(table, row)}: must be a finite number")
    if np.isinf(poses).any():
        row, column = np.argwhere(np.isinf(poses))[0].tolist()
        raise ValueError(
            f"recording {name!r}: {POSE[column]} = {poses[row, column]} in {place(table, row)}: must be finite or NaN"
        )
    # A simulated trajectory has the same pose twice, but for rounding, where forces jump.
    alike = np.abs(np.diff(poses, axis=0)) <= np.array([_FLOOR * size, _FLOOR * size, _FLOOR])
    again = np.zeros(len(times), bool)
    again[1:] = (np.diff(times) == 0.0) & alike.all(axis=1)
    times, poses, table = times[~again], poses[~again], table[~again]
    if (np.diff(times) <= 0.0).any():
        row = int(np.argmax(np.diff(times) <= 0.0)) + 1
        raise ValueError(
            f"recording {name!r}: {TIME} = {times[row]} in {place(table, row)}: must increase from {times[row - 1]}"
        )
    seen = np.isfinite(poses).all(axis=1)
    if seen.sum() < FEWEST:
        raise ValueError(f"recording {name!r}: {seen.sum()} frames with a pose: must be at least {FEWEST}")
    times, poses = times[seen], poses[seen]
    found = noise if noise is not None else _noise(times, poses)
    return Recording(name, times, poses, Noise(max(found.position, _FLOOR * size), max(found.angle, _FLOOR)))


def _noise(times: Floats, poses: Floats) -> Noise:
    """Estimate the noise from four poses in a row, of which the third divided difference holds no parabola.

    Divided by the length of its coefficients it has the standard deviation of a pose, however frames are spaced.
    """
    four = sliding_window_view(times, 4)
    apart = four[:, :, np.newaxis] - four[:, np.newaxis, :] + np.eye(4)
    apart /= np.abs(apart).max(axis=(1, 2), keepdims=True)  # or the products below could overflow
    weights = 1.0 / apart.prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    turned = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
    sizes = np.abs(np.einsum("ni,nki->nk", weights, sliding_window_view(turned, 4, axis=0)))
    position, angle = (float(np.median(part)) / _NORMAL for part in (sizes[:, :2], sizes[:, 2]))
    return Noise(position, angle)


def _values_of(fit: Fit) -> dict[str, float]:
    """Return all parameters of a fit, the stiffness [N/m] in place of its logarithm."""
    logarithm, *others = fit.vector.tolist()
    return {"stiffness": 10.0**logarithm, **dict(zip(fit.problem.names[1:], others, strict=True))}


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
        Profile interval of each fitted parameter of the law, of level .95, in the units of the table.
    others : list of Fit
        Other laws that explain the recordings nearly as well, the best first.
    """

    body: Body
    slope: Slope
    solver: Solver
    recordings: list[Recording]
    frames: list[int]
    fit: Fit
    intervals: dict[str, Interval]
    others: list[Fit]
    model: Model

    @property
    def values(self) -> dict[str, float]:
        """Of all parameters: the stiffness [N/m], which rigid surfaces do not use, the law and the launches."""
        return _values_of(self.fit)

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
        for name in ["stiffness"] * (self.solver != "rigid") + list(LAW):
            unit = "N/m" if name == "stiffness" else self.fit.problem.parameter(name).unit
            low = high = math.nan
            note = "not fitted"
            if name in self.intervals:
                found = self.intervals[name]
                low, high, note = found.low, found.high, found.note
            rows.append((name, self.values[name], low, high, unit, note))
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
            values = _values_of(other)
            beyond = [name for name, ends in self.intervals.items() if not ends.low <= values[name] <= ends.high]
            if beyond and other.cost - self.fit.cost < CLOSE:
                law = ", ".join(f"{name} {values[name]:.4g}" for name in LAW)
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

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the same text."""
        return f"<pre>{escape(str(self))}</pre>"

    def descent(self, name: str | None = None, time: float | None = None) -> Descent:
        """Simulate a recording's descent, with its trajectory, for as long as it was recorded or for ``time`` [s]."""
        i = self._number(name)
        times = self.recordings[i].times
        length = float(times[-1] - times[0]) if time is None else time
        law, launch = self.fit.vector[: len(LAW) + 1], self.launches[self.recordings[i].name]
        return self.model.descent(law, launch, length, _DRAWN)

    def ghost(self, name: str | None = None) -> Ghost:
        """Return a recording for :func:`sledenv.pages.replay.replay_page` of its :meth:`descent`."""
        i = self._number(name)
        one = self.recordings[i]
        return Ghost(one.times - one.times[0], one.poses, self.frames[i])

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
