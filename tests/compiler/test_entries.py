"""Where compiled kernels are kept, when they are compiled again, and what a user is told meanwhile."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba import prange
from numba.extending import overload

from sledenv.compiler import entries, jit
from sledenv.compiler.entries import Entry, entry, parallel_entry
from sledenv.compiler.jit import kernel
from sledenv.machine import files

pytestmark = pytest.mark.jit_only

CALLEE = """
from sledenv.compiler.jit import kernel


@kernel
def doubled(x):
    return 2.0 * x
"""
CALLER = """
import os
import pathlib
import signal
import sys
import time

from numba.extending import overload

from sledenv.compiler.entries import entry
from sledenv.kernel.callee import doubled
from sledenv.compiler.jit import kernel


def compiling():
    pass


@overload(compiling)
def _():
    exec(os.environ.get("WHILE_COMPILING", ""))
    return lambda: None


@kernel
def doubled_and_one(x):
    compiling()
    return doubled(x) + 1.0


f = entry(doubled_and_one)
"""
# Prints the result, how many kernels were compiled and how many were found, and the folder.
RUN = """
from sledenv.compiler import entries
from sledenv.kernel.caller import f
print(f(3.0), f.compiled, f.loaded, entries.cache_folder())
"""
# A process never loses its patience, however slow the machine is,
PATIENT = """
import threading
class Timer(threading.Timer):
    def start(self):
        pass
threading.Timer = Timer
"""
# or at once when it starts to compile.
IMPATIENT = """
import threading
class Timer(threading.Timer):
    def start(self):
        self.function(*self.args)
threading.Timer = Timer
"""
Line = tuple[float, int, int, str]
Run = Callable[..., Line]


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Folder of the kernel of a small copy of the package, with the real entries."""
    folder = tmp_path / "site" / "sledenv" / "kernel"
    folder.mkdir(parents=True)
    for module in (jit, entries, files):
        name = module.__name__.split(".")[1]
        folder.with_name(name).mkdir(exist_ok=True)
        (folder.with_name(name) / "__init__.py").touch()
        shutil.copy(str(module.__file__), folder.with_name(name))
    (folder / "__init__.py").touch()
    (folder.parent / "__init__.py").touch()
    (folder / "callee.py").write_text(CALLEE)
    (folder / "caller.py").write_text(CALLER)
    return folder


@pytest.fixture
def start(package: Path, tmp_path: Path) -> Callable[..., subprocess.Popen[str]]:
    """Start a fresh process of a user who has a home and the small package."""

    def start(program: str = RUN, **environment: str) -> subprocess.Popen[str]:
        inherited = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
        given = {"PYTHONPATH": str(package.parents[1]), "XDG_CACHE_HOME": str(tmp_path / "home")} | environment
        pipe = subprocess.PIPE
        command = [sys.executable, "-c", program if IMPATIENT in program else PATIENT + program]
        return subprocess.Popen(command, env=inherited | given, cwd=tmp_path, stdout=pipe, stderr=pipe, text=True)

    return start


@pytest.fixture
def run(start: Callable[..., subprocess.Popen[str]]) -> Run:
    """Run the small package in a fresh process, which says ``err`` on standard error."""

    def run(program: str = RUN, err: str | None = "", **environment: str) -> Line:
        with start(program, **environment) as process:
            out, said = process.communicate()
        assert process.returncode == 0, said
        assert err is None or said == err
        run.err = said  # type: ignore[attr-defined]
        return line_of(out)

    return run


def line_of(out: str) -> Line:
    result, compiled, loaded, folder = out.split(maxsplit=3)
    return float(result), int(compiled), int(loaded), folder.strip()


def nobody_can_write_beside(package: Path) -> None:
    """Make the folder of caches beside the sources impossible, for root as well."""
    shutil.rmtree(package / "__pycache__", ignore_errors=True)
    (package / "__pycache__").write_text("in the way")


