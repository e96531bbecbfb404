"""Statistics of the benchmark on made-up results: means, ratios, shares, regret, and how often intervals hold."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from sledenv.benchmark import scores
from tests.benchmark import make

FEW = np.linspace(0.0, 0.2, 12).reshape(3, 4)


def row_of(table: pd.DataFrame, agent: str) -> pd.Series:
    return table.set_index("agent").loc[agent]


def test_a_mean_is_over_seeds_and_contexts_and_lies_in_its_interval() -> None:
    """Oracle: the mean of all values; of equal ones the interval is a point."""
    row = row_of(scores.scores(make.results({"sac": FEW, "zero": np.full((2, 4), 0.5)})), "sac")
    judged = make.results({"sac": FEW}).judged
    assert row["reward"] == pytest.approx(judged["reward"].mean())
    assert row["reward_low"] < row["reward"] < row["reward_high"]
    assert (row["seeds"], row["contexts"], row["descents"]) == (3, 4, 1000)
    assert scores.mean_interval(np.full((2, 5), 0.3)) == pytest.approx((0.3, 0.3))


def test_a_ratio_is_that_of_means_over_the_same_contexts() -> None:
    """Oracle: by hand; contexts that are as hard for both do not blur a ratio, though each mean is uncertain."""
    lower = np.linspace(0.1, 0.9, 40)
    low, high = scores.ratio_interval(np.tile(0.9 * lower, (5, 1)), lower)
    assert (low, high) == pytest.approx((0.9, 0.9))
    noisy = 0.9 * lower + np.random.default_rng(0).normal(0.0, 0.01, 40)
    low, high = scores.ratio_interval(noisy, lower)
    assert low < noisy.mean() / lower.mean() < high
    mean_low, mean_high = scores.mean_interval(noisy)
    assert high - low < 0.2 * (mean_high - mean_low)
    row = row_of(scores.scores(make.results({"sac": np.full((3, 20), 0.1)})), "sac")
    assert row[["ratio", "ratio_low", "ratio_high"]].to_numpy(float) == pytest.approx(0.9)


def test_without_a_reference_only_what_needs_one_is_missing() -> None:
    """Oracle: the scores with a reference."""
    made = make.results({"sac": FEW, "zero": FEW[:1]})
    known, unknown = scores.scores(made), scores.scores(make.without_reference(made))
    needed = [name for name in known if name.startswith("ratio") or name in scores.REFERENCE]
    assert unknown[needed].isna().all(axis=None)
    pd.testing.assert_frame_equal(known.drop(columns=needed), unknown.drop(columns=needed))
    assert scores.regrets(make.without_reference(made).judged).isna().all()


def test_a_reference_that_lacks_a_context_is_of_the_others() -> None:
    """Oracle: the means over the contexts that it has."""
    made = make.results({"sac": FEW})
    judged = made.judged[made.judged["agent"] == "sac"]
    lower = made.judged["lower"].where(made.judged["context"] != 2)
    row = row_of(scores.scores(made._replace(judged=made.judged.assign(lower=lower))), "sac")
    known = judged[judged["context"] != 2]
    assert row["ratio"] == pytest.approx(known["reward"].mean() / known["lower"].mean())
    assert row["ratio_low"] < row["ratio"] < row["ratio_high"]
    assert row["reward"] == pytest.approx(judged["reward"].mean())


def test_a_share_has_an_interval_even_if_nothing_was_counted() -> None:
    """Oracle: Wilson's interval of none, of 7 and of all in 50 (scipy), for the contexts of two seeds."""
    for count in (0, 7, 50):
        shares = np.repeat([[1.0] * count + [0.0] * (50 - count)], 2, axis=0)
        expected = stats.binomtest(count, 50).proportion_ci(method="wilson")
        assert scores.share_interval(shares) == (expected.low, expected.high)
    row = row_of(scores.scores(make.results({"sac": np.zeros((2, 50))})), "sac")
    assert row["falls"] == row["falls_low"] == 0.0
    assert 0.05 < row["falls_high"] < 0.1


def test_regret_is_what_is_missed_of_the_reference_and_none_where_that_earns_nothing() -> None:
    """Oracle: the made-up regrets; an agent may be better than a reference."""
    made = make.results({"sac": np.array([[0.4, -0.1, 0.0]])})
    assert scores.regrets(made.judged).to_numpy() == pytest.approx([0.4, -0.1, 0.0])
    assert scores.regrets(made.judged.assign(lower=0.0)).to_numpy() == pytest.approx([0.0, 0.0, 0.0])


def test_most_reward_of_a_problem_is_first_and_launches_are_before_rides() -> None:
    levels = {agent: np.full((1, 4), level) for agent, level in (("zero", 0.5), ("sac", 0.1))}
    table = scores.scores(make.results(levels, ("ice_drop", "brake_mat"), ("descent", "launch")))
    assert table["environment"].tolist() == ["launch"] * 4 + ["descent"] * 4
    assert table["scenario"].tolist() == ["brake_mat", "brake_mat", "ice_drop", "ice_drop"] * 2
    assert table["agent"].tolist() == ["sac", "zero"] * 4


def test_energy_shares_and_endings_add_up_to_one() -> None:
    table = scores.decomposition(make.whole(("brake_mat",), seeds=2, contexts=10).judged)
    assert table[["hysteresis", "sliding", "rolling", "kept", "other"]].sum(axis=1).to_numpy() == pytest.approx(1.0)
    assert table[["finish", "jammed", "tumbled", "another way"]].sum(axis=1).to_numpy() == pytest.approx(1.0)
    assert table["rolling"].to_numpy() == pytest.approx(0.05)


@pytest.mark.parametrize("rows", [slice(0, 1), slice(3, 5)])
def test_seeds_that_met_other_contexts_are_refused(rows: slice) -> None:
    made = make.results({"sac": FEW, "zero": FEW})
    with pytest.raises(ValueError, match="not all seeds and agents met the same contexts"):
        scores.scores(made._replace(judged=made.judged.drop(made.judged.index[rows])))


def test_intervals_of_means_cover_the_truth_in_19_of_20_benchmarks() -> None:
    """Oracle: normal effects of 5 seeds and 100 contexts about 0, those of seeds a tenth as wide, as agents here have.

    Of 200 benchmarks 95 % would be within 92 and 98 %. A bootstrap of five seeds is too narrow where these differ more
    than contexts do: docs/benchmark.md.
    """
    rng, covered = np.random.default_rng(0), 0
    for _ in range(200):
        effects = rng.normal(0.0, 0.02, (5, 1)) + rng.normal(0.0, 0.2, 100)
        low, high = scores.mean_interval(effects + rng.normal(0.0, 0.1, (5, 100)))
        covered += low <= 0.0 <= high
    assert 0.90 <= covered / 200 <= 0.985
