"""Statistics of the benchmark: regret, means, shares, intervals and verdicts on made-up results."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from sledenv.benchmark import report, scores
from tests.benchmark import make

FEW = np.linspace(0.0, 0.2, 12).reshape(3, 4)


def row_of(table: pd.DataFrame, agent: str) -> pd.Series:
    return table.set_index("agent").loc[agent]


def test_a_random_launch_scores_zero_and_a_constant_regret_is_found() -> None:
    """Oracle: a random launch of the made-up scenario earns half of the best."""
    row = row_of(scores.scores(make.results({"ppo": np.full((2, 9), 0.5), "sac": np.full((2, 9), 0.03)})), "ppo")
    assert row["score"] == pytest.approx(0.0, abs=1e-12)
    assert row[["regret", "regret_low", "regret_high", "regret_p90"]].to_numpy(float) == pytest.approx(0.5)
    assert row["reward_low"] < row["reward"] < row["reward_high"]  # the best launches of contexts differ


def test_the_regret_is_the_mean_over_seeds_and_contexts() -> None:
    """Oracle: of 12 values the mean; eleven are not above the tail."""
    row = row_of(scores.scores(make.results({"sac": FEW})), "sac")
    assert row["regret"] == pytest.approx(FEW.mean())
    assert row["regret_low"] < row["regret"] < row["regret_high"]
    assert row["regret_p90"] == pytest.approx(np.sort(FEW.ravel())[10])
    assert row["regret_p90_low"] < row["regret_p90"] < row["regret_p90_high"]


def test_the_interval_of_a_regret_stays_among_possible_ones() -> None:
    """Oracle: two contexts, of which Student's interval is six times as wide as they are apart."""
    row = row_of(scores.scores(make.results({"sac": np.array([[0.0, 0.3]])})), "sac")
    assert (row["regret_low"], row["regret"], row["regret_high"]) == (0.0, pytest.approx(0.15), 1.0)


def test_an_agent_that_falls_in_a_quarter_of_the_contexts_is_not_better_than_one_that_never_does() -> None:
    """Oracle: regrets .001 and .8 in every fourth context, against .01 everywhere."""
    falls = np.tile([0.8, 0.001, 0.001, 0.001], (2, 25))
    table = scores.scores(make.results({"zero": falls, "sac": np.full((2, 100), 0.01)}))
    assert row_of(table, "sac")["regret"] < row_of(table, "zero")["regret"] == pytest.approx(0.20075)
    assert row_of(table, "sac")["reward"] > row_of(table, "zero")["reward"]


def with_falls(shares: np.ndarray) -> pd.Series:
    """Scores of an agent that falls in given shares of the trials, shape (seeds, contexts)."""
    made = make.results({"sac": np.zeros(shares.shape)})
    return row_of(scores.scores(made._replace(results=made.results.assign(tumbled=shares.ravel()))), "sac")


def test_a_share_of_falls_has_an_interval_even_if_nobody_fell() -> None:
    """Oracle: Wilson's interval of 0 and of 7 in 50 (scipy), and the bounds of a share."""
    row = with_falls(np.zeros((2, 50)))
    expected = stats.binomtest(0, 50).proportion_ci(method="wilson")
    assert row[["falls", "falls_low", "falls_high"]].to_numpy(float) == pytest.approx([0.0, *expected], abs=1e-12)
    row = with_falls(np.repeat([[1.0] * 7 + [0.0] * 43], 2, axis=0))
    expected = stats.binomtest(7, 50).proportion_ci(method="wilson")
    assert row["falls"] == pytest.approx(0.14)
    assert row[["falls_low", "falls_high"]].to_numpy(float) == pytest.approx([*expected], abs=0.01)  # t for z
    row = with_falls(np.ones((1, 50)))
    assert 0.9 < row["falls_low"] < 1.0
    assert row["falls_high"] == pytest.approx(1.0)
    split = with_falls(np.repeat([[1.0], [0.0], [0.0], [0.0], [0.0]], 50, axis=1))  # one seed always falls
    assert split["falls_low"] < 0.05
    assert split["falls_high"] > 0.5