def change_callee(package: Path) -> None:
    """From here on the result is 16, not 7.

    The file has another length: Python takes old byte code for a file of the same length and the same second.
    """
    (package / "callee.py").write_text(CALLEE.replace("2.0", "5.00"))


# ---- which code runs


def test_a_change_of_an_imported_kernel_is_never_answered_by_old_machine_code(package: Path, run: Run) -> None:
    """A cache of numba's own goes on with the old machine code of the callee."""
    before = run()
    assert before[:3] == (7.0, 1, 0)
    assert Path(before[3]).parent == package / "__pycache__"
    change_callee(package)
    after = run()
    assert after[:3] == (16.0, 1, 0)
    assert after[3] != before[3]
    (package / "callee.py").write_text(CALLEE)  # going back finds what was compiled then
    assert run() == (7.0, 0, 1, before[3])


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(numba.config, "CACHE_LOCATOR_CLASSES"), reason="this numba has no such setting")
def test_old_files_of_numba_s_own_are_not_taken(package: Path, run: Run) -> None:
    """Here numba keeps nothing in the folder that it is given, but beside the sources."""
    elsewhere = {"NUMBA_CACHE_LOCATOR_CLASSES": "InTreeCacheLocator"}
    assert run(err=None, **elsewhere)[0] == 7.0
    assert "cannot be kept" in run.err  # type: ignore[attr-defined]
    assert list((package / "__pycache__").glob("caller.*.nbi"))
    change_callee(package)
    assert run(err=None, **elsewhere)[0] == 16.0
    assert run()[:3] == (16.0, 1, 0)


def test_bounds_checks_are_not_taken_from_a_cache_without(run: Run) -> None:
    plain = run()
    checked = run(NUMBA_BOUNDSCHECK="1")
    assert checked[:3] == (7.0, 1, 0)
    assert checked[3] != plain[3]


# ---- where it is kept


def test_only_a_few_states_of_the_sources_are_kept(package: Path, run: Run) -> None:
    parent = Path(run()[3]).parent
    states = [f"sledenv-{i:016x}" for i in range(entries._KEPT)]
    for i, name in enumerate((*states, "sledenv-results")):
        (parent / name).mkdir()
        os.utime(parent / name, (i, i))
    change_callee(package)
    newest = Path(run()[3])
    left = {path.name for path in parent.glob("sledenv-*")}
    assert len(left) == entries._KEPT + 1
    assert {newest.name, "sledenv-results"} < left  # one who sets NUMBA_CACHE_DIR may have folders there
    assert set(states[:2]).isdisjoint(left)


def test_numba_cache_dir_comes_first(package: Path, tmp_path: Path, run: Run) -> None:
    folder = run(NUMBA_CACHE_DIR=str(tmp_path / "chosen"))[3]
    assert folder.startswith(str(tmp_path / "chosen"))
    assert list(Path(folder).rglob("caller.*.nbc"))
    assert not list(package.rglob("*.nbc"))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="its modes say nothing about who may write")
def test_a_folder_that_others_may_write_to_is_told(tmp_path: Path, run: Run) -> None:
    """Once a process; the sticky bit keeps no one from putting a folder of compiled code there first."""
    chosen = tmp_path / "chosen"
    chosen.mkdir()
    for mode in (0o777, 0o1777):
        chosen.chmod(mode)
        run(RUN.replace("f(3.0)", "f(3.0) + f(3)"), err=None, NUMBA_CACHE_DIR=str(chosen))
        (line,) = run.err.splitlines()  # type: ignore[attr-defined]
        assert line.startswith(f"sledenv: others may write to {chosen}, from which compiled code is read")
    chosen.chmod(0o775)  # a group of one's own is usual
    assert run(NUMBA_CACHE_DIR=str(chosen))[:3] == (7.0, 0, 1)


def test_a_read_only_installation_is_cached_in_the_user_s_folder(package: Path, tmp_path: Path, run: Run) -> None:
    nobody_can_write_beside(package)
    first = run()
    assert first[:3] == (7.0, 1, 0)
    assert Path(first[3]).parent == tmp_path / "home" / "numba"
    assert run() == (7.0, 0, 1, first[3])


