"""The way from one start down to a minimum within bounds: scipy does the minimising."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from sledenv.identification.objective import Floats, Problem

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
