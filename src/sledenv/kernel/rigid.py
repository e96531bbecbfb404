"""The impact in the stiff limit, exact in the normal impulse: docs/physics.md, section 4.

With the configuration frozen the velocities are linear in the normal impulse p between events (slip, spin or gap rate
reach zero, the impact ends), so the impact is a short list of phases, each in closed form.
"""

from __future__ import annotations

import math

import numpy as np

from sledenv.kernel.bounce import MOST_PHASES, driving, ending, entering, hardness, lying, passing, signs, turning
from sledenv.kernel.contact import BOTH_CORNERS, INCONSISTENT, Pair, contact
from sledenv.kernel.friction import mobility
from sledenv.kernel.geometry import arms, corner_lengths, whole_turns
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, Incline, Limits, RigidLaw
from sledenv.kernel.records import ARC, NOSE, RUNNING, STEP_BUDGET, TAIL, TUMBLED
from sledenv.kernel.state import (
    ARM_A,
    ARM_B,
    FEATURE,
    HYSTERESIS,
    IMPULSE_N,
    IMPULSE_R,
    IMPULSE_T,
    OMEGA,
    ON_CHORD,
    PHI,
    ROLLING,
    SLIDING,
    V_N,
    V_T,
)
from sledenv.kernel.trace import scalar

ENERGETIC, POISSON, NEWTON = range(3)  # what ends an impact
MOST_STRIKES = 10000  # impacts without a flight between them
MOST_CHORD_IMPACTS = 64
RESTING = -4  # status: one corner stays in contact
MOST_NORMAL = 1e9  # times the weight and the centrifugal forces

_enter, _drive, _turn, _end, _pass = (scalar(program) for program in (entering, driving, turning, ending, passing))
_harden, _lie = scalar(hardness), scalar(lying)


@kernel
def impact(
    mass: float,
    inertia: float,
    a: float,
    b: float,
    size: float,
    friction: float,
    arm: float,
    restitution: float,
    hypothesis: int,
    v_t: float,
    omega: float,
    v_n: float,
    phases: np.ndarray | None,
) -> tuple[float, float, float, float, float, float, float, float, float, int]:
    """Follow one impact from touch to separation.

    Parameters
    ----------
    mass, inertia : float
        Of the body [kg], [kg m^2].
    a, b : float
        Arms of the contact point [m].
    size : float
        Of the body [m], makes moments comparable with forces.
    friction, arm : float
        Coulomb coefficient [-] and rolling arm [m].
    restitution : float
        e [-] in [0, 1].
    hypothesis : int
        ENERGETIC (Stronge): the normal work of restitution is e^2 times that of compression. POISSON: its impulse is
        e times that of compression. NEWTON: the gap opens e times as fast as it closed.
    v_t, omega, v_n : float
        Slip [m/s], spin [rad/s] and gap rate [m/s] at touch; v_n > 0 is no impact.
    phases : ndarray of PHASE, optional
        Filled from the front.

    Returns
    -------
    tuple
        v_t, omega, v_n after; normal, tangential [N s] and rolling [N m s] impulse; losses of hysteresis, sliding and
        rolling [J]; number of phases, MOST_PHASES + 1 if they did not suffice.
    """
    w = mobility(mass, inertia, a, b)
    entry = v_n
    impulse, tangential, rolling = 0.0, 0.0, 0.0
    closed, opened, slid, rolled = 0.0, 0.0, 0.0, 0.0
    stored = 0.0  # energy that may be given back
    compressed = 0.0  # impulse at the end of the first compression, 0 before
    count = 0
    if v_n > 0.0:
        return v_t, omega, v_n, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0
    opening = 0.0
    slip, spin = 0.0, 0.0
    mu, rho, rate_t, rate_w, rate_n = 0.0, 0.0, 0.0, 0.0, 0.0
    for turn in range(2 * MOST_PHASES):
        if count == MOST_PHASES or turn == 2 * MOST_PHASES - 1:
            return v_t, omega, v_n, impulse, tangential, rolling, 0.0, slid, rolled, MOST_PHASES + 1
        if not (slip * v_t > 0.0 and spin * omega > 0.0):
            slip, spin, mu, rho = _enter(v_t, omega, friction, arm)
            if slip == 0.0 or spin == 0.0:
                slip, spin, mu, rho = signs(w, friction, arm, size, slip, spin)
            rate_t, rate_w, rate_n = _drive(slip, spin, mu, rho, *w)
        opening, over = _turn(v_n, rate_n, stored, opening)
        if over > 0.0:
            break
        end = math.inf
        if opening > 0.0:
            if v_n == 0.0 and compressed == 0.0:
                compressed = impulse
            if hypothesis == POISSON:
                end = max((1.0 + restitution) * compressed - impulse, 0.0)
            elif hypothesis == NEWTON:
                target = -restitution * entry
                if v_n >= target:
                    end = 0.0
                elif rate_n > 0.0:
                    end = (target - v_n) / rate_n
            else:
                (end,) = _end(v_n, rate_n, stored)
        start = impulse
        moving = (v_t, omega, v_n, impulse, tangential, rolling, closed, slid, rolled, stored)
        passed = _pass(*moving, slip, spin, mu, rho, rate_t, rate_w, rate_n, opening, end, restitution)
        if passed[-1] < 0.0:
            return v_t, omega, v_n, impulse, tangential, rolling, 0.0, slid, rolled, MOST_PHASES + 1
        v_t, omega, v_n, impulse, tangential, rolling, closed, slid, rolled, stored, span, work, going = passed
        if opening > 0.0:
            opened += work
        if phases is not None:  # noqa: SIM102 - numba drops a branch on this alone when it compiles
            if count < phases.shape[0]:
                phase = phases[count]
                phase["start"] = start
                phase["impulse"] = span
                phase["slip"] = int(slip)
                phase["spin"] = int(spin)
                phase["restitution"] = 1 if opening > 0.0 else 0
        if span > 0.0:
            count += 1
        if going == 0.0:
            break
    # Of an energetic impact the loss is known without the cancellation in its two works.
    squared = restitution * restitution
    hysteresis = (1.0 - squared) * closed if hypothesis == ENERGETIC else closed - opened
    return v_t, omega, v_n, impulse, tangential, rolling, hysteresis, slid, rolled, count


