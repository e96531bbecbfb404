"""Studies of hillsides: terrain, rocks, what is told by place, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml

import sledenv
from sledenv import Settings
from sledenv.command.cli import main
from sledenv.machine.files import replacing
from sledenv.scenarios.bodies import RockBody
from sledenv.scenarios.configuration import write_yaml
from sledenv.simulation.checks import checked_scenes
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.records import FINISH, MOST_ZONES, STATUS_OF_CODE
from sledenv.simulation.support import resting_heights, within_a_turn
from sledenv.uncertainty import Study, StudyError, load_study, run, summary
from sledenv.uncertainty.descents import follow
from sledenv.uncertainty.figures import plot_envelopes
from sledenv.uncertainty.passages import descend_over
from sledenv.uncertainty.terrain import read_section
from tests.uncertainty.make import batch_of, lane_of

UNIFORM = {"kind": "uniform", "low": 0.3, "high": 0.5}
SECTION: list[list[Any]] = [[0, 40, "rock"], [10, 34, "rock"], [40, 12, "soil"], [60, 6, "soil"], [100, 4, "soil"]]
HILL: dict[str, Any] = {
    "id": "hill",
    "title": "A hill",
    "terrain": {"section": SECTION},
    "materials": {
        "rock": {"restitution": 0.4, "friction": UNIFORM, "rolling_arm_m": 0.01, "stiffness_n_m": 2e7},
        "soil": {"restitution": 0.3, "friction": 0.6, "rolling_arm_m": 0.08, "stiffness_n_m": 1e7},
    },
    "start_m": {"kind": "uniform", "low": 1, "high": 4},
    "heights_m": [0.5, 1],
    "body": {"kind": "rock", "length_m": {"kind": "uniform", "low": 0.4, "high": 0.8}, "shape": 0.7},
    "launch": {"speed_m_s": 1, "drop_m": 0.2, "orientation_deg": {"kind": "uniform", "low": -180, "high": 180}},
    "limits": {"max_time_s": 100, "max_rebounds": 500},
    "stations_m": [10, 25, 40, 55, 70, 85, 100],
    "launches": 200,
}


def hill(**changes: Any) -> Study:
    return Study.model_validate(HILL | changes)


def test_passages_are_those_of_descents_that_end_there() -> None:
    """Oracle: each descent simulated anew on a slope that ends at the place, in flight and in contact, bit by bit."""
    study = hill()
    scenes = study.scenes(study.values(run.draws(study)))
    settings = study.base.settings()
    found = descend_over(scenes, study.stations, settings)
    (ground,) = {lane_of(scenes, lane).slope.profile for lane in range(len(scenes.rows))}
    swung = flown = touched = 0
    for k, x in enumerate(study.stations[1:], 1):
        there = follow(scenes, np.full(len(scenes.rows), x), False, settings.limits)
        comes = there["status"] == FINISH
        assert np.isnan(found.speed[~comes, k]).all()
        both = comes & ~np.isnan(found.speed[:, k])
        lowest = there["y"] - scenes.resting_heights(there["x"], within_a_turn(there["phi"]))
        centre = there["y"] - np.interp(there["x"], *np.transpose(ground))
        for one, oracle in (
            (found.speed, np.hypot(there["u"], there["v"])),
            (found.kinetic, there["kinetic"]),
            (found.bounce, np.maximum(lowest, 0.0)),
            (found.centre, centre),
        ):
            same = np.isclose(one[both, k], oracle[both], rtol=1e-7, atol=1e-7)
            swung += np.count_nonzero(~same)
        swung += np.count_nonzero(comes & ~both)
        flown += np.count_nonzero(lowest[both] > 0.0)
        touched += np.count_nonzero(lowest[both] < 0.0)
    assert swung <= 8  # over a place and back in one contact
    assert flown > 500
    assert touched > 50


def test_passages_in_thin_air_are_those_without() -> None:
    """Oracle: the flights that closed forms tell; a rock that feels next to nothing comes to the same places."""
    study = hill()
    scenes = study.scenes(study.values(run.draws(study)[:60]))
    thin = scenes._replace(bodies=scenes.bodies.copy())
    thin.bodies["drag_area"] = 1e-8
    settings = study.base.settings()
    found, others = (descend_over(one, study.stations, settings) for one in (scenes, thin))
    assert (others.outcomes["drag"] > 0.0).all()
    assert (found.left_backwards == others.left_backwards).all()
    for name in ("speed", "kinetic", "bounce", "centre"):
        one, other = getattr(found, name)[:, :4], getattr(others, name)[:, :4]  # later, differences have grown
        assert (np.isnan(one) == np.isnan(other)).all()
        assert np.nanmedian(np.abs(one - other)) < 1e-3


def test_whole_descents_are_those_of_a_plain_batch() -> None:
    """Oracle: simulate_batch, bit for bit, on a ground that is level where it ends."""
    study = hill(terrain={"section": [*SECTION, [120, 4, "soil"]]})
    scenes = study.scenes(study.values(run.draws(study)[:60]))
    outcomes = descend_over(scenes, study.stations, study.base.settings()).outcomes
    assert outcomes.tobytes() == sledenv.simulate_batch(*batch_of(scenes), study.base.settings()).outcomes.tobytes()


def test_draws_of_a_hillside_go_where_their_keys_say() -> None:
    """Oracle: the law of the longest material, the columns of zones, the place of the start, the clearance there."""
    study = hill()
    values = study.values(np.full((2, len(study.parameters)), 0.5))
    scenes = study.scenes(values)
    for lane in range(2):
        law, slope, launch = lane_of(scenes, lane)
        (first,) = slope.zones
        assert first == pytest.approx([-100.0, 40.0, 0.4, 0.01, 0.01, 0.4, 2e7])
        assert (law.friction, law.rolling_arm, law.corner_rolling_arm) == pytest.approx((0.6, 0.08, 0.08))
        assert (law.restitution, law.stiffness) == pytest.approx((0.3, 1e7))
        ground = Grounds.of((slope.vertices,))
        place, phi = np.array([launch.x]), np.array([launch.phi])
        lowest = resting_heights(scenes.bodies[scenes.body[lane : lane + 1]], place, phi, ground)
        assert (launch.x, launch.y - lowest[0]) == pytest.approx((2.5, 0.2))


def test_a_rock_has_the_mass_of_its_ellipsoid() -> None:
    """Oracle: density pi a b c / 6 and m (a^2 + b^2) / 20 of the axes, of a rock of many points."""
    rock = RockBody(kind="rock", length_m=1.0, width_ratio=0.7, depth_ratio=0.6, points=12, rounding=0.6)
    body = rock.build()
    assert body.mass == pytest.approx(2700.0 * math.pi / 6.0 * 0.7 * 0.6, rel=0.05)
    assert body.inertia == pytest.approx(body.mass * (1.0 + 0.49) / 20.0, rel=0.08)
    assert 0.45 < body.size < 0.55
    other = rock.model_copy(update={"shape": 0.1}).build()
    assert other != body
    assert rock.build() == body


def test_a_hillside_is_a_study_like_others(tmp_path: Path) -> None:
    """Oracle: the launches, counted; the file it was read from, with the points of its section in it."""
    file, table = tmp_path / "hill.yaml", tmp_path / "hill.csv"
    lines = [f"{x},{z},{material}" for x, z, material in SECTION]
    table.write_text("\n".join(["x_m,z_m,material", *lines]) + "\n")
    file.write_text(yaml.safe_dump(HILL | {"terrain": {"section": "hill.csv"}}))
    result = sledenv.study(file, tmp_path / "out", workers=1, progress=False)
    assert result.study.key == hill().key
    assert load_study(tmp_path / "out" / "study.yaml").key == hill().key
    launches = result.read()
    row = result.envelopes.set_index("x_m").loc[55.0]
    k = 1 + HILL["stations_m"].index(55)
    passing = launches[launches[f"speed_m_s_{k}"].notna()]
    assert row["moving"] == pytest.approx(len(passing) / len(launches))
    assert row["bounce_m_most"] == passing[f"bounce_m_{k}"].max()
    assert row["centre_m_q95"] == np.quantile(passing[f"centre_m_{k}"], 0.95)
    assert row["over_0.5_m"] == pytest.approx((launches[f"bounce_m_{k}"] > 0.5).mean())
    assert launches["status"].isin(list(map(str, STATUS_OF_CODE))).all()
    assert result.shares["share"].sum() == pytest.approx(1.0)
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "out" / "envelopes.csv"), result.envelopes)
    assert max(map(len, result.words.splitlines())) <= 120
    assert "over_1_m" in (tmp_path / "out" / "study.html").read_text()


def test_what_is_given_up_is_told_and_not_left_out(tmp_path: Path) -> None:
    """Oracle: a limit of three rebounds, which every rock meets."""
    study = hill(limits={"max_time_s": 100, "max_rebounds": 3}, launches=12)
    result = sledenv.study(study, tmp_path / "out", workers=1, progress=False)
    assert result.shares.set_index("status").loc["log_full", "share"] == 1.0
    assert result.envelopes["other"].iloc[-1] == 1.0


def test_intervals_of_run_out_cover_the_truth() -> None:
    """Oracle: quantiles of a uniform distribution, 400 experiments."""
    rng, covered = np.random.default_rng(1), np.zeros(8)
    for _ in range(400):
        table = summary.stops(pd.Series(rng.random(300)), 1).iloc[:-1]
        covered += (table["low_m"] <= table["share"]) & (table["share"] <= table["high_m"])
    assert (covered / 400 > 0.92).all()
    assert (covered / 400 < 0.995).all()


def with_point(k: int, point: list[Any]) -> dict[str, Any]:
    return {"section": [*SECTION[:k], point, *SECTION[k + 1 :]]}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"terrain": with_point(2, [9, 12, "soil"])},
            "point 3: x_m = 9: must be > 10 m, that of point 2; put the points",
        ),
        (
            {"terrain": with_point(1, [1, 30, "rock"])},
            "the piece from point 1 to here is -84.3 degrees steep: must be at most 80 ",
        ),
        ({"terrain": with_point(0, [1, 40, "rock"])}, "x_m = 1: must be 0"),
        ({"terrain": with_point(3, [60, "6", "soil"])}, "point 4 is [60, '6', 'soil']: must be a number"),
        ({"terrain": with_point(1, [10, 34, "ice"])}, "materials = rock, soil: must be rock, ice, soil, those of"),
        ({"solver": "rigid"}, "solver = 'rigid': must be 'compliant' on a terrain"),
        ({"contact": {"friction": 0.1}, "slope": {"angle_deg": 3}}, "contact, slope.angle_deg: cannot be given beside"),
        ({"terrain": None}, "materials: goes with terrain, and there is none"),
        ({"start_m": {"kind": "uniform", "low": 1, "high": 200}}, "start_m: uniform, low 1, high 200: a share of 0.5"),
        ({"stations_m": [3, 50]}, "stations_m = [3.0, 50.0]: must rise, from 4 m on"),
        ({"materials": HILL["materials"] | {"soil": {}}}, "materials.soil.restitution: missing"),
        ({"materials": {"8": {}, 8: {}}}, "must hold each name once, as a number or as text"),
        (
            {"terrain": with_point(1, [10, 34, ""])},
            "point 2: material is empty: must name that of the piece that begins",
        ),
        ({"terrain": with_point(1, [10, 34, True])}, "point 2 is [10, 34, True]: must be [x_m, z_m, material]"),
        (
            {"terrain": {"section": SECTION, "steepest_deg": 85}},
            "terrain.steepest_deg = 85: must be a number in (0, 80]",
        ),
    ],
)
def test_a_wrong_hillside_is_refused_by_name_of_the_key(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(StudyError) as error:
        hill(**changes)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x_m,z_m,material\n0,40,rock\n3,high,rock\n", "hill.csv: line 3: z_m = 'high'"),
        ("x_m,height\n0,40\n", "hill.csv: line 1: must name the columns"),
        ("#\nx_m,z_m,material\n0,40,rock\n3,38,\n5,37,soil\n", "hill.csv: line 4: material is empty: must name that"),
        ('x_m,z_m,material\n0,40,"rock\n3,38,rock"\n5,37,soil\n', "hill.csv: line 2 = '0,40,\"rock': a quotation mark"),
        ("x_m,y_m\n0,40\n3,38\n", "hill.csv: its first line must name the columns x_m, z_m, material"),
    ],
)
def test_a_wrong_table_is_refused_by_its_line(text: str, message: str, tmp_path: Path) -> None:
    with replacing(tmp_path / "hill.csv", ".csv") as part:
        part.write_text(text)
    with pytest.raises(ValueError, match="line") as error:
        read_section(tmp_path / "hill.csv")
    assert message in str(error.value)


def test_a_start_behind_no_station_needs_no_rebound() -> None:
    """Oracle: at the first station all are told where they begin."""
    study = hill(start_m=2.0, launches=10)
    scenes = study.scenes(study.values(run.draws(study)))
    found = descend_over(scenes, study.stations, Settings(max_time=1e-3))
    assert found.speed[:, 0] == pytest.approx(1.0)
    assert found.bounce is not None
    assert found.bounce[:, 0] == pytest.approx(0.2)
    assert np.isnan(found.speed[:, 1:]).all()


def test_what_is_drawn_of_the_commonest_material_is_that_of_the_law() -> None:
    """Oracle: the parameters of each launch."""
    drawn = dict.fromkeys(("restitution", "friction", "rolling_arm_m"), UNIFORM)
    soil = drawn | {"stiffness_n_m": {"kind": "uniform", "low": 1e7, "high": 2e7}}
    study = hill(materials=HILL["materials"] | {"soil": soil})
    values = study.values(run.draws(study)[:20])
    scenes = study.scenes(values)
    found = dict(zip(study.parameters, values.T, strict=True))
    rows = scenes.rows
    np.testing.assert_array_equal(rows["friction"], found["materials.soil.friction"])
    for arm in ("rolling_arm", "corner_rolling_arm"):
        np.testing.assert_array_equal(rows[arm], found["materials.soil.rolling_arm_m"])
    np.testing.assert_array_equal(rows["stiffness"], found["materials.soil.stiffness_n_m"])
    asymmetry = rows["asymmetry"]
    np.testing.assert_allclose(((1 - asymmetry) / (1 + asymmetry)) ** 0.5, found["materials.soil.restitution"])
    np.testing.assert_array_equal(scenes.zones[:, 2], found["materials.rock.friction"])


def test_as_many_runs_fit_as_there_are_zones_beside_the_commonest() -> None:
    """Oracle: runs counted by hand; every second one is of the commonest material."""

    def striped(runs: int) -> Study:
        names = ["soil" if k % 2 else "rock" for k in range(runs)]
        return hill(
            terrain={"section": [[6 * k, 40 - k, names[min(k, runs - 1)]] for k in range(runs + 1)]}, stations_m=[6]
        )

    study = striped(2 * MOST_ZONES + 1)
    assert study.terrain is not None
    assert study.terrain.commonest == "rock"
    _, slope, _ = lane_of(study.scenes(study.values(run.draws(study)[:1])), 0)
    expected = [(12.0 * k + 6.0, 12.0 * k + 12.0, 0.6) for k in range(MOST_ZONES)]
    assert [(zone.begin, zone.end, zone.friction) for zone in slope.zones] == expected
    with pytest.raises(StudyError, match=f"make {MOST_ZONES + 1} runs beside those of the commonest, rock: must be at"):
        striped(2 * MOST_ZONES + 3)


@pytest.mark.parametrize("names", [(8, 3), ("no", "1e3"), ("gravel, loose", "a.b"), ("8.5", "yes")])
def test_a_material_may_have_any_name(names: tuple[Any, Any], tmp_path: Path) -> None:
    """Oracle: the study with plain names, up to them; names out of a file are as those in Python."""
    rows = [f'{x},{z},"{names[material == "soil"]}"' for x, z, material in SECTION]
    (tmp_path / "hill.csv").write_text("\n".join(["x_m,z_m,material", *rows]))
    text = yaml.safe_dump(HILL | {"terrain": {"section": "hill.csv"}, "materials": "HERE"}, sort_keys=False)
    lines = [yaml.safe_dump(one, default_flow_style=True).strip() for one in HILL["materials"].values()]
    keys = [f"'{name}'" if "," in str(name) else name for name in names]
    materials = "".join(f"\n  {key}: {line}" for key, line in zip(keys, lines, strict=True))
    (tmp_path / "hill.yaml").write_text(text.replace("HERE", materials))
    found = load_study(tmp_path / "hill.yaml")
    assert found.materials.keys() == {str(name) for name in names}
    values = found.values(run.draws(found)[:12])
    assert found.scenes(values).table.tobytes() == hill().scenes(values).table.tobytes()
    assert found.scenes(values).zones.tobytes() == hill().scenes(values).zones.tobytes()
    if isinstance(names[0], int):
        section = [[x, z, names[material == "soil"]] for x, z, material in SECTION]
        both = dict(zip(names, HILL["materials"].values(), strict=True))
        assert hill(terrain={"section": section}, materials=both).key == found.key


STEEP = """# a face, an overhang and a vertical toe, as they are surveyed
x_m,z_m,material
0,60.5,8
6,58,8
9,51,3
8.6,49,3
8.8,47.5,3
12,44,8
12,41,5
40,30,5
90,26,5
"""


def test_a_section_as_it_is_surveyed_becomes_a_study_with_one_key(tmp_path: Path) -> None:
    """Oracle: elevations and materials by hand; (8.8, 47.5) is 0.817 m behind the face from (9, 51), along x."""
    (tmp_path / "steep.csv").write_text(STEEP)
    one = {"restitution": 0.35, "friction": UNIFORM, "rolling_arm_m": 0.01, "stiffness_n_m": 2e7}
    content = HILL | {"materials": {8: one, 3: one, 5: one}, "stations_m": [10, 20, 40, 60]}
    file = tmp_path / "steep.yaml"
    write_yaml(file, content | {"terrain": {"section": "steep.csv"}})
    with pytest.raises(StudyError, match=r"line 6: x_m = 8.6: must be > 9 m, .*; terrain\.steepest_deg, say 80, fills"):
        load_study(file)
    write_yaml(file, content | {"terrain": {"section": "steep.csv", "steepest_deg": 80}})
    with pytest.warns(
        UserWarning, match=r"^terrain.steepest_deg: 3 of 9 points are under what was filled up, 0.805 m from"
    ):
        study = load_study(file)
    assert study.terrain is not None
    places = study.terrain.section
    assert [place.z for place in places if place.x in (0.0, 6.0, 9.0, 12.0, 40.0)] == [60.5, 58.0, 51.0, 44.0, 30.0]
    assert max(place.z for place in places) == 60.5
    assert [run.material for run in study.terrain.runs] == ["8", "3", "8", "5"]
    result = sledenv.study(study, tmp_path / "out", launches=24, workers=1, progress=False)
    assert load_study(tmp_path / "out" / "study.yaml").key == result.study.key == study.key


@pytest.mark.filterwarnings("default")
def test_the_command_says_what_was_filled_up_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: what Python warns of."""
    (tmp_path / "steep.csv").write_text(STEEP)
    one = HILL["materials"]["rock"]
    content = HILL | {"materials": {8: one, 3: one, 5: one}, "stations_m": [60], "launches": 1}
    write_yaml(tmp_path / "steep.yaml", content | {"terrain": {"section": "steep.csv", "steepest_deg": 80}})
    assert main(["study", str(tmp_path / "steep.yaml"), "--out", str(tmp_path / "out"), "--workers", "1"]) == 0
    told = [line for line in capsys.readouterr().err.splitlines() if "steepest" in line]
    said = "3 of 9 points are under what was filled up, 0.805 m from the ground at most"
    assert told == [f"sledenv study: warning: terrain.steepest_deg: {said}"]


