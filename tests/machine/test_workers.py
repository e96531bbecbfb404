"""Processes that make calls: each call is made once, and they end with the process that has started them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sledenv.machine.workers import runner

CALLS = """
import sys, time
from pathlib import Path
from sledenv.machine.workers import runner

def call(place):
    place.touch()
    time.sleep(600.0)

if __name__ == "__main__":
    for _ in runner(2)([(call, (Path(sys.argv[1], str(i)),)) for i in range(4)]):
        pass
"""


@pytest.mark.parametrize("workers", [1, 2])
def test_every_call_is_made_and_its_value_yielded(workers: int) -> None:
    """Oracle: the built-in function."""
    assert sorted(runner(workers)([(pow, (i, 2)) for i in range(5)])) == [0, 1, 4, 9, 16]


@pytest.mark.skipif(sys.platform == "win32", reason="an orphan is not told")
def test_workers_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    """Oracle: the pipe that they have all inherited, which ends with the last of them."""
    script = tmp_path / "calls.py"
    script.write_text(CALLS)
    (tmp_path / "made").mkdir()
    command = [sys.executable, str(script), str(tmp_path / "made")]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    )
    while len(list((tmp_path / "made").iterdir())) < 2:
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    assert process.stdout is not None
    assert process.stdout.read() == b""
    process.stdout.close()
    process.wait()
