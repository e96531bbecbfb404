"""Write the measured tables into docs/performance.md: ``python -m perf.report`` (nothing is measured)."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Any

from perf.harness import RESULTS, load

NAMES = ("peers", "accuracy", "scaling", "env", "training", "learning", "startup", "profile")
DOCUMENT = Path(__file__).parents[1] / "docs" / "performance.md"


def _block(name: str) -> re.Pattern[str]:
    return re.compile(rf"(?<=<!-- {name}: begin -->\n).*?(?=<!-- {name}: end -->)", re.DOTALL)


def _provenance(stamp: dict[str, Any]) -> str:
    """One line on where, when and with what a result was measured."""
    return (
        f"*{stamp['date']}, commit {stamp['commit']}, {stamp['processor']}, {stamp['cores']} cores, "
        f"load {stamp['load'][2]:.2f} over the last 15 minutes, Python {stamp['python']}*"
    )


def _section(name: str) -> str:
    """Provenance and tables of one result, and a figure if there is one."""
    if not (RESULTS / f"{name}.json").exists():
        return f"Not measured yet: `make bench BENCH={name}`.\n"
    result = load(name)
    module = importlib.import_module(f"perf.{name}")
    figure = f"\n![{name}](../perf/results/{name}.png)\n" if hasattr(module, "draw") else ""
    return f"{_provenance(result['stamp'])}\n\n{module.tables(result)}\n{figure}"


def _versions() -> str:
    """Versions that all results were measured with."""
    found: dict[str, set[str]] = {}
    for name in NAMES:
        if (RESULTS / f"{name}.json").exists():
            for package, number in load(name)["stamp"]["versions"].items():
                found.setdefault(package, set()).add(number)
    return ", ".join(f"{package} {' and '.join(sorted(numbers))}" for package, numbers in found.items()) + ".\n"


def render(text: str) -> str:
    """Return the document with every generated block replaced."""
    for name in NAMES:
        section = _section(name)
        text = _block(name).sub(lambda _, section=section: section, text)  # type: ignore[misc]
    return _block("versions").sub(lambda _: _versions(), text)


def write() -> None:
    """Bring docs/performance.md up to date."""
    DOCUMENT.write_text(render(DOCUMENT.read_text()))


if __name__ == "__main__":
    write()
