"""Whatever a person writes into a file or on the command line: a command ends with a status, never in a traceback."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sledenv.benchmark.runs import TRAINED
from sledenv.command.cli import main
from sledenv.scenarios.configuration import CONFIGS
from sledenv.scenarios.scenario import load_scenario, scenario_names

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]

ENDED = {0, 1, 2}  # done, failed, wrong input
NUMBERS = (1e308, -1e308, 1e200, -1e160, 1e-200, 5e-324, 0.0, -0.0, 0, 1, -1, 1e9, 10**400, -(10**400))
STRANGE = (float("nan"), float("inf"), -float("inf"), True, None, "", "x", "1e5", "..", "\U0001f6f7")
NESTED = ([], [1], [2, 1], [0, 1e308], [1, 2, 3], {}, {"a": 1}, {"kind": "normal", "mean": 1e308, "sd": 1e308})
EXTREME = st.sampled_from([*NUMBERS, *STRANGE, *NESTED])
ANYTHING = EXTREME | st.floats() | st.integers() | st.text(max_size=8) | st.lists(st.floats(), max_size=3)
KEYS = st.sampled_from(["x", "kind", "mass_kg", "friction", "low", 3]) | st.text(max_size=5)


def places(content: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every place of nested mappings and lists: what holds it, and its key."""
    pairs = list(content.items()) if isinstance(content, dict) else list(enumerate(content))
    for key, value in pairs:
        yield content, key
        if isinstance(value, dict | list):
            yield from places(value)


@st.composite
def altered(draw: Callable[..., Any], originals: list[dict[str, Any]]) -> dict[str, Any]:
    """One of some mappings with one to three of its places altered, taken out or joined by another key."""
    content = copy.deepcopy(draw(st.sampled_from(originals)))
    for _ in range(draw(st.integers(1, 3))):
        known = list(places(content))
        if not known:
            break
        owner, key = known[draw(st.integers(0, len(known) - 1))]
        deed = draw(st.sampled_from(["alter", "alter", "alter", "remove", "add"]))
        if deed == "remove":
            del owner[key]
        elif deed == "add" and isinstance(owner, dict):
            owner[draw(KEYS)] = copy.deepcopy(draw(ANYTHING))
        else:
            owner[key] = copy.deepcopy(draw(ANYTHING))  # which may be altered in turn
    return content


def fuzzed(count: int) -> Callable[[Any], Any]:
    """Settings of a test: so many examples, the same ones in every run, as the other tests have them."""
    slow = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example]
    return settings(max_examples=count, derandomize=True, database=None, deadline=None, suppress_health_check=slow)


def ends(*arguments: str) -> None:
    assert main(arguments) in ENDED


def shipped(folder: str) -> list[dict[str, Any]]:
    files = sorted((CONFIGS / folder).glob("*.yaml"))
    return [yaml.safe_load(file.read_text(encoding="utf-8")) for file in files]


