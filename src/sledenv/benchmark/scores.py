"""Statistics of a benchmark: regret, scores, their intervals and the verdict; docs/benchmark.md says what they mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from sledenv.simulation.jam import DescentJam
from sledenv.simulation.records import LOSSES

Floats = NDArray[np.float64]

PROBLEM: Final = ["environment", "scenario"]
AGENT: Final = [*PROBLEM, "agent"]
# In the order of tables.
AGENTS: Final = (
    *("zero", "random_launch", "best_fixed", "land_flat", "land_parallel"),
    *("ppo", "sac", "tqc", "critic", "ride_critic", "replan", "replan_critic"),
)
# What a learned agent has to beat: fixed or ruled launches, or a rule of rides.
BASELINES_OF: Final = {"launch": ("best_fixed", "land_flat"), "descent": ("land_parallel",)}
BASELINES: Final = tuple(name for names in BASELINES_OF.values() for name in names)
STATUSES: Final = ("finish", "jammed", "tumbled")
LANDSCAPE: Final = ("width", "best_of_16", "best_of_64", "best_of_256")  # of launches, and of rides
MEASURES: Final = ("reward", "regret", "falls")  # what every table leads with, means each with an interval
SMALL_REGRET: Final = 0.01  # of the mean
SMALL_TAIL: Final = 0.04  # of the 90th percentile
GOOD_SCORE: Final = 0.9
RESAMPLES: Final = 1000
_SEED: Final = 0
_COLUMNS: Final = {
    "results": (
        f"environment scenario scenario_hash agent seed stage context {' '.join(STATUSES)} supplied "
        f"{' '.join(f'loss_{name}' for name in LOSSES)} rebounds time action_0 on_bound "
        f"{' '.join(DescentJam._fields)}"
    ),
    "curves": "environment scenario agent seed descents seconds mean_reward",
    "runs": "environment scenario agent seed descents train_seconds commit versions suite",
    "oracle": "environment scenario context action_0 reward low high uniform",
    "maps": "scenario context reward",
}


class Results(NamedTuple):
    """What a run of the benchmark leaves, one DataFrame a Parquet file; docs/benchmark.md lists the columns."""

    results: pd.DataFrame  # a row each context in which an agent was judged, means over its trials
    curves: pd.DataFrame  # a row each validation during training
    runs: pd.DataFrame  # a row each trained agent
    oracle: pd.DataFrame  # a row each context: its best launch or ride
    maps: pd.DataFrame  # a row each launch of a jam map


class Spread(NamedTuple):
    """One thing that an estimate is uncertain by, such as the choice of seeds."""

    variance: float
    freedom: int  # degrees of freedom with which the variance is known


class Estimate(NamedTuple):
    """A statistic and what it is uncertain by, each for itself."""

    value: float
    spreads: Sequence[Spread]

    def interval(self) -> tuple[float, float]:
        """95 % interval.

        The variances add up; the width is that of a t distribution whose degrees of freedom follow from all (Welch and
        Satterthwaite), since a few seeds say little about their own spread.
        """
        variance, factor = self._together()
        half = factor * variance**0.5
        return self.value - half, self.value + half

    def share_interval(self, contexts: int) -> tuple[float, float]:
        """95 % interval of a share (Wilson), which stays in [0, 1] and has a width where nothing was counted, too.

        It is that of as many independent trials as would have the variance of the share (Dean and Pagano 2015), but of
        no more than there were contexts: that none of 200 fell does not say that none falls.
        """
        variance, factor = self._together()
        binomial = self.value * (1.0 - self.value)
        square = factor**2 / (min(contexts, binomial / variance) if variance > 0.0 < binomial else contexts)
        middle, half = self.value + 0.5 * square, (square * binomial + 0.25 * square**2) ** 0.5
        return max((middle - half) / (1.0 + square), 0.0), min((middle + half) / (1.0 + square), 1.0)

    def _together(self) -> tuple[float, float]:
        """Return the variance and how many of its roots make a 95 % interval."""
        total = sum(variance for variance, _ in self.spreads)
        if not total > 0.0:
            return 0.0, float(stats.norm.ppf(0.975))
        freedom = total**2 / sum(variance**2 / freedom for variance, freedom in self.spreads if variance > 0.0)
        return total, float(stats.t.ppf(0.975, freedom))


_NONE: Final = Estimate(np.nan, [])


def read_results(folder: Path) -> Results:
    """Read the Parquet files of a benchmark.

    Parameters
    ----------
    folder : Path
        With ``results.parquet`` and ``oracle.parquet``; where one of the others is missing its table is empty.

    Raises
    ------
    FileNotFoundError
        If the folder holds no results.
    ValueError
        If a file lacks a column or has no rows, or two judged descents are the same.
    """
    tables = {}
    for name, listed in _COLUMNS.items():
        path, columns = folder / f"{name}.parquet", listed.split()
        if path.is_file():
            tables[name] = pd.read_parquet(path)
        elif name in ("results", "oracle"):
            raise FileNotFoundError(f"{folder} holds no results of a benchmark: it has no {path.name}")
        else:
            tables[name] = pd.DataFrame(columns=columns)
        missing = [column for column in columns if column not in tables[name]]
        if missing:
            raise ValueError(f"{path} has no column {missing[0]!r}")
        if name in ("results", "oracle") and tables[name].empty:
            raise ValueError(f"{path} has no rows")
    key = [*AGENT, "seed", "stage", "context"]
    twice = tables["results"].duplicated(key)
    if twice.any():
        row = tables["results"][twice].iloc[0]
        raise ValueError(f"results.parquet has two rows of {', '.join(f'{name} {row[name]}' for name in key)}")
    return Results(**tables)


def rank(agents: pd.Series) -> pd.Series:
    """Return the place of each agent in tables and figures: the known ones first, others by name behind them."""
    return agents.map(lambda agent: f"{AGENTS.index(agent):02d}" if agent in AGENTS else f"~{agent}")


def ordered(table: pd.DataFrame) -> pd.DataFrame:
    """Sort rows by environment (the launch first), scenario and agent."""
    table = table.assign(
        _environment=(table["environment"] != "launch"), _agent=rank(table["agent"]) if "agent" in table else ""
    )
    table = table.sort_values(["_environment", "scenario", "_agent"], kind="stable", ignore_index=True)
    return table.drop(columns=["_environment", "_agent"])


def lost(rewards: Floats, best: Floats) -> Floats:
    """Return the regret, the share of what the best launch earns that is lost; 0 where that earns nothing."""
    shares = np.divide(rewards, best, out=np.ones(np.shape(rewards)), where=np.greater(best, 0.0))
    return np.subtract(1.0, shares)


def regrets(results: Results) -> pd.DataFrame:
    """Compare trained agents with the best launch of each context, under launch noise, or with its best ride.

    Where an agent rides better than the search, its ride is the best one.

    Returns
    -------
    DataFrame
        A row for each environment, scenario, agent, seed and context: ``reward``, ``on_bound``, ``finished`` and
        ``falls``, the shares of its trials that end so; ``best`` and ``uniform``, the rewards of the best and of a
        random launch or ride; ``regret``, 1 - reward / best. It is 0 where the best earns nothing, because nothing is
        lost there.

    Raises
    ------
    ValueError
        If a context has no best launch or ride.
    """
    judged = results.results
    table = judged[judged["stage"] == "trained"].rename(columns={"finish": "finished", "tumbled": "falls"})
    table = table[[*AGENT, "seed", "context", "reward", "on_bound", "finished", "falls"]]
    of = [*PROBLEM, "context"]
    oracle = results.oracle[[*of, "reward", "uniform"]].rename(columns={"reward": "best"})
    table = table.merge(oracle, "left", of, validate="many_to_one")
    if table["best"].isna().any():
        row = table[table["best"].isna()].iloc[0]
        raise ValueError(f"oracle.parquet has no context {row['context']} of {row['environment']} {row['scenario']}")
    ridden = table.groupby(of)["reward"].transform("max").where(table["environment"] == "descent", table["best"])
    table["best"] = np.maximum(table["best"], ridden)
    return ordered(table.assign(regret=lost(table["reward"].to_numpy(), table["best"].to_numpy())))


def mean(values: Floats) -> Estimate:
    """Estimate the mean of values of shape (seeds, contexts).

    Seeds and contexts are crossed: every seed met the same contexts, so the values of a seed share its luck and those
    of a context its difficulty. A bootstrap that resamples one of the two as a whole while the other stays as it is
    has the variance of the mean of its means, which needs no drawing. A single seed says nothing about others.
    """
    return Estimate(float(values.mean()), [_spread(values.mean(axis=1)), _spread(values.mean(axis=0))])


def difference(one: Floats, other: Floats) -> Estimate:
    """Estimate the difference of two means over the same contexts: what is hard for both cancels."""
    apart = one.mean(axis=0) - other.mean(axis=0)
    return Estimate(float(apart.mean()), [_spread(each) for each in (one.mean(axis=1), other.mean(axis=1), apart)])


def tail(values: Floats) -> Estimate:
    """Estimate the 90th percentile of values of shape (seeds, contexts): nine tenths of all do not exceed it.

    Seeds and contexts are resampled as for :func:`mean`, but drawn; that understates a variance by (n - 1) / n.
    """
    rng = np.random.default_rng(_SEED)
    order = values.ravel().argsort(kind="stable")
    ranked, spreads = values.ravel()[order], []
    for axis, count in enumerate(values.shape):
        drawn = rng.multinomial(count, np.full(count, 1.0 / count), size=RESAMPLES if count > 1 else 0)
        tails = np.empty(len(drawn))
        for b, often in enumerate(drawn):  # how often each of them is there
            upto = np.cumsum(np.broadcast_to(often if axis else often[:, np.newaxis], values.shape).ravel()[order])
            tails[b] = ranked[np.searchsorted(upto, 0.9 * values.size)]
        spreads.append(Spread(float(tails.var(ddof=1)) * count / (count - 1) if count > 1 else 0.0, count - 1))
    return Estimate(float(np.quantile(values, 0.9, method="inverted_cdf")), spreads)


def scores(results: Results) -> pd.DataFrame:
    """Score every trained agent in every environment and scenario.

    Returns
    -------
    DataFrame
        A row each: ``learned``, whether one of its runs left a learning curve; ``seeds``, ``contexts``; the means
        ``reward``, ``regret`` and ``falls``, each with its interval, ``reward_low``, ``reward_high`` and so on; the
        90th percentile of the regret, ``regret_p90``, with its own; the normalised ``score``; shares ``on_bound`` and
        ``finished``; and for each of ``BASELINES`` the difference of the mean regrets, ``versus_best_fixed`` and so on
        with ``_low`` and ``_high``, NaN where the baseline was not judged.

    Raises
    ------
    ValueError
        If seeds or agents met different contexts of one environment and scenario.
    """
    judged = _judged(results)
    learned = set(results.curves[AGENT].itertuples(index=False, name=None))
    rows = []
    for key, one in judged.items():
        regret = one.values["regret"]
        row = {**dict(zip(AGENT, key, strict=True)), "learned": key in learned}
        row |= {"seeds": len(regret), "contexts": len(one.contexts)}
        row |= _columns({name: mean(one.values[name]) for name in MEASURES}, len(one.contexts))
        row |= _columns({"regret_p90": tail(regret)})
        row |= {"score": one.score().value, "on_bound": one.on_bound, "finished": one.finished}
        for baseline in BASELINES:
            theirs = judged.get((*key[:2], baseline))
            apart = _NONE
            if theirs is not None and key[2] != baseline and one.contexts.equals(theirs.contexts):
                apart = difference(regret, theirs.values["regret"])
            row |= _columns({f"versus_{baseline}": apart})
        rows.append(row)
    return pd.DataFrame(rows)


def summary(results: Results) -> pd.DataFrame:
    """Score every agent over all scenarios.

    Returns
    -------
    DataFrame
        A row for each environment and agent: number of ``scenarios`` and, over all of them, of ``seeds``; the means
        over scenarios of ``reward``, ``regret``, ``falls`` and the normalised ``score``, each with its interval.
        A scenario in which every launch earns the same has no score.
    """
    groups: dict[tuple[str, str], list[_Judged]] = {}
    for (environment, _, agent), one in _judged(results).items():
        groups.setdefault((environment, agent), []).append(one)
    rows = []
    for (environment, agent), scenarios in groups.items():
        row = {"environment": environment, "agent": agent, "scenarios": len(scenarios)}
        row |= {"seeds": sum(len(one.values["regret"]) for one in scenarios)}
        found = {name: _over([mean(one.values[name]) for one in scenarios]) for name in MEASURES}
        found["score"] = _over([score for one in scenarios if not np.isnan((score := one.score()).value)])
        rows.append(row | _columns(found, sum(len(one.contexts) for one in scenarios)))
    return ordered(pd.DataFrame(rows).assign(scenario="")).drop(columns="scenario")


def verdicts(table: pd.DataFrame) -> pd.DataFrame:
    """Say for each environment and scenario whether learning solves it.

    Parameters
    ----------
    table : DataFrame
        Of :func:`scores`.

    Returns
    -------
    DataFrame
        A row for each problem with a learned agent: the ``agent`` of least mean regret, its ``reward``, ``regret``,
        ``regret_p90`` and ``falls``;
        whether these are small (``small_regret``, ``small_tail``), whether its interval is clear of each baseline
        (``clear_of_best_fixed``, ...; None where the baseline was not judged), the ``lowest_score`` of the learned
        agents and whether it is good (``good_scores``); and ``passed``, whether all of these hold but for baselines of
        the other environment.
    """
    columns = ["small_regret", "small_tail", *(f"clear_of_{name}" for name in BASELINES), "good_scores"]
    rows = []
    for key, group in table[table["learned"]].groupby(PROBLEM, sort=False):
        best = group.loc[group["regret"].idxmin()]
        lowest = group["score"].min(skipna=False)
        checks = {"small_regret": best["regret"] <= SMALL_REGRET, "small_tail": best["regret_p90"] <= SMALL_TAIL}
        for name in BASELINES:
            above = best[f"versus_{name}_high"]
            checks[f"clear_of_{name}"] = None if np.isnan(above) else above < 0.0
        checks["good_scores"] = lowest >= GOOD_SCORE
        row = {
            **dict(zip(PROBLEM, key, strict=True)),
            **best[["agent", *MEASURES, "regret_p90"]],
            "lowest_score": lowest,
        }
        checks = {name: None if check is None else bool(check) for name, check in checks.items()}
        other = {f"clear_of_{name}" for name in BASELINES} - {f"clear_of_{name}" for name in BASELINES_OF[key[0]]}
        passed = all(check for name, check in checks.items() if name not in other)
        rows.append(row | checks | {"passed": passed})
    names = [*PROBLEM, "agent", *MEASURES, "regret_p90", "lowest_score", *columns, "passed"]
    return pd.DataFrame(rows, columns=names).astype(dict.fromkeys(columns, object))


def decomposition(results: Results) -> pd.DataFrame:
    """Say where the energy supplied to the descents goes, and how they end.

    Returns
    -------
    DataFrame
        A row for each environment, scenario, agent and stage: means over descents of the shares
        of LOSSES (``hysteresis``, ``sliding``, ``rolling``), ``kept`` as motion along the slope at the finish, and
        ``other`` (spin, motion across the slope, height, and motion that never reached the finish), which add up to 1;
        shares of the descents that ``finish``, are ``jammed``, ``tumbled``, or ended in ``another way``.
    """
    judged = results.results
    supplied = judged["supplied"].where(judged["supplied"] > 0.0)
    shares = pd.DataFrame({name: judged[f"loss_{name}"] / supplied for name in LOSSES}, index=judged.index)
    shares["kept"] = judged["retention"]
    shares["other"] = 1.0 - shares.sum(axis=1, skipna=False)
    for status in STATUSES:
        shares[status] = judged[status]
    shares["another way"] = 1.0 - judged[list(STATUSES)].sum(axis=1)
    keys = [*AGENT, "stage"]
    means = pd.concat([judged[keys], shares.astype(float)], axis=1).groupby(keys, as_index=False).mean()
    return ordered(means.sort_values("stage", ascending=False, kind="stable"))  # untrained before trained


def separation(results: Results) -> pd.DataFrame:
    """Say how far apart a scenario sets doing nothing, chance, one launch for all contexts, a rule and the best.

    Returns
    -------
    DataFrame
        A row for each environment and scenario: mean rewards ``zero``, ``random_launch`` and of each of ``BASELINES``
        (NaN where not judged) and ``best``; means of ``low`` and ``high``, the interval of the best there is; of
        launches ``width``, the share within 1 % of the best; of rides what the best of 16, 64 and 256 random ones
        earns, ``best_of_16`` and so on.
    """
    table = regrets(results)
    means = table.groupby(AGENT)["reward"].mean().unstack("agent")
    means = means.reindex(columns=["zero", "random_launch", *BASELINES])
    judged = table.drop_duplicates([*PROBLEM, "context"])
    known = ["low", "high", *LANDSCAPE]
    oracle = results.oracle.reindex(columns=[*PROBLEM, "context", *known])
    oracle = judged[[*PROBLEM, "context", "best"]].merge(oracle, "left", [*PROBLEM, "context"])
    return ordered(means.join(oracle.drop(columns="context").groupby(PROBLEM).mean()).reset_index())


class _Judged(NamedTuple):
    """What an agent did in a scenario."""

    contexts: pd.Index
    values: dict[str, Floats]  # of each of MEASURES, shape (seeds, contexts)
    uniform: Floats  # (contexts,) rewards of a random launch
    best: Floats  # and of the best one
    on_bound: float
    finished: float

    def score(self) -> Estimate:
        """Place the mean reward on a scale from a random launch (0) to the best one (1), NaN where they are equal."""
        scale = float((self.best - self.uniform).mean())
        if scale == 0.0:
            return _NONE
        above = self.values["reward"] - self.uniform
        score = float(above.mean()) / scale
        return Estimate(score, mean((above - score * (self.best - self.uniform)) / scale).spreads)  # to first order


def _judged(results: Results) -> dict[tuple[str, str, str], _Judged]:
    """Return what each agent did in each environment and scenario, in the order of tables."""
    found: dict[tuple[str, str, str], _Judged] = {}
    met: dict[tuple[str, str], pd.Index] = {}
    for key, group in regrets(results).groupby(AGENT, sort=False):
        values = group.pivot(index="seed", columns="context", values=list(MEASURES))
        contexts = values["regret"].columns
        if values.isna().any(axis=None) or not contexts.equals(met.setdefault(key[:2], contexts)):
            raise ValueError(f"{' '.join(key)}: not all of its seeds met the same contexts as other agents")
        known = group.drop_duplicates("context").sort_values("context")
        ends = (float(group[name].mean()) for name in ("on_bound", "finished"))
        arrays = {name: values[name].to_numpy(float) for name in MEASURES}
        found[key] = _Judged(contexts, arrays, known["uniform"].to_numpy(), known["best"].to_numpy(), *ends)
    return found


def _columns(found: Mapping[str, Estimate], contexts: int = 0) -> dict[str, float]:
    """Return estimates by their names, each with the ends of its interval; a share is of so many contexts."""
    columns: dict[str, float] = {}
    for name, one in found.items():
        low, high = one.share_interval(contexts) if name == "falls" else one.interval()
        if name in ("reward", "regret", "regret_p90"):  # all lie in [0, 1], and so do their means
            low, high = max(low, 0.0), min(high, 1.0)
        columns |= {name: one.value, f"{name}_low": low, f"{name}_high": high}
    return columns


def _over(found: Sequence[Estimate]) -> Estimate:
    """Return the mean of independent estimates."""
    many = len(found)
    parts = [Spread(variance / many**2, freedom) for one in found for variance, freedom in one.spreads]
    return Estimate(sum(one.value for one in found) / many, parts) if many else _NONE


def _spread(means: Floats) -> Spread:
    """Return how uncertain the mean of so many means is."""
    count = len(means)
    return Spread(float(means.var(ddof=1)) / count if count > 1 else 0.0, count - 1)
