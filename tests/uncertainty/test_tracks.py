"""Studies of rides: ground over the plane of a slope, the same for all launches or drawn for each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import sledenv
from sledenv.simulation.records import STATUS_OF_CODE
from sledenv.uncertainty import load_study, run
from sledenv.uncertainty.descents import descend_past
from tests.uncertainty.make import ROLLERS, drawn, lane_of, made, mapping

PROFILE = [[3, 0], [6, 0.4], [7, 0.4], [9, 0], [12, 0], [15, 0.3], [18, 0]]
BUMPS = {"height_m": [0.2, 0.4], "face_m": [2, 3], "top_m": 0.5, "gap_m": [1, 2], "start_m": 3}


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
        context = sledenv.scenarios.Context(*low)._replace(
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


def written(folder: Path, **changes: Any) -> Path:
    file = folder / "ride.yaml"
    file.write_text(yaml.safe_dump(mapping(ROLLERS, **changes)))
    return file


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
    scenes = drawn(study, 6)
    bumps = ground == "bumps"
    assert ("slope.bumps" in study.parameters) == bumps
    assert len(np.unique(scenes.rows["ground"])) == (len(np.unique(scenes.rows["stream"])) if bumps else 1)
    assert len({ground.tobytes() for ground in scenes.grounds()}) == len(np.unique(scenes.rows["ground"]))
    if not bumps:
        assert lane_of(scenes, 0).slope.ground == tuple((float(x), float(y), 0.0) for x, y in PROFILE)
    again = tmp_path / "elsewhere" / "study.yaml"
    again.parent.mkdir()
    again.write_text(yaml.safe_dump(study.model_dump(mode="json")))
    assert load_study(again).key == study.key
    found = descend_past(scenes, study.stations, study.base.settings(), study.base.all_bodies())
    assert np.isfinite(found.columns["speed_m_s"][:, 1]).any()


def test_a_body_that_is_drawn_is_launched_clear_of_the_bumps() -> None:
    """Oracle: a launch below the ground is refused; the largest rocks reach over the first bump."""
    body = {"kind": "rock", "length_m": {"kind": "uniform", "low": 1, "high": 9}}
    study = made(ROLLERS, body=body, ends={"touching": None}, launch__speed_m_s=9)
    scenes = drawn(study, 40)
    begins = np.array([ground["x"][0] for ground in scenes.grounds()])
    assert (scenes.of_body("size") > begins).any()
    found = descend_past(scenes, np.array([0.0, 1.0]), study.base.settings())
    assert np.isfinite(found.columns["speed_m_s"]).all()
