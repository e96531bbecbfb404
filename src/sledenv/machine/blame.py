"""Tells an error of code that a user gives, such as an agent, as that of this code, with its place."""

from __future__ import annotations

import errno
import importlib
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sledenv.machine.extras import MissingPackage

_FULL = errno.ENOSPC, errno.EDQUOT


class GivenCodeError(RuntimeError):
    """An error that code raises which a user has given; the message says whose, what and where."""


@contextmanager
def attribute_errors_to(whose: str, deed: str) -> Iterator[None]:
    """Run code that a user has given.

    Parameters
    ----------
    whose : str
        Such as "agent mine, scenario sled_snow".
    deed : str
        What it does in this context, such as "act".

    Raises
    ------
    GivenCodeError
        If it raises an error, which is the cause; a command would tell a ValueError as wrong input.
    MissingPackage, GivenCodeError
        As it is: it says what to install, or whose error it is.
    OSError
        If a disk is full, which is not the fault of this code.
    """
    try:
        yield
    except (MissingPackage, GivenCodeError):
        raise
    except Exception as error:
        if (full := _full_disk(error)) is not None:
            raise OSError(f"{whose}: {deed}: {full.strerror}: {full.filename or 'a file'} was not written") from error
        words = " ".join(str(error).split())
        kind = type(error).__name__
        raise GivenCodeError(f"{whose}: {deed} raised {kind}: {words}{_place(error)}") from error


def _full_disk(error: BaseException | None) -> OSError | None:
    """Return the error of a full disk that is this one, or that it comes of."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in _FULL:
            return error
        error = error.__cause__ or error.__context__
    return None


def _place(error: Exception) -> str:
    """Return where in the given code an error was raised, empty where none of it has run."""
    passed = {__file__, importlib.__file__}
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename not in passed]
    inner = [frame for frame in frames[1:] if not frame.filename.startswith("<")]  # behind whoever calls it
    own = [frame for frame in inner if frame.filename == inner[0].filename]  # not what it has called itself
    return f" ({Path(own[-1].filename).name}, line {own[-1].lineno})" if own else ""
