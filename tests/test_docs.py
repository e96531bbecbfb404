"""The pages on the code name what there is."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("src", "agents", "perf", "tests", "configs", "examples")
PAGES = ["docs/architecture.md", *(str(page.relative_to(ROOT)) for page in (ROOT / "docs" / "decisions").glob("*.md"))]


def words(text: str) -> set[str]:
    return set(re.findall(r"[A-Za-z_]\w*", text))


@pytest.fixture(scope="module")
def known() -> set[str]:
    """All words of the code, and the names of its files and folders."""
    files = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".yaml")]
    files += [ROOT / "Makefile", ROOT / "pyproject.toml"]
    here = Path(__file__)
    found = set().union(*(words(path.read_text(encoding="utf-8")) for path in files if path != here))
    return found | {part for path in files for part in words(str(path.relative_to(ROOT)))} | {"docs", "md", "id"}


@pytest.mark.parametrize("page", PAGES)
def test_a_name_in_code_font_is_a_name_of_the_code(page: str, known: set[str]) -> None:
    """Oracle: the words of the code. Blocks of text, such as the dataflow, are looked at for words with underscores."""
    text = (ROOT / page).read_text(encoding="utf-8")
    drawn = "".join(re.findall(r"^```text\n(.*?)^```", text, re.MULTILINE | re.DOTALL))
    prose = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    names = set(re.findall(r"`([A-Za-z_][\w.]*)`", prose)) | {word for word in words(drawn) if "_" in word}
    assert names
    assert sorted(name for name in names if not words(name) <= known) == []
