"""Round crests and dips against closed forms, in the limit of stiff springs: docs/physics.md, section 12."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sledenv

G = 9.81
MASS, SMALL = 50.0, 0.3  # [kg], [m] of the disc


def bend(radius: float, sign: float) -> sledenv.Slope:
    """A crest (1) or a dip (-1) of a radius, steep enough on both sides, whose top or bottom is at x = 0."""
    half = 1.1
    far = radius * math.tan(half) / math.cos(half) + 5.0  # more than twice as long as what the arc takes of a piece
    vertex = sign * radius * (1.0 / math.cos(half) - 1.0)
    sides = [(x, vertex - sign * abs(x) * math.tan(half)) for x in (-far, 0.0, far)]
    return sledenv.Slope(0.0, profile=sides, rounding=[0.0, radius, 0.0])


def law(stiffness: float, friction: float, restitution: float = 0.3) -> sledenv.ContactLaw:
    return sledenv.ContactLaw.from_restitution(restitution, stiffness=stiffness, friction=friction, rolling_arm=0.0)


# Crests.


def leaves_at(radius: float, speed: float, stiffness: float, rolls: bool) -> float:
    """Cosine of the angle at which a disc leaves a round crest that starts on its top."""
    disc = sledenv.disc(MASS, SMALL)
    launch = sledenv.State(0.0, SMALL, 0.0, speed, 0.0, -speed / SMALL if rolls else 0.0)
    descent = sledenv.simulate(
        disc, law(stiffness, 1e3 if rolls else 0.0), bend(radius, 1.0), launch, max_rebounds=1, max_time=10.0
    )
    x, y = descent.state.x, descent.state.y + radius
    return y / math.hypot(x, y)


@pytest.mark.parametrize("rolls", [True, False], ids=["rolling", "without friction"])
@pytest.mark.parametrize(("radius", "speed"), [(3.0, 1.0), (3.0, 2.0), (10.0, 2.0), (10.0, 5.0)])
def test_a_disc_leaves_a_round_crest_where_its_weight_no_longer_turns_it(
    radius: float, speed: float, rolls: bool
) -> None:
    """Oracle: cos a = (4 + 3 q)/7 rolling, (2 + q)/3 without friction, q = v0^2/(g (rho + r)).

    The spring lets go within a part of its period, which falls as the root of the stiffness.
    """
    q = speed**2 / (G * (radius + SMALL))
    expected = (4.0 + 3.0 * q) / 7.0 if rolls else (2.0 + q) / 3.0
    for stiffness in (1e6, 1e8, 1e10):
        assert leaves_at(radius, speed, stiffness, rolls) == pytest.approx(expected, abs=20.0 / math.sqrt(stiffness))


# Dips.


def swing(radius: float, angle: float, stiffness: float, friction: float, time: float) -> sledenv.simulation.Descent:
    """A disc that is let go in a round dip at an angle from the bottom."""
    away = radius - SMALL
    launch = sledenv.State(away * math.sin(angle), radius - away * math.cos(angle), 0.0)
    return sledenv.simulate(
        sledenv.disc(MASS, SMALL),
        law(stiffness, friction, 0.05),
        bend(radius, -1.0),
        launch,
        max_time=time,
        record="trajectory",
        sample_interval=1e-3,
    )


@pytest.mark.parametrize("rolls", [True, False], ids=["rolling", "without friction"])
@pytest.mark.parametrize("radius", [1.0, 3.0, 10.0])
def test_a_disc_swings_in_a_round_dip_as_a_pendulum_does(radius: float, rolls: bool) -> None:
    """Oracle: 2 pi sqrt((rho - r)/g) for small angles, sqrt(3/2) times that rolling.

    The depth to which the disc is pressed in lengthens the pendulum, and falls as the stiffness.
    """
    angle, errors = 0.02, []
    expected = 2.0 * math.pi * math.sqrt((radius - SMALL) / G) * (math.sqrt(1.5) if rolls else 1.0)
    expected *= 1.0 + angle**2 / 16.0
    for stiffness in (1e6, 1e8):
        rows = swing(radius, angle, stiffness, 10.0 if rolls else 0.0, 1.5 * expected).trajectory
        t, x = rows["t"], rows["x"]
        k = np.flatnonzero((x[:-1] > 0.0) != (x[1:] > 0.0))
        zeros = t[k] - x[k] * (t[k + 1] - t[k]) / (x[k + 1] - x[k])
        errors.append(abs((zeros[2] - zeros[0]) / expected - 1.0))
    assert errors[0] < 5e-4
    assert errors[1] == pytest.approx(0.01 * errors[0], rel=0.01)
