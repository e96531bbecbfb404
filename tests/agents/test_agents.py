"""Agents train into folders that appear only when complete, and are judged on contexts that no training has seen."""

from __future__ import annotations

import errno
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

import sledenv.agents.demo
import sledenv.agents.evaluate
import sledenv.agents.train
from sledenv.agents import curve
from sledenv.agents.evaluate import main, table
from sledenv.agents.random_launch import Agent as Random
from sledenv.agents.sac import Agent as Sac
from sledenv.agents.train import train
from sledenv.agents.zero import Agent as Zero
from sledenv.benchmark import runs
from sledenv.benchmark.evaluation import Evaluation, evaluation_of
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import TRAINED, is_trained, load_run, read_settings
from sledenv.benchmark.scores import mean_interval
from sledenv.machine.blame import GivenCodeError
from sledenv.scenarios.configuration import read_yaml, write_yaml
from sledenv.scenarios.scenario import Scenario, load_scenario
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


def test_the_splits_share_no_context_and_do_not_depend_on_their_size():
    problem = Problem(own_scenario("brake_mat"))
    contexts = np.concatenate([problem.contexts(split, 200) for split in ("train", "validation", "test")])
    assert len(np.unique(contexts, axis=0)) == 600
    speeds = contexts[:, 3].reshape(3, 200) / np.ptp(contexts[:, 3])
    for one, other in [(0, 1), (0, 2), (1, 2)]:  # nor does one follow from another by a turn through the range
        assert abs(np.exp(2j * np.pi * (speeds[one] - speeds[other])).mean()) < 0.25
    assert np.array_equal(problem.contexts("test", 3), problem.contexts("test", 50)[:3])
    assert not np.array_equal(problem.contexts("train", 3, seed=1), problem.contexts("train", 3, seed=2))


EVERY_AGENT = [
    *(("launch", algo) for algo in ("best_fixed", "critic", "land_flat", "ppo", "random_launch", "sac", "tqc", "zero")),
    *(("descent", algo) for algo in ("critic", "land_parallel", "ppo", "random_launch", "replan")),
    *(("descent", algo) for algo in ("sac", "tqc", "zero")),
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


@pytest.mark.parametrize(
    ("algo", "control"),
    [
        # One of those that share what chooses a launch.
        *((algo, "all") for algo in ("best_fixed", "critic", "land_flat", "random_launch", "sac", "zero")),
        *(("land_flat", "spin+speed"), ("sac", "speed")),
    ],
)
def test_every_agent_chooses_a_speed_too(algo, control, quick, tmp_path):
    """Oracle: the box; what is chosen, in the middle or not, is what the descent is launched with."""
    content = load_scenario(own_scenario("brake_mat")).model_dump(by_alias=True)
    content["control"]["speed_m_s"] = (2.0, 5.0)
    problem = Problem(scenario := Scenario.model_validate(content), control=control)
    _, agent, _ = load_run(train(algo, scenario, "launch", control, seed=3, folder=tmp_path))
    contexts = problem.contexts("test", 10)
    batch, launches = problem.judge(agent, contexts)
    assert launches.shape == (10, len(problem.task.controlled))
    assert (np.abs(launches) <= 1.0).all()
    speeds = problem.task.aimed(problem.task.scenes(contexts), launches).launches[:, 3]
    assert ((speeds >= 2.0) & (speeds <= 5.0)).all()
    if algo in ("zero", "land_flat"):
        assert (speeds == 3.5).all()
    assert ((batch.jam.reward >= 0.0) & (batch.jam.reward <= 1.0)).all()


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


def test_the_best_fixed_action_beats_every_other_candidate_on_its_own_contexts(quick, tmp_path):
    """Oracle: the same candidates, judged again one by one."""
    folder = train("best_fixed", own_scenario("brake_mat"), "launch", seed=1, folder=tmp_path)
    problem, agent, _ = load_run(folder)
    contexts = problem.contexts("train", 20, 1)
    best = problem.judge(agent, contexts)[0].jam.reward.mean()
    rng = np.random.default_rng(0)
    others = [problem.descend(contexts, np.tile(a, (20, 1))).jam.reward.mean() for a in rng.uniform(-1, 1, (5, 2))]
    assert best > np.median(others)


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


def test_of_two_trainings_into_one_folder_the_later_stays_whole(quick, tmp_path, monkeypatch):
    """Oracle: the settings that each wrote beside what it learned; the second begins and ends within the first."""
    inner = []
    real = Random.train.__func__

    def during(cls, problem, settings, seed, folder):
        if not inner:
            inner.append(None)
            train("random_launch", own_scenario("brake_mat"), "launch", folder=tmp_path, overwrite=True)
        agent = real(cls, problem, settings, seed, folder)
        (folder / "mine.txt").write_text(str(len(list(tmp_path.iterdir()))))
        return agent

    monkeypatch.setattr(Random, "train", classmethod(during))
    folder = train("random_launch", own_scenario("brake_mat"), "launch", folder=tmp_path)
    assert list(tmp_path.iterdir()) == [folder]
    assert {path.name for path in folder.iterdir()} == {"config.yaml", "mine.txt", "random.yaml", "record.yaml"}
    assert (folder / "mine.txt").read_text() == "2"  # the inner one's folder, and its own scratch


def test_a_run_that_was_killed_is_no_finished_run(tmp_path, capsys):
    """Oracle: a run that ships, without the file that is written last."""
    shutil.copytree(TRAINED / "sled_mat-launch-spin-critic-s0", tmp_path / "run.part")
    (tmp_path / "run.part" / "record.yaml").unlink()
    assert main([str(tmp_path / "run.part"), "--contexts", "2"]) == 2
    assert "is no finished run: it has no record.yaml" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["config.yaml", "action.yaml"])
