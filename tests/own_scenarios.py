"""Scenarios that the tests have of their own, next to those that ship: round sleds, whose launches may be anything."""

from __future__ import annotations

from pathlib import Path

_FOLDER = Path(__file__).parent / "data" / "scenarios"


def own_scenario(name: str) -> str:
    """Return the path of a scenario of the tests."""
    file = _FOLDER / f"{name}.yaml"
    assert file.is_file(), file
    return str(file)
