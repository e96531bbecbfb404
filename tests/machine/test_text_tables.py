"""Tables as text: cells below each other, whatever their lengths."""

from __future__ import annotations

import io

from rich.console import Console

from sledenv.machine.text_tables import aligned, fitted

ROWS = (("name", "value", ""), ("a", "1.5", "low"), ("longer", "-10.25", ""))


def test_lines_are_as_wide_as_the_longest_cell_of_each_column() -> None:
    assert aligned(ROWS, ("<", ">", "<")) == ["name     value", "a          1.5  low", "longer  -10.25"]


def test_columns_have_a_least_width_and_the_last_is_that_of_all_others() -> None:
    assert aligned([("a", "1", "2", "3")], ("<4", ">3"), gap="") == ["a     1  2  3"]
    assert aligned([("abcdef", "1")], ("<4", ">3"), gap=" ") == ["abcdef   1"]
    assert aligned([], ("<",)) == []


def test_a_table_fits_the_width_of_the_terminal() -> None:
    """Oracle: what rich prints at a width that the words do not have."""
    out = io.StringIO()
    Console(file=out, width=24).print(fitted(("name", "what is asked", "n"), [("ice", "Which launch?", "7")], words=2))
    lines = out.getvalue().splitlines()
    assert [line.split() for line in lines] == [["name", "what", "is", "asked", "n"], ["ice", "Which", "launch?", "7"]]
    assert len(lines[0]) == lines[0].index("n", 5) + 1 == len(lines[1]) <= 24
