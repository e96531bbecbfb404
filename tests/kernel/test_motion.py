"""A free body moves as what acts on it says, and within the bounds that the search for the touchdown relies on."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sledenv.kernel import motion, params
from sledenv.kernel.outline import incline_of
from sledenv.kernel.params import Incline, Slope
from sledenv.kernel.records import FLIGHT_LOSSES
from tests.compiled import compiled

incline = compiled(incline_of)
SLOPES = [Slope(angle, math.inf, gravity) for angle, gravity in ((0.3, 9.81), (-0.2, 1.6), (0.0, 9.81), (0.1, 0.0))]
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")  # where a program divides by zero and drops that
TIMES = np.linspace(0.0, 2.0, 41)


def thrown(slope: Slope, seed: int) -> Any:
    """Return some start of a flight."""
    rng = np.random.default_rng(seed)
    names = ("x", "y", "phi", "u", "v", "omega")
    start = dict(zip(names, rng.normal(0.0, 5.0, len(names)), strict=True))
    return {**incline(params.Slope(*slope[:3]))._asdict(), **start, "size": 0.5}


@pytest.mark.parametrize("slope", SLOPES)
@pytest.mark.parametrize("seed", range(5))
def test_the_path_obeys_the_accelerations(slope: Slope, seed: int) -> None:
    """Oracle: scipy's integration of them; the energy that is left."""
    hop = thrown(slope, seed)

    def rates(t: float, z: np.ndarray) -> list[float]:
        return [z[2], z[3], *motion.accelerations(Incline(*(hop[name] for name in Incline._fields)), z[2], z[3])]

    steps = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-13, "t_eval": TIMES}
    x, y, u, v = solve_ivp(rates, (0.0, TIMES[-1]), [hop["x"], hop["y"], hop["u"], hop["v"]], **steps).y
    assert np.array(motion.along(hop, TIMES)) == pytest.approx(np.array([x, u]), rel=1e-11, abs=1e-11)
    assert np.array(motion.away(hop, TIMES)) == pytest.approx(np.array([y, v]), rel=1e-11, abs=1e-11)
    assert motion.turned(hop, TIMES) == pytest.approx(hop["phi"] + hop["omega"] * TIMES)
    lost = motion.losses(None, None, TIMES)
    assert tuple(lost) == FLIGHT_LOSSES
    kept = 0.5 * (u * u + v * v) + y * hop["inward"] - x * hop["downhill"]
    assert kept + sum(lost.values()) == pytest.approx(np.full(TIMES.shape, kept[0]), rel=1e-11, abs=1e-10)


@pytest.mark.parametrize("slope", SLOPES)
@pytest.mark.parametrize("seed", range(5))
def test_the_bounds_of_the_search_hold(slope: Slope, seed: int) -> None:
    """Oracle: the accelerations along the path; what a parabola is off by over steps long and short."""
    hop = thrown(slope, seed)
    heights, speeds = motion.away(hop, TIMES)
    pulls = np.broadcast_to(motion.pull(hop, speeds), TIMES.shape)
    assert pulls == pytest.approx(
        np.broadcast_to(
            -motion.accelerations(Incline(*(hop[name] for name in Incline._fields)), 0.0, speeds)[1], TIMES.shape
        )
    )
    assert pulls.max() <= motion.most_pull(hop) + 1e-12
    for i in range(len(TIMES)):
        assert pulls[: i + 1].min() >= motion.least_pull(hop, TIMES[i]) - 1e-12
    jerk, most = motion.jerks(hop)
    assert np.diff(pulls)[0] / TIMES[1] == pytest.approx(-jerk, rel=0.2, abs=1e-9)
    assert np.abs(np.diff(pulls)).max() / TIMES[1] <= most + 1e-9
    for step in (1e-3, 0.1, 1.0):
        later, later_speed = motion.away(hop, TIMES + step)
        off = np.abs(heights + step * (speeds - 0.5 * pulls * step) - later)
        off_speed = np.abs(speeds - pulls * step - later_speed)
        errors = motion.departure(hop, step, 0.01)
        assert (off + 0.01 * off_speed).max() <= errors + 1e-12 * np.abs(later).max() + 1e-13


@pytest.mark.parametrize("seed", range(20))
def test_a_body_out_of_reach_is_looked_at_again_when_it_has_fallen_back(seed: int) -> None:
    """Oracle: the path."""
    hop = thrown(SLOPES[0], seed)
    hop["y"], hop["v"] = abs(hop["y"]) + 1.0, abs(hop["v"])
    most = motion.most_pull(hop)
    hop["in_reach"] = (hop["v"] + math.sqrt(hop["v"] ** 2 + 2.0 * most * (hop["y"] - hop["size"]))) / most
    t, height = motion.once_in_reach(hop, 0.1)
    assert t >= 0.1
    assert height >= hop["size"] - 1e-12
    assert height == pytest.approx(motion.away(hop, t)[0], abs=1e-12)
    later = hop["in_reach"] + 0.1
    assert motion.once_in_reach(hop, later) == (later, motion.away(hop, later)[0])
