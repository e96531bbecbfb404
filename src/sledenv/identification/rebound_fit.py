"""The law that fits measured rebounds of one body best, and how sure one may be of it: :func:`identify`."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from typing import TypedDict, Unpack, get_args

import numpy as np
import pandas as pd

from sledenv.identification.fitting import Fit, Interval, profiled, solve
from sledenv.identification.objective import Floats, Loss, Parameter, Problem
from sledenv.identification.plausibility import check_slips, doubts, read_rebounds
from sledenv.identification.rebounds import Rebounds
from sledenv.simulation.bodies import Body
from sledenv.simulation.rigid_impact import Hypothesis, velocities_after
from sledenv.simulation.rules import checked_bounds, checked_choice, checked_flag, checked_mapping

_MOST_FRICTION = 2.0
_MOST_SOFTENING = 1.0
_LOSS_SCALE = 0.1  # relative to the speed before
_USUAL = {"restitution": 0.5, "friction": 0.2}  # where the first start begins; arms and softening from 0
_STARTS = 16
_FEW_STARTS = 8  # of each part of the data in a comparison
_MANY = 1.0 / 3.0  # share of rebounds beyond the scale of the loss; noise of half that scale leaves a quarter there
# Degrees of freedom of the spread between recordings. In 200 data sets of 8 rebounds, which leave 5, intervals of 95 %
# held the friction in 86 %; of 10 to 30 rebounds in 89 to 94 %.
_FEW_DEGREES = 7


@dataclass(frozen=True)
class Identification:
    """A contact law that was fitted to rebounds, and how sure one may be of it.

    Attributes
    ----------
    rebounds : Rebounds
    model : ImpactModel
    fit : Fit
        With the values, their covariance and all starts.
    intervals : dict
        Profile interval of each fitted parameter, of the level .95.
    """

    rebounds: Rebounds
    model: ImpactModel
    fit: Fit
    intervals: Mapping[str, Interval]

    @property
    def values(self) -> dict[str, float]:
        """Of all parameters, those included that were not fitted."""
        return self.fit.values

    @cached_property
    def velocities(self) -> Floats:
        """Velocities after, as the fit has them, shape (N, 3): u, v [m/s], omega [rad/s]."""
        return self.model.velocities(self.rebounds, self.fit.vector)

    @property
    def errors(self) -> Floats:
        """Of each rebound, root of ``dv' M dv / v0' M v0``, shape (N,)."""
        return self.rebounds.errors(self.velocities)

    def predict(self, table: pd.DataFrame | str | os.PathLike[str], body: Body | None = None) -> Floats:
        """Velocities after other impacts of this body, shape (N, 3): u, v [m/s], omega [rad/s].

        Parameters
        ----------
        table, body
            As for :func:`identify`; velocities after need not be there.
        """
        gyration = None if body is not None else self.rebounds.gyration_radius
        return self.model.velocities(
            read_rebounds(table, body, gyration_radius=gyration, measured=False), self.fit.vector
        )

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row a parameter: ``value``, ``error``, ``low`` and ``high`` of the interval, ``unit``, ``note``."""
        rows = []
        for one in self.fit.problem.parameters:
            if one.name in self.fit.problem.free:
                found = self.intervals[one.name]
                value, error = self.values[one.name], self.fit.errors[one.name]
                rows.append((value, error, found.low, found.high, one.unit, found.note))
            else:
                rows.append((self.values[one.name], np.nan, np.nan, np.nan, one.unit, "not fitted"))
        columns = ["value", "error", "low", "high", "unit", "note"]
        return pd.DataFrame(rows, pd.Index(self.fit.problem.names, name="parameter"), columns)

    @cached_property
    def warnings(self) -> list[str]:
        """What casts doubt on the result, a sentence each."""
        return [*doubts(self.rebounds), *self._doubts()]

    def _doubts(self) -> Iterable[str]:
        limit = self.fit.problem.loss_scale
        far = int(np.count_nonzero(self.errors > limit))
        if far > _MANY * len(self.rebounds):
            yield (
                f"{far} of {len(self.rebounds)} rebounds differ from the fit by more than {limit:g} of their speed "
                "before, where outliers begin (loss_scale): no such law explains them, or a sign, a unit, the zero of "
                "phi or the body is told wrongly; do not use the values"
            )
        if self.fit.degrees < _FEW_DEGREES or self.fit.covariance_kind == "model":
            yield self._too_few()
        for name, interval in self.intervals.items():
            if interval.low_on_bound and interval.high_on_bound:
                yield f"these rebounds say nothing of {name}: every value in its bounds is as good"
            elif name in self.fit.on_bound:
                yield f"{name} is on its bound, {self.values[name]:g}: its interval is one-sided"
        minima = self.fit.minima
        failed = len(self.fit.starts) - int(self.fit.starts["converged"].sum())
        if failed:
            yield f"{failed} of {len(self.fit.starts)} starts did not converge"
        for _, other in minima.iloc[1:].iterrows():
            places = ", ".join(f"{name} {other[f'end_{name}']:.4g}" for name in self.fit.problem.free)
            rise = other["cost"] / self.fit.cost - 1.0 if self.fit.cost > 0.0 else math.inf
            yield (
                f"{int(other['found'])} of {len(self.fit.starts)} starts ended in another minimum, at {places}, "
                f"whose cost is higher by {100.0 * rise:.2g} %"
            )

    def _too_few(self) -> str:
        """Say what intervals rest on where recordings are few."""
        recordings = len(np.unique(self.rebounds.recordings))
        enough = len(self.fit.problem.free) + _FEW_DEGREES
        if self.fit.covariance_kind == "model":
            rest = (
                f"{recordings} recordings do not show how errors vary between them: intervals suppose equal and "
                f"independent errors of all {3 * len(self.rebounds)} velocities"
            )
        else:
            rest = f"{recordings} recordings leave {self.fit.degrees} degrees of freedom: intervals may be too short"
        return f"{rest}; record {enough} or more, or fix parameters"

    def __str__(self) -> str:
        """Return the result for a reader: what was fitted, the parameters, the errors, what to doubt."""
        count, recordings = len(self.rebounds), len(np.unique(self.rebounds.recordings))
        mean, tail = np.mean(self.errors), np.quantile(self.errors, 0.9)
        lines = [
            f"{count} rebounds of {recordings} recordings, {self.model.hypothesis} restitution"
            + (f" at {self.model.reference_speed:.3g} m/s" if "softening" not in self.model.fixed else ""),
            "",
            f"{'':<20}{'value':>11}  {'95 % interval':^25} unit",
        ]
        for name, row in self.table.iterrows():
            reach = "" if row["note"] == "not fitted" else f"[{row['low']:.5g}, {row['high']:.5g}]"
            lines.append(f"{name!s:<20}{row['value']:>11.5g}  {reach:^25} {row['unit']:<4} {row['note']}".rstrip())
        lines += ["", f"error of the fit, relative to the speed before: mean {mean:.4f}, 90th percentile {tail:.4f}"]
        return "\n".join([*lines, *(f"warning: {text}" for text in self.warnings)])

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the same text."""
        return f"<pre>{escape(str(self))}</pre>"


def identify(
    table: pd.DataFrame | str | os.PathLike[str],
    body: Body | None = None,
    *,
    gyration_radius: float | None = None,
    hypothesis: Hypothesis = "energetic",
    fixed: Mapping[str, float] | None = None,
    speed_dependent: bool = False,
    **settings: Unpack[FitSettings],
) -> Identification:
    """Fit restitution, friction and rolling arms to measured rebounds of one body.

    Parameters
    ----------
    table : DataFrame or path
        One row a rebound, a CSV or Parquet file if a path. Columns ``u_before_m_s``, ``v_before_m_s``,
        ``omega_before_rad_s``, the same with ``after``, and either ``phi_rad``, the orientation of ``body``, or the
        arms ``a_m`` and ``b_m`` of the contact point, which lies at (-a, -b) from the mass centre. The frame is that
        of the slope: x along it, y along its outward normal, angles counter-clockwise. ``recording``, if it is there,
        names the recording: rebounds of one may share their errors. Other columns are not read. Of a body that is hit
        below its mass centre ``v_before_m_s`` and ``v_after_m_s`` alone tell the restitution; if it bounces freely, so
        do the times of its touchdowns, ``t_touchdown_s``.
    body : Body, optional
        Whose rebounds they are. The mass cancels.
    gyration_radius : float, optional
        Root of inertia over mass [m] of any other smooth body, told by its arms; normal speeds alone need neither.
    hypothesis : {"energetic", "poisson", "newton"}
        What the restitution means.
    fixed : mapping, optional
        Values of parameters that are not to be fitted: ``restitution``, ``friction``, ``rolling_arm`` [m] of the arc,
        ``corner_rolling_arm`` [m], ``softening``.
    speed_dependent : bool
        Whether ``softening`` is fitted as well, see
        :class:`sledenv.identification.rebound_fit.ImpactModel`; the restitution is then that at the median approach
        speed. It is 0 otherwise.
    start : mapping, optional
        Where the first start begins.
    bounds : mapping, optional
        (low, high) of parameters in place of the usual ones.
    loss : {"soft_l1", "linear"}
        Robust, the default, or least squares.
    loss_scale : float
        Error, relative to the speed before, from which on a rebound begins to count as an outlier; .1 by default.
    starts, seed
        As for :func:`sledenv.identification.fitting.solve`; 16 and 0 by default.

    Returns
    -------
    Identification

    Raises
    ------
    TypeError, ValueError
        Naming the column, row or argument, its value and what is allowed; if slips are reversed, which no such law
        does to a body hit below its mass centre; or if a fit never settles, as no such law explains the rebounds.
    OSError
        If the file cannot be read.
    """
    checked_choice("hypothesis", hypothesis, get_args(Hypothesis))
    rebounds = read_rebounds(table, body, gyration_radius=gyration_radius)
    check_slips(rebounds)
    softens = checked_flag("speed_dependent", speed_dependent)
    held = {**({} if softens else {"softening": 0.0}), **checked_mapping("fixed", fixed)}
    speed = float(np.median(rebounds.approach)) if "softening" not in held else 1.0
    model = ImpactModel(hypothesis, held, speed)
    fit = model.fit(rebounds, **settings)
    return Identification(rebounds, model, *profiled(fit))


class FitSettings(TypedDict, total=False):
    """How a law is fitted to rebounds: what :meth:`ImpactModel.fit` takes by name."""

    start: Mapping[str, float] | None
    bounds: Mapping[str, tuple[float, float]] | None
    loss: Loss
    loss_scale: float
    starts: int
    seed: int


@dataclass(frozen=True)
class ImpactModel:
    """How rebounds follow from parameters, and which of these are not fitted.

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
        """What may be fitted; an arm of rolling resistance is at most the radius of gyration."""
        k = gyration_radius
        return (
            Parameter("restitution", "", 0.0, 1.0, 0.1),
            Parameter("friction", "", 0.0, _MOST_FRICTION, 0.1),
            Parameter("rolling_arm", "m", 0.0, k, 0.1 * k),
            Parameter("corner_rolling_arm", "m", 0.0, k, 0.1 * k),
            Parameter("softening", "", -_MOST_SOFTENING, _MOST_SOFTENING, 0.1),
        )

    def velocities(self, rebounds: Rebounds, values: Floats) -> Floats:
        """Velocities after, shape (N, 3): u, v [m/s], omega [rad/s]; for values of all parameters in their order."""
        e, friction, arm, corner_arm, softening = values
        laws = np.empty((len(rebounds), 3))
        laws[:, 0] = e
        if softening != 0.0:
            laws[:, 0] = np.minimum(e * (rebounds.approach / self.reference_speed) ** -softening, 1.0)
        laws[:, 1] = friction
        laws[:, 2] = np.where(rebounds.corner, corner_arm, arm)
        return velocities_after(rebounds.gyration_radius, rebounds.contacts, laws, self.hypothesis)

    def __call__(self, train: Rebounds, test: Rebounds) -> Floats:
        """Fit to some rebounds and predict the velocities after others, shape (N, 3)."""
        return self.velocities(test, self.fit(train, starts=_FEW_STARTS).vector)

    def fit(
        self,
        rebounds: Rebounds,
        start: Mapping[str, float] | None = None,
        *,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        loss: Loss = "soft_l1",
        loss_scale: float = _LOSS_SCALE,
        starts: int = _STARTS,
        seed: int = 0,
    ) -> Fit:
        """Fit the parameters that are not fixed; its arguments are those of :func:`sledenv.identify`.

        Raises
        ------
        ValueError
            Naming an argument, or if the rebounds are too few for the parameters.
        """
        unused = {} if rebounds.corner.any() else {"corner_rolling_arm": 0.0}
        if rebounds.corner.all():
            unused = {"rolling_arm": 0.0}
        along = slice(None)
        if rebounds.normal_alone:
            unused, along = {"friction": 0.0, "rolling_arm": 0.0, "corner_rolling_arm": 0.0}, slice(1, 2)
        limits = checked_bounds(bounds)
        parameters = self.parameters(rebounds.gyration_radius)
        for name in limits:
            if name not in [one.name for one in parameters]:
                raise ValueError(f"bounds: {name!r} is no parameter")
        problem = Problem(
            [one._replace(low=low, high=high) for one in parameters for low, high in [limits.get(one.name, one[2:4])]],
            lambda values: rebounds.residuals(self.velocities(rebounds, values))[:, along],
            {**unused, **self.fixed},
            rebounds.recordings,
            loss,
            loss_scale,
        )
        equations = rebounds.after[:, along].size
        if equations <= len(problem.free):
            raise ValueError(
                f"{len(rebounds)} rebounds: their {equations} velocities would follow from many values of the "
                f"{len(problem.free)} parameters that are fitted ({', '.join(problem.free)}), and no interval; give "
                f"more rebounds than {len(problem.free) * len(rebounds) / equations:.3g}, or fix parameters"
            )
        usual = {one.name: min(max(_USUAL.get(one.name, 0.0), one.low), one.high) for one in problem.parameters}
        return solve(problem, {**usual, **checked_mapping("start", start)}, starts=starts, seed=seed)
