"""What Python calls from the kernel, and where compiled kernels are kept.

An entry contains the machine code of all the kernels that it calls.

numba's own cache looks at the file of the entry alone, and would go on with the machine code of an imported kernel as
it was before a change. So there is a folder for each state of the sources. In it each version of an entry has a folder
of its own, where numba keeps its files, and a record of their digests, because numba reads what it finds.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import json
import logging
import os
import shutil
import stat
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import llvmlite
import numba
import numpy as np

from sledenv.compiler import jit
from sledenv.machine.files import alone

_F = TypeVar("_F", bound=Callable[..., Any])

_PATIENCE = 2.0  # [s] of compilation that need no explanation
_COMPILER, _KERNEL = Path(__file__).parent, Path(__file__).parents[1] / "kernel"  # what is compiled
_KEPT = 4  # folders of compiled kernels, one for each state of the sources
_RECORD = "digests.json"

_COMPILING = "sledenv: compiling %s for its first use, which takes a while (%s)"
_DAMAGED = "sledenv: compiling %s again, because of damaged files: %s"
_FORKED = (
    "this process was forked from one in which batches have run, and cannot run any: start processes by "
    "multiprocessing.get_context('spawn'), or choose another threading layer by NUMBA_THREADING_LAYER=workqueue"
)
_OPEN = (
    "sledenv: others may write to %s, from which compiled code is read: whoever does can run code here; set "
    "NUMBA_CACHE_DIR to a folder of your own"
)
_NOT_KEPT = "sledenv: compiled kernels cannot be kept, the next process will compile again: %s"

_config: Any = numba.config
_log = logging.getLogger("sledenv")
_preparing = threading.RLock()  # numba compiles one function at a time; where it keeps them is one setting for all
_calling = threading.Lock()
_entries: list[Entry] = []
_left_behind: list[int] = []  # processes with threads, from which this one has been forked
_told: set[str] = set()


def entry(function: _F) -> _F:
    """Return what Python calls: it compiles a kernel on the first call, or finds what has been compiled before."""
    return function if _config.DISABLE_JIT else cast(_F, Entry(function))


def parallel_entry(function: _F) -> _F:
    """Return what Python calls from a kernel whose outer ``prange`` loop is shared between threads.

    Its turns take different times, so a thread that has done one takes the next.
    """
    return function if _config.DISABLE_JIT else cast(_F, _ParallelEntry(function, parallel=True))


def entries() -> list[Entry]:
    """All entries of this process."""
    return list(_entries)


class Entry:
    """What Python calls from a kernel: a compiled version for each combination of kinds of arguments.

    Parameters
    ----------
    function : callable
        Takes its arguments by position.
    **options
        For ``numba.njit``.

    Attributes
    ----------
    compiled, loaded : int
        Versions that this process has compiled, and that it has found compiled.
    damaged : list of str
        Paths of files that were not as they had been left; what they held has been compiled again.
    unkept : list of str
        Why versions that were compiled could not be kept.
    """

    __name__: str

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        functools.update_wrapper(self, function)
        self.compiled = self.loaded = 0
        self.damaged: list[str] = []
        self.unkept: list[str] = []
        self._function = function
        self._options = jit.OPTIONS | options
        self._versions: dict[tuple[Any, ...], Callable[..., Any]] = {}  # by the types that numba gives the arguments
        self._fast: dict[tuple[type, ...], Callable[..., Any]] = {}  # by the types that Python gives them
        _entries.append(self)

    def __call__(self, *arguments: Any) -> Any:
        """Compute what the function computes."""
        version = self._fast.get(tuple(map(type, arguments)))
        if version is None:
            return self._version(arguments)(*arguments)
        try:
            return version(*arguments)
        except TypeError:  # an array of another layout, say
            other = self._version(arguments)
            if other is version:
                raise
        return other(*arguments)

    def _version(self, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        signature = tuple(map(numba.typeof, arguments))
        with _preparing:
            if signature not in self._versions:
                self._versions[signature] = self._prepared(signature)
                if all(map(_is_plain, arguments)):
                    self._fast.setdefault(tuple(map(type, arguments)), self._versions[signature])
            return self._versions[signature]

    def _prepared(self, signature: tuple[Any, ...]) -> Callable[..., Any]:
        """Load a version, or compile it."""
        folder = self._folder(signature)
        with _announced(self.__name__, folder):
            if folder is not None:
                try:
                    with _alone_at(folder):
                        return self._kept(signature, folder)
                except OSError as error:  # a full disk, say, must not end a simulation
                    _tell_once(_NOT_KEPT, error)
                    self.unkept.append(str(error))
            version = self._compile(signature, cache=False)
        self.compiled += 1
        return version

    def _folder(self, signature: tuple[Any, ...]) -> Path | None:
        parent = cache_folder()
        if parent is None:
            return None
        module, name = self._function.__module__, self._function.__qualname__
        digest = hashlib.sha256(repr((module, name, self._options, signature)).encode()).hexdigest()[:12]
        return parent / f"{module.rpartition('.')[2]}.{name.replace('<locals>', '')}-{digest}"

    def _kept(self, signature: tuple[Any, ...], folder: Path) -> Callable[..., Any]:
        """Load a version from a folder, or compile it into it."""
        before = self._sound_files(folder)
        # Otherwise numba would look for its files beside the sources.
        own, _config.CACHE_DIR = _config.CACHE_DIR, str(_writable(folder))
        try:
            version = self._compile(signature, cache=True)
        finally:
            _config.CACHE_DIR = own
        after = _digests(folder)
        if not after:  # so that it may have read an old file elsewhere
            raise OSError(f"numba has kept nothing in {folder}")
        if after == before:
            self.loaded += 1
        else:
            unfinished = Path(f"{folder}.tmp")
            unfinished.write_text(json.dumps(after, indent=1))
            unfinished.replace(folder / _RECORD)
            self.compiled += 1
        return version

    def _sound_files(self, folder: Path) -> dict[str, str]:
        """Digests of numba's files in a folder, which is removed if it is not as it has been left."""
        found = _digests(folder)
        try:
            known = json.loads((folder / _RECORD).read_bytes())
            damaged = [name for name in known.keys() | found.keys() if known.get(name) != found.get(name)]
        except FileNotFoundError:  # there is nothing, or the process that wrote here was ended
            if found:
                shutil.rmtree(folder)
            return {}
        except (ValueError, AttributeError):
            damaged = [_RECORD]
        if not damaged:
            return found
        paths = [str(folder / name) for name in sorted(damaged)]
        _log.warning(_DAMAGED, self.__name__, ", ".join(paths))
        shutil.rmtree(folder)
        self.damaged += paths
        return {}

    def _compile(self, signature: tuple[Any, ...], cache: bool) -> Callable[..., Any]:
        # Garbage collection would look through all objects of a compilation again and again to free few.
        collects = gc.isenabled()
        gc.disable()
        try:
            return cast(Callable[..., Any], numba.njit(signature, cache=cache, **self._options)(self._function))
        finally:
            if collects:
                gc.enable()


