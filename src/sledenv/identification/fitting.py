"""Fits from several starts: what was found, its covariance, its intervals, and how it varies between data sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import brentq

from sledenv.identification.objective import LIMIT, Floats, Parameter, Problem, minimise
from sledenv.simulation.rules import checked, checked_count, checked_seed

_REACH = 1e-6  # of a step's scale: how exactly the end of an interval is found
_LOWER = 1e-2  # of the rise that an interval allows: a fall of a cost that is more than unfinished minimisation
ROUNDING = 1e-9  # of a cost: what two minimisations may differ by, and no rise or fall is told below
AGAIN = 50  # times that a fit goes on from a lower cost at most
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
        noise = max(_EXACT**2 * len(self.clusters), ROUNDING * self.cost)
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

    Raises
    ------
    ValueError
        If lower costs appear again and again, as where nothing near the parameters explains the data.
    """
    for _ in range(AGAIN):
        try:
            return fit, {name: fit.interval(name, level) for name in (fit.problem.free if names is None else names)}
        except LocalMinimumError as error:
            further = pd.DataFrame([_row(fit.problem, error.values)])
            fit = _best(fit.problem, pd.concat([further, fit.starts], ignore_index=True))
    raise ValueError(
        f"the fit went on from a lower cost {AGAIN} times and found another each time: no such law explains the data"
    )


def bootstrap(fit: Fit, draws: int = 200, seed: int = 0) -> pd.DataFrame:
    """Fitted parameters of as many data sets, each of recordings drawn with replacement from those of the fit.

    Parameters
    ----------
    fit : Fit
        Each drawn data set is fitted from its values.
    draws : int
    seed : int

    Returns
    -------
    DataFrame
        One row a draw, one column a fitted parameter.

    Raises
    ------
    ValueError
        If there is one recording only.
    """
    checked_count("draws", draws)
    groups = int(fit.clusters.max()) + 1
    if groups < 2:
        raise ValueError("clusters: must be of at least two recordings to draw from")
    rng = np.random.default_rng(seed)
    own = np.ones(len(fit.clusters)) if fit.problem.weights is None else fit.problem.weights
    rows = []
    for _ in range(draws):
        times = np.bincount(rng.integers(groups, size=groups), minlength=groups)
        problem = replace(fit.problem, weights=own * times[fit.clusters])
        rows.append(minimise(problem, fit.vector).values)
    return pd.DataFrame(rows, columns=fit.problem.names)[fit.problem.free]


class Interval(NamedTuple):
    """Values that the data do not contradict; an end on a bound of the parameter is not a result of the data."""

    low: float
    high: float
    level: float
    low_on_bound: bool
    high_on_bound: bool

    @property
    def note(self) -> str:
        """Which of its ends are bounds, in words; "" if none is."""
        ends = (("low", self.low_on_bound), ("high", self.high_on_bound))
        return ", ".join(f"{end} end is its bound" for end, on_bound in ends if on_bound)


class LocalMinimumError(RuntimeError):
    """A fit turns out to be no global minimum.

    Attributes
    ----------
    values : dict
        Of all parameters, where the cost is lower.
    """

    def __init__(self, name: str, cost: float, lower: float, values: dict[str, float]) -> None:
        super().__init__(f"{name} = {values[name]:.6g}: the cost is {lower:.6g}, below {cost:.6g} of the fit")
        self.values = values


