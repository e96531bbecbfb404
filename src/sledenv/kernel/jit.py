"""The compilation decorators, defined once so that every kernel is compiled alike, and the cache of their results."""

# numba has hardly any annotations.
# mypy: allow-untyped-calls

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import logging
import platform
import shutil
import time
from collections.abc import Callable, Iterator
from importlib import resources
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba
from llvmlite.binding import Linkage, parse_bitcode
from numba import types
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.compiler import Compiler, Flags, compile_extra, compile_result
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import _FunctionCompiler  # type: ignore[attr-defined]
from numba.core.event import Event, Listener, register, trigger_event
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.runtime import rtsys  # type: ignore[attr-defined]
from numba.core.typing.templates import make_concrete_template

from sledenv.kernel import ahead

_F = TypeVar("_F", bound=Callable[..., Any])

# No fastmath: it would drop NaN checks, and the kernels report a non-finite state as a status.
_OPTIONS: dict[str, Any] = {"error_model": "numpy"}
# Kernels own no array: reference counts are atomic, and took a third of the time of a rigid hop.
_BORROWING: dict[str, Any] = {"_nrt": False, **_OPTIONS}
_PATIENCE = 2.0  # [s] of compilation that need no explanation
_KEPT = 4  # folders of compiled kernels, one for each state of the sources

_log = logging.getLogger("sledenv")


def kernel(function: _F) -> _F:
    """Compile a scalar kernel on first call; it works in the arrays that it is given and makes none."""
    return _compiled(function, **_BORROWING)


def allocating(function: _F) -> _F:
    """Compile a scalar kernel that makes arrays."""
    return _compiled(function)


def parallel_kernel(function: _F) -> _F:
    """Compile a kernel, for Python to call, whose outer ``prange`` loop is shared between threads.

    Its turns take different times, so a thread that has done one takes the next.
    """
    compiled = _compiled(function, parallel=True)

    # Set in the kernel itself, the chunk size would be an address that no cache can keep.
    @functools.wraps(function)
    def shared(*arguments: Any) -> Any:
        with numba.parallel_chunksize(1):
            return compiled(*arguments)

    return cast(_F, shared)


def _compiled(function: _F, **options: Any) -> _F:
    return function if config.DISABLE_JIT else cast(_F, _Kernel(function, **options))  # type: ignore[attr-defined]


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


class _Codegen(JITCPUCodegen):
    """Turns a kernel into machine code that lies in one piece with its constants.

    numba's lies anywhere, so that an instruction which needs a constant is preceded by one with its address.
    """

    def _init(self, llvm_module: Any) -> None:
        settings: Any = config
        before, settings.USE_LLVMLITE_MEMORY_MANAGER = settings.USE_LLVMLITE_MEMORY_MANAGER, True
        try:
            super()._init(llvm_module)
        finally:
            settings.USE_LLVMLITE_MEMORY_MANAGER = before

    def _customize_tm_options(self, options: dict[str, Any]) -> None:
        super()._customize_tm_options(options)
        if platform.machine() in ("x86_64", "AMD64"):
            options.update(reloc="pic", codemodel="small")


@functools.cache
def _codegen() -> _Codegen:
    return _Codegen("sledenv.kernel")


class _CacheImpl(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Locator,)

    def reduce(self, data: Any) -> tuple[Any, ...]:
        return super().reduce(data), list(data.environment.consts)

    def rebuild(self, target_context: Any, payload: tuple[Any, ...]) -> Any:
        reduced, constants = payload
        result = super().rebuild(target_context.subtarget(_internal_codegen=_codegen()), reduced)
        # The part may have been loaded before, and brought the same environment without what Python's entry added.
        result.environment.consts[:] = constants
        return result


class _Cache(FunctionCache):  # type: ignore[misc]
    _impl_class = _CacheImpl

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        with contextlib.suppress(OSError):
            found = super().load_overload(sig, target_context)
            # Two processes that keep versions of one kernel at a time may have taken the same file for them.
            return None if found is None or found.signature.args != tuple(sig) else found

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except OSError as error:  # a full disk, say, must not end a simulation
            _not_kept(str(error))


@functools.cache
def _not_kept(reason: str) -> None:
    _log.warning("sledenv: compiled kernels cannot be kept, the next process will compile again: %s", reason)


class _Part(JITCodeLibrary):
    """Code of a kernel as its callers contain it: optimised and made executable with them, and not by itself.

    numba's own libraries are optimised and turned into machine code at every level of a tree of calls, each with all
    that it calls.
    """

    def _ensure_finalized(self) -> None:
        """Leave it to the callers."""

    def add_linking_library(self, library: Any) -> None:
        super().add_linking_library(library)
        self._reload_init.update(library._reload_init)

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = self._final_module
            for library in dict.fromkeys(self._linking_libraries):
                self._shared_module.link_in(library._get_module_for_linking(), preserve=True)
            for function in self._shared_module.functions:
                if not function.is_declaration and function.linkage == Linkage.external:
                    function.linkage = "linkonce_odr"
        return self._shared_module


class _Parts(JITCPUCodegen):
    """Makes parts of all that a compilation brings about: a loop for threads is several libraries, one in another."""

    _library_class = _Part


@functools.cache
def _parts() -> _Parts:
    return _Parts("sledenv.kernel.parts")


