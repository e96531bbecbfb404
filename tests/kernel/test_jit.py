"""Where compiled kernels are kept, when they are compiled again, and what a user is told meanwhile."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from sledenv.kernel import ahead, jit

pytestmark = pytest.mark.jit_only

CALLEE = """
from sledenv.kernel.jit import kernel


@kernel
def doubled(x):
    return 2.0 * x
"""
CALLER = """
from sledenv.kernel.callee import doubled
from sledenv.kernel.jit import kernel


@kernel
def doubled_and_one(x):
    return doubled(x) + 1.0
"""
# Prints the result, how many kernels were compiled and how many were found, and the folder.
RUN = """
from sledenv.kernel import jit
from sledenv.kernel.caller import doubled_and_one as f
result = f(3.0)
print(result, sum(f.stats.cache_misses.values()), sum(f.stats.cache_hits.values()), jit.cache_folder())
"""
Run = Callable[..., tuple[float, int, int, str]]


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Folder of the kernel of a small copy of the package, with the real decorators."""
    folder = tmp_path / "site" / "sledenv" / "kernel"
    folder.mkdir(parents=True)
    for module in (ahead, jit):
        shutil.copy(str(module.__file__), folder)
    (folder / "__init__.py").touch()
    (folder.parent / "__init__.py").touch()
    (folder / "callee.py").write_text(CALLEE)
    (folder / "caller.py").write_text(CALLER)
    return folder


@pytest.fixture
def run(package: Path, tmp_path: Path) -> Run:
    """Run the small package in a fresh process whose user has a home of his own."""

    def run(program: str = RUN, **environment: str) -> tuple[float, int, int, str]:
        inherited = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
        given = {"PYTHONPATH": str(package.parents[1]), "XDG_CACHE_HOME": str(tmp_path / "home")} | environment
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=inherited | given,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        result, compiled, found, folder = done.stdout.split(maxsplit=3)
        run.err = done.stderr  # type: ignore[attr-defined]
        return float(result), int(compiled), int(found), folder.strip()

    return run


def nobody_can_write_beside(package: Path) -> None:
    """Make the folder of caches beside the sources impossible, for root as well."""
    shutil.rmtree(package / "__pycache__", ignore_errors=True)
    (package / "__pycache__").write_text("in the way")


def test_a_kernel_is_compiled_once(package: Path, run: Run) -> None:
    first = run()
    assert first[:3] == (7.0, 1, 0)
    assert Path(first[3]).parent == package / "__pycache__"
    assert run() == (7.0, 0, 1, first[3])


def test_a_caller_is_compiled_again_when_what_it_calls_has_changed(package: Path, run: Run) -> None:
    """A cache of numba's own goes on with the old machine code of the callee."""
    before = run()
    source = package / "callee.py"
    source.write_text(CALLEE.replace("2.0", "5.0"))
    after = run()
    assert after[:3] == (16.0, 1, 0)
    assert after[3] != before[3]
    source.write_text(CALLEE)  # going back finds what was compiled then
    assert run() == (7.0, 0, 1, before[3])


def test_a_kernel_that_python_calls_may_have_been_loaded_as_a_part_of_another_before(package: Path, run: Run) -> None:
    """Oracle: numpy; the entry for Python comes out of the cache after the part, and needs constants of its own."""
    (package / "maker.py").write_text(
        "import numpy as np\n"
        "from sledenv.kernel.jit import allocating\n\n\n"
        "@allocating\ndef made():\n    return np.ones(3), np.ones((2, 2))\n\n\n"
        "@allocating\ndef total():\n    a, b = made()\n    return a.sum() + b.sum()\n"
    )
    head = "from sledenv.kernel.maker import made, total\n"
    call = "a, b = made()\nprint(a.sum() + b.sum(), sum(made.stats.cache_misses.values()), "
    tail = "sum(made.stats.cache_hits.values()), 'x')"
    assert run(head + call + tail)[:3] == (7.0, 1, 0)
    assert run(head + "assert total() == 7.0\n" + call + tail)[:3] == (7.0, 0, 1)


