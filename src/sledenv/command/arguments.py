"""Kinds of arguments that several commands take, each with what it refuses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from glob import glob
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import CoercionError, Parameter, Token
from cyclopts.completion import CompletionContext

Solver = Literal["compliant", "rigid"]


def number(kind: type, words: str, accepts: Callable[[Any], bool], *, several: bool = False) -> Parameter:
    """Return what reads a number of a kind, or several, which ``words`` tell to whoever gives another."""

    def one(token: Token) -> Any:
        try:
            value = kind(token.value)
        except ValueError:
            value = math.nan
        if not accepts(value):
            raise CoercionError(msg=f"must be {words}: {token.value!r}", token=token)
        return value

    def read(_: Any, tokens: Sequence[Token]) -> Any:
        return tuple(map(one, tokens)) if several else one(tokens[0])

    return Parameter(converter=read, consume_multiple=(1, None) if several else None)


def within(most: float, unit: str) -> Parameter:
    """Return what reads a number in [-most, most]."""
    words = f"a finite number in [-{most:g}, {most:g}] {unit}"
    return number(float, words, lambda value: abs(value) <= most)


def positive(unit: str) -> Parameter:
    """Return what reads a number above 0, of a size that things have: its square is a number above 0 too."""
    return number(float, f"a number in [1e-09, 1e+09] {unit}", lambda value: 1e-9 <= value <= 1e9)


def _named(folder: Literal["scenarios", "studies", "suites"]) -> Parameter:
    """Return what completes the names of shipped files and the paths of others."""

    def offered(context: CompletionContext) -> list[str]:
        from sledenv.scenarios.configuration import shipped

        return [*shipped(folder), *glob(f"{context.incomplete}*.yaml")]

    return Parameter(completer=offered)


def _folder(_: Any, tokens: Sequence[Token]) -> Path:
    from sledenv.machine.files import check_folder

    folder = Path(tokens[0].value)
    try:
        check_folder(folder)
    except OSError as error:
        raise ValueError(str(error)) from error
    return folder


_SEED: Any = int, "an integer >= 0", lambda value: value >= 0
Seed = Annotated[int, number(*_SEED)]
Seeds = Annotated[tuple[int, ...], Parameter(metavar="SEED"), number(*_SEED, several=True)]
Count = Annotated[int, Parameter(metavar="N"), number(int, "an integer >= 1", lambda value: value >= 1)]
ScenarioName = Annotated[
    str, Parameter(help="Name (sledenv scenarios lists them), or a file that ends in .yaml"), _named("scenarios")
]
StudyName = Annotated[str, _named("studies")]
SuiteName = Annotated[str, _named("suites")]
Surfaces = Parameter(help="Contact model; rigid ignores the stiffness")
Json = Annotated[bool, Parameter(help="Print the result as one JSON document")]
Folder = Annotated[Path, Parameter(metavar="FOLDER", converter=_folder)]
File = Annotated[Path, Parameter(metavar="FILE")]
Workers = Annotated[Count, Parameter(help="Processes (default: one a core)")]
Ray = Annotated[
    str, Parameter(metavar="ADDRESS", help='Use the Ray cluster at this address instead, or start one here: "local"')
]
