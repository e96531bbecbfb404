"""The contact law that is fitted, of rebounds and of poses alike: its parameters, the rebounds it makes, its report."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from typing import Final

import numpy as np
import pandas as pd

from sledenv.identification.fitting import Fit, Floats, Interval, Loss, Parameter, Problem, solve
from sledenv.identification.rebounds import Rebounds
from sledenv.simulation.rigid_impact import Hypothesis, velocities_after
from sledenv.simulation.rules import checked_bounds, checked_mapping

LAW: Final = ("restitution", "friction", "rolling_arm", "corner_rolling_arm")
USUAL: Final = {"restitution": 0.5, "friction": 0.2}  # where a fit begins; arms and softening from 0
LOSS_SCALE: Final = 0.1  # error of a rebound, relative to the speed before, from which on it counts as large
_STARTS, _FEW_STARTS = 16, 8  # of a fit; of each part of the data in a comparison
_MOST_FRICTION, _MOST_SOFTENING = 2.0, 1.0


@dataclass(frozen=True)
class ImpactModel:
    """Velocities after rebounds, of the values of parameters, and which of these are not fitted.

    Attributes
    ----------
    hypothesis : {"energetic", "poisson", "newton"}
        What the restitution means: docs/physics.md, section 4.
    fixed : dict
        Values of parameters that are not fitted.
    reference_speed : float
        Approach speed [m/s] at which the restitution is ``restitution``. With a ``softening`` q it is
        ``restitution (v/reference_speed)^-q`` at the approach speed v, at most 1: the power law of the theory of
        plastic impact, in which q is 1/4 (Johnson 1985, Contact Mechanics, section 11.5).
    """

    hypothesis: Hypothesis = "energetic"
    fixed: Mapping[str, float] = field(default_factory=lambda: {"softening": 0.0})
    reference_speed: float = 1.0

    def parameters(self, gyration_radius: float) -> tuple[Parameter, ...]:
        """Return what may be fitted; an arm of rolling resistance is at most the radius of gyration."""
        k = gyration_radius
        return (
            Parameter("restitution", "", 0.0, 1.0, 0.1),
            Parameter("friction", "", 0.0, _MOST_FRICTION, 0.1),
            Parameter("rolling_arm", "m", 0.0, k, 0.1 * k),
            Parameter("corner_rolling_arm", "m", 0.0, k, 0.1 * k),
            Parameter("softening", "", -_MOST_SOFTENING, _MOST_SOFTENING, 0.1),
        )

    def velocities(self, rebounds: Rebounds, values: Floats) -> Floats:
        """Velocities after, shape (N, 3): u, v [m/s], omega [rad/s]; of the values of LAW, and of a softening."""
        e, friction, arm, corner_arm, *softening = values
        laws = np.empty((len(rebounds), 3))
        laws[:, 0] = e
        if any(softening):
            laws[:, 0] = np.minimum(e * (rebounds.approach / self.reference_speed) ** -softening[0], 1.0)
        laws[:, 1] = friction
        laws[:, 2] = np.where(rebounds.corner, corner_arm, arm)
        return velocities_after(rebounds.gyration_radius, rebounds.contacts, laws, self.hypothesis)

    def __call__(self, train: Rebounds, test: Rebounds) -> Floats:
        """Fit to some rebounds and predict the velocities after others, shape (N, 3)."""
        return self.velocities(test, self.fit(train, starts=_FEW_STARTS).vector)

    def problem(
        self,
        rebounds: Rebounds,
        parameters: Sequence[Parameter],
        loss: Loss = "soft_l1",
        loss_scale: float = LOSS_SCALE,
    ) -> Problem:
        """Return the problem of explaining rebounds; of normal speeds alone, by the restitution alone."""
        along, untold = slice(None), [] if rebounds.corner.any() else ["corner_rolling_arm"]
        if rebounds.normal_alone:
            along, untold = slice(1, 2), ["friction", "rolling_arm", "corner_rolling_arm"]
        elif rebounds.corner.all():
            untold = ["rolling_arm"]
        return Problem(
            parameters,
            lambda values: rebounds.residuals(self.velocities(rebounds, values))[:, along],
            {**{one.name: one.low for one in parameters if one.name in untold}, **self.fixed},
            rebounds.recordings,
            loss,
            loss_scale,
        )

    def fit(
        self,
        rebounds: Rebounds,
        start: Mapping[str, float] | None = None,
        *,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        loss: Loss = "soft_l1",
        loss_scale: float = LOSS_SCALE,
        starts: int = _STARTS,
        seed: int = 0,
    ) -> Fit:
        """Fit the parameters that are not fixed; its arguments are those of :func:`sledenv.identify`.

        Raises
        ------
        ValueError
            Naming an argument, or if the rebounds are too few for the parameters.
        """
        known = {one.name: one for one in self.parameters(rebounds.gyration_radius)}
        for name, (low, high) in checked_bounds(bounds).items():
            if name not in known:
                raise ValueError(f"bounds: {name!r} is no parameter")
            known[name] = known[name]._replace(low=low, high=high)
        problem = self.problem(rebounds, list(known.values()), loss, loss_scale)
        equations = len(rebounds) * (1 if rebounds.normal_alone else 3)
        if equations <= len(problem.free):
            raise ValueError(
                f"{len(rebounds)} rebounds: their {equations} velocities would follow from many values of the "
                f"{len(problem.free)} parameters that are fitted ({', '.join(problem.free)}), and no interval; give "
                f"more rebounds than {len(problem.free) * len(rebounds) / equations:.3g}, or fix parameters"
            )
        usual = {one.name: min(max(USUAL.get(one.name, 0.0), one.low), one.high) for one in problem.parameters}
        return solve(problem, {**usual, **checked_mapping("start", start)}, starts=starts, seed=seed)


@dataclass(frozen=True)
class FittedLaw:
    """A contact law that was fitted, and how sure one may be of it.

    Attributes
    ----------
    fit : Fit
        With the values, their covariance and all starts.
    intervals : dict
        Profile interval of each fitted parameter of the law, of the level 0.95, in the units of the table.
    """

    fit: Fit
    intervals: Mapping[str, Interval]

    @property
    def values(self) -> dict[str, float]:
        """Of all parameters, those included that were not fitted."""
        return self.fit.values

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row per parameter: ``value``, ``error``, ``low`` and ``high`` of the interval, ``unit``, ``note``."""
        rows = {}
        for name, unit in self._reported():
            error = low = high = math.nan
            note = "not fitted"
            if name in self.intervals:
                low, high, *_ = found = self.intervals[name]
                error, note = self.fit.errors.get(name, math.nan), found.note
            rows[name] = (self.values[name], error, low, high, unit, note)
        columns = ["value", "error", "low", "high", "unit", "note"]
        return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("parameter")

    def _reported(self) -> list[tuple[str, str]]:
        """Names and units of the parameters of the law."""
        return [one[:2] for one in self.fit.problem.parameters]

    def _lines(self) -> Iterator[str]:
        """Yield the table for a reader."""
        yield f"{'':<20}{'value':>11}  {'95 % interval':^25} unit"
        for name, row in self.table.iterrows():
            reach = "" if row["note"] == "not fitted" else f"[{row['low']:.5g}, {row['high']:.5g}]"
            yield f"{name!s:<20}{row['value']:>11.5g}  {reach:^25} {row['unit']:<4} {row['note']}".rstrip()

    def _untold(self) -> Iterator[str]:
        """Yield a warning for each parameter that the recordings say nothing of."""
        for name, interval in self.intervals.items():
            if interval.low_on_bound and interval.high_on_bound:
                yield f"the recordings say nothing of {name}: every value in its bounds is as good"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the same text."""
        return f"<pre>{escape(str(self))}</pre>"
