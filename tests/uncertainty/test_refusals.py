"""Studies that are refused, by name of the key, before anything is simulated."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from sledenv.uncertainty import StudyError, load_study
from sledenv.uncertainty.terrain import read_section
from tests.own_scenarios import own_scenario
from tests.uncertainty.make import DROP, HILL, PUSH, ROLLERS, SECTION, UNIFORM, made, mapping

BUMPS = {"height_m": [0.2, 0.4], "face_m": UNIFORM, "top_m": 0.5, "gap_m": [1, 2], "start_m": 3}


def of(kind: str, **numbers: Any) -> dict[str, Any]:
    """A distribution."""
    return {"kind": kind} | numbers


def point(k: int, *given: Any) -> dict[str, Any]:
    """A terrain with another point."""
    return {"section": [*SECTION[:k], list(given), *SECTION[k + 1 :]]}


REFUSED: list[tuple[dict[str, Any], str, Any, str]] = [
    (DROP, "contact__fricton", 0.3, "contact.fricton = 0.3: unknown key (did you mean 'friction'?)"),
    (DROP, "contact__fricton", UNIFORM, "contact.fricton: uniform, low 0.3, high 0.5: unknown"),
    (DROP, "contact__friction", of("uniform", low=-2, high=-1), "contact.friction: uniform, low -2, high -1: must be"),
    (DROP, "contact__friction", of("uniform", low=0.3, high=0.3), "low = 0.3: must be below high = 0.3"),
    (DROP, "contact__friction", of("triangular", low=0, mode=5, high=3), "mode = 5: must be in [low, high] = [0, 3]"),
    (DROP, "contact__friction", of("normal", mean=0.1, sd=0.1), "a share of 0.16 lies outside [0, inf): truncated_nor"),
    (DROP, "contact__restitution", of("uniform", low=0.5, high=1.5), "a share of 0.5 lies outside (0, 1]"),
    (DROP, "contact__asymmetry", 0.5, "either restitution"),
    (DROP, "launch__drop_m", of("normal", mean=1, sd=0), "sd = 0: must be a number in (0, inf)"),
    (DROP, "launch__drop_m", of("lognormal", median=0, log_sd=1), "median = 0: must be a number in (0"),
    (DROP, "launch__drop_m", of("normal", mean=1, sd=1, low=0), "low = 0: unknown key; known: kind, mean, sd"),
    (DROP, "launch__drop_m", of("uniform", low=1, hihg=2), "hihg = 2: unknown key (did you mean 'high'?); known: kind"),
    (DROP, "launch__drop_m", of("unifrom"), "kind = 'unifrom': must be one of uniform, normal"),
    (DROP, "launch__drop_m", {"kind": ["normal"]}, "launch.drop_m: kind = ['normal']: must be one of uniform"),
    (DROP, "launch__drop_m", {"low": 1}, "launch.drop_m: kind: missing; must be one of uniform"),
    (DROP, "launch__drop_m", math.nan, "launch.drop_m = nan: must be a number"),
    (DROP, "launch__drop_m", 1, "nothing is uncertain"),
    (DROP, "launch__speed_m_s", of("lognormal", median=1, log_sd=500), "lies outside [0, inf) m/s"),
    (DROP, "slope__angle_deg", [3, 7], "slope.angle_deg: is a range, give a number or a distribution"),
    (DROP, "body__radius_m", -1, "body.radius_m = -1: must be a number in [1e-50, 1e+50] m"),
    (DROP, "body", {"kind": "cube"}, "body.kind = 'cube': must be one of disc, segment, sled, polygon, hull, arcs"),
    (DROP, "limits", None, "limits: missing"),
    (DROP, "stations_m", [1, 1], "stations_m = [1.0, 1.0]: must rise"),
    (DROP, "stations_m", [0, 1], "stations_m.0 = 0: must be a number in (0, inf)"),
    (DROP, "launches", 0, "launches = 0: must be a whole number in [1"),
    (DROP, "solver", "exact", "solver = 'exact'"),
    (DROP, "scenario", "sled_snwo", "unknown scenario 'sled_snwo' (did you mean 'sled_snow'?)"),
    (DROP, "sloep", {}, "sloep = {}: unknown key (did you mean 'slope'?); known: id, title"),
    (DROP, "start_m", 2.0, "start_m: goes with terrain, and there is none"),
    (ROLLERS, "solver", "rigid", "solver = 'rigid': must be 'compliant' where there is a profile"),
    (ROLLERS, "slope__length_m", of("uniform", low=45, high=55), "slope.length_m: must be certain, a number alone"),
    (ROLLERS, "slope__bumps", BUMPS, "slope.bumps.face_m"),
    (ROLLERS, "slope__profile_file", "none.csv", "slope.profile_file = '"),
    (ROLLERS, "zone", {"friction": UNIFORM}, "zone: the scenario has no zones"),
    (HILL, "terrain", point(2, 9, 12, "soil"), "point 3: x_m = 9: must be > 10 m, that of point 2; put the points"),
    (HILL, "terrain", point(1, 1, 30, "rock"), "the piece from point 1 to here is -84.3 degrees steep: must be at mo"),
    (HILL, "terrain", point(0, 1, 40, "rock"), "x_m = 1: must be 0"),
    (HILL, "terrain", point(3, 60, "6", "soil"), "point 4 is [60, '6', 'soil']: must be a number"),
    (HILL, "terrain", point(1, 10, 34, ""), "material is empty: must name that of the piece that begins"),
    (HILL, "terrain", point(1, 10, 34, True), "point 2 is [10, 34, True]: must be [x_m, z_m, material]"),
    (HILL, "terrain", point(1, 10, 34, "ice"), "materials = rock, soil: must be rock, ice, soil, those of terrain"),
    (HILL, "terrain__steepest_deg", 85, "terrain.steepest_deg = 85: must be a number in (0, 80]"),
    (HILL, "solver", "rigid", "solver = 'rigid': must be 'compliant' where there is a profile"),
    (HILL, "contact", {"friction": 0.1}, "contact: cannot be given beside terrain"),
    (HILL, "start_m", of("uniform", low=1, high=200), "start_m: uniform, low 1, high 200: a share of 0.5"),
    (HILL, "stations_m", [3, 50], "stations_m = [3.0, 50.0]: must rise, from 4 m on"),
    (HILL, "materials__soil", {}, "materials.soil.restitution: missing"),
    (HILL, "materials", {"8": {}, 8: {}}, "repeated key '8'"),
]


@pytest.mark.parametrize(("base", "key", "value", "words"), REFUSED)
def test_a_wrong_study_is_refused_by_name_of_the_key(
    base: dict[str, Any], key: str, value: Any, words: str, tmp_path: Path
) -> None:
    """Oracle: the words of each error, which begin with the file."""
    (tmp_path / "one.yaml").write_text(yaml.safe_dump(mapping(base, **{key: value}), sort_keys=False))
    with pytest.raises(StudyError, match=r"one\.yaml: ") as error:
        load_study(tmp_path / "one.yaml")
    assert words in str(error.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x_m,z_m,material\n0,40,rock\n3,high,rock\n", "hill.csv: line 3: z_m = 'high'"),
        ("x_m,height\n0,40\n", "hill.csv: line 1: must name the columns"),
        ("#\nx_m,z_m,material\n0,40,rock\n3,38,\n5,37,soil\n", "hill.csv: line 4: material is empty: must name that"),
        ('x_m,z_m,material\n0,40,"rock\n3,38,rock"\n5,37,soil\n', "hill.csv: line 2 = '0,40,\"rock': a quotation mark"),
        ("x_m,y_m\n0,40\n3,38\n", "hill.csv: its first line must name the columns x_m, z_m, material"),
    ],
)
def test_a_wrong_table_of_a_section_is_refused_by_its_line(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "hill.csv").write_text(text)
    with pytest.raises(ValueError, match="line") as error:
        read_section(tmp_path / "hill.csv")
    assert words in str(error.value)


def test_ranges_of_a_scenario_are_not_drawn_from_unasked() -> None:
    """Oracle: bowl_snow has ranges of slope, friction, restitution, speed, drop, orientation and spin."""
    content = {"id": "one", "title": "One", "scenario": own_scenario("bowl_snow"), "launch": {"speed_m_s": UNIFORM}}
    with pytest.raises(StudyError) as error:
        made(content)
    lines = str(error.value).splitlines()
    assert [line.split(": ")[1] for line in lines] == [
        *("slope.angle_deg", "contact.friction", "contact.restitution", "launch.drop_m", "launch.orientation_deg"),
        "launch.spin_rad_s",
    ]


def test_draws_that_are_no_body_are_counted() -> None:
    """Oracle: the mass centre is above the chord in the lower half of the range, a quarter of the draws."""
    study = made(PUSH, body__eccentricity_m=of("triangular", low=0.6, mode=1.0, high=1.0))
    with pytest.raises(StudyError, match=r"a share of 0\.25 of all draws is no body, such as .*eccentricity_m = 0\.7"):
        study.check_bodies(study.values(np.full((4, 4), [[0.1], [0.7], [0.8], [0.9]])))
