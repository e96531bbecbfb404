"""The report of a benchmark: one HTML page in plain words, its figures, and tables in Markdown and for a terminal."""

from __future__ import annotations

import base64
import io
import json
import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from sledenv.benchmark import figures
from sledenv.benchmark.figures import label, title
from sledenv.benchmark.scores import (
    BASELINES,
    BASELINES_OF,
    GOOD_SCORE,
    LANDSCAPE,
    PROBLEM,
    SMALL_REGRET,
    SMALL_TAIL,
    Results,
    ordered,
    scores,
    separation,
    summary,
    verdicts,
)
from sledenv.machine import text_tables
from sledenv.machine.files import publish
from sledenv.pages.html import filled

if TYPE_CHECKING:
    from rich.table import Table

PAGE: Final = "index.html"
TABLE: Final = "scores.md"
_DPI: Final = 150
_FIGURES: Final[dict[str, Callable[[Results], Figure | None]]] = {
    "regret": figures.plot_regret,
    "learning": figures.plot_learning,
    "seconds": partial(figures.plot_learning, against="seconds"),
    "maps": figures.plot_maps,
    "energy": figures.plot_energy,
}
_CONTENTS: Final = {PAGE, TABLE, *(f"{name}.png" for name in _FIGURES)}
_FORMS = {"reward": ".3f", "regret": "z.2%", "falls": ".1%", "regret_p90": "z.2%"}  # of what leads a table
_LEADING = ("mean reward [95 %]", "mean regret [95 %]", "falls [95 %]", "90th percentile of regret [95 %]")
_SHOWN = 3  # of these in a terminal, which has no room for more
_CHECKS = {True: "yes", False: "**no**", None: "-"}


def write_report(results: Results, folder: Path) -> Path:
    """Write the report of a benchmark and return its page.

    Parameters
    ----------
    results : Results
        Agents, untrained agents, learning curves, jam maps or an environment may be missing; so are then the parts
        that show them.
    folder : Path
        Its place: ``index.html``, which needs no other file, the figures as PNG and ``scores.md``. It is replaced if it
        holds a report. The same results give the same files.

    Raises
    ------
    OSError
        If the place is taken or cannot be written.
    ValueError
        As :func:`sledenv.benchmark.scores.scores`.
    """
    table = scores(results)
    pictures = {name: _png(figure) for name, draw in _FIGURES.items() if (figure := draw(results)) is not None}
    with publish(folder, _CONTENTS) as part:
        (part / PAGE).write_text(_page(results, table, pictures), encoding="utf-8")
        (part / TABLE).write_text(markdown(results, table), encoding="utf-8")
        for name, picture in pictures.items():
            (part / f"{name}.png").write_bytes(picture)
    return folder / PAGE


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
    """Return scores, of :func:`sledenv.benchmark.scores.scores`, for a terminal: most reward of a scenario first."""
    rows = [
        (title(*problem), label(row["agent"]), str(row["seeds"]), *_leading(row)[:_SHOWN])
        for problem, group in table.groupby(PROBLEM, sort=False)
        for row in group.sort_values("reward", ascending=False, kind="stable").to_dict("records")
    ]
    return text_tables.fitted(("scenario", "agent", "seeds", *_LEADING[:_SHOWN]), rows, words=2)


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=_DPI, metadata={"Software": None})
    return buffer.getvalue()


def _page(results: Results, table: pd.DataFrame, pictures: dict[str, bytes]) -> str:
    judged, runs, agents = results.results, results.runs, set(table["agent"])
    hashes = judged[["scenario", "scenario_hash"]].drop_duplicates().sort_values(["scenario", "scenario_hash"])
    return filled(
        "report.html",
        label=label,
        title=title,
        table=table,
        agents=agents,
        learned={agent: label(agent) for agent in dict.fromkeys(table.loc[table["learned"], "agent"])},
        baselines={agent: label(agent) for agent in _baselines(table)},
        landscape=LANDSCAPE,
        present={agent: label(agent) for agent in BASELINES if agent in agents},
        small_regret=SMALL_REGRET,
        small_tail=SMALL_TAIL,
        good_score=GOOD_SCORE,
        verdicts=verdicts(table).to_dict("records"),
        tasks=_grouped(summary(results), "environment"),
        problems=_grouped(table, PROBLEM),
        pictures={name: base64.b64encode(picture).decode() for name, picture in pictures.items()},
        separation=separation(results).to_dict("records"),
        suites=_known(runs["suite"]),
        commits=_known(runs["commit"]),
        seeds=_known(judged["seed"]),
        judged=len(judged),
        hashes=hashes.itertuples(index=False),
        versions=[
            ", ".join(f"{name} {version}" for name, version in sorted(json.loads(text).items()))
            for text in _known(runs["versions"])
        ],
        budgets=_budgets(runs).to_dict("records"),
    )


