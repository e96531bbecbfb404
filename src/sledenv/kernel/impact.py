"""The impact in the stiff limit, exact in the normal impulse: docs/physics.md, section 4.

With the configuration frozen the velocities are linear in the normal impulse p between events (slip, spin or gap rate
reach zero, the impact ends), so the impact is a short list of phases, each in closed form. The programs of a phase
serve a single impact and packs of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import copy_into_callers, straight
from sledenv.compiler.values import absolute, equal, larger, less, not_more, root, sign, sine_cosine, smaller, where
from sledenv.kernel.friction import Bounds, Branch, Drive, Mobility, branch_forces, rates_of, resolve
from sledenv.kernel.state import change, followed_by

ENERGETIC, POISSON, NEWTON = range(3)  # hypotheses of what ends an impact
MOST_PHASES = 32
SIMULTANEOUS = 4e-16  # of a velocity: what is left of it when another one stops may be rounding
LEVEL = 1e-12  # of the size of the body: a corner this close to the slope counts as touching


# Programs of one impact, or of a pack of them.


def _enter(hop: Any, v_t: Any, omega: Any) -> dict[str, Any]:
    """Signs of slip and spin, and the forces that they bring, over the normal one."""
    slip, spin = sign(v_t), sign(omega)
    return {"slip": slip, "spin": spin, "mu": -slip * hop.friction, "rho": -spin * hop.arm}


def begin_impact(hop: Any) -> None:
    """Program of an impact before its first phase; a gap that opens already is no impact."""
    hop.going = where(less(0.0, hop.v_n), 0.0, 1.0)
    hop.normal_impulse = hop.tangential_impulse = hop.rolling_impulse = 0.0
    hop.closed = hop.stored = hop.opening = hop.sliding = hop.rolling = 0.0
    for name, value in _enter(hop, hop.v_t, hop.omega).items():
        setattr(hop, name, value)


def _end(hop: Any, rate_n: Any, opens: Any, hypothesis: int) -> Any:
    """Normal impulse [N s] after which an impact whose gap ``opens`` has given back what it may; inf if never."""
    v_n, restitution = hop.v_n, hop.restitution
    if hypothesis == POISSON:
        first = opens & equal(v_n, 0.0) & equal(hop.compressed, 0.0)
        hop.compressed = where(first, hop.normal_impulse, hop.compressed)
        end = larger((1.0 + restitution) * hop.compressed - hop.normal_impulse, 0.0)
    elif hypothesis == NEWTON:
        target = -restitution * hop.v_n_entry
        end = where(less(0.0, rate_n), (target - v_n) / rate_n, math.inf)
        end = where(not_more(target, v_n), 0.0, end)
    else:
        speed = v_n + root(v_n * v_n + 2.0 * rate_n * hop.stored)
        end = where(less(0.0, speed), 2.0 * hop.stored / speed, math.inf)
    return where(opens, end, math.inf)


def pass_phase(hop: Any, hypothesis: int) -> Any:
    """Program of a phase of an impact that goes on, up to the first event on the way: its end is one of them.

    Returns the normal impulse [N s] of the phase, 0 if there was none.
    """
    v_t, omega, v_n, mu, rho = hop.v_t, hop.omega, hop.v_n, hop.mu, hop.rho
    rate_t, rate_w, rate_n = rates_of(hop, Drive(0.0, 0.0), mu, rho, 1.0)
    rate_t, rate_w = where(equal(hop.slip, 0.0), 0.0, rate_t), where(equal(hop.spin, 0.0), 0.0, rate_w)
    at_rest, repels = equal(v_n, 0.0), less(0.0, rate_n)
    # Over, if it neither approaches nor has anything to give back.
    over = at_rest & (equal(rate_n, 0.0) | (repels & not_more(hop.stored, 0.0)))
    opening = where(at_rest, where(repels, 1.0, 0.0), hop.opening)
    opens = less(0.0, opening)
    end = _end(hop, rate_n, opens, hypothesis)
    span_t = where(less(hop.slip * rate_t, 0.0) & ~equal(v_t, 0.0), -v_t / rate_t, math.inf)
    span_w = where(less(hop.spin * rate_w, 0.0) & ~equal(omega, 0.0), -omega / rate_w, math.inf)
    span_n = where(less(v_n * rate_n, 0.0), -v_n / rate_n, math.inf)
    stopping = smaller(span_t, span_w)
    span = smaller(stopping, smaller(span_n, end))
    # Of events at once the end counts, then slip and spin that stop.
    ends = not_more(end, span)
    turns = less(span_n, stopping) & ~ends
    stops = less(span_w, span_t) & ~turns & ~ends
    sticks = ~stops & ~turns & ~ends
    slip_then, spin_then = where(sticks, 0.0, v_t + rate_t * span), where(stops, 0.0, omega + rate_w * span)
    # Slip and spin that stop together: rounding must not leave a rest of the later one.
    slip_then = where(not_more(absolute(slip_then), SIMULTANEOUS * absolute(v_t)), 0.0, slip_then)
    spin_then = where(not_more(absolute(spin_then), SIMULTANEOUS * absolute(omega)), 0.0, spin_then)
    rate_then = where(turns, 0.0, v_n + rate_n * span)
    work = 0.5 * (v_n + rate_then) * span
    squared = hop.restitution * hop.restitution
    phase = (hop.slip + 1.0) + 3.0 * (hop.spin + 1.0) + 9.0 * opening
    if hypothesis != ENERGETIC:
        hop.opened = where(opens, hop.opened + work, hop.opened)
    going, finite = less(0.0, hop.going), less(span, math.inf)  # or no event ends the phase
    passes = going & ~over & finite
    change(hop, going, going=where(over, 0.0, where(finite, where(ends, 0.0, 1.0), -1.0)))
    change(
        hop,
        passes,
        v_t=slip_then,
        omega=spin_then,
        v_n=rate_then,
        normal_impulse=hop.normal_impulse + span,
        tangential_impulse=hop.tangential_impulse + mu * span,
        rolling_impulse=hop.rolling_impulse + rho * span,
        closed=where(opens, hop.closed, hop.closed - work),
        sliding=hop.sliding - 0.5 * mu * (v_t + slip_then) * span,
        rolling=hop.rolling - 0.5 * rho * (omega + spin_then) * span,
        stored=where(ends, 0.0, larger(hop.stored - where(opens, work, squared * work), 0.0)),
        opening=opening,
        sequence=where(less(0.0, span), followed_by(hop.sequence, phase), hop.sequence),
        **_enter(hop, slip_then, spin_then),
    )
    return where(passes, span, 0.0)


def hysteresis_of(hop: Any, hypothesis: int) -> Any:
    """Program of the loss [J] of an impact by its restitution."""
    if hypothesis == ENERGETIC:
        return (1.0 - hop.restitution * hop.restitution) * hop.closed  # without the cancellation in its two works
    return hop.closed - hop.opened


def softened(restitution: Any, settle_speed: Any, v_n: Any, pressing: Any) -> Any:
    """Program of the restitution of a touch: none of a slow one, if the acceleration ``pressing`` is onto the slope."""
    return where(less(0.0, pressing) & less(-v_n, settle_speed), 0.0, restitution)


def lies_flat(phi: Any, across: Any, size: Any) -> Any:
    """Program of whether both corners touch, if one does."""
    sine, _ = sine_cosine(phi)
    return not_more(2.0 * across * absolute(sine), LEVEL * size)


def _pass_by(hypothesis: int) -> Callable[[Any], None]:
    def program(hop: Any) -> None:
        hop.span = pass_phase(hop, hypothesis)
        hop.hysteresis = hysteresis_of(hop, hypothesis)

    return straight(program)


_begin = straight(begin_impact)
_pass_energetic, _pass_poisson, _pass_newton = _pass_by(ENERGETIC), _pass_by(POISSON), _pass_by(NEWTON)


@kernel
def choose_signs(
    w: Mobility, friction: float, arm: float, size: float, slip: float, spin: float
) -> tuple[float, float, float, float]:
    """Return signs of slip and spin in the next phase of an impact, and its forces over the normal one.

    Where ``slip`` or ``spin`` is zero the velocity may stay locked, or leave with either sign.
    """
    copy_into_callers()
    drive = Drive(0.0, 0.0)
    best = resolve(w, drive, friction, arm, size, Bounds(1.0, 1.0), Branch(-1, int(slip), int(spin)))
    mu, rho, _ = branch_forces(w, drive, friction, arm, 1.0, False, best.slip, best.spin)
    return float(best.slip), float(best.spin), mu, rho


@kernel
def impact(hypothesis: int, hop: np.void, phases: np.ndarray | None) -> int:
    """Follow one impact from touch to separation.

    Parameters
    ----------
    hypothesis : int
        ENERGETIC (Stronge): the normal work of restitution is e^2 times that of compression. POISSON: its impulse is
        e times that of compression. NEWTON: the gap opens e times as fast as it closed.
    hop : record of HOP
        Told ``per_mass``, ``per_inertia`` and ``size`` of the body, arms ``a`` and ``b`` of the contact point,
        ``friction``, rolling ``arm``, ``restitution``, and ``v_t``, ``omega``, ``v_n`` at touch; v_n > 0 is no impact.
        Afterwards it holds those velocities, impulses and losses of the impact.
    phases : ndarray of PHASE, optional
        Filled from the front.

    Returns
    -------
    int
        Number of phases, MOST_PHASES + 1 if they did not suffice.
    """
    copy_into_callers()
    _begin(hop)
    hop["hysteresis"] = hop["opened"] = hop["compressed"] = 0.0
    hop["v_n_entry"] = hop["v_n"]
    count = 0
    for _ in range(2 * MOST_PHASES - 1):
        if hop["going"] == 0.0:
            return count
        if hop["going"] < 0.0 or count == MOST_PHASES:
            break
        if hop["slip"] == 0.0 or hop["spin"] == 0.0:
            w = Mobility(hop["per_mass"], hop["per_inertia"], hop["a"], hop["b"])
            hop["slip"], hop["spin"], hop["mu"], hop["rho"] = choose_signs(
                w, hop["friction"], hop["arm"], hop["size"], hop["slip"], hop["spin"]
            )
        start, slip, spin = hop["normal_impulse"], hop["slip"], hop["spin"]
        if hypothesis == POISSON:
            _pass_poisson(hop)
        elif hypothesis == NEWTON:
            _pass_newton(hop)
        else:
            _pass_energetic(hop)
        if hop["span"] > 0.0:
            if phases is not None:  # noqa: SIM102 - numba drops a branch on this alone when it compiles
                if count < phases.shape[0]:
                    phase = phases[count]
                    phase["start"], phase["impulse"] = start, hop["span"]
                    phase["slip"], phase["spin"] = int(slip), int(spin)
                    phase["restitution"] = 1 if hop["opening"] > 0.0 else 0
            count += 1
    return count if hop["going"] == 0.0 else MOST_PHASES + 1
