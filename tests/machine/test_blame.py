"""Whose fault an error is."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from sledenv.machine.blame import GivenCodeError, attribute_errors_to

WHOSE = "agent mine, scenario sled_mat"


def save(wrapped: bool) -> None:
    try:
        Path("/dev/full").write_text("weights")
    except OSError:
        if wrapped:
            raise RuntimeError("cannot save") from None
        raise


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no device that is full")
@pytest.mark.parametrize("wrapped", [False, True])
def test_a_full_disk_is_not_the_fault_of_the_agent(wrapped: bool) -> None:
    """Oracle: a device that is full, whatever the agent makes of its error."""
    with (
        pytest.raises(OSError, match=f"{WHOSE}: train: No space left on device") as raised,
        attribute_errors_to(WHOSE, "train"),
    ):
        save(wrapped)
    assert not isinstance(raised.value, GivenCodeError)


def test_the_file_that_a_full_disk_has_left_out_is_named() -> None:
    with pytest.raises(OSError, match=r"exceeded: model\.zip was not written"), attribute_errors_to(WHOSE, "train"):
        raise OSError(errno.EDQUOT, "Disk quota exceeded", "model.zip")


def test_other_errors_of_files_are_those_of_the_agent() -> None:
    """Oracle: a file that is not there is what the agent asked for."""
    with (
        pytest.raises(GivenCodeError, match=r"train raised FileNotFoundError: .*model\.zip"),
        attribute_errors_to(WHOSE, "train"),
    ):
        Path("none/model.zip").read_bytes()
