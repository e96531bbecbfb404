"""The law that fits measured rebounds of one body best, and how sure one may be of it: :func:`identify`."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import Unpack, get_args

import numpy as np
import pandas as pd

from sledenv.identification.fitting import Fit, profiled
from sledenv.identification.impact_model import FitSettings, ImpactModel
from sledenv.identification.intervals import Interval
from sledenv.identification.objective import Floats
from sledenv.identification.rebounds import Rebounds, read_rebounds
from sledenv.simulation.bodies import Body
from sledenv.simulation.rigid_impact import Hypothesis
from sledenv.simulation.rules import checked_choice, checked_flag, checked_mapping

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
        return [*self.rebounds.doubts(), *self._doubts()]

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
        names the recording: rebounds of one may share their errors. Other columns are not read.
    body : Body, optional
        Whose rebounds they are. The mass cancels.
    gyration_radius : float, optional
        Root of inertia over mass [m] of any other smooth body, told by its arms.
    hypothesis : {"energetic", "poisson", "newton"}
        What the restitution means.
    fixed : mapping, optional
        Values of parameters that are not to be fitted: ``restitution``, ``friction``, ``rolling_arm`` [m] of the arc,
        ``corner_rolling_arm`` [m], ``softening``.
    speed_dependent : bool
        Whether ``softening`` is fitted as well, see
        :class:`sledenv.identification.impact_model.ImpactModel`; the restitution is then that at the median approach
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
        Naming the column, row or argument, its value and what is allowed.
    OSError
        If the file cannot be read.
    """
    checked_choice("hypothesis", hypothesis, get_args(Hypothesis))
    rebounds = read_rebounds(table, body, gyration_radius=gyration_radius)
    softens = checked_flag("speed_dependent", speed_dependent)
    held = {**({} if softens else {"softening": 0.0}), **checked_mapping("fixed", fixed)}
    speed = float(np.median(rebounds.approach)) if "softening" not in held else 1.0
    model = ImpactModel(hypothesis, held, speed)
    fit = model.fit(rebounds, **settings)
    return Identification(rebounds, model, *profiled(fit))
