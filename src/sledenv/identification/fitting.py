"""Robust least squares within bounds from several starts, and how sure one may be of what is found."""

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

from sledenv.simulation.rules import POSITIVE, checked, checked_choice, checked_count, checked_seed

Floats = NDArray[np.float64]
Loss = Literal["soft_l1", "linear"]

ROUNDING = 1e-9  # of a cost: no rise or fall is told below
AGAIN = 50  # times that a fit goes on from a lower cost at most
_STEP = 6e-6  # of a scale: steps of central differences
_LIMIT = 200  # steps of a minimisation
_TIGHT = 1e-10  # relative changes of cost, parameters and gradient at which a minimisation ends
_REACH = 1e-6  # of a step: how exactly the end of an interval is found
_LOWER = 1e-2  # of the rise that an interval allows: a fall of a cost that is more than unfinished minimisation
_EXACT = 1e-8  # a residual that counts as zero


class Parameter(NamedTuple):
    """A number that may be fitted."""

    name: str
    unit: str  # "" where it has none
    low: float  # bounds
    high: float
    scale: float  # typical size of a change that matters, > 0


class Interval(NamedTuple):
    """Values that the data do not contradict; an end on a bound of the parameter is not a result of the data."""

    low: float
    high: float
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


@dataclass(frozen=True)
class Problem:
    """The sum over rows of ``C^2 (sqrt(1 + |r|^2/C^2) - 1)``, C = ``loss_scale``, which a fit minimises.

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

    Raises
    ------
    TypeError, ValueError
        Naming what is wrong, its value and what is allowed.
    """

    parameters: Sequence[Parameter]
    residuals: Callable[[Floats], Floats]
    fixed: Mapping[str, float] = field(default_factory=dict)
    clusters: NDArray[np.generic] | None = None
    loss: Loss = "soft_l1"
    loss_scale: float = 1.0

    def __post_init__(self) -> None:
        for one in self.parameters:
            if not (np.isfinite(one.low) and one.low < one.high < np.inf):
                raise ValueError(f"{one.name}: bounds [{one.low!r}, {one.high!r}] must be finite and in order")
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

    def holding(self, values: Mapping[str, float]) -> Problem:
        """Return this problem with more parameters fixed."""
        return replace(self, fixed={**self.fixed, **values})

    def values(self, given: Mapping[str, float]) -> Floats:
        """Return the values of all parameters, shape (P,); fixed ones need not be given."""
        for name in self.free:
            self._check(name, given[name], "start")
        return np.array([self.fixed[name] if name in self.fixed else given[name] for name in self.names], float)

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
            rows = rows * np.sqrt(2.0 / (1.0 + self._roots(rows)))[:, None]
        return rows.ravel()

    def cost(self, values: Floats) -> float:
        """Return what is minimised."""
        return 0.5 * float(np.sum(self.tamed(values) ** 2))

    def _roots(self, rows: Floats) -> Floats:
        roots: Floats = np.sqrt(1.0 + np.sum((rows / self.loss_scale) ** 2, axis=1))
        return roots

    def scores(self, values: Floats) -> tuple[Floats, Floats]:
        """Gradient of the cost of each row, (N, P), and Hessian of the cost, (P, P), by each parameter's scale.

        The residuals' second derivatives are left out of the Hessian, as in the method of Gauss and Newton.
        """
        rows = self.rows(values)
        slopes = np.stack([self._slope(values, k) for k in range(len(values))], axis=2)  # (N, K, P)
        along = np.einsum("nk,nkp->np", rows, slopes)
        first, second = np.ones(len(rows)), np.zeros(len(rows))
        if self.loss == "soft_l1":
            roots = self._roots(rows)
            first, second = 1.0 / roots, -1.0 / (self.loss_scale**2 * roots**3)
        hessian = np.einsum("n,nkp,nkq->pq", first, slopes, slopes) + np.einsum("n,np,nq->pq", second, along, along)
        return first[:, None] * along, hessian

    def _slope(self, values: Floats, k: int) -> Floats:
        """Change of the residuals, (N, K), for a change of a parameter by its scale; one-sided at a bound."""
        one = self.parameters[k]
        low, high = values.copy(), values.copy()
        low[k] = max(values[k] - _STEP * one.scale, one.low)
        high[k] = min(values[k] + _STEP * one.scale, one.high)
        slope: Floats = (self.rows(high) - self.rows(low)) * (one.scale / (high[k] - low[k]))
        return slope

    def _check(self, name: str, value: float, what: str) -> None:
        one = self.parameter(name)
        allowed = f"in [{one.low:g}, {one.high:g}]{f' {one.unit}' if one.unit else ''}"
        checked(what, name, value, (lambda v: (v >= one.low) & (v <= one.high), allowed))


