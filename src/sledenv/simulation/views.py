"""How a notebook shows a descent: registered by pages, which are made of descents, so that none is imported here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

View = Callable[[Any], str]  # from a Descent to HTML

_registered: dict[str, View] = {}


def register(view: View) -> None:
    """Let notebooks show descents by this function."""
    _registered["descent"] = view


def shown(descent: Any) -> str:
    """Return the HTML of a descent."""
    return _registered["descent"](descent)
