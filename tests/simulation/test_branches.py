"""Branches of a batch: each goes on as the lane from which it was taken, and none changes another."""

from __future__ import annotations

import numpy as np
import pytest

import sledenv
from sledenv.simulation.ride import RideBatch

LAW = sledenv.ContactLaw.from_restitution(0.3, stiffness=1e6, friction=0.05, rolling_arm=0.001)
FLAT = sledenv.Slope(0.1, 20.0)
BUMPY = sledenv.Slope(0.1, 20.0, profile=[(3.0, 0.0), (5.0, 0.3), (7.0, 0.0)])
LAUNCHES = np.array([[0.0, 0.8, 0.1 * i, 6.0, 0.0, 0.5 * i] for i in range(3)])


@pytest.mark.parametrize("slope", [FLAT, [FLAT, BUMPY, FLAT]])
@pytest.mark.parametrize("many", [False, True])
def test_branches_are_rides_of_their_own(slope, many):
    """Oracle: the batch itself, and lanes that are launched alone with the same trims."""
    bodies = [sledenv.sled(), sledenv.disc(50.0, 0.4), sledenv.sled()]
    body = bodies if many else bodies[0]
    rides = RideBatch(body, LAW, slope, LAUNCHES, keep_rebounds=True, rotor_inertia=3.0)
    rides.hop(np.full(3, 0.2))
    before = rides.outcomes()
    chosen = np.array([2, 1, 1, 0])
    branches = rides.take(chosen)
    trims = np.array([0.1, -0.4, 0.4, 0.0])
    branches.hop(trims)
    assert np.array_equal(rides.outcomes(), before)
    for i, lane in enumerate(chosen):
        slopes = slope[lane] if isinstance(slope, list) else slope
        alone = sledenv.Ride(
            bodies[lane] if many else body, LAW, slopes, sledenv.State(*LAUNCHES[lane]), rotor_inertia=3.0
        )
        for trim in (0.2, trims[i]):
            alone.trim(trim)
            alone.hop()
        assert branches.outcomes()[i] == alone.descent().as_batch().outcomes[0]
        assert np.array_equal(
            branches.descents().rebounds[i], alone.descent().rebounds[: len(branches.descents().rebounds[i])]
        )
    branches.launch(np.array([0]), LAW, BUMPY, LAUNCHES[:1])
    assert np.array_equal(rides.outcomes(), before)
    with pytest.raises(IndexError, match="must be among 3 lanes"):
        rides.take(np.array([3]))
