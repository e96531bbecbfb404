"""The report of a benchmark: what is in it, with everything and with parts missing."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import sledenv
from sledenv.benchmark import figures
from sledenv.benchmark.report import write_report
from tests.benchmark import make

NAMES = {"regret", "learning", "seconds", "maps", "energy"}


class _Balance(HTMLParser):
    """Every element that is opened is closed in its place."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: object) -> None:
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def words(page: str) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", page.partition("<body>")[2]))


def test_a_report_holds_every_part_and_is_the_same_each_time(tmp_path: Path) -> None:
    made = make.whole(("brake_mat", "ice_drop"), seeds=2, contexts=20)
    page = write_report(made, tmp_path / "report").read_text()
    files = {path.name: path.read_bytes() for path in page_folder(tmp_path)}
    assert set(files) == {"index.html", "scores.md", *(f"{name}.png" for name in NAMES)}
    assert page.count("data:image/png;base64,") == len(NAMES)
    assert not re.search(r"(src|href)=.?(https?:|/)", page)
    balance = _Balance()
    balance.feed(page)
    assert balance.open == []
    for expected in ("made-up", "abc1234", make.HASH, "numpy 2.4.6", "ride", "How to read it"):
        assert expected in page
    assert "Launches SAC 4 20,000 60" in words(page)  # runs, descents and seconds of the training
    write_report(made, tmp_path / "report")
    assert {path.name: path.read_bytes() for path in page_folder(tmp_path)} == files


def test_curves_without_seconds_can_be_drawn() -> None:
    """An agent may leave them out."""
    made = make.whole(("brake_mat",), seeds=2, contexts=20)
    assert figures.plot_learning(made._replace(curves=made.curves.assign(seconds=np.nan)), "seconds") is None


def test_a_learning_curve_is_that_of_seeds_validated_after_other_descents() -> None:
    """One point a check, the mean over seeds, between the descents of both."""
    made = make.whole(("brake_mat",), seeds=2, contexts=20)
    curves = made.curves[made.curves["environment"] == made.curves["environment"].iloc[0]]
    curves = curves.assign(descents=curves["descents"] + 10 * curves["seed"])
    figure = figures.plot_learning(made._replace(curves=curves))
    assert figure is not None
    one, other = (curves[(curves["agent"] == curves["agent"].iloc[0]) & (curves["seed"] == seed)] for seed in (0, 1))
    lines = [line for line in figure.axes[0].lines if len(np.atleast_1d(line.get_xdata())) == len(one)]
    np.testing.assert_allclose(lines[0].get_xdata(), one["descents"] + 5)
    mean = 0.5 * (one["mean_reward"].to_numpy() + other["mean_reward"].to_numpy())
    np.testing.assert_allclose(lines[0].get_ydata(), mean)


def page_folder(folder: Path) -> list[Path]:
    return list((folder / "report").iterdir())


def test_a_smoke_run_with_one_agent_and_nothing_else_is_reported(tmp_path: Path) -> None:
    page = write_report(make.results({"random_launch": np.full((1, 2), 0.4)}), tmp_path / "report").read_text()
    assert {path.stem for path in page_folder(tmp_path)} == {"index", "scores", "regret", "energy"}
    assert "No learned agent was judged" in words(page)
    assert "nan" not in words(page).lower().split()


def test_the_numbers_of_a_report_are_those_of_the_scores(tmp_path: Path) -> None:
    """Oracle: constant regrets."""
    agents = {"sac": 0.005, "best_fixed": 0.2, "land_flat": 0.1}
    made = make.results({agent: np.full((2, 6), regret) for agent, regret in agents.items()})
    text = words(write_report(made, tmp_path / "report").read_text())
    assert "learning passes 1 of 1" in text
    assert "0.50 % [0.50, 0.50]" in text
    assert "\N{MINUS SIGN}19.50 % [\N{MINUS SIGN}19.50, \N{MINUS SIGN}19.50]" in text


