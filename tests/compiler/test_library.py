"""Which object file is used, what is wrong with one, and how another is made."""

from __future__ import annotations

import re
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from sledenv.compiler import build, library, targets
from sledenv.compiler.targets import OTHER, machine

pytestmark = pytest.mark.jit_only
NEWER = dict.fromkeys(targets._V3, True)


def test_an_object_is_made_once_and_always_the_same(tiny: Any, caplog: Any) -> None:
    """Oracle: one that was made in another folder; the words, of which there are none the second time."""
    first = tiny.load()
    assert first.known() == tiny.known
    (file,) = tiny.cache.glob("*/*.kernel")
    assert file.read_bytes() == tiny.made
    assert f"because there is no {tiny.shipped}; kept in {file}" in caplog.text
    caplog.clear()
    assert tiny.load().LIBRARY.ready().startswith(f"{file}, made by this machine")
    assert caplog.text == ""


def test_a_shipped_object_is_used_as_it_is(tiny: Any) -> None:
    """Oracle: there is no cache folder."""
    tiny.shipped.write_bytes(tiny.made)
    assert tiny.load().LIBRARY.ready() == f"{tiny.shipped}, made when the package was built"
    assert not tiny.cache.exists()


def test_an_object_must_not_call_what_nobody_gives_it(tiny: Any) -> None:
    """Oracle: the names as ELF and Mach-O have them."""
    build.check_calls(tiny.made)
    for name in ("memset", "_memcpy", "___bzero"):
        with pytest.raises(RuntimeError, match=f"an object calls {name.lstrip('_')}: part the loop"):
            build.check_calls(tiny.made + f"\0{name}\0".encode())


DAMAGE: dict[str, tuple[Any, str]] = {
    "other sources": (lambda tiny: tiny.told(fingerprint="0" * 16), "is of other sources"),
    "changed": (lambda tiny: tiny.made[:-1] + bytes([tiny.made[-1] ^ 1]), "is damaged"),
    "cut short": (lambda tiny: tiny.made[:-100], "is damaged"),
    "other bits": (lambda tiny: tiny.told(known="0" * 32), "does not compute what it should"),
    "no bits": (lambda tiny: tiny.told(known=""), "does not compute what it should"),
    "empty": (lambda tiny: b"", "cannot be read"),
    "a list": (lambda tiny: b"[]\n" + tiny.made, "cannot be read"),
    "no words": (lambda tiny: b"{}\n" + tiny.made, "cannot be read"),
}


@pytest.mark.parametrize("place", ["shipped", "cache"])
@pytest.mark.parametrize("name", DAMAGE)
def test_a_wrong_object_is_not_used_and_another_is_made(name: str, place: str, tiny: Any, caplog: Any) -> None:
    """Oracle: the words, what it computes, and the file that is in the cache then."""
    module, (damaged, words) = tiny.load_to_copy(), DAMAGE[name]
    tiny.cache.mkdir(mode=0o700)
    own = tiny.cache / module.LIBRARY.fingerprint / tiny.shipped.name
    own.parent.mkdir()
    (tiny.shipped if place == "shipped" else own).write_bytes(damaged(tiny))
    assert module.known() == tiny.known
    assert tiny.copied == [own.parent]
    assert own.read_bytes() == tiny.made
    assert place == "cache" or f"{tiny.shipped} {words}" in caplog.text
    assert len(caplog.records) == 1


def test_a_make_that_fails_leaves_no_file(tiny: Any) -> None:
    """Oracle: the folder; the maker fails once all has been written, and says why."""
    tiny.edit("    make(", '    Path.replace = "no"\n    make(')
    with pytest.raises(RuntimeError, match=r"(?s)the kernel could not be compiled: .*'str' object is not callable"):
        tiny.load().LIBRARY.ready()
    assert [file.name for file in tiny.cache.glob("*/*")] == ["lock"]


