"""The paper's numbers and figures: values against the known ones, files, and a folder that is whole or not there."""

from __future__ import annotations

import csv
import math
import time
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from sledenv import plot, reproduce
from sledenv.files import publish
from sledenv.kernel.records import Mode
from sledenv.reproduce import FILES, Row, printed_rules
from sledenv.wheel import collide_wheel

# id: value, tolerance; docs/physics.md, sections 2 and 4
EXPECTED = {
    "t0_printed_speed": (0.5, 1e-12),
    "speed": (-10.0, 1e-12),
    "t0": (50.0, 1e-12),
    "t_end_euler": (18.8075, 5e-5),
    "t_end_limit": (18.806301, 1e-6),
    "t_end_euler_printed": (24.8979, 5e-5),
    "t_end_limit_printed": (24.8965, 5e-5),
    "t_separation_euler_printed": (25.0, 5e-4),
    "t_separation_printed": (24.9985, 1e-4),
    "separation_printed": (0.0418, 1e-6),
    "separation": (0.037703, 1e-6),
    "elastic_printed": (55.21, 5e-3),
    "elastic": (48.17, 5e-3),
    "slip_directions": (1.0, 0.0),
    "spin_directions": (1.0, 0.0),
    "compression_ends": (0.0129, 5e-5),
    "moment_reverses": (0.0269, 5e-5),
    "depth": (0.078, 5e-4),
    "inertia": (7.5e-3, 1e-15),
    "t_rigid": (18.814409, 1e-6),
    "ledger": (0.0, 1e-12),
    "printed_overlap": (37.5, 0.5),
    "printed_overlap_unit": (62.3, 0.5),
    "corrected_unique": (100.0, 0.0),
    "closed_form_agrees": (100.0, 0.0),
    "scenario_2_printed": (6.0, 1e-12),
    "sled_rebounds": (5.0, 0.0),
}


@pytest.fixture(scope="module")
def rows() -> dict[str, Row]:
    found = [
        *reproduce.example_rows(reproduce.worked_example()),
        *reproduce.table_1_rows(),
        *reproduce.sled_rows(reproduce.sled_descent()),
    ]
    assert len({row.id for row in found}) == len(found)
    return {row.id: row for row in found}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    start = time.perf_counter()
    place = tmp_path_factory.mktemp("paper") / "out"
    assert reproduce.reproduce(place, progress=lambda line: None) == place
    assert time.perf_counter() - start < 60.0
    return place


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("name", EXPECTED)
def test_a_number_comes_out(rows: dict[str, Row], name: str) -> None:
    """Oracle: docs/physics.md, sections 2 and 4, computed by independent codes."""
    value, tolerance = EXPECTED[name]
    assert rows[name].ours == pytest.approx(value, abs=tolerance, rel=0.0)


def test_what_does_not_come_out_is_said(rows: dict[str, Row]) -> None:
    finals = [row for row in rows.values() if row.paper == "26.43"]
    assert len(finals) == 4
    assert all("26.43 J not reproducible" in row.why for row in finals)
    assert "complete sliding confirmed" in rows["slip_directions"].why
    assert "not in the first phase" in rows["moment_reverses"].why
    assert rows["sled_status"].ours == "finish"
    assert "Assumed" in rows["sled_status"].why


def test_exactly_one_corrected_rule_holds_and_names_the_scenario() -> None:
    """Oracle: the closed form of the wheel."""
    rng = np.random.default_rng(4)
    ratio, f, e, arm, inertia = rng.uniform(0.0, [[3.0], [1.0], [1.0], [0.5], [1.0]], (5, 2000)) + 1e-6
    _, corrected = printed_rules(ratio, f, np.minimum(e, 1.0), arm, inertia)
    assert np.array_equal(corrected.sum(axis=0), np.ones(2000))
    wheel = collide_wheel(1.0, inertia, 1.0, f, arm, np.minimum(e, 1.0), ratio, -1.0)
    names = np.array(["slide-roll", "stop-roll", "slide", "stuck"])[np.argmax(corrected, axis=0)]
    assert names.tolist() == wheel.scenario.tolist()


def test_the_moment_has_the_sign_by_which_it_was_computed() -> None:
    """Oracle: J times the difference quotient of the spin, row by row."""
    example = reproduce.worked_example()
    for descent, sign in ((example.euler, "dissipative"), (example.printed, "printed")):
        series, rows = reproduce.force_series(descent, sign), descent.trajectory  # type: ignore[arg-type]
        rate = descent.body.inertia * np.diff(rows["omega"]) / np.diff(rows["t"])
        middle = 0.5 * (series["moment"][1:] + series["moment"][:-1])
        smooth = np.abs(np.diff(series["normal"])) < 50.0
        assert middle[smooth] == pytest.approx(rate[smooth], abs=0.05)


@pytest.mark.slow
def test_the_folder_is_complete(folder: Path) -> None:
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    assert [path.name for path in folder.parent.iterdir()] == ["out"]
    index = (folder / "index.md").read_text(encoding="utf-8")
    assert all(f"]({name})" in index for name in FILES if name != "index.md")
    assert "{" not in index
    for name in FILES:
        content = (folder / name).read_bytes()
        assert len(content) > 500
        assert content.startswith(b"\x89PNG") == name.endswith(".png")


@pytest.mark.slow
def test_the_table_holds_the_numbers(folder: Path, rows: dict[str, Row]) -> None:
    table = {line["id"]: line for line in read(folder / "table.csv")}
    assert list(table) == list(rows)
    for name, (value, tolerance) in EXPECTED.items():
        assert float(table[name]["ours"]) == pytest.approx(value, abs=tolerance, rel=0.0)
    markdown = (folder / "table.md").read_text(encoding="utf-8")
    assert all(row.quantity in markdown for row in rows.values())
    assert {line.count("|") for line in markdown.splitlines() if line.startswith("|")} == {6}


