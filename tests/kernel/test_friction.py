"""The box rule: the forces it selects minimise the quadratic form, and the closed statements follow from it."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sledenv.kernel import friction as box
from sledenv.kernel.friction import Bounds, Drive, Mobility
from tests.compiled import compiled
from tests.oracles import box_rule

property_of_all = settings(deadline=None, derandomize=True, max_examples=300)  # the first call compiles
Branch = tuple[int, int, int]
branch_forces, resolve = compiled(box.branch_forces), compiled(box.resolve)
SIGNS = (-1, 0, 1)
signs = st.sampled_from(SIGNS)
arms = st.floats(-1.0, 1.0)
inertias = st.floats(0.05, 1.0)
frictions = st.one_of(st.just(0.0), st.floats(0.0, 3.0))
rolling_arms = st.one_of(st.just(0.0), st.floats(0.0, 0.5))
drives = st.one_of(st.just(0.0), st.floats(-10.0, 10.0))


def matrix(inertia: float, a: float, b: float) -> np.ndarray:
    """W of physics.md, section 4, for a body of 1 kg, from Newton's laws: columns are unit F, M and N."""
    columns = []
    for force, moment, normal in np.eye(3):
        spin_rate = (-a * normal + b * force + moment) / inertia
        columns.append([force + b * spin_rate, spin_rate, normal - a * spin_rate])
    return np.array(columns).T


def choose(
    a: float,
    b: float,
    state: Branch,
    *,
    inertia: float = 0.1,
    friction: float = 0.3,
    arm: float = 0.05,
    drive_t: float = 0.0,
    drive_n: float = 0.0,
    closing: float = 2.0,
    opening: float = 1.0,
) -> Branch:
    """Branch of a body of 1 kg and 1 m whose velocities have the signs (gap rate, slip, spin)."""
    w, drive = Mobility(1.0, 1.0 / inertia, a, b), Drive(drive_t, drive_n)
    return resolve(w, drive, friction, arm, 1.0, Bounds(closing, opening), box.Branch(*state))


def breaches(w: np.ndarray, drive: np.ndarray, limits: tuple[float, ...], state: Branch, branch: Branch) -> float:
    """How much a branch breaks the laws, from numpy's solution of its three equations; inf if it is singular.

    ``limits`` are friction, rolling arm, closing and opening normal force; order of the rows and forces: F, M, N.
    """
    friction, arm, closing, opening = limits
    gap_rate, slip, spin = branch
    rows, right = [], []
    for locked, law, value, row in (
        (slip == 0, [1.0, 0.0, slip * friction], 0.0, 0),
        (spin == 0, [0.0, 1.0, spin * arm], 0.0, 1),
        (gap_rate == 0, [0.0, 0.0, 1.0], closing if gap_rate < 0 else opening, 2),
    ):
        rows.append(w[row] if locked else law)
        right.append(-drive[row] if locked else value)
    if abs(np.linalg.det(rows)) < 1e-9:
        return math.inf
    force, moment, normal = z = np.linalg.solve(rows, right)
    rate = w @ z + drive
    worst = 0.0
    if state[1] == 0:
        worst = max(worst, abs(force) - friction * normal if slip == 0 else -slip * rate[0])
    if state[2] == 0:
        worst = max(worst, abs(moment) - arm * normal if spin == 0 else -spin * rate[1])
    if state[0] == 0:
        worst = max(worst, normal - closing, opening - normal) if gap_rate == 0 else max(worst, -gap_rate * rate[2])
    return worst


@property_of_all
@given(arms, arms, inertias)
def test_rates_are_those_of_newtons_laws(a: float, b: float, inertia: float) -> None:
    """Oracle: Newton's laws for a unit force, a unit moment and a unit normal force."""
    columns = [box.rates_of(Mobility(1.0, 1.0 / inertia, a, b), Drive(0.0, 0.0), *unit) for unit in np.eye(3)]
    assert np.allclose(np.array(columns).T, matrix(inertia, a, b), rtol=1e-12, atol=1e-12)


