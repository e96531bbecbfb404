"""Processes that make calls: each call is made once, and they end with the process that has started them."""

from __future__ import annotations

import contextlib
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
    for _ in runner(2)([(call, (Path(sys.argv[1], str(i)),)) for i in range(int(sys.argv[2]))]):
        pass
"""


@pytest.mark.parametrize("workers", [1, 2])
def test_every_call_is_made_and_its_value_yielded(workers: int) -> None:
    """Oracle: the built-in function."""
    assert sorted(runner(workers)([(pow, (i, 2)) for i in range(5)])) == [0, 1, 4, 9, 16]


# Python loads this first: a worker says that it is being started, and takes a while.
SLOW_START = """
import pathlib, sys, time
if any("loky" in word and "popen" in word for word in sys.orig_argv):
    pathlib.Path(__file__).with_name(f"{sys.orig_argv[-1]}.started").touch()
    time.sleep(1.0)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="an orphan is not told")
@pytest.mark.parametrize("killed", ["while they work", "while they are started"])
def test_workers_end_with_a_parent_that_is_killed(killed: str, tmp_path: Path) -> None:
    """Oracle: the pipe that they have all inherited, which ends with the last of them; trackers have it too."""
    script, made = tmp_path / "calls.py", tmp_path / "made"
    script.write_text(CALLS)
    made.mkdir()
    path = [str(tmp_path), *sys.path]
    started = killed == "while they are started"
    if started:
        (tmp_path / "sitecustomize.py").write_text(SLOW_START)
    command = [sys.executable, str(script), str(made), "1" if started else "4"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, env=os.environ | {"PYTHONPATH": os.pathsep.join(path)}, start_new_session=True
    )
    try:
        while len(list(tmp_path.glob("*.started") if started else made.iterdir())) < 2:
            assert process.poll() is None
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL)
        assert process.communicate(timeout=120.0)[0] == b""
    finally:  # a worker that lives on would hold the pipe of the tests as well
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
