"""How kernels are compiled, each in the same way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar

from numba import config
from numba.extending import register_jitable

_F = TypeVar("_F", bound=Callable[..., Any])

# No fastmath: it would drop NaN checks, and the kernels report a non-finite state as a status.
OPTIONS: Final[dict[str, Any]] = {"error_model": "numpy"}


def kernel(function: _F) -> _F:
    """Let compiled code call a function; for Python, which calls :mod:`sledenv.entries`, it stays as it is."""
    return function if config.DISABLE_JIT else register_jitable(**OPTIONS)(function)  # type: ignore[attr-defined]
