"""Runs and the agents in them: what cannot be imported, trained or read is told in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import TRAINED, agent_class, is_trained, load_run, read_settings, train
from sledenv.command.cli import main
from sledenv.machine.blame import GivenCodeError

RUN = TRAINED / "sled_mat-launch-spin-critic-s0"
AGENT = """
import numpy as np

class Agent:
    @classmethod
    def train(cls, problem, settings, seed, folder):
        {train}

    @classmethod
    def load(cls, problem, folder):
        {load}

    def act(self, observations):
        return np.zeros((len(observations), {width}), np.float32)
"""


def refused(capsys: pytest.CaptureFixture[str], *arguments: str, status: int = 2) -> str:
    """Message of a command that ends with a status and prints only this line, after what it says it will do."""
    assert main(arguments) == status
    out, err = capsys.readouterr()
    *said, message = err.splitlines()
    assert out == ""
    assert [line.partition(":")[0] for line in said] == ["benchmark"] * len(said)
    return message


@pytest.mark.parametrize(
    ("module", "message"),
    [
        ("../../x", "agent '../../x': must be the name of a module"),
        ("", "agent '': must be the name of a module"),
        ("sledenv.agents.sad", "there is no such module"),
        ("sledenv.benchmark.problem", "the module has no class Agent"),
    ],
)
def test_what_is_no_agent_is_refused(module: str, message: str) -> None:
    with pytest.raises(ValueError, match="agent") as raised:
        agent_class(module)
    assert message in str(raised.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\nx = {}['lr']\n", "importing it raised KeyError: 'lr' (clumsy_{n}.py, line 2)"),
        (
            "import no_such_package\n",
            "raised ModuleNotFoundError: No module named 'no_such_package' (clumsy_{n}.py, line 1)",
        ),
        ("def f(:\n", "importing it raised SyntaxError: invalid syntax (clumsy_{n}.py, line 1)"),
    ],
)
def test_a_module_that_cannot_be_imported_is_told_with_the_place(
    text: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    name = f"clumsy_{abs(hash(text))}"
    (tmp_path / f"{name}.py").write_text(text)
    suite = {"id": "mine", "title": "Mine", "contexts": 2, "scenarios": ["sled_mat"], "agents": {"launch": {name: 1}}}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(suite))
    told = refused(capsys, "benchmark", "--suite", "mine.yaml", status=1)
    assert told.startswith(f"sledenv benchmark: error: agent {name!r}: importing it raised ")
    assert message.format(n=name.removeprefix("clumsy_")) in told
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(("method", "line"), [("train", 7), ("load", 11)])
def test_an_agent_that_raises_an_error_is_told_with_the_place(
    method: str, line: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the lines of the module above; a run that was not trained leaves no folder."""
    monkeypatch.syspath_prepend(tmp_path)
    broken = {"train": "pass", "load": "pass", "width": 1, method: "raise KeyError('lr')"}
    (tmp_path / f"mine_{method}.py").write_text(AGENT.format(**broken))
    with pytest.raises(GivenCodeError) as raised:
        load_run(train(f"mine_{method}", Problem("sled_mat"), {}, 0, tmp_path / "run"))
    assert f"{method} raised KeyError: 'lr' (mine_{method}.py, line {line})" in str(raised.value)
    assert (tmp_path / "run").exists() == (method == "load")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must be a mapping of keys to values"),
        ("agent: 3", "agent = 3: must be text"),
        ("seed: -1", "seed = -1: must be a whole number in [0, inf)"),
        ("{}", "scenario: missing"),
        ("launch_noise: [0, down]", "launch_noise.1 = 'down': must be a number in [0, inf)"),
        (
            "agent: !!python/object/apply:os.system ['touch x']",
            "could not determine a constructor",
        ),
        ("[" * 5000, "cannot be read"),
    ],
)
def test_a_configuration_that_is_none_is_told_in_one_line(
    text: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: nothing of it is executed; it counts as a run that has not been trained."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "config.yaml").write_text(text)
    told = refused(capsys, "map", "sled_mat", "--run", "run")
    assert "run/config.yaml" in told.replace("\\", "/")
    assert message in told
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    assert not is_trained("sledenv.agents.zero", Problem("sled_mat"), {}, 0, tmp_path / "run")


def test_a_run_with_a_damaged_file_is_trained_again(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Oracle: a run, whole and with one of its two files damaged."""
    problem = Problem("sled_mat")
    given: tuple[Any, ...] = "sledenv.agents.zero", problem, {}, 3, tmp_path / "run"
    train(*given)
    assert is_trained(*given)
    (tmp_path / "run" / "record.yaml").write_text("train_seconds: [1]")
    assert not is_trained(*given)
    (message,) = caplog.messages
    assert message.startswith(
        f"sledenv: training again: {tmp_path / 'run' / 'record.yaml'}: train_seconds = [1]: must be"
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has no settings for sledenv/SledLaunch-v0, only for nothing"),
        ("3: {}", "has no settings for sledenv/SledLaunch-v0, only for 3"),
        ("sledenv/SledLaunch-v0: 3", "sledenv/SledLaunch-v0 = 3: must be a mapping"),
        ("a: [", "cannot be read: while parsing"),
    ],
)
def test_settings_that_are_none_are_refused(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "sac.yaml").write_text(text)
    with pytest.raises(ValueError, match=r"sac\.yaml") as raised:
        read_settings(tmp_path, "sledenv.agents.sac", "launch")
    assert message in str(raised.value)
