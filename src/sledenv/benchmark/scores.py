"""Statistics of a benchmark: regret, scores, their intervals and the verdict; docs/benchmark.md says what they mean."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from sledenv.simulation.jam import SHOWN, DescentJam
from sledenv.simulation.records import LOSSES

PROBLEM: Final = ["environment", "scenario"]
AGENT: Final = [*PROBLEM, "agent"]
# In the order of tables.
AGENTS: Final = ("zero", "random_launch", "best_fixed", "land_flat", "ppo", "sac", "td3", "tqc", "critic")
BASELINES: Final = ("best_fixed", "land_flat")  # what a learned agent has to beat
STATUSES: Final = ("finish", "jammed", "tumbled")
SMALL_REGRET: Final = 0.01  # of the interquartile mean
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
    "oracle": "scenario context action_0 reward low high uniform width",
    "maps": "scenario context reward",
}


class Results(NamedTuple):
    """What a run of the benchmark leaves, one DataFrame a Parquet file; docs/benchmark.md lists the columns."""

    results: pd.DataFrame  # a row each context in which an agent was judged, means over its trials
    curves: pd.DataFrame  # a row each validation during training
    runs: pd.DataFrame  # a row each trained agent
    oracle: pd.DataFrame  # a row each context: its best launch
    maps: pd.DataFrame  # a row each launch of a jam map


class Estimate(NamedTuple):
    """A statistic and what its uncertainty comes from."""

    value: float
    seeds: float  # variance over the choice of seeds, 0 for a single one
    freedom: int  # degrees of freedom of that variance
    contexts: NDArray[np.float64]  # (RESAMPLES,) the statistic over resampled contexts
    sampled: int  # number of contexts


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


def regrets(results: Results) -> pd.DataFrame:
    """Compare trained agents with the best launch of each context, both under the tremble.

    Returns
    -------
    DataFrame
        A row for each environment, scenario, agent, seed and context: ``reward`` and whatever else is in ``SHOWN``,
        ``on_bound`` and ``finished``; ``best`` and ``uniform``, the rewards of the best and of a random launch;
        ``regret``, 1 - reward / best. It is 0 where the best launch earns nothing, because nothing is lost there.

    Raises
    ------
    ValueError
        If a context has no best launch.
    """
    judged = results.results
    table = judged[judged["stage"] == "trained"].rename(columns={"finish": "finished"})
    table = table[[*AGENT, "seed", "context", *SHOWN, "on_bound", "finished"]]
    oracle = results.oracle[["scenario", "context", "reward", "uniform"]].rename(columns={"reward": "best"})
    table = table.merge(oracle, "left", ["scenario", "context"], validate="many_to_one")
    if table["best"].isna().any():
        row = table[table["best"].isna()].iloc[0]
        raise ValueError(f"oracle.parquet has no context {row['context']} of {row['scenario']}")
    most = table["best"].to_numpy()
    shares = np.divide(table["reward"].to_numpy(), most, out=np.ones(len(most)), where=most > 0.0)
    return ordered(table.assign(regret=1.0 - shares))


def iqm(values: NDArray[np.float64]) -> float:
    """Interquartile mean: the mean of the middle half of all values."""
    return float(stats.trim_mean(np.ravel(values), 0.25))


def tail(values: NDArray[np.float64]) -> float:
    """90th percentile of all values: the least that at least nine tenths of them do not exceed."""
    return float(np.quantile(values, 0.9, method="inverted_cdf"))


def estimates(values: NDArray[np.float64]) -> tuple[Estimate, Estimate]:
    """Estimate the interquartile mean and the 90th percentile of values of shape (seeds, contexts).

    Seeds and contexts are crossed: every seed met the same contexts, so the values of a seed share its luck and those
    of a context its difficulty. Each of the two is resampled as a whole while the other stays as it is. Contexts are
    resampled alike in every call, so that two agents can be compared on the same resampled contexts.
    """
    seeds, contexts = values.shape
    rng = np.random.default_rng(_SEED)
    drawn = _draws(rng, contexts)
    over_contexts = _resampled(values, np.ones((RESAMPLES, seeds), np.int64), drawn)
    over_seeds = _resampled(values, _draws(rng, seeds), np.ones_like(drawn)) if seeds > 1 else np.zeros((2, 1))
    middle, high = (
        Estimate(statistic(values), _unbiased(theirs, seeds), seeds - 1, each, contexts)
        for statistic, theirs, each in zip((iqm, tail), over_seeds, over_contexts, strict=True)
    )
    return middle, high


def interval(one: Estimate, other: Estimate | None = None) -> tuple[float, float]:
    """95 % interval of an estimate, or of its difference from another one on the same contexts.

    The variances of seeds and contexts add up; the width is that of a t distribution whose degrees of freedom follow
    from both (Welch and Satterthwaite), since a few seeds say little about their own spread.
    """
    value, contexts, parts = one.value, one.contexts, [(one.seeds, one.freedom)]
    if other is not None:
        value, contexts = value - other.value, contexts - other.contexts
        parts.append((other.seeds, other.freedom))
    parts.append((_unbiased(contexts, one.sampled), one.sampled - 1))
    total = sum(variance for variance, _ in parts)
    if not total > 0.0:
        return value, value
    freedom = total**2 / sum(variance**2 / freedom for variance, freedom in parts if variance > 0.0)
    half = float(stats.t.ppf(0.975, freedom)) * total**0.5
    return value - half, value + half


def scores(results: Results) -> pd.DataFrame:
    """Score every trained agent in every environment and scenario.

    Returns
    -------
    DataFrame
        A row each: ``learned``, whether one of its runs left a learning curve; ``seeds``, ``contexts``, mean ``reward``
        and whatever else is in ``SHOWN``; interquartile mean of the ``regret`` with its interval ``regret_low``,
        ``regret_high``, and the 90th percentile, ``regret_p90``, with its own; the normalised ``score``; shares
        ``on_bound`` and ``finished``; and for each of ``BASELINES`` the difference of the interquartile means,
        ``versus_best_fixed`` and so on with ``_low`` and ``_high``, NaN where the baseline was not judged.

    Raises
    ------
    ValueError
        If seeds or agents met different contexts of one environment and scenario.
    """
    table = regrets(results)
    found: dict[tuple[str, ...], Estimate] = {}
    rows = []
    met: dict[tuple[str, str], pd.Index] = {}
    learned = set(results.curves[AGENT].itertuples(index=False, name=None))
    for key, group in table.groupby(AGENT, sort=False):
        values = group.pivot(index="seed", columns="context", values="regret")
        contexts = met.setdefault(key[:2], values.columns)
        if values.isna().any(axis=None) or not values.columns.equals(contexts):
            raise ValueError(f"{' '.join(key)}: not all of its seeds met the same contexts as other agents")
        found[key], high = estimates(values.to_numpy())
        low, upper = interval(found[key])
        least, most = interval(high)
        rows.append(
            {
                **dict(zip(AGENT, key, strict=True)),
                "learned": key in learned,
                "seeds": len(values),
                "contexts": len(contexts),
                **group[list(SHOWN)].mean(),
                "regret": found[key].value,
                "regret_low": low,
                "regret_high": upper,
                "regret_p90": high.value,
                "regret_p90_low": least,
                "regret_p90_high": most,
                "score": float(_normalised(group["reward"].mean(), group["uniform"].mean(), group["best"].mean())),
                "on_bound": group["on_bound"].mean(),
                "finished": group["finished"].mean(),
            }
        )
    for row in rows:
        environment, scenario, agent = (row[name] for name in AGENT)
        mine = found[environment, scenario, agent]
        for baseline in BASELINES:
            theirs = found.get((environment, scenario, baseline))
            if theirs is None and met[environment, scenario].equals(met.get(("launch", scenario))):
                theirs = found.get(("launch", scenario, baseline))  # it only launches and is judged there
            difference = (np.nan, np.nan, np.nan)
            if theirs is not None and agent != baseline:
                difference = (mine.value - theirs.value, *interval(mine, theirs))
            for suffix, value in zip(("", "_low", "_high"), difference, strict=True):
                row[f"versus_{baseline}{suffix}"] = value
    return pd.DataFrame(rows)


def summary(results: Results) -> pd.DataFrame:
    """Score every agent over all scenarios.

    Returns
    -------
    DataFrame
        A row for each environment and agent: number of ``scenarios``, interquartile mean of the normalised ``score``
        over scenarios and seeds, and its interval ``score_low``, ``score_high``: seeds and contexts are resampled
        within each scenario.
    """
    rows = []
    for (environment, agent), group in regrets(results).groupby(["environment", "agent"], sort=False):
        rng = np.random.default_rng(_SEED)
        values, over_seeds, over_contexts, fewest = [], [], [], np.inf
        for _, pack in group.groupby("scenario"):
            rewards = pack.pivot(index="seed", columns="context", values="reward").to_numpy()
            first = pack.drop_duplicates("context").sort_values("context")
            uniform, best = first["uniform"].to_numpy(), first["best"].to_numpy()
            if best.mean() == uniform.mean():
                continue  # every launch earns the same: nothing to score
            seeds, contexts = rewards.shape
            drawn = _draws(rng, contexts) / contexts
            value = _normalised(rewards.mean(axis=1), uniform.mean(), best.mean())
            values.append(value)
            over_contexts.append(_normalised(rewards @ drawn.T, drawn @ uniform, drawn @ best).T)
            over_seeds.append(value[rng.integers(seeds, size=(RESAMPLES, seeds))])
            fewest = min(fewest, contexts)
        if not values:
            continue
        count = sum(map(len, values))
        freedom = count - len(values)
        spread = stats.trim_mean(np.hstack(over_seeds), 0.25, axis=1)
        # As for one scenario, n seeds lose a degree of freedom each time that they are compared with their own mean.
        variance = float(spread.var(ddof=1)) * count / freedom if freedom else 0.0
        resampled = stats.trim_mean(np.hstack(over_contexts), 0.25, axis=1)
        whole = Estimate(iqm(np.concatenate(values)), variance, freedom, resampled, int(fewest))
        low, high = interval(whole)
        row = {"environment": environment, "agent": agent, "scenarios": len(values), "seeds": count}
        rows.append(row | {"score": whole.value, "score_low": low, "score_high": high})
    columns = ["environment", "agent", "scenarios", "seeds", "score", "score_low", "score_high"]
    table = pd.DataFrame(rows, columns=columns)
    return ordered(table.assign(scenario="")).drop(columns="scenario")


def verdicts(table: pd.DataFrame) -> pd.DataFrame:
    """Say for each environment and scenario whether learning solves it.

    Parameters
    ----------
    table : DataFrame
        Of :func:`scores`.

    Returns
    -------
    DataFrame
        A row for each problem with a learned agent: the ``agent`` of least regret, its ``regret`` and ``regret_p90``;
        whether these are small (``small_regret``, ``small_tail``), whether its interval is clear of each baseline
        (``clear_of_best_fixed``, ...; None where the baseline was not judged), the ``lowest_score`` of the learned
        agents and whether it is good (``good_scores``); and ``passed``, whether all of these hold.
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
            **best[["agent", "regret", "regret_p90"]],
            "lowest_score": lowest,
        }
        checks = {name: None if check is None else bool(check) for name, check in checks.items()}
        rows.append(row | checks | {"passed": all(checks.values())})
    names = [*PROBLEM, "agent", "regret", "regret_p90", "lowest_score", *columns, "passed"]
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
    """Say how far apart a scenario sets doing nothing, chance, one launch for all contexts and the best launch.

    Returns
    -------
    DataFrame
        A row for each environment and scenario: mean rewards ``zero``, ``random_launch``, ``best_fixed`` and
        ``land_flat`` (NaN where not judged) and ``best``; means of ``low`` and ``high``, the interval of the best
        there is, and of ``width``, the share of launches within 1 % of the best.
    """
    table = regrets(results)
    means = table.groupby(AGENT)["reward"].mean().unstack("agent")
    means = means.reindex(columns=["zero", "random_launch", *BASELINES])
    judged = table.drop_duplicates([*PROBLEM, "context"])
    oracle = judged[[*PROBLEM, "context", "best"]].merge(
        results.oracle[["scenario", "context", "low", "high", "width"]], "left", ["scenario", "context"]
    )
    landscape = oracle.drop(columns="context").groupby(PROBLEM).mean()
    return ordered(means.join(landscape).reset_index())


