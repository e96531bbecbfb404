"""Tables of a descent for other programs: names, units, and that ``identify`` reads what is written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import sledenv
from sledenv.command.cli import main
from sledenv.identification.plausibility import read_rebounds
from sledenv.identification.recordings import recordings_of
from sledenv.pages.columns import (
    CONTACT_COLUMNS,
    rebound_columns,
    trajectory_columns,
)
from sledenv.scenarios.scenario import load_scenario
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.settings import Solver
from sledenv.simulation.simulate import simulate
from tests.own_scenarios import own_scenario


def given() -> tuple:  # type: ignore[type-arg]
    scenario = load_scenario(own_scenario("ice_drop"))
    context = scenario.sample(np.random.default_rng(0))
    return scenario.given(context)


def descent(solver: Solver = "rigid") -> Descent:
    return simulate(*given(), solver=solver, max_time=1.0, record="trajectory")


def test_each_contact_of_a_trajectory_has_its_columns() -> None:
    """Oracle: the contacts of the descent; cells are None where there is no such contact."""
    one = descent("compliant")
    columns, rows = trajectory_columns(one), one.trajectory
    assert max(columns["contacts"]) == rows["touching"].max() > 0
    assert f"contact_{rows['touching'].max() + 1}_x_m" not in columns
    for k in range(rows["touching"].max()):
        there = rows["touching"] > k
        for field, name in CONTACT_COLUMNS.items():
            cells = columns[f"contact_{k + 1}_{name}"]
            assert [cell is not None for cell in cells] == there.tolist()
            if field not in ("part", "ground"):
                assert [cell for cell in cells if cell is not None] == rows["contacts"][field][there, k].tolist()
        parts = [one.body.parts[code - 1] for code in rows["contacts"]["part"][there, k]]
        assert [cell for cell in columns[f"contact_{k + 1}_part"] if cell] == parts
        assert {cell for cell in columns[f"contact_{k + 1}_ground"] if cell} == {"piece 0"}


@pytest.mark.parametrize("solver", ["rigid", "compliant"])
def test_the_orientation_of_a_rebound_is_that_at_touchdown(solver: Solver) -> None:
    """Oracle: the row of the trajectory at that time."""
    one = descent(solver)
    table = pd.DataFrame(rebound_columns(one))
    assert len(table) >= 2
    for _, row in table.iterrows():
        there = one.trajectory[one.trajectory["t"] == row["t_touchdown_s"]]
        assert len(there)
        turns = (row["phi_rad"] - there["phi"][0]) / (2.0 * np.pi)
        assert turns == pytest.approx(round(turns), abs=1e-12)


def test_tables_of_descents_are_those_of_the_command_with_numbers_of_recordings() -> None:
    one = descent()
    for table, columns in (
        (sledenv.identification.recorded_rebounds([one, one]), rebound_columns(one)),
        (sledenv.identification.recorded_poses([one, one]), trajectory_columns(one)),
    ):
        rows = len(next(iter(columns.values())))
        assert list(table) == ["recording", *columns]
        for number, part in table.groupby("recording"):
            assert number in (0, 1)
            pd.testing.assert_frame_equal(
                part.drop(columns="recording").reset_index(drop=True), pd.DataFrame(columns), check_dtype=False
            )
        assert len(table) == 2 * rows
    mixed = sledenv.identification.recorded_poses(
        [replace(descent("compliant"), trajectory=one.trajectory[:2]), descent("compliant")]
    )
    assert list(mixed) == ["recording", *trajectory_columns(descent("compliant"))]
    assert mixed["contact_1_x_m"][:2].isna().all()


def test_a_batch_has_the_table_of_its_descents_and_gives_its_law_back() -> None:
    """Oracle: the descents one by one, and their law; surfaces are rigid."""
    body, law, slope, launch = given()
    launches = [launch._replace(phi=launch.phi + 0.2 * k, omega=0.5 * k) for k in range(6)]
    how = sledenv.Settings(solver="rigid", max_time=1.0)
    batch = sledenv.simulate_batch(body, law, slope, launches, how, keep_rebounds=True)
    table = sledenv.identification.recorded_rebounds(batch, body, launches)
    single = [sledenv.simulate(body, law, slope, one, how) for one in launches]
    pd.testing.assert_frame_equal(table, sledenv.identification.recorded_rebounds(single))
    found = sledenv.identify(table, body, starts=4)
    assert found.values["restitution"] == pytest.approx(law.restitution, rel=1e-6)
    assert found.values["friction"] == pytest.approx(law.friction, rel=1e-5)


def test_what_makes_no_table_is_named() -> None:
    body, law, slope, launch = given()
    how = sledenv.Settings(solver="rigid", max_time=1.0)
    batch = sledenv.simulate_batch(body, law, slope, [launch], how)
    one = sledenv.simulate(body, law, slope, launch, how)
    rebounds, poses = sledenv.identification.recorded_rebounds, sledenv.identification.recorded_poses
    for make, arguments, kind, message in (
        (rebounds, (batch, body, [launch]), ValueError, "simulate the batch with keep_rebounds"),
        (rebounds, (batch, body), ValueError, "launches: must be given with a batch"),
        (rebounds, (batch, None, [launch]), ValueError, "body: must be given with a batch"),
        (rebounds, (batch, body, [launch] * 2), ValueError, r"is of shape \(2, 6\), .*\(1, 6\)"),
        (rebounds, (one, body), ValueError, "must be given with a batch only"),
        (rebounds, ([],), ValueError, "must hold at least one Descent"),
        (rebounds, ([1],), TypeError, "of the type list: must be a Descent or a sequence"),
        (poses, (one,), ValueError, "descent 0: has no trajectory"),
    ):
        with pytest.raises(kind, match=message):
            make(*arguments)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_identify_reads_what_simulate_writes(tmp_path: Path, suffix: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the same descent, simulated here; a trajectory has event times twice."""
    files = tmp_path / f"poses{suffix}", tmp_path / f"rebounds{suffix}"
    words = ["simulate", own_scenario("ice_drop"), "--csv", str(files[0]), "--rebounds-csv", str(files[1])]
    assert main(words) == 0
    out = capsys.readouterr().out
    one = simulate(*given(), record="trajectory", end_on_chord=True)
    assert f"wrote {len(one.trajectory)} rows into {files[0]}" in out
    assert f"wrote {len(one.rebounds)} rows into {files[1]}" in out
    read = pd.read_csv if suffix == ".csv" else pd.read_parquet
    poses = read(files[0])
    assert (poses["t_s"].diff() == 0.0).any()
    (recording,) = recordings_of(poses, one.body.size)
    assert recording.times == pytest.approx(np.unique(one.trajectory["t"]), rel=1e-12)
    assert recording.noise == pytest.approx((1e-6 * one.body.size, 1e-6))
    rebounds = read_rebounds(files[1], one.body)
    assert rebounds.before == pytest.approx(
        np.stack([one.rebounds[f"{name}_before"] for name in ("u", "v", "omega")], axis=1), rel=1e-9, abs=1e-12
    )
    assert rebounds.place(1) == ("line 3" if suffix == ".csv" else "row 1")


def test_a_table_in_the_folder_that_is_replaced_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    both = "--out", str(tmp_path / "out"), "--rebounds-csv", str(tmp_path / "out" / "fall.csv")
    assert main(["simulate", "paper_impact", *both]) == 2
    assert "--rebounds-csv = " in capsys.readouterr().err
