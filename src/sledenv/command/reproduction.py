"""The command that computes the paper anew."""

from __future__ import annotations

from csv import DictReader
from pathlib import Path

from sledenv.command.arguments import Folder, Json
from sledenv.command.running import progress, tell


def reproduce(*, out: Folder = Path("reproduction"), json: Json = False) -> None:
    """Compute every number and figure of the paper.

    Everything quantitative in it: figures, maps, and a table of its numbers and ours.

    Parameters
    ----------
    out
        Folder of the results.
    """
    from sledenv.reproduce import reproduce as compute

    folder = compute(out, progress=progress("reproduce"))
    with (folder / "table.csv").open(encoding="utf-8", newline="") as lines:
        rows = list(DictReader(lines))
    tell(f"reproduce: wrote {folder / 'index.md'}", {"numbers": rows, "written": [folder / "index.md"]}, json)