def test_a_suite_of_rides_is_compared_with_the_baseline_of_rides_alone(tmp_path: Path) -> None:
    agents = {"sac": np.full((2, 6), 0.005), "land_parallel": np.full((1, 6), 0.2)}
    made = make.results(agents, environments=("descent",))
    text = words(write_report(made, tmp_path / "report").read_text())
    assert "clear of land parallel" in text
    assert "clear of land flat" not in text
    assert "not judged" not in text


def test_a_folder_with_other_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "notes.txt").write_text("mine")
    with pytest.raises(FileExistsError, match=r"notes\.txt"):
        write_report(make.results({"sac": np.full((1, 2), 0.4)}), tmp_path / "report")


def test_an_agents_name_is_shown_as_text(tmp_path: Path) -> None:
    page = write_report(make.results({"<b>mine": np.full((1, 2), 0.4)}), tmp_path / "report").read_text()
    assert "&lt;b&gt;mine" in page
    assert "<b>mine" not in page


def test_jam_maps_mark_the_best_launch_and_every_choice() -> None:
    """Oracle: the tables of the best launches and of the results."""
    made = make.whole(("brake_mat",), ("launch",), seeds=2, contexts=5)
    figure = figures.plot_maps(made)
    assert figure is not None
    ax = figure.axes[0]
    marks = {line.get_marker(): line.get_xydata() for line in ax.lines}
    assert marks["*"] == pytest.approx(made.oracle.loc[[0], ["action_0", "action_1"]].to_numpy())
    judged = made.results
    chosen = judged[(judged["agent"] == "sac") & (judged["context"] == 0)]
    chosen = chosen[chosen["stage"] == "trained"]
    assert marks["o"] == pytest.approx(chosen[["action_0", "action_1"]].to_numpy())


def test_jam_maps_of_a_scenario_that_ships_are_in_its_units() -> None:
    """Oracle: the control bounds of its file; of another scenario with the same name nothing is known."""
    made = make.whole(("sled_snow",), ("launch",), seeds=1, contexts=5)
    snow = sledenv.load_scenario("sled_snow")
    (low, high), (_, fastest) = (snow.control_bounds[name] for name in ("orientation", "spin"))
    for hashed, labels, ends in (
        (snow.hash, ("orientation [deg]", "spin [rad/s]"), (low, high, fastest)),
        ("another", ("orientation [-1 to 1 of its bounds]", "spin [-1 to 1 of its bounds]"), (-1.0, 1.0, 1.0)),
    ):
        figure = figures.plot_maps(made._replace(results=made.results.assign(scenario_hash=hashed)))
        assert figure is not None
        ax = figure.axes[0]
        assert (ax.get_xlabel(), ax.get_ylabel()) == labels
        (star,) = (line.get_xydata()[0] for line in ax.lines if line.get_marker() == "*")
        best = made.oracle.loc[0, ["action_0", "action_1"]].to_numpy(float)
        middle, half = 0.5 * (ends[1] + ends[0]), 0.5 * (ends[1] - ends[0])
        assert star == pytest.approx([middle + half * best[0], ends[2] * best[1]])


def test_a_map_of_three_choices_shows_the_best_of_what_is_not_on_the_axes() -> None:
    """Oracle: the map of two choices, which one of two speeds equals."""
    made = make.whole(("brake_mat",), ("launch",), seeds=1, contexts=5)
    slow, fast = made.maps.assign(speed=-1.0), made.maps.assign(speed=1.0)
    slow["reward"] *= 0.5
    plain, three = (figures.plot_maps(made._replace(maps=maps)) for maps in (made.maps, pd.concat([slow, fast])))
    assert plain is not None
    assert three is not None
    cells = [figure.axes[0].collections[0].get_array() for figure in (plain, three)]
    assert np.array_equal(*cells)


def test_a_map_of_one_choice_is_a_curve() -> None:
    made = make.whole(("brake_mat",), ("launch",), seeds=1, contexts=5)
    maps = made.maps[made.maps["spin"] == 0.0].assign(spin=np.nan)
    figure = figures.plot_maps(made._replace(maps=maps))
    assert figure is not None
    line = figure.axes[0].lines[0]
    first = maps[maps["context"] == 0]
    assert line.get_ydata() == pytest.approx(first["reward"].to_numpy())