@kernel
def _hit(
    body: Body,
    law: RigidLaw,
    feature: int,
    a: float,
    b: float,
    restitution: float,
    state: np.ndarray,
) -> int:
    """Follow one impact of a feature, whose arms and state are given. Return the number of phases."""
    v_t, omega, v_n, p_n, p_t, p_r, hysteresis, sliding, rolling, count = impact(
        body.mass,
        body.inertia,
        a,
        b,
        body.radius + body.eccentricity,
        law.friction,
        law.rolling_arm if feature == ARC else law.corner_rolling_arm,
        restitution,
        ENERGETIC,
        state[V_T],
        state[OMEGA],
        state[V_N],
        None,
    )
    state[V_T], state[OMEGA], state[V_N] = v_t, omega, v_n
    state[IMPULSE_N] += p_n
    state[IMPULSE_T] += p_t
    state[IMPULSE_R] += p_r
    state[HYSTERESIS] += hysteresis
    state[SLIDING] += sliding
    state[ROLLING] += rolling
    return count


@kernel
def _change_corner(body: Body, old: int, new: int, state: np.ndarray) -> None:
    """Turn the contact state of one corner into that of the other."""
    local = state[PHI] - whole_turns(state[PHI])
    a, b = arms(body, old, local)
    v = state[V_N] + a * state[OMEGA]
    u = state[V_T] - b * state[OMEGA]
    a, b = arms(body, new, local)
    state[V_N] = v - a * state[OMEGA]
    state[V_T] = u + b * state[OMEGA]


