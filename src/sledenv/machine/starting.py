"""Start of ``python -m sledenv...``: an interrupt and a missing package are told in one line each."""

from __future__ import annotations

import sys
from types import TracebackType

from sledenv.machine.extras import MissingPackage

WRONG, INTERRUPTED = 2, 130  # exit status


def tell_in_one_line() -> None:
    """Let Python tell an interrupt and a missing package in one line, and end with the status of a command for it.

    It is so only where Python was asked to run a module of sledenv: other programs tell their errors as they like.
    """
    module = _module()
    if not module:
        return

    def told(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
        if not isinstance(error, KeyboardInterrupt | MissingPackage):
            return sys.__excepthook__(kind, error, traceback)
        interrupted = isinstance(error, KeyboardInterrupt)
        print(f"python -m {module}: {'interrupted' if interrupted else f'error: {error}'}", file=sys.stderr)
        raise SystemExit(INTERRUPTED if interrupted else WRONG)

    sys.excepthook = told


def _module() -> str:
    """Name of the module of sledenv that Python was asked to run, as the command line has it; empty if it was none."""
    words = (word.removeprefix("-m") for word in sys.orig_argv)
    return next((word for word in words if word.partition(".")[0] == "sledenv"), "")
