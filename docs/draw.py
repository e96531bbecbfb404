"""Run the Python code of a page, which draws its pictures, in docs/images: ``python docs/draw.py docs/gallery.md``."""

from __future__ import annotations

import contextlib
import re
import sys
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import matplotlib as mpl
from PIL import Image

IMAGES = Path(__file__).parent / "images"


def blocks(page: Path, language: str = "python") -> list[str]:
    """Return the blocks of code of a page, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def run(codes: Iterable[str], known: Mapping[str, Any] = MappingProxyType({})) -> dict[str, Any]:
    """Run blocks of code in the working folder, one after the other, and return the names that are then known."""
    names = dict(known)
    for code in codes:
        exec(compile(code, "<page>", "exec", dont_inherit=True), names)
    return names


def shrink(picture: Path, to: Path) -> None:
    """Give a picture a palette, which makes it a third as large and looks the same."""
    # Median cut merges colours of few points, such as those of two markers; without k-means large areas change theirs.
    how: Any = {"method": Image.Quantize.MAXCOVERAGE, "kmeans": 1, "dither": Image.Dither.NONE}
    with Image.open(picture) as image:
        image.convert("RGB").quantize(256, **how).save(to, optimize=True)


if __name__ == "__main__":
    pages = [Path(name).resolve() for name in sys.argv[1:]]
    mpl.use("Agg")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for page in pages:
            run(blocks(page))
        for picture in Path(folder).glob("*.png"):
            shrink(picture, IMAGES / picture.name)
