"""The work that a descent takes, counted: a slowdown shows without a timer."""

from __future__ import annotations

import numpy as np
import pytest

import sledenv
from perf.reference import BODY, LAUNCH, LAW, SLOPE, launches

STEPS = {  # per rebound: when it becomes better, its number is written here
    "reference, 5 rebounds": ([LAUNCH], 5, 5.2),
    "reference, 20 rebounds": ([LAUNCH], 20, 22.4),
    "500 random launches, 5 rebounds": (launches(500), 5, 5.46),
}


@pytest.mark.jit_only
@pytest.mark.parametrize("name", STEPS)
def test_a_rebound_takes_no_more_integration_steps_than_it_used_to(name: str) -> None:
    """Oracle: the count of an earlier commit, the same on every machine."""
    states, rebounds, before = STEPS[name]
    settings = sledenv.Settings(max_rebounds=rebounds)
    outcomes = sledenv.simulate_batch(BODY, LAW, SLOPE, np.array(states), settings).outcomes
    assert outcomes["steps"].sum() / outcomes["rebounds"].sum() <= 1.01 * before
