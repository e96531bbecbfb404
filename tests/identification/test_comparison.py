"""compare: the law that made the rebounds wins on those held out; intervals of differences."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from sledenv.command.cli import main
from sledenv.identification.comparison import Comparison, compare, impact_models
from sledenv.identification.plausibility import read_rebounds
from sledenv.identification.rebounds import Rebounds
from sledenv.identification.report import plot_errors
from tests.identification.rebound_tables import GYRATION, rebounding, told_by_arms

SPEED = {"energetic, speed", "energetic, rolling, speed"}
ROLLING = {"energetic, rolling", "energetic, rolling, speed"}


def rebounds(seed: int, n: int, noise: float = 0.02, **truth) -> Rebounds:
    rng = np.random.default_rng(seed)
    return read_rebounds(rebounding(told_by_arms(rng, n), rng, noise, **truth), gyration_radius=GYRATION)


@pytest.mark.parametrize(
    ("truth", "best", "alike"),
    [
        ({"rolling_arm": 0.002}, ROLLING, {"poisson, rolling"}),  # hypotheses differ where slip stops, here by little
        ({"rolling_arm": 0.0, "softening": 0.6}, SPEED, set()),
        ({"hypothesis": "newton", "friction": 0.35, "rolling_arm": 0.002}, {"newton, rolling"}, set()),
    ],
    ids=["rolling", "speed", "newton"],
)
def test_the_law_that_made_the_rebounds_wins_clearly(truth: dict, best: set[str], alike: set[str]) -> None:
    comparison = compare(rebounds(1, 300, 0.01, **truth), held_out=np.arange(300) % 2 == 0)
    assert set(comparison.errors) == set(impact_models())
    assert str(comparison.table.index[0]) in best
    others = comparison.differences().drop(index=list(best | alike), errors="ignore")
    assert others["clear"].all()
    assert (others["low"] > 0.0).all()


def test_errors_are_those_of_the_definition() -> None:
    """Oracle: sqrt(dv' M dv / v0' M v0) of predicted velocities, and their mean and percentile."""
    given = rebounds(3, 50)
    predicted = given.after + np.array([0.1, -0.2, 3.0])
    comparison = compare(given, models={}, predicted={"other": predicted})
    energy = given.before[:, 0] ** 2 + given.before[:, 1] ** 2 + GYRATION**2 * given.before[:, 2] ** 2
    expected = np.sqrt((0.01 + 0.04 + 9.0 * GYRATION**2) / energy)
    assert comparison.errors["other"].to_numpy() == pytest.approx(expected)
    row = comparison.table.loc["other"]
    assert row[["mean", "p90"]].tolist() == pytest.approx([expected.mean(), np.quantile(expected, 0.9)])
    assert row["mean_low"] < row["mean"] < row["mean_high"]
    assert row["p90_low"] <= row["p90"] <= row["p90_high"]


def test_paired_differences_are_surer_than_their_parts() -> None:
    """Oracle: the normal interval of a mean; a constant difference is known exactly."""
    rng = np.random.default_rng(4)
    one = rng.gamma(4.0, 0.05, 400)
    errors = pd.DataFrame({"one": one, "more": one + 0.001, "noisy": one + rng.normal(0.01, 0.05, 400)})
    comparison = Comparison(errors, np.arange(400))
    found = comparison.differences()
    assert found.loc["more", ["low", "high"]].to_numpy(float) == pytest.approx([0.001, 0.001])
    assert found.loc["more", "clear"]
    reach = 2.2414 * np.std(errors["noisy"] - one) / 20.0  # of two at 0.95: each at 0.975
    assert found.loc["noisy", "high"] - found.loc["noisy", "low"] == pytest.approx(2 * reach, rel=0.1)
    labels = plot_errors(comparison).axes[0].get_yticklabels()
    assert {label.get_text() for label in labels} == {"one", "more", "noisy"}


def test_recordings_are_drawn_and_held_out_as_a_whole() -> None:
    """Forty rows of four recordings say no more than four; no row of a recording is fitted when another is held out."""
    given = rebounds(5, 40)
    together = Rebounds(given.gyration_radius, given.contacts, given.after, given.corner, np.repeat(np.arange(4), 10))
    seen = []

    def spy(train: Rebounds, test: Rebounds) -> np.ndarray:
        seen.append((set(train.recordings), set(test.recordings)))
        return test.after + 0.1 * (test.recordings[:, None] + 1.0)

    comparison = compare(together, models={"spy": spy}, folds=2)
    assert len(seen) == 2
    assert all(not train & test for train, test in seen)
    alone = Comparison(comparison.errors, np.arange(40)).table.loc["spy"]
    row = comparison.table.loc["spy"]
    assert row["mean_high"] - row["mean_low"] > 1.5 * (alone["mean_high"] - alone["mean_low"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"held_out": [True, False]}, "held_out: must be 30 flags"),
        ({"held_out": np.ones(30, bool)}, "some of them true and some false"),
        ({"held_out": np.zeros(30, bool)}, "some of them true and some false"),
        ({"folds": 1}, "folds = 1: must be from 2 to the number of recordings, 30"),
        ({"folds": 31}, "folds = 31"),
        ({"models": {}, "predicted": {"other": np.zeros((3, 3))}}, r"predicted, other: must be finite .* \(30, 3\)"),
    ],
)
def test_wrong_arguments_are_named(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        compare(rebounds(8, 30), **{"models": {"energetic": impact_models()["energetic"]}} | options)


def test_the_command_compares(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.setattr("sledenv.identification.law._FEW_STARTS", 1)
    rng = np.random.default_rng(10)
    file, out = tmp_path / "rebounds.csv", tmp_path / "fit"
    rebounding(told_by_arms(rng, 24), rng, 0.02).to_csv(file, index=False)
    options = ["--gyration-radius", str(GYRATION), "--starts", "2", "--compare", "--out", str(out)]
    assert main(["identify", str(file), *options]) == 0
    assert "errors on rebounds held out" in capsys.readouterr().out
    assert set(pd.read_csv(out / "models.csv")["model"]) == set(impact_models())
    assert len(pd.read_csv(out / "errors.csv")) == 24
    assert (out / "models.png").is_file()
