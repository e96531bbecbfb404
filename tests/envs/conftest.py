"""Fixtures that several tests of the environments use."""

from __future__ import annotations

import pytest

import sledenv
from tests.own_scenarios import own_scenario


@pytest.fixture(autouse=True)
def _no_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


@pytest.fixture
def short_scenario() -> sledenv.scenarios.Scenario:
    """Ice_drop on a slope two or three hops long, so that thousands of episodes take seconds; one in 50 tumbles."""
    content = sledenv.load_scenario(own_scenario("ice_drop")).model_dump(mode="json")
    content["slope"]["length_m"] = 2.0
    return sledenv.scenarios.Scenario.model_validate(content)