class _ParallelEntry(Entry):
    def __call__(self, *arguments: Any) -> Any:
        """Compute what the function computes; a chunk size set in there would be an address that no cache can keep."""
        if _left_behind:
            raise RuntimeError(_FORKED)
        with numba.parallel_chunksize(1), _one_at_a_time():  # numba has started its threads in between
            return super().__call__(*arguments)


def _one_at_a_time() -> contextlib.AbstractContextManager[Any]:
    """Let Python's threads wait for each other where numba would end the process."""
    return _calling if numba.threading_layer() == "workqueue" else contextlib.nullcontext()  # type: ignore[attr-defined]


def _note_fork() -> None:
    """Remember in a child that the threads of OpenMP, of which it has none, have been started: numba would end it."""
    with contextlib.suppress(ValueError):  # none have been started
        if numba.threading_layer() == "omp":  # type: ignore[attr-defined]
            _left_behind.append(os.getppid())


if sys.platform == "linux":  # where numba's OpenMP is GNU's, which does not outlive a fork
    os.register_at_fork(after_in_child=_note_fork)


def _is_plain(argument: Any) -> bool:
    """Whether any other argument of this Python type is either like this one or refused by a version for this one.

    numba would turn 0.5 in a tuple into 0 for a version that has been compiled for a tuple with a whole number there.
    """
    if isinstance(argument, tuple):
        return all(isinstance(part, float | np.ndarray) and _is_plain(part) for part in argument)
    if isinstance(argument, np.ndarray):
        return bool(argument.flags.carray)
    return isinstance(argument, int | float | np.generic)


