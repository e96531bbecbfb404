"""A point that passes a boundary of a zone where friction then throws the body up, whatever way places are rounded."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import sledenv
from sledenv.simulation.settings import Solver
from sledenv.simulation.support import support_height

BLOCK = sledenv.polygon(2.0, [(0.2, -0.1), (-0.2, -0.1), (-0.2, 0.1), (0.2, 0.1)])
LAW = sledenv.ContactLaw(1e8, 0.6, 0.0, 0.0)
SHIFTS = np.random.default_rng(11).uniform(0.1, 3.0, 12).tolist()


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
@pytest.mark.parametrize("friction", [0.4, 2.5])
def test_a_block_that_slides_off_ice_does_the_same_wherever_the_ice_ends(friction: float, solver: Solver) -> None:
    """Oracle: the slope looks the same everywhere. At f = 2.5 the block tips over the end ahead: f > l/b = 2."""
    length = 0.2  # [m] of the block ahead of its mass centre
    given: dict[str, Any] = {"solver": solver, "max_time": 1.3, "record": "trajectory"}
    ends = []
    for shift in [0.0, *SHIFTS]:
        zone = sledenv.Zone(1.0 + length + shift, math.inf, friction, 0.0)
        launch = sledenv.State(shift, support_height(BLOCK, 0.0), 0.0, 1.0)
        descent = sledenv.simulate(BLOCK, LAW, sledenv.Slope(0.1, zones=[zone]), launch, **given)
        assert str(descent.status) in ("timeout", "jammed")
        assert abs(descent.energy.residual) <= 1e-12 * descent.energy.turnover
        assert (np.abs(descent.trajectory["phi"]).max() > 1e-3) == (friction > 2.0)
        ends.append((descent.state.x - shift, *descent.state[1:]))
    np.testing.assert_allclose(ends, np.tile(ends[0], (len(ends), 1)), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_point_is_thrown_up_by_the_zone_that_it_enters(sign: float) -> None:
    """Oracle: uphill or down, the spin is the one that friction of the zone gives, and the ledger closes."""
    for shift in SHIFTS:
        edges = (1.2 + shift, 9.0) if sign > 0.0 else (-9.0, -1.2 - shift)
        launch = sledenv.State(sign * shift, support_height(BLOCK, 0.0), 0.0, sign)
        slope = sledenv.Slope(sign * 0.1, zones=[sledenv.Zone(*edges, 2.5, 0.0)])
        descent = sledenv.simulate(BLOCK, LAW, slope, launch, solver="rigid", max_time=3.0, max_rebounds=2)
        assert str(descent.status) == "log_full"
        first = descent.rebounds[0]
        assert first["omega_after"] * sign < 0.0
        assert first["loss_sliding"] > 0.0
        assert abs(descent.energy.residual) <= 1e-12 * descent.energy.turnover
