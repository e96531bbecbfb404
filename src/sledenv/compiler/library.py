"""A library of compiled entries: an object file made when the package was built, or by this machine when none fits.

An object file has a line of JSON before the object itself: the target, what it was made of, the digest of the rest, and
what known descents must give.
"""

from __future__ import annotations

import functools
import hashlib
import json
import logging
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import llvmlite.binding as llvm

from sledenv.compiler.entries import Entry, Kind
from sledenv.compiler.targets import machine
from sledenv.machine.files import alone

SHIPPED: Final = Path(__file__).parents[1] / "objects"  # of the package, made when that was built
_MADE = "sledenv: compiling the kernel for this machine, which takes about a minute, because %s; kept in %s"
_KEPT = 4  # files that this machine has made, each of other sources
_log = logging.getLogger("sledenv")


def cache_folder() -> Path:
    """Folder for what this machine makes for itself, in the user's cache folder."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "sledenv"
    users = "~/Library/Caches" if sys.platform == "darwin" else os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(users).expanduser() / "sledenv"


def _own_folder() -> Path:
    """Make the cache folder, into which nobody else may put code for this user to run."""
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    if sys.platform != "win32" and (folder.stat().st_mode & 0o022 or folder.stat().st_uid != os.getuid()):
        raise OSError(f"others may write to {folder}")
    return folder


class Library:
    """Entries that are compiled together.

    Parameters
    ----------
    maker : Path
        Program that makes object files when it is given a folder and targets: see :mod:`sledenv.compiler.build`.
    *sources : Path
        Folders with all Python files that object files are made of.
    """

    def __init__(self, maker: Path, *sources: Path) -> None:
        self.entries: dict[str, Entry] = {}
        self.known: Callable[[], str] = str  # gives what known descents come to
        self._maker, self._sources = maker, sources
        self._lock = threading.RLock()
        self._engine: Any = None
        self._used = ""

    def entry(self, name: str, function: Callable[..., None], *kinds: Kind) -> Entry:
        """Add an entry: see :class:`sledenv.compiler.entries.Entry`."""
        self.entries[name] = Entry(name, function, *kinds, find=self.find)
        return self.entries[name]

    @functools.cached_property
    def fingerprint(self) -> str:
        """Digest of the sources."""
        digest = hashlib.sha256()
        for source in sorted(file for folder in self._sources for file in folder.glob("*.py")):
            digest.update(f"{source.parent.name}/{source.name}\n{source.read_text(encoding='utf-8')}".encode())
        return digest.hexdigest()[:16]

    def ready(self) -> str:
        """Load an object file, made now if none fits, unless one is; return which it is and why.

        Raises
        ------
        RuntimeError
            If none can be made.
        """
        with self._lock:
            if self._engine is None:
                self._find_object()
            return self._used

    def find(self, name: str) -> int:
        """Address of the function of an entry."""
        self.ready()
        return int(self._engine.get_function_address(f"sledenv_{name}"))

    def _find_object(self) -> None:
        why = self._take(SHIPPED / f"{machine()}.kernel", "made when the package was built")
        if why:
            try:
                self._use_own(_own_folder() / self.fingerprint, why)
            except (OSError, RuntimeError) as error:  # a full disk, say, must not end a simulation
                with tempfile.TemporaryDirectory() as scratch:
                    self._use_own(Path(scratch), f"{why}; not kept: {error}")

    def _use_own(self, folder: Path, why: str) -> None:
        """Load the object file of this machine in a folder, made there unless it is."""
        file, reason = folder / f"{machine()}.kernel", f"made by this machine, because {why}"
        if not self._take(file, reason):
            return
        folder.mkdir(exist_ok=True)
        with alone(folder / "lock"):
            wrong = self._take(file, reason)
            if wrong:  # no other process has made it meanwhile
                _log.warning(_MADE, why, file)
                self.make(folder, machine())
                wrong = self._take(file, reason)
        if wrong:
            raise RuntimeError(f"the compiled kernel cannot be used: {wrong}")
        before = sorted(folder.parent.glob("*/*.kernel"), key=lambda kept: kept.stat().st_mtime)
        for old in before[:-_KEPT] if folder.parent == cache_folder() else ():
            shutil.rmtree(old.parent, ignore_errors=True)

    def make(self, folder: Path, *targets: str) -> None:
        """Make the object files of some targets, each whole or not at all, in a process of its own.

        Raises
        ------
        RuntimeError
            If that fails, with what it said.
        """
        command = [sys.executable, str(self._maker), str(folder), *targets]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"the kernel could not be compiled: {' '.join(command)}: {done.stderr.strip()[-2000:]}")

    def _take(self, file: Path, what: str) -> str:
        """Load an object file and see whether it is right; return what is wrong."""
        try:
            header, _, content = file.read_bytes().partition(b"\n")
            about = json.loads(header)
            if about["fingerprint"] != self.fingerprint:
                return f"{file} is of other sources"
            if about["sha256"] != hashlib.sha256(content).hexdigest():
                return f"{file} is damaged"
            known = about["known"]
        except FileNotFoundError:
            return f"there is no {file}"
        except (OSError, ValueError, KeyError, TypeError) as error:
            return f"{file} cannot be read: {error}"
        self.load(content)
        if self.known() != known:
            self.unload()
            return f"{file} does not compute what it should"
        self._used = f"{file}, {what}"
        return ""

    def load(self, content: bytes) -> None:
        """Load an object."""
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        native = llvm.Target.from_default_triple().create_target_machine()
        # All parts in one block: separate ones may be further apart than their references to one another reach.
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), native, use_lmm=True)
        engine.add_object_file(llvm.ObjectFileRef.from_data(content))
        engine.finalize_object()
        self._engine = engine

    def unload(self) -> None:
        """Forget what has been loaded."""
        self._engine = None
        for entry in self.entries.values():
            entry.forget()