def test_rocks_that_roll_back_over_the_start_are_a_share_of_their_own(tmp_path: Path) -> None:
    """Oracle: descents followed by themselves; a ground that rises to 20 m, in front of which all start."""
    section = [[0, 510, "rock"], [20, 516, "rock"], [25, 516, "soil"], [60, 500, "soil"]]
    start = {"kind": "uniform", "low": 5, "high": 24}
    study = hill(
        terrain={"section": section}, start_m=start, launch=HILL["launch"] | {"speed_m_s": 0}, stations_m=[25, 60]
    )
    result = sledenv.study(study, tmp_path / "out", workers=1, progress=False)
    table = result.read()
    scenes = study.scenes(study.values(run.draws(study)))
    ends = follow(scenes, np.full(len(scenes.rows), 60.0), False, study.base.settings().limits)
    left = (ends["x"] < 0.0) & (ends["status"] != FINISH)
    assert 0.3 < left.mean() < 0.9
    np.testing.assert_array_equal(table["status"] == "left_backwards", left)
    np.testing.assert_array_equal(table["stop_m"], np.where(left, 0.0, ends["x"]))
    shares = result.shares.set_index("status")["share"]
    assert shares["left_backwards"] == pytest.approx(left.mean())
    assert shares["jammed"] + shares["finish"] == pytest.approx(1.0 - left.mean())
    last = result.envelopes.iloc[-1]
    assert last["left_backwards"] == pytest.approx(left.mean())
    assert last["other"] == 0.0
    assert last[["moving", "finished", "jammed", "left_backwards", "tumbled"]].sum() == pytest.approx(1.0)
    assert {"left_backwards", "jammed"} <= set(result.sobol["output"])


