"""How descents are simulated: one object, checked once, for all that simulate."""

from __future__ import annotations

import math
import pickle
from dataclasses import FrozenInstanceError, fields, replace
from typing import Any

import numpy as np
import pytest

from sledenv import ContactLaw, Settings, Slope, State, load_scenario, segment, simulate, simulate_batch
from sledenv.simulation import simulate_blocks
from sledenv.simulation.settings import DEFAULT

PROBLEM: Any = (
    segment(1.0, 0.1, 0.05, 7.5e-3),
    ContactLaw(1e6, 0.5, 0.1, 0.001),
    Slope(0.2, 10.0),
    State(0.0, 1.0, 0.3, 1.0),
)


def test_settings_are_plain_numbers_that_cannot_be_changed() -> None:
    """Oracle: the types; another object with the same fields; the words that would make it."""
    numbers: Any = {"max_time": np.float32(2.5), "max_rebounds": np.int64(7), "settle_speed": 0}
    given = Settings("rigid", **numbers, end_on_chord=np.True_, end_touching="nose")
    kinds = [str, float, int, bool, str, *4 * [float]]
    assert [type(getattr(given, field.name)) for field in fields(given)] == kinds
    same = Settings("rigid", max_time=2.5, max_rebounds=7, settle_speed=0.0, end_on_chord=True, end_touching="nose")
    assert given == same == eval(repr(given)) == pickle.loads(pickle.dumps(given))
    assert hash(given) == hash(same)
    with pytest.raises(FrozenInstanceError):
        given.max_time = 1.0  # type: ignore[misc]
    with pytest.raises(ValueError, match=r"Settings.max_time = nan"):
        replace(given, max_time=math.nan)


def test_fields_that_are_spelled_stand_in_place_of_those_of_settings() -> None:
    """Oracle: the same settings as one object; a batch spells them as one descent does."""
    whole = simulate(*PROBLEM, Settings("rigid", max_rebounds=4, max_time=9.0))
    given = Settings(max_rebounds=5, max_time=9.0)
    assert simulate(*PROBLEM, Settings("rigid", max_rebounds=4), max_time=9.0).outcome == whole.outcome
    assert simulate(*PROBLEM, given, solver="rigid", max_rebounds=4).outcome == whole.outcome
    assert simulate(*PROBLEM).outcome == simulate(*PROBLEM, DEFAULT).outcome != whole.outcome
    problems = *PROBLEM[:3], PROBLEM[3:]
    (part,) = simulate_blocks(*problems, given, solver="rigid", max_rebounds=4)
    for outcomes in (simulate_batch(*problems, given, solver="rigid", max_rebounds=4).outcomes, part.outcomes):
        assert [*outcomes] == [whole.outcome]


def test_those_of_a_scenario_are_its_limits_and_rules() -> None:
    """Oracle: the file's sections."""
    scenario = load_scenario("sled_mat")
    limits = {"max_time": 30.0, "max_rebounds": 200, "tolerance": 1e-10}
    rules = {"end_touching": "rider", "run_out": 4.0}
    assert scenario.settings("rigid") == Settings("rigid", **limits, **rules)
