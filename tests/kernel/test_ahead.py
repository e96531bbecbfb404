"""A helper compiles kernels for a process that would compile them otherwise: same results, and nothing stays behind."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from sledenv import Body, ContactLaw, Slope, State, simulate
from sledenv.kernel import ahead, jit
from sledenv.launches import Solver

pytestmark = pytest.mark.jit_only

KERNELS = """
from typing import NamedTuple

import numpy as np

from sledenv.kernel.jit import kernel


class Law(NamedTuple):
    factor: float


@kernel
def first(law: Law, c: np.ndarray, z: np.ndarray, counts: tuple[int, float], number: int) -> float:
    return law.factor * (c[0, 0] + z[0] + counts[0] + counts[1] + number)


@kernel
def second(law: Law) -> float:
    return law.factor + 1.0


@kernel
def both(law: Law, c: np.ndarray, z: np.ndarray) -> float:
    return first(law, c, z, (1, 2.0), 3) + second(law)
"""
# Prints the result and by whom each kernel was compiled, and then the process of the helper.
RUN = """
import sys
import numpy as np
from numba.core.event import install_recorder
from sledenv.kernel import ahead
ahead._CALLERS = ("sledenv.kernel.kernels",)
ahead._TASKS = {"Law": ("kernels.first", "kernels.second")}
helpers = []
class Helper(ahead._Helper):
    def __init__(self, *arguments):
        super().__init__(*arguments)
        helpers.append(self._process)
ahead._Helper = Helper
WITH
from sledenv.kernel.kernels import Law, both
def run():
    with install_recorder("numba:compile") as events:
        result = both(Law(2.0), np.ones((1, 1)), np.ones(1))
    names = {event.data["dispatcher"].__name__ for _, event in events.buffer}
    assert ahead._helper is None
    assert all(process.returncode is not None for process in helpers)
    print(result, *(name for name in ("first", "second", "both") if name in names), sep=",")
    print(*(process.pid for process in helpers))
"""
ALONE = ["19.0", "first", "second", "both"]
HELPED = ["19.0", "both"]
Run = Callable[..., list[str]]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Call a kernel of a small copy of the package for the first time, in a fresh process."""
    folder = tmp_path / "site" / "sledenv" / "kernel"
    folder.mkdir(parents=True)
    for module in (ahead, jit):
        shutil.copy(str(module.__file__), folder)
    for package in (folder.parent, folder):
        (package / "__init__.py").touch()
    (folder / "records.py").write_text("OUTCOME = REBOUND = TRAJECTORY = [('t', 'f8')]\n")
    (folder / "kernels.py").write_text(KERNELS)

    def run(patch: str = "", end: str = "run()", helpers: int = 1, **environment: str) -> list[str]:
        inherited = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
        given = {"PYTHONPATH": str(folder.parents[1]), "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_NUM_THREADS": "2"}
        done = subprocess.run(
            [sys.executable, "-c", RUN.replace("WITH", patch) + end],
            env=inherited | given | environment,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
            timeout=60.0,
        )
        assert "Traceback" not in done.stderr
        result, processes = done.stdout.splitlines()
        assert len(processes.split()) == helpers
        for process in processes.split():
            with pytest.raises(ProcessLookupError):
                os.kill(int(process), 0)
        assert not list(tmp_path.rglob("*.tmp.*"))
        return result.split(",")

    return run


def test_a_helper_compiles_what_is_listed_for_the_types_that_are_called(run: Run) -> None:
    assert run() == HELPED
    assert run(helpers=0) == ["19.0"]  # all is cached


def test_what_is_cached_needs_no_helper(run: Run) -> None:
    run()
    clear = "from sledenv.kernel import jit\n[f.unlink() for f in jit.cache_folder().glob('kernels.both-*')]"
    assert run(clear, helpers=0) == HELPED


@pytest.mark.parametrize(
    "program",
    [
        "import os; os.abort()",
        "raise SystemExit",
        "print('kernels.first', flush=True)",  # it is not there
        "print('kernels.first\\xff' * 100000)",
        "import time; time.sleep(600)",
    ],
)
def test_without_an_answer_of_the_helper_the_process_goes_on_alone(run: Run, program: str) -> None:
    assert run(f"ahead._PROGRAM = {program!r} + '#{{}}{{}}{{}}'; ahead._LONGEST = .5") == ALONE


