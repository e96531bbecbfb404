"""The Python code of the documentation runs as it stands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import torch

from sledenv import load_study

ROOT = Path(__file__).parents[1]


def blocks(page: str) -> list[str]:
    """Python code of a page, in order."""
    return re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def run(codes: list[str]) -> dict[str, object]:
    names: dict[str, object] = {}
    for code in codes:
        exec(code, names)
    return names


def test_the_page_on_simulation_runs_from_top_to_bottom(tmp_path, monkeypatch, capsys):
    """Its figures and its table are written."""
    monkeypatch.chdir(tmp_path)
    names = run(blocks("docs/simulation.md"))
    figures = ["strobe", "descent", "impact", "slip", "penetration", "portraits", "velocities", "impulses", "plane"]
    assert {file.name for file in tmp_path.iterdir()} == {"rebounds.csv", *(f"{name}.png" for name in figures)}
    assert names["descent"].status == "finish"
    assert len((tmp_path / "rebounds.csv").read_text().splitlines()) == 1 + len(names["descent"].rebounds)
    assert names["theory"].static_jam(names["body"], names["sticky"], names["slope"], 0.0).shape == ()
    assert "finish" in names["batch"].status
    assert "SLIDE" in capsys.readouterr().out


def test_the_page_on_sensitivity_runs(tmp_path, monkeypatch, capsys):
    """Its figure is written, and the descent is the one that the page tells of."""
    monkeypatch.chdir(tmp_path)
    names = run(blocks("docs/sensitivity.md"))
    assert [file.name for file in tmp_path.iterdir()] == ["growth.png"]
    assert names["found"].descent.status == "jammed"
    assert len(names["found"].rebounds) == len(names["found"].descent.rebounds) == 13
    assert "nearest change" in capsys.readouterr().out


def test_the_page_on_identification_runs_from_top_to_bottom(capsys):
    """Oracle: the law that made its recording."""
    names = run(blocks("docs/identify.md"))
    for name, truth in (("restitution", 0.6), ("friction", 0.12), ("rolling_arm", 0.002)):
        assert names["found"].intervals[name].low < truth < names["found"].intervals[name].high
    assert "95 % interval" in capsys.readouterr().out


def test_the_page_on_films_runs_from_top_to_bottom(capsys):
    """Oracle: the law that made its film."""
    names = run(blocks("docs/identify_tracks.md"))
    for name, truth in (("restitution", 0.7), ("friction", 0.1), ("rolling_arm", 0.002)):
        assert names["found"].intervals[name].low < truth < names["found"].intervals[name].high
    assert "95 % interval" in capsys.readouterr().out


def test_the_simulation_of_the_readme_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(blocks("README.md")[:1])
    assert (tmp_path / "descent.png").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2])
def test_the_training_of_the_readme_runs(number):
    torch.set_num_threads(1)  # more wait for each other on a busy machine
    run([blocks("README.md")[number].replace("progress_bar=True", "progress_bar=False")])


def test_the_page_on_studies_runs(tmp_path, monkeypatch, capsys):
    """Its study of few launches finds what the page says of many: jams come of friction."""
    monkeypatch.chdir(tmp_path)
    names = run(blocks("docs/uncertainty.md"))
    friction = names["launches"].groupby("status", observed=True)["contact.friction"].mean()
    assert friction["jammed"] > friction["finish"]
    assert "contact.friction" in capsys.readouterr().out


def test_the_study_file_of_the_page_is_valid(tmp_path):
    page = (ROOT / "docs/uncertainty.md").read_text(encoding="utf-8")
    (tmp_path / "mine.yaml").write_text(re.findall(r"^```yaml\n(.*?)^```", page, re.MULTILINE | re.DOTALL)[0])
    assert load_study(tmp_path / "mine.yaml").stations.tolist() == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]
