"""Columns of an observation: their scales are measured, and their table is the one that people read."""

from __future__ import annotations

import numpy as np
import pytest

import sledenv
from sledenv.envs.columns import AROUND, FORESEEN, GROUPS, STATE, Columns
from sledenv.envs.vector import SledDescentVector
from sledenv.simulation.outlook import LANDING, VERTEX

RIDES = [name for name in sledenv.scenario_names() if sledenv.load_scenario(name).rider is not None]
_MASKS = ("there",)
_STILL = ("sine", "cosine")  # of a sled, which hardly turns


@pytest.fixture(scope="module")
def seen() -> dict[str, tuple[np.ndarray, Columns]]:
    """What is seen of rides with random trims, by scenario."""
    found = {}
    for name in RIDES:
        env = SledDescentVector(64, name, columns=GROUPS, info=(), autoreset_mode="SameStep")
        rng, told = np.random.default_rng(0), [env.reset(seed=0)[0]]
        told += [env.step(rng.uniform(-1.0, 1.0, (64, 1)).astype(np.float32))[0] for _ in range(24)]
        found[name] = np.concatenate(told), env.task.columns
    return found


def test_entries_vary_by_a_tenth_to_one_over_all_scenarios(seen):
    """Oracle: standard deviations; fields of the context that no scenario varies are none."""
    spread: dict[str, list[np.ndarray]] = {}
    for rows, columns in seen.values():
        for name, column in zip(columns.names, rows.T, strict=True):
            spread.setdefault(name, []).append(column)
    apart = {name: float(np.concatenate(parts).std()) for name, parts in spread.items() if not name.endswith(_MASKS)}
    assert {name for name, deviation in apart.items() if deviation == 0.0} == {"fall", "shape"}
    for name, deviation in apart.items():
        assert deviation == 0.0 or 0.1 <= deviation <= 1.0, (name, deviation)


@pytest.mark.parametrize("scenario", RIDES)
def test_entries_of_the_state_vary_in_each_scenario(seen, scenario):
    """Oracle: standard deviations."""
    rows, columns = seen[scenario]
    for state in STATE:
        deviation = rows[:, columns.names.index(state.name)].std()
        assert (0.005 if state.name in _STILL else 0.1) <= deviation <= 1.0, (state.name, deviation)


def test_the_kernel_tells_what_the_columns_say():
    assert tuple(one.name for one in AROUND) == VERTEX
    assert tuple(one.name for one in FORESEEN) == LANDING


def test_values_are_read_back_in_their_units(seen):
    """Oracle: the scales one by one."""
    rows, columns = seen["sled_rollers"]
    values = columns.values(rows)
    assert values["left"] == pytest.approx(rows[:, columns.names.index("left")] * 50.0, abs=1e-4)
    assert values["landing_time"] == pytest.approx(rows[:, columns.names.index("landing_time")] * 0.8, abs=1e-6)
    assert set(zip(columns.names, columns.units, strict=True)) >= {("u", "m/s"), ("angle", "rad"), ("ahead_1_x", "m")}
