"""How kernels are compiled, each in the same way."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, TypeVar

import numba
from numba import config
from numba.extending import overload, register_jitable

_F = TypeVar("_F", bound=Callable[..., Any])

# No fastmath: it would drop NaN checks, and the kernels report a non-finite state as a status.
OPTIONS: Final[dict[str, Any]] = {"error_model": "numpy"}


def kernel(function: _F) -> _F:
    """Let compiled code call a function; for Python, which calls :mod:`sledenv.compiler.entries`, it stays as it is."""
    return function if config.DISABLE_JIT else register_jitable(**OPTIONS)(function)  # type: ignore[attr-defined]


def part(function: _F) -> _F:
    """Let compiled code call a function that has one caller, into which numba writes it before it compiles that.

    Compiled by itself, it would be compiled with all that it calls, and its caller with all of this once more.
    """
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    return numba.njit(inline="always", **OPTIONS)(function)  # type: ignore[no-any-return]


def by_type(place: int, kinds: Mapping[type, Callable[..., Any]], otherwise: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that the type of the tuple at a place of its arguments chooses, when it is compiled.

    It is called without keywords.
    """

    def chosen(kind: type) -> Callable[..., Any]:
        return next((function for of, function in kinds.items() if issubclass(kind, of)), otherwise)

    def choice(*given: Any) -> Any:
        return chosen(type(given[place]))(*given)

    if not config.DISABLE_JIT:  # type: ignore[attr-defined]

        def compiled(*given: Any) -> Any:
            return chosen(given[place].instance_class)

        overload(choice, strict=False)(compiled)
    return choice
