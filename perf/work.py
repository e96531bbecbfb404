"""Integration steps a hop on fixed descents: a count that needs no timer, held against perf/baseline.json in CI.

``python -m perf.work`` prints the counts, ``python -m perf.work --update`` makes them the baseline.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import sledenv
from perf import show
from perf.reference import BODY, FEW, LAUNCH, LAW, MANY, SLOPE, launches, settings

BASELINE = Path(__file__).parent / "baseline.json"
STEPS = "steps_per_rebound"
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


def baseline(key: str = STEPS) -> dict[str, float]:
    """The committed counts."""
    found: dict[str, float] = json.loads(BASELINE.read_text())[key]
    return found


def compare(key: str, now: Mapping[str, float]) -> None:
    """Print counts beside the baseline; ``--update`` replaces it."""
    before = baseline(key)
    columns = {
        key.replace("_", " "): lambda name: name,
        "now": lambda name: f"{now[name]:,.6g}",
        "baseline": lambda name: f"{before.get(name, math.nan):,.6g}",
        "change": lambda name: f"{now[name] / before.get(name, math.nan) - 1.0:+.1%}",
    }
    print(show.table(now, columns))
    if "--update" in sys.argv:
        BASELINE.write_text(json.dumps(json.loads(BASELINE.read_text()) | {key: now}, indent=1) + "\n")


if __name__ == "__main__":
    compare(STEPS, measure())
