"""Study files: what they mean and what is refused."""

from __future__ import annotations

import math
import pickle
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import sledenv
from sledenv import ContactLaw, State, simulate_batch
from sledenv.scenarios.bodies import OneBody
from sledenv.scenarios.configuration import Section
from sledenv.scenarios.sections import ContactSection, LaunchSection, SlopeSection, ZoneSection
from sledenv.uncertainty import StudyError, load_study, study_names
from sledenv.uncertainty.distributions import EDGE, KINDS, Distribution
from sledenv.uncertainty.model import _CONTEXT, _LAW, _SLOPE
from tests.bodies import same_bits
from tests.own_scenarios import own_scenario
from tests.uncertainty.make import DROP, PUSH, ZONED, batch_of, lane_of, made, mapping

UNIFORM = {"kind": "uniform", "low": 0.2, "high": 0.3}
FAR = {"kind": "uniform", "low": 8, "high": 10}


@pytest.mark.parametrize("name", study_names())
def test_every_shipped_study_is_valid_and_launches(name: str) -> None:
    study = load_study(name)
    assert study.id == name
    assert study.sources
    scenes = study.scenes(study.values(np.full((3, len(study.parameters)), 0.3)))
    assert len(simulate_batch(*batch_of(scenes)).outcomes) == 3


ONE_SIGMA = 0.5 + 0.5 * math.erf(math.sqrt(0.5))  # share of a normal distribution below its mean and a deviation
SHARES = [  # a kind, its numbers, a value and which share lies below it, by hand
    ("uniform", {"low": -1.0, "high": 3.0}, 0.0, 0.25),
    ("normal", {"mean": 1.0, "sd": 0.5}, 1.5, ONE_SIGMA),
    ("truncated_normal", {"mean": 0.0, "sd": 2.0, "low": -2.0, "high": 2.0}, 0.0, 0.5),
    ("truncated_normal", {"mean": 1.0, "sd": 2.0, "low": 1.0, "high": 9e9}, 3.0, 2.0 * ONE_SIGMA - 1.0),
    ("lognormal", {"median": 2.0, "log_sd": 0.4}, 2.0 * math.exp(0.4), ONE_SIGMA),
    ("triangular", {"low": 0.0, "mode": 1.0, "high": 4.0}, 1.0, 0.25),
    ("triangular", {"low": 0.0, "mode": 1.0, "high": 4.0}, 3.0, 1.0 - 1.0 / 12.0),
]


@pytest.mark.parametrize(("kind", "numbers", "value", "share"), SHARES)
def test_a_distribution_is_what_its_name_says(kind: str, numbers: dict[str, float], value: float, share: float) -> None:
    """Oracle: shares of areas under the density, by hand."""
    one = KINDS[kind].model_validate({"kind": kind} | numbers)
    assert one.at(np.array([share])) == pytest.approx(value, abs=1e-12)
    assert one.outside(-math.inf, value) == pytest.approx(1.0 - share, abs=1e-12)
    assert one.outside(value, math.inf) == pytest.approx(share, abs=1e-12)


@given(st.sampled_from(sorted(KINDS)), st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3), st.floats(1e-3, 1e3))
def test_what_is_drawn_lies_within_the_bounds_and_rises(kind: str, numbers: list[float], sd: float) -> None:
    """Oracle: a quantile function never falls, and leaves no bound that is given."""
    low, mode, high = sorted(numbers)
    every = {"low": low, "mode": mode, "high": high + 1.0, "mean": mode, "sd": sd, "median": sd, "log_sd": 1.0}
    fields = KINDS[kind].model_fields.keys() - {"kind"}
    one: Distribution = KINDS[kind].model_validate({"kind": kind} | {name: every[name] for name in fields})
    values = one.at(np.array([EDGE, 0.01, 0.5, 0.99, 1.0 - EDGE]))
    assert np.isfinite(values).all()
    assert (np.diff(values) >= 0.0).all()
    assert one.ends == (values[0], values[-1])
    if "low" in fields:
        assert low <= values[0]
        assert values[-1] <= high + 1.0


def test_every_number_of_a_section_can_be_uncertain() -> None:
    """Oracle: the keys of the sections of a scenario."""
    parts = {"slope": SlopeSection, "contact": ContactSection, "zone": ZoneSection, "launch": LaunchSection}
    keys = {f"{part}.{key}" for part, section in parts.items() for key in section.quantities()}
    certain = {"slope.run_out_m", "zone.end_m", "zone.rolling_arm_m", "zone.corner_rolling_arm_m"}
    certain |= {"zone.restitution", "zone.stiffness_n_m"}
    ground = {
        "slope.profile_m",
        "slope.rounding_m",
        "slope.tolerance_m",
        "slope.steepest_deg",
    }  # no numbers of a descent
    assert _CONTEXT.keys() | _LAW.keys() | _SLOPE.keys() == keys - certain - ground
    for name in certain:
        with pytest.raises(StudyError, match=rf"{name}: must be certain, a number alone"):
            made(ZONED, **{name.replace(".", "__"): FAR if name == "zone.end_m" else UNIFORM})


