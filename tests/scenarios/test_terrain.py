"""Files of ground: what is read, what is refused and in which line, and how far simplified ground is off."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from sledenv.scenarios.scenario import Scenario, ScenarioError, load_scenario
from sledenv.scenarios.terrain import read_ground
from sledenv.simulation.bends import MOST_VERTICES
from tests.own_scenarios import DELETE, changed

SECTION = "x_m,z_m\n0,77.1\n10,67.9\n20,59.6\n30,51.9\n40,44.8\n50,38.1\n60,33.4\n70,31.3\n80,30.5\n"


@pytest.fixture
def ground(tmp_path: Path) -> Any:
    """Return what makes a scenario from the text of a file that lies beside it."""

    def load(text: str, **changes: Any) -> Scenario:
        (tmp_path / "ground.csv").write_text(text, encoding="utf-8")
        content = changed(**{"slope__profile_file": "ground.csv"} | changes)
        (tmp_path / "one.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
        return load_scenario(tmp_path / "one.yaml")

    return load


def refusal(ground: Any, text: str, **changes: Any) -> str:
    with pytest.raises(ScenarioError) as caught:
        ground(text, **changes)
    (line,) = str(caught.value).splitlines()
    _, found, told = line.partition("ground.csv': ")
    return told if found else line.partition("one.yaml: ")[2]


def test_a_profile_lies_beside_its_scenario(ground: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the vertices in the scenario itself; columns in any order, comments, quotes."""
    same = Scenario.model_validate(changed(slope__profile_m=[[-0.5, 0], [1, 0.25], [2, 0]]))
    for text in (
        "x_m,y_m\n-0.5,0\n1,0.25\n2,0\n",
        "\ufeff# drawn by hand\n\ny_m, x_m\r\n0,-.5\r\n2.5e-1,1\r\n#0,1.5\r\n0,2\r\n\r\n",
        '"x_m","y_m"\n"-0.5","0"\n1,0.25\n2,-0.0',
    ):
        scenario = ground(text)
        assert scenario == same
        assert scenario.hash == same.hash
        assert Scenario.model_validate(scenario.model_dump()) == scenario
    monkeypatch.chdir(tmp_path)
    assert Scenario.model_validate(changed(slope__profile_file="ground.csv")) == same


def test_a_section_of_terrain_is_measured_over_its_own_plane(ground: Any) -> None:
    """Oracle: lengths and inclinations of the pieces of the file; both ends lie in the plane."""
    scenario = ground(SECTION, slope__angle_deg=DELETE, slope__length_m=DELETE)
    (angle, _) = scenario.slope_section.angle_deg
    assert angle == round(math.degrees(math.atan2(77.1 - 30.5, 80)), 6)
    vertices = np.array(scenario.slope_section.profile_m)
    np.testing.assert_allclose(vertices[[0, -1]], [(0.0, 0.0), (math.hypot(46.6, 80), 0.0)], atol=1e-6)
    assert scenario.slope_section.length_m == vertices[-1, 0] + 0.75
    terrain = np.genfromtxt(SECTION.splitlines(), delimiter=",", skip_header=1)
    (along, up), (there, down) = np.diff(vertices, axis=0).T, np.diff(terrain, axis=0).T
    np.testing.assert_allclose(np.hypot(along, up), np.hypot(there, down))
    np.testing.assert_allclose(np.arctan2(up, along) - math.radians(angle), np.arctan2(down, there))


def test_terrain_may_be_measured_over_another_plane(ground: Any) -> None:
    """Oracle: the level plane, over which heights are those of the file less that at x_m = 0."""
    text = "x_m,z_m\n-10,12\n10,8\n20,8.5\n"
    scenario = ground(text, slope__angle_deg=0, slope__length_m=DELETE)
    assert scenario.slope_section.profile_m == ((-10.0, 2.0), (10.0, -2.0), (20.0, -1.5))
    told = "slope.angle_deg = [6, 12]: must be one number with a section of terrain, the plane over which"
    assert told in refusal(ground, text, slope__angle_deg=[6, 12])
    assert refusal(ground, text, slope__angle_deg="steep").startswith("slope.angle_deg = 'steep': must be a number, or")


# Ground that is fitted by pieces and arcs.