class _Minimum(NamedTuple):
    """The end of a minimisation."""

    values: Floats  # of all parameters, shape (P,)
    cost: float
    converged: bool


def _minimise(problem: Problem, values: Floats, limit: int = _LIMIT) -> _Minimum:
    """Minimise from one start, by the dogleg method for boxes: it ends exactly on a bound where it ends there."""
    at = [problem.names.index(name) for name in problem.free]
    values = np.array([problem.fixed.get(one.name, v) for one, v in zip(problem.parameters, values, strict=True)])
    if not at:
        return _Minimum(values, problem.cost(values), True)
    scales = np.array([problem.parameters[k].scale for k in at])
    low, high = np.array([problem.parameters[k][2:4] for k in at]).T

    def whole(scaled: Floats) -> Floats:
        full = values.copy()
        full[at] = np.clip(scaled * scales, low, high)  # which rounding must not leave
        return full

    bounds = low / scales, high / scales
    found = least_squares(
        lambda scaled: problem.tamed(whole(scaled)),
        np.clip(values[at] / scales, *bounds),
        bounds=bounds,
        method="dogbox",
        xtol=_TIGHT,
        ftol=_TIGHT,
        gtol=_TIGHT,
        max_nfev=limit,
    )
    return _Minimum(whole(found.x), float(found.cost), bool(found.status > 0))


class Spread(NamedTuple):
    """The estimate from which covariances and intervals follow."""

    hessian: Floats  # of the cost, shape (P, P), by each parameter's scale
    variance: Floats  # of the gradient of the cost, by scales too
    # "sandwich": from how the gradient varies between recordings, which needs no equal, normal or independent errors
    # within one (White 1982). "model": as if all residuals were independent and alike, where there are hardly more
    # recordings than parameters.
    kind: Literal["sandwich", "model"]
    degrees: int  # of freedom


