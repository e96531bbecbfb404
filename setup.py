"""What pyproject.toml cannot tell: the kernel is compiled, and an editable install puts ``src`` alone on the path."""

import os
import subprocess
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.editable_wheel import editable_wheel

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


class SrcOnThePath(editable_wheel):
    """Put ``src`` alone on the path; sledenv itself finds what a checkout has at its top (machine/checkout.py).

    With packages in several places, setuptools would install a finder that Python asks after the folders of the path:
    started above a clone named sledenv, it would take that folder for the package.
    """

    def finalize_options(self) -> None:
        """Leave out the packages outside ``src``."""
        places = self.distribution.package_dir
        self.distribution.packages = [name for name in self.distribution.packages if name not in places]
        self.distribution.package_dir = {"": places[""]}
        super().finalize_options()


setup(cmdclass={"build_py": BuildWithKernel, "editable_wheel": SrcOnThePath})