def test_a_surveyed_ground_becomes_pieces_and_arcs_within_its_tolerance(ground: Any) -> None:
    """Oracle: the heights of the file; few vertices with radii that are those of the hill, and the finish on it."""
    x = np.linspace(-5.0, 60.0, 651)
    y = 0.5 * np.sin(x / 4.0)
    text = "x_m,y_m\n" + "\n".join(f"{a!r},{b!r}" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    scenario = ground(text, slope__tolerance_m=0.005, slope__length_m=47.5)
    slope = scenario.given(scenario.sample(np.random.default_rng(0))).slope
    assert len(slope.profile) < 60
    assert np.abs(slope.height_at(x) - y).max() <= 0.005
    assert np.median(slope.rounding) > 20.0  # the smallest of the hill is 32 m
    with pytest.warns(
        UserWarning, match=r"^Slope\.profile is cut too finely around x = .*, or slope\.tolerance_m in a sc"
    ):
        uncut = ground(text, slope__length_m=47.5)  # told once, where it is read
    assert scenario.hash != uncut.hash
    refused = refusal(ground, text, slope__rounding_m=1.0, slope__tolerance_m=0.005)
    assert "must be left out where there is slope.rounding_m" in refused


def test_too_many_vertices_are_refused_with_the_tolerance_as_a_remedy(tmp_path: Path) -> None:
    """Oracle: the message; fewer with a tolerance are fitted, and the deviation is told."""
    path = tmp_path / "long.csv"
    for count in (MOST_VERTICES + 1, 1000):
        x = np.linspace(0.0, 100.0, count)
        path.write_text("x_m,y_m\n" + "\n".join(f"{a!r},{math.sin(a)!r}" for a in x.tolist()))
        if count > MOST_VERTICES:
            told = f"holds {count} vertices: must hold at most {MOST_VERTICES}; slope.tolerance_m, say 0.01, "
            with pytest.raises(ValueError, match=told):
                read_ground(str(path))
    few = read_ground(str(path), tolerance=0.01)
    assert len(few.told) < 200
    assert 0.0 < few.deviation <= 0.01


def test_a_scenario_fills_up_what_is_too_steep_and_its_zones_stay_where_they_were(ground: Any) -> None:
    """Oracle: by hand, over the level plane: a vertical toe of 2 m, whose foot is moved by 2 m / tan 80 degrees."""
    text = "x_m,z_m,material\n0,5,rock\n10,4,face\n10,2,road\n20,2,grass\n40,1,\n"
    zones = [{"pieces": [2, 2], "friction": 0.5}, {"material": "grass", "friction": 0.8}]
    flat = {"slope__angle_deg": 0, "slope__length_m": DELETE}
    assert "line 4: x_m = 10: is a vertical step from z_m = 4 in line 3 to 2 m" in refusal(ground, text, **flat)
    with pytest.warns(
        UserWarning, match=r"^slope.steepest_deg: 1 of 5 points are under what was filled up, 0.347 m from"
    ):
        scenario = ground(text, **flat, slope__steepest_deg=80, zones=zones)
    foot = 10.0 + 2.0 / math.tan(math.radians(80.0))
    expected = [(0.0, 0.0), (10.0, -1.0), (foot, -3.0), (20.0, -3.0), (40.0, -4.0)]
    np.testing.assert_allclose(scenario.slope_section.profile_m, expected, atol=1e-6)
    found = [(zone.begin_m[0], zone.end_m) for zone in scenario.zones]
    np.testing.assert_allclose(found, [(foot, 20.0), (20.0, 40.0)], atol=1e-6)
    with pytest.warns(UserWarning, match="1 of 5 points"):
        told = refusal(ground, text, **flat, zones=[{"pieces": [4, 4], "friction": 1}], slope__steepest_deg=80)
    assert (
        told
        == "zones.0.pieces = [4, 4]: must be a pair [first, last] of whole numbers in [0, 3], pieces of the profile"
    )


# Materials.

ROCKY = "x_m,y_m,material\n-1,0,rock\n1,0.1,rock\n2,0,\n3,0.1,grass\n4,0,rock\n5,0.1,\n6,0,\n"


def test_materials_of_a_file_are_zones(ground: Any) -> None:
    """Oracle: the places by hand; runs of one material are one zone each, and the finish cuts what is behind it."""
    zones = [{"material": "rock", "friction": 0.5, "restitution": 0.3}, {"material": "grass", "friction": 0.8}]
    scenario = ground(ROCKY, zones=zones)
    found = [(zone.begin_m[0], zone.end_m, zone.friction[0], zone.restitution) for zone in scenario.zones]
    assert found == [(-1, 2, 0.5, 0.3), (3, 4, 0.8, None), (4, 5, 0.5, 0.3)]
    assert len(scenario.given(scenario.sample(np.random.default_rng(0))).slope.zones) == 3
    last = "x_m,y_m,material\n0,0.1,rock\n1,0,\n7,0,grass\n8,0,rock\n11,0.1,rock\n"
    found = [(zone.begin_m[0], zone.end_m) for zone in ground(last, slope__length_m=12, zones=zones).zones]
    assert found == [(0, 1), (7, 8), (8, None)]
    assert [zone.begin_m[0] for zone in ground(last, slope__length_m=7.2, zones=zones[:1]).zones] == [0]
    simpler = ground(ROCKY.replace("1,0.1,rock", "1,0.001,rock", 1), zones=zones, slope__tolerance_m=0.05)
    assert len(simpler.slope_section.profile_m) < 7
    assert [zone.begin_m[0] for zone in simpler.zones] == [-1, 3, 4]
    assert "zones.0.material = 'roc': must be one of grass, rock" in refusal(
        ground, ROCKY, zones=[{"material": "roc", "friction": 0.5}]
    )
    told = refusal(ground, "x_m,y_m\n0,0\n1,0.1\n2,0\n", zones=zones[:1])
    assert told == "zones.0.material = 'rock': must be left out: the profile has no column material"


def test_more_zones_than_there_may_be_are_told_and_numbers_name_materials(ground: Any) -> None:
    """Oracle: by hand; what YAML reads as a truth value is told."""
    rows = "x_m,y_m,material\n" + "".join(f"{x},{0.1 * (x % 2)},{8 if x % 2 else ''}\n" for x in range(140))
    told = refusal(ground, rows, zones=[{"material": 8, "friction": 1}], slope__length_m=141)
    assert told == (
        "zones: the materials make 70 zones, one behind the other: must be at most 64; let the commonest be that of "
        "the contact, without a zone, or join pieces"
    )
    told = refusal(ground, rows, zones=[{"material": False, "friction": 0.5}])
    assert told == "zones.0.material = False: must be one of 8"
