"""What a first use costs: importing sledenv and a first make, reset and step, in fresh processes, cold and warm."""

from __future__ import annotations

import inspect
import tempfile
from functools import partial
from typing import Any

from perf import show
from perf.harness import python, spread, take_turns
from perf.reference import settings

ROUNDS = 9
COLD_ROUNDS = 3
GYM, STEP = "import gymnasium", "make, reset and step"
_PROBLEM = f"""
from typing import Any
import sledenv
{inspect.getsource(settings)}
body, law = sledenv.Body(1, .1, .05, .0075), sledenv.ContactLaw(1e6, .5, .1, .001)
slope, state = sledenv.Slope(.17), sledenv.State(0, .5, .7)
"""
_SINGLE = "sledenv.simulate(body, law, slope, state, max_rebounds=5, solver={!r})"
_BATCH = "sledenv.simulate_batch(body, law, slope, [state], **settings(max_rebounds=5, solver={!r}))"
PROGRAMS: dict[str, str] = {
    GYM: GYM,
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


def first(name: str, cache: str | None = None, before: str = "") -> float:
    """Wall time [s] of a program in a fresh process, without the start of the interpreter and what is done before.

    ``cache`` is the folder of compiled kernels, an empty one if none is given.
    """
    code = f"import time\n{before}\nstart = time.perf_counter()\n{PROGRAMS[name]}\nprint(time.perf_counter() - start)"
    with tempfile.TemporaryDirectory() as empty:
        return float(python("-c", code, NUMBA_CACHE_DIR=cache or empty).split()[-1])


def measure(rounds: int = ROUNDS, cold_rounds: int = COLD_ROUNDS) -> dict[str, Any]:
    """Run all programs in turn, first those that compile with an empty cache, then all with a full one."""
    compiling = list(PROGRAMS)[2:]
    cold = take_turns({name: partial(first, name) for name in compiling}, cold_rounds)
    with tempfile.TemporaryDirectory() as cache:
        measures = {name: partial(first, name, cache) for name in PROGRAMS}
        take_turns(measures, 1)
        warm = take_turns(measures, rounds)
    rows = [
        {
            "name": name,
            "warm_s": spread(found),
            "warm_over_gymnasium_s": spread(found - warm[GYM]),
            **({"cold_s": spread(cold[name])} if name in cold else {}),
        }
        for name, found in warm.items()
    ]
    return {"rounds": rounds, "cold_rounds": cold_rounds, "rows": rows}


COLUMNS: show.Columns = {
    "in a fresh process": lambda row: row["name"],
    "warm [s]": lambda row: show.quartiles(row["warm_s"]),
    "over import gymnasium [s]": lambda row: show.median(row["warm_over_gymnasium_s"]),
    "cold [s]": lambda row: show.quartiles(row["cold_s"]) if "cold_s" in row else "-",
}
