"""Tables that pages read from the code: ``python -m docs.tables PAGE.md`` prints a page with them."""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path

from sledenv.envs import DESCENT_ID
from sledenv.envs.columns import table
from sledenv.scenarios.scenario import Context

_FIELD = re.compile(r"^    (\w+): [^#\n]*#:? (.*)$", re.MULTILINE)
_PLACE = re.compile(r"^```\{observation\} (\S+)\n```$", re.MULTILINE)


def comments_of(kind: type) -> dict[str, str]:
    """Return what stands beside each field of a class of the package, with its unit."""
    kinds = reversed([one for one in inspect.getmro(kind) if one.__module__.startswith("sledenv")])
    return {name: text for one in kinds for name, text in _FIELD.findall(inspect.getsource(one))}


def observation(environment: str) -> str:
    """Return the entries of an observation as a table in Markdown: the context, and of a ride what follows it."""
    head, line, *ride = table().splitlines()
    told = ((name, comments_of(Context)[name].partition("] ")[2]) for name in Context.seen)
    context = [
        f"| `{name}` | {unit} | {text} | half its range |"
        for (name, text), unit in zip(told, Context.units, strict=True)
    ]
    return "\n".join([head, line, *context, *(ride if environment == DESCENT_ID else ())])


def with_tables(page: str) -> str:
    """Return a page in which each ``{observation} ID`` is the table of that environment."""
    return _PLACE.sub(lambda found: observation(found[1]), page)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        print(with_tables(Path(name).read_text(encoding="utf-8")))
