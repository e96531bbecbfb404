"""Straight sides that land flat on rigid surfaces: against ever stiffer springs, and balances."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest

from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import lowest_arms, support_height
from tests.plane_cases import rock, segment, stone

COUNT = 60
LEVEL = Slope(0.0)


class Landing(NamedTuple):
    """A body that touches with a side, its ground and its launch, and the name of the side."""

    body: Body
    law: ContactLaw
    slope: Slope
    launch: State
    side: str


def flat_on(body: Body, arc: int) -> tuple[float, str]:
    """Orientation [rad] of a body that lies on the side after an arc, a place in its record; the name of the side."""
    record = body.record[0]
    return float(record["high"][arc]), body.parts[int(record["side"][arc]) - 1]


def ends(body: Body, phi: float) -> np.ndarray:
    """Arms a, b [m] of both ends of the side on which a body lies."""
    return lowest_arms(body.record, phi + np.array([-1e-9, 1e-9]))[1]


def random_landings(n: int, seed: int, spin: float) -> Iterator[Landing]:
    """Bodies that touch with a side, some of them without slip, spin, friction or rolling resistance.

    ``spin`` times the size is the largest spin over the speed; above 1 an end may move away.
    """
    rng = np.random.default_rng(seed)

    def some(value: float, share: float) -> float:
        """``value``, or exactly zero in a share of the cases."""
        return 0.0 if rng.random() < share else float(value)

    for number in range(n):
        body = (segment, stone, rock)[number % 3](rng, rng.uniform(0.1, 1.0))
        phi, side = flat_on(body, int(rng.choice(np.flatnonzero(body.record["side"][0] > 0.0))))
        law = ContactLaw.from_restitution(
            rng.uniform(0.05, 1.0),
            stiffness=body.mass,
            friction=some(rng.uniform(0.0, 1.0), 0.2),
            rolling_arm=some(rng.uniform(0.0, 0.05) * body.size, 0.3),
            corner_rolling_arm=some(rng.uniform(0.0, 0.05) * body.size, 0.5),
        )
        speed = rng.uniform(0.5, 4.0)
        u, omega = some(rng.uniform(-4.0, 4.0), 0.2), some(rng.uniform(-spin, spin) * speed / body.size, 0.5)
        if (speed + ends(body, phi)[:, 0] * omega < 0.0).all():
            omega = -omega  # so that an end approaches
        launch = State(0.0, support_height(body, phi), phi, u, -speed, omega)
        yield Landing(body, law, Slope(some(rng.uniform(-0.4, 0.4), 0.2)) if u else LEVEL, launch, side)


def rebound(landing: Landing, solver: Any = "rigid", stiffness: float = 1.0) -> np.void:
    """The first rebound; ``stiffness`` is over the mass [1/s^2]."""
    body, law, slope, launch, _ = landing
    law = law._replace(stiffness=stiffness * body.mass)
    descent = simulate(body, law, slope, launch, solver=solver, max_rebounds=1, max_time=1.0)
    assert descent.status == "log_full"
    # Two points that stick at different depths slip by their difference times the spin: that much is not booked.
    closes = 1e-12 if solver == "rigid" else 1e-6
    assert abs(descent.energy.residual) <= closes * descent.energy.turnover
    found: np.void = descent.rebounds[0]
    return found


def difference(landing: Landing, one: np.void, other: np.void) -> float:
    """Largest difference of the velocities after two rebounds, over the speed of landing."""
    u, v, omega = (abs(one[name] - other[name]) for name in ("u_after", "v_after", "omega_after"))
    return float(max(u, v, landing.body.size * omega)) / -landing.launch.v


@pytest.mark.parametrize(("spin", "seed"), [(0.5, 1), pytest.param(3.0, 7, id="one end may move away")])
def test_a_flat_landing_is_the_limit_of_stiff_springs(spin: float, seed: int) -> None:
    """Oracle: the compliant solver with ever stiffer springs, whose distance from the limit falls as c^-1/2."""
    far, near = [], []
    for landing in random_landings(COUNT, seed, spin):
        found = rebound(landing)
        assert landing.body.parts[found["feature"] - 1] == landing.side
        far.append(difference(landing, found, rebound(landing, "compliant", 1e9)))
        near.append(difference(landing, found, rebound(landing, "compliant", 1e11)))
    distance = np.array(near)
    assert distance.max() < 5e-3
    assert np.median(distance) < 5e-5
    assert distance == pytest.approx(0.1 * np.array(far), rel=0.15, abs=1e-6)


def test_impulses_and_losses_of_a_flat_landing_balance() -> None:
    """Oracle: momentum, where no time passes; the forces act between both ends, within the bounds of each."""
    for landing in random_landings(COUNT, 3, 3.0):
        body, law, _, launch, _ = landing
        found = rebound(landing)
        speed = math.hypot(launch.u, launch.v, body.size * launch.omega)
        rounding = 1e-12 * body.mass * speed
        normal, tangential, twist = (found[f"{name}_impulse"] for name in ("normal", "tangential", "rolling"))
        assert normal == pytest.approx(body.mass * (found["v_after"] - launch.v), rel=0, abs=rounding)
        assert tangential == pytest.approx(body.mass * (found["u_after"] - launch.u), rel=0, abs=rounding)
        assert abs(tangential) <= law.friction * normal + rounding
        assert abs(twist) <= max(law.rolling_arm, law.corner_rolling_arm) * normal + rounding * body.size
        arms = ends(body, launch.phi)
        turning = body.inertia * (found["omega_after"] - launch.omega) - arms[0, 1] * tangential - twist
        least, most = sorted((-normal * arms[:, 0]).tolist())
        slack = 1e-8 * body.size * normal
        assert least - slack <= turning <= most + slack
        losses = [found[f"loss_{name}"] for name in ("hysteresis", "sliding", "rolling")]
        assert min(losses) >= 0.0
        speeds = ((launch[3:], 1.0), ([found[f"{name}_after"] for name in ("u", "v", "omega")], -1.0))
        lost = sum(
            sign * 0.5 * (body.mass * (u * u + v * v) + body.inertia * omega**2) for (u, v, omega), sign in speeds
        )
        assert sum(losses) == pytest.approx(lost, rel=0, abs=1e-12 * body.mass * speed**2)


def test_a_body_without_friction_may_lose_slip_and_spin_at_once() -> None:
    """Oracle: momentum along the slope. A fall without slip: spin alone makes one, and both end at the same time."""
    rng = np.random.default_rng(6)
    for _ in range(COUNT):
        body = stone(rng, rng.uniform(0.1, 1.0))
        phi, side = flat_on(body, int(rng.choice(np.flatnonzero(body.record["side"][0] > 0.0))))
        arm = 0.15 * body.size
        law = ContactLaw.from_restitution(
            rng.uniform(0.05, 1.0), stiffness=1.0, friction=0.0, rolling_arm=arm, corner_rolling_arm=arm
        )
        found = rebound(Landing(body, law, LEVEL, State(0.0, support_height(body, phi), phi, 0.0, -3.0), side))
        assert found["u_after"] == pytest.approx(0.0, abs=1e-12)
