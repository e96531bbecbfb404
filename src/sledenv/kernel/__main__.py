"""Makes object files of the kernel: python src/sledenv/kernel FOLDER [TARGET ...], of this machine if none is named.

Only kernel, compiler and what they stand on are loaded, so that this runs where the package is still being built.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

sys.path.pop(0)  # this folder, whose modules are none of their own
_package = ModuleType("sledenv")
_package.__path__ = [str(Path(__file__).parents[1])]
sys.modules["sledenv"] = _package

from sledenv.compiler.build import make  # noqa: E402
from sledenv.compiler.targets import machine  # noqa: E402
from sledenv.kernel.entries import LIBRARY  # noqa: E402

make(LIBRARY, Path(sys.argv[1]), sys.argv[2:] or [machine()])