def test_without_any_folder_to_write_to_kernels_still_run_and_it_is_told_how_to_get_one(
    package: Path, tmp_path: Path, run: Run
) -> None:
    nobody_can_write_beside(package)
    (tmp_path / "home").write_text("in the way")
    assert run(IMPATIENT + RUN, err=None) == (7.0, 1, 0, "None")
    assert "set NUMBA_CACHE_DIR" in run.err  # type: ignore[attr-defined]


def test_a_cache_that_can_no_longer_be_written_ends_no_simulation(run: Run) -> None:
    program = """
import shutil
from sledenv.compiler import entries
folder = entries.cache_folder()
from sledenv.kernel.caller import f
shutil.rmtree(folder.parent)
folder.parent.write_text("in the way")
print(f(3.0) + f(3), f.compiled, f.loaded, folder)
"""
    assert run(program, err=None)[:3] == (14.0, 2, 0)
    assert run.err.count("compiled kernels cannot be kept") == 1  # type: ignore[attr-defined]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no limits of resources")
def test_a_full_disk_ends_no_simulation(run: Run) -> None:
    """A file that has come to its limit of size stands in for it."""
    full = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))\n"
    assert run(full + RUN, err=None)[:3] == (7.0, 1, 0)
    assert run.err.count("compiled kernels cannot be kept") == 1  # type: ignore[attr-defined]
    assert run()[:3] == (7.0, 1, 0)  # what had been begun is thrown away
    assert run()[:3] == (7.0, 0, 1)


# ---- more than one process, or thread


def test_of_two_cold_processes_one_compiles(start: Callable[..., subprocess.Popen[str]], tmp_path: Path) -> None:
    """Whichever it is, it goes on only when the other is about to call the kernel as well."""
    ready = f"""
import os, pathlib, sledenv.kernel.caller
pathlib.Path({str(tmp_path)!r}, f"ready-{{os.getpid()}}").touch()
"""
    wait = f"""
pathlib.Path({str(tmp_path)!r}, f"compiling-{{os.getpid()}}").touch()
while len(list(pathlib.Path({str(tmp_path)!r}).glob("ready-*"))) < 2:
    time.sleep(0.01)
"""
    with start(ready + RUN, WHILE_COMPILING=wait) as one, start(ready + RUN, WHILE_COMPILING=wait) as other:
        found = [line_of(process.communicate()[0]) for process in (one, other)]
    assert sorted(line[:3] for line in found) == [(7.0, 0, 1), (7.0, 1, 0)]
    assert len(list(tmp_path.glob("compiling-*"))) == 1


def test_a_process_that_is_killed_leaves_nothing_in_the_way(
    start: Callable[..., subprocess.Popen[str]], run: Run
) -> None:
    with start(WHILE_COMPILING="os._exit(9)") as process:
        assert process.wait() == 9
    folder = Path(run()[3])
    (record,) = folder.rglob(entries._RECORD)
    record.unlink()  # as if it had been killed when numba had written its files
    assert run()[:3] == (7.0, 1, 0)
    assert run()[:3] == (7.0, 0, 1)


THREADS = """
import threading
import numpy as np
from numba import prange
from sledenv.compiler import entries
entries.cache_folder = lambda: None  # of a string nothing can be kept
def counted(x):
    for i in prange(len(x)):
        for _ in range(100):
            x[i] += 1.0
f = entries.parallel_entry(counted)
results = []
def call():
    x = np.zeros(20000)
    for _ in range(30):
        f(x)
    results.append(float(x.min()))
threads = [threading.Thread(target=call) for _ in range(4)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
print(sum(results), f.compiled, f.loaded, "-")
"""


def test_threads_may_call_at_once_whatever_numba_s_own_are(run: Run) -> None:
    """Oracle: counting; the layer "workqueue" ends a process in which two threads start a parallel loop at once."""
    assert run(THREADS, NUMBA_THREADING_LAYER="workqueue", NUMBA_NUM_THREADS="2") == (12000.0, 1, 0, "-")


