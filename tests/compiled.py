"""Compiles one kernel by itself, for tests that call it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from sledenv.compiler.entries import INTERPRETED
from sledenv.compiler.jit import OPTIONS, register_all


@functools.cache  # compiled once, whoever asks
def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a kernel as numba compiles it for the arguments it gets; itself where NUMBA_DISABLE_JIT is set."""
    if INTERPRETED:
        return function
    import numba

    run = numba.njit(**OPTIONS)(function)

    @functools.wraps(function)
    def registered(*given: Any) -> Any:
        register_all()
        return run(*given)

    return registered
