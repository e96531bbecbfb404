"""Pages that need no other file and no network: a template, the style and the drawing that all share, and data."""

from __future__ import annotations

import json
import math
from importlib.resources import files
from typing import Any

import numpy as np

_DIGITS = 9  # significant, of every number in a page


def filled(template: str, content: dict[str, Any]) -> str:
    """Return a page.

    Parameters
    ----------
    template : str
        Name of a file of this package. In it ``/*STYLE*/`` stands for page.css, ``/*SCENE*/`` for scene.js and
        ``/*DATA*/`` for the content, as JSON.
    content : dict
        Numbers, strings and arrays, in dicts, lists and tuples; numbers that are not finite become null.
    """
    # "</script>" in a title would end the data.
    data = json.dumps(_plain(content), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    page = _read(template).replace("/*STYLE*/\n", _read("page.css")).replace("/*SCENE*/\n", _read("scene.js"))
    return page.replace("/*DATA*/", data)


def _read(name: str) -> str:
    return files("sledenv").joinpath(name).read_text(encoding="utf-8")


def _plain(value: Any) -> Any:
    """Turn arrays into lists, round numbers, and put None in place of what is no finite number, as JSON has it."""
    match value:
        case dict():
            return {key: _plain(entry) for key, entry in value.items()}
        case list() | tuple():
            return [_plain(entry) for entry in value]
        case np.ndarray() | np.generic():
            return _plain(value.tolist())
        case float():
            return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None
        case _:
            return value