@pytest.mark.parametrize(
    "patch",
    [
        "sys.executable = '/nowhere/python'",
        "sys.executable = '/bin/cat'",
        "sys.executable = ''",
        "sys.executable = None",
        "import multiprocessing; multiprocessing.parent_process = lambda: 1",
    ],
)
def test_where_no_helper_can_be_started_there_is_none(run: Run, patch: str) -> None:
    assert run(patch, helpers=0) == ALONE


def test_one_core_or_no_cache_leave_nothing_to_help_with(run: Run, tmp_path: Path) -> None:
    assert run(helpers=0, NUMBA_NUM_THREADS="1") == ALONE
    (tmp_path / "file").touch()
    nowhere = {"NUMBA_CACHE_DIR": str(tmp_path / "file"), "XDG_CACHE_HOME": str(tmp_path / "file")}
    shutil.rmtree(tmp_path / "site" / "sledenv" / "kernel" / "__pycache__", ignore_errors=True)
    (tmp_path / "site" / "sledenv" / "kernel" / "__pycache__").touch()
    assert run(helpers=0, **nowhere) == ALONE


def test_a_helper_that_would_use_another_cache_compiles_nothing(run: Run, tmp_path: Path) -> None:
    change = f"import os; from sledenv.kernel import jit; jit.cache_folder(); os.environ['NUMBA_CACHE_DIR'] = {'{}'!r}"
    assert run(change.format(tmp_path / "other")) == ALONE
    assert not list((tmp_path / "other").rglob("*.nbc"))


def test_an_interrupt_ends_the_helper(run: Run) -> None:
    """As of Ctrl-C while the process waits; the next call compiles."""
    sleeping = "ahead._PROGRAM = 'import time; time.sleep(600) #{}{}{}'; ahead._LONGEST = 60.0"
    interrupted = """
import signal, threading
threading.Timer(1.0, signal.pthread_kill, [threading.main_thread().ident, signal.SIGINT]).start()
try:
    both(Law(2.0), np.ones((1, 1)), np.ones(1))
except KeyboardInterrupt:
    assert helpers[0].returncode == -signal.SIGKILL
    ahead._TASKS = {}
    run()
"""
    assert run(sleeping, interrupted) == ALONE


def test_a_helper_ends_with_the_process_that_it_helps(tmp_path: Path) -> None:
    """The system closes the pipes of a process, however that ends."""
    program = ahead._PROGRAM.format(sys.path, "folder", ()).replace(
        "work(", "import time; from sledenv.kernel import jit; jit.cache_folder = lambda: time.sleep(600); work("
    )
    with subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE) as process:
        assert process.stdin is not None
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(3.0)
        process.stdin.close()
        assert process.wait(10.0) == 0


@pytest.mark.slow
@pytest.mark.parametrize(("solver", "law"), [("compliant", "ContactLaw"), ("rigid", "RigidLaw")])
def test_a_first_descent_is_the_same_with_a_helper(solver: Solver, law: str, tmp_path: Path) -> None:
    """Oracle: this process, whose kernels come from another cache. All that is listed is compiled by the helper."""
    program = f"""
from numba.core.event import install_recorder
from tests.kernel.test_ahead import digest
with install_recorder("numba:compile") as events:
    print(digest({solver!r}))
functions = {{event.data["dispatcher"].py_func for _, event in events.buffer}}
print(*(f"{{function.__module__.rpartition('.')[2]}}.{{function.__qualname__}}" for function in functions))
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_NUM_THREADS": "2"},
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=True,
    )
    found, names = done.stdout.splitlines()
    assert found == digest(solver)
    assert "descend.descend" in names.split()
    assert not set(ahead._TASKS[law]) & set(names.split())


def digest(solver: Solver) -> str:
    """All digits of a descent; there is anything in the bytes between them."""
    body, law = Body(1.0, 0.1, 0.05, 0.0075), ContactLaw(1e6, 0.5, 0.1, 0.001)
    found = simulate(body, law, Slope(0.17), State(0.0, 0.5, 0.7), solver=solver, record="trajectory")
    rows = [part.tolist() for part in (found.outcome, found.rebounds, found.trajectory)]
    return hashlib.sha256(repr(rows).encode()).hexdigest()