@pytest.mark.slow
def test_the_data_are_those_of_the_figures(folder: Path) -> None:
    """Oracles: the kinetic energies of the table; the closed form; the mirror image of each impact."""
    energies = {line["run"]: float(line["kinetic_j"]) for line in read(folder / "fig_7_10.csv")}
    assert energies["event-driven"] == pytest.approx(18.806301, abs=1e-6)
    assert energies["euler-printed-sign"] == pytest.approx(24.8979, abs=5e-5)
    sled = read(folder / "fig_12_14.csv")
    tilt = math.radians(10.0)
    assert float(sled[0]["vertical_m_s"]) == pytest.approx(-3.0 * math.sin(tilt))
    assert float(sled[0]["horizontal_m_s"]) == pytest.approx(3.0 * math.cos(tilt))
    wheel = read(folder / "table_1.csv")
    assert {line["scenario"] for line in wheel} == {"slide-roll", "stop-roll", "slide", "stuck"}
    number = {"slide-roll": "1", "stop-roll": "2", "slide": "3", "stuck": "4"}
    assert all(number[line["scenario"]] in line["printed_rules"] for line in wheel)
    modes = {
        (line["friction"], float(line["phi_deg"]), float(line["speed_ratio"])): line["mode"]
        for line in read(folder / "mode_map.csv")
    }
    assert all(modes[f, -phi, -speed] == mode for (f, phi, speed), mode in modes.items())


@pytest.mark.slow
def test_an_earlier_reproduction_is_replaced(folder: Path) -> None:
    before = {name: (folder / name).read_bytes() for name in FILES}
    reproduce.reproduce(folder, progress=lambda line: None)
    assert {name: (folder / name).read_bytes() for name in FILES} == before


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit, OSError])
def test_an_interrupted_run_leaves_nothing(tmp_path: Path, error: type[BaseException]) -> None:
    lines: list[str] = []

    def progress(line: str) -> None:
        lines.append(line)
        if len(lines) == 2:
            (scratch,) = tmp_path.iterdir()
            assert (scratch / "new" / "fig_7_10.png").exists()
            raise error

    with pytest.raises(error):
        reproduce.reproduce(tmp_path / "deep" / "out", progress=progress)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_run_keeps_what_was_there(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "index.md").write_text("old")

    def give_up() -> None:
        with publish(tmp_path / "out", FILES) as new:
            (new / "index.md").write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        give_up()
    assert (tmp_path / "out" / "index.md").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_finished_folder_takes_its_place(tmp_path: Path) -> None:
    for text in ("first", "second"):
        with publish(tmp_path / "deep" / "out", ["a.txt"]) as new:
            (new / "a.txt").write_text(text)
        assert (tmp_path / "deep" / "out" / "a.txt").read_text() == text
    assert [path.name for path in tmp_path.rglob("*")] == ["deep", "out", "a.txt"]


def test_a_folder_of_other_files_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(FileExistsError, match=r"holds 'thesis\.tex', which is not of this command"):
        reproduce.reproduce(tmp_path)
    with pytest.raises(NotADirectoryError, match="is a file"):
        reproduce.reproduce(tmp_path / "thesis.tex")
    empty = tmp_path / "empty"
    empty.mkdir()
    monkeypatch.chdir(empty)
    with pytest.raises(FileExistsError, match="is the current folder"):
        reproduce.reproduce(".")
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_maps_are_labelled() -> None:
    x, y = np.linspace(0.0, 1.0, 40), np.linspace(0.0, 0.5, 30)
    scenario = np.where(x > 0.5, "slide", "stuck") * np.ones((30, 1), dtype=object)
    printed = np.where(x > 0.5, "3", "2 + 4") * np.ones((30, 1), dtype=object)
    figure = plot.plot_table_1(x, y, scenario.astype(str), printed.astype(str), note="assumed")
    texts = [[text.get_text() for text in ax.texts] for ax in figure.axes]
    assert texts == [["3", "4"], ["2 + 4", "3"]]
    assert legend(figure) == ["3  slides without rotation", "4  stuck", "several printed rules hold"]
    modes = np.full((30, 40), int(Mode.SLIDE))
    modes[:10] = Mode.SLIP_REVERSAL
    figure = plot.plot_mode_map(x, y, {"one": modes, "other": modes})
    assert [ax.get_title("left") for ax in figure.axes] == ["one", "other"]
    assert legend(figure) == ["slides without rotation", "slip reversed"]


def test_a_sliver_is_not_labelled() -> None:
    x = np.linspace(0.0, 1.0, 40)
    printed = np.full((40, 40), "1", dtype="U9")
    printed[20] = "1 + 2"
    figure = plot.plot_table_1(x, x, np.full((40, 40), "slide-roll"), printed)
    assert [text.get_text() for text in figure.axes[1].texts] == ["1"]


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_wrong_shapes_are_named() -> None:
    x, y = np.linspace(0.0, 1.0, 4), np.linspace(0.0, 1.0, 3)
    names = np.full((3, 4), "slide")
    with pytest.raises(ValueError, match=r"printed has shape \(4, 3\): must be \(3, 4\)"):
        plot.plot_table_1(x, y, names, names.T)
    with pytest.raises(ValueError, match=r"'f = 1' has shape \(4, 3\): must be \(3, 4\)"):
        plot.plot_mode_map(x, y, {"f = 1": np.ones((4, 3), dtype=int)})
    with pytest.raises(ValueError, match="panels is empty"):
        plot.plot_mode_map(x, y, {})
    with pytest.raises(ValueError, match="series is empty"):
        plot.plot_worked_example({})