def test_who_has_left_backwards_comes_to_no_place_afterwards() -> None:
    """Oracle: a disc that spins backwards, by hand: behind the start it meets a wall in the ground and comes back."""
    ground = [(-6.0, 4.0), (-2.0, 0.0), (0.0, 0.0), (30.0, -1.0)]
    slope = sledenv.Slope(0.0, 30.0, profile=ground)
    law = sledenv.ContactLaw.from_restitution(0.6, stiffness=1e7, friction=0.1, rolling_arm=0.0)
    launches = [sledenv.State(3.0, 0.6, 0.0, speed) for speed in (-6.0, 6.0)]
    settings = Settings(max_time=60.0)
    scenes = checked_scenes(sledenv.disc(50.0, 0.3), law, slope, launches, settings)
    assert (follow(scenes, np.array([30.0, 30.0]), False, settings.limits)["status"] == FINISH).all()
    found = descend_over(scenes, np.array([3.0, 5.0, 30.0]), settings)
    assert found.left_backwards is not None
    assert found.left_backwards.tolist() == [True, False]
    assert np.isnan(found.speed).tolist() == [[False, True, True], [False, False, False]]


def test_elevations_of_a_study_are_those_of_its_section(tmp_path: Path) -> None:
    """Oracle: the section, and what the figure draws and says of it."""
    section = [[x, z + 1200.0, material] for x, z, material in SECTION]
    result = sledenv.study(hill(terrain={"section": section}, launches=12), tmp_path / "out", workers=1, progress=False)
    expected = np.interp(result.envelopes["x_m"], [row[0] for row in section], [row[1] for row in section])
    np.testing.assert_allclose(result.envelopes["z_m"], expected)
    assert "1234" in next(line for line in result.words.splitlines() if line.startswith("  10 "))
    figure = plot_envelopes(result)
    ax = figure.axes[0]
    assert ax.lines[0].get_ydata()[0] == 1240.0
    figure.draw_without_rendering()
    (left, bottom), (right, top) = ax.transData.transform([(0.0, 1204.0), (10.0, 1214.0)])
    assert ax.get_ylabel() == f"elevation [m]\nvertical exaggeration {(top - bottom) / (right - left):.2g}"


