"""examples/planar_impacts.py: on files of the dataset's layout with known truth, and on the dataset where it is."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from examples import planar_impacts
from examples.planar_impacts import GOAL, GYRATION_RADIUS, MASS, PUBLISHED, read_impacts, slips, study, turned
from sledenv.identification.comparison import impact_models
from sledenv.identification.plausibility import read_rebounds
from sledenv.identification.rebounds import Rebounds

DATASET = os.environ.get("SLEDENV_PLANAR_IMPACTS")


def impacts(n: int) -> Rebounds:
    """Made-up impacts as the dataset has them, with e = 0.6 and f = 0.2."""
    rng = np.random.default_rng(0)
    lows, highs = [-0.01, 0.025, 0.4, -2.8, -8.0], [0.01, 0.035, 0.9, -2.2, 8.0]
    contacts = rng.uniform(lows, highs, (n, 5))
    given = Rebounds(GYRATION_RADIUS, contacts, contacts[:, 2:], np.zeros(n, bool), np.arange(n))
    after = impact_models()["energetic"].velocities(given, np.array([0.6, 0.2, 0.0, 0.0, 0.0]))
    return replace(given, after=after)


def written(folder: Path) -> np.ndarray:
    """Write made-up impacts in the files of the dataset; the last one creates energy."""
    given = impacts(12)
    after = given.after.copy()
    after[-1] *= 5.0
    a, b = given.arms.T
    poses, zero, one = np.zeros((12, 3)), np.zeros(12), np.ones(12)
    data = {
        "states_i": np.hstack([poses, given.before]),
        "states_f": np.hstack([poses, after]),
        "n": np.stack([zero, one, -a], axis=1),
        "d": np.stack([one, zero, b], axis=1),
    }
    savemat(folder / "data_ellipse.mat", {"data": data})
    savemat(folder / "v_models.mat", {"v_models": np.hstack([after + k for k in range(len(PUBLISHED))])})
    savemat(folder / "w_true_data.mat", {"W": np.zeros((12, 3))})
    return after


def test_files_of_the_datasets_layout_are_read(tmp_path) -> None:
    """Oracle: the law that made them; the impact that creates energy is left out."""
    after = written(tmp_path)
    recorded = read_impacts(tmp_path)
    assert len(recorded.table) == 11
    rebounds = read_rebounds(recorded.table, gyration_radius=GYRATION_RADIUS)
    assert rebounds.after == pytest.approx(after[:-1])
    assert rebounds.balance()["share"].to_numpy() == pytest.approx([1.0, 1.0])
    assert recorded.published["Wang-Mason"] == pytest.approx(after[:-1] + 4.0)
    assert planar_impacts.missing_moment(rebounds, rebounds.after) == pytest.approx(0.0, abs=1e-12)
    assert turned(turned(rebounds)).contacts == pytest.approx(rebounds.contacts)
    assert turned(rebounds).balance()["share"].to_numpy() == pytest.approx([1.0, -1.0])


def test_every_rival_is_the_law_where_its_number_is_neutral() -> None:
    """Exact rebounds: rivals contain the truth, and find it."""
    given = impacts(40)
    for name in ("... scale of b", "... offset of a", "... radius of gyration", "... friction by side"):
        rival = planar_impacts.rivals()[name]
        assert given.errors(rival(given, given)).max() < 1e-5, name


@pytest.mark.slow
@pytest.mark.skipif(not DATASET, reason="SLEDENV_PLANAR_IMPACTS does not name the folder of the dataset")
def test_the_recorded_impacts_are_predicted_better_than_by_the_published_models(tmp_path) -> None:
    """Oracle: docs/recordings.md: the goals, the balance, and that no rolling resistance is found."""
    recorded = read_impacts(Path(str(DATASET)))
    comparisons = study(recorded, tmp_path)
    for name, comparison in comparisons.items():
        best = comparison.table.iloc[0]
        assert best["mean"] <= GOAL[0], name
        assert best["p90"] <= GOAL[1], name
        assert comparison.differences().loc[list(PUBLISHED), "low"].min() > 0.0
    told = read_rebounds(recorded.table, gyration_radius=GYRATION_RADIUS)
    share = told.balance()["share"]
    assert share["a"] > 0.85
    assert share["b"] < -0.85
    assert comparisons["turned"].table.loc["energetic", "mean"] < 0.1
    parts = pd.read_csv(tmp_path / "arms_turned.csv")
    assert parts["rolling_arm"].max() < 5e-4
    found = slips({"told": told, "turned": turned(told)})["median"]
    assert found["told", "after"] > found["told", "before"]
    assert abs(found["turned", "after"]) < 0.1 * found["turned", "before"]
    assert MASS * np.abs(planar_impacts.missing_moment(told, told.after) - recorded.torque / MASS).max() < 1e-5
