"""Pages that need no other file and no network: templates, and how values are written into them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

_DIGITS = 9  # significant, of every number of the data in a page


def filled(template: str, **content: Any) -> str:
    """Return a page.

    Parameters
    ----------
    template : str
        Name of a file of ``templates/`` that extends ``page.html``.
    **content
        What the template names. A script finds ``data`` as ``D``: numbers, strings and arrays, in dicts, lists and
        tuples; numbers that are not finite become null.
    """
    return _TEMPLATES.get_template(template).render(content)


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


def _number(value: float, form: str = "z.3f") -> str:
    """Write a number for a reader: with the minus sign of typography, a fixed space before %, and NaN as a dash."""
    if math.isnan(value):
        return "\N{EN DASH}"
    return f"{value:{form}}".replace("-", "\N{MINUS SIGN}").replace("%", "\N{NO-BREAK SPACE}%")


_TEMPLATES = Environment(
    loader=PackageLoader("sledenv.pages"),
    autoescape=True,
    trim_blocks=True,
    lstrip_blocks=True,
    undefined=StrictUndefined,
)
_TEMPLATES.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
_TEMPLATES.filters |= {"plain": _plain, "number": _number}
_TEMPLATES.tests["nan"] = math.isnan
