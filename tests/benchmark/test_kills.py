"""A run that is killed leaves nothing that looks complete, and the same command goes on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import load_run, train
from sledenv.machine.files import alone

FOLDER = "sled_mat-launch-spin-dies-s0"
AGENT = """
import os, signal

import numpy as np

class Agent:
    @classmethod
    def train(cls, problem, settings, seed, folder):
        (folder / "half").write_text("half")
        if "DIE" in os.environ:
            os.kill(os.getpid(), signal.SIGKILL)

    @classmethod
    def load(cls, problem, folder):
        return cls()

    def act(self, observations):
        return np.zeros((len(observations), 1), np.float32)
"""
PROGRAM = """
import sys
from pathlib import Path
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import train
train("dies", Problem("sled_mat", "launch"), {}, 0, Path(sys.argv[1]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="kills as POSIX has them")
def test_a_killed_training_leaves_no_run_and_the_next_one_removes_its_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the folder after SIGKILL, and after the same command has ended."""
    (tmp_path / "dies.py").write_text(AGENT)
    folder = tmp_path / "runs" / FOLDER
    environment = os.environ | {"DIE": "1"}
    done = subprocess.run([sys.executable, "-c", PROGRAM, str(folder)], cwd=tmp_path, env=environment)
    (left,) = folder.parent.iterdir()
    assert (done.returncode, left.suffix) == (-signal.SIGKILL, ".part")

    monkeypatch.chdir(tmp_path)
    problem = Problem("sled_mat", "launch")
    with alone(left / ".lock"):  # as if it were not dead: another one trains the same
        train("dies", problem, {}, 0, folder)
    assert sorted(folder.parent.iterdir()) == sorted([left, folder])
    train("dies", problem, {}, 0, folder)
    assert list(folder.parent.iterdir()) == [folder]
    load_run(folder)
