"""Kinds of arguments that several commands take, each with what it refuses."""

from __future__ import annotations

from collections.abc import Sequence
from glob import glob
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from cyclopts import CoercionError, Parameter, Token
from cyclopts.completion import CompletionContext
from cyclopts.validators import Number

Solver = Literal["compliant", "rigid"]

# A number above 0, of a size that things have: its square is a number above 0 too.
POSITIVE: Final = Parameter(validator=Number(gte=1e-9, lte=1e9))


def integer(least: int, *, several: bool = False) -> Parameter:
    """Return what reads an integer, or several, and refuses those below the least one; Cyclopts would round 1.5."""

    def one(token: Token) -> int:
        try:
            value = int(token.value)
        except ValueError:
            value = least - 1
        if value < least:
            raise CoercionError(msg=f"must be an integer >= {least}: {token.value!r}", token=token)
        return value

    def read(_: Any, tokens: Sequence[Token]) -> Any:
        return tuple(map(one, tokens)) if several else one(tokens[0])

    return Parameter(converter=read, consume_multiple=(1, None) if several else None)


def within(most: float) -> Parameter:
    """Return what refuses a number out of [-most, most]."""
    return Parameter(validator=Number(gte=-most, lte=most))


def _check_readable(_: Any, file: Path) -> None:
    if not file.exists():
        raise ValueError(f"{file}: cannot be read: there is no such file")
    if not file.is_file():
        raise ValueError(f"{file}: cannot be read: must be a regular file, no folder, device or pipe")


def _named(called: str, folder: Literal["scenarios", "studies", "suites"]) -> Parameter:
    """Return what refuses an unknown name or a missing file before anything large is loaded, and completes both."""

    def check(_: Any, name: str | None) -> None:
        if name is None:  # not given
            return
        from sledenv.machine.shipped import find_file

        _check_readable(None, find_file(called, folder, name))

    def offered(context: CompletionContext) -> list[str]:
        from sledenv.machine.shipped import shipped

        return [*shipped(folder), *glob(f"{context.incomplete}*.yaml")]

    return Parameter(validator=check, completer=offered)


def _check_folder(_: Any, folder: Path | None) -> None:
    if folder is None:  # not given
        return
    from sledenv.machine.files import check_folder

    try:
        check_folder(folder)
    except OSError as error:
        raise ValueError(str(error)) from error


Seed = Annotated[int, integer(0)]
Seeds = Annotated[tuple[int, ...], Parameter(metavar="SEED"), integer(0, several=True)]
Count = Annotated[int, Parameter(metavar="N"), integer(1)]
ScenarioName = Annotated[
    str,
    Parameter(help="Name (sledenv scenarios lists them), or a file that ends in .yaml"),
    _named("scenario", "scenarios"),
]
StudyName = Annotated[str, _named("study", "studies")]
SuiteName = Annotated[str, _named("suite", "suites")]
Surfaces = Parameter(help="Contact model; rigid ignores the stiffness")
Json = Annotated[bool, Parameter(help="Print the result as one JSON document")]
Folder = Annotated[Path, Parameter(metavar="FOLDER", validator=_check_folder)]
File = Annotated[Path, Parameter(metavar="FILE")]
FileToRead = Annotated[File, Parameter(validator=_check_readable)]
Workers = Annotated[Count, Parameter(help="Processes (default: one per core)")]
Ray = Annotated[
    str, Parameter(metavar="ADDRESS", help='Use the Ray cluster at this address instead, or start one here: "local"')
]