class _Whole(JITCodeLibrary):
    """Code of a kernel as Python calls it.

    Nobody else calls what it contains, so LLVM may inline a function that has one caller and pass arguments as it
    likes. What is left gets names of its own: LLVM's linker takes functions of other libraries with the same name for
    the same function.
    """

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if function.linkage == Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._optimize_final_module()
        for function in self._final_module.functions:
            if function.linkage == Linkage.internal:
                function.name = f"{function.name}.{self.name}"


class _PartCacheImpl(_CacheImpl):
    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        return str(super().get_filename_base(f"{fullname}-part", abiflags))

    def reduce(self, part: Any) -> tuple[Any, ...]:
        code = part.library._get_module_for_linking().as_bitcode()
        part.fndesc.typemap = part.fndesc.calltypes = None  # need not be kept, and may not be possible to
        environments = part._find_referenced_environments()
        return part.library.name, code, part.fndesc, part.environment, part.signature, environments

    def rebuild(self, target_context: Any, payload: tuple[Any, ...]) -> Any:
        name, code, descriptor, environment, signature, environments = payload
        library = _Part(target_context.codegen(), name)
        library._final_module = library._shared_module = parse_bitcode(code)
        return compile_result(
            library=library,
            fndesc=descriptor,
            environment=environment,
            signature=signature,
            objectmode=False,
            lifted=(),
            referenced_envs=environments,
        )


class _PartCache(_Cache):
    _impl_class = _PartCacheImpl


class _Flags(Flags):
    """Options of a compilation without their defaults: numba hashes and compares them tens of thousands of times."""

    def __hash__(self) -> int:
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Flags) and self._values == other._values


@functools.cache
def _flags(**options: Any) -> Any:
    flags: Any = _Flags()
    cpu_target.options.parse_as_flags(flags, options)
    flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.no_compile = True
    return flags


@contextlib.contextmanager
def _uncollected() -> Iterator[None]:
    """Without garbage collection, which looks through all objects of a compilation again and again to free few."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


class _Compiler(_FunctionCompiler):  # type: ignore[misc]
    """Compiles a kernel for other kernels to contain, and makes that executable for Python."""

    def __init__(self, dispatcher: _Kernel) -> None:
        options = dispatcher.targetoptions
        super().__init__(dispatcher.py_func, dispatcher.targetdescr, options, dispatcher.locals, Compiler)
        self._dispatcher = dispatcher
        self._name = f"{self.py_func.__module__.rpartition('.')[2]}.{self.py_func.__qualname__}"
        self._parts: dict[tuple[Any, ...], Any] = {}
        self.cache: Any = NullCache()

    def part(self, args: tuple[Any, ...]) -> Any:
        """Return what callers in compiled code contain."""
        args = tuple(types.unliteral(kind) for kind in args)  # one version serves all constants
        if args not in self._parts:
            target = self.targetdescr.target_context
            part = self.cache.load_overload(args, target)
            if part is None and ahead.finished(self._name):
                part = self.cache.load_overload(args, target)
            if part is None:
                with trigger_event("numba:compile", data={"dispatcher": self._dispatcher, "args": args}):
                    part = self._compile_part(args)
                self.cache.save_overload(args, part)
            target.insert_user_function(part.library, part.fndesc, [part.library])
            self._parts[args] = part
        return self._parts[args]

    def _compile_part(self, args: tuple[Any, ...]) -> Any:
        typing = self.targetdescr.typing_context
        target = self.targetdescr.target_context.subtarget(_internal_codegen=_parts())
        return compile_extra(typing, target, self.py_func, args, None, _flags(**self.targetoptions), self.locals)

    @_uncollected()
    def _compile_core(self, args: tuple[Any, ...], return_type: Any) -> Any:
        with ahead.helped(self.py_func, args, cache_folder()):
            part = self.part(args)
        counted = self.targetoptions.get("_nrt", True)
        options = {"enable_nrt": True} if counted else {}
        target = self.targetdescr.target_context.subtarget(_internal_codegen=_codegen(), **options)
        library = _Whole(target.codegen(), part.fndesc.mangled_name)
        library.enable_object_caching()
        library.add_linking_library(part.library)
        if counted:
            library.add_linking_library(rtsys.library)
        target.create_cpython_wrapper(library, part.fndesc, part.environment, part.call_helper)
        entry = target.get_executable(library, part.fndesc, part.environment)
        code = {"library": library, "entry_point": entry, "reload_init": list(library._reload_init)}
        whole = part._replace(target_context=target, **code)
        for environment in whole._find_referenced_environments():
            library.codegen.set_env(environment.env_name, environment)
        return whole


class _Kernel(CPUDispatcher):  # type: ignore[misc]
    """A dispatcher whose code is compiled once for its callers in compiled code and for Python."""

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        super().__init__(function, targetoptions={"nopython": True, **_OPTIONS, **options})
        self._compiler = _Compiler(self)
        if cache_folder() is not None:
            self._cache = _Cache(function)
            self._compiler.cache = _PartCache(function)

    def compile_part(self, args: tuple[Any, ...]) -> None:
        """Compile for callers in compiled code, or find what has been."""
        with global_compiler_lock:
            self._compiler.part(args)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        pysig, args = self._compiler.fold_argument_types(args, kws)
        signature = self._compiler.part(args).signature
        template: Any = make_concrete_template(f"CallTemplate({self.__name__})", self.__name__, [signature])
        return template, pysig, args, {}

    def get_overload(self, sig: Any) -> Any:
        return self._compiler.part(tuple(sig)).library


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
