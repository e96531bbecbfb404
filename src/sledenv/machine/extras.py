"""Says which extra of sledenv to install where a package is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


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
    ImportError
        Naming the missing package and the command that installs the extra.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise ImportError(f"{who}: {error}: pip install 'sledenv[{extra}]'", name=error.name) from error
