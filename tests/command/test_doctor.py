"""The doctor: a sound installation is well, and what is wrong is found."""

from __future__ import annotations

import json
import logging
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from sledenv.command import doctor
from sledenv.command.cli import main
from sledenv.simulation.lanes import num_threads

pytestmark = pytest.mark.jit_only


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
    assert f"{doctor.processor()}, cores {os.cpu_count()}" in out
    assert f"threads    {num_threads()}\n" in out
    assert out.count("check      ") == out.count(": right\n") == len(doctor._CHECKS)
    assert out.endswith("all is well\n")
    assert logging.getLogger("sledenv").level == logging.NOTSET


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


def fail() -> str:
    raise RuntimeError("the kernel could not be compiled")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"LIBRARY": SimpleNamespace(ready=fail)}, "sledenv doctor: the kernel could not be compiled\n"),
        ({"rigid_impact": None}, "rigid impact: TypeError: 'NoneType' object is not callable"),
        ({"INTERPRETED": True}, "NUMBA_DISABLE_JIT is set"),
        ({}, "sledenv doctor: NUMBA_NUM_THREADS = 0: must be "),
    ],
)
def test_what_is_wrong_is_found(
    changed: dict[str, Any], message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the message of what fails."""
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2" if changed else "0")
    for name, value in changed.items():
        monkeypatch.setattr(doctor, name, value)
    assert main(["doctor"]) == 1
    out, err = capsys.readouterr()
    assert out.endswith("something is wrong\n")
    assert err.startswith("sledenv doctor: ")
    assert message in err


@pytest.mark.slow
def test_the_package_as_a_module_is_the_command_and_names_every_encoding() -> None:
    """Oracle: PEP 597, under which a file that is opened without an encoding is an error."""
    strict = ["-X", "warn_default_encoding", "-W", "error::EncodingWarning"]
    assert subprocess.run([sys.executable, *strict, "-m", "sledenv", "doctor"], capture_output=True).returncode == 0
