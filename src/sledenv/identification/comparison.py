"""Which contact law predicts impacts that it was not fitted to: held-out errors, and which differences are clear."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import get_args

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from sledenv.identification.fitting import Floats
from sledenv.identification.law import ImpactModel
from sledenv.identification.plausibility import read_rebounds
from sledenv.identification.rebounds import Rebounds
from sledenv.simulation.bodies import Body
from sledenv.simulation.rigid_impact import Hypothesis

Predictor = Callable[[Rebounds, Rebounds], Floats]  # fitted to the first, velocities after of the second, (N, 3)

_LEVEL = 0.95
_FOLDS = 10
_DRAWS = 4000


def impact_models(reference_speed: float = 1.0) -> dict[str, ImpactModel]:
    """Return the models that are compared: each hypothesis with and without rolling resistance, and softening.

    Parameters
    ----------
    reference_speed : float
        Approach speed [m/s] of those whose restitution depends on it.
    """
    smooth = {"rolling_arm": 0.0, "corner_rolling_arm": 0.0}
    models = {}
    for hypothesis, rolling in itertools.product(get_args(Hypothesis), (False, True)):
        name = f"{hypothesis}, rolling" if rolling else hypothesis
        models[name] = ImpactModel(hypothesis, {**({} if rolling else smooth), "softening": 0.0})
    models["energetic, speed"] = ImpactModel("energetic", smooth, reference_speed)
    models["energetic, rolling, speed"] = ImpactModel("energetic", {}, reference_speed)
    return models


@dataclass(frozen=True)
class Comparison:
    """Errors of several models on impacts that none of them was fitted to.

    Attributes
    ----------
    errors : DataFrame
        Root of ``dv' M dv / v0' M v0``, a row per held-out rebound, indexed by its number, and a column per
        model.
    recordings : ndarray, shape (rows,)
        Recording of each.
    seed : int
        Of the bootstrap over recordings.
    """

    errors: pd.DataFrame
    recordings: NDArray[np.intp]
    seed: int = 0

    @property
    def table(self) -> pd.DataFrame:
        """One row per model, the best first: ``mean`` and ``p90`` of its errors, each with the ends of its interval."""
        ranked = self.errors[self.errors.mean().sort_values().index]
        times = self._times()
        found = {}
        for name, errors in ranked.items():
            sample = errors.to_numpy()
            mean = _ends((times @ sample) / times.sum(axis=1), _LEVEL)
            drawn = np.broadcast_to(sample, times.shape)
            tail = _ends(np.quantile(drawn, 0.9, axis=1, weights=times, method="inverted_cdf"), _LEVEL)
            found[name] = (sample.mean(), *mean, np.quantile(sample, 0.9), *tail)
        columns = ["mean", "mean_low", "mean_high", "p90", "p90_low", "p90_high"]
        return pd.DataFrame.from_dict(found, orient="index", columns=columns).rename_axis("model")

    def differences(self) -> pd.DataFrame:
        """Compare the mean error of each model with that of the best one, on the same rebounds.

        Returns
        -------
        DataFrame
            One row per model: ``difference``, ``low`` and ``high``, and whether it is ``clear``. The intervals hold
            together at the level 0.95 (Bonferroni), so that a difference among many is not called clear by chance.
        """
        reference = str(self.errors.mean().idxmin())
        others = self.errors.drop(columns=reference)
        paired = others.to_numpy() - self.errors[[reference]].to_numpy()
        times = self._times()
        drawn = (times @ paired) / times.sum(axis=1, keepdims=True)
        low, high = _ends(drawn, 1.0 - (1.0 - _LEVEL) / max(others.shape[1], 1))
        found = pd.DataFrame({"difference": paired.mean(axis=0), "low": low, "high": high}, others.columns)
        found["clear"] = (found["low"] > 0.0) | (found["high"] < 0.0)
        return found.sort_values("difference").rename_axis("model")

    def _times(self) -> Floats:
        """Number of times that each row counts in each drawn set of recordings, shape (draws, rows)."""
        groups = int(self.recordings.max()) + 1
        drawn = np.random.default_rng(self.seed).multinomial(groups, np.full(groups, 1.0 / groups), _DRAWS)
        return drawn[:, self.recordings].astype(float)


def compare(
    table: pd.DataFrame | str | os.PathLike[str] | Rebounds,
    body: Body | None = None,
    *,
    gyration_radius: float | None = None,
    models: Mapping[str, Predictor] | None = None,
    predicted: Mapping[str, ArrayLike] | None = None,
    held_out: ArrayLike | None = None,
    folds: int = _FOLDS,
    seed: int = 0,
) -> Comparison:
    """Compare contact laws by their errors on rebounds that they were not fitted to.

    Parameters
    ----------
    table, body, gyration_radius
        As for :func:`sledenv.identify`, or rebounds that have been read already.
    models : mapping, optional
        By name; those of :func:`impact_models` by default.
    predicted : mapping, optional
        Velocities after that other models have predicted, shape (N, 3) each.
    held_out : array_like of bool, shape (N,), optional
        Rebounds that no model is fitted to. Without it each is held out once, with its recording, in one of the folds.
    folds, seed : int
        Parts of the data; of these parts, and of the bootstrap over recordings.

    Returns
    -------
    Comparison

    Raises
    ------
    TypeError, ValueError
        Naming what is wrong, its value and what is allowed.
    """
    rebounds = table if isinstance(table, Rebounds) else read_rebounds(table, body, gyration_radius=gyration_radius)
    if models is None:
        models = impact_models(float(np.median(rebounds.approach)))
    held = np.ones(len(rebounds), bool) if held_out is None else np.asarray(held_out, bool)
    if held.shape != (len(rebounds),) or not held.any() or (held_out is not None and held.all()):
        raise ValueError(f"held_out: must be {len(rebounds)} flags, some of them true and some false")
    parts = list(_folds(rebounds, folds, seed)) if held_out is None else [held]
    errors = {}
    for name, model in models.items():
        velocities = np.zeros((len(rebounds), 3))
        for part in parts:
            velocities[part] = model(rebounds.rows(~part), rebounds.rows(part))
        errors[name] = rebounds.errors(velocities)[held]
    for name, given in (predicted or {}).items():
        velocities = np.asarray(given, float)
        if velocities.shape != (len(rebounds), 3) or not np.isfinite(velocities).all():
            raise ValueError(f"predicted, {name}: must be finite numbers of the shape ({len(rebounds)}, 3)")
        errors[name] = rebounds.errors(velocities)[held]
    recordings = np.unique(rebounds.recordings[held], return_inverse=True)[1]
    return Comparison(pd.DataFrame(errors, pd.Index(np.flatnonzero(held), name="row")), recordings, seed)


def _folds(rebounds: Rebounds, folds: int, seed: int) -> Iterator[NDArray[np.bool_]]:
    recordings = np.unique(rebounds.recordings)
    if not 2 <= folds <= len(recordings):
        raise ValueError(f"folds = {folds}: must be from 2 to the number of recordings, {len(recordings)}")
    for part in np.array_split(np.random.default_rng(seed).permutation(recordings), folds):
        yield np.isin(rebounds.recordings, part)


def _ends(drawn: Floats, level: float) -> Floats:
    """Ends of the interval that holds a share of drawn values, shape (2, ...)."""
    found: Floats = np.quantile(drawn, [0.5 * (1.0 - level), 0.5 * (1.0 + level)], axis=0)
    return found
