"""How descents are simulated: one object, checked once, for all that simulate."""

from __future__ import annotations

import math
import pickle
from dataclasses import FrozenInstanceError, fields, replace
from typing import Any

import numpy as np
import pytest

from sledenv import ContactLaw, Ride, RideBatch, Settings, Slope, State, load_scenario, segment, sensitivity, simulate
from sledenv.simulation.settings import DEFAULT

PROBLEM: Any = (
    segment(1.0, 0.1, 0.05, 7.5e-3),
    ContactLaw(1e6, 0.5, 0.1, 0.001),
    Slope(0.2, 10.0),
    State(0.0, 1.0, 0.3, 1.0),
)

REFUSED = [
    ({"solver": "magic"}, ValueError, "solver = 'magic': must be one of 'compliant', "),
    (
        {"solver": "euler"},
        ValueError,
        "solver = 'euler': must be one of 'compliant', 'rigid'; the paper's own method is sledenv.reproduce.euler_",
    ),
    ({"max_rebounds": 0}, ValueError, "max_rebounds = 0: must be an integer >= 1"),
    ({"max_rebounds": -3}, ValueError, "max_rebounds = -3: must be an integer >= 1"),
    ({"max_rebounds": 1.5}, TypeError, "max_rebounds = 1.5: must be an integer >= 1"),
    ({"max_rebounds": True}, TypeError, "max_rebounds = True: must be an integer >= 1"),
    ({"max_time": 0.0}, ValueError, "max_time = 0.0: must be in (0, inf)"),
    ({"max_time": math.nan}, ValueError, "max_time = nan: must be in (0, inf)"),
    ({"max_time": math.inf}, ValueError, "max_time = inf: must be in (0, inf)"),
    ({"tolerance": 1.0}, ValueError, "tolerance = 1.0: must be in [1e-18, 1e-3]"),
    ({"sample_interval": 0.0}, ValueError, "sample_interval = 0.0: must be in [1e-12, inf) s"),
    ({"sample_interval": 1e-300}, ValueError, "sample_interval = 1e-300: must be in [1e-12, inf) s"),
    ({"settle_speed": -1.0}, ValueError, "settle_speed = -1.0: must be in [0, inf) m/s"),
    ({"settle_speed": "slow"}, TypeError, "settle_speed = 'slow': must be a number in [0, inf) m/s"),
    ({"end_on_chord": 1}, TypeError, "end_on_chord = 1: must be True or False"),
    ({"end_on_chord": "yes"}, TypeError, "end_on_chord = 'yes': must be True or False"),
]


@pytest.mark.parametrize(("bad", "error", "message"), REFUSED, ids=str)
def test_a_wrong_field_is_named(bad: dict[str, Any], error: type[Exception], message: str) -> None:
    """Oracle: the message: field, value and range."""
    with pytest.raises(error) as caught:
        Settings(**bad)
    assert str(caught.value).startswith(f"Settings.{message}")


def test_an_unknown_field_of_a_simulation_is_named_with_those_there_are() -> None:
    with pytest.raises(TypeError, match=r"^tol: is no field of Settings; it has solver, max_time, .*tolerance"):
        simulate(*PROBLEM, tol=1e-8)  # type: ignore[call-arg]


def test_settings_are_plain_numbers_that_cannot_be_changed() -> None:
    """Oracle: the types; another object with the same fields; the words that would make it."""
    given = Settings(
        "rigid",
        max_time=np.float32(2.5),
        max_rebounds=np.int64(7),
        settle_speed=0,
        end_on_chord=np.True_,
        end_touching="nose",
    )
    kinds = [str, float, int, bool, str, *4 * [float]]
    assert [type(getattr(given, field.name)) for field in fields(given)] == kinds
    same = Settings("rigid", max_time=2.5, max_rebounds=7, settle_speed=0.0, end_on_chord=True, end_touching="nose")
    assert given == same
    assert hash(given) == hash(same)
    assert eval(repr(given)) == given
    assert pickle.loads(pickle.dumps(given)) == given
    with pytest.raises(FrozenInstanceError):
        given.max_time = 1.0  # type: ignore[misc]
    with pytest.raises(ValueError, match=r"Settings.max_time = nan"):
        replace(given, max_time=math.nan)


def test_fields_that_are_spelled_stand_in_place_of_those_of_settings() -> None:
    """Oracle: the same settings as one object."""
    whole = simulate(*PROBLEM, Settings("rigid", max_rebounds=4, max_time=9.0))
    given = Settings(max_rebounds=5, max_time=9.0)
    assert simulate(*PROBLEM, Settings("rigid", max_rebounds=4), max_time=9.0).outcome == whole.outcome
    assert simulate(*PROBLEM, given, solver="rigid", max_rebounds=4).outcome == whole.outcome
    assert simulate(*PROBLEM).outcome == simulate(*PROBLEM, DEFAULT).outcome != whole.outcome


@pytest.mark.parametrize("run", [Ride, sensitivity, lambda *given: RideBatch(*given[:3], [given[3]], given[4])])
def test_what_are_no_settings_is_named(run: Any) -> None:
    """Oracle: the message; simulate_batch and simulate_blocks are asked in test_simulate.py."""
    with pytest.raises(TypeError, match=r"settings = 'rigid': must be Settings"):
        run(*PROBLEM, "rigid")


def test_those_of_a_scenario_are_its_limits_and_rules() -> None:
    """Oracle: the file's sections."""
    scenario = load_scenario("sled_mat")
    limits = {"max_time": 30.0, "max_rebounds": 200, "tolerance": 1e-10}
    rules = {"end_touching": "rider", "run_out": 4.0}
    assert scenario.settings("rigid") == Settings("rigid", **limits, **rules)
