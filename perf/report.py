"""Write the measured tables into docs/performance.md: ``python -m perf.report`` (nothing is measured)."""

from __future__ import annotations

import importlib
import re

from perf.harness import ROOT, load
from perf.show import table

NAMES = ("peers", "env", "training", "startup")
DOCUMENT = ROOT / "docs" / "performance.md"


def _section(name: str) -> str:
    """Provenance of one result, with its tables and its figure, as far as there are any."""
    result = load(name)
    stamp = result["stamp"]
    made = (
        f"*{stamp['date']}, commit {stamp['commit']}, {stamp['processor']}, {stamp['cores']} cores, "
        f"load {stamp['load'][2]:.2f} over the last 15 minutes, Python {stamp['python']}*"
    )
    module = importlib.import_module(f"perf.{name}")
    parts = [made]
    if hasattr(module, "tables"):
        parts.append(module.tables(result))
    elif hasattr(module, "COLUMNS"):
        parts.append(table(result["rows"], module.COLUMNS))
    if hasattr(module, "draw"):
        parts.append(f"![{name}](../perf/results/{name}.png)")
    return "\n\n".join(parts) + "\n"


def _versions() -> str:
    """Versions that all results were measured with."""
    found: dict[str, set[str]] = {}
    for name in NAMES:
        for package, number in load(name)["stamp"]["versions"].items():
            found.setdefault(package, set()).add(number)
    return ", ".join(f"{package} {' and '.join(sorted(numbers))}" for package, numbers in found.items()) + ".\n"


def render(text: str) -> str:
    """Return the document with every generated block replaced."""

    def block(found: re.Match[str]) -> str:
        name = found[2]
        return found[1] + (_versions() if name == "versions" else _section(name)) + found[3]

    names = "|".join(("versions", *NAMES))
    return re.sub(rf"(<!-- ({names}): begin -->\n).*?(<!-- \2: end -->)", block, text, flags=re.DOTALL)


def write() -> None:
    """Bring docs/performance.md up to date."""
    DOCUMENT.write_text(render(DOCUMENT.read_text()))


if __name__ == "__main__":
    write()