@pytest.mark.parametrize("section", get_args(OneBody))
def test_every_number_of_a_body_can_be_uncertain(section: type[Section]) -> None:
    """Oracle: the section built by itself for each draw; a body that is drawn is launched clear of the slope."""
    (kind,) = get_args(section.model_fields["kind"].annotation)
    fields = {
        "disc": {"mass_kg": 2, "radius_m": 0.5, "eccentricity_m": 0.1, "inertia_kg_m2": 0.2},
        "segment": {"mass_kg": 2, "radius_m": 0.5, "half_angle_deg": 100},
        "sled": {"balance": 0.1, "bow_radius_m": 15, "height_m": 0.1, "length_m": 0.95}
        | {"rider_height_m": 1.75, "rider_mass_kg": 80, "sled_mass_kg": 40},
        "custom": {"mass_kg": 2, "radius_m": 0.5, "eccentricity_m": 0.1, "inertia_kg_m2": 0.2, "half_angle_deg": 120},
        "polygon": {"mass_kg": 2, "rounding_m": 0.05, "inertia_kg_m2": 0.1},
        "hull": {"mass_kg": 2, "inertia_kg_m2": 0.1},
        "arcs": {"mass_kg": 2, "inertia_kg_m2": 0.1},
        "rock": {"length_m": 0.6, "width_ratio": 0.7, "depth_ratio": 0.8, "rounding": 0.2}
        | {"density_kg_m3": 2600, "shape": 0.3},
    }[kind]
    certain = {"kind": kind} | {
        "polygon": {"points_m": [[0, 0], [0.6, 0], [0.5, 0.4]]},
        "hull": {"circles_m": [[0, 0, 0.1], [0.6, 0, 0.2], [0.5, 0.4, 0]], "centre_m": [0.4, 0.1]},
        "arcs": {"arcs": [{"x_m": 0.1, "y_m": 0, "radius_m": 0.4, "begin_rad": 0}], "centre_m": [0, 0]},
    }.get(kind, {})
    around = {key: {"kind": "uniform", "low": 0.97 * value, "high": 1.03 * value} for key, value in fields.items()}
    study = made(mapping(DROP, body=certain | around, launch__drop_m=0.0, launch__orientation_deg=30))
    values = study.values(np.random.default_rng(0).uniform(0.01, 0.99, (5, len(fields))))
    scenes = study.scenes(values)
    for row, body, launch in zip(values, scenes.bodies[scenes.body], scenes.launches, strict=True):
        alone = section.model_validate(certain | dict(zip(fields, row.tolist(), strict=True))).build()
        same_bits(body, alone.record[0])
        assert launch[1] == sledenv.simulation.support.support_height(alone, launch[2])


def test_draws_go_where_their_keys_say() -> None:
    """Oracle: the fields of law, slope and launch, in SI; degrees become radians."""
    study = made(
        DROP,
        slope__angle_deg={"kind": "uniform", "low": 10, "high": 20},
        slope__gravity_m_s2=UNIFORM,
        contact__restitution=None,
        contact__asymmetry=UNIFORM,
        contact__corner_rolling_arm_m=UNIFORM,
        launch__orientation_deg={"kind": "uniform", "low": -30, "high": 30},
        launch__fall_m_s=UNIFORM,
    )
    scenes = study.scenes(study.values(np.full((2, 7), 0.25)))
    law, _, launch = lane_of(scenes, 0)
    assert law == pytest.approx(ContactLaw(1e7, 0.225, 0.0, 0.0, 0.225))
    assert lane_of(scenes, 1).slope[:3] == pytest.approx([math.radians(12.5), 100.0, 0.225])
    assert launch == pytest.approx(State(0.0, 0.1 + 0.875, math.radians(-15.0), 3.0, -0.225, 0.0))


def test_a_study_stands_in_for_the_numbers_of_its_scenario() -> None:
    """Oracle: the shipped scenario for all else; what tells one study from another is not its words."""
    study = made(PUSH)
    scenes = study.scenes(study.values(np.full((2, 3), 0.5)))
    (body,) = study.base.all_bodies()
    assert (body,) == sledenv.load_scenario(own_scenario("bowl_snow")).all_bodies()
    assert scenes.body.tolist() == [0, 0]
    same_bits(scenes.bodies, body.record)
    assert scenes.launches[0, 3] == pytest.approx(5.0)
    assert study.base.ends.on_chord
    assert made(PUSH, title="Another", launches=7, seed=3).key == study.key
    assert made(PUSH, solver="rigid").key != study.key
    assert made(PUSH, launch__drop_m=0.31).key != study.key
    assert made(PUSH, launch__speed_m_s={"kind": "normal", "mean": 5, "sd": 0.51}).key != study.key
    assert pickle.loads(pickle.dumps(study)).key == study.key
