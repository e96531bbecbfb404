"""Covariance of fitted parameters: curvature of the cost, and how its gradient varies between recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sledenv.identification.objective import Floats, Problem


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