def profile_end(problem: Problem, values: Floats, cost: float, one: Parameter, step: float, allowed: float) -> float:
    """Return the value of a parameter at which the profiled cost has risen by what is allowed, or its bound.

    Parameters
    ----------
    problem : Problem
    values, cost
        Its minimum.
    one : Parameter
        That the cost is profiled along.
    step : float
        The first step away from the minimum; negative to look for the lower end.
    allowed : float
        Rise of the cost, > 0.

    Raises
    ------
    LocalMinimumError
        If a lower cost appears on the way.
    """
    bound = one.high if step > 0.0 else one.low
    at = float(values[problem.names.index(one.name)])
    known = {at: (-allowed, values)}  # by its value: rise of the cost over what is allowed, all values

    def rise(value: float) -> float:
        if value not in known:
            near = known[min(known, key=lambda other: abs(other - value))][1]
            held = problem.holding({one.name: value})
            found = minimise(held, near)
            if found.cost > cost + allowed:  # where the cost is rough, one start may miss the least
                found = min(found, minimise(held, values), key=lambda minimum: minimum.cost)
            known[value] = found.cost - cost - allowed, found.values
            if found.cost < cost - max(_LOWER * allowed, ROUNDING * cost):
                raise LocalMinimumError(one.name, cost, found.cost, problem.named(found.values))
        return known[value][0]

    inside = at
    while inside != bound:
        outside = min(max(inside + step, one.low), one.high)
        if rise(outside) > 0.0:
            return float(brentq(rise, inside, outside, xtol=_REACH * abs(outside - at), rtol=1e-8))
        inside = outside
        step *= 1.6
    return bound


@dataclass(frozen=True)
class Covariance:
    """What the covariance of any of the parameters follows from.

    Attributes
    ----------
    problem : Problem
    hessian : ndarray, shape (P, P)
        Of the cost, by each parameter's scale.
    variance : ndarray, shape (P, P)
        Of the gradient of the cost, by scales too.
    kind : {"sandwich", "model"}
        How the variance was estimated: see :attr:`sledenv.identification.fitting.Fit.covariance_kind`.
    degrees : int
        Degrees of freedom of that estimate.
    """

    problem: Problem
    hessian: Floats
    variance: Floats
    kind: Literal["sandwich", "model"]
    degrees: int

    def among(self, names: Sequence[str]) -> Floats:
        """Covariance of some parameters, the others held; NaN for those that the data say nothing of."""
        at = [self.problem.names.index(name) for name in names]
        told = [k for k, row in enumerate(at) if self.hessian[row, row] > 0.0]
        found = np.full((len(at), len(at)), np.nan)
        kept = np.ix_([at[k] for k in told], [at[k] for k in told])
        inverse = np.linalg.pinv(self.hessian[kept], hermitian=True)
        scales = np.array([self.problem.parameters[at[k]].scale for k in told])
        found[np.ix_(told, told)] = inverse @ self.variance[kept] @ inverse * np.outer(scales, scales)
        return found

    def widening(self, name: str, names: Sequence[str]) -> float:
        """Factor of chi-squared in twice the rise of the profiled cost (Kent 1982): 1 for normal errors of size 1.

        The cost is profiled along one parameter; ``names`` has it and those that are fitted again on the way.
        """
        if self.kind == "model" and np.trace(self.hessian) > 0.0:
            # One factor for all, however little is told of this one.
            return float(np.trace(self.variance) / np.trace(self.hessian))
        at = [self.problem.names.index(one) for one in names]
        hessian, k = self.hessian[np.ix_(at, at)], names.index(name)
        if not hessian[k, k] > 0.0:
            return 1.0
        bare = np.linalg.pinv(hessian, hermitian=True)[k, k] * self.problem.parameter(name).scale ** 2
        ratio = self.among(names)[k, k] / bare
        return float(ratio) if np.isfinite(ratio) else 1.0


def covariance_at(problem: Problem, values: Floats, clusters: NDArray[np.intp]) -> Covariance:
    """Estimate the covariance at a minimum; ``clusters`` has the number of the recording of each row, shape (N,)."""
    scores, hessian = problem.scores(values)
    fitted = len(problem.free)
    groups = int(clusters.max()) + 1
    if groups >= fitted + 2:
        degrees = groups - fitted
        sums = np.zeros((groups, len(values)))
        np.add.at(sums, clusters, scores)
        sums -= sums.mean(axis=0)  # which is not zero where a parameter is on its bound
        return Covariance(problem, hessian, sums.T @ sums * groups / degrees, "sandwich", degrees)
    tamed = problem.tamed(values)
    degrees = max(tamed.size - fitted, 1)
    return Covariance(problem, hessian, hessian * float(tamed @ tamed) / degrees, "model", degrees)
