"""What several tests of the environments use."""

from __future__ import annotations

import pytest

import sledenv


@pytest.fixture
def short_scenario() -> sledenv.Scenario:
    """Ice_drop on a slope that one or two hops cross, so that thousands of episodes take seconds."""
    content = sledenv.load_scenario("ice_drop").model_dump(mode="json")
    content["slope"]["length_m"] = 1.5
    return sledenv.Scenario.model_validate(content)
