"""Agents train into folders that appear only when complete, and are judged on contexts that no training has seen."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import numpy as np
import pytest
import yaml

import sledenv.agents.demo
import sledenv.agents.evaluate
import sledenv.agents.train
from sledenv.agents import curve
from sledenv.agents.evaluate import main, table
from sledenv.agents.sac import Agent as Sac
from sledenv.agents.train import train
from sledenv.agents.zero import Agent as Zero
from sledenv.benchmark import runs
from sledenv.benchmark.evaluation import Evaluation, evaluation_of
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import TRAINED, is_trained, load_run, read_settings
from sledenv.benchmark.scores import mean_interval
from sledenv.machine.blame import GivenCodeError
from tests.own_scenarios import own_scenario

pytestmark = pytest.mark.filterwarnings("ignore")  # of torch, tensorboard and rich, which this project does not own


@pytest.fixture
def quick(monkeypatch):
    """Settings with which a training run takes seconds."""

    def settings(folder, module, environment):
        values, algo = read_settings(folder, module, environment), module.rpartition(".")[2]
        if algo in ("sac", "tqc"):
            values |= {"n_timesteps": 160, "learning_starts": 64, "batch_size": 32, "gradient_steps": 1}
        if algo == "ppo":
            values |= {"n_timesteps": 1024, "n_envs": 8, "n_steps": 64, "n_epochs": 1}
        if algo == "best_fixed":
            values |= {"n_timesteps": 400, "contexts": 20}
        if algo == "critic":
            values |= {"n_timesteps": 300, "n_envs": 10, "n_steps": 10, "n_epochs": 1, "batch_size": 50, "checks": 1}
            values |= {"blur": 0.2}
        if algo == "replan":
            values |= {"spins": [3]}
        return values

    monkeypatch.setattr(runs, "read_settings", settings)
    monkeypatch.setattr(curve, "_CONTEXTS", 12)


EVERY_AGENT = [
    *(("launch", algo) for algo in ("best_fixed", "critic", "land_flat", "ppo", "random_launch", "sac", "tqc", "zero")),
    *(("descent", algo) for algo in ("critic", "land_parallel", "ppo", "random_launch", "replan", "zero")),
]


@pytest.mark.parametrize(("environment", "algo"), EVERY_AGENT)
def test_a_trained_run_is_complete_and_loads_to_the_same_agent(environment, algo, quick, tmp_path):
    """Oracle: two loads judge alike; the folder holds the resolved configuration."""
    folder = train(algo, own_scenario("brake_mat"), environment, seed=3, folder=tmp_path)
    config = yaml.safe_load((folder / "config.yaml").read_text())
    assert config["agent"] == f"sledenv.agents.{algo}"
    assert config["scenario_hash"] == Problem(own_scenario("brake_mat"), environment).scenario.hash
    assert "numba" in config["versions"]
    assert list(tmp_path.iterdir()) == [folder]
    rewards = []
    for _ in range(2):
        problem, agent, _ = load_run(folder)
        rewards.append(evaluation_of(problem, agent, 20, algo).rewards)
    assert np.array_equal(*rewards)
    assert ((rewards[0] >= 0.0) & (rewards[0] <= 1.0)).all()


def test_sac_writes_a_learning_curve_and_keeps_the_policy_that_validated_best(quick, tmp_path):
    """Oracle: the validation contexts, judged again."""
    folder = train("sac", own_scenario("brake_mat"), "launch", seed=0, folder=tmp_path)
    checks = np.loadtxt(folder / "learning_curve.csv", delimiter=",", skiprows=1, ndmin=2)
    assert checks[0, 0] == 0
    assert checks[-1, 0] >= 160
    problem, agent, _ = load_run(folder)
    mean = problem.judge(agent, curve.validation(problem))[0].jam.reward.mean()
    assert mean == pytest.approx(checks[:, 2].max(), abs=1e-12)
    assert list((folder / "tensorboard").rglob("events*"))
    assert Sac.load_untrained(Problem(own_scenario("brake_mat")), folder).act(np.zeros((2, 11), np.float32)).shape == (
        2,
        2,
    )


def test_an_interrupted_run_leaves_nothing_and_can_be_started_again(quick, tmp_path, monkeypatch):
    def interrupt(*args):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Zero, "train", interrupt)
        with pytest.raises(KeyboardInterrupt):
            train("zero", own_scenario("brake_mat"), "launch", folder=tmp_path)
    assert list(tmp_path.iterdir()) == []
    folder = tmp_path / "brake_mat-launch-both-zero-s0"
    assert train("zero", own_scenario("brake_mat"), "launch", folder=tmp_path) == folder
    with pytest.raises(FileExistsError, match="--overwrite"):
        train("zero", own_scenario("brake_mat"), "launch", folder=tmp_path)
    train("zero", own_scenario("brake_mat"), "launch", folder=tmp_path, overwrite=True)


@pytest.mark.parametrize("name", ["config.yaml", "action.yaml"])
def test_a_run_that_refers_from_place_to_place_is_refused(name, tmp_path, quick):
    """A few lines of such references stand for gigabytes."""
    folder = train("best_fixed", own_scenario("brake_mat"), "launch", folder=tmp_path)
    bomb = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 60))
    (folder / name).write_text((folder / name).read_text() + bomb)
    with pytest.raises((ValueError, GivenCodeError), match="refers to another place") as raised:
        load_run(folder)
    assert len(str(raised.value)) < 1000


def test_a_place_for_numbers_is_checked_before_anything_is_judged_and_replaced_whole(tmp_path, monkeypatch, capsys):
    """Oracle: the file as it was after a disk that is full; nothing beside it."""
    name, file = "sled_mat-launch-spin-critic-s0", tmp_path / "scores.json"
    with monkeypatch.context() as patch:
        patch.setattr(sledenv.agents.evaluate, "evaluation_of", None)
        assert main([name, "--json", str(tmp_path / "no" / "scores.json")]) == 2
        assert "there is no folder" in capsys.readouterr().err
    few = [name, "--contexts", "2", "--json", str(file)]
    assert main(few) == 0
    before = file.read_text()

    def full(path, *_, **__):
        path.touch()
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(Path, "write_text", full)
    assert main(few) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert file.read_text() == before
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["sled_rollers-descent-trim-critic-s0", "--tracks", "--shifted"], "are contexts of two kinds"),
        (["sled_mat-launch-spin-critic-s0", "--tracks"], "must be 'descent' for a track made by hand"),
        (["sled_mat-launch-spin-critic-s99"], "neither here nor among those that ship"),
    ],
)
def test_bad_arguments_of_judging_are_explained(arguments, message, capsys):
    assert main(arguments) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--scenario", "sled_snwo"], "sled_snow"),
        (["--algo", "zero", "--steps", "0"], "--steps: must be an integer >= 1: '0'"),
    ],
)
def test_bad_arguments_of_training_are_explained_and_write_nothing(arguments, message, tmp_path, capsys):
    assert sledenv.agents.train.main([*arguments, "--runs", str(tmp_path / "runs")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()


def test_a_run_that_ships_is_found_by_its_name_wherever_one_works(tmp_path, monkeypatch, capsys):
    """Oracle: the same run, by its path; a folder of that name in the working folder is meant first."""
    name, told = "sled_mat-launch-spin-critic-s0", []
    monkeypatch.chdir(tmp_path)
    for run in (str(TRAINED / name), name):
        assert main([run, "--contexts", "4"]) == 0
        told.append(capsys.readouterr().out)
    assert told[0] == told[1]
    (tmp_path / name).mkdir()
    assert main([name]) == 2
    assert "no finished run" in capsys.readouterr().err


def test_a_run_of_another_version_of_the_scenario_is_not_taken_for_this_one(quick, tmp_path):
    """Oracle: a run keeps its own scenario, and is trained only if everything that is meant agrees."""
    problem, module = Problem(own_scenario("brake_mat")), "sledenv.agents.zero"
    folder = train("zero", own_scenario("brake_mat"), "launch", folder=tmp_path)
    before = (folder / "config.yaml").stat().st_mtime_ns
    assert train("zero", own_scenario("brake_mat"), "launch", folder=tmp_path, overwrite=None) == folder
    assert (folder / "config.yaml").stat().st_mtime_ns == before
    assert is_trained(module, problem, {}, 0, folder)
    assert not is_trained(module, problem, {}, 1, folder)
    config = yaml.safe_load((folder / "config.yaml").read_text())
    (folder / "config.yaml").write_text(yaml.safe_dump(config | {"scenario_hash": "0" * 16}))
    assert not is_trained(module, problem, {}, 0, folder)
    assert load_run(folder)[0].scenario == problem.scenario
    train("zero", own_scenario("brake_mat"), "launch", folder=tmp_path, overwrite=None)
    assert is_trained(module, problem, {}, 0, folder)


def test_the_table_has_the_best_first_and_compares_context_by_context():
    """Oracle: a constant lead on noisy contexts has an interval without width; a loss that is told; nobody falls."""
    rng = np.random.default_rng(0)
    base = rng.uniform(0.2, 0.6, 50)
    status = np.full((50, 4), "finish")
    given = {"a_rather_long_name": base, "high": base + 0.125}
    of = {
        "reference": "somebody",
        "lower": np.r_[2.0 * base[:8], np.full(42, np.nan)],
        "lower_fallen": np.zeros(50),
        "clairvoyant": 0.0 * base,
    }
    scores = [Evaluation(name, "mine", rewards, status, **of) for name, rewards in given.items()]
    header, _, high, low, *words = table(scores).splitlines()
    assert "behind high" in header
    assert (high.split()[0], low.split()[0]) == ("high", "a_rather_long_name")
    assert low.endswith("0.125 [0.125, 0.125]")
    assert "0.500 [0.500, 0.500]" in low
    assert "0.0% [0.0, 7.1]" in low  # Wilson's interval of 0 in 50
    assert low.index("[") == high.index("["), "columns stand below each other, whatever the names"
    assert "Ratio: to the mean reward of somebody, 0.8" in "".join(words)
    assert " in the first 8 contexts." in "".join(words)
    few, many = mean_interval(base)
    assert few < base.mean() < many


def test_the_demo_writes_its_table_scores_and_picture(quick, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sledenv.agents.demo, "CONTEXTS", 12)
    command = ["--out", str(tmp_path / "demo"), "--steps", "300"]
    assert sledenv.agents.demo.main(command) == 0
    told = capsys.readouterr().out
    assert "Ratio: to the mean reward of replan" in told
    scores = json.loads((tmp_path / "demo" / "scores.json").read_text())
    assert [score["agent"] for score in scores] == ["no trims", "rule", "small", "shipped"]
    listed = told.partition("-----\n")[2].splitlines()[: len(scores)]
    for line, score in zip(listed, sorted(scores, key=lambda score: -score["mean"]), strict=True):
        assert line.startswith(score["agent"])
    assert (tmp_path / "demo" / "before_after.png").stat().st_size > 20_000
    written = sorted((tmp_path / "demo").rglob("critic.npz"))[0].stat().st_mtime_ns
    assert sledenv.agents.demo.main(command) == 0
    assert sorted((tmp_path / "demo").rglob("critic.npz"))[0].stat().st_mtime_ns == written
