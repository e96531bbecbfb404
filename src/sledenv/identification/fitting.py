"""Robust least squares with several starts, and how sure one may be of what it finds: scipy does the minimising."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple, get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import brentq, least_squares

from sledenv.simulation.rules import POSITIVE, checked, checked_choice, checked_count

Floats = NDArray[np.float64]
Residuals = Callable[[Floats], Floats]
Loss = Literal["soft_l1", "linear"]

_LIMIT = 200  # steps of a minimisation
_TIGHT = 1e-10  # relative changes of cost, parameters and gradient at which a minimisation ends
_SAME = 1e-3  # of its scale: values of a parameter that differ by less belong to one minimum
_NEAR = 1e-2  # of its scale: how near a parameter is to a bound to be tried there
_EXACT = 1e-8  # a residual that counts as zero
_REACH = 1e-6  # of a step's scale: how exactly the end of an interval is found
_LOWER = 1e-2  # of the rise that an interval allows: a fall of a cost that is more than unfinished minimisation
_STEP = 6e-6  # of a scale: steps of central differences


class Parameter(NamedTuple):
    """What may be fitted."""

    name: str
    unit: str  # "" where it has none
    low: float  # bounds
    high: float
    scale: float  # typical size of a change that matters, > 0


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


class Interval(NamedTuple):
    """Values that the data do not contradict; an end on a bound of the parameter is not a result of the data."""

    low: float
    high: float
    level: float
    low_on_bound: bool
    high_on_bound: bool


@dataclass(frozen=True)
class Problem:
    """What is minimised: the sum over rows of ``C^2 (sqrt(1 + |r|^2/C^2) - 1)``, C = ``loss_scale``.

    Parameters
    ----------
    parameters : sequence of Parameter
    residuals : callable
        Takes the values of all parameters, shape (P,), and returns finite residuals, shape (N,) or (N, K). The loss
        looks at a row as a whole, so that a row which is an outlier in one number is one in all.
    fixed : mapping, optional
        Values of parameters that are not fitted.
    clusters : array_like of shape (N,), optional
        Which recording each row is of: rows of one may be dependent. Each row by itself by default.
    loss : {"soft_l1", "linear"}
        Of a row: smooth, from square to absolute value, or least squares, ``|r|^2/2``.
    loss_scale : float
        Length of a row of residuals from which on it counts as large, > 0, in the unit of residuals.
    weights : array_like of shape (N,), optional
        How often each row counts.

    Raises
    ------
    TypeError, ValueError
        Naming what is wrong, its value and what is allowed.
    """

    parameters: Sequence[Parameter]
    residuals: Residuals
    fixed: Mapping[str, float] = field(default_factory=dict)
    clusters: NDArray[np.generic] | None = None
    loss: Loss = "soft_l1"
    loss_scale: float = 1.0
    weights: Floats | None = None

    def __post_init__(self) -> None:
        for one in self.parameters:
            if not (np.isfinite(one.low) and one.low < one.high < np.inf):
                raise ValueError(f"{one.name}: bounds [{one.low!r}, {one.high!r}] must be finite and in order")
            checked(one.name, "scale", one.scale, POSITIVE)
        for name, value in self.fixed.items():
            self._check(name, value, "fixed")
        checked_choice("loss", self.loss, get_args(Loss))
        checked("Problem", "loss_scale", self.loss_scale, POSITIVE)

    @property
    def names(self) -> list[str]:
        """Of all parameters, in order."""
        return [one.name for one in self.parameters]

    @property
    def free(self) -> list[str]:
        """Names of the parameters that are fitted."""
        return [name for name in self.names if name not in self.fixed]

    def parameter(self, name: str) -> Parameter:
        """Return the parameter of a name, or raise ValueError."""
        for one in self.parameters:
            if one.name == name:
                return one
        raise ValueError(f"{name!r} is no parameter: must be one of {', '.join(self.names)}")

    def values(self, given: Mapping[str, float]) -> Floats:
        """Return the values of all parameters, shape (P,); fixed ones need not be given."""
        missing = [name for name in self.free if name not in given]
        if missing:
            raise ValueError(f"start: there is no value of {missing[0]}")
        for name in self.free:
            self._check(name, given[name], "start")
        return np.array([self.fixed.get(name, given.get(name, 0.0)) for name in self.names], float)

    def named(self, values: Floats) -> dict[str, float]:
        """Return the values of all parameters by name."""
        return dict(zip(self.names, values.tolist(), strict=True))

    def rows(self, values: Floats) -> Floats:
        """Residuals, shape (N, K)."""
        found = np.asarray(self.residuals(values), float)
        found = found.reshape(len(found), -1)
        if not np.isfinite(found).all():
            row = int(np.argmin(np.isfinite(found).all(axis=1)))
            raise ValueError(f"residuals of row {row} are {found[row]} at {self.named(values)}")
        return found

    def tamed(self, values: Floats) -> Floats:
        """Residuals of which half the sum of squares is the cost, shape (N K,)."""
        rows = self.rows(values)
        if self.loss == "soft_l1":
            rows = rows * np.sqrt(2.0 / (1.0 + np.sqrt(1.0 + self._squares(rows))))[:, None]
        if self.weights is not None:
            rows = rows * np.sqrt(self.weights)[:, None]
        return rows.ravel()

    def cost(self, values: Floats) -> float:
        """Return what is minimised."""
        return 0.5 * float(np.sum(self.tamed(values) ** 2))

    def _squares(self, rows: Floats) -> Floats:
        squares: Floats = np.sum((rows / self.loss_scale) ** 2, axis=1)
        return squares

    def scores(self, values: Floats) -> tuple[Floats, Floats]:
        """Gradient of the cost of each row, (N, P), and Hessian of the cost, (P, P), by each parameter's scale.

        The residuals' second derivatives are left out of the Hessian, as in the method of Gauss and Newton.
        """
        rows = self.rows(values)
        slopes = np.stack([self._slope(values, k) for k in range(len(values))], axis=2)  # (N, K, P)
        along = np.einsum("nk,nkp->np", rows, slopes)
        weights = np.ones(len(rows)) if self.weights is None else self.weights
        first, second = np.ones(len(rows)), np.zeros(len(rows))
        if self.loss == "soft_l1":
            root = np.sqrt(1.0 + self._squares(rows))
            first, second = 1.0 / root, -1.0 / (self.loss_scale**2 * root**3)
        hessian = np.einsum("n,nkp,nkq->pq", weights * first, slopes, slopes)
        hessian += np.einsum("n,np,nq->pq", weights * second, along, along)
        return (weights * first)[:, None] * along, hessian

    def _slope(self, values: Floats, k: int) -> Floats:
        """Change of the residuals, (N, K), for a change of a parameter by its scale; one-sided at a bound."""
        one = self.parameters[k]
        low, high = (values.copy() for _ in range(2))
        low[k] = max(values[k] - _STEP * one.scale, one.low)
        high[k] = min(values[k] + _STEP * one.scale, one.high)
        slope: Floats = (self.rows(high) - self.rows(low)) * (one.scale / (high[k] - low[k]))
        return slope

    def _check(self, name: str, value: float, what: str) -> None:
        one = self.parameter(name)
        unit = f" {one.unit}" if one.unit else ""
        allowed = f"in [{one.low:g}, {one.high:g}]{unit}"
        checked(what, name, value, (lambda v: (v >= one.low) & (v <= one.high), allowed))


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
    def _spread(self) -> tuple[Floats, Floats, str]:
        """Hessian and variance of the gradient, (P, P) each, by scales, and how the latter was estimated."""
        scores, hessian = self.problem.scores(self.vector)
        fitted = len(self.problem.free)
        groups = int(self.clusters.max()) + 1
        if groups >= fitted + 2:
            sums = np.zeros((groups, len(self.values)))
            np.add.at(sums, self.clusters, scores)
            sums -= sums.mean(axis=0)  # which is not zero where a parameter is on its bound
            return hessian, sums.T @ sums * groups / (groups - fitted), "sandwich"
        rows = self.problem.rows(self.vector)
        tamed = self.problem.tamed(self.vector)
        return hessian, hessian * float(tamed @ tamed) / max(rows.size - fitted, 1), "model"

    @property
    def covariance_kind(self) -> str:
        """How the covariance was estimated.

        "sandwich": from how the gradient varies between recordings, which needs no equal, normal or independent errors
        within one (White 1982). "model": ``(J'J)^-1`` times the variance of residuals, as if all were independent and
        alike, where there are hardly more recordings than parameters.
        """
        return self._spread[2]

    @property
    def degrees(self) -> int:
        """Degrees of freedom of that estimate."""
        groups = int(self.clusters.max()) + 1
        fitted = len(self.problem.free)
        count = groups if self.covariance_kind == "sandwich" else self.problem.rows(self.vector).size
        return max(count - fitted, 1)

    @cached_property
    def covariance(self) -> pd.DataFrame:
        """Of the fitted parameters; NaN for one on its bound, or that the data say nothing of."""
        names = self.problem.free
        inner = [name for name in names if name not in self.on_bound]
        found = pd.DataFrame(np.nan, names, names)
        found.loc[inner, inner] = self._covariance(inner)
        return found

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors of the fitted parameters."""
        variances = np.maximum(np.diag(self.covariance), 0.0)  # rounding may leave less, where the data have no errors
        return dict(zip(self.problem.free, np.sqrt(variances).tolist(), strict=True))

    def _covariance(self, names: list[str]) -> Floats:
        """Covariance of some parameters, the others held."""
        at = [self.problem.names.index(name) for name in names]
        hessian, middle, _ = self._spread
        told = [k for k, row in enumerate(at) if hessian[row, row] > 0.0]
        found = np.full((len(at), len(at)), np.nan)
        kept = np.ix_([at[k] for k in told], [at[k] for k in told])
        inverse = np.linalg.pinv(hessian[kept], hermitian=True)
        scales = np.array([self.problem.parameters[at[k]].scale for k in told])
        found[np.ix_(told, told)] = inverse @ middle[kept] @ inverse * np.outer(scales, scales)
        return found

    def _widening(self, name: str) -> float:
        """Factor of chi-squared in twice the rise of the profiled cost (Kent 1982): 1 for normal errors of size 1."""
        hessian, middle, kind = self._spread
        if kind == "model" and np.trace(hessian) > 0.0:  # one factor for all, however little is told of this one
            return float(np.trace(middle) / np.trace(hessian))
        names = [one for one in self.problem.free if one == name or one not in self.on_bound]
        at = [self.problem.names.index(one) for one in names]
        hessian, k = self._spread[0][np.ix_(at, at)], names.index(name)
        if not hessian[k, k] > 0.0:
            return 1.0
        bare = np.linalg.pinv(hessian, hermitian=True)[k, k] * self.problem.parameter(name).scale ** 2
        ratio = self._covariance(names)[k, k] / bare
        return float(ratio) if np.isfinite(ratio) else 1.0

    def held(self, **values: float) -> tuple[float, dict[str, float]]:
        """Return the least cost with some parameters held, and the values of all; the others start from this fit."""
        problem = replace(self.problem, fixed={**self.problem.fixed, **values})
        found = _descend(problem, problem.values(self.values))
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
        allowed = 0.5 * max(quantile * self._widening(name), noise)
        step = self.errors[name] * np.sqrt(quantile)
        step = float(step) if step > 1e-6 * one.scale else 1e-2 * one.scale
        low, high = (self._end_of(one, side, step, allowed) for side in (-1.0, 1.0))
        return Interval(low, high, level, low <= one.low, high >= one.high)

    def _end_of(self, one: Parameter, side: float, step: float, allowed: float) -> float:
        """Where the profiled cost has risen by what is allowed, on one side, or the bound."""
        bound = one.high if side > 0.0 else one.low
        at = self.values[one.name]
        known = {at: (-allowed, self.vector)}  # by its value: rise of the cost over what is allowed, all values

        def rise(value: float) -> float:
            if value not in known:
                near = known[min(known, key=lambda other: abs(other - value))][1]
                problem = replace(self.problem, fixed={**self.problem.fixed, one.name: value})
                found = _descend(problem, near)
                if found.cost > self.cost + allowed:  # where the cost is rough, one start may miss the least
                    found = min(found, _descend(problem, self.vector), key=lambda descended: descended.cost)
                known[value] = found.cost - self.cost - allowed, found.values
                if found.cost < self.cost - _LOWER * allowed:
                    raise LocalMinimumError(one.name, self.cost, found.cost, self.problem.named(found.values))
            return known[value][0]

        inside = at
        while inside != bound:
            outside = side * min(side * (inside + side * step), side * bound)
            if rise(outside) > 0.0:
                return float(brentq(rise, inside, outside, xtol=_REACH * abs(outside - at), rtol=1e-8))
            inside = outside
            step *= 1.6
        return bound


def solve(
    problem: Problem, start: Mapping[str, float] | None = None, *, starts: int = 16, seed: int = 0, limit: int = _LIMIT
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
    free = [problem.parameter(name) for name in problem.free]
    low, high = np.array([(one.low, one.high) for one in free]).T
    first = 0.5 * (low + high) if start is None else np.array([start.get(one.name, np.nan) for one in free])
    others = low + (high - low) * stats.qmc.LatinHypercube(len(free), rng=seed).random(starts - 1)
    rows = [_row(problem, dict(zip(problem.free, begin.tolist(), strict=True)), limit) for begin in [first, *others]]
    return _best(problem, pd.DataFrame(rows))


def _row(problem: Problem, start: Mapping[str, float], limit: int = _LIMIT) -> dict[str, float]:
    """Row of the table of starts of a minimisation."""
    found = _descend(problem, problem.values(start), limit)
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
        rows.append(_descend(problem, fit.vector).values)
    return pd.DataFrame(rows, columns=fit.problem.names)[fit.problem.free]


class _Descended(NamedTuple):
    values: Floats  # of all parameters, shape (P,)
    cost: float
    evaluations: int
    converged: bool


def _descend(problem: Problem, values: Floats, limit: int = _LIMIT) -> _Descended:
    """Minimise from one start; a parameter that ends beside a bound is tried on it."""
    found = _minimise(problem, values, limit)
    beside = {}
    for k, one in enumerate(problem.parameters):
        if one.name in problem.fixed:
            continue
        bound = one.low if found.values[k] - one.low < one.high - found.values[k] else one.high
        if abs(found.values[k] - bound) <= _NEAR * one.scale:
            beside[one.name] = bound
    if not beside:
        return found
    there = _minimise(replace(problem, fixed={**problem.fixed, **beside}), found.values, limit)
    total = found.evaluations + there.evaluations
    # The minimiser stays inside of the bounds, so that its cost is above that on one by less than its tolerance.
    better = there if there.cost <= found.cost * (1.0 + _TIGHT) + 1e-300 else found
    return better._replace(evaluations=total)


def _minimise(problem: Problem, values: Floats, limit: int) -> _Descended:
    at = [problem.names.index(name) for name in problem.free]
    values = np.array([problem.fixed.get(one.name, v) for one, v in zip(problem.parameters, values, strict=True)])
    if not at:
        return _Descended(values, problem.cost(values), 1, True)
    scales = np.array([problem.parameters[k].scale for k in at])
    low, high = np.array([problem.parameters[k][2:4] for k in at]).T
    evaluations = 0

    def whole(scaled: Floats) -> Floats:
        # Rounding must not leave the bounds.
        full = values.copy()
        full[at] = np.clip(scaled * scales, low, high)
        return full

    def residuals(scaled: Floats) -> Floats:
        nonlocal evaluations
        evaluations += 1
        return problem.tamed(whole(scaled))

    bounds = low / scales, high / scales
    begin = np.clip(values[at] / scales, *bounds)
    found = least_squares(residuals, begin, bounds=bounds, xtol=_TIGHT, ftol=_TIGHT, gtol=_TIGHT, max_nfev=limit)
    return _Descended(whole(found.x), float(found.cost), evaluations, bool(found.status > 0))
