"""The examination behind ``sledenv doctor``: compile every kernel beforehand, and see whether the results are right."""

from __future__ import annotations

import logging
import math
import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final, get_args

import numba
import numpy as np

from sledenv.compiler.entries import cache_folder, entries
from sledenv.simulation.bodies import Body
from sledenv.simulation.ride import Ride
from sledenv.simulation.rigid_impact import rigid_impact, velocities_after
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import BatchSolver, Settings, Solver
from sledenv.simulation.simulate import simulate, simulate_batch

PACKAGES: Final = ("sledenv", "numpy", "numba", "llvmlite", "gymnasium", "stable_baselines3", "torch")

# The reference descent and its first rebound, computed to 50 digits: tests/data/reference_descent.json.
_BODY = Body(mass=1.0, radius=0.1, eccentricity=0.05, inertia=7.5e-3)
_LAW = ContactLaw(stiffness=1e6, asymmetry=0.5, friction=0.1, rolling_arm=1e-3)
_SLOPE = Slope(angle=math.pi / 18.0)
_LAUNCH = State(0.0, 0.6 - 0.05 * math.cos(math.pi / 4.0), math.pi / 4.0, 0.0, 0.0, 0.0)
_FIRST = {"u_after": 0.73720907755848176, "v_after": 1.1295680773816298, "omega_after": -17.836130872506571}
_ACCURACY = 1e-12  # relative

_ROTOR = 1e-3  # [kg m^2]

_log = logging.getLogger("sledenv")


def examine(report: Callable[[str, str], None]) -> list[str]:
    """Compile all kernels into the cache and check what they compute.

    Parameters
    ----------
    report : callable
        Gets what each line of the report is about and what it says, one by one as they are known.

    Returns
    -------
    list of str
        What is wrong, one line each; empty if nothing is.
    """
    folder = cache_folder()
    report("versions", ", ".join(_versions()))
    report("processor", f"{', '.join(_processor())}, cores {os.cpu_count()}")
    report("cache", _contents(folder))
    problems = _hindrances(folder)
    for name, run in _KERNELS:
        try:
            report("kernels", f"{name}: {_warmed(run)}")
        except Exception as error:
            report("kernels", f"{name}: failed")
            problems.append(f"{name}: {type(error).__name__}: {error}")
    unkept = {why for entry in entries() for why in entry.unkept}  # a full disk is found by writing alone
    problems += [f"compiled kernels cannot be kept: {why}" for why in sorted(unkept)]
    report("cache", _contents(folder))
    report("threads", _threads())
    for name, check in _CHECKS:
        try:
            wrong = check()
        except Exception as error:
            wrong = f"{type(error).__name__}: {error}"
        report("check", f"{name}: {'wrong' if wrong else 'right'}")
        if wrong:
            problems.append(f"{name}: {wrong}")
    return problems


def _versions() -> Iterator[str]:
    yield f"Python {platform.python_version()}"
    for name in PACKAGES:
        try:
            yield f"{name} {version(name)}"
        except PackageNotFoundError:
            yield f"{name} not installed"


def _processor() -> Iterator[str]:
    """Name of the processor, and whether it has what the speed depends on, as far as the system says so."""
    try:
        lines = Path("/proc/cpuinfo").read_text(errors="replace").splitlines()
    except OSError:  # not Linux
        lines = []
    known = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    yield known.get("model name") or platform.processor() or platform.machine()
    flags = known.get("flags", "").split()
    for name in ("FMA", "AVX2"):
        yield f"{name} {('yes' if name.lower() in flags else 'no') if flags else 'unknown'}"
    if chosen := numba.config.CPU_NAME:  # type: ignore[attr-defined]
        yield f"{chosen} to numba"


def _contents(folder: Path | None) -> str:
    """What a cache folder holds."""
    if folder is None:
        return "none"
    files = [path.stat().st_size for path in folder.rglob("*.nbc")]
    return f"{folder}: {len(files)} kernels, {sum(files) / 1e6:.1f} MB" if files else f"{folder}: empty"


def _hindrances(folder: Path | None) -> list[str]:
    """What keeps compiled kernels from being kept."""
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return ["NUMBA_DISABLE_JIT is set: the kernels run as plain Python"]
    if folder is None:
        return ["no cache folder can be written, every process will compile again: set NUMBA_CACHE_DIR"]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        return [f"the cache folder cannot be written: {error}"]
    return []


