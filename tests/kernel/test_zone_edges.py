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
SHIFTS = np.random.default_rng(11).uniform(0.1, 3.0, 60).tolist()


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


# Body, law, angle, zones and launch. The first two pass on short of the boundary by rounding; the last one stops on it.
ROUNDED = {
    "two ends": (
        sledenv.circular_segment(100.0, 0.5, 1.9),
        sledenv.ContactLaw(6479077.280361879, 0.6195461424951431, 0.0, 0.06765914761891713, 0.08656096563822813),
        0.5956931773861764,
        [(0.5651926561844891, 0.5652343561882639, 2.553097822575239, 0.050285351393100225, 0.0)],
        (0.0, 0.28969309812696203, math.pi, -5.565266555994556, -0.7536207014021139, -7.830568853779657),
    ),
    "rolling": (
        sledenv.disc(3.0, 0.5, 0.2, 0.3),
        sledenv.ContactLaw(23672102.835185297, 0.2, 1.5745715241842086, 0.009090814255250134, 0.13872897945665955),
        0.21475015657741142,
        [(0.625232837629327, 0.6269365608428714, 0.0, 0.03740100966829636, 0.025755824904943752)],
        (0.0, 0.6773815785124391, -2.661404220514121, 0.7419502292403987, -0.47198343501032824, 2.431450572425938),
    ),
    "stopped": (
        sledenv.polygon(2.0, [(0.5, -0.2), (-0.4, -0.2), (-0.3, 0.3), (0.4, 0.2)]),
        sledenv.ContactLaw(133750.47153122604, 0.2, 0.5775235178709274, 0.013652619710510013, 0.0),
        0.6913025700778879,
        [
            (0.28074923131907276, 0.5349022548421083, 0.2883340945234957, 0.019098844670218062, 0.0),
            (0.5349022548421083, 1.0465022828272674, 0.033911728714331076, 0.005803582748266148, 0.0),
            (1.0465022828272674, 1.395657368103541, 0.03900865469836384, 0.0, 0.0),
            (1.395657368103541, 2.2567821332407307, 2.8787556064398108, 0.01790871011299975, 0.0),
        ],
        (0.0, 0.2833333333333334, math.pi, -3.1543559706455677, -0.342926920871181, -1.523427293526432),
    ),
}


@pytest.mark.jit_only
@pytest.mark.parametrize("name", ROUNDED)
def test_a_place_rounded_to_the_other_side_of_a_boundary_does_not_hold_the_body_there(name: str) -> None:
    """Oracle: conservation, and time goes on; each of these once took the friction of the zone that it had left."""
    body, law, angle, zones, launch = ROUNDED[name]
    slope = sledenv.Slope(angle, zones=[sledenv.Zone(*zone) for zone in zones])
    descent = sledenv.simulate(body, law, slope, sledenv.State(*launch), solver="rigid", max_time=3.0, max_rebounds=200)
    assert str(descent.status) in ("timeout", "jammed", "log_full")
    assert abs(descent.energy.residual) <= 1e-12 * descent.energy.turnover


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
