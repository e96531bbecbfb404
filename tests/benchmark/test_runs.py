"""Runs and the agents in them: what cannot be imported, trained or read is told in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from sledenv.benchmark.problem import Problem
from sledenv.benchmark.runs import TRAINED, agent_class, is_trained, load_run, read_settings, train
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
        return np.zeros((len(observations), 1), np.float32)
"""


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
        ("x = 1\nx = {}['lr']\n", "importing it raised KeyError: 'lr' ({name}.py, line 2)"),
        ("import no_such\n", "raised ModuleNotFoundError: No module named 'no_such' ({name}.py, line 1)"),
        ("def f(:\n", "importing it raised SyntaxError: invalid syntax ({name}.py, line 1)"),
        (AGENT.format(train="raise KeyError('lr')", load="pass"), "train raised KeyError: 'lr' ({name}.py, line 7)"),
        (AGENT.format(train="pass", load="raise OSError('gone')"), "load raised OSError: gone ({name}.py, line 11)"),
    ],
)
def test_an_agent_that_raises_an_error_is_told_with_the_place(
    text: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the lines of the module; a run that was not trained leaves no folder."""
    monkeypatch.syspath_prepend(tmp_path)
    name = f"clumsy_{abs(hash(text))}"
    (tmp_path / f"{name}.py").write_text(text)
    with pytest.raises(GivenCodeError) as raised:
        load_run(train(name, Problem("sled_mat"), {}, 0, tmp_path / "run"))
    assert message.format(name=name) in str(raised.value)
    assert (tmp_path / "run").exists() == ("load raised" in message)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must be a mapping of keys to values"),
        ("agent: 3", "agent = 3: must be text"),
        ("seed: -1", "seed = -1: must be a whole number in [0, inf)"),
        ("{}", "scenario: missing"),
        ("launch_noise: [0, down]", "launch_noise.1 = 'down': must be a number in [0, inf)"),
        ("agent: !!python/object/apply:os.system ['touch x']", "could not determine a constructor"),
        ("[" * 5000, "cannot be read"),
    ],
)
def test_a_configuration_that_is_none_is_told_in_one_line(
    text: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: nothing of it is executed; it counts as a run that has not been trained."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "config.yaml").write_text(text)
    with pytest.raises(ValueError, match=r"config\.yaml") as raised:
        load_run(tmp_path / "run")
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)
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
