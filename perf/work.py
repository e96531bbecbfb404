"""Integration steps a hop on fixed descents: a count that needs no timer, held against perf/baseline.json in CI.

``python -m perf.work`` prints the counts, ``python -m perf.work --update`` makes them the baseline.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import sledenv
from perf.instructions import BASELINE
from perf.reference import BODY, FEW, LAUNCH, LAW, MANY, SLOPE, launches, settings

RANDOM = 500  # launches


def measure() -> dict[str, float]:
    """Integration steps in contact a rebound, compliant solver; a rigid impact takes none."""
    cases: dict[str, tuple[Any, int]] = {
        f"reference, {FEW} rebounds": ([LAUNCH], FEW),
        f"reference, {MANY} rebounds": ([LAUNCH], MANY),
        f"{RANDOM} random launches, {FEW} rebounds": (launches(RANDOM), FEW),
    }
    found = {}
    for name, (states, rebounds) in cases.items():
        outcomes = sledenv.simulate_batch(BODY, LAW, SLOPE, states, **settings(max_rebounds=rebounds)).outcomes
        found[name] = float(outcomes["steps"].sum() / outcomes["rebounds"].sum())
    return found


def baseline() -> dict[str, float]:
    """The committed counts."""
    found: dict[str, float] = json.loads(BASELINE.read_text())["steps_per_rebound"]
    return found


def main() -> None:
    """Print the counts beside the baseline; ``--update`` replaces it."""
    kept = json.loads(BASELINE.read_text()) if BASELINE.exists() else {}
    before = kept.get("steps_per_rebound", {})
    now = measure()
    for name, value in now.items():
        print(f"{name}: {value:.4f} (baseline {before.get(name, float('nan')):.4f})")
    if "--update" in sys.argv:
        kept["steps_per_rebound"] = now
        BASELINE.write_text(json.dumps(kept, indent=1) + "\n")


if __name__ == "__main__":
    main()