@property_of_all
@given(arms, arms, inertias, frictions, rolling_arms, drives, signs, signs, st.sampled_from((-1, 1)))
def test_given_normal_force_the_forces_minimise_the_quadratic_form_over_the_box(
    a: float,
    b: float,
    inertia: float,
    friction: float,
    arm: float,
    drive_t: float,
    slip: int,
    spin: int,
    gap_rate: int,
) -> None:
    """Oracle: argmin z'Az/2 + k'z over |F| <= f N, |M| <= delta N by coordinate descent, moving parts pinned."""
    normal = 2.0 if gap_rate < 0 else 1.0
    w = matrix(inertia, a, b)
    pinned = (
        None if slip == 0 else -slip * friction * normal,
        None if spin == 0 else -spin * arm * normal,
    )
    bounds = (friction * normal, arm * normal)
    z, rates = box_rule(w[:2, :2], w[:2, 2] * normal + np.array([drive_t, 0.0]), bounds, pinned)
    branch = choose(a, b, (gap_rate, slip, spin), inertia=inertia, friction=friction, arm=arm, drive_t=drive_t)
    assert branch[0] == gap_rate
    for i, sign in enumerate((slip, spin)):
        if sign != 0:
            assert branch[1 + i] == sign
        elif abs(rates[i]) > 1e-6:
            assert branch[1 + i] == np.sign(rates[i])  # it leaves in the direction in which it is driven
        elif abs(z[i]) < bounds[i] - 1e-6:
            assert branch[1 + i] == 0
    w, drive = Mobility(1.0, 1.0 / inertia, a, b), Drive(drive_t, 0.0)
    force, moment, _ = branch_forces(w, drive, friction, arm, normal, False, *branch[1:])
    assert force == pytest.approx(z[0], abs=1e-6)
    assert moment == pytest.approx(z[1], abs=1e-6)


@property_of_all
@given(arms, arms, inertias, frictions, rolling_arms, drives, st.floats(-30.0, 5.0), signs, signs, signs)
def test_the_branch_breaks_no_law_if_any_branch_breaks_none(
    a: float,
    b: float,
    inertia: float,
    friction: float,
    arm: float,
    drive_t: float,
    drive_n: float,
    gap_rate: int,
    slip: int,
    spin: int,
) -> None:
    """Oracle: the laws checked one by one on numpy's solution of every branch, a resting gap included."""
    w, drive = matrix(inertia, a, b), np.array([drive_t, 0.0, drive_n])
    state = (gap_rate, slip, spin)
    limits = (friction, arm, 2.0, 1.0)
    worst = {
        branch: breaches(w, drive, limits, state, branch)
        for branch in product(*((entry,) if entry else SIGNS for entry in state))
    }
    assume(min(worst.values()) < 1e-12)
    branch = choose(a, b, state, inertia=inertia, friction=friction, arm=arm, drive_t=drive_t, drive_n=drive_n)
    assert worst[branch] < 1e-9


@property_of_all
@given(arms, arms, inertias, frictions, rolling_arms, st.sampled_from((-1, 1)))
def test_slip_sticks_iff_friction_suffices(
    a: float, b: float, inertia: float, friction: float, arm: float, spin: int
) -> None:
    """Oracle: |m b (a + delta s)/(J + m b^2)| <= f with s = sgn omega, physics.md, section 4."""
    needed = abs(b * (a + arm * spin) / (inertia + b * b))
    assume(abs(needed - friction) > 1e-9)
    branch = choose(a, b, (-1, 0, spin), inertia=inertia, friction=friction, arm=arm)
    assert (branch[1] == 0) == (needed <= friction)


@property_of_all
@given(arms, arms, inertias, frictions, rolling_arms, st.sampled_from((-1, 1)))
def test_stopped_rotation_lasts_iff_the_rolling_arm_suffices(
    a: float, b: float, inertia: float, friction: float, arm: float, slip: int
) -> None:
    """Oracle: |a + b f s| <= delta with s = sgn v_t, physics.md, section 4."""
    needed = abs(a + b * friction * slip)
    assume(abs(needed - arm) > 1e-9)
    branch = choose(a, b, (-1, slip, 0), inertia=inertia, friction=friction, arm=arm)
    assert (branch[2] == 0) == (needed <= arm)


@property_of_all
@given(arms, arms, inertias, frictions, rolling_arms)
def test_a_body_without_drive_is_stuck_iff_its_arm_is_within_the_rolling_arm(
    a: float, b: float, inertia: float, friction: float, arm: float
) -> None:
    """Oracle: |a| <= delta, physics.md, section 4."""
    assume(abs(abs(a) - arm) > 1e-9)
    branch = choose(a, b, (-1, 0, 0), inertia=inertia, friction=friction, arm=arm)
    assert (branch == (-1, 0, 0)) == (abs(a) <= arm)


@pytest.mark.parametrize("drive_n", [-9.0, -6.0, -5.01, -5.0, -4.5, -4.0, -3.9, -1.0, 3.0])
def test_a_gap_rests_iff_its_equilibrium_lies_between_the_two_stiffnesses(drive_n: float) -> None:
    """Oracle: Filippov, k- x <= N_eq <= k+ x with N_eq = -vdot_n/W_nn without friction, physics.md, section 5."""
    opening, closing, w_nn = 2.0, 2.5, 1.0 + 0.25 / 0.25  # a = 0.5, J = 0.25
    branch = choose(
        0.5,
        0.0,
        (0, 1, 1),
        inertia=0.25,
        friction=0.0,
        arm=0.0,
        drive_n=drive_n,
        closing=closing,
        opening=opening,
    )
    equilibrium = -drive_n / w_nn
    expected = 0 if opening <= equilibrium <= closing else (-1 if equilibrium > closing else 1)
    assert branch == (expected, 1, 1)


