"""The examination behind ``sledenv doctor``: which compiled kernel is used, and whether its results are right."""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final, get_args

from sledenv.compiler.entries import INTERPRETED
from sledenv.simulation.bodies import segment
from sledenv.simulation.lanes import num_threads
from sledenv.simulation.records import LIBRARY
from sledenv.simulation.rigid_impact import rigid_impact
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Settings, Solver
from sledenv.simulation.simulate import simulate, simulate_batch

PACKAGES: Final = ("sledenv", "numpy", "numba", "llvmlite", "gymnasium", "stable_baselines3", "torch")

# The reference descent and its first rebound, computed to 50 digits: tests/data/reference_descent.json.
_BODY = segment(mass=1.0, radius=0.1, eccentricity=0.05, inertia=7.5e-3)
_LAW = ContactLaw(stiffness=1e6, asymmetry=0.5, friction=0.1, rolling_arm=1e-3)
_SLOPE = Slope(angle=math.pi / 18.0)
_LAUNCH = State(0.0, 0.6 - 0.05 * math.cos(math.pi / 4.0), math.pi / 4.0, 0.0, 0.0, 0.0)
_FIRST = {"u_after": 0.73720907755848176, "v_after": 1.1295680773816298, "omega_after": -17.836130872506571}
_ACCURACY = 1e-12  # relative


def examine(report: Callable[[str, str], None]) -> list[str]:
    """Load the compiled kernel, which is made if none fits, and check what it computes.

    Parameters
    ----------
    report : callable
        Gets what each line of the report is about and what it says, one by one as they are known.

    Returns
    -------
    list of str
        What is wrong, one line each; empty if nothing is.
    """
    report("versions", ", ".join(_versions()))
    report("processor", f"{processor()}, cores {os.cpu_count()}")
    problems = []
    try:
        report("kernel", "plain Python" if INTERPRETED else LIBRARY.ready())
        report("threads", str(num_threads()))
    except (RuntimeError, ValueError) as error:
        problems.append(str(error))
    if INTERPRETED:
        problems.append("NUMBA_DISABLE_JIT is set: the kernels run as plain Python")
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


def processor() -> str:
    """Return the name of the processor, as far as the system says so."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:  # not Linux
        lines = []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.processor() or platform.machine())


def _reference() -> str:
    """Compare with the reference descent."""
    rebound = simulate(_BODY, _LAW, _SLOPE, _LAUNCH, max_rebounds=1).rebounds[0]
    for name, known in _FIRST.items():
        if not abs(rebound[name] - known) <= _ACCURACY * abs(known):
            return f"{name} = {float(rebound[name])!r} at the first rebound, not {known!r}"
    return ""


def _impact() -> str:
    """Compare with the textbook: a wheel that slides throughout an impact loses f (1 + e) v of its speed."""
    wheel, law = segment(1.0, 0.1, 0.0, 0.005), ContactLaw(1.0, asymmetry=0.6, friction=0.1, rolling_arm=0.0)
    after = rigid_impact(wheel, law, State(0.0, 0.1, 0.0, 10.0, -1.0, 0.0)).state
    if not (abs(after.u - 9.85) <= 1e-14 * 10.0 and abs(after.v - 0.5) <= 1e-14):
        return f"u, v = {after.u!r}, {after.v!r} after the impact of a wheel, not 9.85, 0.5"
    return ""


def _agreement() -> str:
    """Compare a batch with single descents."""
    for solver in get_args(Solver):
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
