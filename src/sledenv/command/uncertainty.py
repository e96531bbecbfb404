"""The command of uncertainty studies."""

from __future__ import annotations

from pathlib import Path

from sledenv.command.arguments import Count, Folder, Json, Ray, StudyName, Workers
from sledenv.command.running import progress, resumable, tell


def study(
    study: StudyName,
    /,
    *,
    out: Folder | None = None,
    launches: Count | None = None,
    workers: Workers | None = None,
    ray: Ray | None = None,
    json: Json = False,
) -> None:
    """Tell what uncertain launches, laws, slopes and bodies mean for the descent.

    Draws what a study calls uncertain, simulates a descent for each draw, and tells how they end, with quantiles,
    envelopes along the slope and Sobol indices. A study that was stopped goes on where it was, and so does one with
    more launches.

    Parameters
    ----------
    study
        brake_stop, hillside, push_off, or a file that ends in .yaml.
    out
        Default: runs/study/STUDY.
    launches
        At least so many (default: what the study says).
    """
    from sledenv.uncertainty import load_study
    from sledenv.uncertainty import study as simulate_study
    from sledenv.uncertainty.run import launches_of

    given = load_study(study)
    folder = out or Path("runs/study") / given.id
    asked = launches or given.launches
    planned = launches_of(given.model_copy(update={"launches": asked}))
    more = f", for {asked} asked for: they come in groups of {len(given.parameters) + 2}, a power of two of groups"
    progress("study")(f"{given.id}: {planned} launches{more if planned > asked else ''}; results go to {folder}")
    with resumable():
        found = simulate_study(given, folder, launches=launches, workers=workers, ray=ray)
    title = f"{given.id}, {found.launches} launches, solver {given.solver}: {given.question or given.title}"
    tables = {name: getattr(found, name) for name in ("shares", "quantiles", "stops", "envelopes", "sobol")}
    named = {"study": given.id, "launches": found.launches, "solver": given.solver}
    page = f"study: wrote {folder / 'study.html'}, with tables and pictures beside it"
    tell(
        f"{title}\n\n{found.words}\n\n{given.id}: {found.answer}\n{page}", named | tables | {"written": [folder]}, json
    )
