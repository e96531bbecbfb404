"""Frozen references: what is written is read, by everything that decides it; what ships is what is earned now."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import yaml

from sledenv.agents import freeze as making
from sledenv.agents.freeze import PLANNERS, main
from sledenv.agents.replan import Agent
from sledenv.benchmark.evaluation import evaluate, evaluation_of
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.references import FOLDER, freeze, reference
from sledenv.benchmark.results import read_results
from sledenv.benchmark.runner import run_suite
from sledenv.benchmark.scores import scores
from sledenv.benchmark.suite import Suite
from sledenv.scenarios.scenario import load_scenario, scenario_names

PLAYED = [name for name in scenario_names() if not {"paper", "engineer"} & set(load_scenario(name).tags)]
RIDES = [name for name in PLAYED if load_scenario(name).is_ride]


def known(lower: float, count: int = 3) -> pd.DataFrame:
    return pd.DataFrame({"lower": lower + 0.1 * np.arange(count), "lower_falls": 0.0, "clairvoyant": np.nan})


def test_what_is_frozen_is_read_where_everything_agrees(tmp_path):
    """Oracle: the table itself; another noise, scenario, set or control has none."""
    problem = Problem("sled_kickers", "descent")
    assert reference(problem, folder=tmp_path) is None
    freeze(problem, "test", known(0.5), "mine", tmp_path)
    freeze(problem, "tracks", known(0.2, 2), "mine", tmp_path)
    found = reference(problem, folder=tmp_path)
    assert found["lower"].tolist() == pytest.approx([0.5, 0.6, 0.7])
    assert reference(problem, "tracks", tmp_path)["lower"].tolist() == pytest.approx([0.2, 0.3])
    assert reference(problem, "shifted", tmp_path) is None
    assert reference(Problem("sled_kickers", "descent", launch_noise=(0.0, 0.0)), folder=tmp_path) is None
    assert reference(Problem("sled_kickers", "launch"), folder=tmp_path) is None
    columns = ("context", "state", "landing")  # what is seen does not matter
    assert reference(Problem("sled_kickers", "descent", columns=columns), folder=tmp_path) is not None
    freeze(problem, "test", known(0.8), "better", tmp_path)
    assert reference(problem, folder=tmp_path)["lower"].iloc[0] == 0.8
    assert reference(problem, "tracks", tmp_path) is not None
    noisy = Problem("sled_kickers", "descent", launch_noise=(0.0, 0.0))
    freeze(noisy, "test", known(0.1), "mine", tmp_path)
    assert reference(problem, folder=tmp_path) is not None
    assert reference(noisy, folder=tmp_path)["lower"].iloc[0] == 0.1


def test_a_score_is_told_beside_what_can_be_expected():
    """Oracle: the means by hand, over the contexts that are known."""
    found = evaluate(lambda seen: np.zeros((len(seen), 1)), "sled_kickers", contexts=20)
    table = reference(Problem("sled_kickers", "descent")).iloc[:20]
    assert np.array_equal(found.lower, table["lower"])
    assert found.ratio == pytest.approx(found.rewards.mean() / table["lower"].mean())
    assert found.ratio_interval[0] < found.ratio < found.ratio_interval[1]
    assert f"ratio        {found.ratio:.3f}" in repr(found)
    with pytest.raises(ValueError, match="read-only"):
        found.lower[0] = 1.0
    steady = evaluate(lambda seen: np.zeros((len(seen), 1)), "sled_kickers", contexts=4, launch_noise=(0.0, 0.0))
    assert steady.lower is None
    assert np.isnan(steady.ratio)
    assert "ratio" not in repr(steady)


@pytest.mark.parametrize("scenario", PLAYED)
def test_every_scenario_has_its_references(scenario):
    """Oracle: what is asked of them: all test contexts of rides, three sets, somebody who knows the errors."""
    environment = "descent" if scenario in RIDES else "launch"
    problem = Problem(scenario, environment)
    test = reference(problem)
    assert test is not None, f"python -m sledenv.agents.freeze {scenario}"
    assert test.index.tolist() == list(range(len(test)))
    sets = ("test", "shifted", "tracks") if environment == "descent" else ("test",)
    kept = len(pd.read_parquet(FOLDER / f"{scenario}.parquet"))
    assert kept == sum(len(reference(problem, one)) for one in sets), "rows of another version of the scenario"
    assert len(test) == (1000 if environment == "descent" else 200)
    assert test["lower"].between(0.0, 1.0).all()
    if environment == "descent":
        assert reference(problem, "shifted") is not None
        assert reference(problem, "tracks") is not None
        knowing = test.dropna()
        assert len(knowing) >= 40
        assert knowing["clairvoyant"].mean() > knowing["lower"].mean()


@pytest.mark.parametrize("scenario", RIDES)
def test_what_can_be_expected_is_earned_now(scenario):
    """Oracle: the planner that is named in the file, in the first contexts of two sets."""
    problem = Problem(scenario, "descent")
    for held_out in ("test", "tracks"):
        planner = Agent(problem, **PLANNERS[reference(problem, held_out).attrs["policy"]])
        now = evaluation_of(problem, planner, 2, "lower", held_out)
        assert now.rewards.tolist() == pytest.approx(now.lower.tolist(), abs=1e-6), "freeze it anew"


def test_a_scenario_is_frozen_set_by_set(tmp_path, monkeypatch, capsys):
    """Oracle: the planner, ridden by hand; a set that is known is not ridden again."""
    planners = {"short": {"spins": [3]}, "shorter": {"spins": [2]}, "of nobody": {"spins": [2], "critic": "nobody"}}
    monkeypatch.setattr(making, "PLANNERS", planners)
    monkeypatch.setattr(making, "_VALIDATED", 8)
    few = ["sled_kickers", "--contexts", "4", "--knowing", "2", "--out", str(tmp_path)]
    assert main(few) == 0
    problem = Problem("sled_kickers", "descent")
    best = pd.read_parquet(tmp_path / "sled_kickers.parquet")["policy"].unique().tolist()
    assert len(best) == 1
    planner = Agent(problem, **making.PLANNERS[best[0]])
    for held_out in ("test", "shifted", "tracks"):
        found = reference(problem, held_out, tmp_path)
        assert found["lower"].tolist() == evaluation_of(problem, planner, 4, "mine", held_out).rewards.tolist()
    assert reference(problem, folder=tmp_path)["clairvoyant"].notna().tolist() == [True, True, False, False]
    assert "of nobody: left out, nobody: there is no such run" in capsys.readouterr().err
    before = (tmp_path / "sled_kickers.parquet").stat().st_mtime_ns
    assert main(few) == 0
    assert (tmp_path / "sled_kickers.parquet").stat().st_mtime_ns == before


def test_a_suite_is_put_beside_the_references_that_ship(tmp_path):
    """Oracle: the table itself, context by context."""
    content = {"id": "tiny", "title": "A test", "contexts": 6, "scenarios": ["sled_kickers"]}
    content["agents"] = {"descent": {"sledenv.agents.zero": 1, "sledenv.agents.land_parallel": 1}}
    (tmp_path / "tiny.yaml").write_text(yaml.safe_dump(content))
    suite = Suite.load(str(tmp_path / "tiny.yaml"))
    found = read_results(suite, run_suite(suite, tmp_path / "out", workers=1))
    lower = reference(Problem("sled_kickers", "descent"))["lower"]
    assert len(found.judged) == 12
    assert found.judged["lower"].tolist() == lower[found.judged["context"]].tolist()
    table = scores(found).set_index("agent")
    zero = found.judged[found.judged["agent"] == "zero"]
    assert table.loc["zero", "ratio"] == pytest.approx(zero["reward"].mean() / zero["lower"].mean())
