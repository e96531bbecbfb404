"""The same ground as pieces and arcs and as a polyline: surveyed hills, and polylines that are cut ever finer."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable

import numpy as np
import pytest

import sledenv
from sledenv.simulation.checks import checked_descent
from sledenv.simulation.fineness import too_fine
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.support import resting_heights

SLED, DISC = sledenv.sled(), sledenv.disc(50.0, 0.3)
LENGTH = 100.0  # [m]


def ridden(
    body: sledenv.Body, slope: sledenv.Slope, stiffness: float, speed: float, record: bool = False
) -> sledenv.simulation.Descent:
    """A ride that starts at x = 0, lying on the ground, with a speed along it."""
    ahead, behind = np.asarray(slope.height_at([0.3 * body.size, -0.3 * body.size])).tolist()
    tilt = math.atan2(ahead - behind, 0.6 * body.size)
    (height,) = resting_heights(body.record, np.zeros(1), np.array([tilt]), Grounds.of((slope.vertices,))).tolist()
    law = sledenv.ContactLaw.from_restitution(0.3, stiffness=stiffness, friction=0.02, rolling_arm=0.0)
    launch = sledenv.State(0.0, height, tilt, speed * math.cos(tilt), speed * math.sin(tilt))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*too finely")
        return sledenv.simulate(
            body, law, slope, launch, max_time=60.0, max_rebounds=10000, record="trajectory" if record else "rebounds"
        )


def is_fine(body: sledenv.Body, slope: sledenv.Slope, stiffness: float) -> bool:
    """Whether a ground is cut more finely than the rule allows."""
    law, launch = sledenv.ContactLaw(stiffness, 0.0, 0.0, 0.0), sledenv.State(0.0, 1e6, 0.0)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*too finely")
        scenes = checked_descent(body, law, slope, launch, sledenv.Settings()).scenes
    return too_fine(scenes) is not None


# Surveyed hills.


# Polylines that are cut ever finer.


def gentle(seed: int) -> sledenv.Slope:
    """Hills of arcs alone, so flat that nothing leaves them."""
    rng = np.random.default_rng((9, seed))
    x = np.cumsum(rng.uniform(8.0, 14.0, 14)) - 25.0
    tilts = np.cumsum(rng.uniform(0.05, 0.12, 14) * np.where(np.arange(14) % 2, 1.0, -1.0))
    tilts -= tilts.mean()
    y = np.r_[0.0, np.cumsum(np.diff(x) * tilts[:-1])]
    return sledenv.Slope(0.12, LENGTH, profile=np.column_stack([x, y - y.min()]), rounding=math.inf)


def lost(body: sledenv.Body, stiffness: float, spacing: float, seeds: Iterable[int]) -> tuple[float, bool]:
    """Part of the speed at the end that a polyline costs more than its arcs, and whether all are fine enough."""
    parts, allowed = [], True
    for seed in seeds:
        arcs = gentle(seed)
        x = np.arange(-12.0, LENGTH + 12.0, spacing)
        line = sledenv.Slope(0.12, LENGTH, profile=np.column_stack([x, arcs.height_at(x)]))
        smooth, cut = (ridden(body, slope, stiffness, 3.0) for slope in (arcs, line))
        assert smooth.status == cut.status == "finish"
        parts.append(1.0 - math.hypot(*cut.state[3:5]) / math.hypot(*smooth.state[3:5]))
        allowed &= not is_fine(body, line, stiffness)
    return float(np.mean(parts)), allowed


@pytest.mark.jit_only
@pytest.mark.parametrize("stiffness", [1e8, 1e9, 1e10])
@pytest.mark.parametrize("body", [DISC, SLED], ids=["disc", "sled"])
def test_polylines_that_are_cut_ever_finer_come_to_their_arcs(body: sledenv.Body, stiffness: float) -> None:
    """Oracle: arcs. Each vertex costs as the square of its turn, so that a dip costs as the length of a piece."""
    spacings = (2.0, 1.0, 0.5, 0.25)
    found = [lost(body, stiffness, spacing, range(2)) for spacing in spacings]
    assert all(allowed for _, allowed in found)
    errors = np.array([error for error, _ in found])
    assert (errors[1:] < 0.65 * errors[:-1]).all()
    order = np.polyfit(np.log(spacings), np.log(errors), 1)[0]
    assert 0.85 < order < 1.5
    assert errors[-1] < 1e-3


@pytest.mark.jit_only
@pytest.mark.parametrize("body", [DISC, SLED], ids=["disc", "sled"])
def test_where_the_rule_ends_a_finer_cut_gains_nothing(body: sledenv.Body) -> None:
    """Oracle: arcs. On softer springs it costs four times as many pieces to halve what is lost, or more."""
    (coarse, allowed), (fine, too) = (lost(body, 1e6, spacing, range(2)) for spacing in (1.0, 0.125))
    assert allowed
    assert not too
    assert fine > 0.4 * coarse
