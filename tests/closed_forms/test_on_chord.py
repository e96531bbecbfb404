"""A body that lies on its chord against its forces, summed and stepped."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sledenv.closed_forms.on_chord import (
    chord_finish_time,
    chord_loads,
    chord_rests,
    chord_slide,
    chord_tipping_friction,
)
from sledenv.kernel.records import NOSE, TAIL
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import ContactLaw, Slope
from sledenv.simulation.support import arms
from tests.closed_forms.make import DISC, SHELL, SLED


@pytest.mark.parametrize("slip", [-1.0, 0.0, 1.0])
def test_the_loads_of_the_corners_balance_weight_and_friction(slip: float) -> None:
    """Oracle: sums of forces and of moments about the mass centre, from the places of the two corners."""
    for body in (SLED, SHELL):
        law, slope = ContactLaw(1e6, 0.5, 0.3, 0.01), Slope(-0.2)
        force = -body.mass * 9.81 * (math.sin(slope.angle) if slip == 0.0 else slip * 0.3 * math.cos(slope.angle))
        loads = chord_loads(body, law, slope, 5.0 * slip)
        moment = 0.0
        for normal, feature, phi in zip(loads, (TAIL, NOSE), (math.pi, -math.pi), strict=True):
            a, b = arms(body, feature, phi)
            moment += np.cross((-a, -b, 0.0), (0.5 * force, float(normal), 0.0))[2]
        assert sum(loads) == pytest.approx(body.mass * 9.81 * math.cos(slope.angle))
        assert moment == pytest.approx(0.0, abs=1e-12 * body.mass)


def test_a_body_tips_off_its_chord_where_a_corner_has_no_load_left() -> None:
    """Oracle: chord_loads, to both sides; rolling resistance of the corners shifts them."""
    law, slope = ContactLaw(1e6, 0.5, 9.0, 0.0, 0.0), Slope(0.0)
    for body in (SLED, SHELL):
        for factor in (1.0 - 1e-9, 1.0 + 1e-9):
            friction = factor * chord_tipping_friction(body, law)
            assert (min(chord_loads(body, law._replace(friction=friction), slope, 1.0)) > 0.0) == (factor < 1.0)
            assert chord_rests(body, law, Slope(math.atan(friction))) == (factor < 1.0)
        wide = chord_tipping_friction(body, law._replace(corner_rolling_arm=0.1))
        across = body.radius * math.sin(body.half_angle)
        assert wide == pytest.approx(chord_tipping_friction(body, law) * (across + 0.1) / across)
        assert not chord_rests(body, law._replace(friction=math.tan(0.1)), Slope(0.1 + 1e-9))
    inside = Body(1.0, 0.5, 0.5 * math.cos(1.0), 0.02, 1.0)  # the mass centre lies in the chord
    assert chord_tipping_friction(inside, law) == math.inf


@pytest.mark.parametrize("friction", [0.0, 0.05, 0.4])
@pytest.mark.parametrize("angle", [-0.1, 0.0, 0.2])
@pytest.mark.parametrize("speed", [-2.0, 0.0, 3.0])
def test_a_block_slides_as_its_forces_say(friction: float, angle: float, speed: float) -> None:
    """Oracle: 100,000 steps of Euler's method with the friction of each instant."""
    law, slope = ContactLaw(1e6, 0.5, friction, 0.0), Slope(angle, 5.0)
    time, steps = 4.0, 100_000
    downhill, bound = 9.81 * math.sin(angle), friction * 9.81 * math.cos(angle) * time / steps
    x, u, finish = 0.0, speed, math.inf
    for i in range(steps):
        u += downhill * time / steps
        u = math.copysign(max(abs(u) - bound, 0.0), u)
        x += u * time / steps
        if x >= slope.length and finish == math.inf:
            finish = (i + 1) * time / steps
    assert [float(value) for value in chord_slide(law, slope, speed, time)] == pytest.approx([x, u], abs=2e-3)
    if min(finish, chord_finish_time(law, slope, speed)) < 0.99 * time:
        assert chord_finish_time(law, slope, speed) == pytest.approx(finish, abs=1e-3)


def test_a_block_that_never_gets_there_takes_for_ever() -> None:
    law = ContactLaw(1e6, 0.5, 0.3, 0.0)
    assert chord_finish_time(law, Slope(0.1, 10.0), 1.0) == math.inf
    assert chord_finish_time(law, Slope(0.1, 10.0), 0.0) == math.inf
    assert chord_finish_time(law, Slope(0.4), 1.0) == math.inf
    assert chord_finish_time(law._replace(friction=0.0), Slope(0.0, 10.0), -1.0) == math.inf


def test_loads_and_slides_are_vectorised() -> None:
    law = ContactLaw(1e6, 0.5, 0.4, 0.004, 0.02)
    phi = np.linspace(-3.0, 3.0, 6).reshape(2, 3)
    assert chord_loads(SLED, law, Slope(0.1), phi)[0].shape == (2, 3)
    assert chord_slide(law, Slope(0.1), phi, np.ones((4, 1, 1)))[1].shape == (4, 2, 3)


def test_wrong_arguments_are_named() -> None:
    law = ContactLaw(1e6, 0.5, 0.4, 0.004)
    with pytest.raises(ValueError, match="no chord to lie on"):
        chord_rests(DISC, law, Slope(0.1))
    with pytest.raises(ValueError, match=r"time = -1\.0: must be in \[0, inf\) s"):
        chord_slide(law, Slope(0.1), 1.0, -1.0)
    with pytest.raises(ValueError, match="gravity = 0"):
        chord_finish_time(law, Slope(0.1, 1.0, 0.0), 1.0)
