"""The pages on the code name what there is."""

from __future__ import annotations

import csv
import io
import re
import tokenize
from itertools import chain
from pathlib import Path

import gymnasium as gym
import pytest

from docs import tables
from sledenv.envs import DESCENT_ID, LAUNCH_ID
from sledenv.scenarios.scenario import Scenario, load_scenario, scenario_names

ROOT = Path(__file__).parents[1]
FOLDERS = ("src", "agents", "configs", "perf", "tests", "examples", "docs")
PAGES = [
    "CONTRIBUTING.md",
    "docs/architecture.md",
    *(str(page.relative_to(ROOT)) for page in (ROOT / "docs" / "decisions").glob("*.md")),
]


def words(text: str) -> set[str]:
    return set(re.findall(r"[A-Za-z_]\w*", text))


@pytest.fixture(scope="module")
def files() -> list[Path]:
    return [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".yaml")]


@pytest.fixture(scope="module")
def known(files: list[Path]) -> set[str]:
    """All names and texts of the code, without its comments and docstrings, and the names of its files."""
    found = {part for path in files for part in words(str(path.relative_to(ROOT)))}
    for path in [*files, ROOT / "Makefile", ROOT / "pyproject.toml"]:
        text = path.read_text(encoding="utf-8")
        if path.suffix != ".py":
            found |= words(text)
            continue
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.NAME or (token.type == tokenize.STRING and '"""' not in token.string):
                found |= words(token.string)
    return found


@pytest.mark.parametrize("page", PAGES)
def test_a_name_in_code_font_is_a_name_of_the_code(page: str, known: set[str], files: list[Path]) -> None:
    """Oracle: the tokens of the code and its files. Blocks of text are looked at for words with underscores."""
    text = (ROOT / page).read_text(encoding="utf-8")
    drawn = "".join(re.findall(r"^```text\n(.*?)^```", text, re.MULTILINE | re.DOTALL))
    prose = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    spans = set(re.findall(r"`([^`\n]+)`", prose))
    paths = {span for span in spans if re.fullmatch(r"[\w/]+\.(py|yaml|md)|[\w/]+/", span)}
    others = [*(ROOT / "docs").rglob("*.md"), *(ROOT / "src").rglob("*.html")]
    there = [f"/{path.relative_to(ROOT)}" for path in [*files, *others]]
    assert [path for path in sorted(paths) if not any(f"/{path}" in one for one in there)] == []
    names = {word for span in spans - paths for word in words(span)} | {word for word in words(drawn) if "_" in word}
    assert sorted(names - known) == []


def test_the_gallery_has_the_scores_of_each_scenario() -> None:
    """Oracle: the tables of suites. Both scenarios for engineers are told in words."""
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \|(.*)$", page, re.MULTILINE))
    assert sorted([*rows, "paper_impact", "skeleton_run"]) == sorted(scenario_names())
    for suite in ("launch", "rides"):
        with (ROOT / "agents" / "results" / f"{suite}.csv").open(encoding="utf-8") as file:
            for one in csv.DictReader(file):
                score = f"{float(one['reward']):.3f}, {100 * float(one['falls']):.0f}\N{NO-BREAK SPACE}%"
                assert score in rows[one["scenario"]] or one["agent"] == "best_fixed", (one["scenario"], one["agent"])


@pytest.mark.parametrize("environment", [LAUNCH_ID, DESCENT_ID])
def test_the_table_of_an_observation_has_the_names_of_its_entries(environment: str) -> None:
    """Oracle: the environment, on bumps that are rounded; the launch is that of a plane."""
    content = load_scenario("sled_rollers").model_dump(by_alias=True)
    content["slope"]["bumps"]["rounding_m"] = 0.5
    scenario = Scenario.model_validate(content) if environment == DESCENT_ID else "sled_mat"
    names = gym.make(environment, scenario=scenario).unwrapped.observation_names
    table = tables.with_tables(f"```{{observation}} {environment}\n```").splitlines()
    rows = [re.findall(r"`(\S+)`", row.split("|")[1]) for row in table[2:]]
    assert set(chain(*rows)) <= set(names)
    assert rows[0][0] == names[0]
    assert rows[-1][-1] == names[-1]


def test_make_trains_each_agent_that_ships() -> None:
    """Oracle: the folders of agents/trained."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (names,) = re.findall(r"^SCENARIOS = (.+)$", makefile, re.MULTILINE)
    trained = [(name, "critic") for name in names.split()]
    folders = [path.name.split("-") for path in (ROOT / "agents" / "trained").iterdir() if path.is_dir()]
    assert sorted(trained) == sorted((name, algo) for name, _, _, algo, _ in folders)