def _draws(rng: np.random.Generator, count: int) -> NDArray[np.int64]:
    """How often each of ``count`` is drawn when as many are drawn with replacement, shape (RESAMPLES, count)."""
    return rng.multinomial(count, np.full(count, 1.0 / count), size=RESAMPLES)


def _resampled(
    values: NDArray[np.float64], seeds: NDArray[np.int64], contexts: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Interquartile mean and 90th percentile where value (i, j) is taken seeds[b, i] * contexts[b, j] times, (2, b)."""
    order = values.ravel().argsort(kind="stable")
    ranked = values.ravel()[order]
    cut = values.size // 4
    found = np.empty((2, len(seeds)))
    for b in range(len(seeds)):
        upto = np.cumsum(np.outer(seeds[b], contexts[b]).ravel()[order])
        kept = np.diff(np.clip(upto, cut, values.size - cut), prepend=cut)
        found[0, b] = kept @ ranked / (values.size - 2 * cut)
        found[1, b] = ranked[np.searchsorted(upto, 0.9 * values.size)]
    return found


def _unbiased(resampled: NDArray[np.float64], count: int) -> float:
    """Variance of a mean-like statistic; resampling n of n understates it by (n - 1) / n."""
    return float(resampled.var(ddof=1)) * count / (count - 1) if count > 1 else 0.0


def _normalised(reward: NDArray[np.float64], uniform: NDArray[np.float64], best: NDArray[np.float64]) -> Any:
    """Place a reward on a scale from a random launch (0) to the best one (1), NaN where they are equal."""
    scale = np.subtract(best, uniform)
    return np.divide(np.subtract(reward, uniform), scale, out=np.full(np.shape(reward), np.nan), where=scale != 0.0)