def test_code_for_other_types_is_not_taken_from_the_cache(package: Path, run: Run) -> None:
    """Two processes that each keep a version at the same time may take the same file for them."""
    run(RUN.replace("f(3.0)", "f(3.0) + f(3)"))
    (cache,) = (package / "__pycache__").glob("sledenv-*")
    for part in ("caller.doubled_and_one-part", "caller.doubled_and_one", "callee.doubled-part"):
        one, other = (next(cache.glob(f"{part}-[0-9]*.{number}.nbc")) for number in (1, 2))
        kept = one.read_bytes()
        one.write_bytes(other.read_bytes())
        other.write_bytes(kept)
    assert run(RUN.replace("f(3.0)", "f(3.5)"))[0] == 8.0
    assert run(RUN.replace("f(3.0)", "f(3)"))[0] == 7.0


def test_only_a_few_states_of_the_sources_are_kept(package: Path, run: Run) -> None:
    parent = Path(run()[3]).parent
    for i in range(jit._KEPT):
        (parent / f"sledenv-{i}").mkdir()
        os.utime(parent / f"sledenv-{i}", (i, i))
    (package / "callee.py").write_text(CALLEE.replace("2.0", "5.0"))
    newest = Path(run()[3])
    left = {path.name for path in parent.glob("sledenv-*")}
    assert len(left) == jit._KEPT
    assert newest.name in left
    assert {"sledenv-0", "sledenv-1"}.isdisjoint(left)


def test_bounds_checks_are_not_taken_from_a_cache_without(run: Run) -> None:
    plain = run()
    checked = run(NUMBA_BOUNDSCHECK="1")
    assert checked[:3] == (7.0, 1, 0)
    assert checked[3] != plain[3]


def test_numba_cache_dir_comes_first(package: Path, tmp_path: Path, run: Run) -> None:
    folder = run(NUMBA_CACHE_DIR=str(tmp_path / "chosen"))[3]
    assert folder.startswith(str(tmp_path / "chosen"))
    assert list(Path(folder).glob("caller.*.nbc"))
    assert not list(package.rglob("*.nbc"))


def test_a_read_only_installation_is_cached_in_the_user_s_folder(package: Path, tmp_path: Path, run: Run) -> None:
    nobody_can_write_beside(package)
    first = run()
    assert first[:3] == (7.0, 1, 0)
    assert first[3].startswith(str(tmp_path / "home" / "numba"))
    assert run() == (7.0, 0, 1, first[3])
    (package / "callee.py").write_text(CALLEE.replace("2.0", "5.0"))
    assert run()[:3] == (16.0, 1, 0)


def test_without_any_folder_to_write_to_kernels_still_run(package: Path, tmp_path: Path, run: Run) -> None:
    nobody_can_write_beside(package)
    (tmp_path / "home").write_text("in the way")
    result, _, found, folder = run()
    assert (result, found, folder) == (7.0, 0, "None")


def test_a_cache_that_can_no_longer_be_written_ends_no_simulation(run: Run) -> None:
    program = """
import shutil
from sledenv.kernel import jit
folder = jit.cache_folder()
from sledenv.kernel.caller import doubled_and_one as f
shutil.rmtree(folder.parent)
folder.parent.write_text("in the way")
print(f(3.0), 0, 0, folder)
"""
    assert run(program)[0] == 7.0
    assert run.err.count("compiled kernels cannot be kept") == 1  # type: ignore[attr-defined]


def test_long_compilation_is_announced_once_and_only_then(package: Path, run: Run) -> None:
    run()
    assert run.err == ""  # type: ignore[attr-defined]
    impatient = "from sledenv.kernel import jit; jit._PATIENCE = 0.0\n" + RUN
    assert run(impatient)[1] == 0
    assert run.err == ""  # type: ignore[attr-defined]  # nothing was compiled
    (package / "callee.py").write_text(CALLEE.replace("2.0", "5.0"))
    folder = run(impatient)[3]
    (line,) = run.err.splitlines()  # type: ignore[attr-defined]
    assert line.startswith("sledenv: compiling doubled_and_one for its first use")
    assert folder in line
    assert "sledenv doctor" in line


def test_the_announcement_obeys_logging_and_leaves_the_kernels_of_others_alone(run: Run) -> None:
    quiet = "import logging; logging.getLogger('sledenv').setLevel(logging.ERROR)\n"
    impatient = "from sledenv.kernel import jit; jit._PATIENCE = 0.0\n"
    assert run(quiet + impatient + RUN)[0] == 7.0
    assert run.err == ""  # type: ignore[attr-defined]
    run(impatient + "import numba; print(numba.njit(lambda x: x + 1.0)(1.0), 0, 0, '-')")
    assert run.err == ""  # type: ignore[attr-defined]
