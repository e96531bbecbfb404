"""Functions that Python calls from compiled code, with C signatures of pointers, lengths and numbers."""

from __future__ import annotations

import ctypes
import os
from array import array
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Any, Final, NamedTuple

import numpy as np

INTERPRETED: Final = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")  # kernels run as plain Python


_DOUBLE = np.dtype(float)
_byte_of: Any = ctypes.c_char.from_buffer
_RESULT = (ctypes.c_void_p * 2)()
_NOWHERE = ctypes.addressof(_RESULT)  # no entry has a result or an error


class Table(NamedTuple):
    """Kind of an argument: a C-contiguous array, in C a pointer to its first element, and its lengths."""

    dtype: np.dtype
    dimensions: int = 1


class Group(NamedTuple):
    """Kinds of arrays that follow each other: callers give them one by one, the function takes them as one tuple."""

    of: Callable[..., Any]  # the type of the tuple, named
    tables: tuple[Table, ...]


Kind = type | Table | Group  # a named tuple of numbers, float, int, bool; or arrays
Find = Callable[[str], int]  # address of the function of some name


class Entry:
    """A function that Python calls with tuples, arrays and numbers, and that runs compiled.

    In C the numbers of all tuples come first, in one array of doubles; then pointer and lengths of each array, and each
    number, in order. It returns nothing: results are written into arrays.

    Parameters
    ----------
    name : str
        Of the function in C.
    function : callable
        What is compiled; called itself where NUMBA_DISABLE_JIT is set.
    *kinds : type, Table or Group
        Of its arguments.
    find : callable
        Where the function in C is, asked at the first call.
    """

    def __init__(self, name: str, function: Callable[..., None], *kinds: Kind, find: Find) -> None:
        self.name, self.function, self._grouped = name, function, kinds
        self.kinds = [one for kind in kinds for one in (kind.tables if isinstance(kind, Group) else (kind,))]
        self._find = find
        self._run: Callable[..., int] | None = None

    def __call__(self, *given: Any) -> None:
        """Run it; raises TypeError for an array of another type or layout."""
        self.prepared(*given)()

    def prepared(self, *given: Any) -> Callable[..., None]:
        """Return it with its first arguments, of which the last ones, if they are numbers, may still be missing.

        Raises
        ------
        TypeError
            For an array of another type or layout.
        """
        if INTERPRETED:
            return lambda *numbers: self.function(*self.grouped([*given, *numbers], lambda of, group: of(*group)))
        run = self._run or self._found()
        doubles = array("d")
        passed: list[Any] = [_NOWHERE, _NOWHERE, 0]
        for kind, argument in zip(self.kinds, given, strict=False):
            if isinstance(argument, tuple):
                doubles.extend(argument)
            elif not isinstance(argument, np.ndarray):
                passed.append(argument)
            else:
                dtype, shape = argument.dtype, argument.shape
                fits = isinstance(kind, Table) and dtype == kind.dtype and len(shape) == kind.dimensions
                if not (fits and argument.flags.c_contiguous):
                    raise TypeError(f"{self.name} takes {kind}, not {dtype} of shape {shape}")
                if 0 in shape:
                    passed.append(0)
                elif dtype is _DOUBLE and argument.flags.writeable:  # found faster so
                    passed.append(ctypes.addressof(_byte_of(argument)))
                else:
                    passed.append(argument.ctypes.data)
                passed += shape
        passed[2] = doubles.buffer_info()[0]

        def call(*numbers: Any, _kept: Any = (doubles, given)) -> None:
            if run(*passed, *numbers):
                raise RuntimeError(f"{self.name} has failed: this is a bug of sledenv")

        return call

    def grouped(self, given: Sequence[Any], joined: Callable[[Callable[..., Any], list[Any]], Any]) -> Iterator[Any]:
        """Yield the arguments of the function: those given, in groups that ``joined`` makes of a type and its parts."""
        rest = iter(given)
        for kind in self._grouped:
            yield joined(kind.of, list(islice(rest, len(kind.tables)))) if isinstance(kind, Group) else next(rest)

    def forget(self) -> None:
        """Ask anew where the function is."""
        self._run = None

    def _found(self) -> Callable[..., int]:
        # Where numba's own convention would put a result and an error, and the numbers.
        kinds: list[type] = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
        for kind in self.kinds:
            if isinstance(kind, Table):
                kinds += [ctypes.c_void_p, *[ctypes.c_int64] * kind.dimensions]
            elif not issubclass(kind, tuple):
                kinds.append(ctypes.c_double if kind is float else ctypes.c_int64)
        # ctypes lets other threads run Python meanwhile.
        self._run = ctypes.CFUNCTYPE(ctypes.c_int32, *kinds)(self._find(self.name))
        return self._run
