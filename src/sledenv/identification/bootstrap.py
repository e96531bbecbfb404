"""How a fit varies between data sets: each is of recordings drawn with replacement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from sledenv.identification.fitting import Fit
from sledenv.identification.minimisation import minimise
from sledenv.simulation.rules import checked_count


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
