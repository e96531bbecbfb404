"""The report of a benchmark: one HTML page in plain words, its figures and a table in Markdown."""

from __future__ import annotations

import base64
import io
import json
import math
from collections.abc import Callable, Sequence
from functools import partial
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import pandas as pd
from matplotlib.figure import Figure

from sledenv.benchmark import figures
from sledenv.benchmark.figures import label, title
from sledenv.benchmark.problem import TREMBLE
from sledenv.benchmark.scores import (
    BASELINES,
    GOOD_SCORE,
    LEARNED,
    PROBLEM,
    SMALL_REGRET,
    SMALL_TAIL,
    Results,
    scores,
    separation,
    summary,
    verdicts,
)
from sledenv.benchmark.tables import markdown
from sledenv.files import publish
from sledenv.jam import SHOWN
from sledenv.text import metric_name

PAGE: Final = "index.html"
TABLE: Final = "scores.md"
_DPI: Final = 150
_NONE: Final = "\N{EN DASH}"
_MINUS: Final = "\N{MINUS SIGN}"
_Drawn = tuple[Callable[[Results], Figure | None], str, str]  # what draws a figure, its heading, how to read it
_FIGURES: Final[dict[str, _Drawn]] = {
    "regret": (
        figures.plot_regret,
        "Regret, context by context",
        "Each curve counts the contexts, of all seeds, in which an agent loses at most the share on the horizontal "
        "axis of what the best launch earns. Higher and further left is better. Where a curve meets the left edge it "
        "shows the share of contexts in which the agent is as good as the best launch, or better.",
    ),
    "learning": (
        figures.plot_learning,
        "Learning",
        "Mean reward on the validation contexts while an agent learns: a line is the mean over seeds, the band around "
        "it reaches from the worst seed to the best. The closer a line comes to the dashed level, and the sooner, the "
        "better. Both levels are of the test contexts, so small differences from them mean nothing.",
    ),
    "seconds": (
        partial(figures.plot_learning, against="seconds"),
        "Learning against time",
        "The same against the seconds that the training takes, on the machine and with the number of workers of this "
        "run; time spent on validation is left out.",
    ),
    "maps": (
        figures.plot_maps,
        "Jam maps and choices",
        "Each panel is one context. Colour is the reward of every launch, dark where the sled jams or tumbles; the "
        "star is the best launch found and the other marks are what the agents chose, one a seed. The axes span the "
        "control range, from -1 to 1. A mark off the star but on equal colour costs nothing. Where more than two "
        "things are chosen, the colour is that of the best launch with what the axes say.",
    ),
    "robustness": (
        figures.plot_robustness,
        "Noise of the launch",
        "Mean reward when the launch misses what the agent chose. The horizontal axis is the size of the noise as "
        "a share of half the control range. A line that falls steeply belongs to an agent that aims at narrow "
        "peaks.",
    ),
    "energy": (
        figures.plot_energy,
        "Where the energy goes",
        "Left, how the energy supplied to a descent ends up, right, how the descents end; means over contexts and "
        "seeds, before learning (untrained) and after it. Learning pays where it turns losses into motion along the "
        "slope. The grey rest is spin, motion across the slope, height, and motion that never reached the finish.",
    ),
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
    pictures = {name: _png(figure) for name, (draw, *_) in _FIGURES.items() if (figure := draw(results)) is not None}
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
    parts = [_header(results, table), _verdicts(table), _summary(results), _scores(table)]
    for name, picture in pictures.items():
        _, heading, words = _FIGURES[name]
        data = base64.b64encode(picture).decode()
        parts.append(
            f'<h2 id="{name}">{heading}</h2>\n<figure><img alt="{heading}" src="data:image/png;base64,{data}">'
            f"<figcaption>How to read it: {words}</figcaption></figure>"
        )
    parts += [_separation(results), _provenance(results)]
    page = files("sledenv.benchmark").joinpath("report.html").read_text(encoding="utf-8")
    return page.replace("<!--CONTENT-->", "\n".join(parts))


def _header(results: Results, table: pd.DataFrame) -> str:
    suites = ", ".join(map(str, results.runs["suite"].unique()))
    counts = [
        _count(table["scenario"].nunique(), "scenario"),
        _count(table["agent"].nunique(), "agent"),
        f"up to {_count(int(table['seeds'].max()), 'seed')} each",
        f"{_count(int(table['contexts'].max()), 'held-out context')} a scenario",
    ]
    return f"""<h1>sledenv benchmark{": " + escape(suites) if suites else ""}</h1>
<p class="lead">{"; ".join(counts)}.</p>
<p>An agent looks at a context (slope, friction, launch speed and so on) and chooses how to let the sled go. It earns a
reward between 0 and 1: half for how far the sled gets, half for how much of the energy supplied is left as speed along
the slope. What it loses against the best launch of the same context, found by a dense search, is its <b>regret</b>:
0 % is perfect. The <b>score</b> puts the mean reward on a scale on which a random launch has 0 and the best has 1.
Where every hop is trimmed the reference is still the best launch alone, so regret can be negative and the score can
exceed 1.</p>"""


def _verdicts(table: pd.DataFrame) -> str:
    found = verdicts(table)
    if found.empty:
        return "<h2>Verdict</h2>\n<p>No learned agent was judged, so there is nothing to decide.</p>"
    rows = []
    for row in found.to_dict("records"):
        cells = [
            escape(title(row["environment"], row["scenario"])),
            escape(label(row["agent"])),
            _check(row["small_regret"], _percent(row["regret"])),
            _check(row["small_tail"], _percent(row["regret_p90"])),
            *(_check(row[f"clear_of_{name}"]) for name in BASELINES),
            _check(row["good_scores"], _number(row["lowest_score"])),
            _check(row["passed"]),
        ]
        rows.append((cells, ""))
    names = [
        "scenario",
        "best learned agent",
        f"regret at most {SMALL_REGRET:.0%}",
        f"90th percentile at most {SMALL_TAIL:.0%}",
        *(f"clear of {label(name)}" for name in BASELINES),
        f"all scores at least {GOOD_SCORE:g}",
        "passed",
    ]
    passed = int(found["passed"].sum())
    return f"""<h2>Verdict: learning passes {passed} of {len(found)}</h2>
<p>The best learned agent is the one of {_names(table, LEARNED)} with the least regret. It is clear of another agent if
the whole 95 % interval of the difference of their regrets is on its side. "All scores" is about every learned agent:
the lowest is shown.</p>
{_table(names, rows)}"""


def _summary(results: Results) -> str:
    table = summary(results)
    parts = []
    for environment, group in table.groupby("environment", sort=False):
        rows = [
            (
                [
                    escape(label(row["agent"])),
                    str(row["scenarios"]),
                    str(row["seeds"]),
                    _interval(row["score"], row["score_low"], row["score_high"], _number),
                ],
                _kind(row["agent"]),
            )
            for row in group.sort_values("score", ascending=False, kind="stable").to_dict("records")
        ]
        parts.append(f"<h3>{_environment(environment)}</h3>\n{_table(['agent', 'scenarios', 'runs', 'score'], rows)}")
    return f"""<h2>All scenarios together</h2>
<p>Interquartile mean of the score over all runs (a seed in a scenario is a run): the mean of the middle half, which one
lucky or failed run does not move. In brackets its 95 % interval.</p>
{"".join(parts)}"""


def _scores(table: pd.DataFrame) -> str:
    names = ["agent", "seeds", *(f"mean {metric_name(name)}" for name in SHOWN)]
    names += ["regret, interquartile mean", "regret, 90th percentile"]
    names += ["steady regret, interquartile mean", "steady regret, 90th percentile", "score"]
    names += [f"regret minus that of {label(name)}" for name in BASELINES if (table["agent"] == name).any()]
    names += ["actions on a bound", "finished"]
    parts = []
    for problem, group in table.groupby(PROBLEM, sort=False):
        rows = []
        for row in group.sort_values("regret", kind="stable").to_dict("records"):
            cells = [
                escape(label(row["agent"])),
                str(row["seeds"]),
                *(_number(row[name]) for name in SHOWN),
                _interval(row["regret"], row["regret_low"], row["regret_high"], _percent),
                _percent(row["regret_p90"]),
                *_steady(row),
                _number(row["score"]),
            ]
            cells += [_difference(row, name) for name in BASELINES if (table["agent"] == name).any()]
            cells += [f"{100.0 * row[name]:.1f} %" for name in ("on_bound", "finished")]
            rows.append((cells, _kind(row["agent"])))
        parts.append(f"<h3>{escape(title(*problem))}</h3>\n{_table(names, rows)}")
    alone = table.loc[table["seeds"] == 1, "agent"].unique()
    note = " Agents with one seed have an interval over contexts alone." if len(alone) else ""
    return f"""<h2>Scores</h2>
<p>Least regret first; learned agents in bold. Brackets are 95 % intervals over seeds and contexts. A difference is
coloured where its interval is clear of 0: green for less regret than the other agent, red for more. The steady regret
is that of a launch that misses by a tremble of {math.degrees(TREMBLE[0]):g} degrees and {TREMBLE[1]:g} rad/s, against
the best launch under the same tremble.{note}</p>
{"".join(parts)}"""


def _steady(row: dict[str, Any]) -> list[str]:
    names = ("steady_regret", "steady_regret_low", "steady_regret_high")
    value, low, high = (row[name] for name in names)
    return [_interval(value, low, high, _percent), _percent(row["steady_regret_p90"])]


def _separation(results: Results) -> str:
    table = separation(results)
    rows = []
    for row in table.to_dict("records"):
        cells = [escape(title(row["environment"], row["scenario"]))]
        cells += [_number(row[name]) for name in ("zero", "random_launch", *BASELINES, "best")]
        cells += [_percent(row["width"]), _number(row["step_median"]), _number(row["step_p99"])]
        rows.append((cells, ""))
    names = ["scenario", "zero", "random launch", *map(label, BASELINES), "best launch"]
    names += ["launches within 1 % of the best", "step, median", "step, 99 %"]
    return f"""<h2>What the scenarios ask for</h2>
{_table(names, rows)}
<p>Mean rewards without learning. How to read it: the gap between the best fixed launch and the best launch is what
looking at the context can gain; a scenario without it would not test learning. A step is the change of reward between
neighbouring launches of the search grid: a small median with a large 99 % means plateaus with cliffs.</p>"""


def _provenance(results: Results) -> str:
    judged, runs = results.results, results.runs
    entries = [
        ("suite", _listed(runs["suite"])),
        ("commit", _listed(runs["commit"])),
        ("seeds", ", ".join(map(str, sorted(judged["seed"].unique())))),
        ("extra noise", ", ".join(f"{100.0 * level:g} %" for level in sorted(judged["noise"].unique()))),
        ("judged descents", f"{len(judged):,}"),
    ]
    hashes = judged.drop_duplicates(["scenario", "scenario_hash"]).sort_values(["scenario", "scenario_hash"])
    entries += [(f"hash of {row.scenario}", str(row.scenario_hash)) for row in hashes.itertuples()]
    for versions in sorted(runs["versions"].dropna().unique()):
        known = json.loads(versions)
        entries.append(("versions", ", ".join(f"{name} {known[name]}" for name in sorted(known))))
    listed = "\n".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in entries if value)
    return f"<h2>Where this comes from</h2>\n<dl>\n{listed}\n</dl>\n{_budgets(runs)}"


