"""The compilation decorators, defined once so that every kernel is compiled alike, and the cache of their results."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import logging
import shutil
import time
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba
from llvmlite.binding import Linkage
from numba import types
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult, Flags, compile_extra
from numba.core.dispatcher import _FunctionCompiler
from numba.core.event import Event, Listener, register, trigger_event
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.typing.templates import make_concrete_template

_F = TypeVar("_F", bound=Callable[..., Any])

# No fastmath: it would drop NaN checks, and the kernels report a non-finite state as a status.
_OPTIONS: dict[str, Any] = {"error_model": "numpy"}
_PATIENCE = 2.0  # [s] of compilation that need no explanation
_KEPT = 4  # folders of compiled kernels, one for each state of the sources

_log = logging.getLogger("sledenv")


def kernel(function: _F) -> _F:
    """Compile a scalar kernel on first call."""
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    return cast(_F, _cached(_Kernel(function)))


def inlined(function: _F) -> _F:
    """Write a kernel into its callers: compiled by itself, it would have all that it calls compiled once more."""
    return cast(_F, _cached(numba.njit(inline="always", **_OPTIONS)(function)))


def parallel_kernel(function: _F) -> _F:
    """Compile a kernel whose outer ``prange`` loop is shared between threads."""
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return function
    return cast(_F, _cached(_Kernel(function, parallel=True)))


def _fingerprint() -> str:
    """Digest of what compiled kernels depend on and numba's own cache does not look at as a whole."""
    compiler = numba.__version__, config.BOUNDSCHECK  # type: ignore[attr-defined]
    digest = hashlib.sha256(repr(compiler).encode())
    for source in sorted(resources.files(__package__).iterdir(), key=lambda entry: entry.name):
        if source.name.endswith(".py") and source.is_file():
            digest.update(source.name.encode())
            digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


FINGERPRINT: Final = _fingerprint()


@functools.cache
def cache_folder() -> Path | None:
    """Folder of the compiled kernels of these very sources.

    It lies where numba keeps compiled functions, the first of ``NUMBA_CACHE_DIR``, ``__pycache__`` beside the sources
    and the user's cache folder that can be written; None if none can.
    """
    try:
        parent = CompileResultCacheImpl(_fingerprint).locator.get_cache_path()
    except RuntimeError:
        return None
    return Path(parent) / f"sledenv-{FINGERPRINT}"


class _Locator(_CacheLocator):  # type: ignore[misc]
    """Keeps all kernels in one folder that belongs to one state of the sources.

    numba's locators compare the file of a function alone, and would go on with a caller that contains the machine code
    of an imported kernel as it was before a change.
    """

    def __init__(self, folder: Path, line: int) -> None:
        self._folder = folder
        self._line = line

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _Locator | None:
        folder = cache_folder()
        return None if folder is None else cls(folder, py_func.__code__.co_firstlineno)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> str:
        return FINGERPRINT

    def get_disambiguator(self) -> str:
        return str(self._line)

    def ensure_cache_path(self) -> None:
        if not self._folder.is_dir():
            _forget(self._folder.parent)
        super().ensure_cache_path()


def _forget(parent: Path) -> None:
    """Remove the folders of the oldest states of the sources; a process that still uses one compiles again."""
    with contextlib.suppress(OSError):  # another process may be at it
        folders = sorted(parent.glob("sledenv-*"), key=lambda folder: folder.stat().st_mtime)
        for folder in folders[: max(0, len(folders) - _KEPT + 1)]:
            shutil.rmtree(folder, ignore_errors=True)


class _CacheImpl(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Locator,)


class _Cache(FunctionCache):  # type: ignore[misc]
    _impl_class = _CacheImpl

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        with contextlib.suppress(OSError):
            return super().load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError as error:  # a full disk, say, must not end a simulation
            _not_kept(str(error))


@functools.cache
def _not_kept(reason: str) -> None:
    _log.warning("sledenv: compiled kernels cannot be kept, the next process will compile again: %s", reason)


def _cached(dispatcher: Any) -> Any:
    """Let a dispatcher keep what it compiles."""
    if not config.DISABLE_JIT and cache_folder() is not None:  # type: ignore[attr-defined]
        dispatcher._cache = _Cache(dispatcher.py_func)  # what cache=True does, with numba's own cache
    return dispatcher


