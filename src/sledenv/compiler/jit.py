"""How kernels are written: plain Python functions, registered with numba when it is to compile them, not before."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar

_F = TypeVar("_F", bound=Callable[..., Any])

# No fastmath: it would drop NaN checks, and the kernels report a non-finite state as a status.
OPTIONS: Final[dict[str, Any]] = {"error_model": "numpy"}

_unregistered: list[Callable[[], object]] = []  # what numba does not know yet


def when_compiled(register: Callable[[], object]) -> None:
    """Call a function, which registers something with numba, before anything is compiled; numba is not loaded now."""
    _unregistered.append(register)


def register_all() -> None:
    """Register all kernels that there are with numba."""
    while _unregistered:
        _unregistered.pop()()


def kernel(function: _F) -> _F:
    """Let compiled code call a function; for Python it stays as it is, and slow."""
    when_compiled(lambda: _register(function))
    return function


def _register(function: Callable[..., Any]) -> None:
    from numba.extending import register_jitable

    register_jitable(**OPTIONS)(function)
