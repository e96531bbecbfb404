"""Which contact law predicts impacts that it was not fitted to: held-out errors, what differs clearly, how far off."""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, get_args

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from sledenv.identification.objective import Floats
from sledenv.identification.plausibility import read_rebounds
from sledenv.identification.rebound_fit import ImpactModel
from sledenv.identification.rebounds import Rebounds
from sledenv.simulation.bodies import Body
from sledenv.simulation.rigid_impact import Hypothesis
from sledenv.simulation.rules import checked, checked_count

Predictor = Callable[[Rebounds, Rebounds], Floats]  # fitted to the first, velocities after of the second, (N, 3)

LEVEL: Final = 0.95
COMPONENTS: Final = ("u", "v", "omega")

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
        Root of ``dv' M dv / v0' M v0``, a row for each held-out rebound, indexed by its number, and a column a model.
    recordings : ndarray, shape (rows,)
        Recording of each.
    draws, seed : int
        Of the bootstrap over recordings.
    """

    errors: pd.DataFrame
    recordings: NDArray[np.intp]
    draws: int = _DRAWS
    seed: int = 0

    @property
    def table(self) -> pd.DataFrame:
        """One row a model, the best first: ``mean`` and ``p90`` of its errors, each with the ends of its interval."""
        ranked = self.errors[self.errors.mean().sort_values().index]
        times = self._times()
        found = {}
        for name, errors in ranked.items():
            sample = errors.to_numpy()
            mean = _ends((times @ sample) / times.sum(axis=1), LEVEL)
            tail = _ends(_tails(times, sample), LEVEL)
            found[name] = (sample.mean(), *mean, np.quantile(sample, 0.9), *tail)
        columns = ["mean", "mean_low", "mean_high", "p90", "p90_low", "p90_high"]
        return pd.DataFrame.from_dict(found, orient="index", columns=columns).rename_axis("model")

    def differences(self, reference: str | None = None) -> pd.DataFrame:
        """How much larger the mean error of each model is than that of one of them, on the same rebounds.

        Parameters
        ----------
        reference : str, optional
            The best model by default.

        Returns
        -------
        DataFrame
            One row a model: ``difference``, ``low`` and ``high``, and whether it is ``clear``. The intervals hold
            together at the level .95 (Bonferroni), so that a difference among many is not called clear by chance.

        Raises
        ------
        ValueError
            If there is no such model.
        """
        reference = str(self.errors.mean().idxmin()) if reference is None else reference
        if reference not in self.errors:
            raise ValueError(f"reference = {reference!r}: must be one of {', '.join(self.errors)}")
        others = self.errors.drop(columns=reference)
        paired = others.to_numpy() - self.errors[[reference]].to_numpy()
        times = self._times()
        drawn = (times @ paired) / times.sum(axis=1, keepdims=True)
        low, high = _ends(drawn, 1.0 - (1.0 - LEVEL) / max(others.shape[1], 1))
        found = pd.DataFrame({"difference": paired.mean(axis=0), "low": low, "high": high}, others.columns)
        found["clear"] = (found["low"] > 0.0) | (found["high"] < 0.0)
        return found.sort_values("difference").rename_axis("model")

    def _times(self) -> Floats:
        """How often each row counts in each drawn set of recordings, shape (draws, rows)."""
        groups = int(self.recordings.max()) + 1
        drawn = np.random.default_rng(self.seed).multinomial(groups, np.full(groups, 1.0 / groups), self.draws)
        return drawn[:, self.recordings].astype(float)


@dataclass(frozen=True)
class Bands:
    """How far measured velocities lie from predicted ones, from errors on impacts that a model was not fitted to.

    Attributes
    ----------
    level : float
    low, high : ndarray, shape (3,)
        Ends of the residuals of u, v and omega, in the energy norm and relative to the speed before.
    norm : float
        Length that residuals have at most.
    """

    level: float
    low: Floats
    high: Floats
    norm: float

    def around(self, rebounds: Rebounds, velocities: Floats) -> tuple[Floats, Floats]:
        """Return the ends of the predictive intervals of u, v [m/s] and omega [rad/s], shape (N, 3) each."""
        size = rebounds.speed[:, None] / rebounds.scales
        return velocities - self.high * size, velocities - self.low * size

    def coverage(self, rebounds: Rebounds, velocities: Floats) -> dict[str, float]:
        """Shares of rebounds that lie within: by component, and ``norm`` by the length of their residual."""
        residuals = rebounds.residuals(velocities)
        inside = (residuals >= self.low) & (residuals <= self.high)
        norm = float(np.mean(np.linalg.norm(residuals, axis=1) <= self.norm))
        return {**dict(zip(COMPONENTS, inside.mean(axis=0).tolist(), strict=True)), "norm": norm}


def predictive_bands(
    model: Predictor, rebounds: Rebounds, *, level: float = LEVEL, folds: int = _FOLDS, seed: int = 0
) -> Bands:
    """Return the spread of a model's residuals on parts of the data that it was not fitted to.

    They hold for impacts drawn as those of ``rebounds`` were, on average over them (conformal prediction by
    cross-validation: Barber et al. 2021, Annals of Statistics 49).

    Parameters
    ----------
    model : Predictor
        Such as an :class:`sledenv.identification.rebound_fit.ImpactModel`.
    rebounds : Rebounds
    level : float
        In (0, 1).
    folds, seed : int
        Parts of the data, whole recordings each.

    Returns
    -------
    Bands

    Raises
    ------
    ValueError
        If there are fewer recordings than folds, or fewer rebounds than the level needs.
    """
    level = checked("predictive_bands", "level", level, (lambda v: (v > 0.0) & (v < 1.0), "in (0, 1)"))
    least = math.ceil(2.0 / (1.0 - level)) - 1
    if len(rebounds) < least:
        raise ValueError(f"{len(rebounds)} rebounds: an interval of level {level:g} needs at least {least}")
    residuals = rebounds.residuals(_cross_validated(model, rebounds, folds, seed))
    lengths = np.linalg.norm(residuals, axis=1)
    above = 0.5 * (1.0 - level)
    return Bands(level, _ranked(residuals, above), -_ranked(-residuals, above), -float(_ranked(-lengths, 2.0 * above)))


def compare(
    table: pd.DataFrame | str | os.PathLike[str] | Rebounds,
    body: Body | None = None,
    *,
    gyration_radius: float | None = None,
    models: Mapping[str, Predictor] | None = None,
    predicted: Mapping[str, ArrayLike] | None = None,
    held_out: ArrayLike | None = None,
    folds: int = _FOLDS,
    draws: int = _DRAWS,
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
        Parts of the data.
    draws : int
        Of the bootstrap over recordings.

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
    checked_count("draws", draws)
    held = np.ones(len(rebounds), bool) if held_out is None else np.asarray(held_out, bool)
    if held.shape != (len(rebounds),) or not held.any() or (held_out is not None and held.all()):
        raise ValueError(f"held_out: must be {len(rebounds)} flags, some of them true and some false")
    errors = {}
    for name, model in models.items():
        if held_out is None:
            velocities = _cross_validated(model, rebounds, folds, seed)
        else:
            velocities = model(rebounds.rows(~held), rebounds.rows(held))
        errors[name] = rebounds.rows(held).errors(velocities)
    for name, given in (predicted or {}).items():
        velocities = np.asarray(given, float)
        if velocities.shape != (len(rebounds), 3) or not np.isfinite(velocities).all():
            raise ValueError(f"predicted, {name}: must be finite numbers of the shape ({len(rebounds)}, 3)")
        errors[name] = rebounds.rows(held).errors(velocities[held])
    recordings = np.unique(rebounds.recordings[held], return_inverse=True)[1]
    return Comparison(pd.DataFrame(errors, pd.Index(np.flatnonzero(held), name="row")), recordings, draws, seed)


def _cross_validated(model: Predictor, rebounds: Rebounds, folds: int, seed: int) -> Floats:
    """Velocities after, shape (N, 3), each from a fit to the other folds."""
    velocities = np.empty((len(rebounds), 3))
    for held in _folds(rebounds, folds, seed):
        velocities[held] = model(rebounds.rows(~held), rebounds.rows(held))
    return velocities


def _folds(rebounds: Rebounds, folds: int, seed: int) -> Iterator[NDArray[np.bool_]]:
    recordings = np.unique(rebounds.recordings)
    if not 2 <= folds <= len(recordings):
        raise ValueError(f"folds = {folds}: must be from 2 to the number of recordings, {len(recordings)}")
    for part in np.array_split(np.random.default_rng(seed).permutation(recordings), folds):
        yield np.isin(rebounds.recordings, part)


def _ranked(values: Floats, share: float) -> Floats:
    """Value that a new one lies below with a probability of at most ``share``, as exchangeable ones rank alike."""
    rank = max(math.floor((len(values) + 1) * share), 1)
    found: Floats = np.sort(values, axis=0)[rank - 1]
    return found


def _ends(drawn: Floats, level: float) -> Floats:
    """Ends of the interval that holds a share of drawn values, shape (2, ...)."""
    found: Floats = np.quantile(drawn, [0.5 * (1.0 - level), 0.5 * (1.0 + level)], axis=0)
    return found


def _tails(times: Floats, sample: Floats) -> Floats:
    """90th percentile of each drawn set, shape (draws,)."""
    order = np.argsort(sample)
    below = np.cumsum(times[:, order], axis=1)
    found: Floats = sample[order][np.argmax(below >= 0.9 * below[:, -1:], axis=1)]
    return found
