"""Commands of the benchmark: the rewards of a context as a map, and suites of agents."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from sledenv.command.arguments import File, Folder, Json, Ray, ScenarioName, Seed, Seeds, SuiteName, Workers
from sledenv.command.running import DPI, progress, resumable, taken, tell, working


def draw_map(
    scenario: ScenarioName,
    /,
    *,
    seed: Seed = 0,
    runs: Annotated[tuple[Path, ...], Parameter(name="--run", metavar="RUN")] = (),
    out: File | None = None,
    html: File | None = None,
    seeds: Seeds | None = None,
    json: Json = False,
) -> None:
    """Draw the jam map of a context, the reward of every launch, or make it a page that simulates them.

    Draws the reward of all launches of one context, with the best one and what trained agents choose; or writes the
    page of play, for any browser, offline, which finds the best one itself and marks what the agents choose.

    Parameters
    ----------
    seed
        Which context of the scenario is drawn.
    runs
        Folder of a trained agent, or the name of one that ships; may be repeated.
    out
        Picture (default: map.png, unless --html is given).
    html
        Write this page.
    seeds
        Contexts to choose from in it (default: that of --seed).
    """
    from sledenv.machine.files import replacing
    from sledenv.pages.play import map_page
    from sledenv.scenarios.scenario import load_scenario

    if seeds and html is None:
        raise ValueError(f"--seeds = {list(seeds)}: only a page has several contexts, see --html")
    picture = out or (None if html else Path("map.png"))
    words: list[str] = []
    contexts: dict[int, dict[str, Any]] = {}
    with ExitStack() as places:
        page = html and taken(places, "--html", replacing(html, ".html", ".htm"))
        drawing = picture and taken(places, "--out", replacing(picture, ".png"))
        if page:
            loaded, drawn = load_scenario(scenario), seeds or (seed,)
            found = {}
            if runs:
                from sledenv.benchmark.landscape import choices

                with working("map"):
                    found = choices(loaded, drawn, runs, progress("map"))
            page.write_text(map_page(loaded, drawn, {k: one.marks for k, one in found.items()}), encoding="utf-8")
            words += [f"context of seed {k}\n{one.words}\n" for k, one in found.items()]
            contexts = {k: {"seed": k, "agents": found[k].plain if runs else []} for k in drawn}
        if drawing:
            from sledenv.benchmark.landscape import landscape

            with working("map"):
                one = landscape(scenario, seed, runs, progress("map"))
                one.figure.savefig(drawing, dpi=DPI, format="png")
            words.append(one.words)
            contexts[seed] = one.marks
    written = [file for file in (picture, html) if file]
    data = {"scenario": scenario, "contexts": list(contexts.values()), "written": written}
    tell("\n".join([*words, *(f"map: wrote {file}" for file in written)]), data, json)


def benchmark(
    *,
    suite: SuiteName = "smoke",
    out: Folder | None = None,
    workers: Workers | None = None,
    ray: Ray | None = None,
    json: Json = False,
) -> None:
    """Train and judge the agents of a suite, and write the report.

    Trains and judges every agent of a suite on every scenario, keeps the numbers in results.sqlite and writes the
    report. What has been done already is kept, so that a run which was stopped goes on.

    Parameters
    ----------
    suite
        smoke, launch, hidden, rides, or a file that ends in .yaml.
    out
        Default: runs/benchmark/SUITE.
    """
    from sledenv.benchmark.report import shown, write_report
    from sledenv.benchmark.results import read_results
    from sledenv.benchmark.runner import run_suite
    from sledenv.benchmark.scores import scores
    from sledenv.benchmark.suite import Suite

    one = Suite.load(suite)
    folder = out or Path("runs/benchmark") / one.id
    progress("benchmark")(f"{one.words}; results go to {folder}")
    with resumable():
        folder = run_suite(one, folder, workers=workers, ray=ray)
    results = read_results(one, folder)
    found = scores(results)
    page = write_report(results, found, folder / "report")
    if not json:
        tell(shown(found), None, json)
    tell(f"benchmark: wrote {page}", {"suite": one.id, "scores": found, "written": [page]}, json)
