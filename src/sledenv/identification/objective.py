"""What a fit minimises, the robust sum of squares of residuals within bounds, and the way down from one start."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sledenv.simulation.rules import POSITIVE, checked, checked_choice

Floats = NDArray[np.float64]
Residuals = Callable[[Floats], Floats]
Loss = Literal["soft_l1", "linear"]

_STEP = 6e-6  # of a scale: steps of central differences
LIMIT = 200  # steps of a minimisation
_TIGHT = 1e-10  # relative changes of cost, parameters and gradient at which a minimisation ends
_NEAR = 1e-2  # of its scale: how near a parameter is to a bound to be tried there


class Minimum(NamedTuple):
    """Where a minimisation ended."""

    values: Floats  # of all parameters, shape (P,)
    cost: float
    evaluations: int
    converged: bool


def minimise(problem: Problem, values: Floats, limit: int = LIMIT) -> Minimum:
    """Minimise from one start; a parameter that ends beside a bound is tried on it."""
    found = _minimise_inside(problem, values, limit)
    beside = {}
    for k, one in enumerate(problem.parameters):
        if one.name in problem.fixed:
            continue
        bound = one.low if found.values[k] - one.low < one.high - found.values[k] else one.high
        if abs(found.values[k] - bound) <= _NEAR * one.scale:
            beside[one.name] = bound
    if not beside:
        return found
    there = _minimise_inside(problem.holding(beside), found.values, limit)
    total = found.evaluations + there.evaluations
    # The minimiser stays inside of the bounds, so that its cost is above that on one by less than its tolerance.
    better = there if there.cost <= found.cost * (1.0 + _TIGHT) + 1e-300 else found
    return better._replace(evaluations=total)


def _minimise_inside(problem: Problem, values: Floats, limit: int) -> Minimum:
    """Minimise from one start by scipy, which stays inside of the bounds."""
    at = [problem.names.index(name) for name in problem.free]
    values = np.array([problem.fixed.get(one.name, v) for one, v in zip(problem.parameters, values, strict=True)])
    if not at:
        return Minimum(values, problem.cost(values), 1, True)
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
    return Minimum(whole(found.x), float(found.cost), evaluations, bool(found.status > 0))


class Parameter(NamedTuple):
    """What may be fitted."""

    name: str
    unit: str  # "" where it has none
    low: float  # bounds
    high: float
    scale: float  # typical size of a change that matters, > 0


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

    def holding(self, values: Mapping[str, float]) -> Problem:
        """Return this problem with more parameters fixed."""
        return replace(self, fixed={**self.fixed, **values})

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