def test_untrained_agents_are_left_out() -> None:
    """Oracle: made-up rewards of .8 of the best, and untrained ones that earn nothing."""
    made = make.results({"sac": np.full((1, 5), 0.2)})
    best = made.oracle["reward"].to_numpy()
    untrained = make.descents("launch", "brake_mat", "sac", 0, 0.0 * best, stage="untrained")
    table = scores.regrets(made._replace(results=pd.concat([made.results, untrained])))
    assert table["regret"].to_numpy() == pytest.approx(0.2)


def test_where_the_best_launch_earns_nothing_there_is_no_regret() -> None:
    made = make.results({"sac": np.full((1, 5), 0.4)})
    made.oracle.loc[2, ["reward", "uniform"]] = 0.0
    made.results.loc[made.results["context"] == 2, "reward"] = 0.0
    assert scores.regrets(made)["regret"].to_numpy() == pytest.approx([0.4, 0.4, 0.0, 0.4, 0.4])


def test_where_every_launch_earns_the_same_there_is_no_score() -> None:
    made = make.results({"sac": np.full((1, 5), 0.4)})
    made.oracle["uniform"] = made.oracle["reward"]
    assert np.isnan(scores.summary(made)["score"]).all()
    assert np.isnan(scores.scores(made)["score"]).all()


def test_the_spread_of_a_mean_is_that_of_a_bootstrap_of_seeds_and_of_contexts() -> None:
    """Oracle: means of values that are resampled by rows and by columns, times n / (n - 1)."""
    rng = np.random.default_rng(0)
    values = rng.normal(size=(6, 9)) + rng.normal(size=(6, 1))
    rows = values.mean(axis=1)[rng.integers(6, size=(200_000, 6))].mean(axis=1).var() * 6 / 5
    columns = values.mean(axis=0)[rng.integers(9, size=(200_000, 9))].mean(axis=1).var() * 9 / 8
    found = scores.mean(values)
    assert found.value == pytest.approx(values.mean())
    assert [variance for variance, _ in found.spreads] == pytest.approx([rows, columns], rel=0.02)
    assert [freedom for _, freedom in found.spreads] == [5, 8]


def test_the_spread_of_a_tail_is_that_of_repeated_values() -> None:
    """Oracle: numpy.quantile of values repeated as often as they are drawn."""
    rng = np.random.default_rng(0)
    values = rng.normal(size=(3, 7))
    found = scores.tail(values)
    assert found.value == np.quantile(values, 0.9, method="inverted_cdf")
    for axis, count, (variance, _) in zip((0, 1), (3, 7), found.spreads, strict=True):
        drawn = rng.integers(count, size=(20_000, count))
        tails = (
            np.quantile(np.take(values, drawn, axis), 0.9, axis=(0, 2), method="inverted_cdf")
            if axis
            else [np.quantile(values[one], 0.9, method="inverted_cdf") for one in drawn]
        )
        assert variance == pytest.approx(np.var(tails) * count / (count - 1), rel=0.15)


def test_a_difference_that_every_seed_and_context_agrees_on_is_clear_of_zero() -> None:
    """Oracle: contexts that are as hard for both do not blur a paired difference, though each interval is wide."""
    hard = np.tile(np.linspace(0.0, 0.8, 40), (5, 1))
    row = row_of(scores.scores(make.results({"sac": hard, "best_fixed": hard + 0.01})), "sac")
    assert row["regret_high"] - row["regret_low"] > 0.1
    assert row["versus_best_fixed"] == pytest.approx(-0.01)
    assert row["versus_best_fixed_low"] == pytest.approx(row["versus_best_fixed_high"])
    assert np.isnan(row["versus_land_flat"])


@pytest.mark.parametrize(
    ("sac", "fixed", "failed"),
    [
        (np.full((3, 20), 0.005), 0.1, set()),
        (np.full((3, 20), 0.02), 0.1, {"small_regret"}),
        (np.tile([0.0] * 16 + [0.045] * 4, (3, 1)), 0.1, {"small_tail"}),
        (np.full((3, 20), 0.005), 0.005, {"clear_of_best_fixed"}),
    ],
)
def test_a_verdict_names_what_fails(sac: np.ndarray, fixed: float, failed: set[str]) -> None:
    """Oracle: thresholds of 1 % and 4 %."""
    agents = {"sac": sac, "best_fixed": np.full((3, 20), fixed), "land_flat": np.full((1, 20), 0.2)}
    (row,) = scores.verdicts(scores.scores(make.results(agents))).to_dict("records")
    checks = ["small_regret", "small_tail", "clear_of_best_fixed", "clear_of_land_flat", "good_scores"]
    assert {name for name in checks if not row[name]} == failed
    assert row["passed"] is (not failed)


