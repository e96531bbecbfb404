"""A page that simulates, as a visitor sees and sets it."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path

import numpy as np

from sledenv.simulation.outcomes import Descent
from tests.browser import Browser, patient, wait_until


def written(folder: Path, page: str) -> Path:
    """A file of a page whose map is closed: it simulates 2,500 launches whenever something is changed."""
    place = folder / "page.html"
    place.write_text(patient(page).replace('"maps":true', '"maps":false'), encoding="utf-8")
    return place


def visit(page: Browser, file: Path, address: str = "") -> None:
    """Open a page anew at an address, and wait for its descent."""
    page.open(file, address)
    wait_until(page, "shown !== null && !asking")


def put(page: Browser, name: str, value: float | str) -> None:
    """Type a number, or choose a body or a context, and wait for the descent that follows."""
    page.run(
        "const field = $('number-' + arguments[0]) ?? $('chosen-' + arguments[0]); field.value = arguments[1];"
        "field.dispatchEvent(new Event('input', { bubbles: true }))",
        name,
        value,
    )
    wait_until(page, "!asking")


def problem(page: Browser) -> str:
    return str(page.run("return $('problem').textContent"))


def columns_of(page: Browser, table: str) -> dict[str, list[float]]:
    """All digits of a table of what is shown."""
    told = page.run(f"return Object.entries(shown.{table}).map(([name, column]) => [name, Array.from(column, String)])")
    return {name: [float(value) for value in column] for name, column in told}


def numbers(page: Browser, what: str) -> dict[str, float]:
    """All digits of an object of numbers."""
    told = page.run(f"return Object.entries({what}).map(([name, value]) => [name, String(value)])")
    return {name: float(value) for name, value in told}


def assert_same(page: Browser, descent: Descent) -> None:
    """The descent that is shown, and its lines of Python, have every number of one of Python."""
    for table in ("rebounds", "trajectory", "contacts"):
        found, rows = columns_of(page, table), getattr(descent, table)
        for name in set(rows.dtype.names) - {"contacts"}:
            np.testing.assert_array_equal(found[name], rows[name], err_msg=f"{table}.{name}")
    outcome = numbers(page, "shown.outcome")
    assert {name: outcome[name] for name in descent.outcome.dtype.names} == {
        name: descent.outcome[name] for name in descent.outcome.dtype.names
    }
    assert numbers(page, "shown.jam") == descent.jam._asdict()
    assert run_lines(page) == [str(descent.status), repr(float(descent.jam.reward))]


def run_lines(page: Browser) -> list[str]:
    """Text that the lines of Python print."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(page.run("return $('python').textContent"), {})
    return out.getvalue().split()


def vertices(page: Browser) -> list[tuple[float, float]]:
    return [(x, y) for x, y, _ in page.run("return verticesOf()")]


def place_of(page: Browser, x: float, y: float) -> tuple[float, float]:
    """Where a place of the slope is in the window [px]."""
    column, row = page.run(
        "const box = $('scene').getBoundingClientRect(); const [column, row] = scene.pixel(...arguments);"
        "return [box.left + column * box.width / scene.W, box.top + row * box.height / scene.H]",
        x,
        y,
    )
    return column, row


def told_launch(page: Browser) -> dict[str, float]:
    launch: dict[str, float] = json.loads(page.run("return JSON.stringify(launchOf())"))
    return launch
