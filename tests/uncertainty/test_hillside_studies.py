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
from sledenv.scenarios.bodies import RockBody
from sledenv.scenarios.configuration import write_yaml
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.records import FINISH, MOST_ZONES, STATUS_OF_CODE
from sledenv.simulation.support import resting_heights, within_a_turn
from sledenv.uncertainty import Study, StudyError, load_study, summary
from sledenv.uncertainty.descents import descend_over, follow
from sledenv.uncertainty.figures import plot_envelopes
from tests.uncertainty.make import HILL, SECTION, UNIFORM, batch_of, drawn, lane_of


def hill(**changes: Any) -> Study:
    return Study.model_validate(HILL | changes)


def test_passages_are_those_of_descents_that_end_there() -> None:
    """Oracle: each descent simulated anew on a slope that ends at the place, in flight and in contact, bit by bit."""
    study = hill()
    scenes = drawn(study)
    settings = study.base.settings()
    found = descend_over(scenes, study.stations, settings)
    speeds = found.columns["speed_m_s"]
    (ground,) = {lane_of(scenes, lane).slope.profile for lane in range(len(scenes.rows))}
    swung = flown = touched = 0
    for k, x in enumerate(study.stations[1:], 1):
        there = follow(scenes, np.full(len(scenes.rows), x), False, settings.limits)
        comes = there["status"] == FINISH
        assert np.isnan(speeds[~comes, k]).all()
        both = comes & ~np.isnan(speeds[:, k])
        lowest = there["y"] - scenes.resting_heights(there["x"], within_a_turn(there["phi"]))
        centre = there["y"] - np.interp(there["x"], *np.transpose(ground))
        oracle = np.column_stack([np.hypot(there["u"], there["v"]), there["kinetic"], np.maximum(lowest, 0.0), centre])
        swung += np.count_nonzero(~np.isclose(found.seen[both, k], oracle[both], rtol=1e-7, atol=1e-7))
        swung += np.count_nonzero(comes & ~both)
        flown += np.count_nonzero(lowest[both] > 0.0)
        touched += np.count_nonzero(lowest[both] < 0.0)
    assert swung <= 8  # over a place and back in one contact
    assert flown > 500
    assert touched > 50


def test_whole_descents_are_those_of_a_plain_batch() -> None:
    """Oracle: simulate_batch, bit for bit, on a ground that is level where it ends."""
    study = hill(terrain={"section": [*SECTION, [120, 4, "soil"]]})
    scenes = drawn(study, 60)
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


def test_intervals_of_run_out_cover_the_truth() -> None:
    """Oracle: quantiles of a uniform distribution, 400 experiments."""
    rng, covered = np.random.default_rng(1), np.zeros(8)
    for _ in range(400):
        table = summary.stops(pd.Series(rng.random(300)), 1).iloc[:-1]
        covered += (table["low_m"] <= table["share"]) & (table["share"] <= table["high_m"])
    assert (covered / 400 > 0.92).all()
    assert (covered / 400 < 0.995).all()


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
    _, slope, _ = lane_of(drawn(study, 1), 0)
    expected = [(12.0 * k + 6.0, 12.0 * k + 12.0, 0.6) for k in range(MOST_ZONES)]
    assert [(zone.begin, zone.end, zone.friction) for zone in slope.zones] == expected
    with pytest.raises(StudyError, match=f"make {MOST_ZONES + 1} runs beside those of the commonest, rock: must be at"):
        striped(2 * MOST_ZONES + 3)


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


def test_rocks_that_roll_back_over_the_start_are_a_share_of_their_own(tmp_path: Path) -> None:
    """Oracle: descents followed by themselves; a ground that rises to 20 m, in front of which all start."""
    section = [[0, 510, "rock"], [20, 516, "rock"], [25, 516, "soil"], [60, 500, "soil"]]
    start = {"kind": "uniform", "low": 5, "high": 24}
    study = hill(
        terrain={"section": section}, start_m=start, launch=HILL["launch"] | {"speed_m_s": 0}, stations_m=[25, 60]
    )
    result = sledenv.study(study, tmp_path / "out", workers=1, progress=False)
    table = result.read()
    scenes = drawn(study)
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


def test_elevations_of_a_study_are_those_of_its_section(tmp_path: Path) -> None:
    """Oracle: the section, and what the figure draws and says of it."""
    section = [[x, z + 1200.0, material] for x, z, material in SECTION]
    result = sledenv.study(hill(terrain={"section": section}, launches=12), tmp_path / "out", workers=1, progress=False)
    expected = np.interp(result.envelopes["x_m"], [row[0] for row in section], [row[1] for row in section])
    np.testing.assert_allclose(result.envelopes["z_m"], expected)
    assert "1234" in next(line for line in result.words.splitlines() if line.startswith("10.0 "))
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
    scenes = drawn(study, 4)
    slope = lane_of(scenes, 0).slope
    assert len(slope.profile) < 30
    assert (np.array(slope.rounding) > 0.0).any()
    assert np.abs(slope.height_at(x) - (z - z[-1])).max() <= 0.0201
    corners = hill(terrain={"section": points}, stations_m=[20, 60, 100])
    assert len(lane_of(drawn(corners, 4), 0).slope.profile) == 201
    assert [zone.begin for zone in slope.zones] == [zone.begin for zone in lane_of(drawn(corners, 4), 0).slope.zones]
    assert study.key != corners.key


@pytest.mark.parametrize(("orientation", "friction"), [(10.0, 0.001), (-20.0, 0.8), (-45.0, 0.8)])
def test_a_long_body_in_air_comes_as_far_as_its_mass_centre_does(orientation: float, friction: float) -> None:
    """Oracle: its outcome; the tail touches behind the first point, where it starts, the nose far ahead of its end."""
    body = {"kind": "polygon", "mass_kg": 100, "points_m": [[-0.9, 0], [0.9, 0], [0.9, 0.3], [-0.9, 0.3]]}
    ice = {"restitution": 0.2, "friction": friction, "rolling_arm_m": 0.001, "stiffness_n_m": 1e6}
    study = hill(
        terrain={"section": [[0, 2, "ice"], [100, 1, "ice"]]},
        materials={"ice": ice},
        body=body | {"rounding_m": 0.01, "drag_area_m2": 0.08},
        launch={"speed_m_s": {"kind": "uniform", "low": 2, "high": 4}, "drop_m": 0.1, "orientation_deg": orientation},
        start_m=0.0,
        stations_m=[0.5, 1, 1.5, 2, 3, 5, 10],
    )
    found = descend_over(drawn(study, 20), study.stations, study.base.settings())
    comes = np.isfinite(found.columns["speed_m_s"])
    finishes = found.outcomes["status"] == FINISH
    assert finishes.all() if friction < 0.1 else not finishes.any()
    assert not found.left_backwards[finishes].any()
    assert comes[finishes].all()
    told = np.where(comes, study.stations, -np.inf).max(axis=1)
    assert (told <= found.outcomes["x"] + 0.5).all()  # a body that rocks may have come a little further