def _baselines(table: pd.DataFrame) -> list[str]:
    """Return the baselines of the environments in which agents were judged."""
    return [name for environment in table["environment"].unique() for name in BASELINES_OF[environment]]


def _grouped(table: pd.DataFrame, by: str | list[str]) -> list[list[dict[str, Any]]]:
    return [group.to_dict("records") for _, group in table.groupby(by, sort=False)]


def _known(values: pd.Series) -> list[Any]:
    """Return what there is, without what a run does not know: outside a repository its commit is empty."""
    return sorted(value for value in values.dropna().unique() if value != "")


def _budgets(runs: pd.DataFrame) -> pd.DataFrame:
    """Return what training took, a row each environment and agent."""
    groups = runs.groupby(["environment", "agent"], as_index=False)
    means = groups.agg(runs=("seed", "size"), descents=("descents", "max"), seconds=("train_seconds", "median"))
    return ordered(means.assign(scenario=""))


def _leading(row: Mapping[str, Any]) -> list[str]:
    """Return what leads every table, each with its interval, a cell each."""
    cells = []
    for name, form in _FORMS.items():
        low, high = (format(row[f"{name}_{end}"], form).removesuffix("%") for end in ("low", "high"))
        cells.append(f"{row[name]:{form}} [{low}, {high}]")
    return cells


def _verdicts(table: pd.DataFrame) -> str:
    names = ["scenario", "best learned agent", "mean reward", "mean regret", "falls", "90th percentile"]
    names += [f"mean <= {SMALL_REGRET:.0%}", f"90th percentile <= {SMALL_TAIL:.0%}"]
    baselines = _baselines(table)
    names += [*(f"clear of {_words(name)}" for name in baselines), "all scores >= .9 (lowest)"]
    rows = [
        [
            _place(table, row["environment"], row["scenario"]),
            _text(row["agent"]),
            *(format(row[name], form) for name, form in _FORMS.items()),
            *(_CHECKS[row[name]] for name in ("small_regret", "small_tail", *(f"clear_of_{n}" for n in baselines))),
            f"{_CHECKS[row['good_scores']]} ({row['lowest_score']:.2f})",
        ]
        for row in verdicts(table).to_dict("records")
    ]
    return text_tables.markdown(names, rows)


def _scores(table: pd.DataFrame) -> str:
    names = ["scenario", "agent", "seeds", *_LEADING, "score", "on bound", "finished"]
    rows = [
        [
            _place(table, row["environment"], row["scenario"]),
            _text(row["agent"]),
            str(row["seeds"]),
            *_leading(row),
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
    names = ["scenario", *map(_words, rewards), "best there is, from", "to"]
    names += ["regret of best fixed", "its 90th percentile", *map(_words, LANDSCAPE)]
    rows = []
    for row in separation(results).to_dict("records"):
        if np.isnan([row[name] for name in rewards[1:]]).all():  # no agent there that shows what is asked for
            continue
        key = row["environment"], row["scenario"]
        regret = [float(fixed.loc[key, name]) if key in fixed.index else np.nan for name in ("regret", "regret_p90")]
        numbers = [*(row[name] for name in (*rewards, "low", "high")), *regret, *(row[name] for name in LANDSCAPE)]
        rows.append([_place(table, *key), *("-" if np.isnan(number) else f"{number:.3f}" for number in numbers)])
    return text_tables.markdown(names, rows)


def _place(table: pd.DataFrame, environment: str, scenario: str) -> str:
    name = _text(scenario)
    return f"{name}, {environment}" if table["environment"].nunique() > 1 else name


def _text(name: str) -> str:
    """Return a name, which may be anybody's, as Markdown that shows it and does nothing else."""
    return re.sub(r"([\\`*<>&|\[\]])", r"\\\1", " ".join(name.split()))


def _words(name: str) -> str:
    return name.replace("_", " ")
