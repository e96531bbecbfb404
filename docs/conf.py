"""The documentation site: ``make docs`` builds it from the Markdown pages and the docstrings."""

from __future__ import annotations

import functools
import hashlib
import inspect
import operator
import os
import re
import shutil
from importlib.metadata import distributions
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import Any

from docutils import nodes

import sledenv
from docs import tables
from sledenv.command.cli import main

ROOT = Path(__file__).parents[1]

project = "sledenv"
author = "The sledenv authors"
copyright = author
version = release = sledenv.__version__

# The source is the whole repository, so that the links of the pages are the same here and where Git shows them.
root_doc = "docs/index"
include_patterns = ["docs/**.md", "agents/README.md", "CHANGELOG.md", "CONTRIBUTING.md"]
exclude_patterns = [".*", "build", "dist", "jupyter_execute", "out", "runs", "site", "reproduction", "src", "tests"]
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]

# A notebook is run, in an empty folder, where its code, the package or what is installed has changed; else its results
# are those of the last build. An error in a cell, or two minutes, fail the build.
RESULTS = ROOT / ".cache" / "notebooks"
nb_execution_mode = "cache"
nb_execution_cache_path = str(RESULTS)
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True
os.environ.setdefault("OMP_NUM_THREADS", "1")  # of the notebooks: threads would wait for each other

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4
myst_dmath_allow_space = False
highlight_language = "text"

autodoc_default_options = {"exclude-members": "model_config"}  # pydantic's
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the types are in the docstrings, with shapes and units
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_preprocess_types = True
_PUBLIC = (sledenv, sledenv.bodies, sledenv.simulation, sledenv.scenarios, sledenv.benchmark, sledenv.uncertainty)
napoleon_type_aliases = {name: f"~{home.__name__}.{name}" for home in reversed(_PUBLIC) for name in home.__all__}
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

# The page to ride, in the start page: docs/browser.md. On its first slope the trained agent gets to the finish; without
# trims, and with those of the rule, the sled falls.
RIDE = "play", "sled_rollers", "--seed", "1", "--html"
PLAY = """\
```{raw} html
<p>Ride it: can you get to the finish, as the trained agent does? The simulator itself runs in this page
(<a href="ride.html">full size</a>).</p>
<iframe class="play" src="ride.html" title="A slope to ride" loading="lazy"></iframe>
```

"""

_CONTENTS: dict[tuple[Any, ...], str] = {}
_ESCAPED = str.maketrans({mark: "\\" + mark for mark in "*|`_"})
_QUOTED = re.compile(r"\$`([^`\n]+)`\$")
_PAGE = re.compile(r"docs/([\w/]+)\.md")


comments_of = functools.cache(tables.comments_of)  # which parses the module of a class


def describe_field(app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """Give a field of a class the comment that stands beside it, with its unit; leave a property its words."""
    if what == "property" and inspect.getdoc(value):
        lines[:] = inspect.getdoc(value).splitlines()  # Napoleon takes what stands before a colon for a type
    if what != "attribute" or (lines and not lines[0].startswith("Alias for field")):
        return
    owner, field = name.rsplit(".", 1)
    lines.clear()
    comments = comments_of(operator.attrgetter(owner.removeprefix("sledenv."))(sledenv))
    if field in comments:
        lines.append(comments[field].translate(_ESCAPED))


def link_pages(app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    """Make a link of a page that a docstring names."""
    lines[:] = [_PAGE.sub(r":doc:`\g<0> </docs/\1>`", line) for line in lines]


def read_page(app: Any, name: str, source: list[str]) -> None:
    """Put tables in their places, and take GitHub's quotes off inline formulae, which MyST does not know."""
    source[0] = _QUOTED.sub(r"$\1$", tables.with_tables(source[0]))


def show_play(app: Any, name: str, source: list[str]) -> None:
    """Put the page to ride above the first picture of the start page; where Git shows it, there are no pages."""
    if name == root_doc:
        above, picture, below = source[0].partition("![")
        source[0] = f"{above}{PLAY}{picture}{below}"


def write_play(app: Any, error: Exception | None) -> None:
    """Write the page to ride beside the start page."""
    if error is None and app.builder.format == "html":
        assert main([*RIDE, str(Path(app.outdir) / "docs" / "ride.html")]) == 0


def leave_formulae(app: Any, tree: nodes.document) -> None:
    """Keep Sphinx from putting displayed formulae of several lines into a split, in which no number is allowed."""
    for formula in tree.findall(nodes.math_block):
        formula["no-wrap"] = True
        formula.children = [nodes.Text(rf"\[{formula.astext()}\]")]


def forget_notebooks(app: Any) -> None:
    """Remove the results of the notebooks if they are of another state of the package or of what it is built on."""
    digest = hashlib.sha256()
    for path in sorted(path for folder in ("src", "agents", "configs") for path in (ROOT / folder).rglob("*.*")):
        if path.is_file() and path.suffix not in (".pyc", ".kernel"):
            digest.update(f"{path.relative_to(ROOT)}\n".encode() + path.read_bytes())
    digest.update("\n".join(sorted(f"{one.name} {one.version}" for one in distributions())).encode())
    stamp = RESULTS / "digest"
    if not stamp.is_file() or stamp.read_text() != digest.hexdigest():
        shutil.rmtree(RESULTS, ignore_errors=True)
        RESULTS.mkdir(parents=True)
        stamp.write_text(digest.hexdigest())


def run_notebooks(app: Any, env: Any, added: set[str], changed: set[str], removed: set[str]) -> list[str]:
    """Read the notebooks at each build: the package may have changed where they have not."""
    return [name for name in env.found_docs if name.startswith("docs/notebooks/")]


def share_contents(app: Any, name: str, template: str, context: dict[str, Any], tree: Any) -> None:
    """Draw the contents beside the listings of modules once for each folder: they are the same for all of it."""
    if name.startswith("_modules/"):
        draw, folder = context["toctree"], PurePosixPath(name).parent

        def drawn(**options: Any) -> str:
            key = folder, *sorted(options.items())
            if key not in _CONTENTS:
                _CONTENTS[key] = draw(**options)
            return _CONTENTS[key]

        context["toctree"] = drawn


def setup(app: Any) -> dict[str, bool]:
    """Add what Sphinx lacks."""
    for change in (describe_field, link_pages):
        app.connect("autodoc-process-docstring", change, priority=900)  # after Napoleon
    app.connect("builder-inited", forget_notebooks)
    app.connect("env-get-outdated", run_notebooks)
    app.connect("html-page-context", share_contents, priority=400)  # before the theme asks for it
    app.connect("source-read", read_page)
    app.connect("source-read", show_play)
    app.connect("build-finished", write_play)
    app.connect("doctree-read", leave_formulae)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
