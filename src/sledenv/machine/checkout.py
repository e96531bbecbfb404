"""Finds the packages that a checkout has at its top, beside ``src``; in a wheel they are within sledenv."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Final

_AT_THE_TOP: Final = ("sledenv.agents", "sledenv.configs")
_TOP: Final = Path(__file__).resolve().parents[3]


class _Finder(MetaPathFinder):
    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname not in _AT_THE_TOP:
            return None
        file = _TOP / fullname.rpartition(".")[2] / "__init__.py"
        return spec_from_file_location(fullname, file) if file.is_file() else None


def find_at_the_top() -> None:
    """Let Python find ``agents`` and ``configs`` of this checkout as packages of sledenv.

    So an editable install is ``src`` on the path and nothing else. What setuptools makes of packages in several places
    is asked after the folders of the path: above a clone named sledenv Python would take that folder for the package.
    """
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())  # before that of another checkout, which is installed