# numba ends a process that was forked from one with threads of OpenMP, and its parent waits for ever.
FORK = """
import multiprocessing, warnings
warnings.simplefilter("ignore")
import numba
import numpy as np
from numba import prange
from sledenv.compiler import entries
entries.cache_folder = lambda: None
def squares(x):
    for i in prange(len(x)):
        x[i] *= x[i]
f = entries.parallel_entry(squares)
def call(_):
    x = np.full(2, 3.0)
    try:
        f(x)
    except RuntimeError as error:
        return str(error)
    return "" if x.tolist() == [9.0, 9.0] else "wrong"
assert call(0) == ""
with multiprocessing.get_context("fork").Pool(1) as pool:
    said = pool.apply(call, (0,))
unsafe = numba.threading_layer() == "omp" and numba.np.ufunc.omppool.openmp_vendor == "GNU"
assert ("get_context('spawn')" in said) if unsafe else said == "", said
print(1.0, f.compiled, f.loaded, "-")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere no process is forked, or with other threads")
@pytest.mark.parametrize("layer", ["omp", "workqueue"])
def test_a_forked_process_computes_or_says_why_not(run: Run, layer: str) -> None:
    assert run(FORK, NUMBA_THREADING_LAYER=layer) == (1.0, 1, 0, "-")


# ---- what is said


def test_long_compilation_is_announced_once_and_only_then(package: Path, run: Run) -> None:
    run()
    assert run(IMPATIENT + RUN)[1] == 0  # nothing was compiled, nothing is said
    change_callee(package)
    folder = run(IMPATIENT + RUN.replace("f(3.0)", "f(3.0) + f(3)"), err=None)[3]
    (line,) = run.err.splitlines()  # type: ignore[attr-defined]
    assert line.startswith("sledenv: compiling doubled_and_one for its first use")
    assert folder in line
    assert "sledenv doctor" in line


def test_the_announcement_obeys_logging(run: Run) -> None:
    quiet = "import logging; logging.getLogger('sledenv').setLevel(logging.ERROR)\n"
    assert run(quiet + IMPATIENT + RUN)[0] == 7.0


def test_patience_ends_with_the_compilation(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    timers: list[threading.Timer] = []

    class Timer(threading.Timer):
        def start(self) -> None:
            timers.append(self)

    monkeypatch.setattr(threading, "Timer", Timer)
    assert entry(halved)(3.0) == 1.5
    (timer,) = timers
    assert timer.interval == entries._PATIENCE
    assert timer.finished.is_set()
    assert entry(halved)(3.0) == 1.5  # from the cache
    assert len(timers) == 1


# ---- an entry, in this process


class Law(NamedTuple):
    factor: float
    count: float = 0.0


class OtherLaw(NamedTuple):
    factor: float
    count: float = 0.0


@kernel
def halved(x: Any) -> Any:
    """Half of x."""
    return 0.5 * x


@kernel
def first_of(law: Any) -> Any:
    return law[0]


@kernel
def total(x: Any) -> Any:
    result = 0.0
    for i in range(len(x)):
        result += x[i]
    return result


@kernel
def chunk_size(x: Any) -> None:
    size = numba.get_parallel_chunksize()
    for i in prange(len(x)):
        x[i] = size


@kernel
def squares(x: Any) -> None:
    for i in prange(len(x)):
        x[i] *= x[i]


def disturbed() -> None:
    """A test says what happens when this is compiled."""


interruptions: list[type[BaseException]] = []


@overload(disturbed)
def _disturbed() -> Any:
    if interruptions:
        raise interruptions.pop()
    return lambda: None


@kernel
def disturbed_half(x: Any) -> Any:
    disturbed()
    return halved(x)


def counts(f: Any) -> tuple[int, int, int]:
    return f.compiled, f.loaded, len(f.damaged)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where this process keeps the kernels of a test."""
    folder = tmp_path / f"sledenv-{entries.FINGERPRINT}"
    monkeypatch.setattr(entries, "cache_folder", lambda: folder)
    monkeypatch.setattr(entries, "_told", set())
    monkeypatch.setattr(entries, "_entries", [])
    return folder


