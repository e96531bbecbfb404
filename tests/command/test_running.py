"""How commands are run: exit status and one line for each error, JSON, progress, and what an interrupt is told as."""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
import textwrap
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
import pandas as pd
import pytest

from sledenv.command import arguments, cli, identification
from sledenv.command.arguments import POSITIVE, Count, Seeds, within
from sledenv.command.running import app, progress, run, tell, working
from sledenv.machine.blame import GivenCodeError
from sledenv.machine.shipped import shipped
from sledenv.simulation import rigid_impact, settings

HEAVY = ("llvmlite", "matplotlib", "numba", "pandas", "pydantic", "scipy")

Speed = Annotated[float, within(3.0)]
Mass = Annotated[float, POSITIVE]


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [
        (ValueError("e = 2: must be in [0, 1]"), 2, "error: e = 2: must be in [0, 1]"),
        (FileNotFoundError("there is no suite"), 2, "error: there is no suite"),
        (ImportError("pip install it"), 2, "error: pip install it"),
        (MemoryError("the rows take 1 TB"), 1, "error: the rows take 1 TB"),
        (GivenCodeError("agent mine: act raised KeyError: 3"), 1, "error: agent mine: act raised KeyError: 3"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_an_error_is_one_line_and_a_status(
    error: BaseException, status: int, message: str, capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest
) -> None:
    command = app("tool", "A tool.")

    @command.command
    def work() -> None:
        raise error

    request.addfinalizer(partial(signal.signal, signal.SIGTERM, signal.signal(signal.SIGTERM, signal.SIG_IGN)))
    assert run(command, ["work"]) == status
    assert capsys.readouterr() == ("", f"tool work: {message}\n")
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_IGN  # as before


def test_an_interrupt_that_a_library_drops_is_heeded_at_the_next_line(
    capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest
) -> None:
    """Oracle: the interrupt of a method that Python calls as it frees an object, whose errors it drops."""
    request.addfinalizer(partial(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT)))
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background may ignore it
    command = app("tool", "A tool.")

    class Freed:
        def __del__(self) -> None:
            with suppress(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)

    @command.default
    def work() -> None:
        told = progress("tool")
        told("first")
        Freed()
        told("second")

    assert run(command, []) == 130
    assert capsys.readouterr() == ("", "tool: first\ntool: interrupted\n")
    assert signal.getsignal(signal.SIGINT) == signal.default_int_handler  # as before


def test_an_error_of_the_program_itself_has_its_traceback() -> None:
    command = app("tool", "A tool.")

    @command.default
    def work() -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run(command, [])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--speed nan", 'Invalid value "nan" for --speed. Must be <= 3.0.'),
        ("--speed -3.1", 'Invalid value "-3.1" for --speed. Must be >= -3.0.'),
        ("--mass 0", 'Invalid value "0.0" for --mass. Must be >= 1e-09.'),
        ("--mass inf", 'Invalid value "inf" for --mass. Must be <= 1000000000.0.'),
        ("--count 1.5", "--count: must be an integer >= 1: '1.5'"),
        ("--seeds 0 -1", "--seeds: must be an integer >= 0: '-1'"),
        ("--seeds", "--seeds requires at least 1 element"),
        ("--sped 3", "Unknown option: --sped. Did you mean --speed?"),
        ("more", "Unused Tokens: ['more']"),
    ],
)
def test_wrong_numbers_are_told_with_option_value_and_range(
    words: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    command = app("tool", "A tool.")
    got: dict[str, Any] = {}

    @command.default
    def work(*, speed: Speed = 0.0, mass: Mass = 1.0, count: Count = 1, seeds: Seeds = ()) -> None:
        got.update(speed=speed, mass=mass, count=count, seeds=seeds)

    assert run(command, words.split()) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n"), got) == ("", 1, {})
    assert message in err
    assert run(command, ["--speed", "-3", "--mass=2e-3", "--count", "7", "--seeds", "3", "1"]) == 0
    assert got == {"speed": -3.0, "mass": 2e-3, "count": 7, "seeds": (3, 1)}


def test_json_is_standard_whatever_the_numbers_are(capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: a parser that refuses NaN and Infinity, which the standard does not have."""
    rows = np.array([(1, math.nan)], dtype=[("n", np.int64), ("x", np.float64)])
    table = pd.DataFrame({"value": [math.inf]}, pd.Index(["a"], name="parameter"))
    data = {"rows": rows, "table": table, "one": np.float64(0.1), "flag": np.bool_(True), "file": Path("a/b")}
    tell("words", data, as_json=True)
    assert json.loads(capsys.readouterr().out, parse_constant=pytest.fail) == {
        "rows": [{"n": 1, "x": None}],
        "table": [{"parameter": "a", "value": None}],
        "one": 0.1,
        "flag": True,
        "file": "a/b",
    }


def test_progress_is_shown_on_a_terminal_alone(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with working("map"):
        pass
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with working("map"):
        pass
    out, err = capsys.readouterr()
    assert out == ""
    assert "map" in err


# --- the command sledenv ----------------------------------------------------------------------------------------------


def test_words_of_the_command_are_those_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["study", "--help"]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in shipped("studies"))
    assert get_args(arguments.Solver) == get_args(settings.Solver)
    assert get_args(identification.Hypothesis) == get_args(rigid_impact.Hypothesis)


def test_help_and_a_misspelt_name_load_nothing_heavy() -> None:
    """Oracle: sys.modules of a fresh process."""
    program = f"""
    import sys
    from sledenv_cli import main
    helped = "", "--help", "--version", "simulate --help", "identify --help"
    wrong = "solve", "simulate sled_snw", "map none.yaml", "study pushof", "benchmark --suite smok", "identify none.csv"
    for words in (*helped, *wrong):
        sys.argv[1:] = words.split()
        assert main() == (2 if words in wrong else 0), words
        print("loaded", sorted(set({HEAVY}) & set(sys.modules)))
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, check=True)
    assert [line for line in done.stdout.splitlines() if line.startswith("loaded")] == ["loaded []"] * 11
    assert "Exit status: 0 done, 1 failed, 2 wrong input, 130 interrupted." in done.stdout
    assert done.stderr.startswith('sledenv: error: Unknown command "solve".')
    assert done.stderr.count("\n") == 6


@pytest.mark.parametrize("module", ["cyclopts", "pydantic"])
def test_an_interrupt_while_the_package_is_loaded_is_one_line(module: str) -> None:
    """Oracle: a process that gets SIGINT as soon as it asks for a module."""
    program = f"""
    import signal, sys
    from importlib.abc import MetaPathFinder

    class Interrupt(MetaPathFinder):
        def find_spec(self, name, path, target=None):
            if name == {module!r}:
                signal.raise_signal(signal.SIGINT)

    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.meta_path.insert(0, Interrupt())
    from sledenv_cli import main
    sys.argv = ["sledenv", "simulate", "paper_impact"]
    sys.exit(main())
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr in ("sledenv: interrupted\n", "sledenv simulate: interrupted\n")


@pytest.mark.skipif(sys.platform == "win32", reason="needs a Unix shell")
def test_a_reader_that_has_seen_enough_ends_no_command_with_a_traceback() -> None:
    command = f"{sys.executable} -m sledenv simulate paper_impact --json | true"
    assert subprocess.run(["bash", "-c", command], capture_output=True, text=True).stderr == ""


def test_words_can_be_completed(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: what the script of a shell asks for, names of scenarios and files included."""
    script = cli.command.generate_completion(shell="bash")
    assert all(word in script for word in ("simulate", "scenarios", "--orientation-deg", "compliant"))

    def offered(*words: str) -> set[str]:
        assert cli.main(["__complete", *words]) == 0
        return {line.split("\t")[0] for line in capsys.readouterr().out.splitlines()}

    monkeypatch.chdir(Path(__file__).parents[2] / "configs" / "scenarios")
    assert {"sled_mat", "sled_snow", "sled_mat.yaml"} <= offered("simulate", "sled")
    assert {"push_off"} <= offered("study", "pu")
    assert str(Path.cwd() / "paper_impact.yaml") in offered("map", str(Path.cwd() / "pa"))
