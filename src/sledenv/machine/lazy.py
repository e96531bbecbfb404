"""Public names of a package whose modules are imported where a name is first asked for."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from sledenv.machine.extras import Missing, MissingPackage


def lazy_names(
    package: str, homes: Mapping[str, Iterable[str]], submodules: Iterable[str] = ()
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package.

    Parameters
    ----------
    package : str
        Its full name.
    homes : mapping of str to iterable of str
        The public names of each module.
    submodules : iterable of str
        Modules of the package that are reached as its attributes, too.

    Notes
    -----
    A name whose packages are not installed is a :class:`~sledenv.machine.extras.Missing`, so that a package can be
    looked at without its extras.
    """
    home = {name: module for module, names in homes.items() for name in names}
    below = frozenset(submodules)

    def get(name: str) -> Any:
        if name not in home and name not in below:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        try:
            if name in below:
                return importlib.import_module(f"{package}.{name}")
            found = getattr(importlib.import_module(home[name]), name)
        except MissingPackage as error:
            return Missing(f"{package}.{name}", error)
        setattr(sys.modules[package], name, found)
        return found

    def list_names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *home, *below})

    return get, list_names
