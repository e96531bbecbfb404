"""Says what to install where a package is missing: an extra of sledenv, or sledenv itself."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn


class MissingPackage(ImportError):
    """A package that an extra brings is missing; the message has the command that installs it."""


class Missing:
    """Stands in for a public name whose packages are missing: it can be imported and looked at, but not used.

    Parameters
    ----------
    name : str
        Such as "sledenv.identify".
    error : MissingPackage
        What whoever uses it is told.
    """

    def __init__(self, name: str, error: MissingPackage) -> None:
        self._name = name
        self._error = error

    def __repr__(self) -> str:
        return f"<{self._name}, not installed: {self._error}>"

    def __call__(self, *given: object, **named: object) -> NoReturn:
        """Raise the error."""
        raise MissingPackage(str(self._error), name=self._error.name) from self._error

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # what help, copies and notebooks ask of any object
            raise AttributeError(name)
        return self()


@contextmanager
def needs(extra: str, who: str) -> Iterator[None]:
    """Import in this context what an extra brings.

    Parameters
    ----------
    extra : str
        Such as "analysis".
    who : str
        What needs it, as the message names it.

    Raises
    ------
    MissingPackage
        Naming it and the command that installs the extra.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise MissingPackage(f"{who}: {error}: pip install 'sledenv[{extra}]'", name=error.name) from error


def folder_of(package: str) -> Path:
    """Return the folder of a package that a checkout has at its top, without importing it.

    Parameters
    ----------
    package : str
        Such as "configs" for ``sledenv.configs``.

    Raises
    ------
    ImportError
        If this sledenv is a checkout that is not installed, so that there is none, or one of another sledenv.
    """
    home = Path(__file__).resolve().parents[1]
    spec = find_spec(f"sledenv.{package}")
    folder = None if spec is None or spec.origin is None else Path(spec.origin).resolve().parent
    if folder is None or folder not in (home / package, home.parents[1] / package):
        found = "not found" if folder is None else f"that of another sledenv, {folder}"
        message = f"sledenv.{package} is {found}: install this one: pip install -e {home.parents[1]}"
        raise ImportError(message, name=f"sledenv.{package}")
    return folder