class _Part(JITCodeLibrary):  # type: ignore[misc]
    """Code of a kernel as its callers contain it: optimised and made executable with them, and not by itself.

    numba's own libraries are optimised and turned into machine code at every level of a tree of calls, together with all
    that they call.
    """

    def _ensure_finalized(self) -> None:
        """Leave it to the callers."""

    def add_linking_library(self, library: Any) -> None:
        super().add_linking_library(library)
        self._reload_init.update(library._reload_init)

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            module = self._final_module
            for library in dict.fromkeys(self._linking_libraries):
                module.link_in(library._get_module_for_linking(), preserve=True)
            for function in module.functions:
                if not function.is_declaration and function.linkage == Linkage.external:
                    function.linkage = "linkonce_odr"
            self._shared_module = module
        return self._shared_module


class _Flags(Flags):  # type: ignore[misc]
    """Options of a compilation, which numba hashes and compares tens of thousands of times: what is not set is left out."""

    def __hash__(self) -> int:
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Flags) and self._values == other._values


class _Compiler(_FunctionCompiler):  # type: ignore[misc]
    """Compiles a kernel for other kernels to contain, and makes that executable for Python."""

    @functools.cached_property
    def _flags(self) -> _Flags:
        return _flags(**self.targetoptions)

    def part(self, args: tuple[Any, ...]) -> CompileResult:
        """Compile for callers that are compiled."""
        typing, target = self.targetdescr.typing_context, self.targetdescr.target_context
        library = _Part(target.codegen(), self.py_func.__qualname__)
        part = compile_extra(typing, target, self.py_func, args, None, self._flags, self.locals, library=library)
        target.insert_user_function(library, part.fndesc, [library])
        return part

    def _compile_core(self, args: tuple[Any, ...], return_type: Any) -> CompileResult:
        part = self.part(args)
        target = part.target_context
        library = target.codegen().create_library(self.py_func.__qualname__)
        library.enable_object_caching()
        library.add_linking_library(part.library)
        target.create_cpython_wrapper(library, part.fndesc, part.environment, part.call_helper)
        return part._replace(library=library, entry_point=target.get_executable(library, part.fndesc, part.environment))


@functools.cache
def _flags(**options: Any) -> _Flags:
    flags = _Flags()
    cpu_target.options.parse_as_flags(flags, options)
    flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.no_compile = True
    return flags


class _Kernel(CPUDispatcher):  # type: ignore[misc]
    """A dispatcher that compiles differently for its callers in compiled code, as a :class:`_Part`, and for Python."""

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        super().__init__(function, targetoptions={"nopython": True, **_OPTIONS, **options})
        self._compiler = _Compiler(function, self.targetdescr, self.targetoptions, self.locals, Compiler)
        self._parts: dict[tuple[Any, ...], CompileResult] = {}

    def get_call_template(self, args: Any, kws: Any) -> Any:
        pysig, args = self._compiler.fold_argument_types(args, kws)
        args = tuple(types.unliteral(kind) for kind in args)  # one version serves all constants
        if args not in self._parts:
            with trigger_event("numba:compile", data={"dispatcher": self, "args": args, "return_type": None}):
                self._parts[args] = self._compiler.part(args)
        signature = self._parts[args].signature
        template = make_concrete_template(f"CallTemplate({self.__name__})", self.__name__, [signature])
        return template, pysig, args, {}

    def get_overload(self, sig: Any) -> Any:
        return self._parts[tuple(sig)].library


class _Announcer(Listener):  # type: ignore[misc]
    """Says, once a process and while it happens, that the kernels are being compiled, if that takes long."""

    def __init__(self) -> None:
        self._depth = 0  # kernels compile those that they call
        self._outermost = ""
        self._began = 0.0
        self._said = False

    def on_start(self, event: Event) -> None:
        if _is_ours(event):
            if self._depth == 0:
                self._outermost = event.data["dispatcher"].__name__
                self._began = time.perf_counter()
            self._depth += 1
            self._say(event)

    def on_end(self, event: Event) -> None:
        if _is_ours(event):
            self._say(event)
            self._depth -= 1

    def _say(self, event: Event) -> None:
        if self._said or time.perf_counter() - self._began < _PATIENCE:
            return
        self._said = True
        folder = cache_folder()
        if folder is None:
            kept = "no cache folder can be written, so the next process will compile again: set NUMBA_CACHE_DIR"
        else:
            kept = f"kept in {folder} for the next time; `sledenv doctor` compiles all of them beforehand"
        _log.warning("sledenv: compiling %s for its first use, which takes a while (%s)", self._outermost, kept)


def _is_ours(event: Event) -> bool:
    return str(event.data["dispatcher"].py_func.__module__).startswith("sledenv.")


register("numba:compile", _Announcer())
