"""Makes object files of the kernel: python src/sledenv/kernel FOLDER [TARGET ...]. This machine is the default target.

It loads only kernel, compiler and what they import, so it runs while the package is still being built.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

sys.path.pop(0)  # this folder: its modules are imported as parts of the package
_package = ModuleType("sledenv")
_package.__path__ = [str(Path(__file__).parents[1])]
sys.modules["sledenv"] = _package

from sledenv.compiler.build import make  # noqa: E402
from sledenv.compiler.targets import machine  # noqa: E402
from sledenv.kernel.entries import LIBRARY  # noqa: E402

make(LIBRARY, Path(sys.argv[1]), sys.argv[2:] or [machine()])
