"""The compilation decorators, defined once so that every kernel is compiled alike."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

_F = TypeVar("_F", bound=Callable[..., Any])

# No fastmath: it would drop NaN checks, and the kernels report a non-finite state as a status.
_OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy"}


def kernel(function: _F) -> _F:
    """Compile a scalar kernel on first call."""
    return cast(_F, numba.njit(**_OPTIONS)(function))


def parallel_kernel(function: _F) -> _F:
    """Compile a kernel whose outer ``prange`` loop is shared between threads."""
    return cast(_F, numba.njit(parallel=True, **_OPTIONS)(function))
