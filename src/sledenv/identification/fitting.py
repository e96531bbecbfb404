"""Fits from several starts: what was found, its covariance and its intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from sledenv.identification.covariance import Covariance, covariance_at
from sledenv.identification.intervals import Interval, LocalMinimumError, profile_end
from sledenv.identification.minimisation import LIMIT, minimise
from sledenv.identification.objective import Floats, Problem
from sledenv.simulation.rules import checked, checked_count, checked_seed

_SAME = 1e-3  # of its scale: values of a parameter that differ by less belong to one minimum
_EXACT = 1e-8  # a residual that counts as zero


@dataclass(frozen=True)
class Fit:
    """What was found.

    Attributes
    ----------
    problem : Problem
    values : dict
        Of all parameters, fixed ones included.
    cost : float
        The least that was found.
    starts : DataFrame
        One row a start, the best first: ``start_NAME`` and ``end_NAME`` of each fitted parameter, ``cost`` at the end,
        ``evaluations`` of the residuals, and ``converged``.
    """

    problem: Problem
    values: dict[str, float]
    cost: float
    starts: pd.DataFrame

    @property
    def vector(self) -> Floats:
        """Values of all parameters in order, shape (P,)."""
        return np.array([self.values[name] for name in self.problem.names])

    @property
    def on_bound(self) -> dict[str, float]:
        """Fitted parameters whose value is one of their bounds, and that bound."""
        found = {name: self.values[name] for name in self.problem.free}
        bounds = {name: self.problem.parameter(name)[2:4] for name in found}
        return {name: value for name, value in found.items() if value in bounds[name]}

    @property
    def minima(self) -> pd.DataFrame:
        """Rows of ``starts``, one for each minimum, with ``found``: by how many starts that converged."""
        ends = [f"end_{name}" for name in self.problem.free]
        scales = np.array([self.problem.parameter(name).scale for name in self.problem.free])
        rest = self.starts[self.starts["converged"]]
        rows = []
        while len(rest):
            steps = np.abs(rest[ends].to_numpy(float) - rest.iloc[0][ends].to_numpy(float)) / scales
            # One minimum may be flat: ends with the same cost are one as well.
            alike = (steps <= _SAME).all(axis=1) | np.isclose(rest["cost"], rest["cost"].iloc[0], rtol=1e-6, atol=1e-30)
            rows.append(rest.iloc[0].to_dict() | {"found": int(alike.sum())})
            rest = rest[~alike]
        return pd.DataFrame(rows)

    @cached_property
    def clusters(self) -> NDArray[np.intp]:
        """Number of the recording of each row, shape (N,)."""
        given = self.problem.clusters
        count = len(self.problem.rows(self.vector))
        return np.arange(count) if given is None else np.unique(np.asarray(given), return_inverse=True)[1]

    @cached_property
    def _covariance(self) -> Covariance:
        return covariance_at(self.problem, self.vector, self.clusters)

    @property
    def covariance_kind(self) -> str:
        """How the covariance was estimated.

        "sandwich": from how the gradient varies between recordings, which needs no equal, normal or independent errors
        within one (White 1982). "model": ``(J'J)^-1`` times the variance of residuals, as if all were independent and
        alike, where there are hardly more recordings than parameters.
        """
        return self._covariance.kind

    @property
    def degrees(self) -> int:
        """Degrees of freedom of that estimate."""
        return self._covariance.degrees

    @cached_property
    def covariance(self) -> pd.DataFrame:
        """Of the fitted parameters; NaN for one on its bound, or that the data say nothing of."""
        names = self.problem.free
        inner = [name for name in names if name not in self.on_bound]
        found = pd.DataFrame(np.nan, names, names)
        found.loc[inner, inner] = self._covariance.among(inner)
        return found

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors of the fitted parameters."""
        variances = np.maximum(np.diag(self.covariance), 0.0)  # rounding may leave less, where the data have no errors
        return dict(zip(self.problem.free, np.sqrt(variances).tolist(), strict=True))

    def held(self, **values: float) -> tuple[float, dict[str, float]]:
        """Return the least cost with some parameters held, and the values of all; the others start from this fit."""
        problem = self.problem.holding(values)
        found = minimise(problem, problem.values(self.values))
        return found.cost, problem.named(found.values)

    def interval(self, name: str, level: float = 0.95) -> Interval:
        """Profile interval of a fitted parameter: where the least cost with it held has not risen too far.

        What is too far follows from the covariance (:attr:`covariance_kind`) and from Student's distribution. On a
        bound the interval is one-sided; it then covers its level or more, as a parameter that is on its bound in truth
        is found on it in about half of all data sets.

        Parameters
        ----------
        name : str
        level : float
            In (0, 1).

        Returns
        -------
        Interval

        Raises
        ------
        ValueError
            If the parameter is not fitted, or the level is outside its range.
        LocalMinimumError
            If a lower cost appears on the way; :func:`profiled` goes on from there.
        """
        if name not in self.problem.free:
            raise ValueError(f"{name!r} is not fitted: must be one of {', '.join(self.problem.free)}")
        level = checked("interval", "level", level, (lambda v: (v > 0.0) & (v < 1.0), "in (0, 1)"))
        one = self.problem.parameter(name)
        quantile = float(stats.t.ppf(0.5 + 0.5 * level, self.degrees)) ** 2
        noise = _EXACT**2 * len(self.clusters)
        again = [other for other in self.problem.free if other == name or other not in self.on_bound]
        allowed = 0.5 * max(quantile * self._covariance.widening(name, again), noise)
        step = self.errors[name] * np.sqrt(quantile)
        step = float(step) if step > 1e-6 * one.scale else 1e-2 * one.scale
        low, high = (
            profile_end(self.problem, self.vector, self.cost, one, side * step, allowed) for side in (-1.0, 1.0)
        )
        return Interval(low, high, level, low <= one.low, high >= one.high)


def solve(
    problem: Problem, start: Mapping[str, float] | None = None, *, starts: int = 16, seed: int = 0, limit: int = LIMIT
) -> Fit:
    """Fit from several starts.

    Parameters
    ----------
    problem : Problem
    start : mapping, optional
        Values of the fitted parameters at the first start; the middle of their bounds by default.
    starts : int
        How many in all; the others are a Latin hypercube in the bounds.
    seed : int
        Of the hypercube.
    limit : int
        Steps of one minimisation, each with one evaluation of the residuals and one for each fitted parameter.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        If all parameters are fixed, a start is outside its bounds, or residuals are not finite.
    """
    if not problem.free:
        raise ValueError(f"fixed = {dict(problem.fixed)!r}: must leave a parameter to fit")
    checked_count("starts", starts)
    seed = checked_seed(seed)
    free = [problem.parameter(name) for name in problem.free]
    low, high = np.array([(one.low, one.high) for one in free]).T
    first = 0.5 * (low + high) if start is None else np.array([start.get(one.name, np.nan) for one in free])
    others = low + (high - low) * stats.qmc.LatinHypercube(len(free), rng=seed).random(starts - 1)
    rows = [_row(problem, dict(zip(problem.free, begin.tolist(), strict=True)), limit) for begin in [first, *others]]
    return _best(problem, pd.DataFrame(rows))


def _row(problem: Problem, start: Mapping[str, float], limit: int = LIMIT) -> dict[str, float]:
    """Row of the table of starts of a minimisation."""
    found = minimise(problem, problem.values(start), limit)
    ends = problem.named(found.values)
    return (
        {f"start_{name}": start[name] for name in problem.free}
        | {f"end_{name}": ends[name] for name in problem.free}
        | {"cost": found.cost, "evaluations": found.evaluations, "converged": found.converged}
    )


def _best(problem: Problem, starts: pd.DataFrame) -> Fit:
    ranked = starts.sort_values("cost", kind="stable", ignore_index=True)
    best = {name: float(ranked[f"end_{name}"].iloc[0]) for name in problem.free}
    return Fit(problem, problem.named(problem.values(best)), float(ranked["cost"].iloc[0]), ranked)


def profiled(fit: Fit, level: float = 0.95, names: Sequence[str] | None = None) -> tuple[Fit, dict[str, Interval]]:
    """Return the profile intervals of fitted parameters, and the fit that they belong to.

    Where a lower cost appears on the way, a minimisation from there is a further row of ``starts``, and the fit.

    Parameters
    ----------
    fit : Fit
    level : float
        In (0, 1).
    names : sequence of str, optional
        Of which parameters; all that are fitted by default.
    """
    while True:
        try:
            return fit, {name: fit.interval(name, level) for name in (fit.problem.free if names is None else names)}
        except LocalMinimumError as error:
            further = pd.DataFrame([_row(fit.problem, error.values)])
            fit = _best(fit.problem, pd.concat([further, fit.starts], ignore_index=True))
