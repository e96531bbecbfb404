"""The report of a benchmark: one HTML page with tables and figures, the scores as a file and for a terminal."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pandas as pd
from matplotlib.figure import Figure

from sledenv.benchmark.figures import label, plot_energy, plot_learning, plot_regret, title
from sledenv.benchmark.results import PROBLEM, Results
from sledenv.benchmark.scores import MEASURES, told
from sledenv.machine import text_tables
from sledenv.machine.files import publish, write_csv
from sledenv.pages.html import filled

if TYPE_CHECKING:
    from rich.table import Table

PAGE: Final = "index.html"
SCORES: Final = "scores.csv"
_DPI: Final = 150
_FORMS: Final = {"reward": ".3f", "falls": ".1%", "ratio": ".3f"}
_WORDS: Final = {"reward": "mean reward", "falls": "falls", "ratio": "ratio to reference"}


def write_report(results: Results, table: pd.DataFrame, folder: Path) -> Path:
    """Write the report of a benchmark and return its page.

    Parameters
    ----------
    results : Results
        Learning curves, untrained agents, references or an environment may be missing; so are then the parts that
        show them.
    table : DataFrame
        Of :func:`sledenv.benchmark.scores.scores`.
    folder : Path
        Its place: ``index.html``, which needs no other file, and ``scores.csv``, the table. It is replaced if it holds
        a report. The same results give the same files.

    Raises
    ------
    OSError
        If the place is taken or cannot be written.
    """
    runs, figures = results.runs, (plot_learning(results), plot_regret(results), plot_energy(results))
    problems = [(title(*problem), _worded(group), group.iloc[0]) for problem, group in _by_problem(table)]
    hashes = results.judged[["scenario", "scenario_hash"]].drop_duplicates().sort_values("scenario")
    origin = {"suite": runs["suite"], "commit": runs["commit"], "seeds": runs["seed"].astype(str)}
    origin |= {"scenarios": hashes["scenario"] + " (hash " + hashes["scenario_hash"] + ")"}
    origin |= {"versions": runs["versions"].map(_versions)}
    page = filled(
        "report.html",
        table=table,
        problems=problems,
        origin={name: "; ".join(filter(None, values.unique())) for name, values in origin.items()},
        pictures=dict(zip(("learning", "regret", "energy"), map(_embedded, figures), strict=True)),
    )
    with publish(folder, {PAGE, SCORES}) as part:
        (part / PAGE).write_text(page, encoding="utf-8")
        write_csv(part / SCORES, list(table), table.itertuples(index=False, name=None))
    return folder / PAGE


def shown(table: pd.DataFrame) -> Table:
    """Return scores, of :func:`sledenv.benchmark.scores.scores`, for a terminal."""
    groups = [_worded(group).assign(scenario=title(*problem)) for problem, group in _by_problem(table)]
    names = ["scenario", "agent", "seeds", *(name for name in _WORDS.values() if any(name in one for one in groups))]
    rows = pd.concat(groups).reindex(columns=names).fillna("-").to_numpy().tolist()
    return text_tables.fitted(names, rows, words=2)


def _by_problem(table: pd.DataFrame) -> Any:
    return table.groupby(PROBLEM, sort=False)


def _worded(group: pd.DataFrame) -> pd.DataFrame:
    """Return the scores of a problem as text; without a reference there is no ratio to it."""
    named = {"agent": group["agent"].map(label), "seeds": group["seeds"].astype(str)}
    for name in MEASURES:
        if group[name].notna().any():
            ends = zip(group[name], group[f"{name}_low"], group[f"{name}_high"], strict=True)
            named[_WORDS[name]] = [told(value, (low, high), _FORMS[name]) for value, low, high in ends]
    named |= {"finished": group["finished"].map("{:.1%}".format), "on a bound": group["on_bound"].map("{:.1%}".format)}
    named |= {"training descents": group["descents"].map("{:,.0f}".format)}
    return pd.DataFrame(named | {"training CPU [s]": group["train_cpu_seconds"].map("{:,.1f}".format)})


def _versions(text: str) -> str:
    """Return the versions of packages, which a run knows as JSON, in words."""
    return ", ".join(f"{name} {version}" for name, version in sorted(json.loads(text).items()))


def _embedded(figure: Figure | None) -> str | None:
    """Return a figure as a part of a page."""
    if figure is None:
        return None
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=_DPI, metadata={"Software": None})
    return base64.b64encode(buffer.getvalue()).decode()
