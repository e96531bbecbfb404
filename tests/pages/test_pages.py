"""The pages of the documentation hold together: links, commands, the site."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

import sledenv
import sledenv.plot
from docs import draw
from sledenv.command.cli import main

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.rglob("*.md"), ROOT / "agents" / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "README.md"])
NAMES = [str(page.relative_to(ROOT)) for page in PAGES]


def anchors(page: Path) -> set[str]:
    """Anchors of a page, behind the # of a link: its headings as GitHub writes them."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = (re.sub(r"\[(.*?)\]\(.*?\)", r"\1", line) for line in re.findall(r"^#+ (.*)$", text, re.MULTILINE))
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("name", [*NAMES, "CHANGELOG.md"])
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


@pytest.mark.parametrize("name", [name for name in NAMES if draw.blocks(ROOT / name, "sh")])
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
            words = words[: words.index("|")] if "|" in words else words
            assert main([word for word in words[1:2] if not word.startswith("-")] + ["--help"]) == 0
            options = set(re.findall(r"--[a-z-]+", capsys.readouterr().out))
            assert {word for word in words if word.startswith("--")} <= options


@pytest.mark.parametrize(
    "module",
    [
        *(sledenv, sledenv.benchmark, sledenv.bodies, sledenv.closed_forms, sledenv.identification, sledenv.plot),
        *(sledenv.scenarios, sledenv.simulation, sledenv.uncertainty),
    ],
    ids=lambda module: module.__name__,
)
def test_every_public_name_is_in_the_reference(module):
    pages = "".join(page.read_text(encoding="utf-8") for page in (DOCS / "api").glob("*.md"))
    whole = f"automodule:: {module.__name__}\n" in pages
    assert whole or [name for name in module.__all__ if not re.search(rf"sledenv(\.\w+)*\.{name}\b", pages)] == []


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Folder of the site, built with warnings as errors."""
    pytest.importorskip("sphinx")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "-d", str(folder / "trees")]
    subprocess.run([*command, "-c", "docs", ".", str(folder / "site")], cwd=ROOT, check=True)
    return folder / "site"


@pytest.mark.slow
def test_the_site_has_every_page_and_needs_no_network(site):
    """The file that the folder is opened with leads to the first page."""
    pages = [site / page.relative_to(ROOT).with_suffix(".html") for page in PAGES if page != ROOT / "README.md"]
    for page in pages:
        loaded = re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="(https?:[^"]*)', page.read_text(encoding="utf-8"))
        assert loaded == []
    assert "docs/index.html" in (site / "index.html").read_text(encoding="utf-8")


_SEEN = """return [
  document.documentElement.scrollWidth - document.documentElement.clientWidth,
  [...document.images].filter(image => !image.naturalWidth).length,
  document.querySelectorAll('.math').length - document.querySelectorAll('mjx-container').length,
  document.querySelectorAll('[data-mml-node=merror]').length]"""


@pytest.mark.slow
@pytest.mark.parametrize("width", [1280, 390])
def test_pages_fit_a_desktop_and_a_phone(site, width, chromium):
    """Nothing is wider than the screen but what scrolls by itself, no picture is missing, every formula is drawn."""
    chromium.screen(width, 900)
    for page in sorted([*site.glob("docs/**/*.html"), site / "agents" / "README.html"]):
        chromium.open(page)
        until = time.monotonic() + 60.0  # MathJax draws after the page has loaded
        while (seen := chromium.run(_SEEN)) != [0, 0, 0, 0] and time.monotonic() < until:
            time.sleep(0.1)
        assert (page.name, seen) == (page.name, [0, 0, 0, 0])