def test_a_run_that_refers_from_place_to_place_is_refused(name, tmp_path, quick):
    """A few lines of such references stand for gigabytes."""
    folder = train("best_fixed", own_scenario("brake_mat"), "launch", folder=tmp_path)
    bomb = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 60))
    (folder / name).write_text((folder / name).read_text() + bomb)
    with pytest.raises((ValueError, GivenCodeError), match="refers to another place") as raised:
        load_run(folder)
    assert len(str(raised.value)) < 1000


def test_what_a_run_writes_it_reads(tmp_path):
    """Oracle: itself; text that looks like a number stays text, and nothing is written as a reference."""
    twice = [1.0, 1e-05]
    content = {"hash": "12e45678", "code": "0123", "list": twice, "again": twice, "none": None, "yes": "no", "i": 3}
    write_yaml(tmp_path / "one.yaml", content | {"inf": -float("inf")})
    assert read_yaml(tmp_path / "one.yaml") == content | {"inf": -float("inf")}


def test_a_place_for_numbers_is_checked_before_anything_is_judged_and_replaced_whole(tmp_path, monkeypatch, capsys):
    """Oracle: the file as it was after a disk that is full; nothing beside it."""
    name, file = "sled_mat-launch-spin-critic-s0", tmp_path / "scores.json"
    with monkeypatch.context() as patch:
        patch.setattr(sledenv.agents.evaluate, "evaluation_of", None)
        assert main([name, "--json", str(tmp_path / "no" / "scores.json")]) == 2
        assert "--json" in (told := capsys.readouterr().err)
        assert "there is no folder" in told
    few = [name, "--contexts", "2", "--json", str(file)]
    assert main(few) == 0
    before = file.read_text()
    assert json.loads(before)[0]["falls_interval"][1] > 0.0

    def full(path, *_, **__):
        with open(path, "w") as part:
            part.write("[")
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(Path, "write_text", full)
    assert main(few) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert file.read_text() == before
    assert list(tmp_path.iterdir()) == [file]


def test_tracks_made_by_hand_have_a_table_of_their_own(tmp_path, capsys):
    """Oracle: the rewards that ``evaluate`` gives."""
    name, file = "sled_rollers-descent-trim-critic-s0", tmp_path / "scores.json"
    assert main([name, "--tracks", "--contexts", "14", "--json", str(file)]) == 0
    told = capsys.readouterr().out
    score = sledenv.evaluate(name, contexts=14, tracks=True)
    assert json.loads(file.read_text())[0]["rewards"] == score.rewards.tolist()
    assert json.loads(file.read_text())[0]["tracks"] == list(score.places)
    lines = {line.split()[0]: line.split() for line in told.splitlines() if line}
    for track in score.places:
        on = np.array(score.places) == track
        mean, falls = f"{score.rewards[on].mean():.3f},", f"{score.fallen[on].mean():.1%}"
        assert lines[track] == [track, str(on.sum()), mean, falls, "fall"]
    assert main([name, "--tracks", "--shifted"]) == 2
    assert "--tracks and --shifted are contexts of two kinds" in capsys.readouterr().err
    assert main(["sled_mat-launch-spin-critic-s0", "--tracks"]) == 2
    assert "must be 'descent' for a track made by hand" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["demo", "evaluate", "train"])
def test_help_needs_no_docstrings(command, capsys):
    """Oracle: the module as python -OO has it."""
    file = Path(sledenv.agents.evaluate.__file__).with_name(f"{command}.py")
    bare = {"__name__": f"sledenv.agents.{command}", "__package__": "sledenv.agents", "__doc__": None}
    exec(compile(file.read_text(encoding="utf-8"), file, "exec", optimize=2), bare)
    assert bare["main"](["--help"]) == 0
    assert f"sledenv.agents.{command}" in capsys.readouterr().out


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
    name = "sled_mat-launch-spin-critic-s0"
    few = ["--contexts", "4"]
    assert main([str(TRAINED / name), *few]) == 0
    by_path = capsys.readouterr().out
    monkeypatch.chdir(tmp_path)
    assert main([name, *few]) == 0
    assert capsys.readouterr().out == by_path
    (tmp_path / name).mkdir()
    assert main([name]) == 2
    assert "no finished run" in capsys.readouterr().err
    assert main(["sled_mat-launch-spin-critic-s99"]) == 2
    assert "neither here nor among those that ship" in capsys.readouterr().err


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
