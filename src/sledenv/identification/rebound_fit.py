"""The law that fits measured rebounds of one body best, and how sure one may be of it: :func:`identify`."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, get_args

import numpy as np
import pandas as pd

from sledenv.identification.fitting import Floats, profiled
from sledenv.identification.law import FittedLaw, ImpactModel
from sledenv.identification.plausibility import check_slips, doubts, read_rebounds
from sledenv.identification.rebounds import Rebounds
from sledenv.simulation.bodies import Body
from sledenv.simulation.rigid_impact import Hypothesis
from sledenv.simulation.rules import checked_choice, checked_flag, checked_mapping

_MANY = 1.0 / 3.0  # share of rebounds beyond the scale of the loss; noise of half that scale leaves a quarter there
# Degrees of freedom of the spread between recordings. In 200 data sets of 8 rebounds, which leave 5, intervals of 95 %
# held the friction in 86 %; of 10 to 30 rebounds in 89 to 94 %.
_FEW_DEGREES = 7


@dataclass(frozen=True)
class Identification(FittedLaw):
    """A contact law that was fitted to rebounds.

    Attributes
    ----------
    fit, intervals
        As of :class:`~sledenv.identification.law.FittedLaw`.
    rebounds : Rebounds
    model : ImpactModel
    """

    rebounds: Rebounds
    model: ImpactModel

    @cached_property
    def velocities(self) -> Floats:
        """Velocities after, as the fit has them, shape (N, 3): u, v [m/s], omega [rad/s]."""
        return self.model.velocities(self.rebounds, self.fit.vector)

    @property
    def errors(self) -> Floats:
        """Of each rebound, root of ``dv' M dv / v0' M v0``, shape (N,)."""
        return self.rebounds.errors(self.velocities)

    @cached_property
    def warnings(self) -> list[str]:
        """Reasons to doubt the result, a sentence each."""
        return [*doubts(self.rebounds), *self._doubts()]

    def _doubts(self) -> Iterator[str]:
        limit = self.fit.problem.loss_scale
        far = int(np.count_nonzero(self.errors > limit))
        if far > _MANY * len(self.rebounds):
            yield (
                f"{far} of {len(self.rebounds)} rebounds differ from the fit by more than {limit:g} of their speed "
                "before, where outliers begin (loss_scale): no such law explains them, or a sign, a unit, the zero of "
                "phi or the body is told wrongly; do not use the values"
            )
        if self.fit.spread.degrees < _FEW_DEGREES or self.fit.spread.kind == "model":
            yield self._too_few()
        yield from self._untold()
        for name, value in self.fit.on_bound.items():
            if not (self.intervals[name].low_on_bound and self.intervals[name].high_on_bound):
                yield f"{name} is on its bound, {value:g}: its interval is one-sided"
        failed = int(np.count_nonzero(~self.fit.starts["converged"]))
        if failed:
            yield f"{failed} of {len(self.fit.starts)} starts did not converge"

    def _too_few(self) -> str:
        """Say what intervals rest on where recordings are few."""
        recordings = len(np.unique(self.rebounds.recordings))
        rest = f"{recordings} recordings leave {self.fit.spread.degrees} degrees of freedom: intervals may be too short"
        if self.fit.spread.kind == "model":
            rest = (
                f"{recordings} recordings do not show how errors vary between them: intervals suppose equal and "
                f"independent errors of all {3 * len(self.rebounds)} velocities"
            )
        return f"{rest}; record {len(self.fit.problem.free) + _FEW_DEGREES} or more, or fix parameters"

    def __str__(self) -> str:
        """Return the result for a reader: what was fitted, the parameters, the errors, what to doubt."""
        count, recordings = len(self.rebounds), len(np.unique(self.rebounds.recordings))
        speed = "" if "softening" in self.model.fixed else f" at {self.model.reference_speed:.3g} m/s"
        mean, tail = np.mean(self.errors), np.quantile(self.errors, 0.9)
        lines = [f"{count} rebounds of {recordings} recordings, {self.model.hypothesis} restitution{speed}", ""]
        lines += self._lines()
        lines += ["", f"error of the fit, relative to the speed before: mean {mean:.4f}, 90th percentile {tail:.4f}"]
        return "\n".join([*lines, *(f"warning: {text}" for text in self.warnings)])


def identify(
    table: pd.DataFrame | str | os.PathLike[str],
    body: Body | None = None,
    *,
    gyration_radius: float | None = None,
    hypothesis: Hypothesis = "energetic",
    fixed: Mapping[str, float] | None = None,
    speed_dependent: bool = False,
    **settings: Any,
) -> Identification:
    """Fit restitution, friction and rolling arms to measured rebounds of one body.

    Parameters
    ----------
    table : DataFrame or path
        One row per rebound, a CSV or Parquet file if a path. Columns ``u_before_m_s``, ``v_before_m_s``,
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
        Whether ``softening`` is fitted as well, see :class:`sledenv.identification.law.ImpactModel`; the restitution
        is then that at the median approach speed. It is 0 otherwise.
    start : mapping, optional
        Where the first start begins.
    bounds : mapping, optional
        (low, high) of parameters in place of the usual ones.
    loss : {"soft_l1", "linear"}
        Robust, the default, or least squares.
    loss_scale : float
        Error, relative to the speed before, from which on a rebound begins to count as an outlier; 0.1 by default.
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
    return Identification(*profiled(fit), rebounds, model)
