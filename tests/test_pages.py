"""The pages of the documentation hold together: links, commands, the site."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

import sledenv
import sledenv.plot
from docs import draw
from sledenv.cli import main

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.rglob("*.md"), ROOT / "agents" / "README.md", ROOT / "README.md"])
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]


def anchors(page: Path) -> set[str]:
    """What can follow the # of a link to a page: its headings as GitHub writes them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = (re.sub(r"\[(.*?)\]\(.*?\)", r"\1", line) for line in re.findall(r"^#+ (.*)$", text, re.MULTILINE))
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("name", NAMES)
def test_every_link_of_a_page_leads_somewhere(name):
    """Oracle: the files of the repository and their headings."""
    page = ROOT / name
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    wrong = []
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        path, _, anchor = link.partition("#")
        if "://" in path:
            continue
        target = (page.parent / path).resolve() if path else page
        if not target.is_file() or (anchor and anchor not in anchors(target)):
            wrong.append(link)
    assert wrong == []


def test_every_page_is_in_the_site():
    """Oracle: the tables of contents, from the first page on."""
    found, left = set(), [DOCS / "index.md"]
    while left:
        page = left.pop()
        found.add(page)
        for entries in re.findall(r"^```\{toctree\}\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S):
            files = ((page.parent / f"{entry}.md").resolve() for entry in entries.split())
            left += [file for file in files if file.is_file() and file not in found]
    assert set(DOCS.rglob("*.md")) - found == set()


@pytest.mark.parametrize("name", NAMES)
def test_the_commands_of_a_page_exist(name, capsys):
    """Oracle: the help of each sub-command, the targets of the Makefile, the modules and files of the repository."""
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    for line in "\n".join(draw.blocks(ROOT / name, "sh")).replace("\\\n", " ").splitlines():
        words = line.split("#")[0].split()
        if words[:1] == ["make"]:
            assert words[1] in targets
        elif words[:2] == ["python", "-m"] and not words[2].startswith(("venv", "rl_zoo3")):
            assert importlib.util.find_spec(words[2]) is not None
        elif words[:1] == ["python"] and words[1] != "-m":
            assert (ROOT / words[1]).is_file()
        elif words[:1] == ["sledenv"]:
            with pytest.raises(SystemExit, match="0"):
                main([words[1], "--help"])
            options = set(re.findall(r"--[a-z-]+", capsys.readouterr().out))
            assert {word for word in words if word.startswith("--")} <= options


@pytest.mark.parametrize("module", [sledenv, sledenv.plot])
def test_every_public_name_is_in_the_reference(module):
    pages = "".join(page.read_text(encoding="utf-8") for page in (DOCS / "api").glob("*.md"))
    whole = f"automodule:: {module.__name__}\n" in pages
    assert whole or [name for name in module.__all__ if not re.search(rf"{module.__name__}\.{name}\b", pages)] == []


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path):
    """Every page has a file, formulae need no network, and what a folder is opened with leads to the first page."""
    pytest.importorskip("sphinx")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "-d", str(tmp_path / "trees")]
    subprocess.run([*command, "-c", "docs", ".", str(tmp_path / "site")], cwd=ROOT, check=True)
    pages = [page.relative_to(ROOT).with_suffix(".html") for page in PAGES if page != ROOT / "README.md"]
    assert [page for page in pages if not (tmp_path / "site" / page).is_file()] == []
    physics = (tmp_path / "site/docs/physics.html").read_text(encoding="utf-8")
    assert re.findall(r'<(?:script|link)[^>]*(?:src|href)="(https?:[^"]*)', physics) == []
    assert 'src="../_static/tex-svg.js' in physics
    assert "docs/index.html" in (tmp_path / "site/index.html").read_text(encoding="utf-8")
