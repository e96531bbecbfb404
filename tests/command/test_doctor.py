"""What the doctor finds in a sound installation, and that it finds what is wrong."""

from __future__ import annotations

import errno
import json
import logging
import re
from collections.abc import Callable
from pathlib import Path

import numba
import pytest

from sledenv.command import doctor
from sledenv.command.cli import main
from sledenv.compiler import entries

pytestmark = pytest.mark.jit_only

Ill = Callable[..., str]


def test_a_sound_installation_is_warmed_and_well(capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: after one examination nothing is left to be compiled, and the folder holds kernels."""
    main(["doctor"])
    capsys.readouterr()
    assert main(["doctor"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for name in ("Python", *doctor.PACKAGES):
        assert re.search(rf"{name} (\d|not installed)", out), name
    assert f"numba {numba.__version__}" in out
    assert out.count("kernels    ") == len(doctor._KERNELS)
    assert "compiled in" not in out
    assert re.search(r"FMA (yes|no|unknown), AVX2 (yes|no|unknown), cores \d+", out)
    assert re.search(rf"threads    {numba.get_num_threads()}, layer \w+", out)
    kept = int(re.findall(r"(\d+) kernels, ", out)[-1])
    assert (
        kept >= sum(entry.compiled + entry.loaded for entry in entries.entries() if "sledenv" in entry.__module__) > 5
    )
    assert out.endswith("all is well\n")
    assert logging.getLogger("sledenv").level == logging.NOTSET


@pytest.fixture
def ill(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Ill:
    """Message of a doctor that finds something wrong; the kernels are left out."""

    def run(**changed: object) -> str:
        for name, value in ({"_KERNELS": ()} | changed).items():
            monkeypatch.setattr(doctor, name, value)
        assert main(["doctor"]) == 1
        out, err = capsys.readouterr()
        assert out.endswith("something is wrong\n")
        assert err.startswith("sledenv doctor: ")
        assert "Traceback" not in err
        return err

    return run


def test_what_was_found_is_told_to_a_program(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the same lines, on standard error while they become known; a digit that is 2.8e-10 off."""
    monkeypatch.setattr(doctor, "_KERNELS", ())
    monkeypatch.setattr(doctor, "_FIRST", doctor._FIRST | {"u_after": 0.73720907727848})
    assert main(["doctor", "--json"]) == 1
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert "reference descent: u_after = 0.737209077558" in found["problems"][0]
    assert "at the first rebound, not 0.73720907727848" in err
    assert found["report"]["check"][0] == "reference descent: wrong"
    assert f"versions   {found['report']['versions'][0]}\n" in err


def test_a_cache_that_cannot_be_written_is_found(ill: Ill, tmp_path: Path) -> None:
    assert "no cache folder can be written" in ill(cache_folder=lambda: None)
    (tmp_path / "file").write_text("in the way")
    err = ill(cache_folder=lambda: tmp_path / "file" / "cache")
    assert f"the cache folder cannot be written: [Errno 20] Not a directory: '{tmp_path / 'file' / 'cache'}'" in err


def test_a_full_disk_is_found(ill: Ill, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A small file can be written, a kernel cannot; it computes all the same."""

    def full(*given: object, **options: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(entries, "_entries", [])
    monkeypatch.setattr(entries, "_told", set())
    monkeypatch.setattr(entries, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(numba.core.caching.IndexDataCacheFile, "save", full)
    kernels = (("one kernel", lambda: entries.entry(halved)(3.0)),)
    err = ill(_KERNELS=kernels, _CHECKS=(), cache_folder=lambda: tmp_path)
    assert err == "sledenv doctor: compiled kernels cannot be kept: [Errno 28] No space left on device\n"


def test_damaged_files_are_found_and_replaced(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for module in (entries, doctor):
        monkeypatch.setattr(module, "cache_folder", lambda: tmp_path / "cache")
    monkeypatch.setattr(entries, "_entries", [])
    monkeypatch.setattr(doctor, "_KERNELS", (("one kernel", lambda: entries.entry(halved)(3.0)),))
    monkeypatch.setattr(doctor, "_CHECKS", ())
    said = []
    for damage in (None, None, b"x", None):
        if damage:
            (path,) = tmp_path.rglob("*.nbc")
            path.write_bytes(damage)
        assert main(["doctor"]) == 0
        out, err = capsys.readouterr()
        assert err == ""
        said += re.findall(r"one kernel: (\w+) in \S+ s(.*)", out)
        assert ": 1 kernels, " in out
    assert said == [("compiled", ""), ("ready", ""), ("compiled", f", in place of a damaged {path}"), ("ready", "")]


def halved(x: float) -> float:
    return 0.5 * x


def test_a_kernel_that_does_not_compile_is_found(ill: Ill) -> None:
    def fail() -> None:
        raise RuntimeError("no such instruction")

    assert "a batch: RuntimeError: no such instruction" in ill(_KERNELS=(("a batch", fail),))
    assert "rigid impact: TypeError: 'NoneType' object is not callable" in ill(rigid_impact=None)


def test_kernels_that_are_not_compiled_at_all_are_found(ill: Ill, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 1)
    assert "NUMBA_DISABLE_JIT is set" in ill()
