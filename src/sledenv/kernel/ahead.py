"""A second process that compiles kernels which the first will come to: compiling keeps numba to one core.

Compiled kernels are kept as files, one by one, so the two meet in the cache folder. The kernels that are worth it are
listed below; their arguments are known beforehand, numbers and tuples by annotation and arrays by name.

A helper may be missing, late or wrong, or end at any time: a kernel that it has not left in the cache is compiled as
without it. It ends with the process that it helps, because its standard input does.
"""

# numba has hardly any annotations.
# mypy: allow-untyped-calls

from __future__ import annotations

import contextlib
import gc
import inspect
import multiprocessing
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, Final, get_args, get_type_hints

import numpy as np
from numba import typeof, types
from numba.core import config

# Kernels that a helper compiles for a caller in ``_CALLERS`` that gets such a law, each with all that it calls: in the
# order in which they are needed, and as many as it can do while the other process compiles the rest.
_LAST: Final = ("descend.depart", "descend.close_books")
_TASKS: Final = {
    "ContactLaw": ("chord.chord_contact", *_LAST),
    "RigidLaw": ("contact._take_step", "series.expand", "contact._sample_step", *_LAST),
}
_CALLERS: Final = ("sledenv.kernel.descend", "sledenv.kernel.lanes")
_LONGEST: Final = 30.0  # [s] to wait for a kernel
_PROGRAM: Final = "import sys; sys.path[:] = {}; from sledenv.kernel.ahead import work; work({!r}, {!r})"


class _Helper:
    """A process that compiles kernels into a folder."""

    def __init__(self, names: Sequence[str], folder: Path) -> None:
        self._awaited = set(names)
        self._process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM.format(sys.path, str(folder), names)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            encoding="ascii",
            errors="replace",
        )

    def finishes(self, name: str) -> bool:
        """Wait for a kernel if it is one of these; say whether the helper has left it in the cache."""
        if name not in self._awaited or self._process.stdout is None:
            return False
        alarm = threading.Timer(_LONGEST, self._process.kill)
        try:
            alarm.start()
            for line in self._process.stdout:
                self._awaited.discard(line.strip())
                if name not in self._awaited:
                    return True
        except RuntimeError:  # there are no new threads while the interpreter ends
            return False
        finally:
            alarm.cancel()
        return False

    def end(self) -> None:
        with self._process:
            self._process.kill()


_helper: _Helper | None = None  # of the compilation in progress: numba has one at a time in a process


@contextlib.contextmanager
def helped(caller: Callable[..., Any], args: Sequence[Any], folder: Path | None) -> Iterator[None]:
    """Have a part of what a caller with arguments of these types contains compiled beside the rest."""
    global _helper
    names = () if folder is None or _helper is not None else _tasks(caller, args, folder)
    if folder is None or not names:
        yield
        return
    try:
        with contextlib.suppress(OSError, RuntimeError):  # the latter while the interpreter ends
            _helper = _Helper(names, folder)
        yield
    finally:
        if _helper is not None:
            _helper.end()
            _helper = None


def finished(name: str) -> bool:
    """Say whether a kernel that was not in the cache is there now; wait for it if a helper compiles it."""
    return _helper is not None and _helper.finishes(name)


def _tasks(caller: Callable[..., Any], args: Sequence[Any], folder: Path) -> tuple[str, ...]:
    """Names of the kernels that a helper should compile, if there is a core for it and an interpreter."""
    if (
        caller.__module__ not in _CALLERS
        or config.NUMBA_NUM_THREADS == 1  # type: ignore[attr-defined]
        or multiprocessing.parent_process() is not None  # a worker: the other cores are for its siblings
        # A program with Python inside would start itself.
        or getattr(sys, "frozen", False)
        or not Path(sys.executable or "").name.lower().startswith("python")
    ):
        return ()
    kinds = (getattr(kind, "instance_class", type(kind)).__name__ for kind in args)
    names = next((_TASKS[kind] for kind in kinds if kind in _TASKS), ())
    return tuple(name for name in names if not any(folder.glob(f"{name}-part-*")))


def work(folder: str, names: Sequence[str]) -> None:
    """Compile kernels into a folder, and print the name of each that is there: what a helper does."""
    threading.Thread(target=_end_with_standard_input, daemon=True).start()
    gc.disable()
    jit = import_module("sledenv.kernel.jit")
    if str(jit.cache_folder()) != folder:
        return
    for name in names:
        module, _, function = name.partition(".")
        kernel = getattr(import_module(f"sledenv.kernel.{module}"), function)
        kernel.compile_part(_types_of(kernel.py_func))
        print(name, flush=True)


def _end_with_standard_input() -> None:
    os.read(0, 1)  # not sys.stdin, which this thread would hold when the interpreter ends
    os._exit(0)


def _types_of(function: Callable[..., Any]) -> tuple[Any, ...]:
    """Types of the arguments that a kernel gets in a descent."""
    records = import_module("sledenv.kernel.records")
    arrays = {
        "c": np.zeros((1, 1)),
        "flight": np.zeros(1, records.OUTCOME)[0],
        "rebound": np.zeros(1, records.REBOUND)[0],
        "trajectory": np.zeros(1, records.TRAJECTORY),
    }

    def kind_of(hint: Any, name: str = "") -> Any:
        if name in arrays or hint is np.ndarray:
            return typeof(arrays.get(name, np.zeros(1)))
        if get_args(hint):  # of a tuple
            return types.Tuple([kind_of(part) for part in get_args(hint)])
        fields = getattr(hint, "_fields", ())
        return types.NamedUniTuple(types.float64, len(fields), hint) if fields else typeof(hint())

    hints = get_type_hints(function)
    return tuple(kind_of(hints[name], name) for name in inspect.signature(function).parameters)
