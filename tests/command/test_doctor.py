"""What the doctor finds in a sound installation, and that it finds what is wrong."""

from __future__ import annotations

import json
import logging
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from sledenv.command import doctor
from sledenv.command.cli import main
from sledenv.simulation.lanes import num_threads

pytestmark = pytest.mark.jit_only

Ill = Callable[..., str]


def test_a_sound_installation_is_well(capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the file of the kernel is there, so nothing is left to be compiled."""
    main(["doctor"])
    capsys.readouterr()
    assert main(["doctor"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    for name in ("Python", *doctor.PACKAGES):
        assert re.search(rf"{name} (\d|not installed)", out), name
    (kernel,) = re.findall(r"^kernel     (\S+\.kernel), made ", out, re.MULTILINE)
    assert Path(kernel).is_file()
    assert re.search(r"FMA (yes|no|unknown), AVX2 (yes|no|unknown), cores \d+", out)
    assert f"threads    {num_threads()}\n" in out
    assert out.count("check      ") == out.count(": right\n") == len(doctor._CHECKS)
    assert out.endswith("all is well\n")
    assert logging.getLogger("sledenv").level == logging.NOTSET


@pytest.fixture
def ill(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Ill:
    """Message of a doctor that finds something wrong."""

    def run(**changed: object) -> str:
        for name, value in changed.items():
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
    monkeypatch.setattr(doctor, "_FIRST", doctor._FIRST | {"u_after": 0.73720907727848})
    assert main(["doctor", "--json"]) == 1
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert "reference descent: u_after = 0.737209077558" in found["problems"][0]
    assert "at the first rebound, not 0.73720907727848" in err
    assert found["report"]["check"][0] == "reference descent: wrong"
    assert f"versions   {found['report']['versions'][0]}\n" in err


def test_a_kernel_that_cannot_be_used_is_found(ill: Ill) -> None:
    """Oracle: the message of what loads it."""

    def fail() -> str:
        raise RuntimeError("the kernel could not be compiled")

    assert "sledenv doctor: the kernel could not be compiled\n" in ill(LIBRARY=SimpleNamespace(ready=fail))


def test_a_number_of_threads_that_is_none_is_found(ill: Ill, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", "0")
    assert "sledenv doctor: NUMBA_NUM_THREADS = 0: must be " in ill()


def test_a_check_that_fails_is_found(ill: Ill) -> None:
    assert "rigid impact: TypeError: 'NoneType' object is not callable" in ill(rigid_impact=None)


def test_kernels_that_are_not_compiled_at_all_are_found(ill: Ill) -> None:
    assert "NUMBA_DISABLE_JIT is set" in ill(INTERPRETED=True)


@pytest.mark.slow
def test_the_package_as_a_module_is_the_command_and_names_every_encoding() -> None:
    """Oracle: PEP 597, under which a file that is opened without an encoding is an error."""
    strict = ["-X", "warn_default_encoding", "-W", "error::EncodingWarning"]
    assert subprocess.run([sys.executable, *strict, "-m", "sledenv", "doctor"], capture_output=True).returncode == 0
