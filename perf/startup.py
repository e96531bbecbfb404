"""What a first use costs: importing sledenv and a first make, reset and step, in fresh processes, cold and warm."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from perf.harness import figure_of, save, spread, table, with_quartiles

ROUNDS = 9
COLD_ROUNDS = 3

_GYM = "import gymnasium"
_IMPORT = "import sledenv"
_MAKE = "make, reset and step"
_SIMULATE = {solver: f"simulate, {solver}" for solver in ("compliant", "rigid")}
_BATCH = {solver: f"simulate_batch, {solver}" for solver in ("compliant", "rigid")}
_PROBLEM = """
import sledenv
body, law = sledenv.Body(1, .1, .05, .0075), sledenv.ContactLaw(1e6, .5, .1, .001)
slope, state = sledenv.Slope(.17), sledenv.State(0, .5, .7)
"""
PROGRAMS: dict[str, str] = {
    _GYM: "import gymnasium",
    _IMPORT: "import sledenv",
    _MAKE: """
import gymnasium, sledenv
env = gymnasium.make("sledenv/SledLaunch-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
""",
    **{
        name: f"{_PROBLEM}sledenv.simulate(body, law, slope, state, max_rebounds=5, solver={solver!r})"
        for solver, name in _SIMULATE.items()
    },
    **{
        name: f"{_PROBLEM}settings = sledenv.Settings({solver!r}, max_rebounds=5)\n"
        "sledenv.simulate_batch(body, law, slope, [state], settings)"
        for solver, name in _BATCH.items()
    },
}


def _run(program: str, cache: str) -> float:
    """Wall time [s] of a program in a fresh process, the start of the interpreter not counted."""
    code = f"import time; start = time.perf_counter()\n{program}\nprint(time.perf_counter() - start)"
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its byte code
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment,
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
        check=True,
    )
    return float(done.stdout.split()[-1])


def main(rounds: int = ROUNDS, cold_rounds: int = COLD_ROUNDS) -> None:
    """Measure and write."""
    compiling = [name for name in PROGRAMS if name not in (_GYM, _IMPORT)]
    cold: dict[str, list[float]] = {name: [] for name in compiling}
    warm: dict[str, list[float]] = {name: [] for name in PROGRAMS}
    for i in range(cold_rounds):
        for k in range(len(compiling)):
            name = compiling[(i + k) % len(compiling)]
            with tempfile.TemporaryDirectory() as cache:
                cold[name].append(_run(PROGRAMS[name], cache))
    names = list(PROGRAMS)
    with tempfile.TemporaryDirectory() as cache:
        for name in names:
            _run(PROGRAMS[name], cache)
        for i in range(rounds):
            for k in range(len(names)):
                name = names[(i + k) % len(names)]
                warm[name].append(_run(PROGRAMS[name], cache))
    gym = np.array(warm[_GYM])
    rows = [
        {
            "name": name,
            "warm_s": spread(np.array(warm[name])),
            "warm_over_gymnasium_s": spread(np.array(warm[name]) - gym),
            **({"cold_s": spread(np.array(cold[name]))} if name in cold else {}),
        }
        for name in names
    ]
    result = {"rounds": rounds, "cold_rounds": cold_rounds, "rows": rows}
    save("startup", result)


def tables(result: dict[str, Any]) -> str:
    """Return the table of docs/performance.md."""
    rows = [
        (
            row["name"],
            with_quartiles(row["warm_s"]),
            figure_of(row["warm_over_gymnasium_s"]["median"]),
            with_quartiles(row["cold_s"]) if "cold_s" in row else "-",
        )
        for row in result["rows"]
    ]
    return table(("in a fresh process", "warm [s]", "over import gymnasium [s]", "cold [s]"), rows)


if __name__ == "__main__":
    main()