def _digests(folder: Path) -> dict[str, str]:
    """Digests of the files that numba has put into a folder, by their paths in it."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != _RECORD)
    return {path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@contextlib.contextmanager
def _alone_at(folder: Path) -> Iterator[None]:
    """Wait until no other process is at a folder of compiled kernels."""
    if not folder.parent.is_dir():
        _forget(folder.parent.parent)
        folder.parent.mkdir(parents=True, exist_ok=True)
    for place in (folder.parent.parent, folder.parent):
        # Whoever may write to the sources as well needs no compiled code.
        if sys.platform != "win32" and place.stat().st_mode & ~_KERNEL.stat().st_mode & stat.S_IWOTH:
            _tell_once(_OPEN, place)
    with alone(Path(f"{folder}.lock")):
        yield


def _forget(parent: Path) -> None:
    """Remove the folders of the oldest states of the sources; a process that still uses one compiles again."""
    with contextlib.suppress(OSError):  # another process may be at it
        folders = sorted(parent.glob("sledenv-" + 16 * "[0-9a-f]"), key=lambda folder: folder.stat().st_mtime)
        for folder in folders[: max(0, len(folders) - _KEPT + 1)]:
            shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def _announced(name: str, folder: Path | None) -> Iterator[None]:
    """Say, once a process and while it happens, that a kernel is being compiled, if that takes long."""
    if folder is None:
        kept = "no cache folder can be written, so the next process will compile again: set NUMBA_CACHE_DIR"
    else:
        kept = f"kept in {folder.parent} for the next time; `sledenv doctor` compiles all of them beforehand"
    timer = threading.Timer(_PATIENCE, _tell_once, (_COMPILING, name, kept))
    timer.daemon = True
    if folder is None or not (folder / _RECORD).exists():
        with contextlib.suppress(RuntimeError):  # there are no new threads while the interpreter ends
            timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _tell_once(message: str, *details: object) -> None:
    if message not in _told:
        _told.add(message)
        _log.warning(message, *details)


def _fingerprint() -> str:
    """Digest of what compiled kernels depend on and numba's own cache does not look at as a whole."""
    compiler = numba.__version__, llvmlite.__version__, np.__version__, tuple(sys.version_info), _config.BOUNDSCHECK
    digest = hashlib.sha256(repr(compiler).encode())
    for folder in (_KERNEL, _COMPILER):
        for source in sorted(folder.iterdir(), key=lambda source: source.name):
            if source.name.endswith(".py") and source.is_file():
                digest.update(f"{folder.name}/{source.name}".encode())
                digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


FINGERPRINT: Final = _fingerprint()


@functools.cache
def cache_folder() -> Path | None:
    """Folder of the compiled kernels of these very sources.

    It lies where numba keeps compiled functions, the first of ``NUMBA_CACHE_DIR``, ``__pycache__`` beside the sources
    and the user's cache folder that can be written; None if none can.
    """
    users = {"win32": "~/AppData/Local/numba/Cache", "darwin": "~/Library/Caches/numba"}.get(sys.platform)
    users = users or os.path.join(os.environ.get("XDG_CACHE_HOME") or "~/.cache", "numba")
    for place in (_config.CACHE_DIR, _KERNEL / "__pycache__", os.path.expanduser(users)):
        with contextlib.suppress(OSError):
            if place:
                return _writable(Path(place).absolute()) / f"sledenv-{FINGERPRINT}"
    return None


def _writable(folder: Path) -> Path:
    """Make sure that a folder is there and can be written, or raise an OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    tempfile.TemporaryFile(dir=folder).close()
    return folder
