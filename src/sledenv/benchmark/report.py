"""The report of a benchmark: one HTML page in plain words, its figures and a table in Markdown."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import pandas as pd
from matplotlib.figure import Figure

from sledenv.benchmark import figures
from sledenv.benchmark.figures import label, title
from sledenv.benchmark.scores import (
    BASELINES,
    GOOD_SCORE,
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
from sledenv.benchmark.tables import markdown
from sledenv.machine.files import publish
from sledenv.pages.html import filled
from sledenv.simulation.jam import SHOWN
from sledenv.simulation.words import metric_name

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
        baselines={agent: label(agent) for agent in BASELINES},
        present={agent: label(agent) for agent in BASELINES if agent in agents},
        metrics={name: metric_name(name) for name in SHOWN},
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
