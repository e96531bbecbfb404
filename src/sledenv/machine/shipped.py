"""Files of configuration that ship with the package, found by their names."""

from __future__ import annotations

from collections.abc import Collection
from difflib import get_close_matches
from pathlib import Path
from typing import Final

from sledenv.machine.extras import folder_of

CONFIGS: Final = folder_of("configs")  # all that ships as YAML: scenarios, tracks, studies, suites, settings


def shipped(folder: str) -> tuple[str, ...]:
    """Return the names of the files that ship in a folder of ``configs``, sorted."""
    return tuple(sorted(file.stem for file in (CONFIGS / folder).glob("*.yaml")))


def is_path(name: str) -> bool:
    """Whether this is the path of a file, and not the name of one that ships."""
    return name.endswith((".yaml", ".yml"))


def find_file(called: str, folder: str, name: str) -> Path:
    """Return the file of a name that ships in a folder of ``configs``; a path ends in ``.yaml`` and stays as it is.

    Raises
    ------
    ValueError
        If there is no such name; ``called`` says of what.
    """
    if is_path(name):
        return Path(name)
    known = shipped(folder)
    if name not in known:
        raise ValueError(
            f"unknown {called} {name!r}{suggestion(name, known)}; known: {', '.join(known)}; a file ends in .yaml"
        )
    return CONFIGS / folder / f"{name}.yaml"


def suggestion(word: str, known: Collection[str]) -> str:
    """Return a suggestion for a misspelt word, empty if nothing is near."""
    nearest = get_close_matches(word, known, n=1)
    return f" (did you mean {nearest[0]!r}?)" if nearest else ""
