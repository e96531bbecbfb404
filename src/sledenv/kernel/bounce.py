"""What a hop of rigid bodies consists of, as straight-line programs, and packs of flights that run them side by side.

A hop is ordinary if the impact that ends the flight lets the body go. :func:`bounce` follows such hops of a whole pack.
What it finds to be something else it leaves where it was, for :mod:`sledenv.kernel.rigid`, which runs these programs.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.kernel.flight import (
    F_ACROSS,
    F_ALONG,
    F_DOWNHILL,
    F_ECCENTRICITY,
    F_GRAVITY,
    F_HALF_ANGLE,
    F_HORIZON,
    F_OMEGA,
    F_PHI,
    F_RADIUS,
    F_ROWS,
    F_TIME,
    F_TOP,
    F_V,
    F_Y,
    arrival,
    finish,
    tell_body,
    touchdown_times,
)
from sledenv.kernel.friction import branch_forces, rates_of, resolve
from sledenv.kernel.geometry import has_corners, without_turns
from sledenv.kernel.jit import allocating, kernel
from sledenv.kernel.params import Body
from sledenv.kernel.records import ARC
from sledenv.kernel.rows import table
from sledenv.kernel.trace import LANES, absolute, larger, less, not_more, packed, root, sine_cosine, smaller, where

MOST_PHASES = 32
TOGETHER = 4e-16
FLAT = 1e-12  # of the size of the body: a corner this close to the slope counts as touching

# Rows of a pack, behind those of its flights.
(
    B_T,  # the rest of the state at the start of the flight
    B_X,
    B_U,
    B_HYSTERESIS,  # [J] losses of the descent
    B_SLIDING,
    B_ROLLING,
    B_REBOUNDS,
    B_LENGTH,  # [m] of the slope
    B_MAX_TIME,  # [s]
    B_PER_MASS,  # of the body
    B_PER_INERTIA,
    B_FRICTION,  # of the law
    B_ARM,
    B_CORNER_ARM,
    B_RESTITUTION,
    B_SETTLE_SPEED,
    L_T,  # state at the touchdown
    L_X,
    L_PHI,
    L_U,
    L_V,
    L_OMEGA,
    L_FEATURE,
    L_A,
    L_B,
    L_V_T,
    L_V_N,
    I_GOING,  # 1 during the impact, 0 when it has ended, -1 where there is none
    I_V_T,  # state during the impact, and after it
    I_OMEGA,
    I_V_N,
    I_IMPULSE,
    I_TANGENTIAL,
    I_ROLLING,
    I_CLOSED,  # [J] work of compression
    I_SLID,  # [J] losses
    I_ROLLED,
    I_STORED,  # [J] what may be given back
    I_OPENING,  # 1 if the gap opens
    I_SLIP,  # signs of the branch that is followed, 0 where it is locked
    I_SPIN,
    I_MU,  # tangential force and moment over the normal one
    I_RHO,
    I_ARM,  # [m] rolling arm of the feature
    I_RESTITUTION,  # 0 where the impact is plastic
    I_HYSTERESIS,  # [J] loss
    I_FINE,  # 1 if the hop was ordinary
) = range(F_ROWS, F_ROWS + 47)
B_ROWS = F_ROWS + 47


def _zero(a: Any) -> Any:
    return not_more(a, 0.0) & not_more(0.0, a)


def _sign(a: Any) -> Any:
    return where(less(0.0, a), 1.0, where(less(a, 0.0), -1.0, 0.0))


def hardness(omega: Any, v_n: Any, b: Any, gravity: Any, radius: Any, settle_speed: Any, restitution: Any) -> Any:
    """Program of the restitution of a touch: none of a slow one that is pressed onto the slope."""
    pressed = less(0.0, gravity + (radius - b) * omega * omega)
    return (where(pressed & less(-v_n, settle_speed), 0.0, restitution),)


def lying(phi: Any, across: Any, size: Any) -> Any:
    """Program of whether the other corner touches as well."""
    sine, _ = sine_cosine(phi)
    return (where(not_more(2.0 * across * absolute(sine), FLAT * size), 1.0, 0.0),)


def entering(v_t: Any, omega: Any, friction: Any, arm: Any) -> Any:
    """Program of the signs of slip and spin, and of the forces that they bring, over the normal one."""
    slip, spin = _sign(v_t), _sign(omega)
    return slip, spin, -slip * friction, -spin * arm


def driving(
    slip: Any, spin: Any, mu: Any, rho: Any, per_mass: Any, per_inertia: Any, a: Any, b: Any
) -> tuple[Any, Any, Any]:
    """Program of the rates of (v_t, omega, v_n) in the normal impulse: docs/physics.md, section 4."""
    rate_t, rate_w, rate_n = rates_of((per_mass, per_inertia, a, b), 0.0, 0.0, mu, rho, 1.0)
    return where(_zero(slip), 0.0, rate_t), where(_zero(spin), 0.0, rate_w), rate_n


def turning(v_n: Any, rate_n: Any, stored: Any, opening: Any) -> tuple[Any, Any]:
    """Program of whether the gap opens, and of whether the impact is over."""
    at_rest, opens = _zero(v_n), less(0.0, rate_n)
    # It neither approaches nor has anything to give back.
    over = at_rest & (_zero(rate_n) | (opens & not_more(stored, 0.0)))
    return where(at_rest, where(opens, 1.0, 0.0), opening), where(over, 1.0, 0.0)


def ending(v_n: Any, rate_n: Any, stored: Any) -> Any:
    """Program of the normal impulse after which an energetic impact has given back what is stored; inf if never."""
    speed = v_n + root(v_n * v_n + 2.0 * rate_n * stored)
    return (where(less(0.0, speed), 2.0 * stored / speed, math.inf),)


def passing(
    v_t: Any,
    omega: Any,
    v_n: Any,
    impulse: Any,
    tangential: Any,
    rolling: Any,
    closed: Any,
    slid: Any,
    rolled: Any,
    stored: Any,
    slip: Any,
    spin: Any,
    mu: Any,
    rho: Any,
    rate_t: Any,
    rate_w: Any,
    rate_n: Any,
    opening: Any,
    end: Any,
    restitution: Any,
) -> Any:
    """Program of a phase of an impact, up to the first event on the way, of which ``end`` is one."""
    span_t = where(less(slip * rate_t, 0.0) & ~_zero(v_t), -v_t / rate_t, math.inf)
    span_w = where(less(spin * rate_w, 0.0) & ~_zero(omega), -omega / rate_w, math.inf)
    span_n = where(less(v_n * rate_n, 0.0), -v_n / rate_n, math.inf)
    sliding, before = smaller(span_t, span_w), smaller(span_n, end)
    span = smaller(sliding, before)
    # Of events at once the end counts, then slip and spin that stop.
    ends = not_more(end, span)
    turns = less(span_n, sliding) & ~ends
    stops = less(span_w, span_t) & ~turns & ~ends
    sticks = ~stops & ~turns & ~ends
    slip_then, spin_then = where(sticks, 0.0, v_t + rate_t * span), where(stops, 0.0, omega + rate_w * span)
    # Slip and spin that stop together: rounding must not leave a rest of the later one.
    slip_then = where(not_more(absolute(slip_then), TOGETHER * absolute(v_t)), 0.0, slip_then)
    spin_then = where(not_more(absolute(spin_then), TOGETHER * absolute(omega)), 0.0, spin_then)
    rate_then = where(turns, 0.0, v_n + rate_n * span)
    work = 0.5 * (v_n + rate_then) * span
    returning = less(0.0, opening)
    spent = where(returning, work, restitution * restitution * work)
    return (
        slip_then,
        spin_then,
        rate_then,
        impulse + span,
        tangential + mu * span,
        rolling + rho * span,
        where(returning, closed, closed - work),
        slid - 0.5 * mu * (v_t + slip_then) * span,
        rolled - 0.5 * rho * (omega + spin_then) * span,
        where(ends, 0.0, larger(stored - spent, 0.0)),
        span,
        work,
        where(less(span, math.inf), where(ends, 0.0, 1.0), -1.0),
    )


def _landing(corners: bool) -> Any:
    """Return the program of the first part of a hop: flight, touch, and how the impact begins."""
    arrive = arrival(corners)

    def land(
        touchdown: Any,
        t: Any,
        x: Any,
        y: Any,
        phi: Any,
        u: Any,
        v: Any,
        omega: Any,
        downhill: Any,
        gravity: Any,
        horizon: Any,
        length: Any,
        radius: Any,
        eccentricity: Any,
        half_angle: Any,
        along: Any,
        across: Any,
        size: Any,
        friction: Any,
        arm: Any,
        corner_arm: Any,
        restitution: Any,
        settle_speed: Any,
    ) -> Any:
        (finished,) = finish(x, u, downhill, length)
        lands = ~not_more(finished, touchdown) & not_more(touchdown, horizon) & less(touchdown, math.inf)
        shape = (radius, eccentricity, half_angle, along, across)
        there = arrive(touchdown, t, x, y, phi, u, v, omega, downhill, gravity, *shape)
        t, x, _, phi, u, v, feature, a, b, v_n, v_t = there
        curved = radius
        if corners:
            on_arc = not_more(feature, ARC)
            (flat,) = lying(without_turns(phi), across, size)
            lands = lands & (on_arc | not_more(flat, 0.0))
            curved, arm = where(on_arc, radius, 0.0), where(on_arc, arm, corner_arm)
        (restitution,) = hardness(omega, v_n, b, gravity, curved, settle_speed, restitution)
        signs = entering(v_t, omega, friction, arm)
        # A gap that opens already is no impact.
        going = where(lands, where(less(0.0, v_n), 0.0, 1.0), -1.0)
        began = (v_t, omega, v_n, *([0.0] * 8), *signs)
        return t, x, phi, u, v, omega, feature, a, b, v_t, v_n, going, *began, arm, restitution

    return land


def _phase(
    going: Any,
    v_t: Any,
    omega: Any,
    v_n: Any,
    impulse: Any,
    tangential: Any,
    rolling: Any,
    closed: Any,
    slid: Any,
    rolled: Any,
    stored: Any,
    opening: Any,
    slip: Any,
    spin: Any,
    mu: Any,
    rho: Any,
    per_mass: Any,
    per_inertia: Any,
    a: Any,
    b: Any,
    friction: Any,
    arm: Any,
    restitution: Any,
) -> Any:
    """Program of a phase of an energetic impact, where one is going on."""
    rate_t, rate_w, rate_n = driving(slip, spin, mu, rho, per_mass, per_inertia, a, b)
    opens, over = turning(v_n, rate_n, stored, opening)
    (end,) = ending(v_n, rate_n, stored)
    end = where(less(0.0, opens), end, math.inf)
    moving = (v_t, omega, v_n, impulse, tangential, rolling, closed, slid, rolled, stored)
    rates = (rate_t, rate_w, rate_n)
    *passed, _, _, then = passing(*moving, slip, spin, mu, rho, *rates, opens, end, restitution)
    signs = entering(passed[0], passed[1], friction, arm)
    on = less(0.0, going) & not_more(over, 0.0)
    before, after = (*moving, opening, slip, spin, mu, rho), (*passed, opens, *signs)
    moved = [where(on, new, old) for new, old in zip(after, before, strict=True)]
    return where(on, then, where(less(0.0, going), 0.0, going)), *moved


def _leaving(
    going: Any,
    t: Any,
    x: Any,
    phi: Any,
    a: Any,
    b: Any,
    v_t: Any,
    omega: Any,
    v_n: Any,
    closed: Any,
    slid: Any,
    rolled: Any,
    restitution: Any,
    hysteresis: Any,
    sliding: Any,
    rolling: Any,
    rebounds: Any,
    max_time: Any,
    *flight: Any,
) -> Any:
    """Program of the end of a hop."""
    fine = _zero(going) & less(0.0, v_n)
    lost = (1.0 - restitution * restitution) * closed
    books = (hysteresis + lost, sliding + slid, rolling + rolled, rebounds + 1.0)
    after = (t, x, b, phi, v_t - b * omega, v_n + a * omega, omega, max_time - t, *books)
    before = (*flight, hysteresis, sliding, rolling, rebounds)
    return lost, where(fine, 1.0, 0.0), *(where(fine, new, old) for new, old in zip(after, before, strict=True))


_SHAPE = (F_RADIUS, F_ECCENTRICITY, F_HALF_ANGLE, F_ALONG, F_ACROSS, F_TOP)
_LAW = (B_FRICTION, B_ARM, B_CORNER_ARM, B_RESTITUTION, B_SETTLE_SPEED)
_SIGNS = (I_SLIP, I_SPIN, I_MU, I_RHO)
_MOVING = (I_V_T, I_OMEGA, I_V_N, I_IMPULSE, I_TANGENTIAL, I_ROLLING, I_CLOSED, I_SLID, I_ROLLED, I_STORED, I_OPENING)
_TOUCHED = (L_T, L_X, L_PHI, L_U, L_V, L_OMEGA, L_FEATURE, L_A, L_B, L_V_T, L_V_N)
_BOOKS = (B_HYSTERESIS, B_SLIDING, B_ROLLING, B_REBOUNDS)
_LANDED = (
    (F_TIME, B_T, B_X, F_Y, F_PHI, B_U, F_V, F_OMEGA, F_DOWNHILL, F_GRAVITY, F_HORIZON, B_LENGTH, *_SHAPE, *_LAW),
    (*_TOUCHED, I_GOING, *_MOVING, *_SIGNS, I_ARM, I_RESTITUTION),
)
_PASSED = (
    (I_GOING, *_MOVING, *_SIGNS, B_PER_MASS, B_PER_INERTIA, L_A, L_B, B_FRICTION, I_ARM, I_RESTITUTION),
    (I_GOING, *_MOVING, *_SIGNS),
)
_MOVED = (B_T, B_X, F_Y, F_PHI, B_U, F_V, F_OMEGA, F_HORIZON)
_LEFT = (
    (
        *(I_GOING, L_T, L_X, L_PHI, L_A, L_B, I_V_T, I_OMEGA, I_V_N, I_CLOSED, I_SLID, I_ROLLED, I_RESTITUTION),
        *_BOOKS,
        B_MAX_TIME,
        *_MOVED,
    ),
    (I_HYSTERESIS, I_FINE, *_MOVED, *_BOOKS),
)
_land_discs, _land_sleds = packed(_landing(False), *_LANDED), packed(_landing(True), *_LANDED)
_pass_phases, _leave_all = packed(_phase, *_PASSED), packed(_leaving, *_LEFT)


@kernel
def signs(
    w: tuple[float, float, float, float], friction: float, arm: float, size: float, slip: float, spin: float
) -> tuple[float, float, float, float]:
    """Return the branch of an impact, signs of slip and spin, and its forces over the normal one.

    Where ``slip`` or ``spin`` is zero the velocity may stay locked, or leave with either sign.
    """
    _, one, other = resolve(w, 0.0, 0.0, friction, arm, size, 1.0, 1.0, -1, int(slip), int(spin))
    mu, rho, _ = branch_forces(w, 0.0, 0.0, friction, arm, 1.0, False, one, other)
    return float(one), float(other), mu, rho


@allocating
def bounce_pack(body: Body) -> np.ndarray:
    """Return a pack of flights of a body, shape (B_ROWS, LANES), for :func:`bounce`."""
    z = table(B_ROWS, LANES)
    tell_body(body, z)
    for k in range(LANES):
        z[B_PER_MASS, k], z[B_PER_INERTIA, k] = 1.0 / body.mass, 1.0 / body.inertia
    return z


@kernel
def _choose(z: np.ndarray, size: float) -> bool:
    """Choose the branch of each impact whose slip or spin is zero; say whether an impact goes on."""
    going = False
    for k in range(LANES):
        if z[I_GOING, k] > 0.0:
            going = True
            if z[I_SLIP, k] == 0.0 or z[I_SPIN, k] == 0.0:
                w = z[B_PER_MASS, k], z[B_PER_INERTIA, k], z[L_A, k], z[L_B, k]
                z[I_SLIP, k], z[I_SPIN, k], z[I_MU, k], z[I_RHO, k] = signs(
                    w, z[B_FRICTION, k], z[I_ARM, k], size, z[I_SLIP, k], z[I_SPIN, k]
                )
    return going


@kernel
def bounce(body: Body, count: int, z: np.ndarray) -> None:
    """Follow the first ``count`` flights of a pack to their next rebound; what is not ordinary stays where it is.

    Parameters
    ----------
    body : Body
    count : int
        FEW to LANES.
    z : ndarray, shape (B_ROWS, LANES)
        From :func:`bounce_pack`, with the state of each flight, its books, slope and law. Afterwards I_FINE tells which
        hops were ordinary, and F_TIME how long each flight was.
    """
    touchdown_times(body, count, z)
    for k in range(count, LANES):
        z[F_TIME, k] = math.inf
    if has_corners(body):
        _land_sleds(z)
    else:
        _land_discs(z)
    size = body.radius + body.eccentricity
    for _ in range(MOST_PHASES - 1):
        if not _choose(z, size):
            break
        _pass_phases(z)
    _leave_all(z)
