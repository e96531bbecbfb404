"""A tiny library in a folder of its own, so that no test waits until the kernel is compiled."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest

from sledenv.compiler import library

SOURCE = Path(__file__).with_name("tiny.py")


class Tiny:
    """Its source in a folder, and where the package and the user's cache have its object file.

    Parameters
    ----------
    folder : Path
        Empty.
    made : bytes
        Content of its object file.
    """

    def __init__(self, folder: Path, made: bytes = b"") -> None:
        self.made = made
        (folder / "tiny").mkdir()
        (folder / "shipped").mkdir()
        self.source = Path(shutil.copy(SOURCE, folder / "tiny"))
        self.shipped, self.cache = folder / "shipped" / f"{library.machine()}.kernel", folder / "cache"
        self.copied: list[Path] = []
        self.full = False  # the disk of the user's cache

    def load(self) -> Any:
        """Load it anew, as another process does."""
        spec = spec_from_file_location("tiny", self.source)
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    def load_to_copy(self) -> Any:
        """Load it anew; instead of making its object file it copies the one that there is, and notes to where."""
        module = self.load()
        module.LIBRARY.make = self.copy
        return module

    def copy(self, folder: Path, target: str) -> None:
        """Copy the object file, if there is room."""
        if self.full and folder.is_relative_to(self.cache):
            raise RuntimeError("No space left")
        self.copied.append(folder)
        (folder / f"{target}.kernel").write_bytes(self.made)

    def start(self, program: str, **environment: str) -> subprocess.Popen[str]:
        """Run a program with the library in another process."""
        before = "import sys, pathlib, tiny; from sledenv.compiler import library\n"
        before += (
            "library.SHIPPED, library.cache_folder = pathlib.Path(sys.argv[1]), lambda: pathlib.Path(sys.argv[2])\n"
        )
        command = [sys.executable, "-c", before + program, str(self.shipped.parent), str(self.cache)]
        given = {**os.environ, "PYTHONPATH": str(self.source.parent), **environment}
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=given)

    @property
    def known(self) -> str:
        """Digest of the numbers that it must compute."""
        return str(json.loads(self.made.partition(b"\n")[0])["known"])

    def told(self, **words: object) -> bytes:
        """Return its object file with other words before the object."""
        header, _, content = self.made.partition(b"\n")
        return json.dumps(json.loads(header) | words).encode() + b"\n" + content

    def edit(self, old: str, new: str) -> None:
        """Edit the source."""
        text = self.source.read_text()
        assert old in text
        self.source.write_text(text.replace(old, new))


@pytest.fixture(scope="session")
def _made(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("made")
    Tiny(folder).load().LIBRARY.make(folder, library.machine())
    return (folder / f"{library.machine()}.kernel").read_bytes()


@pytest.fixture
def tiny(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, _made: bytes) -> Tiny:
    """Return a tiny library that has no object file yet."""
    found = Tiny(tmp_path, _made)
    monkeypatch.setattr(library, "SHIPPED", found.shipped.parent)
    monkeypatch.setattr(library, "cache_folder", lambda: found.cache)
    return found
