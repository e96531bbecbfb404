"""Studies of rides: ground over the plane of a slope, the same for all launches or drawn for each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import sledenv
from sledenv.command.cli import main
from sledenv.simulation.records import STATUS_OF_CODE
from sledenv.simulation.scenes import Scenes
from sledenv.uncertainty import Study, StudyError, load_study, run
from sledenv.uncertainty.descents import descend_past
from tests.uncertainty.make import ROLLERS, lane_of, made, mapping

UNIFORM = {"kind": "uniform", "low": 0.2, "high": 0.3}
PROFILE = [[3, 0], [6, 0.4], [7, 0.4], [9, 0], [12, 0], [15, 0.3], [18, 0]]
BUMPS = {"height_m": [0.2, 0.4], "face_m": [2, 3], "top_m": 0.5, "gap_m": [1, 2], "start_m": 3}


def scenes_of(study: Study, launches: int) -> Scenes:
    return study.scenes(study.values(run.draws(study)[:launches]))


def test_every_launch_rides_the_track_of_its_number() -> None:
    """Oracle: simulate on the slope that the scenario makes of a context with this number, bit for bit."""
    study = made(ROLLERS)
    values = study.values(run.draws(study))
    names, settings = list(study.parameters), study.base.settings()
    assert names == ["contact.friction", "launch.speed_m_s", "slope.bumps"]
    tracks = values[:, 2]
    assert (tracks == np.floor(tracks)).all()
    assert len(np.unique(tracks)) == len(values) // 5 * 2  # of a group of Saltelli's scheme
    scenes = study.scenes(values)
    found = descend_past(scenes, study.stations, settings, study.base.all_bodies())
    scenario = sledenv.load_scenario("sled_rollers")
    low, _ = study.base.ranges
    for i, row in enumerate(values.tolist()):
        given = dict(zip(names, row, strict=True))
        context = sledenv.Context(*low)._replace(
            friction=given["contact.friction"], speed=given["launch.speed_m_s"], track=given["slope.bumps"]
        )
        own = scenario.given(context)
        assert own[1:] == lane_of(scenes, i)
        one = sledenv.simulate(*own, settings)
        for name in one.outcome.dtype.names:
            assert one.outcome[name].tobytes() == found.outcomes[name][i].tobytes(), name
        assert one.jam.reward == found.jam.reward[i]
    ends = {str(STATUS_OF_CODE[code]) for code in found.outcomes["status"]}
    assert ends == {"finish", "tumbled"}


def test_passages_over_bumps_agree_with_the_trajectory() -> None:
    """Oracle: rows of the trajectory on both sides of a station, on faces, tops and level ground, in flight or not."""
    study = made(ROLLERS)
    scenes, settings = scenes_of(study, 12), study.base.settings()
    (body,) = study.base.all_bodies()
    stations = np.linspace(0.0, 50.0, 11)
    found = descend_past(scenes, stations, settings, [body])
    compared = 0
    for i in range(len(scenes.rows)):
        given = lane_of(scenes, i)
        rows = sledenv.simulate(body, *given, settings, record="trajectory", sample_interval=1e-3).trajectory
        for k, x in enumerate(stations[1:], 1):
            beyond = np.flatnonzero(rows["x"] >= x)
            assert np.isnan(found.speed[i, k]) == (len(beyond) == 0)
            if len(beyond):
                around = np.hypot(rows["u"], rows["v"])[beyond[0] - 1 : beyond[0] + 1]
                assert around.min() - 2e-2 <= found.speed[i, k] <= around.max() + 2e-2
                compared += 1
    assert compared > 60


def written(folder: Path, **changes: Any) -> Path:
    file = folder / "ride.yaml"
    file.write_text(yaml.safe_dump(mapping(ROLLERS, **changes)))
    return file


def test_a_study_of_a_ride_runs_resumes_and_reports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the files before a block was lost, byte by byte; the page and what is printed name the track."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sledenv.uncertainty.run.BLOCK", 20)
    command = ["study", str(file := written(tmp_path)), "--workers", "1"]
    assert main(command) == 0
    assert "    slope.bumps" in capsys.readouterr().out
    files = [path for path in (tmp_path / "runs" / "study" / "rollers").rglob("*") if path.is_file()]
    before = [path.read_bytes() for path in files]
    blocks = sorted(path for path in files if path.parent.name == "launches")
    assert len(blocks) == 4
    blocks[1].unlink()
    assert main(command) == 0
    assert [path.read_bytes() for path in files] == before
    assert "slope.bumps" in (blocks[0].parents[1] / "study.html").read_text()
    assert load_study(blocks[0].parents[1] / "study.yaml").key == load_study(file).key


@pytest.mark.parametrize("ground", ["profile_m", "profile_file", "scenario", "bumps"])
def test_ground_may_be_of_the_study_or_of_its_scenario(
    ground: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the vertices as they are written; a file is seen from the one that names it."""
    table = "\n".join(["x_m,y_m", *(f"{x},{y}" for x, y in PROFILE)])
    (tmp_path / "ground.csv").write_text(table)
    given = {"profile_m": PROFILE, "bumps": BUMPS}
    key = ground if ground in given else "profile_file"
    slope = {"angle_deg": 5, "length_m": 22, key: given.get(key, "ground.csv")}
    changes: dict[str, Any] = {"slope": slope}
    if ground == "scenario":
        own = sledenv.load_scenario("sled_rollers").model_dump(by_alias=True, mode="json", exclude_none=True)
        own["slope"] = slope
        (tmp_path / "own.yaml").write_text(yaml.safe_dump(own))
        changes = {"scenario": "own.yaml"}
    study_file = written(tmp_path, **changes, stations_m=[8, 22])
    monkeypatch.chdir("/")
    study = load_study(study_file)
    scenes = scenes_of(study, 6)
    drawn = ground == "bumps"
    assert ("slope.bumps" in study.parameters) == drawn
    assert len(np.unique(scenes.rows["ground"])) == (len(np.unique(scenes.rows["stream"])) if drawn else 1)
    assert len({ground.tobytes() for ground in scenes.grounds()}) == len(np.unique(scenes.rows["ground"]))
    if not drawn:
        assert lane_of(scenes, 0).slope.ground == tuple((float(x), float(y), 0.0) for x, y in PROFILE)
    again = tmp_path / "elsewhere" / "study.yaml"
    again.parent.mkdir()
    again.write_text(yaml.safe_dump(study.model_dump(mode="json")))
    assert load_study(again).key == study.key
    found = descend_past(scenes, study.stations, study.base.settings(), study.base.all_bodies())
    assert np.isfinite(found.speed[:, 1]).any()