@property_of_all
@given(arms, arms, inertias, frictions, rolling_arms, drives, st.floats(-30.0, 5.0), signs, signs, signs)
def test_the_mirrored_contact_takes_the_mirrored_branch(
    a: float,
    b: float,
    inertia: float,
    friction: float,
    arm: float,
    drive_t: float,
    drive_n: float,
    gap_rate: int,
    slip: int,
    spin: int,
) -> None:
    """Oracle: mirror symmetry, x -> -x: a, slip, spin and the drive along the slope change their signs."""
    options = {"inertia": inertia, "friction": friction, "arm": arm, "drive_n": drive_n}
    branch = choose(a, b, (gap_rate, slip, spin), drive_t=drive_t, **options)
    mirrored = choose(-a, b, (gap_rate, -slip, -spin), drive_t=-drive_t, **options)
    w, drive = matrix(inertia, a, b), np.array([drive_t, 0.0, drive_n])
    equally_good = breaches(w, drive, (friction, arm, 2.0, 1.0), (gap_rate, slip, spin), branch) < 1e-9
    if equally_good:  # where no branch is admissible, the least bad one may tie with its mirror image
        assert mirrored == (branch[0], -branch[1], -branch[2])


def test_a_force_at_its_bound_locks() -> None:
    """Oracle: the closed statements hold with equality, |a| = delta, and ties go to the branch with more locks."""
    assert choose(0.25, 0.5, (-1, 0, 0), arm=0.25) == (-1, 0, 0)
    assert choose(-0.25, 0.5, (-1, 0, 0), arm=0.25) == (-1, 0, 0)
    assert choose(0.25 + 1e-9, 0.5, (-1, 0, 0), arm=0.25)[2] == -1
    assert choose(0.0, 0.5, (-1, 0, 0), friction=0.0, arm=0.0) == (-1, 0, 0)  # neither drive nor bound


def test_a_force_at_its_bound_up_to_rounding_locks() -> None:
    """Oracle: F = -drive = f N and M = a N - b F = delta N, which decimal numbers meet up to rounding alone.

    Without a tolerance the violation of a lock, some 1e-17, is beaten by a branch that slides or rotates.
    """
    rng = np.random.default_rng(0)
    for _ in range(200):
        b, friction, arm = rng.uniform(-1.0, 1.0), rng.uniform(0.05, 1.0), rng.uniform(0.05, 0.5)
        normal, side = rng.uniform(0.5, 3.0), rng.choice([-1.0, 1.0])
        drive = side * friction * normal
        a = (arm * normal - b * drive) / normal
        given_: dict[str, float] = {"friction": friction, "arm": arm, "drive_t": drive, "closing": normal}
        assert choose(a, b, (-1, 0, 0), **given_) == (-1, 0, 0)


@pytest.mark.jit_only  # plain Python refuses to divide by zero
def test_a_singular_branch_is_not_chosen() -> None:
    """Oracle: J/m + a^2 + a b f s = 0 leaves a sliding contact without normal force to rest on (Painleve).

    With a = 0.5, J = 0.25 and b f = 1 against the slip, a locked gap has no solution: the branch divides by zero. The
    others need a force that opens (2 rate = N: never) or closes the gap, and the drive closes it.
    """
    a, b, friction, inertia = 0.5, 1.0, 1.0, 0.25
    w = Mobility(1.0, 1.0 / inertia, a, b)
    singular = branch_forces(w, Drive(0.0, -9.0), friction, 0.0, 2.0, True, -1, 1)
    assert not np.isfinite(singular).all()
    branch = choose(a, b, (0, -1, 1), inertia=inertia, friction=friction, arm=0.0, drive_n=-9.0)
    assert branch == (-1, -1, 1)


def test_the_chosen_branch_does_not_depend_on_the_unit_of_force() -> None:
    """Oracle: scaling mass, forces and bounds together scales the problem."""
    for state in product(SIGNS, SIGNS, SIGNS):
        expected = choose(0.2, 0.3, state, drive_t=1.0, drive_n=-4.0)
        w = Mobility(1e-6, 1e-5, 0.2, 0.3)
        assert resolve(w, Drive(1.0, -4.0), 0.3, 0.05, 1.0, Bounds(2e6, 1e6), box.Branch(*state)) == expected
