"""The Painlevé region against its sign on a grid, and against the literature."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sledenv.closed_forms.painleve import painleve, painleve_threshold
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import ContactLaw
from tests.bodies import rod
from tests.closed_forms.make import BODIES, OUTLINES, ROD, WHEEL


@pytest.mark.parametrize("body", (BODIES | OUTLINES).values(), ids=BODIES | OUTLINES)
@pytest.mark.parametrize("arm", [0.0, 0.01, 0.4])
def test_the_painleve_threshold_is_where_the_region_appears(body: Body, arm: float) -> None:
    """Oracle: the sign of the expression on a fine grid of orientations, over all signs of slip and spin."""
    law = ContactLaw(1e6, 0.5, 0.0, arm, 0.5 * arm)
    threshold = painleve_threshold(body, law)
    phi = np.linspace(-math.pi, math.pi, 200_001)

    def region(friction: float) -> bool:
        tried = law._replace(friction=friction)
        return any((painleve(body, tried, phi, s, w) < 0.0).any() for s in (-1, 1) for w in (-1, 1))

    if threshold == math.inf:
        assert not region(1e9)
    else:
        assert region(threshold * (1.0 + 1e-8) + 1e-8)
        assert threshold == 0.0 or not region(threshold * (1.0 - 1e-12))


@pytest.mark.parametrize("inertia", [0.01, 1.0 / 3.0, 2.0])
def test_the_painleve_threshold_of_a_rod_is_the_textbook_one(inertia: float) -> None:
    """Oracle: 2 k sqrt(k^2 + h^2) / h^2 with k^2 = J/m; 4/3 for the uniform rod of the literature."""
    k_squared = inertia / 2.0
    expected = 2.0 * math.sqrt(k_squared * (k_squared + 0.49)) / 0.49
    body = rod(2.0, 0.7, inertia)
    assert painleve_threshold(body, ContactLaw(1e6, 0.5, 0.3, 0.0)) == pytest.approx(expected, rel=1e-13)
    assert painleve_threshold(ROD, ContactLaw(1e6, 0.5, 0.3, 0.0)) == pytest.approx(4.0 / 3.0, rel=1e-13)


def test_a_wheel_has_no_painleve_region() -> None:
    assert painleve_threshold(WHEEL, ContactLaw(1e6, 0.5, 0.3, 0.05)) == math.inf