def test_a_body_that_is_drawn_is_launched_clear_of_the_bumps() -> None:
    """Oracle: a launch below the ground is refused; the largest rocks reach over the first bump."""
    body = {"kind": "rock", "length_m": {"kind": "uniform", "low": 1, "high": 9}}
    study = made(ROLLERS, body=body, ends={"touching": None}, launch__speed_m_s=9)
    scenes = scenes_of(study, 40)
    begins = np.array([ground["x"][0] for ground in scenes.grounds()])
    assert (scenes.of_body("size") > begins).any()
    found = descend_past(scenes, np.array([0.0, 1.0]), study.base.settings())
    assert np.isfinite(found.speed).all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"solver": "rigid"}, "solver = 'rigid': must be 'compliant' where there is a profile"),
        ({"slope__length_m": {"kind": "uniform", "low": 45, "high": 55}}, "slope.length_m: must be certain, a number"),
        ({"slope__bumps": UNIFORM}, "slope.bumps: uniform, low 0.2, high 0.3"),
        ({"slope__bumps": BUMPS | {"face_m": UNIFORM}}, "slope.bumps.face_m"),
        ({"slope__profile_file": "none.csv"}, "slope.profile_file = '"),
        ({"slope__run_out_m": UNIFORM}, "slope.run_out_m: must be certain"),
    ],
)
def test_a_wrong_ride_is_refused_by_name_of_the_key(changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(StudyError) as error:
        load_study(written(tmp_path, **changes))
    assert message in str(error.value)
