"""Scenarios: what is read, what is refused and in which words, how contexts are drawn, what the simulator gets."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sledenv.scenarios.configuration import read_yaml, write_yaml
from sledenv.scenarios.scenario import Context, Scenario, ScenarioError, load_scenario, scenario_names
from sledenv.simulation.bodies import Body, Segment, segment
from sledenv.simulation.scene import State
from sledenv.simulation.shapes import circular_segment, hull, polygon, rod
from sledenv.simulation.sleds import sled
from sledenv.simulation.support import support_height
from tests.own_scenarios import DELETE, GOOD, POLYGON, changed, own_scenario

ROOT = Path(__file__).parents[2]
SHIPPED = sorted(path.stem for path in (ROOT / "configs" / "scenarios").glob("*.yaml"))


def problems(content: Any) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        Scenario.model_validate(content)
    return str(caught.value).splitlines()


HULL = {"kind": "hull", "mass_kg": 2, "circles_m": [[0, 0, 0.1], [0.6, 0.1, 0.05], [0.2, 0.4, 0]]}
MEASURED = {"inertia_kg_m2": 0.3, "centre_m": [0.25, 0.125]}


@pytest.fixture
def scenario() -> Scenario:
    return Scenario.model_validate(GOOD)


def test_every_problem_is_reported_at_once() -> None:
    """Oracle: three mistakes in three sections make three lines; what is no mapping makes one."""
    lines = problems(changed(slope__angle_deg=95, body__mass_g=1, limits__max_rebounds=0))
    keys = ["slope.angle_deg", "body.mass_g", "limits.max_rebounds"]
    assert [line.split(": ")[1].split(" =")[0] for line in lines] == keys
    for content in (None, [], 3, own_scenario("ice_drop")):
        assert problems(content) == ["scenario without id: must be a mapping of keys to values"]


def test_bounds_of_the_speed_are_optional_and_count_in_the_hash_where_they_are_given(scenario: Scenario) -> None:
    """Oracle: the scenario without them; a choice that they allow, and one of which the bounds are wrong."""
    assert Scenario.model_validate(changed(control__speed_m_s=None)) == scenario
    assert list(scenario.control_bounds) == ["orientation", "spin"]
    faster = Scenario.model_validate(changed(control__speed_m_s=[2, 5], control__chosen="orientation+speed"))
    assert faster.control_bounds["speed"] == (2.0, 5.0)
    assert faster.hash != scenario.hash
    assert Scenario.model_validate(faster.model_dump()) == faster
    (line,) = problems(changed(control__speed_m_s=[5, 2], control__chosen="speed"))
    assert line.startswith("scenario example: control.speed_m_s = [5, 2]: low must be below high")


def test_a_number_is_decimal_and_all_else_is_text(tmp_path: Path) -> None:
    """Oracle: YAML 1.1 would read 8, 90, 16, 3, 1000 and 90.5 for the first of what is text here."""
    numbers = {"0": 0, "-7": -7, "+12": 12, "1e7": 1e7, "-.5": -0.5, "3.": 3.0, "0.25E-3": 0.25e-3, ".inf": math.inf}
    words = ("010", "1:30", "0x10", "0b11", "1_000", "1:30.5", ".", "+", "1e", "00.5", "e5", "..5")
    for text, value in (numbers | dict(zip(words, words, strict=True))).items():
        (tmp_path / "file.yaml").write_text(f"key: {text}")
        (read,) = read_yaml(tmp_path / "file.yaml").values()
        assert (read, type(read)) == (value, type(value))


def test_a_file_reads_as_its_mapping_does(tmp_path: Path, scenario: Scenario) -> None:
    """Oracle: ``model_validate`` of the same content; ``1e7`` without a point is a number, as in YAML 1.2."""
    path = tmp_path / "example.yaml"
    path.write_text(yaml.safe_dump(GOOD).replace("10000000.0", "1e7"), encoding="utf-8")
    assert "stiffness_n_m: 1e7" in path.read_text(encoding="utf-8")
    assert load_scenario(path) == load_scenario(str(path)) == scenario


def test_a_scenario_survives_pickling_and_dumping_and_stays_fixed(scenario: Scenario) -> None:
    """Oracle: equality with the original."""
    twin = pickle.loads(pickle.dumps(scenario))
    assert twin == scenario
    assert hash(twin) == hash(scenario)
    assert Scenario.model_validate(scenario.model_dump()) == scenario
    assert Scenario.model_validate(scenario) is scenario
    with pytest.raises(ValueError, match="frozen"):
        scenario.title = "other"


def test_the_hash_depends_on_what_is_simulated_alone(scenario: Scenario) -> None:
    """Oracle: a recorded hash; prose, key order and the spelling of a number leave it, every other key changes it."""
    assert scenario.hash == "dd6b7553ed30a6ac"
    reordered = {key: GOOD[key] for key in reversed(GOOD)}
    for same in (reordered, changed(title="x", sources="y", tags=["z"]), changed(slope__gravity_m_s2=9.81)):
        assert Scenario.model_validate(same).hash == scenario.hash
    single, pair = changed(launch__drop_m=1), changed(launch__drop_m=[1.0, 1.0])
    assert Scenario.model_validate(single).hash == Scenario.model_validate(pair).hash != scenario.hash
    for other in (changed(limits__max_rebounds=201), changed(id="other"), changed(launch__spin_rad_s=[-2, 2.1])):
        assert Scenario.model_validate(other).hash != scenario.hash


def test_bodies_are_built_once(scenario: Scenario) -> None:
    """Oracle: identity. Every step of an environment asks for them, and to build one takes as long as the step."""
    again = Scenario.model_validate(scenario.model_dump(mode="json", by_alias=True))
    assert again is not scenario
    assert all(one is other for one, other in zip(scenario.all_bodies(), again.all_bodies(), strict=True))


def test_ranges_are_aligned_with_the_context_and_in_si_units(scenario: Scenario) -> None:
    """Oracle: the numbers of ``GOOD`` by hand."""
    low, high = scenario.ranges
    expected_low = Context(math.radians(6), 0.1, 0.4, 1, 0.2, 0, math.radians(-90), -2, 0, 0, 0, 0)
    expected_high = Context(math.radians(12), 0.3, 0.6, 3, 1.0, 2, math.radians(90), 2, 0, 0, 0, 0)
    np.testing.assert_array_equal(low, expected_low)
    np.testing.assert_array_equal(high, expected_high)
    low[:] = 0.0
    np.testing.assert_array_equal(scenario.ranges[0], expected_low)


def test_a_context_is_uniform_in_the_ranges(scenario: Scenario) -> None:
    """Oracle: mean and variance of a uniform distribution, to six standard errors, and no correlation."""
    rng = np.random.default_rng(7)
    contexts = np.array([scenario.sample(rng) for _ in range(4000)])
    low, high = scenario.ranges
    assert (contexts >= low).all()
    assert (contexts <= high).all()
    varied = high > low
    unit = (contexts - low)[:, varied] / (high - low)[varied]
    np.testing.assert_allclose(unit.mean(axis=0), 0.5, atol=6 * math.sqrt(1 / 12 / 4000))
    np.testing.assert_allclose(unit.var(axis=0), 1 / 12, rtol=0.1)
    np.testing.assert_allclose(np.corrcoef(unit.T), np.eye(varied.sum()), atol=6 / math.sqrt(4000))


@pytest.mark.parametrize("name", SHIPPED)
def test_sampling_is_reproducible_and_always_takes_as_many_draws(name: str) -> None:
    """Oracle: a second generator that skips eleven doubles, and one more where bumps are drawn."""
    rng, twin, skipped = (np.random.default_rng(3) for _ in range(3))
    first = load_scenario(name).sample(rng)
    assert first == load_scenario(name).sample(twin)
    assert all(type(value) is float for value in first)
    skipped.random(11 + (load_scenario(name).slope_section.bumps is not None))
    assert rng.random() == twin.random() == skipped.random()


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_no_draw_leaves_its_range(one: float, other: float) -> None:
    """Oracle: the bounds, for the extreme draws 0 and 1 - 2^-53; a degenerate range gives its number exactly."""
    low, high = sorted((one, other))
    scenario = Scenario.model_validate(changed(launch__drop_m=[low, high], contact__friction=low))
    for draw in (0.0, 1.0 - 2.0**-53):
        context = Context(*scenario.contexts(np.full(scenario.draws, draw)))
        assert low <= context.drop <= high
        assert context.friction == low


def test_each_kind_of_body_is_built() -> None:
    """Oracle: the constructors of the simulator."""

    def body(**section: Any) -> Body:
        scenario = Scenario.model_validate(changed(body=section))
        (built,) = scenario.all_bodies()
        given = scenario.given(scenario.sample(np.random.default_rng(0))).body
        assert given == built
        assert given.record.tobytes() == scenario.outlines.tobytes()
        return given

    disc = {"mass_kg": 2, "radius_m": 0.5, "eccentricity_m": 0.1, "inertia_kg_m2": 0.2}
    assert body(kind="disc", **disc) == segment(2, 0.5, 0.1, 0.2)
    assert body(kind="custom", **disc) == segment(2, 0.5, 0.1, 0.2, math.pi)
    assert body(kind="custom", **disc, half_angle_deg=90) == segment(2, 0.5, 0.1, 0.2, math.pi / 2)
    assert body(kind="custom", **disc | {"radius_m": 0, "eccentricity_m": 0}) == segment(2, 0, 0, 0.2)
    assert body(**SEGMENT) == circular_segment(2, 0.5, math.pi / 3)
    assert body(kind="sled") == sled()
    assert body(kind="sled", sled_mass_kg=30, balance=0.1) == sled(sled_mass=30.0, balance=0.1)
    assert body(**POLYGON) == polygon(2, [(0, 0), (0.4, 0), (0.3, 0.3), (0, 0.3)])
    assert body(**POLYGON, rounding_m=0.05) == polygon(2, [(0, 0), (0.4, 0), (0.3, 0.3), (0, 0.3)], 0.05)
    names = {"parts": list("abcd"), "sides": ["under", "front", "above", "back"]}
    measured = {"inertia": 0.3, "centre": (0.25, 0.125)}
    assert body(**POLYGON, **names, **MEASURED) == polygon(2, POLYGON["points_m"], **names, **measured)
    assert body(**POLYGON, inertia_kg_m2=0.3) == polygon(2, POLYGON["points_m"], inertia=0.3)
    assert body(**HULL) == hull(2, HULL["circles_m"])
    names = {"parts": ["heel", "toe", "top"], "sides": ["back", "front", "back"]}
    assert body(**HULL, **names, **MEASURED) == hull(2, HULL["circles_m"], **names, **measured)


SEGMENT = {"kind": "segment", "mass_kg": 2, "radius_m": 0.5, "half_angle_deg": 60}


@pytest.mark.parametrize("half_angle_deg", [60, 120, 180])
@pytest.mark.parametrize("orientation", [0.0, 0.7, -2.0, 3.1, 8.0, -40.0])
def test_the_lowest_point_of_the_body_starts_at_the_drop_height(half_angle_deg: float, orientation: float) -> None:
    """Oracle: the smallest height of 40 000 points of the outline, drawn around the launched mass centre.

    Whole turns are taken off an orientation.
    """
    scenario = Scenario.model_validate(changed(body=SEGMENT | {"half_angle_deg": half_angle_deg}))
    context = scenario.sample(np.random.default_rng(1))
    shape, _, _, state = scenario.given(context, orientation, 3.0)
    assert isinstance(shape, Segment)
    turned = math.remainder(orientation, math.tau)
    assert state == State(0.0, state.y, turned, context.speed, -context.fall, 3.0)
    around = orientation + np.linspace(-shape.half_angle, shape.half_angle, 40_001)
    outline = state.y + shape.eccentricity * math.cos(state.phi) - shape.radius * np.cos(around)
    assert outline.min() == pytest.approx(context.drop, abs=1e-8)


def by_arcs(body: Body) -> dict[str, Any]:
    """Section of a body, told by its arcs."""
    keys = ("x_m", "y_m", "radius_m", "begin_rad", "part", "side", "corner")
    arcs = [dict(zip(keys, arc, strict=True)) for arc in body.arcs]
    return {"kind": "arcs", "mass_kg": body.mass, "inertia_kg_m2": body.inertia, "centre_m": [0, 0], "arcs": arcs}


@pytest.mark.parametrize(
    "body",
    [
        pytest.param(sled(), id="sled"),
        pytest.param(rod(2.0, 1.5), id="rod"),
        pytest.param(rod(2.0, 1.5, 0.2), id="bar"),
        pytest.param(polygon(2.0, [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], 0.1), id="polygon"),
        pytest.param(circular_segment(2.0, 0.5, 1.0), id="segment"),
    ],
)
def test_any_body_can_be_told_by_its_arcs(body: Body, tmp_path: Path) -> None:
    """Oracle: the body, whose arcs are written into a file; where it is uniform, that without its mass properties."""
    section = by_arcs(body)
    write_yaml(tmp_path / "arcs.yaml", changed(body=section))
    (read,) = load_scenario(tmp_path / "arcs.yaml").all_bodies()
    assert (read.mass, read.inertia, read.arcs) == (body.mass, body.inertia, body.arcs)
    if body.parts[0] not in ("rider", "nose"):  # a sled is not uniform, and a line has no area
        moved = [arc | {"x_m": arc["x_m"] + 2.0, "y_m": arc["y_m"] - 1.0} for arc in section["arcs"]]
        uniform = section | {"inertia_kg_m2": None, "centre_m": None, "arcs": moved}
        (found,) = Scenario.model_validate(changed(body=uniform)).all_bodies()
        assert found.inertia == pytest.approx(body.inertia, rel=1e-12)
        assert [arc.x for arc in found.arcs] == pytest.approx([arc.x for arc in body.arcs], abs=1e-14)


def test_a_body_that_is_wrong_is_told_once() -> None:
    """Oracle: one line; neither a length that follows from the body nor the count of a choice is wrong too."""
    good, wrong = {"kind": "sled"}, {"kind": "sled", "balanc": 0.1}
    ground = {"slope__profile_m": [[0, 0], [10, -1]], "slope__length_m": DELETE}
    for changes, words in (
        ({"body": wrong} | ground, "body.balanc = 0.1: unknown key (did you mean 'balance'?)"),
        ({"body": DELETE} | ground, "body: missing; must be a mapping with kind"),
        ({"body": {"kind": "choice", "of": [good, wrong]}}, "body.of.1.balanc = 0.1: unknown key"),
        ({"body": {"kind": "choice", "of": [good]}}, "body.of = [{'kind': 'sled'}]: must have at least 2 entries"),
    ):
        (line,) = problems(changed(**changes))
        assert line.startswith(f"scenario example: {words}")


def test_a_launch_takes_the_disturbance_unless_the_agent_chooses(scenario: Scenario) -> None:
    """Oracle: the fields of the context."""
    context = scenario.sample(np.random.default_rng(2))
    disturbed, chosen = scenario.given(context).launch, scenario.given(context, orientation=0.0, spin=0.0).launch
    assert (disturbed.phi, disturbed.omega) == (context.orientation, context.spin)
    assert (chosen.phi, chosen.omega) == (0.0, 0.0)
    assert scenario.given(context, speed=4.5).launch == disturbed._replace(u=4.5)


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_scenario_is_valid_and_launches(name: str) -> None:
    """Oracle: the validation of the simulator's own parameters; the file's name is its id."""
    scenario = load_scenario(name)
    assert scenario.id == name
    assert scenario.tags
    assert scenario.sources
    low, high = (Context(*bound.tolist()) for bound in scenario.ranges)
    for context in (low, high, scenario.sample(np.random.default_rng(0))):
        body, law, slope, state = scenario.given(context)
        assert isinstance(body, Body)
        assert law.restitution == pytest.approx(context.restitution, rel=1e-15)
        assert slope[:3] == (context.angle, scenario.slope_section.length_m, scenario.slope_section.gravity_m_s2)
        assert len(slope.zones) == len(scenario.zones)
        assert state.y == context.drop + support_height(body, state.phi) >= body.lowest_support


def test_the_shipped_names_are_those_of_the_folder() -> None:
    """Oracle: the files of configs/scenarios."""
    assert scenario_names() == tuple(SHIPPED)
    assert {"sled_rollers", "boulder_benches", "sled_snow", "paper_impact"} <= set(SHIPPED)


def test_a_zone_may_have_its_own_restitution_and_stiffness() -> None:
    """Oracle: the zone and the row of the slope; those of the contact unless given, and then the hash is as without."""
    zone = {"begin_m": 2, "friction": 0.1}
    one = Scenario.model_validate(changed() | {"zones": [zone | {"restitution": 0.2, "stiffness_n_m": 1e5}]})
    plain = Scenario.model_validate(changed() | {"zones": [zone]})
    assert plain.hash == "d07a5ff190026ad2" != one.hash
    for scenario, own in ((one, (0.2, 1e5)), (plain, (None, None))):
        (found,) = scenario.given(scenario.sample(np.random.default_rng(1))).slope.zones
        assert (found.restitution, found.stiffness) == own


def test_an_episode_may_end_where_a_part_of_the_body_touches() -> None:
    """Oracle: the settings. The rule counts in the hash if it is given."""
    content = changed(body={"kind": "sled"}) | {"ends": {"touching": "rider"}}
    scenario = Scenario.model_validate(content)
    assert scenario.settings().end_touching == "rider"
    assert scenario.hash != Scenario.model_validate(content | {"ends": {}}).hash