def test_a_section_may_be_told_by_few_pieces_and_arcs() -> None:
    """Oracle: the points themselves, from which the ground is at most as far as it may be; materials stay in place."""
    x = np.linspace(0.0, 100.0, 201)
    z = 40.0 - 0.3 * x + np.sin(x / 9.0)
    points = [[a, b, "rock" if a < 50.0 else "soil"] for a, b in zip(x.tolist(), z.tolist(), strict=True)]
    study = hill(terrain={"section": points, "tolerance_m": 0.02}, stations_m=[20, 60, 100])
    scenes = study.scenes(study.values(run.draws(study)[:4]))
    slope = lane_of(scenes, 0).slope
    assert len(slope.profile) < 30
    assert (np.array(slope.rounding) > 0.0).any()
    assert np.abs(slope.height_at(x) - (z - z[-1])).max() <= 0.0201
    corners = hill(terrain={"section": points}, stations_m=[20, 60, 100])
    assert len(lane_of(corners.scenes(corners.values(run.draws(corners)[:4])), 0).slope.profile) == 201
    assert [zone.begin for zone in slope.zones] == [
        zone.begin for zone in lane_of(corners.scenes(corners.values(run.draws(corners)[:4])), 0).slope.zones
    ]
    assert study.key != corners.key


def _sleds(start: float, orientation: float, friction: float) -> Study:
    """Long bodies that feel the air, on level ground."""
    body = {"kind": "polygon", "mass_kg": 100, "points_m": [[-0.9, 0], [0.9, 0], [0.9, 0.3], [-0.9, 0.3]]}
    ice = {"restitution": 0.2, "friction": friction, "rolling_arm_m": 0.001, "stiffness_n_m": 1e6}
    return hill(
        terrain={"section": [[0, 2, "ice"], [100, 1, "ice"]]},
        materials={"ice": ice},
        body=body | {"rounding_m": 0.01, "drag_area_m2": 0.08},
        launch={"speed_m_s": {"kind": "uniform", "low": 2, "high": 4}, "drop_m": 0.1, "orientation_deg": orientation},
        start_m=start,
        stations_m=[0.5, 1, 1.5, 2, 3, 5, 10],
    )