@kernel
def strike_chord(body: Body, law: RigidLaw, feature: int, pressed: bool, state: np.ndarray) -> tuple[int, int]:
    """Follow the impacts of a chord that lies on the slope, one corner at a time: docs/physics.md, section 8.

    The corners are hit in turn, the faster first, with the restitution of the law. A body that still approaches after
    MOST_CHORD_IMPACTS of them, or with both corners slower than ``law.settle_speed``, lies on its chord; so does
    one that is pressed onto the slope with both corners at rest.

    Returns
    -------
    tuple of int
        TUMBLED, RUNNING (both corners leave), or RESTING where one corner stays; the corner that ``state`` is of.
    """
    for i in range(2 * MOST_CHORD_IMPACTS):
        here = state[V_N]
        other = NOSE if feature == TAIL else TAIL
        _change_corner(body, feature, other, state)
        there = state[V_N]
        slow = i >= MOST_CHORD_IMPACTS or (pressed and max(abs(here), abs(there)) < law.settle_speed)
        if (slow and min(here, there) < 0.0) or (pressed and here == 0.0 and there == 0.0):
            # What both corners have left is given up: the body lies on its chord.
            local = state[PHI] - whole_turns(state[PHI])
            a, b = arms(body, other, local)
            v = there + a * state[OMEGA]
            state[V_T] -= b * state[OMEGA]
            state[HYSTERESIS] += 0.5 * (body.inertia * state[OMEGA] ** 2 + body.mass * v * v)
            state[OMEGA], state[V_N] = 0.0, 0.0
            return TUMBLED, other
        if here <= there:
            _change_corner(body, other, feature, state)
            state[V_N] = here
        else:
            feature = other
        if state[V_N] >= 0.0:
            break
        plastic = pressed and -state[V_N] < law.settle_speed
        a, b = arms(body, feature, state[PHI] - whole_turns(state[PHI]))
        if _hit(body, law, feature, a, b, 0.0 if plastic else law.restitution, state) > MOST_PHASES:
            return STEP_BUDGET, feature
    if state[V_N] > 0.0:
        return RUNNING, feature
    return RESTING, feature


@kernel
def strike(
    body: Body,
    law: RigidLaw,
    slope: Incline,
    limits: Limits,
    state: np.ndarray,
    c: np.ndarray,
    z: np.ndarray,
    steps: int,
    trajectory: np.ndarray,
    samples: int,
) -> tuple[int, int, int]:
    """Follow a touch of rigid surfaces: an impact, and the sustained contact that it may settle into.

    An impact slower than ``law.settle_speed`` is plastic if the body is pressed onto the slope; that ends the infinite
    sequence of ever smaller bounces (docs/physics.md, section 6). Arguments and result are those of
    :func:`sledenv.kernel.contact.contact`.
    """
    size = body.radius + body.eccentricity
    gravity = slope.inward
    pair = Pair(
        math.inf,
        0.0,
        law.friction,
        law.rolling_arm,
        law.corner_rolling_arm,
        MOST_NORMAL * body.mass * (gravity + size * state[OMEGA] * state[OMEGA] + state[V_T] * state[V_T] / size),
    )
    a, b = state[ARM_A], state[ARM_B]
    for _ in range(MOST_STRIKES):
        local = state[PHI] - whole_turns(state[PHI])
        feature = int(state[FEATURE])
        if feature != ARC and _lie(local, corner_lengths(body)[1], size)[0] > 0.0:
            state[ON_CHORD] = 1.0
            state[PHI] += math.copysign(math.pi, local) - local  # flat, so that neither corner lies below the slope
            pressed = gravity - b * state[OMEGA] * state[OMEGA] > 0.0
            status, feature = strike_chord(body, law, feature, pressed, state)
            state[FEATURE] = feature
            if status != RESTING:
                return status, steps, samples
        else:
            radius = body.radius if feature == ARC else 0.0
            (restitution,) = _harden(state[OMEGA], state[V_N], b, gravity, radius, law.settle_speed, law.restitution)
            if _hit(body, law, feature, a, b, restitution, state) > MOST_PHASES:
                return STEP_BUDGET, steps, samples
            if state[V_N] > 0.0:
                return RUNNING, steps, samples
        status, steps, samples = contact(body, pair, slope, limits, state, c, z, steps, trajectory, samples)
        if status != INCONSISTENT and status != BOTH_CORNERS:
            return status, steps, samples
        a, b = arms(body, int(state[FEATURE]), state[PHI] - whole_turns(state[PHI]))
    return STEP_BUDGET, steps, samples