@dataclass(frozen=True)
class Fit:
    """The least cost that was found.

    Attributes
    ----------
    problem : Problem
    values : dict
        Of all parameters, fixed ones included.
    cost : float
    starts : DataFrame
        One row per start, the best first: ``start_NAME`` and ``end_NAME`` of each fitted parameter, ``cost`` at the end
        and ``converged``.
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
        free = self.problem.free
        return {name: self.values[name] for name in free if self.values[name] in self.problem.parameter(name)[2:4]}

    @cached_property
    def spread(self) -> Spread:
        """Hessian and variance of the gradient at the minimum, and how the variance was estimated."""
        values, fitted = self.vector, len(self.problem.free)
        scores, hessian = self.problem.scores(values)
        given = self.problem.clusters
        clusters = np.arange(len(scores)) if given is None else np.unique(np.asarray(given), return_inverse=True)[1]
        groups = int(clusters.max()) + 1
        if groups >= fitted + 2:
            sums = np.zeros((groups, len(values)))
            np.add.at(sums, clusters, scores)
            sums -= sums.mean(axis=0)  # which is not zero where a parameter is on its bound
            degrees = groups - fitted
            return Spread(hessian, sums.T @ sums * groups / degrees, "sandwich", degrees)
        tamed = self.problem.tamed(values)
        degrees = max(tamed.size - fitted, 1)
        return Spread(hessian, hessian * float(tamed @ tamed) / degrees, "model", degrees)

    def _among(self, names: Sequence[str]) -> Floats:
        """Covariance of some parameters, the others held; NaN for those that the data say nothing of."""
        at = np.array([self.problem.names.index(name) for name in names], int)
        hessian, variance = (of[np.ix_(at, at)] for of in self.spread[:2])
        told = np.flatnonzero(np.diag(hessian) > 0.0)
        kept = np.ix_(told, told)
        scales = np.array([self.problem.parameters[k].scale for k in at[told]])
        inverse = np.linalg.pinv(hessian[kept], hermitian=True)
        found = np.full(hessian.shape, np.nan)
        found[kept] = inverse @ variance[kept] @ inverse * np.outer(scales, scales)
        return found

    def _widening(self, name: str) -> float:
        """Factor of chi-squared in twice the rise of the profiled cost (Kent 1982): 1 for normal errors of size 1."""
        hessian, variance, kind, _ = self.spread
        if kind == "model" and np.trace(hessian) > 0.0:
            return float(np.trace(variance) / np.trace(hessian))  # one for all, however little is told of this one
        names = [other for other in self.problem.free if other == name or other not in self.on_bound]
        at, k = [self.problem.names.index(one) for one in names], names.index(name)
        if not hessian[at[k], at[k]] > 0.0:
            return 1.0
        bare = np.linalg.pinv(hessian[np.ix_(at, at)], hermitian=True)[k, k] * self.problem.parameter(name).scale ** 2
        ratio = float(self._among(names)[k, k] / bare)
        return ratio if np.isfinite(ratio) else 1.0

    @cached_property
    def covariance(self) -> pd.DataFrame:
        """Of the fitted parameters; NaN for one on its bound, or that the data say nothing of."""
        names = self.problem.free
        inner = [name for name in names if name not in self.on_bound]
        found = pd.DataFrame(np.nan, names, names)
        found.loc[inner, inner] = self._among(inner)
        return found

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors of the fitted parameters."""
        variances = np.maximum(np.diag(self.covariance), 0.0)  # rounding may leave less, where the data have no errors
        return dict(zip(self.problem.free, np.sqrt(variances).tolist(), strict=True))

    def held(self, **values: float) -> tuple[float, dict[str, float]]:
        """Return the least cost with some parameters held, and the values of all; the others start from this fit."""
        found = _minimise(self.problem.holding(values), self.vector)
        return found.cost, self.problem.named(found.values)

    def interval(self, name: str) -> Interval:
        """Profile interval of a fitted parameter: where the least cost with it held has not risen too far.

        Its level is 0.95. How far the cost may rise follows from :attr:`spread` and from Student's distribution. On a
        bound the interval is one-sided; it then covers its level or more, as a parameter that is on its bound in truth
        is found on it in about half of all data sets.

        Raises
        ------
        ValueError
            If the parameter is not fitted.
        LocalMinimumError
            If a lower cost appears on the way; :func:`profiled` goes on from there.
        """
        if name not in self.problem.free:
            raise ValueError(f"{name!r} is not fitted: must be one of {', '.join(self.problem.free)}")
        one = self.problem.parameter(name)
        quantile = float(stats.t.ppf(0.975, self.spread.degrees))
        noise = max(_EXACT**2 * len(self.problem.rows(self.vector)), ROUNDING * self.cost)
        allowed = 0.5 * max(quantile**2 * self._widening(name), noise)
        step = self.errors[name] * quantile
        step = step if step > 1e-6 * one.scale else 1e-2 * one.scale  # where it is NaN, too
        low, high = (self._end(one, side * step, allowed) for side in (-1.0, 1.0))
        return Interval(low, high, low <= one.low, high >= one.high)

    def _end(self, one: Parameter, step: float, allowed: float) -> float:
        """Value of a parameter, in the direction of ``step``, at which the profiled cost has risen by what is allowed.

        Its bound, if the cost does not rise so far.
        """
        bound = one.high if step > 0.0 else one.low
        at = self.values[one.name]
        known = {at: (-allowed, self.vector)}  # by its value: rise of the cost over what is allowed, all values

        def rise(value: float) -> float:
            if value not in known:
                held = self.problem.holding({one.name: value})
                found = _minimise(held, known[min(known, key=lambda other: abs(other - value))][1])
                if found.cost > self.cost + allowed:  # where the cost is rough, one start may miss the least
                    found = min(found, _minimise(held, self.vector), key=lambda minimum: minimum.cost)
                known[value] = found.cost - self.cost - allowed, found.values
                if found.cost < self.cost - max(_LOWER * allowed, ROUNDING * self.cost):
                    raise LocalMinimumError(one.name, self.cost, found.cost, self.problem.named(found.values))
            return known[value][0]

        inside = at
        while inside != bound:
            outside = min(max(inside + step, one.low), one.high)
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
        Values of fitted parameters at the first start; others begin in the middle of their bounds.
    starts : int
        How many in all; the others are a Latin hypercube in the bounds.
    seed : int
        Of the hypercube.
    limit : int
        Steps of one minimisation, each with one evaluation of the residuals and one for each fitted parameter.

    Raises
    ------
    ValueError
        If all parameters are fixed, a start is outside its bounds, or residuals are not finite.
    """
    free = [problem.parameter(name) for name in problem.free]
    if not free:
        raise ValueError(f"fixed = {dict(problem.fixed)!r}: must leave a parameter to fit")
    checked_count("starts", starts)
    seed = checked_seed(seed)
    low, high = np.array([one[2:4] for one in free]).T
    first = [(start or {}).get(one.name, 0.5 * (one.low + one.high)) for one in free]
    others = low + (high - low) * stats.qmc.LatinHypercube(len(free), rng=seed).random(starts - 1)
    return _best(problem, [dict(zip(problem.free, begin, strict=True)) for begin in [first, *others.tolist()]], limit)


def _best(
    problem: Problem, starts: Sequence[Mapping[str, float]], limit: int = _LIMIT, known: pd.DataFrame | None = None
) -> Fit:
    """Minimise from each start and return the best fit, also of those that are known."""
    rows = []
    for start in starts:
        found = _minimise(problem, problem.values(start), limit)
        ends = problem.named(found.values)
        row = {f"start_{name}": start[name] for name in problem.free}
        row |= {f"end_{name}": ends[name] for name in problem.free}
        rows.append(row | {"cost": found.cost, "converged": found.converged})
    ranked = pd.concat([pd.DataFrame(rows), known]).sort_values("cost", kind="stable", ignore_index=True)
    best = {name: float(ranked[f"end_{name}"][0]) for name in problem.free}
    return Fit(problem, problem.named(problem.values(best)), float(ranked["cost"][0]), ranked)


def profiled(fit: Fit, names: Sequence[str] | None = None) -> tuple[Fit, dict[str, Interval]]:
    """Return the profile intervals of fitted parameters, of the level 0.95, and the fit that they belong to.

    Where a lower cost appears on the way, a minimisation from there is a further row of ``starts``, and the fit.

    Parameters
    ----------
    fit : Fit
    names : sequence of str, optional
        Of which parameters; all that are fitted by default.

    Raises
    ------
    ValueError
        If lower costs appear again and again, as where nothing near the parameters explains the data.
    """
    for _ in range(AGAIN):
        try:
            return fit, {name: fit.interval(name) for name in (fit.problem.free if names is None else names)}
        except LocalMinimumError as error:
            fit = _best(fit.problem, [error.values], known=fit.starts)
    raise ValueError(
        f"the fit went on from a lower cost {AGAIN} times and found another each time: no such law explains the data"
    )
