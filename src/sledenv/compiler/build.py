"""Makes the object files of a library with numba: one module of all entries, emitted for one target after the other."""

from __future__ import annotations

import gc
import hashlib
import json
import os
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding as llvm

from sledenv.compiler.entries import Entry, Table
from sledenv.compiler.jit import OPTIONS, kernel, register_all
from sledenv.compiler.library import Library
from sledenv.compiler.targets import Target, machine, target_of

# Kernels count no references: they allocate nothing, and what they are given outlives them.
_NO_COUNTS = "define void @NRT_incref(i8* %a) {\n ret void\n}\ndefine void @NRT_decref(i8* %a) {\n ret void\n}\n"
# What a processor has decides nothing before the target is known, and all optimization happens at the end.
_SETTINGS = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_OPT": "0"}

_INLINED_IF_SMALL = 10  # what LLVM's count of a function may be; 225 by default


def make(library: Library, folder: Path, targets: Sequence[str]) -> None:
    """Make the object files TARGET.kernel of a library, each whole or not at all.

    This is for a process in which numba has not been loaded.

    Parameters
    ----------
    library : Library
    folder : Path
        Where they go; files that exist are replaced.
    targets : sequence of str
        Of ``TARGETS``; or ``OTHER``, for this machine.
    """
    for name in [name for name in os.environ if name.startswith("NUMBA_")]:
        del os.environ[name]
    os.environ.update(_SETTINGS)
    gc.disable()  # it would look through all objects of a compilation again and again to free few
    import numba

    module = _module(library)
    native = _emitted(module, target_of(machine()))
    library.load(native)
    about = {
        "fingerprint": library.fingerprint,
        "versions": {"numba": numba.__version__, "llvmlite": llvmlite.__version__, "python": sys.version.split()[0]},
        "known": library.known(),  # the same on every platform
    }
    folder.mkdir(parents=True, exist_ok=True)
    for target in targets:
        content = native if target == machine() else _emitted(module, target_of(target))
        header = {"target": target, **about, "sha256": hashlib.sha256(content).hexdigest()}
        unfinished = folder / f".{target}.{os.getpid()}"
        try:
            unfinished.write_bytes(json.dumps(header).encode() + b"\n" + content)
            unfinished.replace(folder / f"{target}.kernel")
        finally:
            unfinished.unlink(missing_ok=True)


def _module(library: Library) -> Any:
    """Return one module of all entries, not optimized yet, in which nothing else can be called from outside."""
    import numba

    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    for entry in library.entries.values():
        kernel(entry.function)
    register_all()
    whole = llvm.parse_assembly(_NO_COUNTS)
    exported = {}
    for entry in library.entries.values():
        function, signature = _in_c(entry)
        compiled = numba.cfunc(signature, **OPTIONS)(function)
        part = llvm.parse_assembly(compiled.inspect_llvm())
        for variable in part.global_variables:
            if variable.linkage == llvm.Linkage.common:
                variable.linkage = llvm.Linkage.weak_any
        part.get_function(compiled.native_name).linkage = llvm.Linkage.internal  # it would raise errors of Python
        exported[compiled.native_name.removeprefix("cfunc.")] = f"sledenv_{entry.name}"
        whole.link_in(part)
    for value in (*whole.functions, *whole.global_variables):
        if not value.is_declaration and value.name not in exported:
            value.linkage = llvm.Linkage.internal
    for native, name in exported.items():
        function = whole.get_function(native)
        function.linkage, function.name = llvm.Linkage.external, name
    return whole


def _emitted(module: Any, target: Target) -> bytes:
    """Return the object of a module, optimized for a target."""
    kind = {"reloc": "static" if target.triple.startswith("wasm") else "pic", "codemodel": "default"}
    machine = llvm.Target.from_triple(target.triple).create_target_machine(
        cpu=target.processor, features=target.features, opt=3, **kind
    )
    module = module.clone()
    if "windows" in target.triple:  # there every object with doubles asks for this, which Python does not have
        module.link_in(llvm.parse_assembly("@_fltused = constant i32 0"))
    module.triple, module.data_layout = target.triple, str(machine.target_data)
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    if target.small:
        tuning.inlining_threshold, tuning.loop_unrolling = _INLINED_IF_SMALL, False
        for function in module.functions:
            if not function.is_declaration:
                function.add_function_attribute("optsize")
    builder = llvm.create_pass_builder(machine, tuning)
    builder.getModulePassManager().run(module, builder)
    content = bytes(machine.emit_object(module))
    check_calls(content)
    return content


def check_calls(content: bytes) -> None:
    """Raise RuntimeError if an object calls what LLVM puts in place of long loops: no library gives it."""
    called = re.search(rb"\0_{0,3}(memset|memcpy|memmove|bzero)\0", content)
    if called:
        name = called[1].decode()
        raise RuntimeError(f"an object calls {name}: part the loop that LLVM has replaced by it into shorter ones")


def _in_c(entry: Entry) -> tuple[Callable[..., None], Any]:
    """Return a function of an entry with C arguments, and its signature."""
    import numba

    types: Any = numba.types
    parameters, arguments = ["numbers"], []
    kinds: list[Any] = [types.CPointer(types.float64)]
    scope: dict[str, Any] = {"function": entry.function, "carray": numba.carray}  # type: ignore[attr-defined]
    place = 0
    for i, kind in enumerate(entry.kinds):
        if isinstance(kind, Table):
            lengths = [f"length_{i}_{j}" for j in range(kind.dimensions)]
            parameters += [f"data_{i}", *lengths]
            kinds += [types.CPointer(numba.from_dtype(kind.dtype)), *[types.int64] * kind.dimensions]
            arguments.append(f"carray(data_{i}, ({', '.join(lengths)},))")
        elif issubclass(kind, tuple):
            end = place + len(kind._fields)  # type: ignore[attr-defined]
            scope[f"kind_{i}"] = kind
            arguments.append(f"kind_{i}({', '.join(f'numbers[{j}]' for j in range(place, end))})")
            place = end
        else:
            parameters.append(f"number_{i}")
            kinds.append(types.float64 if kind is float else types.int64)
            arguments.append(f"number_{i} != 0" if kind is bool else f"number_{i}")

    def joined(of: Any, parts: list[str]) -> str:
        scope[of.__name__] = of
        return f"{of.__name__}({', '.join(parts)})"

    given = ", ".join(entry.grouped(arguments, joined))
    exec(f"def {entry.name}({', '.join(parameters)}):\n    function({given})", scope)
    return scope[entry.name], types.void(*kinds)
