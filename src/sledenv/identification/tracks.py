"""From recorded poses over time to the contact law and the launches that explain them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import get_args

import numpy as np
import pandas as pd

from sledenv.identification.fitting import Fit, Loss
from sledenv.identification.flights import law_of
from sledenv.identification.frames import check_frame
from sledenv.identification.law import LAW, FittedLaw
from sledenv.identification.recordings import POSE, TIME, Noise, Recording, recordings_of
from sledenv.identification.search import CLOSE, STIFFNESS, Model, Search, distinct, known_of, parameters_of, settled
from sledenv.identification.tables import RECORDING
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

_MISFIT = 1.5  # mean square of residuals, in noise levels, from which it is said
_DRAWN = 0.01  # [s] between two rows in flight of a descent that is shown, simulate's default


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
        Lower and upper bound of fitted ones; restitution in [0, 1], from 0.001 on compliant surfaces, friction in
        [0, 1.5], arms from 0 to the radius of a segment or to the size of any other body, and stiffness, of contacts
        that last from 0.02 intervals of frames to 0.1 s, by default.
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
        Naming recording, column, value and what is allowed; if another sign or unit would explain the poses; if no
        body touches the slope; or if no rebound can be explained.
    """
    checked_choice("solver", solver, get_args(Solver))
    checked_choice("loss", loss, get_args(Loss))
    rng = np.random.default_rng(checked_seed(seed))
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
    search = Search(model, held, rng)
    fits = search.run()
    if not fits:
        raise ValueError(_nothing_told(search))
    best, intervals = settled(fits)
    others = [fit for fit in distinct([best, *fits]) if fit is not best]
    if STIFFNESS in intervals:
        found = intervals.pop(STIFFNESS)
        intervals["stiffness"] = found._replace(low=10.0**found.low, high=10.0**found.high)
    return TrackFit(best, intervals, model, search.frames(search.level), others)


def _nothing_told(search: Search) -> str:
    """Reason why no law could be fitted."""
    tracks = zip(search.flights, search.model.recordings, strict=True)
    if all(track and track[-1].end > one.times[-1] for track, one in tracks):
        return "the table: the body touches the slope in no recording, so that nothing tells the law"
    levels = [f"{one.name!r} {one.noise.position:.2g} m, {one.noise.angle:.2g} rad" for one in search.model.recordings]
    return (
        "the table: no law explains the first rebound of any recording to within its noise "
        f"({', '.join(levels)}): are the body, the slope, the units, the frame and the zero of phi_rad right, and is "
        "the noise? A contact that lasts for some frames needs compliant surfaces, poses without noise a body and a "
        "slope that are told as exactly, or a noise that makes up for it"
    )


def _values_of(fit: Fit) -> dict[str, float]:
    """Return all parameters of a fit, the stiffness [N/m] in place of its logarithm."""
    others = {name: value for name, value in fit.values.items() if name != STIFFNESS}
    return {"stiffness": 10.0 ** fit.values[STIFFNESS]} | others


@dataclass(frozen=True)
class TrackFit(FittedLaw):
    """A contact law that was fitted to recorded poses.

    Attributes
    ----------
    fit, intervals
        As of :class:`~sledenv.identification.law.FittedLaw`.
    model : Model
        With the body, the slope, the solver and the recordings, each with its noise.
    frames : tuple of int
        How many frames of each recording are explained by the fit, and used.
    others : list of Fit
        Other laws that explain the recordings nearly as well, the best first.
    """

    model: Model
    frames: tuple[int, ...]
    others: list[Fit]

    @property
    def recordings(self) -> Sequence[Recording]:
        """Recorded poses, with the noise that was given or estimated."""
        return self.model.recordings

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

    def _reported(self) -> list[tuple[str, str]]:
        stiffness = [("stiffness", "N/m")] if self.model.solver == "compliant" else []
        return stiffness + [one[:2] for one in self.fit.problem.parameters if one.name in LAW]

    @cached_property
    def warnings(self) -> list[str]:
        """Reasons to doubt the result, a sentence each."""
        return list(self._doubts())

    def _doubts(self) -> Iterator[str]:
        for name, row in self.used.iterrows():
            if not row["whole"]:
                yield (
                    f"recording {name!r} is explained until {row['until_s']:.4g} s only, {row['rebounds']} rebounds: "
                    "what follows is not used, and the law may be a wrong one that explains no more than this"
                )
            if row["misfit"] > _MISFIT:
                yield f"recording {name!r}: residuals are {math.sqrt(row['misfit']):.1f} times the noise"
        yield from self._untold()
        for other in self.others:
            values = _values_of(other)
            beyond = [name for name, ends in self.intervals.items() if not ends.low <= values[name] <= ends.high]
            if beyond and other.cost - self.fit.cost < CLOSE:
                law = ", ".join(f"{name} {values[name]:.4g}" for name in LAW)
                yield f"another law explains the recordings nearly as well: {law}"
        if self.model.solver == "rigid" and not self.used["whole"].all():
            yield (
                "surfaces were taken for rigid: contacts that last, for a few milliseconds even, look like this, and "
                "no interval knows of it; fit compliant surfaces, and see whether they explain more"
            )

    def __str__(self) -> str:
        """Return the result for a reader: what was used, the law, what to doubt."""
        lines = [f"{len(self.recordings)} recordings, {self.model.solver} surfaces, flights and rebounds as simulated"]
        lines += ["", self.used.round(4).to_string(), "", *self._lines()]
        return "\n".join([*lines, *(f"warning: {text}" for text in self.warnings)])

    def descent(self, name: str | None = None) -> Descent:
        """Simulate the descent of a recording, with its trajectory, for as long as it was recorded."""
        one = self.recordings[self._number(name)]
        law = self.fit.vector[: len(LAW) + 1]
        return self.model.descent(law, self.launches[one.name], float(one.times[-1] - one.times[0]), _DRAWN)

    def ghost(self, name: str | None = None) -> Ghost:
        """Return a recording for :func:`sledenv.pages.replay.replay_page` of its :meth:`descent`."""
        i = self._number(name)
        one = self.recordings[i]
        return Ghost(one.times - one.times[0], one.poses, self.frames[i])

    @cached_property
    def residuals(self) -> pd.DataFrame:
        """One row per frame of each recording, the unused ones included: recorded less simulated pose."""
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
        """One row per recording: its frames, how many are used and until when, rebounds by then, noise, and misfit.

        ``misfit`` is the mean square of a number of the used poses, in noise levels, but for wrong ones: 1 by chance.
        """
        rows = []
        for one, used in zip(self.recordings, self.frames, strict=True):
            until = float(one.times[used - 1])
            rebounds = np.count_nonzero(self.descent(one.name).rebounds["t"] <= until - one.times[0])
            whole = self.residuals.loc[self.residuals[RECORDING] == one.name, "noise_levels"].to_numpy()[:used]
            misfit = float(np.median(whole**2)) / 2.366  # the median of chi-squared of 3 degrees of freedom
            rows.append((one.name, len(one.times), used, until, rebounds, used == len(one.times), *one.noise, misfit))
        names = ["frames", "used", "until_s", "rebounds", "whole", "noise_position_m", "noise_angle_rad", "misfit"]
        return pd.DataFrame(rows, columns=[RECORDING, *names]).set_index(RECORDING)

    def _number(self, name: str | None) -> int:
        names = [one.name for one in self.recordings]
        if name is None and len(names) == 1:
            return 0
        if name not in names:
            raise ValueError(f"recording = {name!r}: must be one of {', '.join(map(repr, names))}")
        return names.index(name)
