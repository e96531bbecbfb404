"""Statistics of a benchmark: what agents earn, how often they fall, what a reference earns, and intervals of all."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.stats import binomtest, bootstrap

from sledenv.benchmark.results import AGENT, PROBLEM, REFERENCE, STATUSES, Results
from sledenv.simulation.records import LOSSES

Interval = tuple[float, float]

MEASURES: Final = ("reward", "falls", "ratio")  # what every table leads with, each with its interval
_RESAMPLES: Final = 2000
_MANY: Final = 3000  # contexts
_SAME: Final = 1e-12  # values that differ by less have nothing to resample


def mean_interval(values: ArrayLike) -> Interval:
    """Return the 95 % interval of a mean.

    Parameters
    ----------
    values : array_like, shape (contexts,) or (seeds, contexts)
        Of at least two contexts.

    Examples
    --------
    >>> low, high = mean_interval([0.1, 0.4, 0.4, 0.7])
    >>> print(f"{low:.2f} to {high:.2f}")
    0.18 to 0.62
    """
    return ratio_interval(values, np.ones(np.shape(values)[-1]))


def ratio_interval(values: ArrayLike, lower: ArrayLike) -> Interval:
    """Return the 95 % interval of the ratio of two means over the same contexts.

    Seeds and contexts are crossed, every seed met the same contexts, and a bootstrap (BCa) resamples both
    independently. Of a single seed only contexts are resampled, which says nothing about another training.

    Parameters
    ----------
    values : array_like, shape (contexts,) or (seeds, contexts)
        Of at least two contexts.
    lower : array_like, shape (contexts,)
        What the mean is divided by; its own is not 0.
    """
    table, base = np.atleast_2d(np.asarray(values, float)), np.asarray(lower, float)
    ratio = float(table.mean() / base.mean())
    if np.ptp(table - ratio * base) <= _SAME:
        return ratio, ratio

    def resampled(*drawn: NDArray[np.intp], axis: int) -> NDArray[np.float64]:
        *seeds, contexts = drawn
        rows = table[seeds[0][..., np.newaxis], contexts[..., np.newaxis, :]].mean(-2) if seeds else table[0, contexts]
        return np.asarray(rows.mean(axis) / base[contexts].mean(axis))

    samples = [np.arange(count) for count in table.shape if count > 1]
    method: Any = "BCa" if base.size <= _MANY else "percentile"  # the first takes the square of the contexts
    options: dict[str, Any] = {"n_resamples": _RESAMPLES, "batch": 500 if base.size <= _MANY else 20, "method": method}
    found = bootstrap(samples, resampled, vectorized=True, rng=np.random.default_rng(0), **options)
    return float(found.confidence_interval.low), float(found.confidence_interval.high)


def share_interval(shares: ArrayLike) -> Interval:
    """Return Wilson's 95 % interval of a mean share, which has a width even if nothing was counted.

    Parameters
    ----------
    shares : array_like, shape (contexts,) or (seeds, contexts)
        In [0, 1]. There are as many trials as contexts: what another draw or training does in a context is no
        independent one.

    Examples
    --------
    >>> low, high = share_interval(np.zeros(200))
    >>> print(f"{low:.1%} to {high:.1%}")
    0.0% to 1.9%
    """
    table = np.asarray(shares, float)
    count = table.shape[-1]
    found = binomtest(round(float(table.mean()) * count), count).proportion_ci(method="wilson")
    return float(found.low), float(found.high)


def told(value: float, ends: Interval, form: str) -> str:
    """Return a number with its interval as text, a dash for NaN; a percent sign stands once."""
    if np.isnan(value):
        return "-"
    low, high = (format(end, f"z{form}").removesuffix("%") for end in ends)
    return f"{value:z{form}} [{low}, {high}]"


def regrets(judged: pd.DataFrame) -> pd.Series[float]:
    """Return 1 - ``reward`` / ``lower`` of each row, 0 where the reference earns nothing: nothing can be lost there."""
    return 1.0 - (judged["reward"] / judged["lower"]).where(judged["lower"] != 0.0, 1.0)


def scores(results: Results) -> pd.DataFrame:
    """Return how well trained agents did in the test contexts.

    Returns
    -------
    DataFrame
        A row for each environment, scenario and agent, most reward of a problem first: numbers of ``seeds`` and
        ``contexts``; means ``reward``, ``falls`` and ``ratio`` to the reference, each with its interval,
        ``reward_low``, ``reward_high`` and so on; shares ``finished`` and ``on_bound``; means ``descents`` and
        ``train_cpu_seconds`` of the training; ``lower``, ``lower_falls`` and ``clairvoyant``, the means of the
        reference. What needs a reference is NaN where there is none.

    Raises
    ------
    ValueError
        If seeds or agents met different contexts of one environment and scenario.
    """
    judged = results.judged[results.judged["stage"] == "trained"]
    met = judged.groupby(PROBLEM)["context"].transform("nunique")
    if (judged.groupby([*AGENT, "seed"])["context"].transform("nunique") != met).any():
        raise ValueError("results: not all seeds and agents met the same contexts")
    rows = [dict(zip(AGENT, key, strict=True)) | _score(group) for key, group in judged.groupby(AGENT)]
    training = results.runs.groupby(AGENT, as_index=False)[["descents", "train_cpu_seconds"]].mean()
    table = pd.DataFrame(rows).merge(training, "left", AGENT)
    table["rides"] = table["environment"] == "descent"
    table = table.sort_values(["rides", "scenario", "reward"], ascending=[True, True, False], ignore_index=True)
    return table.drop(columns="rides")


def _score(group: pd.DataFrame) -> dict[str, Any]:
    """Return what an agent did in a problem."""
    reward, falls, lower = (
        group.pivot(index="seed", columns="context", values=name).to_numpy() for name in ("reward", "tumbled", "lower")
    )
    known = ~np.isnan(lower[0])  # there may be a reference of the first contexts alone
    base, has = lower[0, known], bool(known.any() and lower[0, known].mean() > 0.0)
    ends = {"reward": mean_interval(reward), "falls": share_interval(falls)}
    ends["ratio"] = ratio_interval(reward[:, known], base) if has else (np.nan, np.nan)
    ratio = reward[:, known].mean() / base.mean() if has else np.nan
    means = {"reward": reward.mean(), "falls": falls.mean(), "ratio": ratio}
    row: dict[str, Any] = {"seeds": len(reward), "contexts": reward.shape[1]}
    for name in MEASURES:
        row |= {name: float(means[name]), f"{name}_low": ends[name][0], f"{name}_high": ends[name][1]}
    row |= {"finished": group["finish"].mean(), "on_bound": group["on_bound"].mean()}
    return row | {name: group[name].mean() for name in REFERENCE}


def decomposition(judged: pd.DataFrame) -> pd.DataFrame:
    """Return where the energy supplied to the descents goes, and how they end.

    Returns
    -------
    DataFrame
        A row for each environment, scenario, agent and stage: means over descents of the shares
        of LOSSES (``hysteresis``, ``sliding``, ``rolling``), ``kept`` as motion along the slope at the finish, and
        ``other`` (spin, motion across the slope, height, and motion that never reached the finish), which add up to 1;
        shares of the descents that ``finish``, are ``jammed``, ``tumbled``, or ended in ``another way``.
    """
    supplied = judged["supplied"].where(judged["supplied"] > 0.0)
    shares = judged[[*AGENT, "stage", *STATUSES]].assign(kept=judged["retention"])
    shares = shares.assign(**{name: judged[f"loss_{name}"] / supplied for name in LOSSES})
    shares["other"] = 1.0 - shares[["kept", *LOSSES]].sum(axis=1, skipna=False)
    shares["another way"] = 1.0 - shares[[*STATUSES]].sum(axis=1)
    return shares.groupby([*AGENT, "stage"], as_index=False).mean()