def test_a_kernel_stays_a_function_and_an_entry_has_its_name(folder: Path) -> None:
    f: Any = entry(halved)
    assert halved(3) == 1.5
    assert (f.__name__, f.__doc__, f.__wrapped__) == ("halved", "Half of x.", halved)
    assert entries.entries() == [f]
    assert counts(f) == (0, 0, 0)


def test_without_compilation_both_are_the_function(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 1)
    for made in (kernel, entry, parallel_entry):
        assert made(halved) is halved


def test_each_kind_of_arguments_has_a_version(folder: Path) -> None:
    f: Any = entry(first_of)
    assert (f(Law(1.5)), f(OtherLaw(2.5)), f(Law(3.5))) == (1.5, 2.5, 3.5)
    assert counts(f) == (2, 0, 0)
    assert len(list(folder.glob("*.lock"))) == 2
    again: Any = entry(first_of)
    assert again(OtherLaw(2.5)) == 2.5
    assert counts(again) == (0, 1, 0)


def test_numbers_in_tuples_are_never_rounded(folder: Path) -> None:
    """Numba would give a tuple of floats to a version for whole numbers, and cut them."""
    f: Any = entry(first_of)
    assert f(Law(1, 2)) == 1  # type: ignore[arg-type]
    assert f(Law(1.5, 2.5)) == 1.5
    assert f(Law(2, 3)) == 2
    assert f((1, 2.5)) == 1
    assert f((1.5, 2)) == 1.5
    assert f((1.5, 2.5)) == 1.5


def test_arrays_of_any_kind_are_taken(folder: Path) -> None:
    f: Any = entry(total)
    x = np.arange(8.0)
    fixed = x.copy()
    fixed.flags.writeable = False
    for _ in range(2):
        assert (f(x), f(x[::2]), f(fixed), f(x.astype(int)), f(x)) == (28.0, 12.0, 28.0, 28.0, 28.0)
    assert counts(f) == (4, 0, 0)


def test_arguments_that_cannot_be_compiled_are_refused(folder: Path) -> None:
    f: Any = entry(halved)
    for _ in range(2):
        with pytest.raises(numba.errors.TypingError):
            f("x")
    assert f(3.0) == 1.5
    assert os.environ.get("NUMBA_CACHE_DIR", "") == numba.config.CACHE_DIR


