"""The report of a benchmark: what is in it, with everything and with parts missing."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from sledenv.benchmark import figures, report
from sledenv.benchmark.results import Results
from sledenv.benchmark.scores import scores
from tests.benchmark import make

FIGURES = {"Learning", "Regret, context by context", "Where the energy goes"}


def written(results: Results, folder: Path) -> str:
    return report.write_report(results, scores(results), folder / "report").read_text(encoding="utf-8")


def words(page: str) -> str:
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", page.partition("<body>")[2]))


def drawn(page: str) -> set[str]:
    return set(re.findall(r'<img alt="([^"]*)"', page))


def test_a_report_holds_every_part_and_is_the_same_each_time(tmp_path: Path) -> None:
    made = make.whole(("brake_mat", "ice_drop"), seeds=2, contexts=20)
    page = written(made, tmp_path)
    files = {path.name: path.read_bytes() for path in (tmp_path / "report").iterdir()}
    assert set(files) == {"index.html", "scores.csv"}
    assert drawn(page) == FIGURES
    assert not re.search(r"(src|href)=.?(https?:|/)", page)
    for expected in ("made-up", "abc1234", make.HASH, "numpy 2.4.6", "brake_mat, ride", "The reference earns"):
        assert expected in page
    assert re.search(r" SAC 2 0\.\S+ \[.*? 20,000 60\.5 ", words(page))  # flights and mean seconds of the training
    written(made, tmp_path)
    assert {path.name: path.read_bytes() for path in (tmp_path / "report").iterdir()} == files


def test_the_file_of_scores_is_the_table(tmp_path: Path) -> None:
    """Oracle: the table; what a spreadsheet would take for a formula has an apostrophe before it."""
    made = make.results({"sac": np.full((2, 6), 0.1), "=1+1": np.full((1, 6), 0.2)})
    written(made, tmp_path)
    read = pd.read_csv(tmp_path / "report" / "scores.csv")
    assert read["agent"].tolist() == ["sac", "'=1+1"]
    pd.testing.assert_frame_equal(read.drop(columns="agent"), scores(made).drop(columns="agent"))


def test_a_learning_curve_is_that_of_seeds_validated_after_other_descents() -> None:
    """One point a check, the mean over seeds, between the descents of both."""
    made = make.whole(("brake_mat",), seeds=2, contexts=20)
    curves = made.curves[made.curves["environment"] == made.curves["environment"].iloc[0]]
    curves = curves.assign(descents=curves["descents"] + 10 * curves["seed"])
    figure = figures.plot_learning(made._replace(curves=curves))
    assert figure is not None
    one, other = (curves[(curves["agent"] == "sac") & (curves["seed"] == seed)] for seed in (0, 1))
    (line,) = (line for line in figure.axes[0].lines if line.get_color() == figures.look("sac", curves)[0])
    np.testing.assert_allclose(line.get_xdata(), one["descents"] + 5)
    mean = 0.5 * (one["mean_reward"].to_numpy() + other["mean_reward"].to_numpy())
    np.testing.assert_allclose(line.get_ydata(), mean)


def test_regrets_are_drawn_as_the_share_of_contexts_below_them() -> None:
    """Oracle: of four regrets, one is below 0 and all are below 0.5."""
    figure = figures.plot_regret(make.results({"sac": np.array([[-0.1, 0.05, 0.2, 0.4]])}))
    assert figure is not None
    (steps,) = (line for line in figure.axes[0].lines if len(np.atleast_1d(line.get_xdata())) > 2)
    x, y = np.asarray(steps.get_xdata()), np.asarray(steps.get_ydata())
    assert [y[x <= level].max() for level in (0.0, 0.1, 0.5)] == [0.25, 0.5, 1.0]


def test_without_reference_curves_and_training_the_rest_is_reported(tmp_path: Path) -> None:
    page = written(make.without_reference(make.results({"random_launch": np.full((1, 2), 0.4)})), tmp_path)
    assert drawn(page) == {"Where the energy goes"}
    assert "No reference is frozen" in words(page)
    assert "ratio to reference" not in page
    assert "nan" not in words(page).lower().split()


def test_a_folder_with_other_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "notes.txt").write_text("mine")
    with pytest.raises(FileExistsError, match=r"notes\.txt"):
        written(make.results({"sac": np.full((1, 2), 0.4)}), tmp_path)


def test_an_agents_name_is_shown_as_text(tmp_path: Path) -> None:
    page = written(make.results({"<b>mine": np.full((1, 2), 0.4)}), tmp_path)
    assert "&lt;b&gt;mine" in page
    assert "<b>mine" not in page