def short(content: dict[str, Any]) -> dict[str, Any]:
    """Limits that keep whatever can be simulated short."""
    return content | {"limits": {"max_time_s": 0.2, "max_rebounds": 3}}


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of what is written, the same one for all examples."""
    return tmp_path_factory.mktemp("fuzz")


SCENARIOS = [load_scenario(name).model_dump(mode="json", by_alias=True) for name in scenario_names()]


@fuzzed(500)
@given(content=altered(SCENARIOS), solver=st.sampled_from(["compliant", "rigid"]))
def test_scenarios(content: dict[str, Any], solver: str, scratch: Path) -> None:
    file = scratch / "scenario.yaml"
    file.write_text(yaml.safe_dump(short(content), allow_unicode=True), encoding="utf-8")
    ends("simulate", str(file), "--solver", solver, "--json")


@fuzzed(300)
@given(content=altered(shipped("studies")))
def test_studies(content: dict[str, Any], scratch: Path) -> None:
    """All of a study but its descents, which are those of a scenario, and its figures."""
    from sledenv.uncertainty import load_study
    from sledenv.uncertainty.run import draws

    file = scratch / "study.yaml"
    file.write_text(yaml.safe_dump(content, allow_unicode=True), encoding="utf-8")

    def prepared(one: Any, *given: object, **named: object) -> None:
        few = one.model_copy(update={"launches": 8})
        values = few.values(draws(few))
        few.check_bodies(values)
        few.scenes(values)
        assert one == load_study(file)
        raise ValueError("prepared")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sledenv.uncertainty.study", prepared)
        ends("study", str(file), "--out", str(scratch / "out"))


@fuzzed(200)
@given(content=altered([one | {"settings": str(CONFIGS / "agents"), "contexts": 2} for one in shipped("suites")]))
def test_suites(content: dict[str, Any], scratch: Path) -> None:
    """All of a suite up to the problem of its first job; agents are trained and judged elsewhere."""
    file = scratch / "suite.yaml"
    file.write_text(yaml.safe_dump(content, allow_unicode=True), encoding="utf-8")

    def prepared(suite: Any, *given: object, **named: object) -> None:
        next(iter(suite.jobs())).problem()
        raise ValueError("prepared")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sledenv.benchmark.runner.run_suite", prepared)
        ends("benchmark", "--suite", str(file), "--out", str(scratch / "out"))


RUN = TRAINED / "sled_mat-launch-spin-critic-s0"


@fuzzed(300)
@given(content=altered([yaml.safe_load((RUN / "config.yaml").read_text(encoding="utf-8"))]))
def test_runs(content: dict[str, Any], scratch: Path) -> None:
    """Judged by a command that ends before anything is drawn: no run of these is of the scenario asked for."""
    folder = scratch / "run"
    folder.mkdir(exist_ok=True)
    for file in RUN.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    (folder / "config.yaml").write_text(yaml.safe_dump(content, allow_unicode=True), encoding="utf-8")
    ends("map", "sled_snow", "--run", str(folder), "--out", str(scratch / "map.png"))


def recording() -> dict[str, list[Any]]:
    rng = np.random.default_rng(0)
    count = 6
    names = [f"{name}_{when}_{unit}" for when in ("before", "after") for name, unit in UNITS.items()]
    table = {name: rng.uniform(0.5, 1.0, count).tolist() for name in names}
    table["v_before_m_s"] = [-v for v in table["v_before_m_s"]]
    return table | {"a_m": [0.1, -0.1] * 3, "b_m": [0.2] * count, "recording": [0, 0, 1, 1, 2, 2]}


UNITS = {"u": "m_s", "v": "m_s", "omega": "rad_s"}
RADII = st.sampled_from(["0.2", "0.2", "0.2", "1e200", "1e-200", "nan", "0", "-1", "x"])


@fuzzed(400)
@given(content=altered([recording()]), radius=RADII, flip=st.none() | st.tuples(st.integers(0), st.integers(1, 255)))
def test_recordings(content: dict[str, Any], radius: str, flip: tuple[int, int] | None, scratch: Path) -> None:
    columns = {name: pd.Series(values if isinstance(values, list) else [values]) for name, values in content.items()}
    file = scratch / "recorded.csv"
    pd.DataFrame({name: column.astype(object) for name, column in columns.items()}).to_csv(
        file, index=False, errors="replace"
    )
    if flip and file.stat().st_size:
        whole = bytearray(file.read_bytes())
        whole[flip[0] % len(whole)] ^= flip[1]
        file.write_bytes(whole)
    ends("identify", str(file), f"--gyration-radius={radius}", "--starts", "1", "--fix", "rolling_arm=0")


COMMANDS = "simulate sensitivity scenarios replay study map identify benchmark doctor paper_impact sled_brw"
OPTIONS = "--seed --spin --speed --orientation-deg --solver --launches --fix --json --help --"
VALUES = "rigid euler 1 -1 1e400 nan 0x10 no.yaml no.csv /proc ."
WORDS = st.sampled_from([*COMMANDS.split(), *OPTIONS.split(), *VALUES.split(), ""])


@fuzzed(300)
@given(words=st.lists(WORDS | st.text(max_size=6), min_size=1, max_size=6))
def test_words_of_the_command_line(words: list[str], scratch: Path) -> None:
    """Commands that run for long by themselves are told what they must refuse."""
    if words[0] in {"benchmark", "doctor", "study", "map", "sensitivity", "replay"}:
        words = [*words, "--no-such-option"]
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(scratch)
        ends(*words)
