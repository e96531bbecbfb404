"""How commands are run: errors of one line, exit status, results and progress, places to write to."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from importlib.metadata import version
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Final, NoReturn

from cyclopts import App, CycloptsError, MissingArgumentError, Parameter

from sledenv.machine.blame import GivenCodeError

if TYPE_CHECKING:
    from rich.table import Table

FAILED: Final = 1
WRONG: Final = 2
_INTERRUPTED = 128 + signal.SIGINT
_interrupts: list[int] = []  # that have come since the command began
_BROKEN_PIPE = 141
_WIDTH = 120  # of a table that is not printed on a terminal
DPI: Final = 150  # of pictures
STATUS: Final = "Exit status: 0 done, 1 failed, 2 wrong input, 130 interrupted."


def app(name: str, text: str) -> App:
    """Return a command without sub-commands yet; they are functions, and their docstrings are its help."""
    return App(
        name,
        help=text,
        help_format="markdown",
        help_epilogue=STATUS,
        version=lambda: version("sledenv"),
        default_parameter=Parameter(negative="", show_default=_shown),
        suppress_keyboard_interrupt=False,
    )


def _shown(default: Any) -> str | None:
    return None if default is None or default is False or default == () else str(default)


def run(command: App, arguments: Sequence[str] | None = None) -> int:
    """Run a command, which is warned in one line on standard error.

    Parameters
    ----------
    command : App
    arguments : sequence of str, optional
        Those of the command line by default.

    Returns
    -------
    int
        Exit status: what the command returns, 0 for None; 1 with a message on standard error where the memory is too
        small, or code that was given raised an error, such as an agent; 2 with one where an argument is wrong, a file
        cannot be read or written, or a package is missing; 130 and 143 after an interrupt and a request to terminate;
        141 where nobody reads on.
    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    name = " ".join((*command.name, *(word for word in command.parse_commands(words)[0] if word[0] != "-")))
    before = signal.signal(signal.SIGTERM, _terminate)  # or the folder being written would stay
    heeded = signal.getsignal(signal.SIGINT)
    _interrupts.clear()
    if heeded is signal.default_int_handler:  # a process in the background may ignore it
        signal.signal(signal.SIGINT, _interrupt)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *where: print(f"{name}: warning: {message}", file=sys.stderr)
            status = command(words, print_error=False, exit_on_error=False, result_action="return_value")
        sys.stdout.flush()
    except BrokenPipeError:  # the reader, head for one, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _BROKEN_PIPE
    except CycloptsError as error:
        return _told(f"{name}: error: {_words(error)}", WRONG)
    except OSError as error:  # the system names a file and says why, without a number that nobody knows
        why = f"{error.filename}: {error.strerror}" if error.filename and error.strerror else error
        return _told(f"{name}: error: {why}", WRONG)
    except (ValueError, ImportError) as error:  # a wrong scenario, suite or run
        return _told(f"{name}: error: {error}", WRONG)
    except (MemoryError, GivenCodeError) as error:
        return _told(f"{name}: error: {error}", FAILED)
    except KeyboardInterrupt as error:
        return _told(f"{name}: interrupted{error}", _INTERRUPTED)
    finally:
        signal.signal(signal.SIGTERM, before)
        signal.signal(signal.SIGINT, heeded)
    return status or 0


def _words(error: CycloptsError) -> str:
    """Return what is wrong with the words of a command, in one line."""
    words = " ".join(str(error).removeprefix("Invalid value for ").split())
    if type(error) is not MissingArgumentError or error.argument is None:
        return words
    _, meant, suggestion = words.partition(" Did you mean ")
    what = f"{error.keyword} needs a value" if error.keyword else f"{error.argument.name} is required"
    return f"{what}.{meant}{suggestion}" if meant else what


def _told(message: str, status: int) -> int:
    print(message, file=sys.stderr)
    return status


def _terminate(number: int, frame: FrameType | None) -> NoReturn:
    raise SystemExit(128 + number)


def _interrupt(number: int, frame: FrameType | None) -> NoReturn:
    _interrupts.append(number)
    raise KeyboardInterrupt


def tell(result: str | Table, data: Any, as_json: bool) -> None:
    """Print a result on standard output: for a reader, or as one JSON document in which what is not finite is null."""
    if as_json:
        from pydantic_core import to_json

        result = to_json(data, indent=2, inf_nan_mode="null", fallback=_plain).decode()
    if isinstance(result, str):
        print(result, flush=True)
    else:
        from rich.console import Console

        Console(width=None if sys.stdout.isatty() else _WIDTH, highlight=False).print(result)


def _plain(value: Any) -> Any:
    """Return what numpy and pandas have as lists and numbers; rows of a table have their names."""
    if hasattr(value, "to_dict"):
        return value.reset_index().to_dict("records") if value.index.names != [None] else value.to_dict("records")
    if getattr(value.dtype, "names", None):
        return [dict(zip(value.dtype.names, row, strict=True)) for row in value.tolist()]
    return value.tolist()


@contextmanager
def working(words: str) -> Iterator[None]:
    """Show on standard error that something is being done, if that is a terminal."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(words):
        yield


@contextmanager
def resumable() -> Iterator[None]:
    """Let an interrupt in this context be told with how to go on."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt("; the same command goes on where it was") from None


def progress(name: str) -> Callable[[str], None]:
    """Return what tells on standard error what a command is about to do, or that it is not as it was interrupted.

    Python drops an interrupt that comes while it frees an object or runs a callback of a library.
    """

    def told(line: str) -> None:
        if _interrupts:
            raise KeyboardInterrupt
        print(f"{name}: {line}", file=sys.stderr, flush=True)

    return told


def taken(places: ExitStack, option: str, place: AbstractContextManager[Path]) -> Path:
    """Take a place to write to; what is wrong with it is said of the option."""
    try:
        return places.enter_context(place)
    except OSError as error:
        raise OSError(f"{option}: {error}") from error
