"""Study files: what they mean and what is refused."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate

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


def written(folder: Path, content: Any) -> Path:
    path = folder / "one.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.mark.parametrize("name", study_names())
def test_every_shipped_study_is_valid_and_launches(name: str) -> None:
    study = load_study(name)
    assert study.id == name
    assert study.sources
    scenes = study.scenes(study.values(np.full((3, len(study.parameters)), 0.3)))
    assert len(simulate_batch(*batch_of(scenes)).outcomes) == 3


DENSITIES = {  # written out, unlike those of scipy.stats
    "uniform": ({"low": -1.0, "high": 3.0}, lambda x: 0.25 * ((x >= -1) & (x <= 3))),
    "normal": (
        {"mean": 1.0, "sd": 0.5},
        lambda x: np.exp(-0.5 * ((x - 1) / 0.5) ** 2) / (0.5 * math.sqrt(2 * math.pi)),
    ),
    "truncated_normal": (
        {"mean": 0.0, "sd": 1.0, "low": -1.0, "high": 2.0},
        lambda x: (
            np.exp(-0.5 * x**2)
            * ((x >= -1) & (x <= 2))
            / (math.sqrt(math.pi / 2) * (math.erf(2**0.5) + math.erf(0.5**0.5)))
        ),
    ),
    "lognormal": (
        {"median": 2.0, "log_sd": 0.4},
        lambda x: np.exp(-0.5 * (np.log(x / 2.0) / 0.4) ** 2) / (x * 0.4 * math.sqrt(2 * math.pi)),
    ),
    "triangular": (
        {"low": 0.0, "mode": 1.0, "high": 4.0},
        lambda x: np.where(x < 1, x / 2, (4 - x) / 6) * ((x >= 0) & (x <= 4)),
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_distribution_is_what_its_name_says(kind: str) -> None:
    """Oracle: the density, written out here and summed up numerically."""
    given_, density = DENSITIES[kind]
    one = KINDS[kind].model_validate({"kind": kind} | given_)
    low, high = one.at(np.array([0.1, 0.8]))
    share, _ = integrate.quad(density, low, high, limit=200)
    assert share == pytest.approx(0.7, abs=1e-9)
    assert one.outside(low, high) == pytest.approx(0.3, abs=1e-12)


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


def test_the_path_of_a_scenario_is_seen_from_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = sledenv.load_scenario(own_scenario("bowl_snow")).model_dump(by_alias=True, mode="json")
    (tmp_path / "own.yaml").write_text(yaml.safe_dump({key: value for key, value in own.items() if value is not None}))
    path = written(tmp_path, mapping(PUSH, scenario="own.yaml"))
    monkeypatch.chdir("/")
    assert load_study(path).base.body_section == made(PUSH).base.body_section


def of(kind: str, **numbers: float) -> dict[str, Any]:
    """A distribution."""
    return {"kind": kind} | numbers


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"contact__fricton": 0.3}, "contact.fricton = 0.3: unknown key (did you mean 'friction'?)"),
        (
            {"contact__fricton": UNIFORM},
            "contact.fricton: uniform, low 0.2, high 0.3: unknown key (did you mean 'friction'?)",
        ),
        (
            {"scenario": "sled_snow", "zone__fricton": UNIFORM},
            "zone.fricton: uniform, low 0.2, high 0.3: unknown key (did you mean 'friction'?)",
        ),
        (
            {"contact__friction": of("uniform", low=-0.3, high=-0.1)},
            "contact.friction: uniform, low -0.3, high -0.1: must be a number",
        ),
        ({"contact__friction": of("uniform", low=0.3, high=0.3)}, "low = 0.3: must be below high = 0.3"),
        (
            {"contact__friction": of("triangular", low=0.1, mode=0.5, high=0.3)},
            "mode = 0.5: must be in [low, high] = [0.1, 0.3]",
        ),
        ({"launch__drop_m": of("normal", mean=1, sd=0)}, "sd = 0: must be a number in (0, inf)"),
        ({"launch__drop_m": of("lognormal", median=0, log_sd=1)}, "median = 0: must be a number in (0"),
        ({"launch__drop_m": of("normal", mean=1)}, "sd: missing"),
        ({"launch__drop_m": of("normal", mean=1, sd=1, low=0)}, "low = 0: unknown key; known: kind, mean, sd"),
        ({"launch__drop_m": {"kind": "cauchy"}}, "launch.drop_m: kind = 'cauchy': must be one of uniform, normal"),
        ({"launch__drop_m": {"kind": "unifrom"}}, "(did you mean 'uniform'?)"),
        ({"launch__drop_m": {"kind": ["normal"]}}, "launch.drop_m: kind = ['normal']: must be one of uniform"),
        ({"launch__drop_m": {"low": 1}}, "launch.drop_m: kind: missing; must be one of uniform"),
        (
            {"launch__drop_m": of("uniform", low=1, hihg=2)},
            "launch.drop_m: hihg = 2: unknown key (did you mean 'high'?); known: kind, low, high; high: missing",
        ),
        ({"launch__drop_m": math.nan}, "launch.drop_m = nan: must be a number"),
        (
            {"contact__friction": of("normal", mean=0.1, sd=0.1)},
            "contact.friction: normal, mean 0.1, sd 0.1: a share of 0.16 lies outside [0, inf): truncated_normal has",
        ),
        (
            {"contact__restitution": of("uniform", low=0.5, high=1.5)},
            "contact.restitution: uniform, low 0.5, high 1.5: a share of 0.5 lies outside (0, 1]",
        ),
        ({"launch__speed_m_s": of("lognormal", median=1, log_sd=500)}, "lies outside [0, inf) m/s"),
        ({"slope__angle_deg": [3, 7]}, "slope.angle_deg: is a range, give a number or a distribution"),
        ({"body__radius_m": -1}, "body.radius_m = -1: must be a number in [1e-50, 1e+50] m"),
        (
            {"body": {"kind": "cube"}},
            "body.kind = 'cube': must be one of disc, segment, sled, polygon, hull, arcs, custom, rock, choice",
        ),
        ({"contact__asymmetry": 0.5}, "either restitution"),
        ({"limits": None}, "limits: missing"),
        ({"launch__drop_m": 1}, "nothing is uncertain"),
        ({"stations_m": [1, 1]}, "stations_m = [1.0, 1.0]: must rise"),
        ({"stations_m": [0, 1]}, "stations_m.0 = 0: must be a number in (0, inf)"),
        ({"launches": 0}, "launches = 0: must be a whole number in [1"),
        ({"solver": "exact"}, "solver = 'exact'"),
        ({"scenario": "sled_snwo"}, "unknown scenario 'sled_snwo' (did you mean 'sled_snow'?)"),
        ({"sloep": {}}, "sloep = {}: unknown key (did you mean 'slope'?); known: id, title"),
    ],
)
def test_a_wrong_study_is_refused_by_name_of_the_key(changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"one\.yaml: ") as error:
        load_study(written(tmp_path, mapping(DROP, **changes)))
    assert message in str(error.value)


def test_ranges_of_a_scenario_are_not_drawn_from_unasked(tmp_path: Path) -> None:
    """Oracle: bowl_snow has ranges of slope, friction, restitution, speed, drop, orientation and spin."""
    content = {"id": "one", "title": "One", "scenario": own_scenario("bowl_snow"), "launch": {"speed_m_s": UNIFORM}}
    with pytest.raises(StudyError) as error:
        load_study(written(tmp_path, content))
    lines = str(error.value).splitlines()
    assert [line.split(": ")[1] for line in lines] == [
        *("slope.angle_deg", "contact.friction", "contact.restitution", "launch.drop_m", "launch.orientation_deg"),
        "launch.spin_rad_s",
    ]
    assert all(line.endswith(": is a range, give a number or a distribution") for line in lines)


def test_draws_that_are_no_body_are_counted() -> None:
    """Oracle: the mass centre is above the chord in the lower half of the range, a quarter of the draws."""
    eccentricity = {"kind": "triangular", "low": 0.6, "mode": 1.0, "high": 1.0}
    study = made(PUSH, body__eccentricity_m=eccentricity)
    with pytest.raises(StudyError, match=r"a share of 0\.25 of all draws is no body, such as .*eccentricity_m = 0\.7"):
        study.check_bodies(study.values(np.full((4, 4), [[0.1], [0.7], [0.8], [0.9]])))
    light = made(DROP, body__mass_kg={"kind": "uniform", "low": 0.5, "high": 2.5})  # all mass at the rim: 1 kg
    with pytest.raises(StudyError, match=r"a share of 0\.25 .* inertia_kg_m2 = 0\.01: must be a number in \(0, m"):
        light.check_bodies(light.values(np.tile([[0.2], [0.3], [0.5], [0.9]], 2)))


@pytest.mark.parametrize("text", ["", "- 1", "id: [", "id: a\nid: b"])
def test_a_file_that_is_no_mapping_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "one.yaml"
    path.write_text(text)
    with pytest.raises(StudyError, match=r"one\.yaml"):
        load_study(path)
    with pytest.raises(StudyError, match="unknown study 'brake_stpo' \\(did you mean 'brake_stop'"):
        load_study("brake_stpo")
    with pytest.raises(StudyError, match="cannot be read"):
        load_study(tmp_path / "none.yaml")
