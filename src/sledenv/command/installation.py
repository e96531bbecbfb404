"""The command that examines the installation."""

from __future__ import annotations

import sys

from sledenv.command.arguments import Json
from sledenv.command.running import FAILED, tell


def doctor(*, json: Json = False) -> int:
    """Check the installation.

    Loads the compiled kernel, which is made now if none fits; reports versions, processor, threads and cache; checks
    results that are known. Ends with status 1 if something is wrong.
    """
    from sledenv.command.doctor import examine

    report: dict[str, list[str]] = {}

    def note(name: str, words: str) -> None:
        report.setdefault(name, []).append(words)
        print(f"{name:<11}{words}", file=sys.stderr if json else sys.stdout, flush=True)

    problems = examine(note)
    for problem in problems:
        print(f"sledenv doctor: {problem}", file=sys.stderr)
    tell("something is wrong" if problems else "all is well", {"problems": problems, "report": report}, json)
    return FAILED if problems else 0
