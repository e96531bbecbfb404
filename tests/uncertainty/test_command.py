"""The command: what it prints and writes, and how it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest
import yaml

from sledenv.command.cli import main
from tests.uncertainty.make import DROP


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "drop.yaml"
    path.write_text(yaml.safe_dump(DROP))
    return path


def test_study_prints_and_writes_what_it_has_found(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the tables in its folder; the second time there is nothing left to simulate."""
    monkeypatch.chdir(tmp_path)
    assert main(["study", str(file), "--launches", "90", "--workers", "1"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("drop, 96 launches, solver rigid: A drop\n")
    answer, page = out.splitlines()[-2:]
    assert answer.startswith("drop: 100 % log_full; half end within 1.")
    assert page == "study: wrote runs/study/drop/study.html, with tables and pictures beside it"
    assert "96.0/96.0" in err
    assert main(["study", str(file), "--launches", "90", "--workers", "1", "--json"]) == 0
    again, err = capsys.readouterr()
    assert "96.0/96.0" in err
    told = json.loads(again, parse_constant=pytest.fail)
    assert (told["study"], told["launches"], told["written"]) == ("drop", 96, ["runs/study/drop"])
    assert sum(row["share"] for row in told["shares"]) == pytest.approx(1.0)
    assert {row["output"] for row in told["quantiles"]} >= {"stop_m"}
    mean = pd.read_parquet("runs/study/drop/quantiles.parquet").set_index("output").loc["stop_m", "mean"]
    printed = next(line.split() for line in out.splitlines() if line.startswith("stop_m "))
    assert float(printed[1]) == pytest.approx(mean, rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["psuh_off"], "unknown study 'psuh_off' (did you mean 'push_off'?); known: brake_stop, hillside, push_off;"),
        (["FILE", "--launches", "0"], "must be an integer >= 1: '0'"),
        (["FILE", "--out", "FILE"], "is a file: choose another folder"),
        (["FILE", "--out", "."], "is the current folder: choose another one"),
    ],
)
def test_study_refuses(
    arguments: list[str],
    message: str,
    file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    try:
        status = main(["study", *(str(file) if word == "FILE" else word for word in arguments)])
    except SystemExit as stop:
        status = stop.code
    out, err = capsys.readouterr()
    assert (status, out) == (2, "")
    assert message in err
    assert [path.name for path in tmp_path.iterdir()] == ["drop.yaml"]


@pytest.mark.parametrize(("launches", "planned", "rounded"), [(6, 6, False), (7, 12, True)])
def test_what_is_about_to_be_done_is_told_and_how_to_go_on(
    launches: int,
    planned: int,
    rounded: bool,
    file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Oracle: groups of three launches, of which there is a power of two."""

    def interrupted(*given: object, **named: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("sledenv.uncertainty.study", interrupted)
    folder = tmp_path / "out"
    assert main(["study", str(file), "--out", str(folder), "--launches", str(launches)]) == 130
    out, err = capsys.readouterr()
    first, second = err.splitlines()
    more = f", for {launches} asked for: they come in groups of 3, a power of two of groups" if rounded else ""
    assert (out, first) == ("", f"study: drop: {planned} launches{more}; results go to {folder}")
    assert second == "sledenv study: interrupted; the same command goes on where it was"