def test_whoever_left_a_learning_curve_has_learned_and_no_one_else() -> None:
    """Oracle: of two agents of someone's own one has a curve, in one of two scenarios."""
    agents = {"clever": np.full((2, 9), 0.005), "guess": np.full((2, 9), 0.002), "best_fixed": np.full((2, 9), 0.2)}
    made = make.results(agents, ("brake_mat", "ice_drop"))
    point = {"environment": "launch", "scenario": "brake_mat", "agent": "clever", "seed": 0}
    curves = pd.DataFrame([point | {"descents": 100, "seconds": 1.0, "mean_reward": 0.5}])
    (row,) = scores.verdicts(scores.scores(made._replace(curves=curves))).to_dict("records")
    assert (row["scenario"], row["agent"]) == ("brake_mat", "clever")
    assert scores.verdicts(scores.scores(made)).empty


def test_one_bad_learner_fails_the_scores_and_a_baseline_that_was_not_judged_fails_the_verdict() -> None:
    """Oracle: a regret of 6 % of the best is a score of 0.88 where a random launch earns half."""
    agents = {"sac": np.full((2, 9), 0.005), "tqc": np.full((2, 9), 0.06), "best_fixed": np.full((2, 9), 0.2)}
    (row,) = scores.verdicts(scores.scores(make.results(agents))).to_dict("records")
    assert row["agent"] == "sac"
    assert row["lowest_score"] == pytest.approx(0.88)
    assert row["good_scores"] is False
    assert row["clear_of_land_flat"] is None
    assert row["passed"] is False


def test_a_ride_is_compared_with_the_best_of_the_search_and_of_all_agents() -> None:
    """Oracle: by hand; rewards of .9 and .7 times what the search found, and an agent that is 2 % above it."""
    levels = {"sac": np.full((2, 9), 0.1), "land_parallel": np.full((1, 9), 0.3), "replan": np.full((1, 9), -0.02)}
    table = scores.scores(make.results(levels, environments=("descent",))).set_index("agent")
    assert table["regret"].to_dict() == pytest.approx(
        {"sac": 1 - 0.9 / 1.02, "land_parallel": 1 - 0.7 / 1.02, "replan": 0}
    )
    assert table.loc["sac", "versus_land_parallel"] == pytest.approx(-0.2 / 1.02)
    assert np.isnan(table.loc["sac", "versus_best_fixed"])
    (verdict,) = scores.verdicts(table.reset_index()).to_dict("records")
    assert verdict["clear_of_land_parallel"] is True
    assert verdict["clear_of_best_fixed"] is None


def test_the_summary_is_the_mean_over_scenarios() -> None:
    """Oracle: regrets of 0, 2, ..., 14 % are scores of 1, .96, ..., .72 of which .86 is the mean, in each scenario."""
    regrets = np.repeat(np.linspace(0.0, 0.14, 8)[:, np.newaxis], 6, axis=1)
    made = make.results({"sac": regrets}, ("brake_mat", "ice_drop"))
    (row,) = scores.summary(made).to_dict("records")
    assert (row["scenarios"], row["seeds"]) == (2, 16)
    assert row["score"] == pytest.approx(0.86)
    assert row["regret"] == pytest.approx(0.07)
    assert row["reward"] == pytest.approx(made.results["reward"].mean())
    each = scores.scores(made)
    for name in ("reward", "regret", "falls"):
        assert row[f"{name}_low"] < row[name] + 1e-12 < row[f"{name}_high"]
        widths = each[f"{name}_high"] - each[f"{name}_low"]
        assert row[f"{name}_high"] - row[f"{name}_low"] < widths.mean()
    assert row["score_low"] < 0.86 < row["score_high"]


def test_energy_shares_and_endings_add_up_to_one() -> None:
    table = scores.decomposition(make.whole(("brake_mat",), seeds=2, contexts=10))
    assert table[["hysteresis", "sliding", "rolling", "kept", "other"]].sum(axis=1).to_numpy() == pytest.approx(1.0)
    assert table[["finish", "jammed", "tumbled", "another way"]].sum(axis=1).to_numpy() == pytest.approx(1.0)
    (row,) = table[(table["agent"] == "zero")].to_dict("records")
    assert row["rolling"] == pytest.approx(0.05)


