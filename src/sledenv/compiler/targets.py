"""Platforms for which object files are made, and which of them this machine is."""

from __future__ import annotations

import functools
import platform
import sys
from typing import Final, NamedTuple

import llvmlite.binding as llvm


class Target(NamedTuple):
    """Processor and system that an object file is made for."""

    triple: str
    processor: str
    features: str = ""  # of the processor, besides what its name says
    small: bool = False  # its size matters more than a tenth of its speed


TARGETS: Final = {
    "linux-x86_64": Target("x86_64-unknown-linux-gnu", "x86-64-v3"),
    "linux-aarch64": Target("aarch64-unknown-linux-gnu", "generic"),
    "darwin-arm64": Target("arm64-apple-macosx11.0.0", "apple-m1"),
    "win32-x86_64": Target("x86_64-pc-windows-msvc", "x86-64-v3"),
    # To be linked: see pages/kernel.py.
    "wasm32": Target("wasm32-unknown-unknown", "generic", "+simd128", small=True),
}
OTHER: Final = "other"  # any other machine: an object that it makes for itself
_V3 = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")


@functools.cache
def machine() -> str:
    """Name of the target that this machine is."""
    name = f"{sys.platform}-{platform.machine().lower().replace('amd64', 'x86_64')}"
    if name.endswith("x86_64") and not all(map(llvm.get_host_cpu_features().get, _V3)):
        return OTHER
    return name if name in TARGETS else OTHER


def target_of(name: str) -> Target:
    """Return a target; ``OTHER`` is any processor of this machine's kind, whatever this one has besides."""
    if name in TARGETS:
        return TARGETS[name]
    triple = llvm.get_default_triple()
    return Target(triple, "x86-64" if triple.startswith("x86_64") else "generic")
