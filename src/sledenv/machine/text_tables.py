"""Tables as text, each kind written in one place: Markdown, lines, a table that fits the terminal; quotes of CSV."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain, repeat
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table


def markdown(names: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown, of cells without ``|``; each line ends."""
    lines = [names, ["---"] * len(names), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def aligned(rows: Sequence[Sequence[str]], columns: Sequence[str], gap: str = "  ") -> list[str]:
    """Return rows as lines in which the cells of a column stand below each other.

    Parameters
    ----------
    rows : sequence of sequences of str
        All with as many cells, the names of the columns among them.
    columns : sequence of str
        Of each column the side of its cells and how wide it is at least: "<12", ">". The last is that of all others.
    gap : str
        Between two columns.
    """
    kinds = chain(columns, repeat(columns[-1]))
    # The length of kinds, which never end, is that of the cells.
    forms = [
        f"{kind[0]}{max(int(kind[1:] or 0), *map(len, cells))}"
        for cells, kind in zip(zip(*rows, strict=True), kinds, strict=False)
    ]
    return [gap.join(map(format, row, forms)).rstrip() for row in rows]


def fitted(names: Sequence[str], rows: Iterable[Sequence[str]], words: int) -> Table:
    """Return a table that is as wide as the terminal at most: the first columns are words, all others numbers."""
    from rich.table import Table  # which importing an environment does not wait for

    table = Table(box=None, pad_edge=False)
    for i, name in enumerate(names):
        table.add_column(name, justify="left" if i < words else "right")
    for row in rows:
        table.add_row(*row)
    return table


def check_quotes(line: str, number: int) -> None:
    """Raise ValueError if a quotation mark of a line of a CSV file has no other one: cells do not go over lines."""
    if line.count('"') % 2:
        raise ValueError(f"line {number} = {line.strip()!r}: a quotation mark has no other one in its line")