def test_seeds_that_met_other_contexts_are_refused() -> None:
    made = make.results({"sac": FEW})
    with pytest.raises(ValueError, match="launch brake_mat sac: not all of its seeds met the same contexts"):
        scores.scores(made._replace(results=made.results.iloc[1:]))


def test_results_are_read_back_and_what_is_wrong_with_them_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"no results\.parquet"):
        scores.read_results(tmp_path)
    made = make.results({"best_fixed": FEW})
    made.results.to_parquet(tmp_path / "results.parquet")
    made.oracle.to_parquet(tmp_path / "oracle.parquet")
    read = scores.read_results(tmp_path)
    assert read.curves.empty
    pd.testing.assert_frame_equal(scores.scores(read), scores.scores(made))
    pd.concat([made.results, made.results.iloc[:1]]).to_parquet(tmp_path / "results.parquet")
    with pytest.raises(
        ValueError, match="two rows of environment launch, scenario brake_mat, agent best_fixed, seed 0"
    ):
        scores.read_results(tmp_path)
    made.results.drop(columns="reward").to_parquet(tmp_path / "results.parquet")
    with pytest.raises(ValueError, match=r"results\.parquet has no column 'reward'"):
        scores.read_results(tmp_path)


def test_the_tables_in_markdown_have_a_line_a_scenario_and_a_line_an_agent() -> None:
    results = make.results({"sac": FEW, "zero": FEW, "best_fixed": FEW})
    text = report.markdown(results, scores.scores(results))
    found = [[line for line in part.splitlines()[1:] if line] for part in text.split("## ")[1:]]
    verdict, judged, asked = found
    assert [line.split(" | ")[1] for line in judged[2:]] == ["zero", "best_fixed", "sac"]
    assert [line.split(" | ")[1] for line in verdict[2:]] == ["sac"]
    assert " - " in verdict[2]  # land flat was not judged
    assert len(asked) == 3
    for lines in found:
        assert len({line.count("|") for line in lines}) == 1


def test_names_that_are_anybodys_are_text_in_markdown() -> None:
    """Oracle: what of Markdown and HTML they would be; a row stays a row."""
    results = make.results({"a|b": FEW, "<img src=x>": FEW, "[x](http://y)\n# z": FEW})
    text = report.markdown(results, scores.scores(results))
    lines = [line for line in text.partition("## Scores")[2].partition("##")[0].splitlines() if line]
    assert len(lines) == 2 + 3
    assert {line.replace("\\|", "").count("|") for line in lines} == {lines[0].count("|")}
    for escaped in (r"a\|b", r"\<img src=x\>", r"\[x\](http://y) # z"):
        assert escaped in text


@pytest.mark.parametrize(("seed_effect", "context_effect"), [(1.0, 1.0), (0.05, 1.0), (0.15, 1.0)])
def test_intervals_of_means_cover_the_truth_in_19_of_20_benchmarks(seed_effect: float, context_effect: float) -> None:
    """Oracle: normal effects of 5 seeds and 60 contexts about 0.

    The bounds are three standard errors of 2000 benchmarks; a percentile bootstrap of both factors covers 85 % of the
    first case.
    """
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(2000):
        seeds, contexts = rng.normal(0.0, seed_effect, (5, 1)), rng.normal(0.0, context_effect, 60)
        low, high = scores.mean(seeds + contexts + rng.normal(0.0, 0.3, (5, 60))).interval()
        covered += low <= 0.0 <= high
    assert 0.935 <= covered / 2000 <= 0.98


@pytest.mark.parametrize("share", [0.005, 0.02, 0.1, 0.5])
def test_intervals_of_shares_cover_the_truth_in_19_of_20_benchmarks(share: float) -> None:
    """Oracle: 200 contexts, in each of which all of 64 trials fall, or few; more than 19 of 20 are allowed."""
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(1000):
        falls = np.where(rng.random((1, 200)) < 0.9 * share, 1.0, rng.binomial(64, 0.1 * share, (1, 200)) / 64)
        low, high = scores.mean(falls).share_interval(200)
        covered += low <= 0.9 * share + (1.0 - 0.9 * share) * 0.1 * share <= high
    assert covered / 1000 >= 0.93