@pytest.mark.skipif(not machine().endswith("x86_64"), reason="older processors of this kind need no other object")
def test_an_older_processor_gets_an_object_of_its_own(tiny: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: another object than that of a newer one, which computes the same."""
    tiny.edit("    make(", "    make.__globals__['machine'] = lambda: 'other'\n    make(")
    monkeypatch.setattr(library, "machine", lambda: OTHER)
    assert tiny.load().known() == tiny.known
    (file,) = tiny.cache.glob(f"*/{OTHER}.kernel")
    assert file.read_bytes().partition(b"\n")[2] != tiny.made.partition(b"\n")[2]


TARGETS = [
    *(("linux x86_64", NEWER, "linux-x86_64"), ("win32 AMD64", NEWER, "win32-x86_64"), ("darwin x86_64", NEWER, OTHER)),
    *(("linux x86_64", NEWER | {"fma": False}, OTHER), ("win32 AMD64", {}, OTHER), ("linux riscv64", {}, OTHER)),
    *(("linux aarch64", {}, "linux-aarch64"), ("darwin arm64", {}, "darwin-arm64")),
]


@pytest.mark.parametrize(("kind", "features", "target"), TARGETS)
def test_the_target_is_that_of_system_and_processor(kind: str, features: dict[str, bool], target: str) -> None:
    """Oracle: the table; x86-64 needs all that its third version has."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.platform", kind.split()[0])
        patch.setattr("platform.machine", lambda: kind.split()[1])
        patch.setattr("llvmlite.binding.get_host_cpu_features", lambda: features)
        assert machine.__wrapped__() == target


UNUSABLE = {
    "rights": "others may",
    "owner": "others may",
    "file": "cache",
    "read-only": "Read-only",
    "full": "No space",
}


@pytest.mark.skipif(sys.platform == "win32", reason="its rights are others")
@pytest.mark.parametrize("case", UNUSABLE)
def test_a_cache_folder_that_cannot_be_used_is_not(case: str, tiny: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: what is computed all the same, and the words."""
    tiny.full = case == "full"
    tiny.cache.write_text("in the way") if case == "file" else tiny.cache.mkdir(mode=0o700)
    if case == "rights":
        tiny.cache.chmod(0o770)
    if case == "owner":
        monkeypatch.setattr("os.getuid", lambda: -1)
    if case == "read-only":
        monkeypatch.setattr(library, "alone", Mock(side_effect=[OSError("Read-only file system"), nullcontext()]))
    module = tiny.load_to_copy()
    assert module.known() == tiny.known
    assert re.search(f"not kept: .*{UNUSABLE[case]}", module.LIBRARY.ready())
    assert not tiny.copied[0].is_relative_to(tiny.cache)


@pytest.mark.jit_only
@pytest.mark.skipif(sys.platform != "linux", reason="holds address space as Linux does")
@pytest.mark.parametrize("pages", [1, 8, 32])
def test_an_object_is_loaded_where_free_memory_is_in_pieces(pages: int) -> None:
    """Oracle: what known descents come to; holes of some pages, gigabytes apart, into which no object fits as a whole.

    Its parts in different holes were further apart than their references to one another reach, and the process died.
    """
    program = Path(__file__).with_name("pieces.py")
    done = subprocess.run([sys.executable, str(program), str(pages)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-500:]
    assert done.stdout.startswith(("True", "no address space"))


def test_two_processes_at_once_make_one_object(tiny: Any) -> None:
    """Oracle: one of them says that it makes one; both compute."""
    both = [tiny.start("print(tiny.known())") for _ in range(2)]
    said = [process.communicate() for process in both]
    assert [out for out, _ in said] == [f"{tiny.known}\n"] * 2
    assert "".join(err for _, err in said).count("compiling the kernel") == 1


def test_an_edited_source_has_another_fingerprint(tiny: Any) -> None:
    """Oracle: the fingerprints before, after, and with another source."""
    before = tiny.load().LIBRARY.fingerprint
    tiny.edit("1e-3", "1.1e-3")
    after = tiny.load().LIBRARY.fingerprint
    tiny.source.with_name("other.py").touch()
    assert len({before, after, tiny.load().LIBRARY.fingerprint}) == 3