def _threads() -> str:
    try:
        return f"{numba.get_num_threads()}, layer {numba.threading_layer()}"  # type: ignore[attr-defined]
    except ValueError:  # no parallel kernel has run
        return f"{numba.get_num_threads()}, not started"


def _warmed(run: Callable[[], None]) -> str:
    level = _log.level
    _log.setLevel(logging.ERROR)  # that it is compiling is known here
    compiled, damaged = _made()
    start = time.perf_counter()
    try:
        run()
    finally:
        _log.setLevel(level)
    spent = time.perf_counter() - start
    now_compiled, now_damaged = _made()
    why = "".join(f", in place of a damaged {path}" for path in sorted(now_damaged - damaged))
    return f"{'compiled' if now_compiled > compiled else 'ready'} in {spent:.1f} s{why}"


def _made() -> tuple[int, set[str]]:
    """How many kernels this process has compiled, and what files it has found damaged."""
    return sum(entry.compiled for entry in entries()), {path for entry in entries() for path in entry.damaged}


def _descent(solver: Solver) -> None:
    simulate(_BODY, _LAW, _SLOPE, _LAUNCH, Settings(solver, max_time=0.4, step=1e-5))


def _lanes(solver: BatchSolver) -> None:
    simulate_batch(_BODY, _LAW, _SLOPE, [_LAUNCH, _LAUNCH], Settings(solver, max_rebounds=5))


def _ride(solver: BatchSolver) -> None:
    ride = Ride(_BODY, _LAW, _SLOPE, _LAUNCH, Settings(solver, max_rebounds=5), rotor_inertia=_ROTOR)
    ride.hop()
    ride.trim(1.0)
    ride.run()


def _rebounds() -> None:
    velocities_after(0.1, np.array([[0.01, 0.1, 1.0, -1.0, 1.0]]), np.array([[0.5, 0.1, 1e-3]]))


_KERNELS: Final[tuple[tuple[str, Callable[[], None]], ...]] = (
    ("one descent, compliant", partial(_descent, "compliant")),
    ("a batch, compliant", partial(_lanes, "compliant")),
    ("hop by hop, compliant", partial(_ride, "compliant")),
    ("one descent, rigid", partial(_descent, "rigid")),
    ("a batch, rigid", partial(_lanes, "rigid")),
    ("hop by hop, rigid", partial(_ride, "rigid")),
    ("one descent, euler", partial(_descent, "euler")),
    ("impacts told by their arms", _rebounds),
)


def _reference() -> str:
    """Compare with the reference descent."""
    rebound = simulate(_BODY, _LAW, _SLOPE, _LAUNCH, max_rebounds=1).rebounds[0]
    for name, known in _FIRST.items():
        if not abs(rebound[name] - known) <= _ACCURACY * abs(known):
            return f"{name} = {float(rebound[name])!r} at the first rebound, not {known!r}"
    return ""


def _impact() -> str:
    """Compare with the textbook: a wheel that slides throughout an impact loses f (1 + e) v of its speed."""
    wheel, law = Body(1.0, 0.1, 0.0, 0.005), ContactLaw(1.0, asymmetry=0.6, friction=0.1, rolling_arm=0.0)
    after = rigid_impact(wheel, law, State(0.0, 0.1, 0.0, 10.0, -1.0, 0.0)).state
    if not (abs(after.u - 9.85) <= 1e-14 * 10.0 and abs(after.v - 0.5) <= 1e-14):
        return f"u, v = {after.u!r}, {after.v!r} after the impact of a wheel, not 9.85, 0.5"
    return ""


def _agreement() -> str:
    """Compare a batch with single descents."""
    for solver in get_args(BatchSolver):
        settings = Settings(solver, max_rebounds=5)
        one = simulate(_BODY, _LAW, _SLOPE, _LAUNCH, settings).outcome
        both = simulate_batch(_BODY, _LAW, _SLOPE, [_LAUNCH, _LAUNCH], settings).outcomes
        if not (both == one).all():
            return f"a lane differs from simulate with solver = {solver!r}"
    return ""


_CHECKS: Final[tuple[tuple[str, Callable[[], str]], ...]] = (
    ("reference descent", _reference),
    ("rigid impact", _impact),
    ("batch", _agreement),
)
