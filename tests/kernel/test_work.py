"""The work that a descent takes, counted: a slowdown shows without a timer."""

from __future__ import annotations

import pytest

from perf import work


@pytest.mark.jit_only
def test_a_rebound_takes_no_more_integration_steps_than_it_used_to() -> None:
    """Oracle: perf/baseline.json; ``python -m perf.work --update`` makes what is better the baseline."""
    before = work.baseline()
    now = work.measure()
    assert now.keys() == before.keys()
    worse = {name: (before[name], steps) for name, steps in now.items() if steps > 1.01 * before[name]}
    assert not worse, f"(baseline, now): {worse}"
