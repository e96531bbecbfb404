"""The documentation site: ``make docs`` builds it from the Markdown pages and the docstrings."""

from __future__ import annotations

import inspect
import re
import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import sledenv

ROOT = Path(__file__).parents[1]

project = "sledenv"
author = "The sledenv authors"
copyright = author
version = release = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]

# The source is the whole repository, so that the links of the pages are the same here and where Git shows them.
root_doc = "docs/index"
include_patterns = ["docs/**.md", "agents/README.md", "CHANGELOG.md"]
exclude_patterns = [".*", "build", "dist", "out", "runs", "site", "reproduction", "src", "tests"]
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4
myst_dmath_allow_space = False
highlight_language = "text"

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the types are in the docstrings, with shapes and units
autosummary_generate = False
napoleon_google_docstring = False
napoleon_use_rtype = False
viewcode_line_numbers = True

# Formulae are drawn by a copy of MathJax that travels with the site, so that it needs no network.
MATHJAX = Path(find_spec("sphinx-mathjax-offline").origin).parent / "static" / "mathjax" / "tex-svg.js"

html_theme = "furo"
html_title = "sledenv"
html_static_path = ["css", str(MATHJAX)]
html_css_files = ["site.css"]
html_extra_path = ["site_root"]  # index.html, which leads to docs/index.html
html_copy_source = False
html_show_sphinx = False
mathjax_path = MATHJAX.name

_FIELD = re.compile(r"^    (\w+): [^#\n]*#:? (.*)$", re.MULTILINE)


def describe_field(app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """Give a field of a class the comment that stands beside it, with its unit."""
    if what not in ("attribute", "property") or (lines and not lines[0].startswith("Alias for field")):
        return
    owner, field = name.rsplit(".", 1)
    for kind in inspect.getmro(_find(owner)):
        if kind.__module__.startswith("sledenv"):
            comments = dict(_FIELD.findall(inspect.getsource(kind)))
            if field in comments:
                lines[:] = [comments[field].replace("*", r"\*")]
                return


def _find(path: str) -> Any:
    found: Any = sledenv
    for part in path.split(".")[1:]:
        found = getattr(found, part)
    return found


def setup(app: Any) -> dict[str, bool]:
    """Add what Sphinx lacks."""
    app.connect("autodoc-process-docstring", describe_field)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
