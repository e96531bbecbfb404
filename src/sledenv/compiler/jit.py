"""How kernels are written: plain Python functions, registered with numba when it is to compile them, not before."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
    """Let compiled code call a function; for Python it stays as it is, slow and without fused multiply-adds."""
    when_compiled(lambda: _register(function))
    return function


def _register(function: Callable[..., Any]) -> None:
    from numba.extending import register_jitable

    register_jitable(**OPTIONS)(function)


def by_type(place: int, kinds: Mapping[type, Callable[..., Any]], otherwise: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that the type of the tuple at a place of its arguments chooses, when it is compiled.

    It is called without keywords.
    """

    def chosen(kind: type) -> Callable[..., Any]:
        return next((function for of, function in kinds.items() if issubclass(kind, of)), otherwise)

    def choice(*given: Any) -> Any:
        return chosen(type(given[place]))(*given)

    def compiled(*given: Any) -> Any:
        return chosen(given[place].instance_class)

    def register() -> None:
        from numba.extending import overload

        overload(choice, strict=False)(compiled)

    when_compiled(register)
    return choice