def _budgets(runs: pd.DataFrame) -> str:
    if runs.empty:
        return ""
    keys = ["environment", "agent"]
    table = runs.assign(environment=pd.Categorical(runs["environment"], ["launch", "descent"])).groupby(
        keys, observed=True
    )
    means = table.agg(runs=("seed", "size"), descents=("descents", "max"), seconds=("train_seconds", "median"))
    rows = [
        (
            [
                _environment(environment),
                escape(label(agent)),
                str(row.runs),
                f"{row.descents:,.0f}",
                f"{row.seconds:,.0f}",
            ],
            "",
        )
        for (environment, agent), row in means.iterrows()
    ]
    names = ["task", "agent", "runs", "training budget, descents", "training time, median [s]"]
    return f"<h3>Training</h3>\n{_table(names, rows)}"


def _environment(environment: str) -> str:
    return "The launch alone" if environment == "launch" else "The launch, and every hop trimmed"


def _kind(agent: str) -> str:
    return "learned" if agent in LEARNED else ""


def _names(table: pd.DataFrame, agents: Sequence[str]) -> str:
    return ", ".join(label(agent) for agent in agents if (table["agent"] == agent).any())


def _count(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def _listed(values: pd.Series) -> str:
    return ", ".join(sorted(map(str, values.dropna().unique())))


def _number(value: float) -> str:
    return _NONE if math.isnan(value) else f"{value:z.3f}".replace("-", _MINUS)


def _percent(value: float) -> str:
    return _NONE if math.isnan(value) else f"{100.0 * value:z.2f} %".replace("-", _MINUS)


def _interval(value: float, low: float, high: float, words: Callable[[float], str]) -> str:
    bounds = ", ".join(words(bound).removesuffix(" %") for bound in (low, high))
    return f"{words(value)} <small>[{bounds}]</small>"


def _difference(row: dict[str, Any], baseline: str) -> str:
    value, low, high = (row[f"versus_{baseline}{suffix}"] for suffix in ("", "_low", "_high"))
    if math.isnan(value):
        return _NONE
    kind = "yes" if high < 0.0 else "no" if low > 0.0 else ""
    return f'<span class="{kind}">{_interval(value, low, high, _percent)}</span>'


def _check(passed: bool | None, value: str = "") -> str:
    if passed is None:
        return "not judged"
    return f'{value} <span class="{"yes" if passed else "no"}">{"yes" if passed else "no"}</span>'.strip()


def _table(names: Sequence[str], rows: Sequence[tuple[Sequence[str], str]]) -> str:
    """Write a table whose cells are HTML already, each row with its class."""
    head = "".join(f"<th>{escape(name)}</th>" for name in names)
    body = "\n".join(f"<tr class='{kind}'>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>" for cells, kind in rows)
    return f'<div class="scroll"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody></table></div>'
