"""The box rule at one contact: the closed statements of docs/physics.md, section 4, on sticking, rolling and rest."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sledenv import segment
from sledenv.kernel import mode
from sledenv.kernel.geometry import ARC_PIECE
from tests.engine import Spring, incline, new_space, pieces_of, put, record_of, touch

Signs = tuple[int, int]
choose_mode, PLANE = mode.choose, pieces_of([])
SIGNS = (-1, 0, 1)
arms = st.floats(-1.0, 1.0)
heights = st.floats(0.05, 1.0)
inertias = st.floats(0.05, 1.0)
frictions = st.one_of(st.just(0.0), st.floats(1e-3, 3.0))
rolling_arms = st.one_of(st.just(0.0), st.floats(1e-3, 0.5))


def choose(
    a: float,
    b: float,
    state: Signs,
    *,
    inertia: float = 0.1,
    friction: float = 0.3,
    arm: float = 0.05,
    downhill: float = 0.0,
    load: float = 1.0,
    mass: float = 1.0,
) -> Signs:
    """Signs of slip and spin [1 m/s, 1 rad/s] that a body goes on with, 0 where a force keeps them zero.

    Its contact point, at (-a, -b), is pressed on with the force ``load``, and a force pulls at the mass centre. Its
    orientation does not change: it is an impact.
    """
    radius = (a * a + b * b) / b
    body = record_of(segment(mass, radius, min(math.hypot(a, radius - b), radius), inertia))
    space, phi = new_space(), math.atan2(a, radius - b)
    slip, omega = map(float, state)
    put(space, (0.0, b, phi), (slip - b * omega, -1.0 + a * omega, omega))
    contact = touch(body, PLANE, space, (ARC_PIECE, 0, 0), Spring(1e-2, 1e2 * load, 0.5e2 * load, friction, arm))
    contact["gap_rate"], contact["slip"] = -1.0, slip
    space["frozen"] = 1.0
    choose_mode(body, PLANE, incline(0.0, 0.0)._replace(downhill=downhill), space)
    contacts = space["contacts"]
    return (
        0 if contact["slip_still"] else int(contact["slip_sign"]),
        0 if contacts["spin_still"] else int(contacts["spin_sign"]),
    )


@given(arms, heights, inertias, frictions, rolling_arms, st.sampled_from((-1, 1)))
def test_slip_sticks_iff_friction_suffices(
    a: float, b: float, inertia: float, friction: float, arm: float, spin: int
) -> None:
    """Oracle: |m b (a + delta s)/(J + m b^2)| <= f with s = sgn omega, physics.md, section 4."""
    needed = abs(b * (a + arm * spin) / (inertia + b * b))
    assume(abs(needed - friction) > 1e-9)
    slip, _ = choose(a, b, (0, spin), inertia=inertia, friction=friction, arm=arm)
    assert (slip == 0) == (needed <= friction)


@given(arms, heights, inertias, frictions, rolling_arms, st.sampled_from((-1, 1)))
def test_stopped_rotation_lasts_iff_the_rolling_arm_suffices(
    a: float, b: float, inertia: float, friction: float, arm: float, slip: int
) -> None:
    """Oracle: |a + b f s| <= delta with s = sgn v_t, physics.md, section 4."""
    needed = abs(a + b * friction * slip)
    assume(abs(needed - arm) > 1e-9)
    _, spin = choose(a, b, (slip, 0), inertia=inertia, friction=friction, arm=arm)
    assert (spin == 0) == (needed <= arm)


@given(arms, heights, inertias, st.floats(1e-3, 3.0), st.floats(1e-3, 0.5))
def test_a_body_without_drive_is_stuck_iff_its_arm_is_within_the_rolling_arm(
    a: float, b: float, inertia: float, friction: float, arm: float
) -> None:
    """Oracle: |a| <= delta, physics.md, section 4."""
    assume(abs(abs(a) - arm) > 1e-9)
    assert (choose(a, b, (0, 0), inertia=inertia, friction=friction, arm=arm) == (0, 0)) == (abs(a) <= arm)


def test_a_force_at_its_bound_locks() -> None:
    """Oracle: the closed statements hold with equality, |a| = delta, and ties go to the mode with more locks."""
    assert choose(0.25, 0.5, (0, 0), arm=0.25) == (0, 0)
    assert choose(-0.25, 0.5, (0, 0), arm=0.25) == (0, 0)
    assert choose(0.25 + 1e-6, 0.5, (0, 0), arm=0.25)[1] == -1


def test_a_force_at_its_bound_up_to_rounding_locks() -> None:
    """Oracle: F = -m g_t = f N and M = a N - b F = delta N, which decimal numbers meet up to rounding alone.

    Without a tolerance the violation of a lock, some 1e-17, is beaten by a mode that slides or rotates.
    """
    rng = np.random.default_rng(0)
    for _ in range(200):
        b, friction, arm = rng.uniform(0.1, 1.0), rng.uniform(0.05, 1.0), rng.uniform(0.05, 0.5)
        load, side = rng.uniform(0.5, 3.0), rng.choice([-1.0, 1.0])
        downhill = side * friction * load
        a = (arm * load - b * downhill) / load
        assert choose(a, b, (0, 0), friction=friction, arm=arm, downhill=downhill, load=load) == (0, 0)


@pytest.mark.parametrize("unit", [1e-6, 1e3])
def test_the_mode_does_not_depend_on_the_unit_of_force(unit: float) -> None:
    """Oracle: scaling mass, inertia and load together scales the problem."""
    for state in product(SIGNS, SIGNS):
        expected = choose(0.2, 0.3, state, downhill=1.0)
        assert choose(0.2, 0.3, state, downhill=1.0, mass=unit, inertia=0.1 * unit, load=unit) == expected
