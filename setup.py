"""The step of the build that pyproject.toml cannot tell: the kernel is compiled into object files of the package."""

import os
import subprocess
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

HERE = Path(__file__).parent


class BuildWithKernel(build_py):
    """Besides the Python files, make the object files of the targets in SLEDENV_TARGETS: this machine by default."""

    def run(self) -> None:
        """Build."""
        super().run()
        targets = os.environ.get("SLEDENV_TARGETS", "this machine")
        package = HERE / "src/sledenv" if self.editable_mode else Path(self.build_lib, "sledenv").absolute()
        if targets.split():
            self.announce(f"compiling the kernel for {targets}: about a minute", level=3)
            chosen = [] if targets == "this machine" else targets.split()
            command = [sys.executable, str(HERE / "src/sledenv/kernel"), str(package / "objects"), *chosen]
            subprocess.run(command, check=True)


setup(cmdclass={"build_py": BuildWithKernel})
