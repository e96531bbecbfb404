"""What a first use costs: importing sledenv, a first step, a first batch and a command, in fresh processes."""

from __future__ import annotations

import inspect
import sys
import tempfile
import time
from functools import partial
from typing import Any

from perf import show
from perf.harness import ROOT, python, spread, take_turns
from perf.reference import settings

ROUNDS = 9
BASE, STEP = "import gymnasium, numpy", "make, reset and step"
COMMAND, MADE = "sledenv simulate sled_snow, in all", "to make the object file of this machine"
_PROBLEM = f"""
from typing import Any
import sledenv
{inspect.getsource(settings)}
body, law = sledenv.segment(1, .1, .05, .0075), sledenv.ContactLaw(1e6, .5, .1, .001)
slope, state = sledenv.Slope(.17), sledenv.State(0, .5, .7)
"""
_SINGLE = "sledenv.simulate(body, law, slope, state, max_rebounds=5, solver={!r})"
_BATCH = "sledenv.simulate_batch(body, law, slope, [state] * 1000, **settings(max_rebounds=5, solver={!r}))"
PROGRAMS: dict[str, str] = {
    BASE: BASE,
    "import sledenv": "import sledenv",
    STEP: """
import gymnasium, sledenv
env = gymnasium.make("sledenv/SledLaunch-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
""",
    **{f"simulate, {solver}": _PROBLEM + _SINGLE.format(solver) for solver in ("compliant", "rigid")},
    **{f"simulate_batch, {solver}": _PROBLEM + _BATCH.format(solver) for solver in ("compliant", "rigid")},
}


def first(name: str, folders: str | None = None, before: str = "") -> float:
    """Wall time [s] of a program in a fresh process, without the start of the interpreter and what is done before.

    ``folders`` is a folder for all that this machine compiles, an empty one if none is given.
    """
    code = f"import time\n{before}\nstart = time.perf_counter()\n{PROGRAMS[name]}\nprint(time.perf_counter() - start)"
    with tempfile.TemporaryDirectory() as empty:
        return float(python("-c", code, **keeping(folders or empty)).split()[-1])


def keeping(folder: str) -> dict[str, str]:
    """Variables that let what is compiled be kept in a folder; older trees let numba keep it."""
    own = ("XDG_CACHE_HOME", "LOCALAPPDATA") if sys.platform != "darwin" else ("HOME",)
    return dict.fromkeys((*own, "NUMBA_CACHE_DIR"), folder)


def _command() -> float:
    """Wall time [s] of a command, with the start of the interpreter."""
    with tempfile.TemporaryDirectory() as empty:
        start = time.perf_counter()
        python("-m", "sledenv_cli", "simulate", "sled_snow", **keeping(empty))
        return time.perf_counter() - start


def _make() -> float:
    """Wall time [s] in which the object file of this machine is made."""
    from sledenv.compiler.targets import machine

    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        python(str(ROOT / "src" / "sledenv" / "kernel"), folder, machine())
        return time.perf_counter() - start


def measure(rounds: int = ROUNDS) -> dict[str, Any]:
    """Run all programs in turn, each in a process that finds nothing but what the installation has brought.

    RuntimeError if that has no object file for these sources and this machine: install it anew.
    """
    from sledenv.compiler.library import SHIPPED
    from sledenv.kernel.entries import LIBRARY

    used = LIBRARY.ready()
    if not used.startswith(str(SHIPPED)):
        raise RuntimeError(f"the installed object file does not fit, install sledenv anew: {used}")
    measures = {name: partial(first, name) for name in PROGRAMS} | {COMMAND: _command}
    take_turns(measures, 1)
    found = take_turns(measures, rounds)
    rows = [{"name": name, "s": spread(times), "over_s": spread(times - found[BASE])} for name, times in found.items()]
    del rows[-1]["over_s"]  # it counts the start of the interpreter too
    made = take_turns({MADE: _make}, 1)[MADE]
    return {"rounds": rounds, "rows": [*rows, {"name": MADE, "s": spread(made)}]}


COLUMNS: show.Columns = {
    "in a fresh process": lambda row: row["name"],
    "s": lambda row: show.quartiles(row["s"]),
    "over import gymnasium, numpy [s]": lambda row: show.median(row["over_s"]) if "over_s" in row else "-",
}
