"""The tables of a benchmark: in Markdown, for the documents of a project, and in the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from sledenv.benchmark.figures import label, title
from sledenv.benchmark.scores import BASELINES, PROBLEM, Results, separation, verdicts
from sledenv.machine import text_tables
from sledenv.simulation.jam import SHOWN
from sledenv.simulation.words import metric_name

if TYPE_CHECKING:
    from rich.table import Table

_CHECKS = {True: "yes", False: "**no**", None: "-"}


def markdown(results: Results, table: pd.DataFrame) -> str:
    """Write the verdict on each scenario, the scores of each agent and what the scenarios ask for as Markdown.

    Parameters
    ----------
    results : Results
        With ``oracle``, or the last table is left out.
    table : DataFrame
        Of :func:`sledenv.benchmark.scores.scores`.

    Returns
    -------
    str
        Three tables under headings of the second level.
    """
    parts = {"Verdict": _verdicts(table), "Scores": _scores(table)}
    if len(results.oracle):
        parts["What the scenarios ask for"] = _separation(results, table)
    return "\n".join(f"## {heading}\n\n{text}" for heading, text in parts.items())


def shown(table: pd.DataFrame) -> Table:
    """Return scores, of :func:`sledenv.benchmark.scores.scores`, for a terminal: least regret of a scenario first."""
    names = "scenario", "agent", "seeds", "reward", "regret, interquartile mean [95 %]", "90th percentile [95 %]"
    rows = []
    for problem, group in table.groupby(PROBLEM, sort=False):
        for row in group.sort_values("regret", kind="stable").itertuples():
            interval = f"{row.regret:z.2%} [{row.regret_low:z.2%}, {row.regret_high:z.2%}]"
            high = f"{row.regret_p90:z.2%} [{row.regret_p90_low:z.2%}, {row.regret_p90_high:z.2%}]"
            numbers = f"{row.seeds}", f"{row.reward:.3f}", interval, high
            rows.append((title(*problem), label(row.agent), *numbers))
    return text_tables.fitted(names, rows, words=2)


def _verdicts(table: pd.DataFrame) -> str:
    names = ["scenario", "best learned agent", "regret, IQM", "regret, p90", "IQM <= 1 %", "p90 <= 4 %"]
    names += [*(f"clear of {_words(name)}" for name in BASELINES), "all scores >= .9 (lowest)"]
    rows = [
        [
            _place(table, row["environment"], row["scenario"]),
            row["agent"],
            f"{row['regret']:.2%}",
            f"{row['regret_p90']:.2%}",
            *(_CHECKS[row[name]] for name in ("small_regret", "small_tail", *(f"clear_of_{n}" for n in BASELINES))),
            f"{_CHECKS[row['good_scores']]} ({row['lowest_score']:.2f})",
        ]
        for row in verdicts(table).to_dict("records")
    ]
    return text_tables.markdown(names, rows)


def _scores(table: pd.DataFrame) -> str:
    names = ["scenario", "agent", "seeds", *(f"mean {metric_name(name)}" for name in SHOWN)]
    names += ["regret, IQM [95 %]", "regret, p90 [95 %]", "score", "on bound", "finished"]
    rows = [
        [
            _place(table, row["environment"], row["scenario"]),
            row["agent"],
            str(row["seeds"]),
            *(f"{row[name]:.3f}" for name in SHOWN),
            f"{row['regret']:.2%} [{row['regret_low']:.2%}, {row['regret_high']:.2%}]",
            f"{row['regret_p90']:.2%} [{row['regret_p90_low']:.2%}, {row['regret_p90_high']:.2%}]",
            f"{row['score']:.3f}",
            f"{row['on_bound']:.1%}",
            f"{row['finished']:.1%}",
        ]
        for row in table.to_dict("records")
    ]
    return text_tables.markdown(names, rows)


def _separation(results: Results, table: pd.DataFrame) -> str:
    fixed = table[table["agent"] == "best_fixed"].set_index(["environment", "scenario"])
    rewards = ("best", *BASELINES, "random_launch", "zero")
    names = [
        "scenario",
        *map(_words, rewards),
        "best there is, from",
        "to",
        "regret of best fixed, IQM",
        "p90",
        "width",
    ]
    rows = []
    for row in separation(results).to_dict("records"):
        if np.isnan([row[name] for name in rewards[1:]]).all():  # no agent there that shows what is asked for
            continue
        key = row["environment"], row["scenario"]
        regret = [float(fixed.loc[key, name]) if key in fixed.index else np.nan for name in ("regret", "regret_p90")]
        numbers = [*(row[name] for name in (*rewards, "low", "high")), *regret, row["width"]]
        rows.append([_place(table, *key), *("-" if np.isnan(number) else f"{number:.3f}" for number in numbers)])
    return text_tables.markdown(names, rows)


def _place(table: pd.DataFrame, environment: str, scenario: str) -> str:
    return f"{scenario}, {environment}" if table["environment"].nunique() > 1 else scenario


def _words(name: str) -> str:
    return name.replace("_", " ")