def test_a_long_body_in_air_that_starts_at_the_begin_of_a_section_has_not_left_it() -> None:
    """Oracle: its outcome; its tail touches behind the first point, its mass centre never is there."""
    study = _sleds(0.0, 10.0, 0.001)
    scenes = study.scenes(study.values(run.draws(study)[:20]))
    found = descend_over(scenes, study.stations, study.base.settings())
    assert (found.outcomes["status"] == FINISH).all()
    assert not found.left_backwards.any()
    assert np.isfinite(found.speed).all()


@pytest.mark.parametrize("orientation", [-20.0, -45.0])
def test_no_passage_is_told_of_a_place_behind_where_a_body_in_air_stops(orientation: float) -> None:
    """Oracle: where its mass centre ends; the nose touches the ground far ahead of it."""
    study = _sleds(0.0, orientation, 0.8)
    scenes = study.scenes(study.values(run.draws(study)[:20]))
    found = descend_over(scenes, study.stations, study.base.settings())
    told = np.where(np.isfinite(found.speed), study.stations, -np.inf).max(axis=1)
    assert (told < 10.0).all()
    assert (told <= found.outcomes["x"] + 0.5).all()  # a body that rocks may have come a little further


def test_a_section_may_be_of_many_materials(tmp_path: Path) -> None:
    """They share colours, and the picture is drawn."""
    points = [[10.0 * k, 120.0 - 5.0 * k, f"m{k % 12}"] for k in range(24)]
    ground = {"restitution": 0.3, "friction": 0.5, "rolling_arm_m": 0.01, "stiffness_n_m": 1e6}
    study = hill(terrain={"section": points}, materials={f"m{k}": ground for k in range(12)}, launches=40)
    found = sledenv.study(study, tmp_path / "out")
    assert (tmp_path / "out" / "envelopes.png").is_file()
    assert found.words