def test_a_loop_is_shared_between_threads_turn_by_turn(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = numba.get_parallel_chunksize()
    x = np.arange(5.0)
    for expected in ((1, 0, 0), (0, 1, 0)):
        f: Any = parallel_entry(squares)
        f(x)
        assert counts(f) == expected
    assert x.tolist() == [0.0, 1.0, 16.0, 81.0, 256.0]
    monkeypatch.setattr(entries, "cache_folder", lambda: None)  # the size that is in force cannot be cached
    parallel_entry(chunk_size)(x)
    assert x.tolist() == 5 * [1.0]
    assert numba.get_parallel_chunksize() == before


def test_threads_that_call_at_once_compile_once(folder: Path) -> None:
    f: Any = entry(halved)
    barrier = threading.Barrier(4)
    results: list[float] = []

    def call() -> None:
        barrier.wait()
        results.append(f(3.0))

    threads = [threading.Thread(target=call) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == 4 * [1.5]
    assert counts(f) == (1, 0, 0)


def test_after_an_interrupt_the_next_call_compiles(folder: Path) -> None:
    f: Any = entry(disturbed_half)
    interruptions.append(KeyboardInterrupt)
    with pytest.raises(KeyboardInterrupt):
        f(3.0)
    assert counts(f) == (0, 0, 0)
    assert os.environ.get("NUMBA_CACHE_DIR", "") == numba.config.CACHE_DIR
    assert f(3.0) == 1.5
    assert counts(f) == (1, 0, 0)
    again: Any = entry(disturbed_half)
    assert again(3.0) == 1.5
    assert counts(again) == (0, 1, 0)


def flipped(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda data: b"",
    "truncated": lambda data: data[:-1],
    "longer": lambda data: data + b"\0",
    "zeros": lambda data: bytes(len(data)),
    "random": lambda data: np.random.default_rng(0).bytes(len(data)),
    "one bit": flipped,
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("ending", ["*.nbi", "*.nbc", entries._RECORD])
def test_a_damaged_file_is_named_and_replaced(
    folder: Path, caplog: pytest.LogCaptureFixture, ending: str, damage: str
) -> None:
    assert entry(halved)(3.0) == 1.5
    (path,) = folder.rglob(ending)
    sound = path.read_bytes()
    path.write_bytes(DAMAGES[damage](sound))
    f: Any = entry(halved)
    assert f(3.0) == 1.5
    assert counts(f) == (1, 0, 1)
    (message,) = caplog.messages
    assert "sledenv: compiling halved again, because of damaged files" in message
    if ending != entries._RECORD or damage != "one bit":  # that damages the digest of another file
        assert f.damaged == [str(path)]
        assert str(path) in message
    after: Any = entry(halved)
    assert after(3.0) == 1.5
    assert counts(after) == (0, 1, 0)
    assert len(caplog.messages) == 1


@pytest.mark.parametrize("damage", ["missing", "extra", "other", "no dictionary"])
def test_a_folder_that_is_not_as_it_was_left_is_compiled_again(
    folder: Path, caplog: pytest.LogCaptureFixture, damage: str
) -> None:
    assert entry(halved)(3.0) == 1.5
    assert entry(first_of)(Law(3.0)) == 3.0
    index = next(path for path in folder.rglob("*.nbi") if "halved" in path.name)
    data = next(path for path in folder.rglob("*.nbc") if "halved" in path.name)
    if damage == "missing":
        data.unlink()
    elif damage == "extra":
        index.with_suffix(".new").touch()
    elif damage == "other":  # sound, but of another kernel
        data.write_bytes(next(path for path in folder.rglob("*.nbc") if "first_of" in path.name).read_bytes())
    else:
        (index.parents[1] / entries._RECORD).write_text("1")
    f: Any = entry(halved)
    assert f(3.0) == 1.5
    assert counts(f) == (1, 0, 1)
    assert len(caplog.messages) == 1


def test_nothing_is_read_before_it_is_known_to_be_sound(folder: Path) -> None:
    """A pickle could run anything, as this one does."""
    assert entry(halved)(3.0) == 1.5
    (index,) = folder.rglob("*.nbi")
    index.write_bytes(b"cos\nabort\n(tR.")
    assert entry(halved)(3.0) == 1.5


def test_the_record_says_what_numba_has_written(folder: Path) -> None:
    assert entry(halved)(3.0) == 1.5
    (record,) = folder.rglob(entries._RECORD)
    there = {path.relative_to(record.parent).as_posix() for path in folder.rglob("*.nb?")}
    assert set(json.loads(record.read_text())) == there
    assert len(there) == 2


def test_an_entry_in_a_compilation_does_not_wait_for_itself(folder: Path) -> None:
    inner: Any = entry(halved)

    @overload(entry_user := lambda: None)
    def _() -> Any:
        value = inner(3.0)
        return lambda: value

    @kernel
    def outer() -> Any:
        return entry_user()

    f: Any = entry(outer)
    assert f() == 1.5
    assert isinstance(f, Entry)
    assert counts(inner) == counts(f) == (1, 0, 0)
    assert {path.name.rpartition("-")[0] for path in folder.glob("*.lock")} == {
        "test_entries.halved",
        "test_entries.test_an_entry_in_a_compilation_does_not_wait_for_itself..outer",
    }
