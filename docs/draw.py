"""Run the Python code of a page, which draws its pictures, in docs/images: ``python docs/draw.py docs/gallery.md``."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl

IMAGES = Path(__file__).parent / "images"


def blocks(page: Path) -> list[str]:
    """Return the blocks of Python code of a page, in order."""
    return re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def run(page: Path) -> dict[str, Any]:
    """Run the blocks of a page in the working folder and return the names that they define."""
    names: dict[str, Any] = {}
    for code in blocks(page):
        exec(code, names)
    return names


if __name__ == "__main__":
    pages = [Path(name).resolve() for name in sys.argv[1:]]
    mpl.use("Agg")
    os.chdir(IMAGES)
    for page in pages:
        run(page)
