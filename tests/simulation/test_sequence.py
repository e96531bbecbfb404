"""The code of the sequence of events in a rebound."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sledenv.simulation.bodies import Segment, segment
from sledenv.simulation.rigid_impact import rigid_impact
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Settings
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate, simulate_batch

DISC = segment(1.0, 0.1, 0.05, 7.5e-3)
SEGMENT = circular_segment(2.0, 0.5, math.radians(60.0))
LAW = ContactLaw(1e6, 0.5, 0.3, 0.002, 0.001)
INCLINE = Slope(0.2, 10.0, 9.81)
RANGES = ((0.0, 0.0), (1.0, 1.5), (-3.0, 3.0), (-2.0, 2.0), (-2.0, 0.0), (-10.0, 10.0))  # of the fields of State


def launches(count: int) -> np.ndarray:
    rng = np.random.default_rng(4)
    return np.column_stack([rng.uniform(low, high, count) for low, high in RANGES])


@pytest.mark.parametrize("body", [DISC, SEGMENT], ids=["disc", "segment"])
def test_first_rigid_rebounds_have_the_same_code_just_when_their_impacts_have_the_same_phases(body: Segment) -> None:
    """Oracle: rigid_impact's own list of phases, of a launch that has fallen on one point."""
    batch = simulate_batch(
        body, LAW, INCLINE, launches(300), Settings(solver="rigid", max_rebounds=1), keep_rebounds=True
    )
    seen: dict[tuple[Any, ...], set[int]] = {}
    for row in batch.rebounds[:, 0]:
        if row["t"] > row["t_touchdown"]:
            continue  # it stayed
        at = State(0.0, 0.0, row["phi"], row["u_before"], row["v_before"], row["omega_before"])
        phases = tuple((p.slip, p.spin, p.restitution) for p in rigid_impact(body, LAW, at).phases)
        seen.setdefault(phases, set()).add(int(row["sequence"]))
    assert len(seen) > 10
    assert all(len(codes) == 1 for codes in seen.values())
    assert len(set.union(*seen.values())) == len(seen)


def branches(trajectory: np.ndarray, start: float, end: float) -> tuple[tuple[int, ...], ...]:
    """Return feature and signs of slip and spin of a contact in turn, as the rows between two times tell."""
    rows = trajectory[(trajectory["feature"] > 0) & (trajectory["t"] >= start) & (trajectory["t"] <= end)]
    # Within a step signs stay; at its two ends rows share their time with those of its neighbours.
    found: list[tuple[int, ...]] = []
    for row in rows:
        told = tuple(int(row[name]) for name in ("feature", "slip", "spin"))
        if not found or found[-1] != told:
            found.append(told)
    return tuple(found)


def test_compliant_rebounds_with_the_same_code_went_the_same_way() -> None:
    """Oracle: the trajectory's own signs of slip and spin, in order."""
    seen: dict[int, tuple[tuple[int, ...], ...]] = {}
    for launch in launches(60):
        descent = simulate(DISC, LAW, INCLINE, State(*launch), record="trajectory", max_rebounds=3)
        for row in descent.rebounds:
            way = branches(descent.trajectory, row["t_touchdown"], row["t"])
            assert seen.setdefault(int(row["sequence"]), way) == way
    assert len(set(seen.values())) > 8
